//! How far interpolated values are from the truth: samples are left out, found
//! again by interpolation, and compared.
//!
//! The chair's orientation comes at 240 Hz from the IMU and is thinned to
//! 60 Hz: that error is the real one. Other streams come at 60 Hz and are
//! thinned to 30 Hz; the error of a straight line falls with the square of the
//! distance, so that a quarter of it is what rows between 60 Hz samples have.
//! A row that falls on a sample has none.

use std::fmt;

use super::interpolate::{Place, angle_between, unwrap};
use super::{Rule, between, usual_distance};
use crate::read::{ElementKind, Episode, ReadError, Values};

/// Rate to which the IMU is thinned, Hz: that of the other state streams.
const STATE_RATE: f64 = 60.0;

/// Error of one quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct Accuracy {
    /// Stream and column, with the part of a pose.
    pub what: String,
    /// Unit of the error, `m` or `rad`.
    pub unit: &'static str,
    /// Rate of the samples that were kept, Hz.
    pub kept_hz: f64,
    /// Rate of the samples that were compared against, Hz.
    pub truth_hz: f64,
    /// Greatest error.
    pub worst: f64,
    /// Mean error.
    pub mean: f64,
    /// Greatest error expected at the rate of the recorded states.
    pub at_state_rate: f64,
}

impl fmt::Display for Accuracy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (factor, unit) = match self.unit {
            "m" => (1e3, "mm"),
            _ => (1.0_f64.to_degrees(), "deg"),
        };
        write!(
            f,
            "{:<34} {:>5.0} of {:>3.0} Hz kept: worst {:.5} {unit}, mean {:.6} {unit}; between recorded samples <= {:.5} {unit}",
            self.what,
            self.kept_hz,
            self.truth_hz,
            self.worst * factor,
            self.mean * factor,
            self.at_state_rate * factor,
        )
    }
}

/// Errors of poses, orientations and joint angles of an episode.
///
/// # Errors
/// When a column cannot be read.
pub fn accuracy(episode: &Episode) -> Result<Vec<Accuracy>, ReadError> {
    let mut out = Vec::new();
    for (stream, column) in [
        ("pose", "pose"),
        ("object_pose", "pose"),
        ("joint_state", "position"),
        ("imu", "orientation"),
    ] {
        if !episode.has(stream) {
            continue;
        }
        let times = episode.stamps(stream)?;
        let metas = episode.columns(stream)?;
        let Some(meta) = metas.iter().find(|m| m.name == column) else {
            continue;
        };
        if meta.kind != ElementKind::F64 || meta.width() == 0 {
            continue;
        }
        let Values::F64(mut all) = episode.values(meta)? else {
            continue;
        };
        let rule = Rule::of(meta);
        let width = meta.width();
        if rule == Rule::Angle {
            unwrap(&mut all, width);
            // Wheels turn by many turns; the arm is what precision is for.
            let arm: Vec<usize> = (0..width)
                .filter(|&i| meta.names.get(i).is_some_and(|n| n.starts_with("joint_")))
                .collect();
            if !arm.is_empty() {
                let rows = all.chunks_exact(width);
                let kept = rows.flat_map(|r| arm.iter().map(|&i| r[i])).collect();
                out.extend(thinned(
                    &format!("{stream}/{column} (arm)"),
                    rule,
                    &times,
                    kept,
                    arm.len(),
                ));
                continue;
            }
        }
        out.extend(thinned(
            &format!("{stream}/{column}"),
            rule,
            &times,
            all,
            width,
        ));
    }
    Ok(out)
}

/// Compares every left-out sample with what interpolation finds for it.
#[must_use]
pub fn thinned(
    what: &str,
    rule: Rule,
    times: &[u64],
    all: Vec<f64>,
    width: usize,
) -> Vec<Accuracy> {
    let Some(usual) = usual_distance(times).filter(|&d| d > 0) else {
        return Vec::new();
    };
    let rate = 1e9 / usual as f64;
    let step = ((rate / STATE_RATE).round() as usize).max(2);
    let mut kinds = [
        ("", "rad", 0.0_f64, 0.0_f64, 0_usize),
        ("", "rad", 0.0, 0.0, 0),
    ];
    match rule {
        Rule::Pose => {
            kinds[0].0 = ", position";
            kinds[0].1 = "m";
            kinds[1].0 = ", orientation";
        }
        Rule::Linear => kinds[0].1 = "m",
        _ => {}
    }
    for from in (0..times.len().saturating_sub(step)).step_by(step) {
        let to = from + step;
        for left in from + 1..to {
            let span = (times[to] - times[from]) as f64;
            let share = (times[left] - times[from]) as f64 / span;
            let pair = [
                &all[from * width..(from + 1) * width],
                &all[to * width..(to + 1) * width],
            ]
            .concat();
            let mut found = Vec::with_capacity(width);
            between(rule, &pair, width, Place::Between(0, share), &mut found);
            let truth = &all[left * width..(left + 1) * width];
            let mut count = |kind: usize, error: f64| {
                let k = &mut kinds[kind];
                if error.is_finite() {
                    k.2 = k.2.max(error);
                    k.3 += error;
                    k.4 += 1;
                }
            };
            let four = |s: &[f64], at: usize| std::array::from_fn(|k| s[at + k]);
            match rule {
                Rule::Pose => {
                    for (f, t) in found.chunks_exact(7).zip(truth.chunks_exact(7)) {
                        let off: f64 = (0..3).map(|k| (f[k] - t[k]).powi(2)).sum();
                        count(0, off.sqrt());
                        count(1, angle_between(four(f, 3), four(t, 3)));
                    }
                }
                Rule::Quaternion => {
                    for (f, t) in found.chunks_exact(4).zip(truth.chunks_exact(4)) {
                        count(0, angle_between(four(f, 0), four(t, 0)));
                    }
                }
                Rule::Linear | Rule::Angle | Rule::Nearest => {
                    for (f, t) in found.iter().zip(truth) {
                        count(0, (f - t).abs());
                    }
                }
            }
        }
    }
    let kept_hz = rate / step as f64;
    let gain = (kept_hz / STATE_RATE).powi(2).min(1.0);
    kinds
        .into_iter()
        .filter(|k| k.4 > 0)
        .map(|(part, unit, worst, sum, n)| Accuracy {
            what: format!("{what}{part}"),
            unit,
            kept_hz,
            truth_hz: rate,
            worst,
            mean: sum / n as f64,
            at_state_rate: worst * gain,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_a_parabola_is_an_eighth_of_its_curvature_times_the_distance_squared() {
        let times: Vec<u64> = (0..240).map(|i| i * 1_000_000_000 / 60).collect();
        let all: Vec<f64> = times.iter().map(|&t| (t as f64 * 1e-9).powi(2)).collect();
        let found = thinned("x", Rule::Linear, &times, all, 1);
        let expected = 2.0 / 30.0_f64.powi(2) / 8.0;
        assert!((found[0].worst - expected).abs() < 1e-6, "{found:?}");
        assert!((found[0].at_state_rate - expected / 4.0).abs() < 1e-6);
    }
}
