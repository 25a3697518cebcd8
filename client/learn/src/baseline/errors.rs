//! Errors of predictions, and of naive predictors.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::columns::{OUTPUTS, QUATERNIONS, Trial, degrees};

/// Windows of a batch, over which the paper's tables compute their minimum and maximum.
pub const BATCH: usize = 16;
/// Resamples of a bootstrap.
const RESAMPLES: usize = 2000;

/// Predictions for windows of trials: by trial, in the order of their last rows.
pub type Predictions = Vec<Vec<[f32; OUTPUTS]>>;

/// Errors of one predictor at one time ahead.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Errors {
    /// Mean absolute error of each output.
    pub mae: [f64; OUTPUTS],
    /// Mean squared error of each output.
    pub mse: [f64; OUTPUTS],
    /// Least and greatest mean absolute error of a trial.
    pub mae_of_trials: [[f64; 2]; OUTPUTS],
    /// Least and greatest mean absolute error of a batch of 16 windows in a row.
    pub mae_of_batches: [[f64; 2]; OUTPUTS],
    /// Mean angle between predicted and true rotation of hand and chair, degrees.
    pub degrees: [f64; 2],
    /// Mean absolute errors by trial.
    #[serde(skip)]
    pub by_trial: Vec<[f64; OUTPUTS]>,
}

/// True outputs `ahead` rows after the last row of each window.
#[must_use]
pub fn truth(trials: &[Trial], length: usize, ahead: usize, longest: usize) -> Predictions {
    let of = |trial: &Trial| {
        let last = lasts(trial, length, longest);
        last.map(|row| trial.outputs[row + ahead]).collect()
    };
    trials.iter().map(of).collect()
}

/// Last rows of the windows of a trial.
pub fn lasts(trial: &Trial, length: usize, longest: usize) -> std::ops::Range<usize> {
    let end = trial.outputs.len().saturating_sub(longest);
    length - 1..end.max(length - 1)
}

/// Naive predictor: repeats the outputs of the last row.
#[must_use]
pub fn repeated(trials: &[Trial], length: usize, longest: usize) -> Predictions {
    let of = |trial: &Trial| {
        let last = lasts(trial, length, longest);
        last.map(|row| trial.outputs[row]).collect()
    };
    trials.iter().map(of).collect()
}

/// Naive predictor: continues the last change.
#[must_use]
pub fn extrapolated(trials: &[Trial], length: usize, ahead: usize, longest: usize) -> Predictions {
    let of = |trial: &Trial| {
        let last = lasts(trial, length, longest);
        last.map(|row| {
            let (now, before) = (trial.outputs[row], trial.outputs[row.max(1) - 1]);
            std::array::from_fn(|i| now[i] + ahead as f32 * (now[i] - before[i]))
        })
        .collect()
    };
    trials.iter().map(of).collect()
}

/// Errors of predictions against the truth.
#[must_use]
pub fn errors(found: &Predictions, truth: &Predictions) -> Errors {
    let each = |of: &dyn Fn(f64) -> f64, part: &[([f32; OUTPUTS], [f32; OUTPUTS])]| {
        let mut sums = [0.0; OUTPUTS];
        for (a, b) in part {
            for (i, sum) in sums.iter_mut().enumerate() {
                *sum += of(f64::from(a[i]) - f64::from(b[i]));
            }
        }
        sums.map(|sum: f64| sum / part.len().max(1) as f64)
    };
    let by_trial: Vec<Vec<_>> = found
        .iter()
        .zip(truth)
        .map(|(a, b)| a.iter().copied().zip(b.iter().copied()).collect())
        .filter(|trial: &Vec<_>| !trial.is_empty())
        .collect();
    let all: Vec<_> = by_trial.concat();
    let absolute: &dyn Fn(f64) -> f64 = &f64::abs;
    let trials: Vec<_> = by_trial.iter().map(|part| each(absolute, part)).collect();
    let batches = by_trial.iter().flat_map(|trial| trial.chunks(BATCH));
    let batches: Vec<_> = batches.map(|part| each(absolute, part)).collect();
    let turned = QUATERNIONS.map(|at| {
        let angles = all
            .iter()
            .map(|(a, b)| degrees(&a[at..at + 4], &b[at..at + 4]));
        angles.sum::<f64>() / all.len().max(1) as f64
    });
    Errors {
        mae: each(absolute, &all),
        mse: each(&|e| e * e, &all),
        mae_of_trials: extremes(&trials),
        mae_of_batches: extremes(&batches),
        degrees: turned,
        by_trial: trials,
    }
}

fn extremes(rows: &[[f64; OUTPUTS]]) -> [[f64; 2]; OUTPUTS] {
    std::array::from_fn(|i| {
        let values = rows.iter().map(|row| row[i]);
        let least = values.clone().fold(f64::INFINITY, f64::min);
        [least, values.fold(f64::NEG_INFINITY, f64::max)]
    })
}

/// Skill of a predictor: 1 - MAE / MAE of the better naive predictor; with its 95 % bootstrap
/// interval over trials (with a seed). `None` when the naive error is 0.
#[must_use]
pub fn skill(of: &Errors, trivial: &[&Errors], output: usize) -> Option<[f64; 3]> {
    let trials = of.by_trial.len();
    let at = |errors: &Errors, samples: &[usize]| -> f64 {
        let sum: f64 = samples.iter().map(|t| errors.by_trial[*t][output]).sum();
        sum / samples.len().max(1) as f64
    };
    let skill_over = |samples: &[usize]| {
        let best = trivial.iter().map(|errors| at(errors, samples));
        let best = best.fold(f64::INFINITY, f64::min);
        (best > 1e-9).then(|| 1.0 - at(of, samples) / best)
    };
    let all: Vec<usize> = (0..trials).collect();
    let value = skill_over(&all)?;
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let mut samples: Vec<f64> = (0..RESAMPLES)
        .filter_map(|_| {
            let again: Vec<usize> = (0..trials)
                .map(|_| random.random_range(0..trials))
                .collect();
            skill_over(&again)
        })
        .collect();
    samples.sort_by(f64::total_cmp);
    let quantile = |q: f64| {
        samples
            .get(((samples.len() as f64 - 1.0) * q).round() as usize)
            .copied()
    };
    Some([value, quantile(0.025)?, quantile(0.975)?])
}

#[cfg(test)]
mod tests {
    use super::super::columns::tests::moving_trial;
    use super::*;

    #[test]
    fn errors_equal_hand_computed_ones() {
        // The chair moves 0.1 m a row: two rows ahead, repeating has an error of 0.2 m,
        // extrapolating none.
        let trials = vec![moving_trial(1, 12, 0.1), moving_trial(2, 30, 0.3)];
        let truth = truth(&trials, 5, 2, 2);
        assert_eq!([truth[0].len(), truth[1].len()], [6, 24]);
        let repeated = errors(&repeated(&trials, 5, 2), &truth);
        let wanted = (6.0 * 0.2 + 24.0 * 0.6) / 30.0;
        assert!(
            (repeated.mae[7] - wanted).abs() < 1e-5,
            "{}",
            repeated.mae[7]
        );
        let square = (6.0 * 0.04 + 24.0 * 0.36) / 30.0;
        assert!((repeated.mse[7] - square).abs() < 1e-5);
        let [least, most] = repeated.mae_of_trials[7];
        assert!((least - 0.2).abs() < 1e-5 && (most - 0.6).abs() < 1e-5);
        // The hand turns by 0.02 rad a row.
        assert!((repeated.degrees[0] - 0.04_f64.to_degrees()).abs() < 1e-2);
        let on = errors(&extrapolated(&trials, 5, 2, 2), &truth);
        assert!(on.mae[7] < 1e-5, "{}", on.mae[7]);
    }

    #[test]
    fn batch_is_sixteen_windows_of_one_trial() {
        let truth: Predictions = vec![vec![[0.0; OUTPUTS]; 20]];
        let mut found = truth.clone();
        found[0][19] = [4.0; OUTPUTS];
        let errors = errors(&found, &truth);
        assert_eq!(errors.mae_of_batches[0], [0.0, 1.0]);
        assert_eq!(errors.mae_of_trials[0], [0.2, 0.2]);
    }

    #[test]
    fn skill_is_relative_to_the_better_naive_predictor() {
        let of = |mae: &[f64]| {
            let mut errors = errors(&vec![], &vec![]);
            errors.by_trial = mae.iter().map(|m| [*m; OUTPUTS]).collect();
            errors
        };
        let (good, one, other) = (of(&[0.1, 0.3]), of(&[0.4, 0.4]), of(&[2.0, 2.0]));
        let [value, low, high] = skill(&good, &[&one, &other], 0).unwrap();
        assert!((value - 0.5).abs() < 1e-12);
        assert!(
            (low - 0.25).abs() < 1e-12 && (high - 0.75).abs() < 1e-12,
            "{low} {high}"
        );
        assert!(skill(&good, &[&of(&[0.0, 0.0])], 0).is_none());
    }
}
