//! Reads `assets/tasks/NAME.toml`, resolves its queries in its area and checks it
//! against the scene.

use std::collections::BTreeMap;
use std::path::Path;

use super::area::AreaSpec;
use super::area_load::scene_of;
use super::condition::{Name, Threshold};
use super::context::TARGET;
use super::file::TaskFile;
use super::goal::{Goal, JointBounds};
use super::home_query;
use super::home_sites::HomeQuery;
use super::name_check::check_name;
use super::spec::{FailureSpec, TaskSpec, WaitSpec};
use super::stock;
use super::template::{FailureEntry, PersonEntry, Template, Verb};
use crate::robot::CorridorSettings;
use crate::scene::{Files, Place, Scene, SceneError, names, provenance};

/// Every task below `assets/tasks`, by name, for a robot with this hand.
///
/// # Errors
/// When one of them is invalid.
pub fn list(assets: &Path, hand: &CorridorSettings) -> Result<Vec<TaskSpec>, SceneError> {
    let names = names(assets, "tasks")?;
    each(assets, names, hand).collect()
}

/// The usable tasks below `assets/tasks`, those of the pack of `scene`, and those below
/// `assets/home_tasks` that `scene` satisfies. A task that is invalid costs itself: it is logged
/// and left out.
///
/// # Errors
/// When the folder of tasks cannot be read.
pub fn usable(
    assets: &Path,
    scene: Option<&Scene>,
    hand: &CorridorSettings,
) -> Result<Vec<TaskSpec>, SceneError> {
    let of_assets = each(assets, names(assets, "tasks")?, hand);
    let queries = scene.map_or_else(Vec::new, |scene| of_home(assets, scene, hand));
    let scene = scene.filter(|scene| scene.pack.is_some());
    let packed = scene.into_iter().flat_map(|scene| {
        let pack = scene.pack.iter();
        let names = pack.flat_map(|pack| pack.names("tasks", "toml").map(str::to_owned));
        names
            .map(|name| TaskSpec::load(assets, &name, scene, hand))
            .collect::<Vec<_>>()
    });
    let usable = of_assets.chain(packed).filter_map(|task| {
        task.inspect_err(|error| tracing::warn!("a task is left out: {error}"))
            .ok()
    });
    Ok(usable.chain(queries).collect())
}

/// The tasks below `assets/home_tasks` that a scene satisfies.
fn of_home(assets: &Path, scene: &Scene, hand: &CorridorSettings) -> Vec<TaskSpec> {
    // Assets of older versions lack the folder.
    let names = names(assets, HOME_TASKS).unwrap_or_default().into_iter();
    let load = |name: String| match TaskSpec::load(assets, &name, scene, hand) {
        Ok(task) => Some(task),
        Err(SceneError::NotOffered { .. }) => None,
        Err(error) => {
            tracing::warn!("a task is left out: {error}");
            None
        }
    };
    match scene.places.is_empty() && scene.handles.is_empty() {
        true => Vec::new(),
        false => names.filter_map(load).collect(),
    }
}

/// Each of the named tasks of the assets.
fn each(
    assets: &Path,
    names: Vec<String>,
    hand: &CorridorSettings,
) -> impl Iterator<Item = Result<TaskSpec, SceneError>> {
    // Most tasks share a scene and an area, which take far longer to read.
    let mut scenes: BTreeMap<String, Scene> = BTreeMap::new();
    let mut areas: BTreeMap<String, AreaSpec> = BTreeMap::new();
    let files = Files::of_assets(assets);
    names.into_iter().map(move |name| {
        let file = read(files, &name)?;
        let Some(area_name) = file.area.clone() else {
            return Err(place(&name).key("area").wrong(
                "absent",
                "an area in assets/tasks",
                "name one, or move the file to assets/home_tasks",
            ));
        };
        let scene_name = scene_of(files, &place(&name).key("area"), &area_name)?;
        if !scenes.contains_key(&scene_name) {
            let scene = Scene::load(assets, &scene_name)?;
            scenes.insert(scene_name.clone(), scene);
        }
        let scene = &scenes[&scene_name];
        if !areas.contains_key(&area_name) {
            let area = AreaSpec::load(assets, &area_name, scene, hand)?;
            areas.insert(area_name.clone(), area);
        }
        let area = areas[&area_name].clone();
        TaskSpec::checked(assets, &name, file, area, scene)
    })
}

fn place(name: &str) -> Place {
    Place::file(&format!("tasks/{name}.toml"))
}

/// Folder of the tasks of every home.
const HOME_TASKS: &str = "home_tasks";

/// Path of a task below the assets folder, or in the pack of the scene.
pub(super) fn path_of(files: Files<'_>, name: &str) -> String {
    let [own, of_home] = ["tasks", HOME_TASKS].map(|folder| format!("{folder}/{name}.toml"));
    match !files.contains(&own) && files.contains(&of_home) {
        true => of_home,
        false => own,
    }
}

/// The scene with the objects that the task samples: those of the stock, when it has no area.
///
/// # Errors
/// When a file is missing or a value is invalid.
pub fn stocked(assets: &Path, task: &str, scene: Scene) -> Result<Scene, SceneError> {
    let files = Files::of_scene(assets, &scene);
    match task.is_empty() || read(files, task)?.area.is_some() {
        true => Ok(scene),
        false => home_query::stocked(assets, &scene),
    }
}

fn read(files: Files<'_>, name: &str) -> Result<TaskFile, SceneError> {
    let path = path_of(files, name);
    let file: TaskFile = files.parse(&path)?;
    provenance(&Place::file(&path), &file.origin, &file.license)?;
    Ok(file)
}

impl TaskSpec {
    /// Reads `assets/tasks/NAME.toml` and checks it against its scene, loaded with all
    /// optional furniture.
    ///
    /// # Errors
    /// When a file is missing or a value is invalid.
    pub fn load(
        assets: &Path,
        name: &str,
        scene: &Scene,
        hand: &CorridorSettings,
    ) -> Result<Self, SceneError> {
        let files = Files::of_scene(assets, scene);
        let file = read(files, name)?;
        let Some(area) = file.area.clone() else {
            let scene = home_query::stocked(assets, scene)?;
            let path = path_of(files, name);
            return home_query::read(assets, (name, &path), file, &scene, hand);
        };
        scene_of(files, &place(name).key("area"), &area)?;
        let area = AreaSpec::load(assets, &area, scene, hand)?;
        Self::checked(assets, name, file, area, scene)
    }

    /// A task that is a query, before its place and target are sampled.
    pub(super) fn from_query(
        (name, path): (&str, &str),
        file: TaskFile,
        (area, targets, goal): (AreaSpec, Vec<String>, Goal),
        query: HomeQuery,
    ) -> Result<Self, SceneError> {
        let place = &Place::file(path);
        check_instructions(place, &file.instructions)?;
        let template = &query.template;
        let time_limit = file.time_limit.unwrap_or(home_query::TIME_LIMIT);
        Ok(Self {
            name: name.to_owned(),
            files: vec![path.to_owned(), stock::FILE.to_owned()],
            activity: file.activity,
            goal,
            area,
            targets,
            rivals: Vec::new(),
            instructions: file.instructions,
            time_limit: check_time_limit(place, time_limit)?,
            conditions: template.conditions(&file.template, None, None)?,
            failure: read_failure(&place.key("thresholds.failure"), &template.failure)?,
            waits: read_waits(&place.key("template"), template.person)?,
            template: file.template,
            query: Some(query),
        })
    }

    /// Checks a query with its place and its target.
    pub(super) fn check_resolved(&self, scene: &Scene) -> Result<(), SceneError> {
        self.check_conditions(&self.place(), scene)?;
        self.check_goal(&self.place())
    }

    fn checked(
        assets: &Path,
        name: &str,
        file: TaskFile,
        area: AreaSpec,
        scene: &Scene,
    ) -> Result<Self, SceneError> {
        let place = place(name);
        let template = Template::read(assets, &place, &file.template, &file.thresholds)?;
        let object_key = place.key("object");
        let region = match (template.goal, &file.place) {
            (Verb::Put, Some(to)) => {
                let place = place.key("place");
                Some(to.region_query(&place)?.region(&place, &area, scene)?)
            }
            (Verb::Put, None) => {
                return Err(place.key("place").wrong(
                    "absent",
                    "where to put the object",
                    "for example place = { name = \"placemat\" }",
                ));
            }
            (_, Some(_)) => {
                return Err(place.key("place").wrong(
                    "given",
                    format!("none with the template {:?}", file.template),
                    "leave it out, or take the template \"put\"",
                ));
            }
            (_, None) => None,
        };
        let targets = match template.goal {
            Verb::Lift | Verb::Put | Verb::Give | Verb::Bring => {
                file.object.objects(&object_key, &area, scene)?
            }
            Verb::Open | Verb::Close => file.object.sliding(&object_key, &area, scene)?,
        };
        if file.from.is_some() {
            return Err(place.key("from").wrong(
                "given beside area",
                "one of them",
                "leave out the area, or from",
            ));
        }
        check_instructions(&place, &file.instructions)?;
        let joint_of = |name: &String| {
            let joint = scene.furniture_named(name).and_then(|i| scene.joint_of(i));
            joint.map_or(String::new(), |joint| joint.name.clone())
        };
        let joint = targets.first().map(joint_of).unwrap_or_default();
        let single = match &targets[..] {
            [only] => Some([only.as_str(), joint.as_str()]),
            _ => None,
        };
        let conditions = template.conditions(&file.template, single, region.as_deref())?;
        let time_limit = file.time_limit.unwrap_or(template.time_limit);
        let mut spec = Self {
            name: name.to_owned(),
            files: vec![
                format!("tasks/{name}.toml"),
                format!("areas/{}.toml", area.name),
            ],
            template: file.template,
            activity: file.activity,
            goal: Goal::Lift,
            area,
            targets,
            rivals: Vec::new(),
            instructions: file.instructions,
            time_limit: check_time_limit(&place, time_limit)?,
            conditions,
            failure: read_failure(&place.key("thresholds.failure"), &template.failure)?,
            waits: read_waits(&place.key("template"), template.person)?,
            query: None,
        };
        spec.check_conditions(&place, scene)?;
        spec.goal = match (template.goal, region) {
            (Verb::Lift, _) => Goal::Lift,
            (Verb::Give, _) => Goal::Give,
            (Verb::Bring, _) => Goal::Bring,
            (Verb::Put, region) => Goal::Put {
                on: region.unwrap_or_default(),
            },
            (Verb::Open, _) => Goal::Open(spec.joint_bounds()),
            (Verb::Close, _) => Goal::Close(spec.joint_bounds()),
        };
        spec.check_goal(&place)?;
        spec.check_tips(&object_key, scene)?;
        if spec.variants().next().is_none() {
            let offers = |v: &super::area::Variant| match v.name.as_str() {
                "" => "the area by itself".to_owned(),
                name => format!("the variant {name:?}"),
            };
            let known: Vec<_> = spec.area.variants.iter().map(offers).collect();
            return Err(object_key.wrong(
                format!("{} with {:?}", spec.targets.join(", "), spec.region_name()),
                format!("all of it together in {}", known.join(" or ")),
                format!("ask for less, or add to areas/{}.toml", spec.area.name),
            ));
        }
        Ok(spec)
    }

    /// The joint position required for success.
    pub(super) fn joint_bounds(&self) -> JointBounds {
        let mut required = self.conditions.iter().filter(|c| c.required);
        let found = required.find_map(|c| c.predicate.joint_bounds());
        found.unwrap_or_default()
    }

    fn check_conditions(&self, place: &Place, scene: &Scene) -> Result<(), SceneError> {
        if !self.conditions.iter().any(|c| c.required) {
            return Err(place.key("template").wrong(
                format!("a list of {} without a required one", self.conditions.len()),
                "at least one condition with required = true",
                "define success",
            ));
        }
        for condition in &self.conditions {
            let predicate = condition.predicate.as_dyn();
            let place = place.key("thresholds").key(predicate.word());
            for name in predicate.names() {
                check_name(&place, scene, name)?;
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

    /// Rejects a goal that is not required for success.
    fn check_goal(&self, place: &Place) -> Result<(), SceneError> {
        let is_target = |name: &str| name == TARGET || self.targets.iter().any(|t| t == name);
        let required = self.conditions.iter().filter(|c| c.required);
        let judged = required
            .flat_map(|c| c.predicate.as_dyn().names())
            .any(|name| match (name, &self.goal) {
                (Name::Object(object), Goal::Lift | Goal::Give | Goal::Bring) => is_target(object),
                (Name::Surface(surface), Goal::Put { on }) => surface == on,
                (Name::Joint(_), Goal::Open(_) | Goal::Close(_)) => true,
                _ => false,
            });
        if judged {
            return Ok(());
        }
        Err(place.key("template").wrong(
            format!("{:?}", self.goal),
            "what a required condition names",
            "name the goal in a condition with required = true",
        ))
    }

    /// Rejects a target without a tip for the goal `bring`.
    fn check_tips(&self, object_key: &Place, scene: &Scene) -> Result<(), SceneError> {
        if self.goal != Goal::Bring {
            return Ok(());
        }
        let tip = |name: &String| scene.objects[scene.object_named(name)?].tip;
        match self.targets.iter().find(|name| tip(name).is_none()) {
            None => Ok(()),
            Some(name) => Err(object_key.wrong(
                format!("{name:?}, which has no tip"),
                "an object with a tip",
                "name another, or give `tip` in the object's file: the point to drink or eat from",
            )),
        }
    }
}

fn check_instructions(place: &Place, sentences: &[String]) -> Result<(), SceneError> {
    if sentences.is_empty() || sentences.iter().any(|s| s.trim().is_empty()) {
        return Err(place.key("instructions").wrong(
            format!("{sentences:?}"),
            "at least one sentence, none empty",
            "write what a person would say",
        ));
    }
    Ok(())
}

fn check_time_limit(place: &Place, seconds: f64) -> Result<f64, SceneError> {
    let why = "times are simulated seconds";
    place
        .key("time_limit")
        .within(seconds, 1.0, 3600.0, "s", why)
}

fn read_waits(place: &Place, entry: Option<PersonEntry>) -> Result<WaitSpec, SceneError> {
    let Some(PersonEntry { motion, mouth_open }) = entry else {
        return Ok(WaitSpec::default());
    };
    Ok(WaitSpec {
        motion: place.key("person.motion").within(
            motion,
            0.0,
            1.0,
            "",
            "0 sits still, 1 moves as people do who wait",
        )?,
        mouth_open,
    })
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
