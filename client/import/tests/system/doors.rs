//! Doors of rooms for the chair, and doors of furniture in the report.

use std::path::Path;

use wheelarm_import::home_report::home::OpeningKind;
use wheelarm_import::home_report::{Finding, Home, Posture, RobotFacts, page, plan};
use wheelarm_import::{Options, import};
use wheelarm_planning::footprint_check::Rectangle;

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
fn door_between_rooms_is_free_and_the_closed_front_door_is_an_obstacle() {
    let home = home(&Flat::new());
    let is_blocked = |kind: OpeningKind| {
        let mut openings = home.openings.iter().filter(|o| o.kind == kind);
        let opening = openings.next().expect("an opening of the kind");
        let middle = Rectangle {
            centre: opening.centre,
            half: [0.2, 0.3],
            along: opening.along,
        };
        let mut solids = home.solids.iter();
        // From the wheels to the head of a seated person.
        solids.any(|solid| {
            solid.heights[0] < 1.3 && solid.heights[1] > 0.1 && solid.outline.overlaps(&middle)
        })
    };
    assert!(!is_blocked(OpeningKind::Frame));
    assert!(is_blocked(OpeningKind::Door));
}

#[test]
fn report_calls_doors_of_furniture_opened_or_says_why_not() {
    let home = home(&Flat::new());
    let finding = Finding::new(&home, &robot());
    let report = &finding.report;
    assert_eq!(report.summary.leaves, report.leaves.len());
    assert!(!report.leaves.is_empty());
    for leaf in &report.leaves {
        assert_ne!(leaf.stop.is_some(), leaf.reason.is_some(), "{leaf:?}");
        let words = leaf.words();
        assert!(words == "opened" || words.starts_with("not opened: "));
    }
    let opened = report.leaves.iter().filter(|leaf| leaf.stop.is_some());
    assert_eq!(report.summary.leaves_opened, opened.count());
    let text = wheelarm_import::home_report::text(report).unwrap();
    assert!(text.contains("furniture doors, opened by 45°"), "{text}");
    let png = plan(&home, &finding).unwrap();
    let html = page(report, &png).unwrap();
    assert!(png.starts_with(b"\x89PNG") && html.contains("data:image/png;base64,"));
}
