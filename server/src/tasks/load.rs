//! Reads `assets/tasks/NAME.toml` and checks it against its scene.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::Path;

use super::condition::{Name, Threshold};
use super::context::TARGET;
use super::draw::clearance_of;
use super::file::{FailureEntry, PlaceEntry, SlideEntry, Target, TaskFile};
use super::goal::Goal;
use super::spec::{ConditionSpec, FailureSpec, PlaceSpec, Range, SlideSpec, StartSpec, TaskSpec};
use crate::scene::{Place, Scene, SceneError, names, parse, provenance};

/// Every task below `assets/tasks`, by name.
///
/// # Errors
/// When one of them cannot be used.
pub fn list(assets: &Path) -> Result<Vec<TaskSpec>, SceneError> {
    // Most tasks share a scene, and a scene takes far longer to read than a task.
    let mut scenes: BTreeMap<String, Scene> = BTreeMap::new();
    let mut tasks = Vec::new();
    for name in names(assets, "tasks")? {
        let file = read(assets, &name)?;
        let scene = match scenes.entry(file.scene.clone()) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(place) => place.insert(Scene::load(assets, &file.scene)?),
        };
        tasks.push(TaskSpec::checked(&name, file, scene)?);
    }
    Ok(tasks)
}

fn read(assets: &Path, name: &str) -> Result<TaskFile, SceneError> {
    let path = format!("tasks/{name}.toml");
    let file: TaskFile = parse(assets, &path)?;
    provenance(&Place::file(&path), &file.origin, &file.license)?;
    Ok(file)
}

impl TaskSpec {
    /// Reads `assets/tasks/NAME.toml` and checks it against the scene in which
    /// it is to be done, as it was loaded: with all that is optional.
    ///
    /// # Errors
    /// When the file is missing or something in it cannot be.
    pub fn load(assets: &Path, name: &str, scene: &Scene) -> Result<Self, SceneError> {
        Self::checked(name, read(assets, name)?, scene)
    }

    fn checked(name: &str, file: TaskFile, scene: &Scene) -> Result<Self, SceneError> {
        let place = Place::file(&format!("tasks/{name}.toml"));
        let targets = match file.target {
            Target::One(target) => vec![target],
            Target::OneOf(targets) => targets,
        };
        if targets.is_empty() {
            return Err(place.key("target").wrong(
                "an empty list",
                "at least one name",
                "say what the task is about",
            ));
        }
        for target in &targets {
            let slides = scene
                .furniture_named(target)
                .is_some_and(|body| scene.joint_of(body).is_some());
            if !slides {
                known_object(&place.key("target"), scene, target)?;
            }
        }
        if !scene.furniture.iter().any(|body| body.area == file.area) || file.area.is_empty() {
            let mut areas: Vec<_> = scene.furniture.iter().map(|b| b.area.as_str()).collect();
            areas.sort_unstable();
            areas.dedup();
            areas.retain(|area| !area.is_empty());
            return Err(place.key("area").wrong(
                format!("{:?}", file.area),
                format!("one of {}", areas.join(", ")),
                "use an area of the scene's furniture",
            ));
        }
        if file.instructions.is_empty() || file.instructions.iter().any(|s| s.trim().is_empty()) {
            return Err(place.key("instructions").wrong(
                format!("{:?}", file.instructions),
                "at least one sentence, none empty",
                "write what a person would ask for",
            ));
        }
        let start = place.key("start");
        let spec = Self {
            name: name.to_owned(),
            activity: file.activity,
            area: file.area,
            scene: file.scene,
            targets,
            goal: file.goal,
            instructions: file.instructions,
            time_limit: place.key("time_limit").within(
                file.time_limit,
                1.0,
                3600.0,
                "s",
                "times are simulated seconds",
            )?,
            start: StartSpec {
                x: range(&start.key("x"), file.start.x, -50.0, 50.0, "m")?,
                y: range(&start.key("y"), file.start.y, -50.0, 50.0, "m")?,
                yaw: angles(&start.key("yaw_deg"), file.start.yaw_deg)?,
            },
            places: file
                .place
                .iter()
                .map(|entry| read_place(&place.entry("place", &entry.object), scene, entry))
                .collect::<Result<_, _>>()?,
            slides: file
                .slide
                .iter()
                .map(|entry| read_slide(&place.entry("slide", &entry.joint), scene, entry))
                .collect::<Result<_, _>>()?,
            conditions: file
                .condition
                .into_iter()
                .map(|entry| ConditionSpec {
                    predicate: entry.predicate,
                    required: entry.required,
                })
                .collect(),
            failure: read_failure(&place.key("failure"), &file.failure)?,
        };
        spec.check_conditions(&place, scene)?;
        spec.check_goal(&place, scene)?;
        spec.check_room(&place, scene)?;
        Ok(spec)
    }

    fn check_conditions(&self, place: &Place, scene: &Scene) -> Result<(), SceneError> {
        if !self.conditions.iter().any(|c| c.required) {
            return Err(place.key("condition").wrong(
                format!("a list of {} without a required one", self.conditions.len()),
                "at least one condition with required = true",
                "say what success is",
            ));
        }
        for condition in &self.conditions {
            let place = place.entry("condition", condition.label());
            let predicate = condition.predicate.as_dyn();
            for name in predicate.names() {
                known(&place, scene, name)?;
            }
            for Threshold {
                key,
                value,
                unit,
                most,
            } in predicate.thresholds()
            {
                let why = "thresholds are m, s, N and, in keys with _deg, degrees";
                place.key(key).within(value, 0.0, most, unit, why)?;
            }
        }
        Ok(())
    }

    /// Refuses a goal that success does not depend on.
    fn check_goal(&self, place: &Place, scene: &Scene) -> Result<(), SceneError> {
        let place = place.key("goal");
        let asked = match &self.goal {
            Goal::Lift => Name::Object(TARGET),
            Goal::Put { on } => Name::Surface(on),
            Goal::Open { joint, travel } => {
                let metres = "joint positions of furniture are metres";
                place
                    .key("open.travel")
                    .within(*travel, 0.0, 2.0, "m", metres)?;
                Name::Joint(joint)
            }
        };
        known(&place, scene, asked)?;
        let is_target = |object: &str| object == TARGET || self.targets.iter().any(|t| t == object);
        let required = self.conditions.iter().filter(|c| c.required);
        let judged = required
            .flat_map(|c| c.predicate.as_dyn().names())
            .any(|name| match (name, asked) {
                (Name::Object(object), Name::Object(_)) => is_target(object),
                _ => name == asked,
            });
        if judged {
            return Ok(());
        }
        Err(place.wrong(
            format!("{:?}", self.goal),
            "what a required condition names",
            "say what is to be done, and judge it by a condition with required = true",
        ))
    }

    /// Refuses ranges in which the objects find no room.
    fn check_room(&self, place: &Place, scene: &Scene) -> Result<(), SceneError> {
        let worst = (0..8)
            .map(|seed| clearance_of(self, scene, seed))
            .fold(f64::INFINITY, f64::min);
        if worst < 0.0 {
            return Err(place.key("place").wrong(
                format!("so tight that objects overlap by {:.0} mm", -worst * 1000.0),
                "ranges with room for all objects and the gripper",
                "widen the ranges or move other objects of the scene away",
            ));
        }
        Ok(())
    }
}

fn read_failure(place: &Place, entry: &FailureEntry) -> Result<FailureSpec, SceneError> {
    let metres = "lengths are metres";
    Ok(FailureSpec {
        drop: place
            .key("drop")
            .within(entry.drop, 0.005, 1.0, "m", metres)?,
        tilt: place
            .key("tilt_deg")
            .within(entry.tilt_deg, 5.0, 180.0, "degrees", "angles are degrees")?
            .to_radians(),
        reach: entry
            .reach
            .map(|reach| place.key("reach").within(reach, 0.05, 5.0, "m", metres))
            .transpose()?,
        force: place.key("force").within(
            entry.force,
            1.0,
            1e5,
            "N",
            "it is a force that ends the episode, well above that of a hard touch",
        )?,
    })
}

fn read_place(place: &Place, scene: &Scene, entry: &PlaceEntry) -> Result<PlaceSpec, SceneError> {
    known_object(place, scene, &entry.object)?;
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
    })
}

fn read_slide(place: &Place, scene: &Scene, entry: &SlideEntry) -> Result<SlideSpec, SceneError> {
    let [friction, damping] = ["friction", "damping"].map(|key| place.key(key));
    known_joint(&place.key("joint"), scene, &entry.joint)?;
    Ok(SlideSpec {
        joint: entry.joint.clone(),
        friction: range(&friction, entry.friction, 0.0, 1000.0, "N")?,
        damping: range(&damping, entry.damping, 0.0, 10_000.0, "N·s/m")?,
    })
}

/// Refuses a name that the scene has not.
fn known(place: &Place, scene: &Scene, name: Name<'_>) -> Result<(), SceneError> {
    match name {
        Name::Object(TARGET) => Ok(()),
        Name::Object(object) => known_object(&place.key("object"), scene, object),
        Name::Surface(on) => scene.surface(place, on, None).map(|_| ()),
        Name::Joint(joint) => known_joint(&place.key("joint"), scene, joint),
    }
}

fn known_joint(place: &Place, scene: &Scene, name: &str) -> Result<(), SceneError> {
    if scene.joint_named(name).is_some() {
        return Ok(());
    }
    let known: Vec<_> = scene.joints.iter().map(|j| j.name.as_str()).collect();
    Err(place.wrong(
        format!("{name:?}"),
        format!("one of {}", known.join(", ")),
        "correct the name or give the furniture a slide",
    ))
}

fn known_object(place: &Place, scene: &Scene, name: &str) -> Result<(), SceneError> {
    if scene.object_named(name).is_some() {
        return Ok(());
    }
    let known: Vec<_> = scene.objects.iter().map(|o| o.name.as_str()).collect();
    Err(place.wrong(
        format!("{name:?}"),
        format!("one of {}", known.join(", ")),
        format!(
            "correct the name or add the object to scenes/{}.toml",
            scene.name
        ),
    ))
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
