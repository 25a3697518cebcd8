//! Error of interpolated values against recorded ones: samples are left out, interpolated
//! again by interpolation, and compared.
//!
//! The chair's orientation is sampled at 240 Hz from the IMU and is thinned to
//! 60 Hz: that error is the real one. Other streams come at 60 Hz and are
//! thinned to 30 Hz; the error of a straight line falls with the square of the
//! distance, so that a quarter of it is what rows between 60 Hz samples have.
//! That of a cubic falls faster where motion is smooth, and not where something
//! knocks; a quarter is reported there, too. A row at a sample has no error.

use std::fmt;

use super::curve::{Curve, Slopes, only};
use super::interpolate::{angle_between, unwrap};
use super::{Interpolation, Rule, usual_distance};
use crate::read::{ElementKind, Episode, ReadError, Values};

/// Rate to which the IMU is thinned, Hz: that of the other state streams.
const STATE_RATE: f64 = 60.0;

/// Error of one quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct Accuracy {
    /// Stream and column, with the part of a pose.
    pub what: String,
    /// Curve between the samples.
    pub interpolation: Interpolation,
    /// Unit of the error, `m` or `rad`.
    pub unit: &'static str,
    /// Rate of the samples that were kept, Hz.
    pub kept_hz: f64,
    /// Rate of the samples that were compared against, Hz.
    pub truth_hz: f64,
    /// Greatest error.
    pub worst: f64,
    /// Frame, joint or object with the greatest error; empty for a single one.
    pub worst_of: String,
    /// When that was, seconds since the stream's first sample.
    pub worst_at: f64,
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
        let by = match self.interpolation {
            Interpolation::Linear => "linear",
            Interpolation::Hermite => "hermite",
        };
        write!(
            f,
            "{:<34} {by:<7} {:>5.0} of {:>3.0} Hz kept: worst {:.5} {unit} ({}{}{:.2} s), mean {:.6} {unit}; between recorded samples <= {:.5} {unit}",
            self.what,
            self.kept_hz,
            self.truth_hz,
            self.worst * factor,
            self.worst_of,
            if self.worst_of.is_empty() { "" } else { ", " },
            self.worst_at,
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
        let rule = Rule::for_column(meta);
        let mut width = meta.width();
        let mut slopes = Slopes::of(episode, meta)?;
        let mut what = format!("{stream}/{column}");
        let mut names = meta.names.clone();
        if rule == Rule::Angle {
            unwrap(&mut all, width);
            // Wheels turn by many turns; precision matters for the arm.
            let arm: Vec<usize> = (0..width)
                .filter(|&i| meta.names.get(i).is_some_and(|n| n.starts_with("joint_")))
                .collect();
            if !arm.is_empty() {
                all = only(&all, &arm, width);
                slopes = slopes.map(|s| s.only(&arm, width));
                width = arm.len();
                names = arm.iter().filter_map(|&i| names.get(i).cloned()).collect();
                what.push_str(" (arm)");
            }
        }
        let straight = Curve {
            rule,
            width,
            slopes: None,
        };
        out.extend(thinned(&what, &names, straight, &times, &all));
        if slopes.is_some() {
            let cubic = Curve {
                slopes: slopes.as_ref(),
                ..straight
            };
            out.extend(thinned(&what, &names, cubic, &times, &all));
        }
    }
    Ok(out)
}

/// Errors of one quantity while they are counted.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    worst: f64,
    worst_of: usize,
    worst_at: u64,
    sum: f64,
    count: usize,
}

impl Errors {
    fn add(&mut self, error: f64, of: usize, at: u64) {
        if !error.is_finite() {
            return;
        }
        if error > self.worst {
            (self.worst, self.worst_of, self.worst_at) = (error, of, at);
        }
        self.sum += error;
        self.count += 1;
    }
}

/// Compares every left-out sample with its interpolated value.
fn thinned(
    what: &str,
    names: &[String],
    curve: Curve<'_>,
    times: &[u64],
    all: &[f64],
) -> Vec<Accuracy> {
    let Curve { rule, width, .. } = curve;
    let Some(usual) = usual_distance(times).filter(|&d| d > 0) else {
        return Vec::new();
    };
    let rate = 1e9 / usual as f64;
    let step = ((rate / STATE_RATE).round() as usize).max(2);
    let kinds = match rule {
        Rule::Pose => [(", position", "m"), (", orientation", "rad")],
        Rule::Linear => [("", "m"), ("", "rad")],
        _ => [("", "rad"), ("", "rad")],
    };
    let mut errors = [Errors::default(); 2];
    let mut found = Vec::with_capacity(width);
    for from in (0..times.len().saturating_sub(step)).step_by(step) {
        let to = from + step;
        for left in from + 1..to {
            let span = (times[to] - times[from]) as f64;
            let share = (times[left] - times[from]) as f64 / span;
            found.clear();
            curve.between(times, all, (from, to), share, &mut found);
            let truth = &all[left * width..(left + 1) * width];
            let at = times[left] - times[0];
            let four = |s: &[f64], at: usize| std::array::from_fn(|k| s[at + k]);
            match rule {
                Rule::Pose => {
                    let poses = found.chunks_exact(7).zip(truth.chunks_exact(7));
                    for (i, (f, t)) in poses.enumerate() {
                        let off: f64 = (0..3).map(|k| (f[k] - t[k]).powi(2)).sum();
                        errors[0].add(off.sqrt(), i, at);
                        errors[1].add(angle_between(four(f, 3), four(t, 3)), i, at);
                    }
                }
                Rule::Quaternion => {
                    let poses = found.chunks_exact(4).zip(truth.chunks_exact(4));
                    for (i, (f, t)) in poses.enumerate() {
                        errors[0].add(angle_between(four(f, 0), four(t, 0)), i, at);
                    }
                }
                Rule::Linear | Rule::Angle | Rule::Nearest => {
                    for (i, (f, t)) in found.iter().zip(truth).enumerate() {
                        errors[0].add((f - t).abs(), i, at);
                    }
                }
            }
        }
    }
    let kept_hz = rate / step as f64;
    let gain = (kept_hz / STATE_RATE).powi(2).min(1.0);
    kinds
        .into_iter()
        .zip(errors)
        .filter(|(_, e)| e.count > 0)
        .map(|((part, unit), e)| Accuracy {
            what: format!("{what}{part}"),
            interpolation: if curve.slopes.is_some() {
                Interpolation::Hermite
            } else {
                Interpolation::Linear
            },
            unit,
            kept_hz,
            truth_hz: rate,
            worst: e.worst,
            worst_of: names.get(e.worst_of).cloned().unwrap_or_default(),
            worst_at: e.worst_at as f64 * 1e-9,
            mean: e.sum / e.count as f64,
            at_state_rate: e.worst * gain,
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
        let line = Curve {
            rule: Rule::Linear,
            width: 1,
            slopes: None,
        };
        let found = thinned("x", &[], line, &times, &all);
        let expected = 2.0 / 30.0_f64.powi(2) / 8.0;
        assert!((found[0].worst - expected).abs() < 1e-6, "{found:?}");
        assert!((found[0].at_state_rate - expected / 4.0).abs() < 1e-6);
    }
}
