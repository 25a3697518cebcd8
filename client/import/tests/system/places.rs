//! Places of imported and authored homes, on existing surfaces.

use std::path::{Path, PathBuf};

use wheelarm_homes::home_places::{self, HomePlaces, PlaceRobot};
use wheelarm_homes::home_report::{Finding, Home, Posture, RobotFacts};
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

fn added(pack: &Pack) -> HomePlaces {
    let robot = robot();
    let robot = PlaceRobot {
        drives: &robot,
        starts: &robot,
    };
    home_places::add(pack, robot).unwrap()
}

fn kind_of<'a>(pack: &'a Pack, home: &HomeFile, piece: &str) -> &'a KindFile {
    let entry = home.piece.iter().find(|entry| entry.name == piece).unwrap();
    &pack.kinds()[&entry.kind]
}

/// Checks every place; returns the names of the pieces.
fn check(found: &HomePlaces) -> Vec<String> {
    let pack = Pack::from_zip(&found.pack.to_zip().unwrap()).unwrap();
    let home = pack.home().unwrap();
    let mut pieces = Vec::new();
    for place in &home.place {
        let kind = kind_of(&pack, home, &place.on);
        let surface = kind.surfaces.iter().find(|s| s.name == place.surface);
        let surface = surface.unwrap();
        let (inwards, along) = (place.inwards, place.along);
        assert!(0.0 < inwards[0] && inwards[0] <= inwards[1] && inwards[1] < surface.depth);
        assert!(along[0] <= along[1] && along.iter().all(|a| a.abs() < surface.width / 2.0));
        assert!(place.headroom > 0.2, "{place:?}");
        let (x, y) = (place.start.x, place.start.y);
        for at in [[x[0], y[0]], [x[1], y[1]]] {
            let is_inside = home.room.iter().any(|room| contains(&room.outline, at));
            assert!(is_inside, "{} starts at {at:?}", place.on);
        }
        pieces.push(place.on.clone());
    }
    pieces
}

#[test]
fn each_reached_surface_has_a_place_or_a_reason() {
    let found = added(&imported(&Flat::new()));
    let reached = found.reached + found.reached_within;
    assert!(found.reached > 0 && reached <= found.surfaces);
    let pieces = check(&found);
    assert_eq!(pieces.len() + found.skipped.len(), reached);
    assert!(pieces.contains(&"kitchen_cabinet".to_owned()), "{pieces:?}");
    let places = &found.pack.home().unwrap().place;
    let apart = places.iter().filter(|place| place.apart).count();
    assert!(apart <= found.reached_within);
    let cabinet = places.iter().find(|place| place.on == "kitchen_cabinet");
    assert!(cabinet.unwrap().room.is_some());
}

#[test]
fn each_door_that_the_report_opens_has_a_handle_with_a_start_in_a_room() {
    let pack = imported(&Flat::new());
    let home = Home::from_pack(&pack).unwrap();
    let report = Finding::new(&home, &robot()).report;
    let found = added(&pack);
    assert_eq!(found.leaves, report.leaves.len());
    let home = found.pack.home().unwrap();
    for handle in &home.handle {
        let leaf = report.leaves.iter().find(|leaf| leaf.piece == handle.on);
        let leaf = leaf.expect("a leaf of the report");
        assert_eq!(leaf.stop.is_none(), handle.apart, "{handle:?}");
        assert!(leaf.allowed, "{leaf:?}");
        let at = [handle.start.x[0], handle.start.y[0]];
        assert!(home.room.iter().any(|room| contains(&room.outline, at)));
    }
    let opened = report.leaves.iter().filter(|leaf| leaf.stop.is_some());
    for leaf in opened {
        let mut handles = home.handle.iter();
        assert!(handles.any(|handle| handle.on == leaf.piece), "{leaf:?}");
    }
}

#[test]
fn equal_homes_give_equal_places() {
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
fn surface_without_reach_has_no_place() {
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
    let robot = PlaceRobot {
        drives: &robot,
        starts: &robot,
    };
    let error = home_places::add(&pack, robot).unwrap_err().to_string();
    assert!(error.contains("has no home.toml"), "{error}");
}
