//! Small homes built in code.

use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};

use nalgebra::Isometry3;
use wheelarm_planning::footprint_check::{Pose2, Rectangle};

use super::home::{Home, Opening, OpeningKind, Owner, Piece, Room, Solid, Surface, box_in};
use super::*;

fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets")
}

fn robot(posture: Posture) -> RobotFacts {
    RobotFacts::read(&assets(), "wheelarm", posture).expect("the robot")
}

fn solid(owner: Owner, x: [f64; 2], y: [f64; 2], heights: [f64; 2]) -> Solid {
    Solid {
        owner,
        outline: Rectangle {
            centre: [f64::midpoint(x[0], x[1]), f64::midpoint(y[0], y[1])],
            half: [(x[1] - x[0]) / 2.0, (y[1] - y[0]) / 2.0],
            along: [1.0, 0.0],
        },
        heights,
    }
}

fn room(name: &str, x: [f64; 2], y: [f64; 2]) -> Room {
    Room {
        name: name.to_owned(),
        kind: name.to_owned(),
        outline: vec![[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]],
    }
}

/// Two rooms of 4 m x 4 m side by side; a door of this width in the wall between them, its
/// middle at (4.05, 2).
fn two_rooms(door: f64) -> Home {
    let wall = |x, y| solid(Owner::Building, x, y, [0.0, 2.5]);
    let half = door / 2.0;
    Home {
        name: "two-rooms".to_owned(),
        rooms: vec![
            room("hall", [0.0, 4.0], [0.0, 4.0]),
            room("kitchen", [4.1, 8.1], [0.0, 4.0]),
        ],
        openings: vec![Opening {
            closed: false,
            kind: OpeningKind::Door,
            centre: [4.05, 2.0],
            along: [0.0, 1.0],
            width: door,
            heights: [0.0, 2.0],
            thickness: 0.1,
        }],
        solids: vec![
            wall([-0.1, 8.2], [-0.1, 0.0]),
            wall([-0.1, 8.2], [4.0, 4.1]),
            wall([-0.1, 0.0], [-0.1, 4.1]),
            wall([8.1, 8.2], [-0.1, 4.1]),
            wall([4.0, 4.1], [0.0, 2.0 - half]),
            wall([4.0, 4.1], [2.0 + half, 4.0]),
        ],
        start: Some(Pose2 {
            x: 1.5,
            y: 2.0,
            heading: 0.0,
        }),
        ..Home::default()
    }
}

/// Adds a table of 1.2 m x 0.7 m and this height with its middle at `at`.
fn put_table(home: &mut Home, name: &str, at: [f64; 2], height: f64) {
    let piece = home.pieces.len();
    home.pieces.push(Piece {
        name: name.to_owned(),
        category: "table".to_owned(),
    });
    let half = [0.6, 0.35, 0.015];
    let top = box_in(
        &Isometry3::identity(),
        [at[0], at[1], height - 0.015],
        0.0,
        half,
    );
    home.solids.push(Solid::from_box(Owner::Piece(piece), &top));
    home.surfaces.push(Surface {
        piece,
        name: "top".to_owned(),
        centre: at,
        height,
        yaw: FRAC_PI_2,
        size: [0.7, 1.2],
    });
}

/// Adds a box as a piece of this category.
fn put_box(home: &mut Home, name: &str, category: &str, x: [f64; 2], y: [f64; 2], z: [f64; 2]) {
    let piece = Owner::Piece(home.pieces.len());
    home.pieces.push(Piece {
        name: name.to_owned(),
        category: category.to_owned(),
    });
    home.solids.push(solid(piece, x, y, z));
}

#[test]
fn table_behind_a_narrow_door_is_reached_where_the_arm_has_room_to_return_home() {
    // The chair enters the kitchen with its arm stowed only.
    for (wide, is_reached) in [(4.0, true), (1.1, false)] {
        let mut home = two_rooms(0.8);
        put_table(&mut home, "table", [7.7, 2.0], 0.75);
        for y in [[2.0 + wide / 2.0, 4.1], [-0.1, 2.0 - wide / 2.0]] {
            let narrow = solid(Owner::Building, [4.1, 8.1], y, [0.0, 2.5]);
            home.solids.push(narrow);
        }
        let Finding { report, .. } = Finding::new(&home, &robot(Posture::Travel));
        assert_eq!(report.summary.rooms_entered, 2, "{wide} m");
        assert_eq!(report.summary.surfaces_reached == 1, is_reached, "{wide} m");
    }
}

#[test]
fn a_table_in_the_open_is_reached_from_a_stop_that_is_free() {
    let mut home = two_rooms(1.0);
    put_table(&mut home, "table", [6.1, 3.6], 0.75);
    for posture in [Posture::Travel, Posture::Home] {
        let robot = robot(posture);
        let Finding { report, floor } = Finding::new(&home, &robot);
        assert_eq!(report.summary.surfaces_reached, 1, "{posture:?}");
        let found = &report.surfaces[0];
        assert_eq!(
            (found.room.as_deref(), found.reason),
            (Some("kitchen"), None)
        );
        let strip = found.strip.as_ref().expect("a strip");
        // The wall is behind it: the chair arrives from the south or a side.
        assert!(strip.inwards > -0.1 && strip.width > 0.3, "{strip:?}");
        for [x, y, heading] in strip.stops.iter().copied() {
            let stop = Pose2 { x, y, heading };
            assert!(floor.stops.is_free(&stop), "{stop:?}");
            let mount = robot.reach.mount().translation;
            let base = stop.point(mount.x, mount.y);
            let far = ((base[0] - 6.1).powi(2) + (base[1] - 3.6).powi(2)).sqrt();
            assert!(far < 1.4, "the stop is {far} m from the table");
        }
    }
}

#[test]
fn a_shelf_behind_a_wall_is_not_reached_through_it() {
    let mut home = two_rooms(0.0);
    home.openings.clear();
    // In the closed kitchen, right behind the wall.
    put_table(&mut home, "shelf", [4.75, 2.0], 0.75);
    let report = Finding::new(&home, &robot(Posture::Travel)).report;
    let found = &report.surfaces[0];
    assert_eq!(found.strip, None);
    assert!(!report.rooms[1].entered && report.rooms[0].entered);
    // Without the wall above the table it would be reached from the hall.
    for solid in &mut home.solids {
        let is_between = (solid.outline.centre[0] - 4.05).abs() < 1e-9;
        if is_between {
            solid.heights[1] = 0.7;
        }
    }
    let report = Finding::new(&home, &robot(Posture::Travel)).report;
    assert_eq!(report.summary.surfaces_reached, 1);
}

#[test]
fn a_door_too_narrow_by_a_centimetre_keeps_the_chair_out() {
    // The narrowest door that it passes, found by centimetres.
    let passes = |width: f64| {
        let report = Finding::new(&two_rooms(width), &robot(Posture::Travel)).report;
        let door = &report.doors[0];
        assert!((door.clear_width - width).abs() < 1e-9);
        assert_eq!(door.din_barrier_free, width > 0.799);
        assert_eq!(door.passed, report.rooms[1].entered, "door of {width} m");
        door.passed
    };
    let centimetres = |count: i32| f64::from(count) / 100.0;
    let narrowest = (66..=95).find(|count| passes(centimetres(*count)));
    let narrowest = narrowest.expect("a door that it passes");
    // 0.694 m wide, and cells of 5 cm.
    assert!((70..=79).contains(&narrowest), "{narrowest} cm");
    assert!(!passes(centimetres(narrowest - 1)));
    let report = Finding::new(
        &two_rooms(centimetres(narrowest - 1)),
        &robot(Posture::Travel),
    );
    let words = text(&report.report).expect("text");
    assert!(words.contains("gets into 1 of 2 rooms"), "{words}");
    assert!(words.contains("door between"), "{words}");
}

#[test]
fn a_home_without_room_for_the_chair_has_a_report() {
    let mut home = two_rooms(0.9);
    put_box(
        &mut home,
        "crates",
        "box",
        [0.0, 8.1],
        [0.0, 4.0],
        [0.0, 0.6],
    );
    put_table(&mut home, "table", [6.1, 3.6], 0.75);
    let finding = Finding::new(&home, &robot(Posture::Travel));
    let report = &finding.report;
    assert_eq!((report.start, report.home_start_driven), (None, false));
    assert_eq!(report.summary.rooms_entered, 0);
    assert_eq!(report.surfaces[0].reason, Some(Reason::NoFloor));
    assert_eq!(report.surfaces[0].blocked_by[0], "crates");
    let words = text(report).expect("text");
    assert!(words.contains("fits nowhere"), "{words}");
    // Without the crates it is reached: they are named first.
    assert_eq!(report.to_move[0].piece, "crates");
    assert_eq!(report.to_move[0].surfaces, ["table/top"]);
}

#[test]
fn a_box_before_a_door_is_named_and_worth_moving() {
    let mut home = two_rooms(0.95);
    put_box(
        &mut home,
        "hamper",
        "basket",
        [3.4, 3.95],
        [1.7, 2.3],
        [0.0, 0.6],
    );
    put_table(&mut home, "table", [6.1, 3.6], 0.75);
    let report = Finding::new(&home, &robot(Posture::Travel)).report;
    assert!(!report.doors[0].passed);
    assert_eq!(report.doors[0].blocked_by, ["hamper"]);
    assert_eq!(report.doors[0].between, ["hall", "kitchen"]);
    assert_eq!(report.surfaces[0].reason, Some(Reason::NotConnected));
    let best = &report.to_move[0];
    assert_eq!((best.piece.as_str(), best.doors), ("hamper", 1));
    assert_eq!(
        (&best.rooms[..], &best.surfaces[..]),
        (&["kitchen".to_owned()][..], &["table/top".to_owned()][..])
    );
}

#[test]
fn a_high_shelf_is_out_of_reach() {
    let mut home = two_rooms(1.0);
    put_table(&mut home, "loft", [6.1, 3.6], 1.75);
    put_table(&mut home, "mat", [6.1, 1.0], 0.02);
    let report = Finding::new(&home, &robot(Posture::Travel)).report;
    assert_eq!(report.surfaces[0].reason, Some(Reason::OutOfReach));
    assert_eq!(report.summary.surfaces, 2);
}

#[test]
fn outside_rooms_are_not_driven_and_not_counted() {
    let mut home = two_rooms(1.0);
    home.rooms[1].name = "terrace".to_owned();
    home.rooms[1].kind = "terrace".to_owned();
    let report = Finding::new(&home, &robot(Posture::Travel)).report;
    assert_eq!((report.summary.rooms, report.summary.rooms_entered), (1, 1));
    assert!(!report.rooms[1].entered);
    assert!(!report.rooms[0].turning_squares.is_empty());
}

#[test]
fn the_report_is_the_same_twice_and_is_json() {
    let mut home = two_rooms(1.0);
    put_table(&mut home, "table", [6.1, 3.6], 0.75);
    let robot = robot(Posture::Travel);
    let [one, two] = [(), ()].map(|()| Finding::new(&home, &robot).report);
    assert_eq!(one, two);
    let json = serde_json::to_value(&one).expect("JSON");
    assert_eq!(json["summary"]["surfaces_reached"], 1);
    assert_eq!(json["surfaces"][0]["reason"], serde_json::Value::Null);
}

#[test]
fn errors_of_a_robot_name_the_file_and_the_fix() {
    let folder = tempfile::tempdir().expect("a folder");
    let robots = folder.path().join("robots/mine");
    std::fs::create_dir_all(&robots).expect("a folder");
    let read = || RobotFacts::read(folder.path(), "mine", Posture::Travel);
    let words = || read().expect_err("an error").to_string();
    assert!(words().contains("cannot read"), "{}", words());
    let write = |text: &str| std::fs::write(robots.join("robot.toml"), text).expect("a file");
    let outline = "{ top = 0.5, footprint = [-0.2, 0.8, -0.3, 0.3] }";
    let reach = "[reach]\nnearest = 0.4\nfurthest = 0.8\n";
    write(&format!("outline = [{outline}]\n{reach}"));
    assert!(words().contains("--posture home"), "{}", words());
    write(&format!("outline = []\n{reach}[travel]\noutline = []\n"));
    assert!(words().contains("outline"), "{}", words());
    let bad = "{ top = 0.5, footprint = [0.2, -0.8, -0.3, 0.3] }";
    write(&format!(
        "outline = [{outline}]\n{reach}[travel]\noutline = [{bad}]\n"
    ));
    assert!(words().contains("x min < x max"), "{}", words());
    write(&format!(
        "outline = [{outline}]\n{reach}[travel]\noutline = [{outline}]\n"
    ));
    assert!(words().contains("reach.bin"), "{}", words());
    std::fs::write(robots.join("reach.bin"), [0; 100]).expect("a file");
    assert!(words().contains("100 bytes"), "{}", words());
    assert_eq!(
        "sideways".parse::<Posture>().expect_err("an error"),
        "unknown posture \"sideways\"; available: travel, home"
    );
}
