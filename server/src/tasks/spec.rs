//! What a task is: plain data, checked against its scene by who loads it.

use super::goal::Goal;
use super::predicates::AnyPredicate;
use crate::scene::{Place, Scene, Surface};

/// What is asked, where things may start, and when it is done.
#[derive(Clone, Debug, PartialEq)]
pub struct TaskSpec {
    /// Name of the file below assets/tasks.
    pub name: String,
    /// Activity of daily living: `serve`, `organize`.
    pub activity: String,
    /// Area of the home where it happens.
    pub area: String,
    /// Scene below assets/scenes.
    pub scene: String,
    /// What the task is about: an object or furniture that slides; a draw
    /// takes one of them.
    pub targets: Vec<String>,
    /// What is to be done with it.
    pub goal: Goal,
    /// Sentences that ask for it; a draw takes one. `{from_left}` and
    /// `{from_right}` stand for the target's place among the targets.
    pub instructions: Vec<String>,
    /// Simulated seconds after which it has failed.
    pub time_limit: f64,
    /// Where the chair starts.
    pub start: StartSpec,
    /// Where objects start; those not listed stand at their place in the scene.
    pub places: Vec<PlaceSpec>,
    /// How hard furniture slides; what is not listed slides as in the scene.
    pub slides: Vec<SlideSpec>,
    /// What must hold, or is reported.
    pub conditions: Vec<ConditionSpec>,
    /// When the target counts as lost.
    pub failure: FailureSpec,
}

/// A closed range of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Least.
    pub min: f64,
    /// Greatest.
    pub max: f64,
}

impl Range {
    /// Whether a number lies inside, rounding aside.
    #[must_use]
    pub fn contains(&self, value: f64) -> bool {
        value >= self.min - 1e-9 && value <= self.max + 1e-9
    }
}

/// Ranges of the chair's start: pose of `wheelchair_root` in `house`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartSpec {
    /// Metres.
    pub x: Range,
    /// Metres.
    pub y: Range,
    /// Radians.
    pub yaw: Range,
}

/// Ranges of one object's start, in the frame of the surface's approach edge.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaceSpec {
    /// Object.
    pub object: String,
    /// Furniture that carries it.
    pub on: String,
    /// Surface of the furniture; the first one when absent.
    pub surface: Option<String>,
    /// From the edge inwards, metres.
    pub inwards: Range,
    /// Along the edge from its middle, metres.
    pub along: Range,
    /// Turn against the inward direction, radians.
    pub yaw: Range,
    /// kg; the object's own when absent.
    pub mass: Option<Range>,
    /// Coulomb coefficient; the object's own when absent.
    pub friction: Option<Range>,
    /// How often it is there at all, 0 to 1.
    pub chance: f64,
}

/// Ranges of the resistance of furniture that slides.
#[derive(Clone, Debug, PartialEq)]
pub struct SlideSpec {
    /// Joint, for example `drawer_1_joint`.
    pub joint: String,
    /// Dry friction, N.
    pub friction: Range,
    /// Viscous friction, N·s/m.
    pub damping: Range,
}

/// A condition of the task.
#[derive(Clone, Debug, PartialEq)]
pub struct ConditionSpec {
    /// What must be true.
    pub(super) predicate: AnyPredicate,
    /// Needed for success, or only reported.
    pub required: bool,
}

/// When the target counts as dropped or tipped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FailureSpec {
    /// Metres below its start, or above it for having been lifted.
    pub drop: f64,
    /// Lean from how it stood while not held, radians.
    pub tilt: f64,
    /// At rest further than this inwards from the approach edge no arm gets it,
    /// metres; `None` where that does not matter.
    pub reach: Option<f64>,
    /// The robot pressed furniture harder than this, N.
    pub force: f64,
}

impl ConditionSpec {
    /// The predicate with what it is about, for example `inside(knife, placemat)`.
    #[must_use]
    pub fn label(&self) -> String {
        self.predicate.label()
    }
}

impl TaskSpec {
    /// The furniture on which the task puts something, if it does.
    #[must_use]
    pub fn region_name(&self) -> Option<&str> {
        match &self.goal {
            Goal::Put { on } => Some(on),
            Goal::Lift | Goal::Open { .. } => None,
        }
    }

    /// The surface in which the task puts something, if it does.
    #[must_use]
    pub fn region<'a>(&self, scene: &'a Scene) -> Option<&'a Surface> {
        scene.surface_named(self.region_name()?, None)
    }

    /// Where errors about this task stand.
    pub(super) fn place(&self) -> Place {
        Place::file(&format!("tasks/{}.toml", self.name))
    }
}
