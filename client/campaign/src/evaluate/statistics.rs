//! Intervals of shares, a test of pairs, quantiles, and a bootstrap of means.

use crate::episode_seed::mixed;

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
    // As likely as the fewer or less, and without a difference that cancels.
    let (all, more) = (one + other, one.max(other));
    (2.0 * at_least(more, all, 0.5)).min(1.0)
}

/// Quantiles at `shares`, 0 to 1, between neighbours in proportion (as numpy's usual
/// ones); `None` without values.
#[must_use]
pub fn quantiles<const N: usize>(values: &[f64], shares: [f64; N]) -> Option<[f64; N]> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    Some(shares.map(|share| {
        let place = share * last as f64;
        let (below, above) = (place.floor() as usize, place.ceil() as usize);
        sorted[below] + (place - below as f64) * (sorted[above] - sorted[below])
    }))
}

/// Mean; 0 without values.
#[must_use]
pub fn mean(values: &[f64]) -> f64 {
    // The sum of no numbers is -0.
    let sum = values.iter().sum::<f64>() + 0.0;
    sum / values.len().max(1) as f64
}

/// Samples of a bootstrap.
const RESAMPLES: u64 = 10_000;

/// Interval of the mean at 95 %: percentiles of the means of resampled values.
/// Deterministic for the same values.
#[must_use]
pub fn bootstrap(values: &[f64]) -> [f64; 2] {
    let count = values.len() as u64;
    if count == 0 {
        return [f64::NEG_INFINITY, f64::INFINITY];
    }
    let sample = |resample: u64| {
        let sampled = (0..count).map(|i| mixed(mixed(resample) ^ i) % count);
        sampled.map(|at| values[at as usize]).sum::<f64>() / count as f64
    };
    let means: Vec<f64> = (0..RESAMPLES).map(sample).collect();
    quantiles(&means, [TAIL, 1.0 - TAIL]).unwrap_or_default()
}

/// Interval at 95 % of the ratio of two sums over pairs, the second number of each over the
/// first: percentiles over resampled pairs. Resamples whose first numbers are all 0 have no
/// ratio and are left out; `None` when all do. Deterministic for the same pairs.
#[must_use]
pub fn ratio_bootstrap(pairs: &[(f64, f64)]) -> Option<[f64; 2]> {
    let count = pairs.len() as u64;
    let ratio = |resample: u64| {
        let sampled = (0..count).map(|i| mixed(mixed(resample) ^ i) % count);
        let (below, above) = sampled.fold((0.0, 0.0), |(below, above), at| {
            let (one, other) = pairs[at as usize];
            (below + one, above + other)
        });
        (below > 0.0).then(|| above / below)
    };
    let ratios: Vec<f64> = (0..RESAMPLES).filter_map(ratio).collect();
    quantiles(&ratios, [TAIL, 1.0 - TAIL])
}

/// Point from which a monotone condition holds, 0 to 1.
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
    fn intervals_and_tests_are_those_of_scipy_and_statsmodels() {
        // Written by tests/python/intervals.py.
        let lines = include_str!("intervals.csv").lines().skip(1);
        let mut counts = [0; 3];
        for line in lines {
            let cells: Vec<&str> = line.split(',').collect();
            let whole = |i: usize| cells[i].parse::<usize>().unwrap();
            let real = |i: usize| cells[i].parse::<f64>().unwrap();
            let (a, b) = (whole(1), whole(2));
            let (which, found) = match cells[0] {
                "wilson" => (0, wilson(a, b)),
                "clopper_pearson" => (1, clopper_pearson(a, b)),
                "mcnemar" => (2, [mcnemar(a, b), 0.0]),
                other => panic!("{other}"),
            };
            counts[which] += 1;
            for (found, wanted) in found.into_iter().zip([real(3), real(4)]) {
                let near = 1e-9 * wanted.max(1e-3);
                assert!((found - wanted).abs() < near, "{line}: {found}");
            }
        }
        assert_eq!(counts, [100, 100, 196]);
        // 2 * 0.5^60, where a difference from 1 would be 0.
        assert!((mcnemar(60, 0) / 0.5_f64.powi(59) - 1.0).abs() < 1e-9);
        assert!((mcnemar(2, 55) / 2.295_386_1e-14 - 1.0).abs() < 1e-7);
    }

    #[test]
    fn ratio_bootstrap_agrees_with_every_resample_and_with_the_normal_approximation() {
        // All 4^4 equally likely resamples of four pairs; those of the third alone have no ratio.
        let four = [(1.0, 1.0), (1.0, 0.0), (0.0, 0.0), (1.0, 1.0)];
        let mut exact = Vec::new();
        for code in 0..256_usize {
            let sampled = (0..4).map(|i| four[(code >> (2 * i)) & 3]);
            let (one, other) = sampled.fold((0.0, 0.0), |(a, b), (c, d)| (a + c, b + d));
            exact.extend((one > 0.0).then(|| other / one));
        }
        let exact = quantiles(&exact, [TAIL, 1.0 - TAIL]).unwrap();
        assert_eq!(ratio_bootstrap(&four), Some(exact));
        // 80 successes of 120, of which 40 are kept, and 10 new ones: 0.625. The delta method:
        // sum of (other - ratio * one)^2 = 40 * 0.375^2 + 40 * 0.625^2 + 10 = 31.25, so the
        // standard error is sqrt(31.25) / 80 = 0.0699.
        let pairs: Vec<(f64, f64)> = (0..120)
            .map(|i| match i {
                0..40 => (1.0, 1.0),
                40..80 => (1.0, 0.0),
                80..90 => (0.0, 1.0),
                _ => (0.0, 0.0),
            })
            .collect();
        let [low, high] = ratio_bootstrap(&pairs).unwrap();
        assert!((low - (0.625 - 1.96 * 0.0699)).abs() < 0.015, "{low}");
        assert!((high - (0.625 + 1.96 * 0.0699)).abs() < 0.015, "{high}");
        assert_eq!(ratio_bootstrap(&[(1.0, 1.0); 9]), Some([1.0, 1.0]));
        assert_eq!(ratio_bootstrap(&[(0.0, 1.0); 9]), None);
        assert_eq!(ratio_bootstrap(&[]), None);
    }

    #[test]
    fn quantiles_are_numpys_and_a_bootstrap_covers_the_mean() {
        // numpy.quantile([3, 1, 4, 1, 5], [0, 0.25, 0.5, 0.9, 1]).
        let found = quantiles(&[3.0, 1.0, 4.0, 1.0, 5.0], [0.0, 0.25, 0.5, 0.9, 1.0]).unwrap();
        for (found, wanted) in found.into_iter().zip([1.0, 1.0, 3.0, 4.6, 5.0]) {
            assert!((found - wanted).abs() < 1e-12, "{found} {wanted}");
        }
        assert_eq!(quantiles(&[], [0.5]), None);
        assert!(mean(&[]).is_sign_positive());
        let values: Vec<f64> = (0..100).map(|i| f64::from(i % 5) * 20.0).collect();
        let [low, high] = bootstrap(&values);
        // The standard error is 28.28 / 10.
        let half = 1.96 * 2.828;
        assert!((low - (40.0 - half)).abs() < 0.5, "{low}");
        assert!((high - (40.0 + half)).abs() < 0.5, "{high}");
        assert_eq!(bootstrap(&values), [low, high]);
        assert_eq!(bootstrap(&[7.0; 9]), [7.0, 7.0]);
    }
}
