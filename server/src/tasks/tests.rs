//! Draws over many seeds, and judgement of synthetic snapshots.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use wheelarm_proto::PHYSICS_HZ;

use super::*;
use crate::robot::RobotModel;
use crate::scene::tests::{assets, home};
use crate::scene::{Bounds, Scene};
use crate::snapshot::{Anomaly, BodyRef, BodyState, Contact, Snapshot};

fn pick_mustard() -> TaskSpec {
    TaskSpec::load(&assets(), "pick_mustard").unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn every_task_loads_and_says_where_it_comes_from() {
    let tasks = list(&assets()).unwrap_or_else(|error| panic!("{error}"));
    assert!(tasks.iter().any(|task| task.name == "pick_mustard"));
}

#[test]
fn drawn_starts_are_inside_their_ranges_apart_and_reachable() {
    let (spec, scene) = (pick_mustard(), home());
    let mut seen = Vec::new();
    for seed in 0..200 {
        let drawn = draw(&spec, &scene, seed);
        assert_eq!(drawn, draw(&spec, &scene, seed), "seed {seed} repeats");
        seen.push(drawn.placements[0].pose.translation.vector);
        let start = drawn.start;
        assert!(spec.start.x.contains(start.translation.x));
        assert!(spec.start.y.contains(start.translation.y));
        assert!(spec.start.yaw.contains(start.rotation.euler_angles().2));
        assert!(spec.instructions.contains(&drawn.instruction));
        for place in &spec.places {
            let object = scene.object_named(&place.object).unwrap();
            let surface = scene.surface_named(&place.on, None).unwrap();
            let placement = drawn.placements[object];
            let on = surface.edge.inverse() * placement.pose;
            assert!(place.inwards.contains(on.translation.x), "seed {seed}");
            assert!(place.along.contains(on.translation.y), "seed {seed}");
            assert!(
                place.yaw.contains(on.rotation.euler_angles().2),
                "seed {seed}"
            );
            if let Some(mass) = place.mass {
                assert!(mass.contains(placement.mass));
            }
        }
        assert_apart(&scene, &drawn, seed);
        assert_grasp_side_free(&scene, &spec, &drawn, seed);
    }
    let spread = Bounds::of_points(seen.into_iter().map(Into::into)).unwrap();
    assert!(spread.size().x > 0.2 && spread.size().y > 0.9, "{spread:?}");
}

/// No object overlaps another or furniture, and each stands on what carries it.
fn assert_apart(scene: &Scene, drawn: &Draw, seed: u64) {
    let bounds: Vec<_> = scene
        .objects
        .iter()
        .zip(&drawn.placements)
        .map(|(body, placement)| body.collision_bounds(&placement.pose).unwrap())
        .collect();
    for (i, own) in bounds.iter().enumerate() {
        for other in &bounds[i + 1..] {
            assert!(!own.overlaps(other, 0.0), "seed {seed}: objects overlap");
        }
        let mut gap = f64::INFINITY;
        for body in &scene.furniture {
            // Part by part: the bounds of a whole table reach down to the floor.
            for part in &body.collision {
                let mut piece = body.clone();
                piece.collision = vec![part.clone()];
                let other = piece.collision_bounds(&body.pose).unwrap();
                assert!(!own.overlaps(&other, 1e-6), "seed {seed}: in {}", body.name);
                let column = Bounds {
                    min: [own.min.x, own.min.y, other.min.z].into(),
                    max: own.max,
                };
                if column.overlaps(&other, 1e-6) {
                    gap = gap.min(own.min.z - other.max.z);
                }
            }
        }
        assert!(gap.abs() <= 0.0005, "seed {seed}: {i} hangs {gap} m high");
    }
}

/// One side grasp of the target comes from the aisle, and the open hand, 0.16 m
/// wide, meets nothing on its way from 0.3 m outside the edge.
fn assert_grasp_side_free(scene: &Scene, spec: &TaskSpec, drawn: &Draw, seed: u64) {
    let target = scene.object_named(&spec.target).unwrap();
    let surface = scene.surface_named("coffee_table", None).unwrap();
    let inwards = surface.edge.rotation * Vector3::x();
    let at = drawn.placements[target].pose;
    let grasp = scene.objects[target]
        .grasps
        .iter()
        .map(|grasp| at * grasp.pose)
        .find(|grasp| (grasp.rotation * Vector3::z()).dot(&inwards) > 0.9)
        .unwrap_or_else(|| panic!("seed {seed}: no grasp from the aisle"));
    for (i, placement) in drawn.placements.iter().enumerate() {
        if i == target {
            continue;
        }
        let hand = scene.objects[i]
            .collision_bounds(&(grasp.inverse() * placement.pose))
            .unwrap();
        let way = Bounds {
            min: [-0.08, -0.10, -0.70].into(),
            max: [0.08, 0.10, 0.04].into(),
        };
        assert!(!way.overlaps(&hand, 0.0), "seed {seed}: {i} is in the way");
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
        let evaluator = Evaluator::new(&pick_mustard(), &scene, &model)
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
    let mut other = Evaluator::new(&pick_mustard(), &stage.scene, &stage.model).unwrap();
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
            "time_limit = 90.0",
            "time_limit = -1",
            &["time_limit is -1 s"],
        ),
        (
            "inwards = [0.10, 0.40]",
            "inwards = [0.10, 1.40]",
            &["place[mustard].inwards is 1.4 m", "0 to 0.8"],
        ),
        (
            "along = [-0.60, 0.60]",
            "along = [0.60, -0.60]",
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
