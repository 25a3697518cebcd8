//! Values of a column between two of its samples, from its metadata and
//! by its recorded velocities on request.

use clap::ValueEnum;

use super::hermite::{Axes, cubic, turn};
use super::interpolate::{Place, linear, slerp};
use crate::read::{ColumnMeta, ElementKind, Episode, ReadError, Values};

/// Curve between two samples of a continuous motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Interpolation {
    /// Straight lines and great arcs, as in the paper.
    Linear,
    /// Cubics with the recorded velocities for the robot's own motion, the rest
    /// as linear.
    #[default]
    Hermite,
}

/// How the values of a column are interpolated between samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// Straight line.
    Linear,
    /// Straight line of the unwrapped angle.
    Angle,
    /// Position linear, orientation by slerp.
    Pose,
    /// Slerp.
    Quaternion,
    /// The nearest sample.
    Nearest,
}

impl Rule {
    /// The rule in a word, as files name it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Angle => "linear, unwrapped",
            Self::Pose => "linear and slerp",
            Self::Quaternion => "slerp",
            Self::Nearest => "nearest",
        }
    }

    /// The rule of a column by its metadata.
    #[must_use]
    pub fn for_column(meta: &ColumnMeta) -> Self {
        // Commands and lists of contacts jump; there is nothing between two of them.
        let jumps = match meta.stream.as_str() {
            "command" | "evaluation" => true,
            "applied" => matches!(meta.name.as_str(), "arm" | "base" | "gripper"),
            "contact" => meta.name != "pad_force",
            // Infinite where nothing is met; a straight line between two surfaces is none.
            "scan" | "sensed_scan" => true,
            _ => false,
        };
        if meta.kind != ElementKind::F64 || jumps {
            Self::Nearest
        } else if meta.components == ["x", "y", "z", "qx", "qy", "qz", "qw"] {
            Self::Pose
        } else if meta.components == ["x", "y", "z", "w"] {
            Self::Quaternion
        } else if meta.units == "rad" {
            Self::Angle
        } else {
            Self::Linear
        }
    }
}

/// The recorded velocities of a column.
#[derive(Clone, Debug)]
pub(crate) struct Slopes {
    values: Vec<f64>,
    axes: Axes,
}

impl Slopes {
    /// Those of `meta`; `None` for a column whose velocity is not recorded, or
    /// in other axes than its position.
    pub(crate) fn of(episode: &Episode, meta: &ColumnMeta) -> Result<Option<Self>, ReadError> {
        let (column, axes) = match (meta.stream.as_str(), meta.name.as_str()) {
            // Not objects: knocks between two samples and the jitter of objects
            // at rest make their velocities useless.
            ("pose", "pose") => ("twist", Axes::Parent),
            ("joint_state", "position") => ("velocity", Axes::Parent),
            ("imu", "orientation") => ("angular_velocity", Axes::Body),
            _ => return Ok(None),
        };
        let metas = episode.columns(&meta.stream)?;
        let Some(slope) = metas.iter().find(|m| m.name == column) else {
            return Ok(None);
        };
        let width = match Rule::for_column(meta) {
            Rule::Pose => meta.width() / 7 * 6,
            Rule::Quaternion => 3,
            _ => meta.width(),
        };
        if slope.width() != width || slope.count != meta.count {
            return Ok(None);
        }
        Ok(match episode.values(slope)? {
            Values::F64(values) => Some(Self { values, axes }),
            _ => None,
        })
    }

    /// The velocities of some of the `width` angles of a row.
    pub(crate) fn only(&self, which: &[usize], width: usize) -> Self {
        Self {
            values: only(&self.values, which, width),
            axes: self.axes,
        }
    }
}

/// Some of the `width` numbers of every row.
pub(crate) fn only(all: &[f64], which: &[usize], width: usize) -> Vec<f64> {
    let rows = all.chunks_exact(width);
    rows.flat_map(|row| which.iter().map(|&i| row[i])).collect()
}

/// How values of `width` numbers are interpolated.
#[derive(Clone, Copy)]
pub(crate) struct Curve<'a> {
    pub rule: Rule,
    pub width: usize,
    pub slopes: Option<&'a Slopes>,
}

impl Curve<'_> {
    /// Appends the values at a place among samples.
    pub(crate) fn append(self, times: &[u64], all: &[f64], at: Place, out: &mut Vec<f64>) {
        match at {
            Place::At(i) => out.extend_from_slice(&all[i * self.width..(i + 1) * self.width]),
            Place::Between(i, share) => self.between(times, all, (i, i + 1), share, out),
            Place::Outside => out.extend(std::iter::repeat_n(f64::NAN, self.width)),
        }
    }

    /// Appends the values at a share of the way from sample `i` to sample `j`.
    pub(crate) fn between(
        self,
        times: &[u64],
        all: &[f64],
        (i, j): (usize, usize),
        share: f64,
        out: &mut Vec<f64>,
    ) {
        let row = |i: usize| &all[i * self.width..(i + 1) * self.width];
        // Numbers of one pose, index of its quaternion, and numbers of its velocity.
        let (step, straight, turning) = match self.rule {
            Rule::Pose => (7, 3, true),
            Rule::Quaternion => (4, 0, true),
            Rule::Linear | Rule::Angle | Rule::Nearest => (1, 1, false),
        };
        let speeds = straight + if turning { 3 } else { 0 };
        let span = (times[j] - times[i]) as f64 * 1e-9;
        let quaternions = row(i).chunks_exact(step).zip(row(j).chunks_exact(step));
        for (index, (a, b)) in quaternions.enumerate() {
            let slopes = self.slopes.and_then(|slopes| {
                let width = self.width / step * speeds;
                let of = |i: usize| {
                    let from = i * width + index * speeds;
                    slopes.values.get(from..from + speeds)
                };
                let (va, vb) = (of(i)?, of(j)?);
                let known = va.iter().chain(vb).all(|v| v.is_finite());
                known.then_some((va, vb, slopes.axes))
            });
            let four = |s: &[f64]| std::array::from_fn(|k| s[straight + k]);
            let three = |s: &[f64]| std::array::from_fn(|k| s[straight + k]);
            match slopes {
                Some((va, vb, axes)) => {
                    out.extend(
                        (0..straight).map(|k| cubic([a[k], b[k]], [va[k], vb[k]], span, share)),
                    );
                    if turning {
                        let ends = [four(a), four(b)];
                        out.extend(turn(ends, [three(va), three(vb)], axes, span, share));
                    }
                }
                None => {
                    out.extend((0..straight).map(|k| linear(a[k], b[k], share)));
                    if turning {
                        out.extend(slerp(four(a), four(b), share));
                    }
                }
            }
        }
    }
}
