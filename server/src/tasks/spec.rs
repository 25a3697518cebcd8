//! What a task is: plain data, checked against its scene by who loads it.

use super::area::{AreaSpec, Variant};
use super::goal::Goal;
use super::predicates::AnyPredicate;
use crate::people::PersonSetting;
use crate::scene::{Place, Scene, Surface};

/// What is asked, of what, and when it is done.
#[derive(Clone, Debug, PartialEq)]
pub struct TaskSpec {
    /// Name of the file below assets/tasks.
    pub name: String,
    /// Template below assets/templates of which it is an instance.
    pub template: String,
    /// Activity of daily living: `serve`, `organize`.
    pub activity: String,
    /// Where it happens, and what stands there.
    pub area: AreaSpec,
    /// What the task is about: objects or furniture that slides; a draw takes
    /// one of them.
    pub targets: Vec<String>,
    /// What is to be done with it.
    pub goal: Goal,
    /// Sentences that ask for it; a draw takes one. `{from_left}`,
    /// `{from_right}` and `{from_top}` stand for the target's place among the
    /// targets.
    pub instructions: Vec<String>,
    /// Simulated seconds after which it has failed.
    pub time_limit: f64,
    /// What must hold, or is reported.
    pub conditions: Vec<ConditionSpec>,
    /// When the target counts as lost.
    pub failure: FailureSpec,
    /// How somebody waits for it, where the scenario does not say.
    pub waits: WaitSpec,
}

/// Posture of somebody for whom a task is done, where the scenario names none.
const FREE_LAP: &str = "hands_on_armrests";

/// How somebody waits for what a task brings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WaitSpec {
    /// How much the head moves, 0 to 1.
    pub motion: f64,
    /// The mouth opens and stays open.
    pub mouth_open: bool,
}

impl Default for WaitSpec {
    fn default() -> Self {
        Self {
            motion: 1.0,
            mouth_open: false,
        }
    }
}

/// A condition of the task.
#[derive(Clone, Debug, PartialEq)]
pub struct ConditionSpec {
    /// What must be true.
    pub(super) predicate: AnyPredicate,
    /// Needed for success, or only reported.
    pub required: bool,
    /// Only where somebody sits in the chair.
    pub with_person: bool,
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

/// Activity of the tasks that are done for somebody in the seat.
const CARE: &str = "care";

impl TaskSpec {
    /// Whether it is done for somebody in the seat: one is drawn where the scenario
    /// names nobody.
    #[must_use]
    pub fn is_care(&self) -> bool {
        self.activity == CARE || matches!(self.goal, Goal::Give | Goal::Bring)
    }

    /// Somebody for whom the task is done: who is `asked` for, and as the task needs it
    /// where that says nothing. Hands leave the lap free. Who was drawn before stays as
    /// told.
    #[must_use]
    pub fn cared_for(&self, asked: Option<PersonSetting>) -> PersonSetting {
        let mut person = asked.unwrap_or_default();
        if person.drawn.is_some() {
            return person;
        }
        if person.posture.is_empty() {
            person.posture = FREE_LAP.to_owned();
        }
        person.motion.get_or_insert(self.waits.motion);
        person.mouth_open |= self.waits.mouth_open;
        person
    }

    /// The furniture on which the task puts something, if it does.
    #[must_use]
    pub fn region_name(&self) -> Option<&str> {
        match &self.goal {
            Goal::Put { on } => Some(on),
            Goal::Lift | Goal::Give | Goal::Bring | Goal::Open { .. } | Goal::Close { .. } => None,
        }
    }

    /// The surface in which the task puts something, if it does.
    #[must_use]
    pub fn region<'a>(&self, scene: &'a Scene) -> Option<&'a Surface> {
        scene.surface_named(self.region_name()?, None)
    }

    /// Variants of the area in which everything is that the task asks for.
    pub fn variants(&self) -> impl DoubleEndedIterator<Item = &Variant> {
        let objects = self.targets.iter().map(String::as_str);
        let asked: Vec<&str> = match self.goal {
            // Furniture is always there.
            Goal::Open { .. } | Goal::Close { .. } => Vec::new(),
            Goal::Lift | Goal::Give | Goal::Bring | Goal::Put { .. } => {
                objects.chain(self.region_name()).collect()
            }
        };
        let variants = self.area.variants.iter();
        variants.filter(move |variant| asked.iter().all(|name| variant.offers(name)))
    }

    /// Where errors about this task stand.
    pub(super) fn place(&self) -> Place {
        Place::file(&format!("tasks/{}.toml", self.name))
    }
}
