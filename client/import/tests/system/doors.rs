//! Doors of rooms for the chair, and doors of furniture in the report.

use std::f64::consts::FRAC_PI_2;
use std::path::Path;

use wheelarm_import::home_report::home::OpeningKind;
use wheelarm_import::home_report::{Finding, Home, Posture, RobotFacts, floor};
use wheelarm_import::{Options, import};
use wheelarm_planning::footprint_check::Pose2;

use crate::flat::Flat;

fn home(flat: &Flat) -> Home {
    let options = Options {
        name: "flat".into(),
        ..Options::default()
    };
    let pack = import("flat.sh3d", flat.bytes(), &options).unwrap().pack;
    Home::from_pack(&pack).unwrap()
}

fn robot() -> RobotFacts {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets");
    RobotFacts::read(&assets, "wheelarm", Posture::Travel).unwrap()
}

#[test]
fn chair_passes_a_door_between_rooms_and_collides_with_the_closed_front_door() {
    let (home, robot) = (home(&Flat::new()), robot());
    let footprint = floor::footprint(&home, &robot);
    // Across the wall, from either side.
    let is_free = |kind: OpeningKind| {
        let mut openings = home.openings.iter().filter(|o| o.kind == kind);
        let opening = openings.next().expect("an opening of the kind");
        let [x, y] = opening.centre;
        let along = wheelarm_proto::exact::atan2(opening.along[1], opening.along[0]);
        [along + FRAC_PI_2, along - FRAC_PI_2]
            .map(|heading| footprint.is_free(&Pose2 { x, y, heading }, 0.0))
    };
    assert_eq!(is_free(OpeningKind::Frame), [true, true]);
    assert_eq!(is_free(OpeningKind::Door), [false, false]);
}

#[test]
fn report_calls_doors_of_furniture_opened_or_says_why_not() {
    let report = Finding::new(&home(&Flat::new()), &robot()).report;
    assert_eq!(report.summary.leaves, report.leaves.len());
    assert!(!report.leaves.is_empty());
    for leaf in &report.leaves {
        assert_ne!(leaf.stop.is_some(), leaf.reason.is_some(), "{leaf:?}");
        let words = leaf.words();
        assert!(words == "opened" || words.starts_with("not opened: "));
    }
    let opened = report.leaves.iter().filter(|leaf| leaf.stop.is_some());
    assert_eq!(report.summary.leaves_opened, opened.count());
    let text = wheelarm_import::home_report::text(&report).unwrap();
    assert!(text.contains("furniture doors, opened by 45°"), "{text}");
    // A chair whose floor is taken up by a wardrobe opens nothing.
    let mut blocked = home(&Flat::new());
    for solid in &mut blocked.solids {
        solid.outline.half = solid.outline.half.map(|half| half + 0.6);
    }
    let report = Finding::new(&blocked, &robot()).report;
    assert_eq!(report.summary.leaves_opened, 0);
}
