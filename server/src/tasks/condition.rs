//! Interface of a condition of a task: it names scene parts, has thresholds and
//! measures one snapshot.
//!
//! [`Predicate`] has no default methods, so an incomplete implementation does not
//! compile. Durations and past violations are kept in the [`Memory`], so that a saved
//! evaluation resumes as if it had not been interrupted.

use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};
use wheelarm_proto::PHYSICS_HZ;

use super::context::Context;
use super::failure::Failure;
use crate::snapshot::Snapshot;

/// A condition of the world: plain data with its thresholds.
pub(super) trait Predicate {
    /// Its name in a task file.
    fn word(&self) -> &'static str;

    /// Its subjects, in the order of its label.
    fn names(&self) -> Vec<Name<'_>>;

    /// Its thresholds, as in the task file.
    fn thresholds(&self) -> Vec<Threshold>;

    /// The failure that follows when the predicate stops holding and can never hold
    /// again; `None` otherwise.
    fn loss(&self) -> Option<Failure>;

    /// Measures one snapshot; `None` when its subject does not exist, which counts as
    /// not holding.
    fn measure(
        &self,
        context: &Context,
        memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Option<Measure>;
}

/// A scene part named by a condition or a goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Name<'a> {
    /// An object, or the sampled target.
    Object(&'a str),
    /// Furniture, for its first surface.
    Surface(&'a str),
    /// A joint of furniture.
    Joint(&'a str),
}

impl<'a> Name<'a> {
    /// The name alone.
    pub(super) fn text(self) -> &'a str {
        let (Self::Object(text) | Self::Surface(text) | Self::Joint(text)) = self;
        text
    }
}

/// A number of a task file between 0 and `most`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Threshold {
    /// Key in the task file.
    pub key: &'static str,
    /// Value in the file.
    pub value: f64,
    /// Unit in the file.
    pub unit: &'static str,
    /// Largest sensible value.
    pub most: f64,
}

impl Threshold {
    pub(super) fn new(key: &'static str, value: f64, unit: &'static str, most: f64) -> Self {
        Self {
            key,
            value,
            unit,
            most,
        }
    }
}

/// What a predicate says about one snapshot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Measure {
    /// SI.
    pub value: f64,
    /// Whether it holds now.
    pub holds: bool,
}

/// What a predicate remembers from one tick to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Memory {
    /// Tick since which the condition has held without a break.
    since: Option<u64>,
    /// Greatest value so far.
    pub worst: f64,
    /// Whether a limit has ever been exceeded.
    pub exceeded: bool,
    /// Tick and pose of the previous measurement.
    before: Option<(u64, Isometry3<f64>)>,
}

impl Memory {
    /// Speed, m/s, and turn rate, rad/s, of a body at `pose` since the last call;
    /// `None` the first time.
    pub(super) fn rates(&mut self, tick: u64, pose: &Isometry3<f64>) -> Option<[f64; 2]> {
        let before = self.before.replace((tick, *pose));
        let (since, last) = before.filter(|(since, _)| *since < tick)?;
        let secs = seconds(tick - since);
        let way = (pose.translation.vector - last.translation.vector).norm();
        let turn = 2.0 * last.rotation.rotation_to(&pose.rotation).imag().norm();
        Some([way / secs, turn / secs])
    }

    /// Whether `now` has been true for `secs` seconds without a break.
    pub(super) fn lasted(&mut self, now: bool, tick: u64, secs: f64) -> bool {
        if !now {
            self.since = None;
            return false;
        }
        let since = *self.since.get_or_insert(tick);
        seconds(tick.saturating_sub(since)) >= secs
    }
}

/// Physics ticks as seconds.
pub(super) fn seconds(ticks: u64) -> f64 {
    ticks as f64 / PHYSICS_HZ as f64
}
