//! Predicates by name, as they stand in task files, and what they measure.
//!
//! A predicate is plain data with its thresholds; `measure` looks at one
//! snapshot and gives a value and whether it holds now. What must last or what
//! must never have happened is kept in its `Memory`, so that a saved evaluation
//! goes on as if it had not been interrupted. A new predicate is a variant
//! here, its arm in `measure` and its objects in `objects`.

use serde::{Deserialize, Serialize};

use super::context::Context;
use crate::snapshot::Snapshot;

/// Object name that stands for the target that was drawn.
pub(super) const TARGET: &str = "target";

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
    /// The object has once been lifted by `height` metres while both pads pressed
    /// it with at least `pad_force` N. Value: the greatest rise so held, metres.
    LiftedBefore {
        object: String,
        height: f64,
        pad_force: f64,
    },
    /// The object's centre of mass is above the first surface of furniture `on`,
    /// and its lowest point within `above` metres of it. Value: the distance of
    /// the centre of mass from the middle of the surface on the floor plan, metres.
    Inside {
        object: String,
        on: String,
        above: f64,
    },
    /// The object leans by no more than `tilt` rad from how it stood. Value: the
    /// lean, rad.
    Upright { object: String, tilt: f64 },
    /// The object moves slower than `speed` m/s and turns slower than `turn_rate`
    /// rad/s, for `secs` seconds. Value: its speed, m/s.
    AtRest {
        object: String,
        speed: f64,
        turn_rate: f64,
        secs: f64,
    },
    /// No part of the robot touches the object, for `secs` seconds. Value: the
    /// force of the robot on it, N.
    Released { object: String, secs: f64 },
    /// The joint of furniture is open by at least `travel` metres. Value: its
    /// position, metres.
    OpenedBy { joint: String, travel: f64 },
    /// Of the targets that could have been drawn none but the drawn one was ever
    /// lifted by `height` metres. Value: the greatest rise of another, metres.
    CorrectInstance { height: f64 },
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
    /// Its word in a task file.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::LiftedAndHeld { .. } => "lifted_and_held",
            Self::LiftedBefore { .. } => "lifted_before",
            Self::Inside { .. } => "inside",
            Self::Upright { .. } => "upright",
            Self::AtRest { .. } => "at_rest",
            Self::Released { .. } => "released",
            Self::OpenedBy { .. } => "opened_by",
            Self::CorrectInstance { .. } => "correct_instance",
            Self::ChairStopped { .. } => "chair_stopped",
            Self::NothingKnockedOver { .. } => "nothing_knocked_over",
            Self::NoHardCollision { .. } => "no_hard_collision",
        }
    }

    /// Name with the object it is about, as it is reported.
    #[must_use]
    pub fn label(&self) -> String {
        let word = self.word();
        match self {
            Self::LiftedAndHeld { object, .. }
            | Self::LiftedBefore { object, .. }
            | Self::Upright { object, .. }
            | Self::AtRest { object, .. }
            | Self::Released { object, .. } => format!("{word}({object})"),
            Self::Inside { object, on, .. } => format!("{word}({object}, {on})"),
            Self::OpenedBy { joint, .. } => format!("{word}({joint})"),
            Self::CorrectInstance { .. }
            | Self::ChairStopped { .. }
            | Self::NothingKnockedOver { .. }
            | Self::NoHardCollision { .. } => word.to_owned(),
        }
    }

    /// Objects that it names.
    pub(super) fn objects(&self) -> Vec<&str> {
        match self {
            Self::LiftedAndHeld { object, .. }
            | Self::LiftedBefore { object, .. }
            | Self::Inside { object, .. }
            | Self::Upright { object, .. }
            | Self::AtRest { object, .. }
            | Self::Released { object, .. } => vec![object],
            Self::OpenedBy { .. }
            | Self::CorrectInstance { .. }
            | Self::ChairStopped { .. }
            | Self::NothingKnockedOver { .. }
            | Self::NoHardCollision { .. } => Vec::new(),
        }
    }

    /// Furniture on whose surface something is to be.
    pub(super) fn region(&self) -> Option<&str> {
        match self {
            Self::Inside { on, .. } => Some(on),
            _ => None,
        }
    }

    /// Joint of furniture that it names.
    pub(super) fn joint(&self) -> Option<&str> {
        match self {
            Self::OpenedBy { joint, .. } => Some(joint),
            _ => None,
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
            Self::LiftedBefore {
                height, pad_force, ..
            } => vec![
                ("height", height, "m", 2.0),
                ("pad_force", pad_force, "N", 235.0),
            ],
            Self::Inside { above, .. } => vec![("above", above, "m", 1.0)],
            Self::Upright { tilt, .. } => vec![("tilt", tilt, "rad", std::f64::consts::PI)],
            Self::AtRest {
                speed,
                turn_rate,
                secs,
                ..
            } => vec![
                ("speed", speed, "m/s", 1.0),
                ("turn_rate", turn_rate, "rad/s", 10.0),
                ("secs", secs, "s", 60.0),
            ],
            Self::Released { secs, .. } => vec![("secs", secs, "s", 60.0)],
            Self::OpenedBy { travel, .. } => vec![("travel", travel, "m", 2.0)],
            Self::CorrectInstance { height } => vec![("height", height, "m", 2.0)],
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

    /// Looks at one snapshot. A predicate about what is not there does not hold.
    pub(super) fn measure(
        &self,
        context: &Context,
        memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Measure {
        self.measure_object(context, memory, snapshot)
            .unwrap_or_else(|| self.measure_all(context, memory, snapshot))
    }

    /// Predicates about one object; `None` for others and when it is not there.
    fn measure_object(
        &self,
        context: &Context,
        memory: &mut Memory,
        snapshot: &Snapshot,
    ) -> Option<Measure> {
        let object = context.object(self.objects().first()?)?;
        let state = snapshot.objects.get(object)?;
        let tick = snapshot.tick;
        Some(match self {
            Self::LiftedAndHeld {
                height,
                pad_force,
                secs,
                ..
            } => {
                let rise = context.rise(object, snapshot);
                let now = rise >= *height && context.held(object, *pad_force, snapshot);
                Measure {
                    value: rise,
                    holds: memory.lasted(now, tick, *secs),
                }
            }
            Self::LiftedBefore {
                height, pad_force, ..
            } => {
                if context.held(object, *pad_force, snapshot) {
                    memory.worst = memory.worst.max(context.rise(object, snapshot));
                }
                Measure {
                    value: memory.worst,
                    holds: memory.worst >= *height,
                }
            }
            Self::Inside { on, above, .. } => {
                let (distance, inside) = context.inside(object, state, on, *above)?;
                Measure {
                    value: distance,
                    holds: inside,
                }
            }
            Self::Upright { tilt, .. } => {
                let lean = context.lean(object, state);
                Measure {
                    value: lean,
                    holds: lean <= *tilt,
                }
            }
            Self::AtRest {
                speed,
                turn_rate,
                secs,
                ..
            } => {
                let moving = state.linear.norm();
                let now = moving <= *speed && state.angular.norm() <= *turn_rate;
                Measure {
                    value: moving,
                    holds: memory.lasted(now, tick, *secs),
                }
            }
            Self::Released { secs, .. } => {
                let force = context.robot_force(object, snapshot);
                Measure {
                    value: force.unwrap_or(0.0),
                    holds: memory.lasted(force.is_none(), tick, *secs),
                }
            }
            _ => return None,
        })
    }

    /// Predicates about the robot, furniture or all objects.
    fn measure_all(&self, context: &Context, memory: &mut Memory, snapshot: &Snapshot) -> Measure {
        match self {
            Self::OpenedBy { joint, travel } => {
                let joint = context.joints.iter().position(|name| name == joint);
                let state = joint.and_then(|joint| snapshot.furniture_joints.get(joint));
                let position = state.map_or(0.0, |state| state.position);
                Measure {
                    value: position,
                    holds: position >= *travel,
                }
            }
            Self::CorrectInstance { height } => {
                for &other in &context.decoys {
                    memory.worst = memory.worst.max(context.rise(other, snapshot));
                }
                Measure {
                    value: memory.worst,
                    holds: memory.worst < *height,
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
                    if Some(object) == context.target {
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
                memory.worst = memory.worst.max(context.collision_force(snapshot));
                Measure {
                    value: memory.worst,
                    holds: memory.worst <= *force,
                }
            }
            _ => Measure {
                value: 0.0,
                holds: false,
            },
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
