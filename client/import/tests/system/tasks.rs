//! Tasks of imported and authored homes, whose files name existing objects and surfaces.

use std::path::{Path, PathBuf};

use wheelarm_import::home_report::{Posture, RobotFacts};
use wheelarm_import::home_tasks::{self, HomeTasks, MOST, TaskRobot};
use wheelarm_import::{Options, import};
use wheelarm_pack::{HomeFile, KindFile, Pack, contains};

use crate::flat::Flat;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn robot() -> RobotFacts {
    RobotFacts::read(&root().join("assets"), "wheelarm", Posture::Home).unwrap()
}

fn imported(flat: &Flat) -> Pack {
    let options = Options {
        name: "flat".into(),
        ..Options::default()
    };
    import("flat.sh3d", flat.bytes(), &options).unwrap().pack
}

fn added(pack: &Pack) -> HomeTasks {
    let robot = robot();
    let robot = TaskRobot {
        drives: &robot,
        starts: &robot,
    };
    home_tasks::add(pack, robot).unwrap()
}

fn table(pack: &Pack, path: &str) -> toml::Table {
    let bytes = pack.file(path).unwrap_or_else(|| panic!("no {path}"));
    toml::from_str(std::str::from_utf8(bytes).unwrap()).unwrap()
}

fn range(table: &toml::Table, key: &str) -> [f64; 2] {
    let values = table[key].as_array().unwrap();
    [0, 1].map(|i| values[i].as_float().unwrap())
}

fn kind_of<'a>(pack: &'a Pack, home: &HomeFile, piece: &str) -> &'a KindFile {
    let entry = home.piece.iter().find(|entry| entry.name == piece).unwrap();
    &pack.kinds()[&entry.kind]
}

/// Checks the files of every task; returns the names of the pieces.
fn check(found: &HomeTasks) -> Vec<String> {
    let pack = Pack::from_zip(&found.pack.to_zip().unwrap()).unwrap();
    let home = pack.home().unwrap();
    let mut pieces = Vec::new();
    for name in &found.tasks {
        let task = table(&pack, &format!("tasks/{name}.toml"));
        let object = task["object"]["name"].as_str().unwrap();
        assert_eq!(task["area"].as_str(), Some(name.as_str()));
        assert!(
            root()
                .join(format!("assets/objects/{object}.toml"))
                .is_file()
        );
        let entry = home.object.iter().find(|entry| entry.name == object);
        assert!(entry.unwrap().optional, "only its tasks place it");
        let area = table(&pack, &format!("areas/{name}.toml"));
        assert_eq!(area["scene"].as_str(), Some("flat"));
        let place = area["place"][0].as_table().unwrap();
        assert_eq!(place["object"].as_str(), Some(object));
        let on = place["on"].as_str().unwrap();
        let kind = kind_of(&pack, home, on);
        let named = |surface: &&wheelarm_pack::SurfaceEntry| {
            Some(surface.name.as_str()) == place["surface"].as_str()
        };
        let surface = kind.surfaces.iter().find(named).unwrap();
        let (inwards, along) = (range(place, "inwards"), range(place, "along"));
        assert!(0.0 < inwards[0] && inwards[0] <= inwards[1] && inwards[1] < surface.depth);
        assert!(along[0] <= along[1] && along.iter().all(|a| a.abs() < surface.width / 2.0));
        let start = area["start"].as_table().unwrap();
        let [x, y] = ["x", "y"].map(|key| range(start, key));
        for at in [[x[0], y[0]], [x[1], y[1]]] {
            let is_inside = home.room.iter().any(|room| contains(&room.outline, at));
            assert!(is_inside, "{name} starts at {at:?}");
        }
        pieces.push(on.to_owned());
    }
    pieces
}

#[test]
fn each_reached_surface_has_a_task_or_a_reason() {
    let found = added(&imported(&Flat::new()));
    let reached = found.reached + found.reached_within;
    assert!(found.reached > 0 && reached <= found.surfaces);
    assert_eq!(found.tasks.len() + found.skipped.len(), reached);
    assert!(found.tasks_within <= found.reached_within);
    assert!(!found.tasks.is_empty() && found.tasks.len() <= MOST);
    let pieces = check(&found);
    assert!(pieces.contains(&"kitchen_cabinet".to_owned()), "{pieces:?}");
    let name = &found.tasks[0];
    let task = table(&found.pack, &format!("tasks/{name}.toml"));
    let sentence = task["instructions"][0].as_str().unwrap();
    assert!(sentence.starts_with("Pick up the "), "{sentence}");
    assert!(sentence.contains(" in the "), "{sentence}");
}

#[test]
fn equal_homes_give_equal_tasks() {
    let zip = || added(&imported(&Flat::new())).pack.to_zip().unwrap();
    assert!(zip() == zip());
}

#[test]
fn authored_home_keeps_its_files_and_objects() {
    let flat = Pack::open(&root().join("tests/data/flat")).unwrap();
    let mut files = flat.files().clone();
    files.insert("README.md".into(), b"A flat.".to_vec());
    let before = Pack::from_files(files).unwrap();
    let found = added(&before);
    check(&found);
    for path in [
        "areas/flat_table.toml",
        "tasks/pick_jar.toml",
        "objects/jar.toml",
        "README.md",
    ] {
        assert_eq!(found.pack.file(path), before.file(path), "{path}");
    }
    let jars = found.pack.home().unwrap().object.iter();
    assert_eq!(jars.filter(|object| object.name == "jar_1").count(), 1);
}

#[test]
fn surface_without_reach_has_no_task() {
    // A cabinet that is higher than the arm.
    let high = Flat::new().with("height='85'", "height='190'");
    let found = added(&imported(&high));
    let pieces = check(&found);
    assert!(
        !pieces.contains(&"kitchen_cabinet".to_owned()),
        "{pieces:?}"
    );
}

#[test]
fn pack_without_a_home_is_rejected() {
    let flat = Pack::open(&root().join("tests/data/flat")).unwrap();
    let mut files = flat.files().clone();
    files.remove("home.toml");
    let pack = Pack::from_files(files).unwrap();
    let robot = robot();
    let robot = TaskRobot {
        drives: &robot,
        starts: &robot,
    };
    let error = home_tasks::add(&pack, robot).unwrap_err().to_string();
    assert!(error.contains("has no home.toml"), "{error}");
}
