//! Specification of a task: plain data, checked against its scene by the loader.

use super::area::{AreaSpec, Variant};
use super::condition_spec::ConditionSpec;
use super::goal::Goal;
use super::home_sites::HomeQuery;
use super::stock;
use crate::people::PersonSetting;
use crate::scene::{Place, Scene, Surface};

/// A task: target, goal and conditions.
#[derive(Clone, Debug, PartialEq)]
pub struct TaskSpec {
    /// Name of the file below assets/tasks or assets/home_tasks.
    pub name: String,
    /// This file, and that of the area or of the stock, below the assets folder.
    pub files: Vec<String>,
    /// Its template below assets/templates.
    pub template: String,
    /// Activity of daily living: `serve`, `organize`.
    pub activity: String,
    /// Area of the home.
    pub area: AreaSpec,
    /// Possible targets: objects or furniture on joints; sampling selects one.
    pub targets: Vec<String>,
    /// Other objects of the scene of a settled query that it could have requested: all that a
    /// target has to satisfy holds of them too.
    pub(super) rivals: Vec<String>,
    /// What to do with the target.
    pub goal: Goal,
    /// Instructions; sampling selects one. `{from_left}` and `{from_right}` are replaced
    /// by the target's number among the targets, `{by_height}` by its category with its
    /// place: `top drawer`, `second drawer from the top`, `bottom drawer`.
    pub instructions: Vec<String>,
    /// Simulated seconds after which it fails.
    pub time_limit: f64,
    /// Required and reported conditions.
    pub conditions: Vec<ConditionSpec>,
    /// Failure of the target.
    pub failure: FailureSpec,
    /// Behaviour of the person, unless the scenario sets it.
    pub waits: WaitSpec,
    /// It is a query over the places of a home, and has no target, place and conditions yet.
    pub(super) query: Option<HomeQuery>,
}

/// Default posture of the person in care tasks.
const FREE_LAP: &str = "hands_on_armrests";

/// Behaviour of a person who waits for the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WaitSpec {
    /// Motion of the head, 0 to 1.
    pub motion: f64,
    /// The mouth is open.
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

/// When the target counts as dropped or tipped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FailureSpec {
    /// Fall below its start, or rise above it that counts as lifted, metres.
    pub drop: f64,
    /// Lean from its start while not held, radians.
    pub tilt: f64,
    /// Distance inwards from the approach edge beyond which a resting target is
    /// unreachable, metres; `None` for no limit.
    pub reach: Option<f64>,
    /// Contact force of the robot with furniture above which the task fails, N.
    pub force: f64,
}

/// Activity of care tasks.
const CARE: &str = "care";

impl TaskSpec {
    /// Whether it is a care task: its person is sampled unless the scenario names one.
    #[must_use]
    pub fn is_care(&self) -> bool {
        self.activity == CARE || matches!(self.goal, Goal::Give | Goal::Bring)
    }

    /// The person for a care task: the `requested` one, with the task's values where
    /// that has none. The hands leave the lap free. A person sampled before is
    /// unchanged.
    #[must_use]
    pub fn cared_for(&self, requested: Option<PersonSetting>) -> PersonSetting {
        let mut person = requested.unwrap_or_default();
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

    /// Whether its sentences name places by room and kind of furniture: it has no area file.
    pub(super) fn names_places(&self) -> bool {
        self.files.iter().any(|file| file == stock::FILE)
    }

    /// The furniture on which the task puts the target, if any.
    #[must_use]
    pub fn region_name(&self) -> Option<&str> {
        match &self.goal {
            Goal::Put { on } => Some(on),
            Goal::Lift | Goal::Give | Goal::Bring | Goal::Open(_) | Goal::Close(_) => None,
        }
    }

    /// The surface on which the task puts the target, if any.
    #[must_use]
    pub fn region<'a>(&self, scene: &'a Scene) -> Option<&'a Surface> {
        scene.surface_named(self.region_name()?, None)
    }

    /// Variants of the area that contain everything that the task needs.
    pub fn variants(&self) -> impl DoubleEndedIterator<Item = &Variant> {
        let objects = self.targets.iter().map(String::as_str);
        let needed: Vec<&str> = match self.goal {
            // Furniture always exists.
            Goal::Open(_) | Goal::Close(_) => Vec::new(),
            // Every variant of a query is a place with an object.
            _ if self.query.is_some() => Vec::new(),
            Goal::Lift | Goal::Give | Goal::Bring | Goal::Put { .. } => {
                objects.chain(self.region_name()).collect()
            }
        };
        let variants = self.area.variants.iter();
        variants.filter(move |variant| needed.iter().all(|name| variant.offers(name)))
    }

    /// Replaces the placeholders of its sentences with words.
    pub(super) fn name_in_sentences(&mut self, object: &str, from: &str, place: &str) {
        for sentence in &mut self.instructions {
            for (key, words) in [("{object}", object), ("{from}", from), ("{place}", place)] {
                *sentence = sentence.replace(key, words);
            }
        }
    }

    /// Place of this task in error messages.
    pub(super) fn place(&self) -> Place {
        Place::file(self.files.first().map_or("", String::as_str))
    }
}
