//! Areas of a home and the ranges from which they are sampled: plain data, checked
//! against the scene by the loader. Independent of tasks.

use crate::robot::CorridorSettings;
use crate::scene::{Body, ReachedPlace, Scene};

/// An area; its ranges are the same for every task.
#[derive(Clone, Debug, PartialEq)]
pub struct AreaSpec {
    /// Name of the file below assets/areas.
    pub name: String,
    /// Scene below assets/scenes.
    pub scene: String,
    /// Hand corridor of the robot: scenes are sampled with room for it.
    pub hand: CorridorSettings,
    /// Ranges of a start near the area.
    pub start: StartSpec,
    /// Friction of furniture on joints; unlisted furniture keeps the scene's values.
    pub slides: Vec<SlideSpec>,
    /// Possible contents: at least one; the first has the share that the others leave.
    pub variants: Vec<Variant>,
    /// Probability that it is sampled while a task is in another area, 0 to 1, among
    /// the areas on the same furniture.
    pub elsewhere: f64,
    /// The other areas of the scene, without their own surroundings.
    pub surroundings: Vec<AreaSpec>,
}

/// One set of objects that may be in an area.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// Its name; empty for the first.
    pub name: String,
    /// Probability, 0 to 1.
    pub share: f64,
    /// Optional furniture that it needs.
    pub furniture: Vec<String>,
    /// Furniture on which objects may be placed.
    pub regions: Vec<String>,
    /// Where objects start.
    pub places: Vec<PlaceSpec>,
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
    /// Whether a number is inside, with a tolerance for rounding.
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

impl StartSpec {
    /// The start near a place of a home.
    pub(super) fn near(place: &ReachedPlace) -> Self {
        let [x, y, yaw] = place.start.map(|[min, max]| Range { min, max });
        Self { x, y, yaw }
    }
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
    /// Rotation relative to the inward direction, radians.
    pub yaw: Range,
    /// kg; the object's own when absent.
    pub mass: Option<Range>,
    /// Coulomb coefficient; the object's own when absent.
    pub friction: Option<Range>,
    /// Probability that it exists, 0 to 1.
    pub chance: f64,
    /// Probabilities of resting otherwise than upright.
    pub rest: RestShares,
}

impl PlaceSpec {
    /// Whether it exists in every scene, so that a task may name it.
    #[must_use]
    pub fn is_certain(&self) -> bool {
        self.chance >= 1.0
    }
}

/// Shares of scenes in which an object rests otherwise than upright in its range.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RestShares {
    /// On its side.
    pub lies: f64,
    /// On top of other clutter.
    pub stacks: f64,
    /// Against other clutter.
    pub leans: f64,
    /// Behind a possible target, as seen from the approach edge.
    pub hides: f64,
}

impl RestShares {
    /// Sum of the shares.
    #[must_use]
    pub fn sum(&self) -> f64 {
        self.lies + self.stacks + self.leans + self.hides
    }
}

/// Ranges of furniture on a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct SlideSpec {
    /// Joint, for example `drawer_1_joint`.
    pub joint: String,
    /// Dry friction, N or N·m.
    pub friction: Range,
    /// Viscous friction, N·s/m or N·m·s.
    pub damping: Range,
    /// Initial joint position, metres or radians.
    pub position: Range,
}

impl AreaSpec {
    /// The furniture that carries its objects; empty for an area of furniture on joints.
    #[must_use]
    pub fn carrier(&self) -> &str {
        let places = self.variants.first().and_then(|v| v.places.first());
        places.map_or("", |place| &place.on)
    }

    /// Whether an object is missing from some scenes of the area or its surroundings.
    #[must_use]
    pub fn may_miss(&self, object: &str) -> bool {
        let areas = [self].into_iter().chain(&self.surroundings);
        let variants = areas.flat_map(|area| &area.variants);
        let places: Vec<_> = variants.filter_map(|v| v.place(object)).collect();
        let own = self.variants.iter().all(|v| v.offers(object));
        !places.is_empty() && !own
    }

    /// The variant of this name.
    #[must_use]
    pub fn variant(&self, name: &str) -> Option<&Variant> {
        self.variants.iter().find(|variant| variant.name == name)
    }

    /// Sampled furniture on joints, in the order of the file.
    pub(super) fn sliding<'a>(&'a self, scene: &'a Scene) -> impl Iterator<Item = &'a Body> {
        self.slides.iter().filter_map(move |slide| {
            let joint = scene.joint_named(&slide.joint)?;
            scene.furniture.get(scene.joints[joint].furniture)
        })
    }
}

impl Variant {
    /// The ranges of an object.
    #[must_use]
    pub fn place(&self, object: &str) -> Option<&PlaceSpec> {
        self.places.iter().find(|place| place.object == object)
    }

    /// Whether an object or region exists in every scene.
    #[must_use]
    pub fn offers(&self, name: &str) -> bool {
        self.place(name).is_some_and(PlaceSpec::is_certain)
            || self.regions.iter().any(|region| region == name)
    }
}
