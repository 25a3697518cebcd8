//! What is brought to the mouth or laid into the lap, judged on made-up states.

use nalgebra::{Point3, UnitQuaternion, Vector3};

use super::Evaluator;
use super::tests::{Stage, condition, task};
use crate::people::{BodyPart, HeadPose, PARTS, Person, PersonSetting};
use crate::scene::tests::assets;
use crate::snapshot::PersonState;

/// A stage of a task with somebody in the chair.
fn seated(name: &str, target: &str) -> (Stage, Person) {
    let setting = PersonSetting {
        body: "woman_p50".to_owned(),
        posture: "hands_on_armrests".to_owned(),
        ..PersonSetting::default()
    };
    let person = setting
        .draw(&assets(), 1)
        .and_then(|drawn| Person::load(&assets(), drawn))
        .unwrap_or_else(|error| panic!("{error}"));
    let mut stage = Stage::of(name, target);
    let (task, model) = (task(name), &stage.model);
    stage.evaluator = Evaluator::new(&task, &stage.scene, model, target, Some(&person))
        .unwrap_or_else(|error| panic!("{error}"));
    stage.snapshot.person = Some(PersonState {
        head: HeadPose::default(),
        forces: [0.0; PARTS.len()],
        robot_force: 0.0,
    });
    (stage, person)
}

/// The beaker held with the end of its straw `before` metres before the lips, leaning
/// by `degrees`.
struct Sip {
    stage: Stage,
    person: Person,
}

impl Sip {
    fn new() -> Self {
        let (stage, person) = seated("serve_drink", "straw_cup");
        let mut sip = Self { stage, person };
        sip.stage.run(0.1);
        sip.stage.grip();
        sip.stage.raise(0.08);
        assert!(!sip.stage.run(0.2).done);
        sip
    }

    fn bring(&mut self, before: f64, degrees: f64) {
        let chair = self.stage.snapshot.links[0].pose;
        let lips = chair * self.person.mouth(&HeadPose::default());
        let aim = lips * Point3::new(before, 0.0, 0.0);
        let tip = self.stage.scene.objects[self.stage.target].tip.unwrap();
        let cup = &mut self.stage.snapshot.objects[self.stage.target].pose;
        cup.rotation = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), degrees.to_radians());
        cup.translation.vector = aim.coords - cup.rotation * tip.coords;
    }

    fn press_face(&mut self, newtons: f64) {
        let person = self.stage.snapshot.person.as_mut().unwrap();
        person.forces[BodyPart::Face.index()] = newtons;
    }
}

#[test]
fn a_sip_is_served_level_at_the_lips_for_two_seconds() {
    let mut sip = Sip::new();
    sip.bring(0.02, 5.0);
    let early = sip.stage.run(1.8);
    assert!(!early.done);
    assert!((condition(&early, "at_mouth").value - 0.02).abs() < 1e-3);
    assert!(sip.stage.run(0.4).success);

    let mut far = Sip::new();
    far.bring(0.05, 0.0);
    assert!(!condition(&far.stage.run(3.0), "at_mouth").holds);

    let mut tilted = Sip::new();
    tilted.bring(0.02, 20.0);
    let judged = tilted.stage.run(3.0);
    assert!(!judged.done && condition(&judged, "kept_level").holds);
    // Level again: what leant no more than 30 degrees has spilt nothing.
    tilted.bring(0.02, 0.0);
    assert!(tilted.stage.run(2.5).success);

    let mut spilt = Sip::new();
    spilt.bring(0.02, 40.0);
    spilt.stage.run(0.1);
    spilt.bring(0.02, 0.0);
    let judged = spilt.stage.run(3.0);
    assert!(!judged.success && !condition(&judged, "kept_level").holds);
}

#[test]
fn whoever_presses_the_face_has_failed_even_if_it_was_only_once() {
    let mut hard = Sip::new();
    hard.press_face(2.5);
    hard.stage.run(0.0);
    hard.press_face(0.0);
    hard.bring(0.02, 0.0);
    let judged = hard.stage.run(3.0);
    let gentle = condition(&judged, "gentle_on_face");
    assert!(!judged.success && !gentle.holds && gentle.value == 2.5);
    let mut light = Sip::new();
    light.press_face(1.5);
    light.bring(0.02, 0.0);
    assert!(light.stage.run(2.5).success);
}

/// The remote control, taken and then `forward` metres before the middle of the lap,
/// `above` metres over it.
fn given(forward: f64, above: f64) -> Stage {
    let (mut stage, person) = seated("serve_remote", "remote_control");
    stage.run(0.1);
    stage.grip();
    stage.raise(0.08);
    assert!(!stage.run(0.2).done);
    let at = stage.snapshot.links[0].pose * person.lap.at;
    let remote = &mut stage.snapshot.objects[stage.target].pose;
    remote.translation.vector = at.coords + Vector3::new(forward, 0.0, above);
    stage
}

#[test]
fn a_thing_is_given_when_it_lies_in_the_lap_and_is_let_go() {
    let mut held = given(0.0, 0.01);
    let judged = held.run(2.0);
    assert!(!judged.done && condition(&judged, "in_lap").holds);
    assert!(!condition(&judged, "released").holds);
    held.snapshot.contacts.clear();
    assert!(held.run(0.6).success);

    for (forward, above) in [(0.4, 0.01), (0.0, 0.15), (0.0, -0.15)] {
        let mut beside = given(forward, above);
        beside.snapshot.contacts.clear();
        let judged = beside.run(2.0);
        let lies = condition(&judged, "in_lap");
        assert!(!judged.success && !lies.holds, "{forward} {above}");
        assert!((lies.value - forward).abs() < 0.01, "{}", lies.value);
    }
}
