//! Evaluation of synthetic snapshots.

use nalgebra::Vector3;
use wheelarm_proto::PHYSICS_HZ;

use super::super::*;
use super::{Stage, condition, task};
use crate::scene::tests::home;
use crate::snapshot::{Anomaly, BodyRef};

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
    assert!(stage.run(1.0).success, "success is final");
}

#[test]
fn incomplete_picks_do_not_succeed() {
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
            s.rolling.x = 0.05;
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
fn a_chair_that_does_not_move_is_at_rest_whatever_speed_the_engine_reports() {
    let mut stage = Stage::new();
    stage.snapshot.links[0].angular.z = 0.024;
    stage.run(0.1);
    stage.grip();
    stage.raise(0.12);
    let judged = stage.run(1.5);
    assert!(judged.success, "{judged:?}");
    assert_eq!(condition(&judged, "chair_stopped").value, 0.0);
}

#[test]
fn target_that_is_held_below_its_start_is_not_dropped() {
    let mut stage = Stage::new();
    stage.run(0.1);
    stage.grip();
    stage.raise(-0.5);
    assert_eq!(stage.run(0.2).failure, None);
    stage.snapshot.contacts.clear();
    assert_eq!(stage.run(0.1).failure, Some(Failure::Dropped));
}

#[test]
fn failures_have_a_cause() {
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
        (Failure::Tipped, |s| s.lean(s.target, 80.0)),
        (Failure::Timeout, |s| s.snapshot.tick += 100 * PHYSICS_HZ),
        (Failure::Lost, |s| {
            let lost = Anomaly::NotFinite(BodyRef::Object(s.target));
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
fn the_time_limit_of_an_episode_applies_to_that_episode_only() {
    let mut stage = Stage::new();
    for (limit, expected) in [
        (Some(1e5), None),
        (Some(5.0), Some(Failure::Timeout)),
        (None, None),
    ] {
        stage.evaluator.reset();
        stage.evaluator.limit_episode(limit);
        stage.run(0.1);
        stage.snapshot.tick += match limit {
            Some(1e5) => 1000 * PHYSICS_HZ,
            _ => 6 * PHYSICS_HZ,
        };
        assert_eq!(stage.run(0.1).failure, expected, "{limit:?}");
    }
}

#[test]
fn accidents_are_reported_until_the_end() {
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
fn a_knife_is_placed_when_it_was_lifted_and_released_on_the_mat() {
    let mat = home().surface_named("placemat", None).unwrap().centre();
    let on_mat = |stage: &mut Stage| {
        let knife = &mut stage.snapshot.objects[stage.target].pose;
        knife.translation.vector = mat.translation.vector + Vector3::new(-0.04, 0.0, 0.0);
    };
    let lifted = || {
        let mut stage = Stage::for_task("place_knife", "knife");
        stage.run(0.1);
        stage.grip();
        stage.raise(0.08);
        assert!(!stage.run(0.2).done);
        on_mat(&mut stage);
        stage
    };
    let mut held = lifted();
    assert!(!held.run(2.0).done, "still in the hand");
    held.snapshot.contacts.clear();
    assert!(!held.run(0.3).done, "released for 0.3 s only");
    assert!(held.run(0.4).success);

    let mut moving = lifted();
    moving.snapshot.contacts.clear();
    moving.snapshot.objects[moving.target].linear.x = 0.1;
    assert!(!moving.run(2.0).done, "it still slides");

    let mut pushed = Stage::for_task("place_knife", "knife");
    pushed.run(0.1);
    on_mat(&mut pushed);
    assert!(!pushed.run(2.0).done, "it was never lifted");

    let mut beside = lifted();
    beside.snapshot.contacts.clear();
    beside.raise(0.0);
    beside.snapshot.objects[beside.target].pose.translation.x += 0.5;
    assert_eq!(beside.run(0.1).failure, Some(Failure::Dropped));
}

#[test]
fn a_can_counts_only_at_the_bottom_of_the_bin() {
    let bin = home().surface_named("table_bin", None).unwrap().centre();
    let released = |offset: Vector3<f64>| {
        let mut stage = Stage::for_task("throw_meat_can", "meat_can");
        stage.run(0.1);
        stage.grip();
        stage.raise(0.08);
        assert!(!stage.run(0.2).done);
        let up = Vector3::z() * stage.scene.objects[stage.target].standing_height();
        let can = &mut stage.snapshot.objects[stage.target].pose;
        can.translation.vector = bin.translation.vector + up + offset;
        assert!(!stage.run(2.0).done, "still in the hand");
        stage.snapshot.contacts.clear();
        stage
    };
    let bottom = Vector3::z() * -0.114;
    let mut in_bin = released(bottom);
    assert!(!in_bin.run(0.3).done, "released for 0.3 s only");
    assert!(in_bin.run(0.4).success);

    for elsewhere in [Vector3::z() * 0.15, bottom + Vector3::x() * 0.4] {
        let judged = released(elsewhere).run(2.0);
        assert!(!judged.done && !condition(&judged, "inside").holds);
    }
}

#[test]
fn a_drawer_counts_from_twenty_centimetres_on() {
    let mut stage = Stage::for_task("open_drawer", "drawer_1");
    stage.run(0.1);
    stage.snapshot.furniture_joints[1].position = 0.3;
    stage.snapshot.furniture_joints[0].position = 0.19;
    // A pad that pulls the handle is not a collision, a chair at its front is.
    let drawer = BodyRef::Furniture(stage.scene.furniture_named("drawer_1").unwrap());
    let pad = stage.link("robotiq_85_left_finger_tip_link");
    stage.touch(pad, drawer, 80.0);
    let early = stage.run(0.5);
    assert!(!early.done && condition(&early, "no_hard_collision").holds);
    assert_eq!(condition(&early, "opened_by").value, 0.19);
    stage.snapshot.furniture_joints[0].position = 0.2;
    assert!(stage.run(0.1).success);
    let mut shut = Stage::for_task("close_drawer", "drawer_2");
    shut.snapshot.furniture_joints[1].position = 0.05;
    assert!(!shut.run(0.5).done && !condition(&shut.run(0.0), "closed_to").holds);
    shut.snapshot.furniture_joints[1].position = 0.01;
    assert!(shut.run(0.1).success);
    stage.touch(BodyRef::Link(0), drawer, 80.0);
    assert_eq!(stage.evaluator.hard_collisions(&stage.snapshot).count(), 1);
}

#[test]
fn another_can_is_not_the_target() {
    let mut stage = Stage::for_task("select_coke", "coke_2");
    stage.run(0.1);
    let other = stage.scene.object_named("coke_3").unwrap();
    stage.snapshot.objects[other].pose.translation.z += 0.12;
    stage.run(0.1);
    stage.grip();
    stage.raise(0.12);
    let evaluation = stage.run(3.0);
    assert!(condition(&evaluation, "lifted_and_held(target)").holds);
    assert!(!condition(&evaluation, "correct_instance").holds && !evaluation.success);
    assert_eq!(evaluation.failure, Some(Failure::WrongObject));
    let model = &stage.model;
    let wrong = Evaluator::new(&task("select_coke"), &stage.scene, model, "mustard", None);
    assert!(wrong.unwrap_err().to_string().contains("coke_4"));
}

#[test]
fn an_unreachable_target_and_a_hard_collision_end_the_task() {
    let mut far = Stage::new();
    far.run(0.1);
    let inwards = far
        .scene
        .surface_named("coffee_table", None)
        .unwrap()
        .edge
        .rotation
        * Vector3::x();
    far.snapshot.objects[far.target].pose.translation.vector += inwards * 0.4;
    assert_eq!(far.run(0.1).failure, Some(Failure::Unreachable));
    let mut rammed = Stage::new();
    rammed.run(0.1);
    let table = BodyRef::Furniture(rammed.scene.furniture_named("coffee_table").unwrap());
    rammed.touch(BodyRef::Link(0), table, 500.0);
    assert_eq!(rammed.run(0.1).failure, Some(Failure::HardCollision));
}

#[test]
fn a_restored_evaluator_continues_as_if_never_interrupted() {
    let mut stage = Stage::new();
    stage.run(0.1);
    stage.grip();
    stage.raise(0.12);
    stage.run(0.8);
    let bytes = postcard::to_stdvec(stage.evaluator.state()).unwrap();
    let mut other = Evaluator::new(
        &task("pick_mustard"),
        &stage.scene,
        &stage.model,
        "mustard",
        None,
    )
    .unwrap();
    other.restore(postcard::from_bytes(&bytes).unwrap());
    for _ in 0..30 {
        stage.snapshot.tick += PHYSICS_HZ / 60;
        let expected = stage.evaluator.update(&stage.snapshot);
        assert_eq!(other.update(&stage.snapshot), expected);
    }
    assert!(stage.run(0.0).success);
}
