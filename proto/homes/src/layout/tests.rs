//! Laws of own homes.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use wheelarm_pack::{MaterialFile, PackName};

use super::placed::is_solid;
use super::random::Random;
use super::shape::Design;
use super::*;
use crate::home_report::{Finding, Posture, RobotFacts};

fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets")
}

fn catalog() -> Catalog {
    Catalog::read(&assets()).unwrap()
}

/// The robot with the arm as it drives, and as an episode starts.
fn robot() -> (RobotFacts, RobotFacts) {
    let facts = |posture| RobotFacts::read(&assets(), "wheelarm", posture).unwrap();
    (facts(Posture::Travel), facts(Posture::Home))
}

fn order<'a>(catalog: &'a Catalog, plan: &'a str, seed: u64) -> Order<'a> {
    Order {
        catalog,
        plan: (plan, catalog.plan(plan).unwrap()),
        style: ("nordic", catalog.style("nordic").unwrap()),
        seed,
        name: "home",
    }
}

/// The drafts of a plan for some seeds, without rejected ones.
fn drafts(catalog: &Catalog, plan: &str, seeds: std::ops::Range<u64>) -> Vec<Layout> {
    let table = catalog.plan(plan).unwrap();
    let all = seeds.map(|seed| draft(catalog, plan, table, seed));
    all.filter_map(Result::ok).collect()
}

#[test]
fn three_plans_and_one_style_are_held_out() {
    let catalog = catalog();
    let plans = catalog.plans.iter().filter(|(_, plan)| plan.held_out);
    let plans: Vec<&str> = plans.map(|(name, _)| name.as_str()).collect();
    assert_eq!(plans, ["guest_house", "loft", "long_hall"]);
    let styles = catalog.styles.iter().filter(|(_, style)| style.held_out);
    let styles: Vec<&str> = styles.map(|(name, _)| name.as_str()).collect();
    assert_eq!(styles, ["modern"]);
    assert_eq!((catalog.plans.len(), catalog.styles.len()), (12, 3));
}

#[test]
fn every_plan_is_valid_and_has_layouts() {
    let catalog = catalog();
    for (name, plan) in &catalog.plans {
        check::check(&catalog, name, plan).unwrap();
        let count = drafts(&catalog, name, 0..8).len();
        assert!(count >= 4, "{name}: {count} of 8 seeds have a layout");
    }
}

#[test]
fn layouts_of_a_plan_differ() {
    let catalog = catalog();
    for name in catalog.plans.keys() {
        let all = drafts(&catalog, name, 0..8);
        for (index, one) in all.iter().enumerate() {
            assert!(!one.differs_from(one), "{name}");
            let mut others = all[index + 1..].iter();
            assert!(others.all(|other| one.differs_from(other)), "{name}");
        }
    }
}

#[test]
fn small_move_is_the_same_layout_and_another_wall_is_not() {
    let catalog = catalog();
    let one = drafts(&catalog, "studio", 0..8).remove(0);
    let mut moved = one.clone();
    moved.furnished[0].placed[0].at[0] += 0.19;
    assert!(!one.differs_from(&moved));
    moved.furnished[0].placed[0].at[0] += 0.02;
    assert!(one.differs_from(&moved));
    let mut turned = one.clone();
    turned.furnished[0].placed[0].side = None;
    assert!(one.differs_from(&turned));
}

#[test]
fn pieces_are_inside_and_apart_from_each_other_and_from_doors() {
    let catalog = catalog();
    for name in catalog.plans.keys() {
        for layout in drafts(&catalog, name, 0..6) {
            for (room, furnished) in layout.furnished.iter().enumerate() {
                let inside = layout.rooms.shapes[room].inside();
                let space = super::draft::space(&layout.rooms, room);
                let all = furnished
                    .placed
                    .iter()
                    .filter(|piece| is_solid(&piece.kind));
                let all: Vec<_> = all.collect();
                for (index, piece) in all.iter().enumerate() {
                    assert!(inside.contains(&piece.rect), "{name}: {piece:?}");
                    let free = |door: &geometry::Rect| !piece.rect.overlaps(door);
                    assert!(space.keep.iter().all(free), "{name}: {piece:?} in a door");
                    for other in &all[index + 1..] {
                        // Chairs are pushed under tables.
                        let is_seat = [piece, other].iter().any(|p| p.kind == "chair");
                        let meets = piece.rect.overlaps(&other.rect);
                        assert!(is_seat || !meets, "{name}: {piece:?} {other:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn made_home_is_ready_by_the_report_and_equal_again() {
    let catalog = catalog();
    let (drives, starts) = robot();
    let robot = PlaceRobot {
        drives: &drives,
        starts: &starts,
    };
    let made = (0..20).find_map(|seed| {
        let home = make(&order(&catalog, "studio", seed), robot).ok()?;
        Some((seed, home))
    });
    let (seed, home) = made.expect("one of 20 seeds is ready");
    let again = make(&order(&catalog, "studio", seed), robot).unwrap();
    let id = |home: &OwnHome| -> PackName { home.pack.id().clone() };
    assert_eq!(id(&home), id(&again));
    let report = Finding::new(&Home::from_pack(&home.pack).unwrap(), &drives).report;
    assert!(report.home_start_driven);
    assert_eq!(report.summary.rooms_entered, report.summary.rooms);
    assert_eq!(report.summary.surfaces_reached, home.ready.reached);
    assert!(home.ready.reached as f64 >= REACHED * home.ready.surfaces as f64);
    let places = with_places(&home, robot).unwrap();
    assert!(places.pack.home().unwrap().place.len() >= 3);
}

#[test]
fn narrow_door_is_rejected() {
    let mut catalog = catalog();
    let plan = catalog.plans.get_mut("studio").unwrap();
    plan.room[1].beside.as_mut().unwrap().door = Some([0.55, 0.55]);
    let (drives, starts) = robot();
    let robot = PlaceRobot {
        drives: &drives,
        starts: &starts,
    };
    let seed = (0..20).find(|seed| {
        let plan = catalog.plan("studio").unwrap();
        draft(&catalog, "studio", plan, *seed).is_ok()
    });
    let error = make(&order(&catalog, "studio", seed.unwrap()), robot).unwrap_err();
    let words = error.to_string();
    assert!(words.contains("does not enter bathroom"), "{words}");
}

#[test]
fn invalid_plan_names_the_place_and_the_fix() {
    type Change = fn(&mut PlanFile);
    let change: [(Change, &str); 5] = [
        (
            |plan| plan.entrance = "cellar".into(),
            "no room named \"cellar\"",
        ),
        (|plan| plan.room[1].beside = None, "beside an earlier one"),
        (|plan| plan.room[0].size[0] = [9.0, 3.0], "rising lengths"),
        (
            |plan| plan.room[1].name = plan.room[0].name.clone(),
            "its own name",
        ),
        (
            |plan| plan.room[0].row[0].pieces[0] = "throne".into(),
            "available: armchair",
        ),
    ];
    for (change, part) in change {
        let catalog = catalog();
        let mut plan = catalog.plan("studio").unwrap().clone();
        change(&mut plan);
        let words = check::check(&catalog, "studio", &plan)
            .unwrap_err()
            .to_string();
        assert!(words.contains("homes/plans/studio.toml"), "{words}");
        assert!(words.contains(part), "{part:?} in {words}");
    }
}

/// Materials of a kind, of one style and of the assets.
#[test]
fn every_kind_has_shapes_of_known_materials() {
    let catalog = catalog();
    let text = std::fs::read_to_string(assets().join("materials/home.toml")).unwrap();
    let built_in: MaterialFile = toml::from_str(&text).unwrap();
    for (name, style) in &catalog.styles {
        let design = Design {
            front: style.front,
            handle: style.handle,
            legs: style.legs,
        };
        let mut used = BTreeSet::new();
        let mut random = Random::for_purpose("test", 0, name);
        let mut add = |model: &shape::Model| {
            let parts = model.kind.parts.iter();
            used.extend(parts.filter_map(|part| part.material.clone()));
        };
        for (kind, sizes) in &catalog.furniture.kind {
            let size = [sizes.depth[1], sizes.width[1], sizes.height[1]];
            let model = kinds::model(kind, &sizes.category, size, design, &mut random);
            let model = model.unwrap_or_else(|| panic!("no shapes of {kind}"));
            assert!(!model.kind.parts.is_empty(), "{kind}");
            add(&model);
            for object in kinds::on(kind) {
                let model = kinds::small_objects(object.name, &mut random);
                assert!(!model.kind.parts.is_empty(), "{}", object.name);
                add(&model);
            }
        }
        add(&kinds::front_door(0.96, 2.06, 0.12));
        let heights = [0.9, 1.3];
        add(&kinds::window(1.4, heights, 0.12, Some(0.03), &mut random));
        for piece in [kinds::WallPiece::Hooks, kinds::WallPiece::Image([0.5, 0.6])] {
            add(&kinds::wall_pieces(piece, 2.5, design, &mut random));
        }
        let known = |material: &&String| {
            style.material.contains_key(*material) || built_in.material.contains_key(*material)
        };
        let unknown: Vec<&String> = used.iter().filter(|m| !known(m)).collect();
        assert!(unknown.is_empty(), "{name}: {unknown:?}");
        for role in ["floor", "floor_wet", "wall_wet", "wall_outside", "ceiling"] {
            assert!(style.material.contains_key(role), "{name}: {role}");
        }
        assert!(!style.walls.is_empty(), "{name}");
    }
}
