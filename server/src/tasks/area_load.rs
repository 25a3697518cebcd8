//! Reads `assets/areas/NAME.toml` and checks it against its scene.
//!
//! Lengths are metres, angles degrees in keys with `_deg`.

use std::path::Path;

use serde::Deserialize;

use wheelarm_proto::furniture::JointMotion;

use super::area::{AreaSpec, PlaceSpec, Range, RestShares, SlideSpec, StartSpec, Variant};
use super::name_check::{known_joint, known_object};
use super::rest::lying;
use super::scene_sampling::sample_scene;
use crate::robot::CorridorSettings;
use crate::scene::{Body, Files, Place, Scene, SceneError, provenance};

/// Seeds sampled when an area is loaded, to check that there is room.
const SEEDS: u64 = 4;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct AreaFile {
    origin: String,
    license: String,
    scene: String,
    start: StartEntry,
    #[serde(default)]
    regions: Vec<String>,
    #[serde(default)]
    place: Vec<PlaceEntry>,
    #[serde(default)]
    slide: Vec<SlideEntry>,
    #[serde(default)]
    variant: Vec<VariantEntry>,
    /// Probability that it is sampled while a task is in another area, 0 to 1.
    #[serde(default)]
    elsewhere: f64,
}

/// Ranges of the chair's start: smallest and largest value.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct StartEntry {
    x: [f64; 2],
    y: [f64; 2],
    yaw_deg: [f64; 2],
}

/// Ranges of an object's start, in the frame of the surface's approach edge.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlaceEntry {
    object: String,
    on: String,
    surface: Option<String>,
    /// From the edge inwards.
    inwards: [f64; 2],
    /// Along the edge from its middle.
    along: [f64; 2],
    /// Rotation relative to the inward direction.
    yaw_deg: [f64; 2],
    mass: Option<[f64; 2]>,
    friction: Option<[f64; 2]>,
    /// Probability that it exists, 0 to 1.
    chance: Option<f64>,
    /// Probability that it is on its side, 0 to 1.
    #[serde(default)]
    lies: f64,
    /// Probability that it is on top of other clutter.
    #[serde(default)]
    stacks: f64,
    /// Probability that it leans against other clutter.
    #[serde(default)]
    leans: f64,
    /// Probability that it is behind a possible target.
    #[serde(default)]
    hides: f64,
}

/// Ranges of furniture on a joint.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct SlideEntry {
    /// For example `drawer_1_joint`.
    joint: String,
    /// N, or N·m of a hinge.
    friction: [f64; 2],
    /// N·s/m, or N·m·s of a hinge.
    damping: [f64; 2],
    /// Initial position of what slides, m.
    position: Option<[f64; 2]>,
    /// Initial angle of what turns.
    position_deg: Option<[f64; 2]>,
}

/// A variant of the area's contents.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct VariantEntry {
    name: String,
    /// Probability, 0 to 1.
    share: f64,
    /// Optional furniture of the scene.
    #[serde(default)]
    furniture: Vec<String>,
    #[serde(default)]
    regions: Vec<String>,
    /// Added to the area's own places, or replacing those of the same object.
    #[serde(default)]
    place: Vec<PlaceEntry>,
}

impl AreaSpec {
    /// Reads `assets/areas/NAME.toml` and checks it against its scene, loaded with all
    /// optional furniture. Checks that the hand has room.
    ///
    /// # Errors
    /// When the file is missing or a value is invalid.
    pub fn load(
        assets: &Path,
        name: &str,
        scene: &Scene,
        hand: &CorridorSettings,
    ) -> Result<Self, SceneError> {
        let files = Files::of_scene(assets, scene);
        let mut spec = Self::load_alone(files, name, scene, hand)?;
        let place = Place::file(&format!("areas/{name}.toml"));
        let others = files.names("areas")?.into_iter();
        for other in others.filter(|other| other != name) {
            let is_here = read(files, &other).map(|file| file.scene == scene.name);
            let loaded = match is_here {
                Ok(false) => continue,
                Ok(true) => Self::load_alone(files, &other, scene, hand),
                Err(error) => Err(error),
            };
            match loaded {
                Ok(other) => spec.surroundings.push(other),
                // The bad area costs its own tasks only.
                Err(error) => tracing::warn!("the area {other:?} is left out: {error}"),
            }
        }
        spec.check_room(&place, scene)?;
        Ok(spec)
    }

    /// Without its surroundings, and without the check of the room.
    fn load_alone(
        files: Files<'_>,
        name: &str,
        scene: &Scene,
        hand: &CorridorSettings,
    ) -> Result<Self, SceneError> {
        let file = read(files, name)?;
        let place = Place::file(&format!("areas/{name}.toml"));
        if file.scene != scene.name {
            return Err(place.key("scene").wrong(
                format!("{:?}", file.scene),
                format!("the scene in use, {:?}", scene.name),
                format!("take the scene {:?}, or a task of this one", file.scene),
            ));
        }
        let start = place.key("start");
        let mut first = Variant {
            name: String::new(),
            share: 1.0,
            furniture: Vec::new(),
            regions: regions(&place, scene, &file.regions)?,
            places: Vec::new(),
        };
        for entry in &file.place {
            let place = place.entry("place", &entry.object);
            first.places.push(read_place(&place, scene, entry)?);
        }
        let mut variants = vec![first];
        for entry in &file.variant {
            let place = place.entry("variant", &entry.name);
            variants.push(read_variant(&place, scene, entry, &variants[0])?);
        }
        let others: f64 = variants[1..].iter().map(|v| v.share).sum();
        let share = place.key("variant.share");
        let why = "shares of the variants leave the rest to the area without them";
        variants[0].share = 1.0 - share.within(others, 0.0, 1.0, "", why)?;
        Ok(Self {
            name: name.to_owned(),
            scene: file.scene,
            hand: *hand,
            start: StartSpec {
                x: range(&start.key("x"), file.start.x, -50.0, 50.0, "m")?,
                y: range(&start.key("y"), file.start.y, -50.0, 50.0, "m")?,
                yaw: angles(&start.key("yaw_deg"), file.start.yaw_deg)?,
            },
            slides: file
                .slide
                .iter()
                .map(|entry| read_slide(&place.entry("slide", &entry.joint), scene, entry))
                .collect::<Result<_, _>>()?,
            variants,
            elsewhere: place.key("elsewhere").within(
                file.elsewhere,
                0.0,
                1.0,
                "",
                "a share of the scenes of tasks elsewhere",
            )?,
            surroundings: Vec::new(),
        })
    }

    /// Rejects ranges in which the objects, or the hand next to them, have no room.
    fn check_room(&self, place: &Place, scene: &Scene) -> Result<(), SceneError> {
        for variant in &self.variants {
            let mut scene = scene.clone();
            scene.keep_optional(&variant.furniture);
            let mut rooms =
                (0..SEEDS).map(|seed| sample_scene(self, variant, &scene, seed, None).clearance);
            if let Some(worst) = rooms.find(|room| *room < 0.0) {
                let which = match variant.name.as_str() {
                    "" => String::new(),
                    name => format!(" in the variant {name:?}"),
                };
                return Err(place.key("place").wrong(
                    format!(
                        "so tight{which} that {:.0} mm are missing for all objects and the hand",
                        -worst * 1000.0
                    ),
                    "ranges with room for all objects, the regions and the gripper",
                    "widen the ranges or move other objects of the scene away",
                ));
            }
        }
        Ok(())
    }
}

/// Name of the scene of an area, read from its file only.
pub(super) fn scene_of(files: Files<'_>, area: &Place, name: &str) -> Result<String, SceneError> {
    let known = files.names("areas")?;
    if !known.iter().any(|known| known == name) {
        return Err(area.wrong(
            format!("{name:?}"),
            format!("one of {}", known.join(", ")),
            "correct the name or add the area in assets/areas",
        ));
    }
    Ok(read(files, name)?.scene)
}

fn read(files: Files<'_>, name: &str) -> Result<AreaFile, SceneError> {
    let path = format!("areas/{name}.toml");
    let file: AreaFile = files.parse(&path)?;
    provenance(&Place::file(&path), &file.origin, &file.license)?;
    Ok(file)
}

fn regions(place: &Place, scene: &Scene, regions: &[String]) -> Result<Vec<String>, SceneError> {
    for region in regions {
        scene.surface(&place.key("regions"), region, None)?;
    }
    Ok(regions.to_vec())
}

fn read_variant(
    place: &Place,
    scene: &Scene,
    entry: &VariantEntry,
    first: &Variant,
) -> Result<Variant, SceneError> {
    for name in &entry.furniture {
        let optional = scene.furniture.iter().filter(|body| body.optional);
        let known: Vec<_> = optional.map(|body| body.name.as_str()).collect();
        if !known.contains(&name.as_str()) {
            return Err(place.key("furniture").wrong(
                format!("{name:?}"),
                format!("one of {}", known.join(", ")),
                "name furniture of the scene with optional = true",
            ));
        }
    }
    let mut places = first.places.clone();
    for entry in &entry.place {
        let read = read_place(&place.entry("place", &entry.object), scene, entry)?;
        match places.iter_mut().find(|p| p.object == read.object) {
            Some(own) => {
                *own = PlaceSpec {
                    mass: read.mass.or(own.mass),
                    friction: read.friction.or(own.friction),
                    ..read
                };
            }
            None => places.push(read),
        }
    }
    let more = regions(place, scene, &entry.regions)?;
    Ok(Variant {
        name: entry.name.clone(),
        share: place.key("share").within(
            entry.share,
            0.0,
            1.0,
            "",
            "1 is always, 0.2 every fifth time",
        )?,
        furniture: entry.furniture.clone(),
        regions: [&first.regions[..], &more[..]].concat(),
        places,
    })
}

/// Probabilities of poses other than upright. A possible target is on its side only where a grasp
/// reaches it from above, and never stacks, leans or hides.
fn read_rest(place: &Place, body: &Body, entry: &PlaceEntry) -> Result<RestShares, SceneError> {
    let share = |key, value| {
        let why = "0.2 is every fifth scene";
        place.key(key).within(value, 0.0, 1.0, "", why)
    };
    let rest = RestShares {
        lies: share("lies", entry.lies)?,
        stacks: share("stacks", entry.stacks)?,
        leans: share("leans", entry.leans)?,
        hides: share("hides", entry.hides)?,
    };
    share("lies", rest.sum())?;
    let is_certain = entry.chance.is_none_or(|chance| chance >= 1.0);
    if is_certain && rest.sum() > rest.lies {
        return Err(place.wrong(
            "an object of every scene that stacks, leans or hides",
            "clutter for that, with a chance below 1",
            "leave out stacks, leans and hides, or give a chance",
        ));
    }
    if rest.lies > 0.0 && lying(body, is_certain).is_empty() {
        return Err(place.key("lies").wrong(
            format!("{}", rest.lies),
            "0: no grasp reaches the object from above when it lies",
            "leave it out, or give the object a grasp for it",
        ));
    }
    Ok(rest)
}

fn read_place(place: &Place, scene: &Scene, entry: &PlaceEntry) -> Result<PlaceSpec, SceneError> {
    known_object(place, scene, &entry.object)?;
    let object = scene.object_named(&entry.object).unwrap_or_default();
    let surface = scene.surface(place, &entry.on, entry.surface.as_deref())?;
    let half = surface.width / 2.0;
    let (inwards, along) = (place.key("inwards"), place.key("along"));
    Ok(PlaceSpec {
        object: entry.object.clone(),
        on: entry.on.clone(),
        surface: entry.surface.clone(),
        inwards: range(&inwards, entry.inwards, 0.0, surface.depth, "m")?,
        along: range(&along, entry.along, -half, half, "m")?,
        yaw: angles(&place.key("yaw_deg"), entry.yaw_deg)?,
        mass: entry
            .mass
            .map(|mass| range(&place.key("mass"), mass, 0.001, 100.0, "kg"))
            .transpose()?,
        friction: entry
            .friction
            .map(|friction| range(&place.key("friction"), friction, 0.0, 2.0, ""))
            .transpose()?,
        chance: place.key("chance").within(
            entry.chance.unwrap_or(1.0),
            0.0,
            1.0,
            "",
            "1 is always, 0.5 every other time",
        )?,
        rest: read_rest(place, &scene.objects[object], entry)?,
    })
}

fn read_slide(place: &Place, scene: &Scene, entry: &SlideEntry) -> Result<SlideSpec, SceneError> {
    let joint = known_joint(&place.key("joint"), scene, &entry.joint)?;
    let turns = joint.motion == JointMotion::Turns;
    let (key, most, units) = match turns {
        true => ("position_deg", joint.travel.to_degrees(), ["N·m", "N·m·s"]),
        false => ("position", joint.travel, ["N", "N·s/m"]),
    };
    let (given, other) = match turns {
        true => (entry.position_deg, ("position", entry.position)),
        false => (entry.position, ("position_deg", entry.position_deg)),
    };
    if let (other, Some(value)) = other {
        return Err(place.key(other).wrong(
            format!("{value:?}"),
            format!(
                "{key}, for {} {}",
                entry.joint,
                if turns { "turns" } else { "slides" }
            ),
            format!("write {key} instead"),
        ));
    }
    let unit = if turns { "degrees" } else { "m" };
    let position = range(&place.key(key), given.unwrap_or_default(), 0.0, most, unit)?;
    let scaled = |value: f64| if turns { value.to_radians() } else { value };
    Ok(SlideSpec {
        joint: entry.joint.clone(),
        friction: range(
            &place.key("friction"),
            entry.friction,
            0.0,
            1000.0,
            units[0],
        )?,
        damping: range(
            &place.key("damping"),
            entry.damping,
            0.0,
            10_000.0,
            units[1],
        )?,
        position: Range {
            min: scaled(position.min),
            max: scaled(position.max),
        },
    })
}

fn range(
    place: &Place,
    [min, max]: [f64; 2],
    low: f64,
    high: f64,
    unit: &str,
) -> Result<Range, SceneError> {
    for value in [min, max] {
        place.within(
            value,
            low,
            high,
            unit,
            "give [least, greatest] within these",
        )?;
    }
    if min > max {
        return Err(place.wrong(
            format!("[{min}, {max}]"),
            "[least, greatest]",
            "swap the two",
        ));
    }
    Ok(Range { min, max })
}

fn angles(place: &Place, degrees: [f64; 2]) -> Result<Range, SceneError> {
    let range = range(place, degrees, -360.0, 360.0, "degrees")?;
    Ok(Range {
        min: range.min.to_radians(),
        max: range.max.to_radians(),
    })
}
