//! Tests of task files, samples over many seeds, and evaluation of synthetic snapshots.

mod evaluation;
mod home_words;
mod maps;
mod object_packs;
mod queries;
mod samples;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use wheelarm_proto::PHYSICS_HZ;

use super::*;
use crate::robot::{CorridorSettings, RobotModel};
use crate::scene::Scene;
use crate::scene::tests::{assets, home};
use crate::snapshot::{BodyRef, BodyState, Contact, JointState, Snapshot};

/// The hand corridor of the bundled robot.
pub(super) fn hand() -> CorridorSettings {
    let model = RobotModel::load(&assets(), "wheelarm");
    model
        .unwrap_or_else(|error| panic!("{error}"))
        .settings
        .gripper
        .corridor
}

pub(super) fn task(name: &str) -> TaskSpec {
    TaskSpec::load(&assets(), name, &home(), &hand()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn every_task_has_several_instructions() {
    let tasks = list(&assets(), &hand()).unwrap_or_else(|error| panic!("{error}"));
    assert!(tasks.len() >= 19);
    for task in &tasks {
        assert!(task.instructions.len() >= 5, "{}", task.name);
        assert!(["serve", "organize", "care"].contains(&task.activity.as_str()));
        let turn = match task.area.name.as_str() {
            "coffee_table" | "lounge" => "right",
            "kitchen_table" | "kitchen_bin" | "kitchen_meal" => "left",
            "shelf" | "floor" => "straight",
            "workstation" => "around",
            other => panic!("{} is in {other}", task.name),
        };
        assert!(task.instructions[0].contains(turn), "{}", task.name);
        let reported = task.conditions.iter().filter(|c| !c.required).count();
        assert_eq!(reported, 2, "{}", task.name);
    }
}

#[test]
fn tasks_use_the_force_limits_of_guard_and_expert() {
    use wheelarm_proto::person::{FACE_FORCE_LIMIT, FORCE_LIMIT};
    let tasks = list(&assets(), &hand()).unwrap_or_else(|error| panic!("{error}"));
    for task in &tasks {
        let clear = |word: &str| word == "clear_of_person";
        let words = task.conditions.iter().map(|c| c.predicate.as_dyn().word());
        assert_eq!(words.filter(|word| clear(word)).count(), 1, "{}", task.name);
        for condition in &task.conditions {
            let predicate = condition.predicate.as_dyn();
            for threshold in predicate.thresholds() {
                let expected = match (predicate.word(), threshold.key) {
                    ("clear_of_person", "force") => FORCE_LIMIT,
                    ("clear_of_person", "face") => FACE_FORCE_LIMIT,
                    ("gentle_on_face" | "at_mouth", "force") => FACE_FORCE_LIMIT,
                    _ => continue,
                };
                assert_eq!(threshold.value, expected, "{} {}", task.name, threshold.key);
            }
        }
    }
}

/// The home's objects at their places, with the robot far away and at rest.
pub(super) struct Stage {
    pub(super) scene: Scene,
    pub(super) model: RobotModel,
    pub(super) evaluator: Evaluator,
    pub(super) snapshot: Snapshot,
    pub(super) target: usize,
    /// Velocity of the chair, m/s.
    rolling: Vector3<f64>,
}

impl Stage {
    fn new() -> Self {
        Self::for_task("pick_mustard", "mustard")
    }

    pub(super) fn for_task(name: &str, target: &str) -> Self {
        let scene = home();
        let model =
            RobotModel::load(&assets(), "wheelarm").unwrap_or_else(|error| panic!("{error}"));
        let evaluator = Evaluator::new(&task(name), &scene, &model, target, None)
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
            furniture_joints: vec![JointState::default(); 4],
            sliding: Vec::new(),
            person: None,
            contacts: Vec::new(),
            anomalies: Vec::new(),
        };
        // A drawer is not an object: lifting does not matter then.
        let target = scene.object_named(target).unwrap_or_default();
        Self {
            scene,
            model,
            evaluator,
            snapshot,
            target,
            rolling: Vector3::zeros(),
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

    pub(super) fn grip(&mut self) {
        for tip in [
            "robotiq_85_left_finger_tip_link",
            "robotiq_85_right_finger_tip_link",
        ] {
            let tip = self.link(tip);
            self.touch(tip, BodyRef::Object(self.target), 20.0);
        }
    }

    pub(super) fn raise(&mut self, metres: f64) {
        let object = &mut self.snapshot.objects[self.target];
        object.pose.translation.z = self.scene.objects[self.target].pose.translation.z + metres;
    }

    fn lean(&mut self, object: usize, degrees: f64) {
        let pose = &mut self.snapshot.objects[object].pose;
        pose.rotation = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), degrees.to_radians());
    }

    /// Evaluates every control tick for `secs`, and returns the last result.
    pub(super) fn run(&mut self, secs: f64) -> Evaluation {
        let mut last = self.evaluator.update(&self.snapshot);
        for _ in 0..(secs * 60.0).round() as u64 {
            self.snapshot.tick += PHYSICS_HZ / 60;
            self.snapshot.links[0].pose.translation.vector += self.rolling / 60.0;
            last = self.evaluator.update(&self.snapshot);
        }
        last
    }
}

pub(super) fn condition<'a>(evaluation: &'a Evaluation, name: &str) -> &'a Condition {
    evaluation
        .conditions
        .iter()
        .find(|c| c.name.starts_with(name))
        .unwrap()
}

#[test]
fn broken_tasks_are_rejected_with_key_values_and_fix() {
    let cases: [(&str, &str, &str, &[&str]); 16] = [
        (
            "areas/coffee_table.toml",
            "scene = \"home\"",
            "scene = \"flat\"",
            &[
                "scene is \"flat\"",
                "the scene in use, \"home\"",
                "take the scene \"flat\"",
            ],
        ),
        (
            "tasks/pick_mustard.toml",
            "template = \"lift\"",
            "template = \"juggle\"",
            &["template is \"juggle\"", "close, give, lift, open, put"],
        ),
        (
            "tasks/pick_mustard.toml",
            "template = \"lift\"",
            "template = \"put\"",
            &["place is absent", "placemat"],
        ),
        (
            "tasks/pick_mustard.toml",
            "template = \"lift\"",
            "template = \"open\"",
            &[
                "object is name \"mustard\"",
                "furniture that slides of coffee_table: none",
            ],
        ),
        (
            "tasks/pick_mustard.toml",
            "{ name = \"mustard\" }",
            "{ category = \"mug\", colour = \"red\" }",
            &[
                "category \"mug\" and colour \"red\"",
                "mustard (yellow bottle)",
                "areas/coffee_table.toml",
            ],
        ),
        (
            "tasks/pick_mustard.toml",
            "{ name = \"mustard\" }",
            "{ name = \"banana\" }",
            &["name \"banana\"", "crackers (red box)"],
        ),
        (
            "tasks/pick_mustard.toml",
            "area = \"coffee_table\"",
            "area = \"attic\"",
            &["area is \"attic\"", "coffee_table"],
        ),
        (
            "tasks/pick_mustard.toml",
            "license =",
            "time_limit = -1\nlicense =",
            &["time_limit is -1 s"],
        ),
        (
            "tasks/place_knife.toml",
            "failure = { reach = 0.4 }",
            "inside.height = 0.1",
            &["thresholds.inside.height is 0.1", "above"],
        ),
        (
            "tasks/place_knife.toml",
            "failure = { reach = 0.4 }",
            "opened_by.travel = 0.1",
            &["thresholds.opened_by", "at_rest"],
        ),
        (
            "tasks/place_knife.toml",
            "failure = { reach = 0.4 }",
            "nothing_knocked_over.tilt_deg = 300",
            &["tilt_deg is 300 degrees", "0 to 180"],
        ),
        (
            "tasks/place_knife.toml",
            "{ name = \"placemat\" }",
            "{ name = \"sofa\" }",
            &["place is name \"sofa\"", "placemat"],
        ),
        (
            "areas/coffee_table.toml",
            "inwards = [0.1, 0.4]",
            "inwards = [0.1, 1.4]",
            &["place[mustard].inwards is 1.4 m", "0 to 0.8"],
        ),
        (
            "areas/coffee_table.toml",
            "along = [-0.6, 0.6]",
            "along = [0.6, -0.6]",
            &["along is [0.6, -0.6]", "swap"],
        ),
        (
            "areas/coffee_table.toml",
            "along = [-0.55, 0.55]\nyaw_deg = [70, 110]",
            "along = [1.09, 1.10]\nyaw_deg = [70, 110]",
            &["place is", "missing", "widen"],
        ),
        (
            "templates/lift.toml",
            "predicate.lifted_and_held",
            "predicate.levitating",
            &["levitating", "lifted_and_held"],
        ),
    ];
    let home = home();
    for (i, (file, from, to, expected)) in cases.into_iter().enumerate() {
        let folder = crate::scene::tests::Copy::new(&format!("task{i}"));
        folder.edit(file, from, to);
        let task = match file {
            "tasks/place_knife.toml" => "place_knife",
            _ => "pick_mustard",
        };
        let error = match TaskSpec::load(&folder.0, task, &home, &hand()) {
            Ok(_) => panic!("{to} was accepted"),
            Err(error) => error.to_string(),
        };
        assert!(error.contains(file), "{error}");
        for part in expected {
            assert!(error.contains(part), "{part:?} is missing in: {error}");
        }
    }
}
