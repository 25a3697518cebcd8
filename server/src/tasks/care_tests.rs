//! Tests of care tasks (mouth and lap) on synthetic states.

use nalgebra::{Point3, UnitQuaternion, Vector3};

use super::tests::{Stage, condition, task};
use super::{Evaluator, Failure};
use crate::people::{BodyPart, HeadPose, Person, PersonSetting};
use crate::scene::tests::assets;
use crate::snapshot::{BodyRef, PersonState, Touch};

/// A stage of a task with a person in the chair.
fn seated(name: &str, target: &str) -> (Stage, Person) {
    let setting = PersonSetting {
        body: "woman_p50".to_owned(),
        posture: "hands_on_armrests".to_owned(),
        ..PersonSetting::default()
    };
    let person = setting
        .sample(&assets(), 1)
        .and_then(|drawn| Person::load(&assets(), drawn))
        .unwrap_or_else(|error| panic!("{error}"));
    let mut stage = Stage::for_task(name, target);
    let (task, model) = (task(name), &stage.model);
    stage.evaluator = Evaluator::new(&task, &stage.scene, model, target, Some(&person))
        .unwrap_or_else(|error| panic!("{error}"));
    stage.snapshot.person = Some(PersonState {
        head: HeadPose::default(),
        ..PersonState::default()
    });
    (stage, person)
}

/// The beaker in the hand with the end of its straw `before` metres in front of the
/// lips, leaning by `degrees`.
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
    // Level again: below 30 degrees nothing is spilt.
    tilted.bring(0.02, 0.0);
    assert!(tilted.stage.run(2.5).success);

    let mut spilt = Sip::new();
    spilt.bring(0.02, 40.0);
    spilt.stage.run(0.1);
    spilt.bring(0.02, 0.0);
    let judged = spilt.stage.run(3.0);
    assert!(!judged.success && !condition(&judged, "kept_level").holds);
    assert_eq!(judged.failure, Some(Failure::Tilted));
}

#[test]
fn pressing_the_face_once_fails_the_task() {
    let mut hard = Sip::new();
    hard.press_face(2.5);
    hard.stage.run(0.0);
    hard.press_face(0.0);
    hard.bring(0.02, 0.0);
    let judged = hard.stage.run(3.0);
    let gentle = condition(&judged, "gentle_on_face");
    assert!(!judged.success && !gentle.holds && gentle.value == 2.5);
    assert_eq!(judged.failure, Some(Failure::PersonForce));
    let mut light = Sip::new();
    light.press_face(1.5);
    light.bring(0.02, 0.0);
    assert!(light.stage.run(2.5).success);
}

#[test]
fn a_lost_condition_fails_the_task_in_the_same_tick() {
    let (mut stage, _) = seated("pick_mustard", "mustard");
    assert!(!stage.run(0.1).done);
    let press = |stage: &mut Stage, force: f64| {
        stage.snapshot.person.as_mut().unwrap().touches = vec![Touch {
            part: BodyPart::Arms,
            partner: BodyRef::Link(12),
            force,
            weight: 0.0,
        }];
    };
    press(&mut stage, 181_000.0);
    // The target falls in the same tick, which is a consequence and not the cause.
    stage.raise(-0.5);
    let judged = stage.run(0.0);
    assert!(judged.done && !judged.success, "{judged:?}");
    assert_eq!(judged.failure, Some(Failure::PersonForce));
    press(&mut stage, 0.0);
    stage.snapshot.tick += 200 * wheelarm_proto::PHYSICS_HZ;
    assert_eq!(stage.run(1.0).failure, Some(Failure::PersonForce));
}

/// The remote control, lifted and then `forward` metres in front of the middle of the
/// lap, `above` metres over it.
fn handed_over(forward: f64, above: f64) -> Stage {
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
fn an_object_is_given_when_it_is_released_in_the_lap() {
    let mut held = handed_over(0.0, 0.01);
    let judged = held.run(2.0);
    assert!(!judged.done && condition(&judged, "in_lap").holds);
    assert!(!condition(&judged, "released").holds);
    held.snapshot.contacts.clear();
    assert!(held.run(0.6).success);

    for (forward, above) in [(0.4, 0.01), (0.0, 0.15), (0.0, -0.15)] {
        let mut beside = handed_over(forward, above);
        beside.snapshot.contacts.clear();
        let judged = beside.run(2.0);
        let in_lap = condition(&judged, "in_lap");
        assert!(!judged.success && !in_lap.holds, "{forward} {above}");
        assert!((in_lap.value - forward).abs() < 0.01, "{}", in_lap.value);
    }
}

/// The object weighs 4 N: in lap or hands it may press with 12 N while the robot does
/// not touch it.
#[test]
fn every_part_of_the_person_and_every_body_that_touches_it_count() {
    let (mut stage, _) = seated("serve_remote", "remote_control");
    let object = BodyRef::Object(stage.target);
    let (link, floor, table) = (
        BodyRef::Link(1),
        BodyRef::Furniture(0),
        BodyRef::Furniture(1),
    );
    let new_evaluator = stage.evaluator.clone();
    // Part, partner, force in N, whether the robot touches the object, whether it is
    // allowed.
    let cases = [
        (BodyPart::Legs, table, 4.9, false, true),
        (BodyPart::Legs, table, 5.1, false, false),
        (BodyPart::Legs, floor, 5.1, false, false),
        (BodyPart::Legs, link, 5.1, false, false),
        (BodyPart::Legs, object, 5.1, false, false),
        (BodyPart::Hands, link, 4.9, false, true),
        (BodyPart::Hands, link, 5.1, false, false),
        (BodyPart::Lap, table, 5.1, false, false),
        (BodyPart::Torso, object, 5.1, true, false),
        (BodyPart::Face, object, 1.9, true, true),
        (BodyPart::Face, object, 2.1, true, false),
        (BodyPart::Mouth, object, 2.1, true, false),
        (BodyPart::Lap, object, 11.9, false, true),
        (BodyPart::Hands, object, 11.9, false, true),
        (BodyPart::Lap, object, 12.1, false, false),
        (BodyPart::Lap, object, 4.9, true, true),
        (BodyPart::Lap, object, 5.1, true, false),
    ];
    for (part, partner, force, held, clear) in cases {
        stage.evaluator = new_evaluator.clone();
        stage.snapshot.contacts.clear();
        if held {
            stage.grip();
        }
        let touch = Touch {
            part,
            partner,
            force,
            weight: if partner == object { 4.0 } else { 0.0 },
        };
        let person = stage.snapshot.person.as_mut().unwrap();
        person.touches = vec![touch];
        stage.run(0.0);
        // Once is enough.
        let person = stage.snapshot.person.as_mut().unwrap();
        person.touches.clear();
        let judged = stage.run(0.0);
        let condition = condition(&judged, "clear_of_person");
        assert_eq!(
            (condition.holds, condition.value),
            (clear, force),
            "{part:?} touched by {partner:?} with {force} N, held: {held}"
        );
    }
}
