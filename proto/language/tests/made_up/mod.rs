//! Scenes sampled from the ranges of `assets/areas`, without the server's rule that
//! every target can be grasped: objects are at least 0.12 m apart.

use std::path::Path;

use serde::Deserialize;
use wheelarm_language::{Grammar, Home, Meaning, Role, Scene, Verb};
use wheelarm_proto::random::{self, SPLITMIX64_STEP, SplitMix64};

pub fn text(path: &str) -> String {
    let full = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../assets")
        .join(path);
    std::fs::read_to_string(&full).unwrap_or_else(|e| panic!("{}: {e}", full.display()))
}

fn names(folder: &str) -> Vec<String> {
    let full = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../assets")
        .join(folder);
    let entries = std::fs::read_dir(full).expect("a folder of the assets");
    let names = entries.map(|e| {
        e.expect("an entry")
            .file_name()
            .to_string_lossy()
            .into_owned()
    });
    let mut names: Vec<String> = names.filter(|n| n.ends_with(".toml")).collect();
    names.sort();
    names
}

pub fn grammar() -> Grammar {
    Grammar::read(&|name| Some(text(&format!("language/{name}")))).unwrap_or_else(|e| panic!("{e}"))
}

pub fn home() -> Home {
    let objects = names("objects")
        .into_iter()
        .map(|name| format!("objects/{name}"));
    let paths = objects.chain(["scenes/home.toml".to_owned()]);
    let texts: Vec<(String, String)> = paths.map(|path| (path.clone(), text(&path))).collect();
    let texts = texts
        .iter()
        .map(|(path, text)| (path.as_str(), text.as_str()));
    Home::read(texts).expect("a home")
}

/// Names of the tasks with their sentences.
pub fn tasks() -> Vec<(String, Vec<String>)> {
    #[derive(Deserialize)]
    struct Task {
        instructions: Vec<String>,
    }
    let read = |name: String| {
        let task: Task = toml::from_str(&text(&format!("tasks/{name}"))).expect("a task");
        (name.trim_end_matches(".toml").to_owned(), task.instructions)
    };
    names("tasks").into_iter().map(read).collect()
}

#[derive(Deserialize)]
struct AreaFile {
    #[serde(default)]
    place: Vec<Place>,
    #[serde(default)]
    variant: Vec<Variant>,
}

#[derive(Deserialize)]
struct Variant {
    #[serde(default)]
    place: Vec<Place>,
}

#[derive(Clone, Deserialize)]
struct Place {
    object: String,
    on: String,
    inwards: [f64; 2],
    along: [f64; 2],
    chance: Option<f64>,
}

/// Random numbers between 0 and 1 from a seed.
pub struct TestRandom(SplitMix64);

impl TestRandom {
    pub fn from_seed(seed: u64) -> Self {
        Self(SplitMix64(seed.wrapping_mul(SPLITMIX64_STEP)))
    }

    pub fn fraction(&mut self) -> f64 {
        random::fraction(self.0.bits())
    }
}

/// A scene with the objects of all areas, including the bear's.
pub fn scene(home: &Home, seed: u64) -> Scene {
    let mut scene = home.scene(&|_| true);
    let mut draws = TestRandom::from_seed(seed);
    let mut all: Vec<Place> = Vec::new();
    for name in names("areas") {
        let file: AreaFile = toml::from_str(&text(&format!("areas/{name}"))).expect("an area");
        let mut places = file.place;
        for variant in file.variant {
            places.retain(|p| variant.place.iter().all(|own| own.object != p.object));
            places.extend(variant.place);
        }
        for place in places {
            if place.chance.is_some_and(|chance| draws.fraction() > chance) {
                continue;
            }
            // An object of two areas is placed in one of them.
            if all.iter().all(|known| known.object != place.object) {
                all.push(place);
            }
        }
    }
    // Objects with the least room first.
    let room = |place: &Place| {
        let [inwards, along] = [place.inwards, place.along].map(|[low, high]| high - low);
        inwards * along
    };
    all.sort_by(|a, b| room(a).total_cmp(&room(b)));
    for place in &all {
        stand(&mut scene, home, place, &mut draws);
    }
    scene
}

fn stand(scene: &mut Scene, home: &Home, place: &Place, draws: &mut TestRandom) {
    let area = scene
        .areas
        .iter()
        .find(|a| a.name == place.on)
        .expect("an area")
        .clone();
    let mut within = |[low, high]: [f64; 2]| low + (high - low) * draws.fraction();
    for _ in 0..200 {
        let (inwards, along) = (within(place.inwards), within(place.along));
        let index = scene.areas.iter().position(|a| a.name == place.on);
        let is_free = scene.entities.iter().all(|t| {
            t.area != index
                || t.role != Role::Object
                || wheelarm_proto::exact::hypot(t.at[0] - inwards, t.at[1] - along) > 0.12
        });
        if is_free {
            put(scene, home, &place.object, &area.name, [inwards, along]);
            return;
        }
    }
    panic!("no room for {}", place.object);
}

/// Puts an object on an area: inwards from its edge, along it to the left.
pub fn put(scene: &mut Scene, home: &Home, object: &str, area: &str, [inwards, along]: [f64; 2]) {
    let on = scene
        .areas
        .iter()
        .find(|a| a.name == area)
        .expect("an area");
    let (sin, cos) = wheelarm_proto::exact::sin_cos(on.inwards);
    let at = [
        on.edge[0] + cos * inwards - sin * along,
        on.edge[1] + sin * inwards + cos * along,
        on.edge[2],
    ];
    scene.add(object, home.words_of(object), Role::Object, at, None);
    assert!(
        scene.entities.last().is_some_and(|t| t.area.is_some()),
        "{object} is on no area"
    );
}

/// The scene of the hand-written sentences.
pub fn fixed(home: &Home) -> Scene {
    let mut scene = home.scene(&|_| true);
    for (object, area, at) in [
        ("mustard", "coffee_table", [0.20, 0.30]),
        ("tomato_soup", "coffee_table", [0.22, 0.05]),
        ("crackers", "coffee_table", [0.25, -0.30]),
        ("grey_cup", "coffee_table", [0.15, -0.50]),
        ("coffee_can", "coffee_table", [0.50, 0.05]),
        ("sugar_box", "coffee_table", [0.50, 0.45]),
        ("blue_mug", "kitchen_table", [0.20, 0.50]),
        ("silver_bottle", "kitchen_table", [0.20, 0.20]),
        ("glass_bottle", "kitchen_table", [0.35, -0.40]),
        ("bowl", "kitchen_table", [0.15, -0.15]),
        ("meat_can", "kitchen_table", [0.35, 0.45]),
        ("knife", "kitchen_table", [0.15, -0.30]),
        ("teddy_bear", "kitchen_table", [0.25, 0.02]),
        ("coke_1", "shelf", [0.10, 0.225]),
        ("coke_2", "shelf", [0.10, 0.075]),
        ("coke_3", "shelf", [0.10, -0.075]),
        ("coke_4", "shelf", [0.10, -0.225]),
    ] {
        put(&mut scene, home, object, area, at);
    }
    scene
}

/// All possible requests in a scene.
pub fn wishes(scene: &Scene) -> Vec<Meaning> {
    let mut out = Vec::new();
    for (target, entity) in scene.entities.iter().enumerate() {
        let goal = match entity.name.as_str() {
            "knife" => Some("placemat"),
            "teddy_bear" => Some("bear_cushion"),
            _ => None,
        };
        let mut add = |verb, goal| out.push(Meaning { verb, target, goal });
        match (entity.role, goal) {
            (Role::Slide, _) => {
                add(Verb::Open, None);
                add(Verb::Close, None);
            }
            (Role::Object, Some(goal)) => add(Verb::Put, scene.named(goal)),
            (Role::Object, None) => {
                add(Verb::Lift, None);
                match entity.name.as_str() {
                    "straw_cup" | "feeding_spoon" => add(Verb::Bring, None),
                    "remote_control" => add(Verb::Give, None),
                    "meat_can" => add(Verb::Put, scene.named("table_bin")),
                    _ => {}
                }
            }
            (Role::Goal, _) => {}
        }
    }
    out
}

/// A task of the library: action, object and goal.
#[derive(Clone, Debug)]
pub struct Task {
    /// Name of its file.
    pub name: String,
    /// Area of its objects.
    pub area: String,
    verb: Verb,
    object: Query,
    goal: Option<String>,
}

#[derive(Clone, Debug, Default, Deserialize)]
struct Query {
    name: Option<String>,
    category: Option<String>,
}

/// The tasks of the library, sorted by name.
pub fn library() -> Vec<Task> {
    #[derive(Deserialize)]
    struct File {
        area: String,
        template: Verb,
        object: Query,
        #[serde(default)]
        place: Query,
    }
    let read = |name: String| {
        let file: File = toml::from_str(&text(&format!("tasks/{name}"))).expect("a task");
        Task {
            name: name.trim_end_matches(".toml").to_owned(),
            area: file.area,
            verb: file.template,
            object: file.object,
            goal: file.place.name,
        }
    };
    names("tasks").into_iter().map(read).collect()
}

impl Task {
    /// A scene with the objects of the task's area, and those of the areas on other
    /// furniture.
    pub fn scene(&self, home: &Home, seed: u64) -> Scene {
        let mut scene = home.scene(&|name| self.goal.as_deref() == Some(name));
        let bear = self.object.name.as_deref() == Some("teddy_bear");
        let own: Vec<Place> = places(&self.area, bear);
        let mut draws = TestRandom::from_seed(seed);
        let others = ["coffee_table", "kitchen_table", "shelf"];
        let others = others
            .iter()
            .filter(|area| own.iter().all(|place| place.on != **area));
        let rest: Vec<Place> = others.flat_map(|area| places(area, false)).collect();
        for place in own.iter().chain(&rest) {
            let is_absent = place.chance.is_some_and(|chance| draws.fraction() > chance);
            if !is_absent && scene.named(&place.object).is_none() {
                stand(&mut scene, home, place, &mut draws);
            }
        }
        scene
    }

    /// The task's request in a scene; the seed selects among several objects.
    pub fn wish(&self, scene: &Scene, seed: u64) -> Meaning {
        let fits = |i: &usize| {
            let entity = &scene.entities[*i];
            let is_named = self.object.name.as_ref().is_some_and(|n| *n == entity.name);
            let on = |area: usize| scene.areas[area].name == self.area;
            let category = self.object.category.as_ref();
            let is_of =
                category.is_some_and(|c| *c == entity.category && entity.area.is_some_and(on));
            is_named || is_of
        };
        let all: Vec<usize> = (0..scene.entities.len()).filter(fits).collect();
        let chosen = (TestRandom::from_seed(seed ^ 0x7a5c).fraction() * all.len() as f64) as usize;
        Meaning {
            verb: self.verb,
            target: all[chosen.min(all.len() - 1)],
            goal: self.goal.as_ref().and_then(|goal| scene.named(goal)),
        }
    }
}

/// Objects of an area with their positions, those of its variants on request.
fn places(area: &str, with_variants: bool) -> Vec<Place> {
    let file: AreaFile = toml::from_str(&text(&format!("areas/{area}.toml"))).expect("an area");
    let mut places = file.place;
    for variant in file.variant.into_iter().filter(|_| with_variants) {
        places.retain(|p| variant.place.iter().all(|own| own.object != p.object));
        places.extend(variant.place);
    }
    places
}
