//! The pack of a small home.

use std::collections::BTreeSet;

use wheelarm_import::{Imported, Joints, Options, import, write};
use wheelarm_pack::{OpeningKind, Pack, PartEntry, PieceEntry};

use crate::flat::{Flat, boxes};

fn options() -> Options {
    Options {
        name: "flat".into(),
        ..Options::default()
    }
}

fn imported(flat: &Flat) -> Imported {
    import("flat.sh3d", flat.bytes(), &options()).unwrap()
}

/// Smallest and largest coordinates of a collision shape.
fn extent(part: &PartEntry) -> ([f64; 3], [f64; 3]) {
    let corners = match (&part.hull, part.cuboid, part.at) {
        (Some(hull), _, _) => hull.clone(),
        (_, Some(size), Some(at)) => {
            let corner = |sign: f64| [0, 1, 2].map(|axis| at[axis] + sign * 0.5 * size[axis]);
            vec![corner(-1.0), corner(1.0)]
        }
        _ => panic!("neither a hull nor a box: {part:?}"),
    };
    let of = |pick: fn(f64, f64) -> f64| {
        let first = corners[0];
        corners.iter().fold(first, |best, p| {
            [0, 1, 2].map(|axis| pick(best[axis], p[axis]))
        })
    };
    (of(f64::min), of(f64::max))
}

fn piece<'a>(pack: &'a Pack, name: &str) -> &'a PieceEntry {
    let home = pack.home().unwrap();
    let found = home.piece.iter().find(|piece| piece.name == name);
    found.unwrap_or_else(|| panic!("no piece {name}"))
}

#[test]
fn rooms_walls_and_openings_are_those_of_the_plan() {
    let imported = imported(&Flat::new());
    let home = imported.pack.home().unwrap();
    let rooms: Vec<_> = home
        .room
        .iter()
        .map(|r| (r.name.as_str(), r.kind.as_str()))
        .collect();
    assert_eq!(rooms, [("wohnzimmer", "living_room"), ("kuche", "kitchen")]);
    assert_eq!(home.wall.len(), 5);
    assert_eq!(home.license, "CC0-1.0");
    // Plan x 0..8 m and y 0..4 m about the middle, y upwards.
    let first = &home.wall[0];
    assert!(
        (first.from[1] - 2.0).abs() < 1e-6 && first.from[0] < -4.0,
        "{first:?}"
    );
    assert!(
        (first.from[0] + 4.049).abs() < 1e-6,
        "joined to the outer corner"
    );
    assert_eq!(home.wall[4].end_height, Some(2.0));
    let kinds: Vec<_> = home.opening.iter().map(|o| (o.wall, o.kind)).collect();
    assert_eq!(
        kinds,
        [
            (4, OpeningKind::Frame),
            (3, OpeningKind::Door),
            (0, OpeningKind::Window)
        ],
        "the door between the rooms is open, the front door closed"
    );
    let window = &home.opening[2];
    assert!((window.sill - 0.9).abs() < 1e-9 && (window.width - 1.0).abs() < 1e-9);
    assert!((window.at - 2.049).abs() < 1e-6, "{window:?}");
}

#[test]
fn furniture_has_its_place_size_and_colour() {
    let imported = imported(&Flat::new());
    let pack = &imported.pack;
    let table = piece(pack, "table");
    assert_eq!(table.at, [-2.5, 0.5, 0.0]);
    assert_eq!(table.yaw_deg, -90.0);
    assert_eq!(table.room.as_deref(), Some("wohnzimmer"));
    let kind = &pack.kinds()[&table.kind];
    assert_eq!(kind.category, "table");
    assert_eq!(kind.collision.as_ref().unwrap().len(), 5);
    let surface = &kind.surfaces[0];
    assert_eq!(surface.edge, [0.4, 0.0, 0.74], "the front edge of the top");
    assert_eq!(
        (surface.inwards_deg, surface.depth, surface.width),
        (180.0, 0.8, 1.2)
    );
    let materials = pack.file("materials/home.toml").unwrap();
    assert!(String::from_utf8_lossy(materials).contains("#336699"));
    assert_eq!(piece(pack, "chair").yaw_deg, 90.0);
}

#[test]
fn every_piece_is_in_the_pack_or_left_out() {
    for flat in [
        Flat::new(),
        Flat::new().with("name='Stuhl'", "name='Stuhl' visible='false'"),
        Flat::new().without("3/table.obj"),
    ] {
        let summary = imported(&flat).summary;
        assert_eq!(summary.found, summary.placed + summary.left_out.len());
        assert_eq!(summary.found, 6);
    }
}

#[test]
fn door_of_a_cabinet_turns_to_the_front() {
    let imported = imported(&Flat::new());
    let pack = &imported.pack;
    let leaf = piece(pack, "kitchen_cabinet_door");
    assert_eq!(leaf.on.as_deref(), Some("kitchen_cabinet"));
    let joint = pack.kinds()[&leaf.kind].joint.as_ref().unwrap();
    assert!(joint.turns);
    // The pin is on the left of the model, which is -y of the kind; the leaf extends towards +y
    // and its edge moves to +x by a turn about -z.
    assert_eq!(joint.axis, [0.0, 0.0, -1.0]);
    assert!(joint.com[1] > 0.25);
    let [x, y, z] = joint.inertia;
    assert!(x + y > z && y + z > x && z + x > y, "{joint:?}");
    assert_eq!(
        pack.kinds()[&leaf.kind].grasps.len(),
        1,
        "the handle is 15 cm long"
    );
    // The inside of the carcass is free.
    let carcass = &pack.kinds()[&piece(pack, "kitchen_cabinet").kind];
    let fills = |part: &PartEntry| {
        let (low, high) = extent(part);
        (0..3).all(|axis| high[axis] - low[axis] > 0.3)
    };
    assert!(!carcass.collision.as_ref().unwrap().iter().any(fills));

    let without = Options {
        joints: Joints::None,
        ..options()
    };
    let closed = import("flat.sh3d", Flat::new().bytes(), &without).unwrap();
    assert_eq!(closed.summary.hinges, 0);
    let closed_cabinet = &closed.pack.kinds()[&piece(&closed.pack, "kitchen_cabinet").kind];
    assert!(closed_cabinet.collision.as_ref().unwrap().iter().any(fills));
}

#[test]
fn leaf_of_a_room_door_is_taken_out() {
    let pack = imported(&Flat::new()).pack;
    let open = &pack.kinds()[&piece(&pack, "door").kind];
    for part in open.collision.as_ref().unwrap() {
        let (low, high) = extent(part);
        let is_jamb = low[1] > 0.37 || high[1] < -0.37;
        let is_lintel = low[2] > 2.0;
        assert!(is_jamb || is_lintel, "{part:?}");
    }
    let front = &pack.kinds()[&piece(&pack, "door_2").kind];
    assert_eq!(
        front.collision.as_ref().unwrap().len(),
        1,
        "a plate across the opening"
    );
}

#[test]
fn door_between_two_ends_of_walls_is_a_passage() {
    let wall = "<wall id='wall4' xStart='400' yStart='0' xEnd='400' yEnd='400'";
    let parts = "<wall id='wall5' xStart='400' yStart='0' xEnd='400' yEnd='104' thickness='10'/>\
        <wall id='wall4' xStart='400' yStart='196' xEnd='400' yEnd='400'";
    let flat = Flat::new().with(wall, parts);
    // Rooms may leave a gap beside their walls.
    let flat = flat.with(
        "<point x='395' y='5'/><point x='395' y='395'/>",
        "<point x='370' y='5'/><point x='370' y='395'/>",
    );
    let pack = imported(&flat).pack;
    let kind = &pack.kinds()[&piece(&pack, "door").kind];
    for part in kind.collision.as_ref().unwrap() {
        let (low, high) = extent(part);
        assert!(low[2] > 2.0 || low[1].max(-high[1]) >= 0.39, "{part:?}");
    }
}

#[test]
fn sill_of_a_passage_does_not_collide() {
    let window = boxes(&[
        ("left", "white", [-0.45, 0.0, -0.06], [-0.40, 2.05, 0.06]),
        ("right", "white", [0.40, 0.0, -0.06], [0.45, 2.05, 0.06]),
        ("sill", "white", [-0.40, 0.0, -0.06], [0.40, 0.06, 0.06]),
        (
            "sweethome3d_opening_on_hinge_1_pane",
            "glass",
            [-0.40, 0.06, 0.0],
            [0.40, 2.05, 0.02],
        ),
        (
            "sweethome3d_hinge_1",
            "silver",
            [-0.40, 0.06, 0.0],
            [-0.39, 2.05, 0.01],
        ),
    ]);
    let pack = imported(&Flat::new().file("1/door.obj", window.as_bytes())).pack;
    let kind = &pack.kinds()[&piece(&pack, "door").kind];
    let parts = kind.collision.as_ref().unwrap();
    assert!(!parts.is_empty());
    for part in parts {
        let (low, high) = extent(part);
        assert!(low[1].max(-high[1]) >= 0.39, "{part:?}");
    }
}

#[test]
fn door_without_a_leaf_group_leaves_its_opening_free() {
    let solid = boxes(&[("door", "white", [-0.45, 0.0, -0.05], [0.45, 2.1, 0.05])]);
    let flat = Flat::new().file("1/door.obj", solid.as_bytes());
    let summary = imported(&flat).summary;
    let left: Vec<_> = summary.left_out.iter().map(|l| l.name.as_str()).collect();
    assert_eq!(left, ["Door"]);
    assert!(summary.left_out[0].reason.contains("no leaf"));
}

#[test]
fn chair_starts_on_free_floor_and_the_camera_is_inside() {
    let imported = imported(&Flat::new());
    let home = imported.pack.home().unwrap();
    let inside = |p: [f64; 2]| {
        home.room
            .iter()
            .any(|r| wheelarm_pack::contains(&r.outline, p))
    };
    assert!(inside(home.start.at), "{:?}", home.start);
    let [x, y, z] = home.room_camera.at;
    assert!(inside([x, y]) && z < 2.5);
    for name in ["table", "chair", "kitchen_cabinet"] {
        let [x, y, _] = piece(&imported.pack, name).at;
        let [sx, sy] = home.start.at;
        assert!((x - sx).hypot(y - sy) > 0.8, "{name}");
    }
}

#[test]
fn equal_files_give_equal_bytes() {
    let zip = |_: i32| imported(&Flat::new()).pack.to_zip().unwrap();
    assert!(zip(0) == zip(1));
    // The order of the files in the archive does not count.
    let mut other = Flat::new();
    other.files.reverse();
    assert!(imported(&other).pack.to_zip().unwrap() == zip(2));
}

#[test]
fn options_select_and_leave_out() {
    let without = Options {
        without: vec!["chairs".into()],
        ..options()
    };
    let summary = import("flat.sh3d", Flat::new().bytes(), &without)
        .unwrap()
        .summary;
    assert_eq!(summary.left_out.len(), 1);
    assert_eq!(summary.left_out[0].reason, "--without chairs");
    let unstated = Flat::new().with("<property name='License' value='CC0 1.0'/>", "");
    let plain = imported(&unstated);
    assert_eq!(plain.pack.home().unwrap().license, "unknown");
    assert!(
        plain
            .summary
            .notes
            .iter()
            .any(|note| note.contains("--license"))
    );
    let given = Options {
        license: Some("CC-BY-4.0".into()),
        ..options()
    };
    let pack = import("flat.sh3d", unstated.bytes(), &given).unwrap().pack;
    assert!(
        pack.manifest()
            .source
            .iter()
            .all(|source| source.license == "CC-BY-4.0")
    );
}

#[test]
fn level_is_chosen_by_name_or_number() {
    let levels = "<level id='l0' name='Ground' elevation='0' floorThickness='12' height='250'/>\
        <level id='l1' name='Roof' elevation='262' floorThickness='12' height='250'/><environment";
    let flat = Flat::new()
        .with("<environment", levels)
        .with("<wall id", "<wall level='l0' id")
        .with("<room name", "<room level='l0' name");
    let of = |level: &str| {
        let options = Options {
            level: Some(level.into()),
            ..options()
        };
        import("flat.sh3d", flat.bytes(), &options)
    };
    assert_eq!(of("1").unwrap().summary.level, "Ground");
    assert_eq!(of("ground").unwrap().summary.other_levels, ["Roof"]);
    let error = of("Roof").unwrap_err().to_string();
    assert_eq!(
        error,
        "level \"Roof\" has no walls; levels with walls: Ground (5)"
    );
    let error = of("3").unwrap_err().to_string();
    assert!(error.contains("Ground (5), Roof (0)"), "{error}");
}

#[test]
fn round_wall_becomes_ten_straight_ones() {
    let flat = Flat::new().with("id='wall1'", "id='wall1' arcExtent='0.7'");
    let pack = imported(&flat).pack;
    let home = pack.home().unwrap();
    assert_eq!(home.wall.len(), 14);
    let ends: BTreeSet<String> = home.wall.iter().map(|w| format!("{:?}", w.from)).collect();
    assert_eq!(ends.len(), 14, "each begins at another place");
    // The arc bulges by chord / 2 * tan(extent / 4), about 0.35 m.
    let walls = home.wall.iter().filter(|wall| wall.from[0] > 3.0);
    let far = walls
        .map(|wall| (wall.from[0] - 4.0).abs())
        .fold(0.0, f64::max);
    assert!(far > 0.3 && far < 0.4, "{far}");
}

#[test]
fn room_inside_another_is_cut_out() {
    let rug = "<room name='Bad'><point x='405' y='5'/><point x='600' y='5'/>\
        <point x='600' y='200'/><point x='405' y='200'/></room></home>";
    let pack = imported(&Flat::new().with("</home>", rug)).pack;
    let home = pack.home().unwrap();
    let at = [(500.0 - 400.0) / 100.0, (200.0 - 100.0) / 100.0];
    let over: Vec<_> = home
        .room
        .iter()
        .filter(|room| wheelarm_pack::contains(&room.outline, at))
        .map(|room| room.name.as_str())
        .collect();
    assert_eq!(over, ["bad"], "one floor at each place");
    let sum: f64 = home
        .room
        .iter()
        .map(|r| wheelarm_pack::area(&r.outline).abs())
        .sum();
    assert!((sum - 2.0 * 3.9 * 3.9).abs() < 1e-3, "{sum}");
}

#[test]
fn rooms_are_made_from_walls_when_none_is_drawn() {
    let text = String::from_utf8(Flat::new().files[0].1.clone()).unwrap();
    let from = text.find("<room").unwrap();
    let text = format!("{}</home>", &text[..from]);
    let flat = Flat::new().file("Home.xml", text.as_bytes());
    let imported = imported(&flat);
    assert_eq!(imported.summary.rooms, 2);
    assert!(imported.summary.notes[0].contains("no room is drawn"));
    // A wall with a gap encloses nothing: the message names its open end.
    let open = text.replace("xEnd='800' yEnd='400'", "xEnd='800' yEnd='100'");
    let open = open.replace(
        "xStart='800' yStart='400' xEnd='0'",
        "xStart='500' yStart='400' xEnd='0'",
    );
    let open = open.replace(
        "id='wall4' xStart='400' yStart='0'",
        "id='wall4' xStart='400' yStart='200'",
    );
    let open = open.replace("xStart='0' yStart='400'", "xStart='0' yStart='300'");
    let flat = Flat::new().file("Home.xml", open.as_bytes());
    let error = import("flat.sh3d", flat.bytes(), &options())
        .unwrap_err()
        .to_string();
    assert!(
        error.starts_with("flat: no room is closed; draw rooms or close the wall near ("),
        "{error}"
    );
}

#[test]
fn closed_area_without_a_drawn_room_becomes_a_room() {
    let kitchen = "<room name='Küche'>";
    let text = String::from_utf8(Flat::new().files[0].1.clone()).unwrap();
    let from = text.find(kitchen).unwrap();
    let text = format!("{}</home>", &text[..from]);
    let flat = Flat::new().file("Home.xml", text.as_bytes());
    let imported = imported(&flat);
    let home = imported.pack.home().unwrap();
    let names: Vec<&str> = home.room.iter().map(|room| room.name.as_str()).collect();
    assert_eq!(names, ["wohnzimmer", "room"]);
    assert!(wheelarm_pack::contains(&home.room[1].outline, [2.0, 0.0]));
    assert!(imported.summary.notes[0].starts_with("1 rooms made from the walls"));
}

#[test]
fn license_that_is_not_stated_names_the_model() {
    let flat = Flat::new().with(
        "<pieceOfFurniture catalogId='test#chair'",
        "<pieceOfFurniture catalogId='test#chair' license='all rights reserved'",
    );
    let notes = imported(&flat).summary.notes;
    let note = notes.iter().find(|note| note.contains("chair"));
    let note = note.unwrap_or_else(|| panic!("{notes:?}"));
    assert!(note.starts_with("license of chair is not known; plans with"));
    assert!(note.contains("--without"), "{note}");
}

#[test]
fn pack_of_the_same_name_is_replaced_and_other_folders_are_not() {
    let folder = tempfile::tempdir().unwrap();
    let pack = imported(&Flat::new()).pack;
    let first = write(&pack, folder.path()).unwrap();
    assert_eq!(Pack::open(&first).unwrap().id(), pack.id());
    let other =
        imported(&Flat::new().with("name='Cabinet'", "name='Cabinet' visible='false'")).pack;
    write(&other, folder.path()).unwrap();
    assert_eq!(Pack::open(&first).unwrap().id(), other.id());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    std::fs::remove_file(first.join("pack.toml")).unwrap();
    let error = write(&pack, folder.path()).unwrap_err().to_string();
    assert!(error.contains("is not a pack"), "{error}");
}

#[test]
fn texture_of_a_floor_becomes_a_square_image() {
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, 4, 2);
    encoder.set_color(png::ColorType::Rgb);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&[200; 24]).unwrap();
    writer.finish().unwrap();
    let floor = "<room name='Küche'><texture attribute='floorTexture' name='Tiles' \
        width='40' height='20' image='9'/>";
    let flat = Flat::new().with("<room name='Küche'>", floor);
    let pack = imported(&flat.clone().file("9", &png)).pack;
    assert_eq!(pack.names("textures", "png").count(), 1);
    let home = pack.home().unwrap();
    assert!(home.room[1].floor_material.starts_with("floor_image_"));
    // A missing image costs itself.
    let plain = imported(&flat);
    assert!(
        plain
            .summary
            .notes
            .iter()
            .any(|note| note.contains("image 9 is missing"))
    );
}
