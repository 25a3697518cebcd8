//! Intervals of shares and a test of pairs.

/// 97.5 % quantile of the normal distribution.
const QUANTILE: f64 = 1.959_963_984_540_054;
/// Share beyond either end of an interval.
const TAIL: f64 = 0.025;
/// Halvings of an interval: beyond the precision of an f64.
const HALVINGS: usize = 200;

/// Wilson's score interval of a share at 95 %; from 0 to 1 without trials.
#[must_use]
pub fn wilson(successes: usize, trials: usize) -> [f64; 2] {
    if trials == 0 {
        return [0.0, 1.0];
    }
    let (n, p) = (trials as f64, successes as f64 / trials as f64);
    let z = QUANTILE * QUANTILE / n;
    let middle = (p + z / 2.0) / (1.0 + z);
    let half = (z * p * (1.0 - p) + z * z / 4.0).sqrt() / (1.0 + z);
    [(middle - half).max(0.0), (middle + half).min(1.0)]
}

/// Clopper and Pearson's exact interval of a share at 95 %: never too narrow.
/// From 0 to 1 without trials.
#[must_use]
pub fn clopper_pearson(successes: usize, trials: usize) -> [f64; 2] {
    if trials == 0 {
        return [0.0, 1.0];
    }
    let low = match successes {
        0 => 0.0,
        // So small that as many or more come with the probability of a tail.
        k => root(|p| at_least(k, trials, p) >= TAIL),
    };
    let high = match trials - successes {
        0 => 1.0,
        failures => 1.0 - root(|q| at_least(failures, trials, q) >= TAIL),
    };
    [low, high]
}

/// McNemar's exact test of pairs, two-sided: how likely such a difference is, or a
/// greater one, where both are equally good. `one` and `other` count the pairs in which
/// only the one, only the other succeeded.
#[must_use]
pub fn mcnemar(one: usize, other: usize) -> f64 {
    let (all, fewer) = (one + other, one.min(other));
    (2.0 * (1.0 - at_least(fewer + 1, all, 0.5))).min(1.0)
}

/// Where a condition that holds from some place on begins, 0 to 1.
fn root(holds: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..HALVINGS {
        let middle = f64::midpoint(low, high);
        if holds(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    f64::midpoint(low, high)
}

/// Probability of `k` or more successes in `n` trials of probability `p`.
fn at_least(k: usize, n: usize, p: f64) -> f64 {
    if k == 0 {
        return 1.0;
    }
    if k > n || p <= 0.0 {
        return 0.0;
    }
    if p >= 1.0 {
        return 1.0;
    }
    // Logarithms, since single terms may be too small for an f64.
    let odds = (p / (1.0 - p)).ln();
    let mut term = n as f64 * (1.0 - p).ln();
    let (mut below, mut above) = (0.0, 0.0);
    for i in 0..=n {
        if i < k {
            below += term.exp();
        } else {
            above += term.exp();
        }
        term += ((n - i) as f64 / (i + 1) as f64).ln() + odds;
    }
    // The sum of few terms is the more exact one.
    if above < below { above } else { 1.0 - below }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilsons_interval_has_the_values_of_the_textbook() {
        // Roots of (p - k/n)² = z² p (1 - p) / n by bisection.
        for (successes, trials, low, high) in [
            (0, 10, 0.000000000000, 0.277532799863),
            (3, 4, 0.300641842582, 0.954412739190),
            (48, 50, 0.865399093125, 0.988961115672),
            (50, 50, 0.928652400867, 1.000000000000),
            (199, 200, 0.972226295602, 0.999116831284),
        ] {
            let [a, b] = wilson(successes, trials);
            assert!((a - low).abs() < 1e-9 && (b - high).abs() < 1e-9, "{a} {b}");
        }
    }

    #[test]
    fn the_exact_interval_and_test_have_scipys_values() {
        // scipy.stats.beta.ppf(0.025, k, n - k + 1) and (0.975, k + 1, n - k).
        for (successes, trials, low, high) in [
            (0, 10, 0.000000000000, 0.308497107819),
            (3, 4, 0.194120449683, 0.993690536790),
            (48, 50, 0.862862374396, 0.995118566574),
            (50, 50, 0.928878263536, 1.000000000000),
            (120, 200, 0.528535672797, 0.668453736264),
            (199, 200, 0.972458101543, 0.999873418972),
            (1, 1000, 0.000025317487, 0.005558924280),
            (1500, 3000, 0.481948769327, 0.518051230673),
        ] {
            let [a, b] = clopper_pearson(successes, trials);
            assert!(
                (a - low).abs() < 1e-9 && (b - high).abs() < 1e-9,
                "{successes} of {trials}: {a} {b}"
            );
        }
        // scipy.stats.binomtest(min(b, c), b + c, 0.5).pvalue.
        for (one, other, p) in [
            (0, 0, 1.000000000000),
            (1, 0, 1.000000000000),
            (5, 5, 1.000000000000),
            (3, 12, 0.035156250000),
            (0, 20, 0.000001907349),
            (40, 70, 0.005447429511),
            (200, 260, 0.005883922473),
        ] {
            let found = mcnemar(one, other);
            assert!((found - p).abs() < 1e-9, "{one} {other}: {found}");
        }
    }
}
