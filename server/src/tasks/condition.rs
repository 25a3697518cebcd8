//! What a condition of a task is to the judge: it names things, has thresholds
//! and measures one snapshot.
//!
//! Whoever implements [`Predicate`] says all of it, for nothing has a default:
//! a kind that is left out does not compile. What must last or what must never
//! have happened is kept in the [`Memory`], so that a saved evaluation resumes
//! as if it had not been interrupted.

use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};
use wheelarm_proto::PHYSICS_HZ;

use super::context::Context;
use super::failure::Failure;
use crate::snapshot::Snapshot;

/// Something that can be true of the world: plain data with its thresholds.
pub(super) trait Predicate {
    /// Its word in a task file.
    fn word(&self) -> &'static str;

    /// What it is about, in the order in which its label tells them.
    fn names(&self) -> Vec<Name<'_>>;

    /// Its thresholds, as they stand in the task file.
    fn thresholds(&self) -> Vec<Threshold>;

    /// The failure that follows when the predicate stops holding, where it can never hold
    /// again; `None` where it can.
    fn loss(&self) -> Option<Failure>;

    /// Looks at one snapshot; `None` when what it is about is not there, which
    /// counts as not holding.
    fn measure(
        &self,
        context: &Context,
        memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Option<Measure>;
}

/// A part of the scene that a condition or a goal names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Name<'a> {
    /// An object, or the target that was drawn.
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

/// A number of a task file that must lie between 0 and `most`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Threshold {
    /// Key in the task file.
    pub key: &'static str,
    /// As in the file.
    pub value: f64,
    /// Unit in the file.
    pub unit: &'static str,
    /// Greatest sensible value.
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
    /// Tick and pose of what was looked at before.
    before: Option<(u64, Isometry3<f64>)>,
}

impl Memory {
    /// Speed, m/s, and turn rate, rad/s, of what stands at `pose` now, by where it was
    /// when it was last asked; `None` the first time.
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
