//! Predicates by name, as they stand in task files, and what they measure.
//!
//! A predicate is plain data with its thresholds; `measure` looks at one
//! snapshot and gives a value and whether it holds now. What must last or what
//! must never have happened is kept in its `Memory`, so that a saved evaluation
//! goes on as if it had not been interrupted. A new predicate is a variant
//! here, its arm in `measure` and its objects in `objects`.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::evaluate::Context;
use crate::snapshot::{BodyRef, BodyState, Snapshot};

/// Something that can be true of the world, with its thresholds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Predicate {
    /// The object's lowest point is `height` metres above where it started, and
    /// both pads press it with at least `pad_force` N, for `secs` seconds.
    /// Value: the rise, metres.
    LiftedAndHeld {
        object: String,
        height: f64,
        pad_force: f64,
        secs: f64,
    },
    /// The chair moves slower than `speed` m/s and turns slower than `turn_rate`
    /// rad/s. Value: its speed, m/s.
    ChairStopped { speed: f64, turn_rate: f64 },
    /// No object but the target has ever leant by more than `tilt` rad from how
    /// it stood, or fallen by more than `drop` metres. Value: the greatest lean
    /// so far, rad (pi for a fall).
    NothingKnockedOver { tilt: f64, drop: f64 },
    /// The robot has never pressed furniture with more than `force` N, wheels on
    /// the floor excepted. Value: the greatest force so far, N.
    NoHardCollision { force: f64 },
}

/// What a predicate remembers from one tick to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Memory {
    /// Tick since which the condition has held without a break.
    since: Option<u64>,
    /// Greatest value so far.
    worst: f64,
}

/// What a predicate says about one snapshot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Measure {
    pub value: f64,
    pub holds: bool,
}

impl Predicate {
    /// Name with the object it is about, as it is reported.
    #[must_use]
    pub fn label(&self) -> String {
        match self {
            Self::LiftedAndHeld { object, .. } => format!("lifted_and_held({object})"),
            Self::ChairStopped { .. } => "chair_stopped".to_owned(),
            Self::NothingKnockedOver { .. } => "nothing_knocked_over".to_owned(),
            Self::NoHardCollision { .. } => "no_hard_collision".to_owned(),
        }
    }

    /// Objects that it names.
    pub(super) fn objects(&self) -> Vec<&str> {
        match self {
            Self::LiftedAndHeld { object, .. } => vec![object],
            Self::ChairStopped { .. }
            | Self::NothingKnockedOver { .. }
            | Self::NoHardCollision { .. } => Vec::new(),
        }
    }

    /// Its thresholds by key, with unit and greatest sensible value.
    pub(super) fn thresholds(&self) -> Vec<(&'static str, f64, &'static str, f64)> {
        match *self {
            Self::LiftedAndHeld {
                height,
                pad_force,
                secs,
                ..
            } => vec![
                ("height", height, "m", 2.0),
                ("pad_force", pad_force, "N", 235.0),
                ("secs", secs, "s", 60.0),
            ],
            Self::ChairStopped { speed, turn_rate } => vec![
                ("speed", speed, "m/s", 1.0),
                ("turn_rate", turn_rate, "rad/s", 1.0),
            ],
            Self::NothingKnockedOver { tilt, drop } => vec![
                ("tilt", tilt, "rad", std::f64::consts::PI),
                ("drop", drop, "m", 2.0),
            ],
            Self::NoHardCollision { force } => vec![("force", force, "N", 10_000.0)],
        }
    }

    /// Looks at one snapshot.
    pub(super) fn measure(
        &self,
        context: &Context,
        memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Measure {
        match self {
            Self::LiftedAndHeld {
                object,
                height,
                pad_force,
                secs,
            } => {
                let Some(object) = context.object(object) else {
                    return Measure {
                        value: 0.0,
                        holds: false,
                    };
                };
                let rise = context.rise(object, snapshot);
                let now = rise >= *height && context.held(object, *pad_force, snapshot);
                Measure {
                    value: rise,
                    holds: memory.lasted(now, snapshot.tick, *secs),
                }
            }
            Self::ChairStopped { speed, turn_rate } => {
                let root = snapshot.links.first();
                let moving = root.map_or(0.0, |link| link.linear.norm());
                let turning = root.map_or(0.0, |link| link.angular.norm());
                Measure {
                    value: moving,
                    holds: moving <= *speed && turning <= *turn_rate,
                }
            }
            Self::NothingKnockedOver { tilt, drop } => {
                for (object, state) in snapshot.objects.iter().enumerate() {
                    if object == context.target {
                        continue;
                    }
                    let fell = context.rise(object, snapshot) < -drop;
                    let lean = if fell {
                        std::f64::consts::PI
                    } else {
                        context.lean(object, state)
                    };
                    memory.worst = memory.worst.max(lean);
                }
                Measure {
                    value: memory.worst,
                    holds: memory.worst <= *tilt,
                }
            }
            Self::NoHardCollision { force } => {
                for contact in &snapshot.contacts {
                    if context.is_collision(contact.first, contact.second) {
                        memory.worst = memory.worst.max(contact.force.norm());
                    }
                }
                Measure {
                    value: memory.worst,
                    holds: memory.worst <= *force,
                }
            }
        }
    }
}

impl Memory {
    /// Whether `now` has been true for `secs` seconds without a break.
    fn lasted(&mut self, now: bool, tick: u64, secs: f64) -> bool {
        if !now {
            self.since = None;
            return false;
        }
        let since = *self.since.get_or_insert(tick);
        super::evaluate::seconds(tick.saturating_sub(since)) >= secs
    }
}

impl Context {
    /// How far the object's lowest point is above where it started, metres.
    pub(super) fn rise(&self, object: usize, snapshot: &Snapshot) -> f64 {
        let (Some(body), Some(state), Some(start)) = (
            self.bodies.get(object),
            snapshot.objects.get(object),
            self.starts.get(object),
        ) else {
            return 0.0;
        };
        let bottom = |pose| {
            body.collision_bounds(pose)
                .map_or(0.0, |bounds| bounds.min.z)
        };
        bottom(&state.pose) - bottom(start)
    }

    /// Angle between the object's upright axis now and at the start, rad.
    pub(super) fn lean(&self, object: usize, state: &BodyState) -> f64 {
        self.starts.get(object).map_or(0.0, |start| {
            let up = |pose: &nalgebra::Isometry3<f64>| pose.rotation * Vector3::z();
            up(start).angle(&up(&state.pose))
        })
    }

    /// Whether both pads press the object with at least `force` N.
    pub(super) fn held(&self, object: usize, force: f64, snapshot: &Snapshot) -> bool {
        self.pads.iter().all(|&pad| {
            let (pad, object) = (BodyRef::Link(pad), BodyRef::Object(object));
            snapshot
                .contacts
                .iter()
                .filter(|c| {
                    (c.first, c.second) == (pad, object) || (c.first, c.second) == (object, pad)
                })
                .map(|c| c.force.norm())
                .sum::<f64>()
                >= force
        })
    }

    /// Whether these two are the robot and furniture, and not a wheel on the floor.
    fn is_collision(&self, first: BodyRef, second: BodyRef) -> bool {
        match (first, second) {
            (BodyRef::Link(link), BodyRef::Furniture(furniture))
            | (BodyRef::Furniture(furniture), BodyRef::Link(link)) => {
                furniture != 0 || !self.wheels.contains(&link)
            }
            _ => false,
        }
    }
}
