//! Draws over many seeds, and judgement of synthetic snapshots.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use wheelarm_proto::PHYSICS_HZ;

use super::*;
use crate::robot::RobotModel;
use crate::scene::tests::{assets, home};
use crate::scene::{Body, Bounds, Scene};
use crate::snapshot::{Anomaly, BodyRef, BodyState, Contact, Snapshot};

fn task(name: &str) -> TaskSpec {
    TaskSpec::load(&assets(), name).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn every_task_says_what_is_asked_in_several_ways() {
    let tasks = list(&assets()).unwrap_or_else(|error| panic!("{error}"));
    assert!(tasks.len() >= 13);
    for task in &tasks {
        assert!(task.instructions.len() >= 5, "{}", task.name);
        assert!(["serve", "organize"].contains(&task.activity.as_str()));
        let turn = match task.area.as_str() {
            "coffee_table" => "right",
            "kitchen_table" => "left",
            "shelf" => "straight",
            "workstation" => "around",
            other => panic!("{} is in {other}", task.name),
        };
        assert!(task.instructions[0].contains(turn), "{}", task.name);
        let reported = task.conditions.iter().filter(|c| !c.required).count();
        assert_eq!(reported, 2, "{}", task.name);
    }
}

#[test]
fn drawn_starts_of_every_task_are_inside_their_ranges_and_apart() {
    for spec in list(&assets()).unwrap_or_else(|error| panic!("{error}")) {
        let mut scene = home();
        scene.keep_optional(spec.region_name());
        let mut seen = Vec::new();
        for seed in 0..40 {
            let drawn = draw(&spec, &scene, seed);
            let at = format!("{} seed {seed}", spec.name);
            if seed < 3 {
                assert_eq!(drawn, draw(&spec, &scene, seed), "{at} repeats");
            }
            let start = drawn.start;
            assert!(spec.start.x.contains(start.translation.x));
            assert!(spec.start.y.contains(start.translation.y));
            assert!(spec.start.yaw.contains(start.rotation.euler_angles().2));
            assert!(spec.targets.contains(&drawn.target));
            assert!(!drawn.instruction.contains('{'), "{}", drawn.instruction);
            for place in &spec.places {
                let object = scene.object_named(&place.object).unwrap();
                let Some(placement) = drawn.placements[object] else {
                    assert!(place.chance < 1.0, "{at}: no {}", place.object);
                    continue;
                };
                let surface = scene.surface_named(&place.on, None).unwrap();
                let on = surface.edge.inverse() * placement.pose;
                assert!(place.inwards.contains(on.translation.x), "{at}");
                assert!(place.along.contains(on.translation.y), "{at}");
                assert!(place.yaw.contains(on.rotation.euler_angles().2), "{at}");
                assert!(place.mass.is_none_or(|m| m.contains(placement.mass)));
                assert!(
                    place
                        .friction
                        .is_none_or(|f| f.contains(placement.friction))
                );
                if place.object == drawn.target {
                    seen.push(on.translation.vector);
                }
            }
            assert_apart(&scene, &drawn, &at);
        }
        if let Some(spread) = Bounds::of_points(seen.into_iter().map(Into::into)) {
            let (x, y) = (spread.size().x, spread.size().y);
            assert!(x > 0.03 && y > 0.2, "{}: {spread:?}", spec.name);
        }
    }
}

#[test]
fn the_sentence_counts_the_cans_as_who_faces_the_shelf_sees_them() {
    let (spec, scene) = (task("select_coke"), home());
    for seed in 0..40 {
        let drawn = draw(&spec, &scene, seed);
        let sentence = &drawn.instruction;
        // Facing south the left is east, where x grows.
        let x = |name: &str| {
            let object = scene.object_named(name).unwrap();
            drawn.placements[object].unwrap().pose.translation.x
        };
        let mut order: Vec<_> = spec.targets.iter().collect();
        order.sort_by(|a, b| x(b).total_cmp(&x(a)));
        if sentence.contains("the right") {
            order.reverse();
        }
        let words = ["first", "second", "third", "fourth"];
        let index = words.iter().position(|w| sentence.contains(w)).unwrap();
        assert_eq!(order[index], &drawn.target, "seed {seed}: {sentence}");
    }
}

/// No object overlaps another or furniture, and each stands on what carries it.
/// Bounds are taken along the first one's axes, then along the other's.
fn assert_apart(scene: &Scene, drawn: &Draw, at: &str) {
    let bodies: Vec<_> = scene
        .objects
        .iter()
        .zip(&drawn.placements)
        .filter_map(|(body, placement)| Some((body, placement.as_ref()?.pose)))
        .collect();
    let overlap = |(a, a_pose): (&Body, Isometry3<f64>), (b, b_pose): (&Body, Isometry3<f64>)| {
        let seen_from = |frame: Isometry3<f64>| {
            let a = a.collision_bounds(&(frame.inverse() * a_pose)).unwrap();
            let b = b.collision_bounds(&(frame.inverse() * b_pose)).unwrap();
            a.overlaps(&b, 1e-6)
        };
        let between = (b_pose.translation.vector - a_pose.translation.vector).xy();
        let line = Isometry3::rotation(Vector3::z() * between.y.atan2(between.x));
        // What is round is apart along the line between the middles.
        let round = |body: &Body| body.grasps.iter().any(|grasp| grasp.symmetric);
        let along = !(round(a) && round(b)) || seen_from(line);
        along && seen_from(a_pose) && seen_from(b_pose)
    };
    for (i, own) in bodies.iter().enumerate() {
        for other in &bodies[i + 1..] {
            let names = (&own.0.name, &other.0.name);
            assert!(!overlap(*own, *other), "{at}: {names:?} overlap");
        }
        let bounds = own.0.collision_bounds(&own.1).unwrap();
        let mut gap = f64::INFINITY;
        for body in &scene.furniture {
            // Part by part: the bounds of a whole table reach down to the floor.
            for part in &body.collision {
                let mut piece = body.clone();
                piece.collision = vec![part.clone()];
                let hit = overlap(*own, (&piece, body.pose));
                assert!(!hit, "{at}: {} in {}", own.0.name, body.name);
                let other = piece.collision_bounds(&body.pose).unwrap();
                let column = Bounds {
                    min: [bounds.min.x, bounds.min.y, other.min.z].into(),
                    max: bounds.max,
                };
                if column.overlaps(&other, 1e-6) {
                    gap = gap.min((bounds.min.z - other.max.z).abs());
                }
            }
        }
        assert!(gap <= 0.0005, "{at}: {} hangs {gap} m high", own.0.name);
    }
}

/// A world of the home's objects at their places, robot far away and at rest.
struct Stage {
    scene: Scene,
    model: RobotModel,
    evaluator: Evaluator,
    snapshot: Snapshot,
    mustard: usize,
}

impl Stage {
    fn new() -> Self {
        let scene = home();
        let model =
            RobotModel::load(&assets(), "wheelarm").unwrap_or_else(|error| panic!("{error}"));
        let evaluator = Evaluator::new(&task("pick_mustard"), &scene, &model, "mustard")
            .unwrap_or_else(|error| panic!("{error}"));
        let rest = |pose: Isometry3<f64>| BodyState {
            pose,
            linear: Vector3::zeros(),
            angular: Vector3::zeros(),
        };
        let snapshot = Snapshot {
            tick: 1000,
            joints: Vec::new(),
            links: model
                .links
                .iter()
                .map(|_| rest(Isometry3::identity()))
                .collect(),
            objects: scene.objects.iter().map(|body| rest(body.pose)).collect(),
            skins: Vec::new(),
            furniture_joints: Vec::new(),
            sliding: Vec::new(),
            contacts: Vec::new(),
            anomalies: Vec::new(),
        };
        let mustard = scene.object_named("mustard").unwrap();
        Self {
            scene,
            model,
            evaluator,
            snapshot,
            mustard,
        }
    }

    fn link(&self, name: &str) -> BodyRef {
        BodyRef::Link(
            self.model
                .links
                .iter()
                .position(|l| l.name == name)
                .unwrap(),
        )
    }

    fn touch(&mut self, first: BodyRef, second: BodyRef, newtons: f64) {
        self.snapshot.contacts.push(Contact {
            first,
            second,
            point: Vector3::zeros(),
            force: Vector3::x() * newtons,
        });
    }

    fn grip(&mut self) {
        for tip in [
            "robotiq_85_left_finger_tip_link",
            "robotiq_85_right_finger_tip_link",
        ] {
            let tip = self.link(tip);
            self.touch(tip, BodyRef::Object(self.mustard), 20.0);
        }
    }

    fn raise(&mut self, metres: f64) {
        let object = &mut self.snapshot.objects[self.mustard];
        object.pose.translation.z = self.scene.objects[self.mustard].pose.translation.z + metres;
    }

    fn lean(&mut self, object: usize, degrees: f64) {
        let pose = &mut self.snapshot.objects[object].pose;
        pose.rotation = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), degrees.to_radians());
    }

    /// Judges every control tick for `secs`, and gives the last answer.
    fn run(&mut self, secs: f64) -> Evaluation {
        let mut last = self.evaluator.update(&self.snapshot);
        for _ in 0..(secs * 60.0).round() as u64 {
            self.snapshot.tick += PHYSICS_HZ / 60;
            last = self.evaluator.update(&self.snapshot);
        }
        last
    }
}

fn condition<'a>(evaluation: &'a Evaluation, name: &str) -> &'a Condition {
    evaluation
        .conditions
        .iter()
        .find(|c| c.name.starts_with(name))
        .unwrap()
}

#[test]
fn a_pick_succeeds_after_a_second_in_the_air_with_the_chair_at_rest() {
    let mut stage = Stage::new();
    let before = stage.run(0.5);
    assert!(!before.done && before.conditions.len() == 4);
    stage.grip();
    stage.raise(0.12);
    let early = stage.run(0.9);
    assert!(!early.done, "held for 0.9 s only");
    assert!((condition(&early, "lifted_and_held").value - 0.12).abs() < 1e-9);
    let late = stage.run(0.2);
    assert!(late.success && late.done && late.failure.is_none());
    assert!((late.elapsed - 1.6).abs() < 1e-9, "{}", late.elapsed);
    stage.snapshot.contacts.clear();
    stage.raise(0.0);
    assert!(stage.run(1.0).success, "success is not taken back");
}

#[test]
fn what_does_not_count_as_a_pick() {
    type Change = fn(&mut Stage);
    let cases: [(&str, Change); 4] = [
        ("too low", |s| {
            s.grip();
            s.raise(0.09);
        }),
        ("one finger only", |s| {
            s.grip();
            s.snapshot.contacts.pop();
            s.raise(0.12);
        }),
        ("in the air but not held", |s| s.raise(0.3)),
        ("chair still rolling", |s| {
            s.grip();
            s.raise(0.12);
            s.snapshot.links[0].linear.x = 0.05;
        }),
    ];
    for (name, change) in cases {
        let mut stage = Stage::new();
        stage.run(0.1);
        change(&mut stage);
        let evaluation = stage.run(3.0);
        assert!(!evaluation.done, "{name}: {evaluation:?}");
    }
}

#[test]
fn failures_say_why() {
    type Change = fn(&mut Stage);
    let cases: [(Failure, Change); 5] = [
        (Failure::Dropped, |s| {
            s.grip();
            s.raise(0.08);
            s.run(0.2);
            s.snapshot.contacts.clear();
            s.raise(0.0);
        }),
        (Failure::Dropped, |s| s.raise(-0.5)),
        (Failure::Tipped, |s| s.lean(s.mustard, 80.0)),
        (Failure::Timeout, |s| s.snapshot.tick += 100 * PHYSICS_HZ),
        (Failure::Lost, |s| {
            let lost = Anomaly::NotFinite(BodyRef::Object(s.mustard));
            s.snapshot.anomalies.push(lost);
        }),
    ];
    for (expected, change) in cases {
        let mut stage = Stage::new();
        stage.run(0.1);
        change(&mut stage);
        let evaluation = stage.run(0.1);
        assert!(evaluation.done && !evaluation.success);
        assert_eq!(evaluation.failure, Some(expected));
    }
}

#[test]
fn accidents_are_remembered_and_reported() {
    let mut stage = Stage::new();
    let quiet = stage.run(0.1);
    assert!(condition(&quiet, "nothing_knocked_over").holds);
    let soup = stage.scene.object_named("tomato_soup").unwrap();
    stage.lean(soup, 90.0);
    let (wheel, floor) = (stage.link("back_left_wheel"), BodyRef::Furniture(0));
    stage.touch(wheel, floor, 400.0);
    let table = BodyRef::Furniture(stage.scene.furniture_named("coffee_table").unwrap());
    stage.touch(table, BodyRef::Link(0), 80.0);
    stage.run(0.0);
    stage.lean(soup, 0.0);
    stage.snapshot.contacts.clear();
    let after = stage.run(0.1);
    let (knocked, hit) = (
        condition(&after, "nothing_knocked_over"),
        condition(&after, "no_hard_collision"),
    );
    assert!(!knocked.holds && !knocked.required);
    assert!((knocked.value - std::f64::consts::FRAC_PI_2).abs() < 1e-6);
    assert!(
        !hit.holds && hit.value == 80.0,
        "the wheel's 400 N do not count"
    );
    assert!(!after.done);
}

#[test]
fn a_restored_evaluator_goes_on_as_if_never_interrupted() {
    let mut stage = Stage::new();
    stage.run(0.1);
    stage.grip();
    stage.raise(0.12);
    stage.run(0.8);
    let bytes = postcard::to_stdvec(stage.evaluator.state()).unwrap();
    let mut other =
        Evaluator::new(&task("pick_mustard"), &stage.scene, &stage.model, "mustard").unwrap();
    other.restore(postcard::from_bytes(&bytes).unwrap());
    for _ in 0..30 {
        stage.snapshot.tick += PHYSICS_HZ / 60;
        let expected = stage.evaluator.update(&stage.snapshot);
        assert_eq!(other.update(&stage.snapshot), expected);
    }
    assert!(stage.run(0.0).success);
}

#[test]
fn broken_tasks_are_refused_with_key_values_and_cure() {
    let cases: [(&str, &str, &[&str]); 7] = [
        (
            "target = \"mustard\"",
            "target = \"ketchup\"",
            &["target is \"ketchup\"", "grey_cup"],
        ),
        (
            "area = \"coffee_table\"",
            "area = \"attic\"",
            &["area is \"attic\"", "coffee_table"],
        ),
        (
            "time_limit = 100.0",
            "time_limit = -1",
            &["time_limit is -1 s"],
        ),
        (
            "inwards = [0.1, 0.4]",
            "inwards = [0.1, 1.4]",
            &["place[mustard].inwards is 1.4 m", "0 to 0.8"],
        ),
        (
            "along = [-0.6, 0.6]",
            "along = [0.6, -0.6]",
            &["along is [0.6, -0.6]", "swap"],
        ),
        (
            "predicate.lifted_and_held",
            "predicate.levitating",
            &["levitating", "lifted_and_held"],
        ),
        (
            "along = [-0.85, 0.85]\nyaw_deg = [60, 120]",
            "along = [1.09, 1.10]\nyaw_deg = [60, 120]",
            &["place is", "overlap", "widen"],
        ),
    ];
    for (i, (from, to, expected)) in cases.into_iter().enumerate() {
        let folder = crate::scene::tests::Copy::new(&format!("task{i}"));
        folder.edit("tasks/pick_mustard.toml", from, to);
        let error = match TaskSpec::load(&folder.0, "pick_mustard") {
            Ok(_) => panic!("{to} was taken"),
            Err(error) => error.to_string(),
        };
        assert!(error.contains("tasks/pick_mustard.toml"), "{error}");
        for part in expected {
            assert!(error.contains(part), "{part:?} is missing in: {error}");
        }
    }
}
