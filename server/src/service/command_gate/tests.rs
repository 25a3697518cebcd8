//! Tests of the command gate.

use super::admit::MAX_PENDING;
use super::*;
use wheelarm_proto::schema::OtherVersion;
use wheelarm_proto::v1::RefusalCode;
use wheelarm_proto::{Message, seal};

use std::time::Instant;

fn drive(sequence: u64, linear: f64) -> v1::Command {
    v1::Command {
        header: Some(v1::Header {
            sequence,
            run_id: "r".into(),
            ..Default::default()
        }),
        commander: "me".into(),
        base: Some(v1::BaseCommand {
            linear,
            angular: 0.0,
        }),
        ..Default::default()
    }
}

fn command_gate() -> CommandGate {
    let assets = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
    let model = crate::robot::RobotModel::load(&assets, "wheelarm").expect("the robot");
    let mut command_gate = CommandGate::new(GripperMap::new(&model));
    take_control(&mut command_gate, "me", "r");
    command_gate
}

fn life(name: &str, run_id: &str) -> Life {
    Life {
        name: name.into(),
        run_id: run_id.into(),
    }
}

fn take_control(command_gate: &mut CommandGate, name: &str, run_id: &str) {
    let request = ControlRequest {
        take: true,
        ..ControlRequest::default()
    };
    command_gate
        .request_control(life(name, run_id), &request, Instant::now())
        .expect("control");
}

/// Sends a command that answers the newest state, unless it names another.
fn accept(command_gate: &mut CommandGate, command: &v1::Command) -> Result<(), Refused> {
    let mut command = command.clone();
    if command.answers_tick.is_none() && !command_gate.listening.lock_step {
        command.answers_tick = Some(command_gate.next_tick);
    }
    command_gate.accept(&command.encode_to_vec(), 0.0)
}

#[test]
fn a_chair_command_brakes_when_it_is_a_quarter_of_a_second_old() {
    let mut command_gate = command_gate();
    accept(&mut command_gate, &drive(1, 0.4)).unwrap();
    assert_eq!(
        command_gate.take(0, 0.0, 0.0).input.base.unwrap().linear,
        0.4
    );
    assert!(command_gate.take(4, 0.24, 0.0).input.base.is_none());
    let stale = command_gate.take(8, 0.25, 0.0);
    assert!(stale.stopped.any() && stale.input.base.unwrap().linear == 0.0);
    assert!(
        !command_gate.take(12, 0.5, 0.0).stopped.any(),
        "braked twice"
    );
}

#[test]
fn old_repeated_and_foreign_commands_are_refused_with_a_reason() {
    let mut command_gate = command_gate();
    accept(&mut command_gate, &drive(5, 0.1)).unwrap();
    for (command, word) in [
        (drive(5, 0.2), "sequence"),
        (drive(4, 0.2), "sequence"),
        (
            v1::Command {
                commander: "a/b".into(),
                ..drive(6, 0.2)
            },
            "commander",
        ),
        (drive(6, f64::NAN), "finite"),
        (drive(6, 1e9), "expected"),
    ] {
        let refused = accept(&mut command_gate, &command).unwrap_err();
        assert!(refused.reason.contains(word), "{}", refused.reason);
    }
    assert!(command_gate.accept(&[0xff; 7], 0.0).is_err());
    assert!(command_gate.accept(&vec![0; MAX_BYTES + 1], 0.0).is_err());
    assert_eq!(command_gate.refused(), 7);
    assert_eq!(
        command_gate.take(0, 0.0, 0.0).input.base.unwrap().linear,
        0.1
    );
}

#[test]
fn lock_step_waits_for_the_answer_to_its_own_tick() {
    let mut command_gate = command_gate();
    let listening = Listening {
        lock_step: true,
        ..Default::default()
    };
    command_gate.listen(listening, 100);
    assert!(!command_gate.answered(100));
    let early = v1::Command {
        answers_tick: Some(96),
        ..drive(1, 0.1)
    };
    assert!(
        accept(&mut command_gate, &early)
            .unwrap_err()
            .reason
            .contains("tick")
    );
    let other = v1::Command {
        commander: "other".into(),
        answers_tick: Some(100),
        ..drive(1, 0.1)
    };
    assert!(accept(&mut command_gate, &other).is_err());
    // A command for a tick that is not a control tick, or for none, would never be used.
    for (answers_tick, words) in [(Some(102), "not a control tick"), (None, "which state")] {
        let off = v1::Command {
            answers_tick,
            ..drive(2, 0.1)
        };
        let refused = accept(&mut command_gate, &off).unwrap_err();
        assert_eq!(refused.code, RefusalCode::NoTick);
        assert!(refused.reason.contains(words), "{}", refused.reason);
    }
    accept(
        &mut command_gate,
        &v1::Command {
            answers_tick: Some(100),
            ..drive(2, 0.1)
        },
    )
    .unwrap();
    assert!(command_gate.answered(100));
    assert_eq!(command_gate.take(100, 0.0, 0.0).commands.len(), 1);
    assert!(!command_gate.answered(104));
}

#[test]
fn only_the_holder_commands_and_losing_control_stops_the_robot() {
    let mut command_gate = command_gate();
    accept(&mut command_gate, &drive(1000, 0.4)).unwrap();
    assert_eq!(
        command_gate.take(0, 0.0, 0.0).input.base.unwrap().linear,
        0.4
    );
    // The same name in another process is a different commander.
    let mut again = drive(0, 0.2);
    again.header.as_mut().unwrap().run_id = "new".into();
    let reason = accept(&mut command_gate, &again).unwrap_err().reason;
    assert!(reason.contains("another process"), "{reason}");
    take_control(&mut command_gate, "me", "new");
    let stopped = command_gate.take(4, 0.02, 0.0);
    assert!(stopped.stopped.any() && stopped.input.base == Some(REST));
    assert_eq!(stopped.input.arm, Some(ArmIntent::Hold));
    // The new holder counts from 0; the former one is rejected.
    accept(&mut command_gate, &again).unwrap();
    assert!(
        !command_gate.take(8, 0.04, 0.0).stopped.any(),
        "stopped once is enough"
    );
    assert!(command_gate.token_lost(&life("me", "new")));
    assert!(command_gate.take(12, 0.06, 0.0).stopped.any());
    let reason = accept(&mut command_gate, &again).unwrap_err().reason;
    assert!(reason.contains("request control first"), "{reason}");
}

#[test]
fn motion_stops_when_an_episode_begins_or_ends() {
    let mut command_gate = command_gate();
    accept(&mut command_gate, &drive(1, 0.4)).unwrap();
    command_gate.take(0, 0.0, 0.0);
    command_gate.listen(Listening::default(), 4);
    assert_eq!(command_gate.take(4, 0.02, 0.0).input.base, Some(REST));
    command_gate.listen(Listening::default(), 8);
    assert!(
        !command_gate.take(8, 0.04, 0.0).stopped.any(),
        "already at rest"
    );
    accept(&mut command_gate, &drive(2, 0.4)).unwrap();
    command_gate.take(12, 0.06, 0.0);
    command_gate.renew(Listening::default(), 0);
    assert!(
        !command_gate.take(0, 0.08, 0.0).stopped.any(),
        "another robot is at rest"
    );
}

#[test]
fn commands_delayed_by_a_stalled_connection_are_rejected() {
    let mut command_gate = command_gate();
    command_gate.take(1000, 0.0, 0.0);
    let answering = |sequence, answers_tick| v1::Command {
        answers_tick: Some(answers_tick),
        ..drive(sequence, 0.1)
    };
    let reason = accept(&mut command_gate, &answering(1, 700))
        .unwrap_err()
        .reason;
    assert!(reason.contains("1.25 s old"), "{reason}");
    accept(&mut command_gate, &answering(2, 900)).unwrap();
}

#[test]
fn old_commands_do_not_drive_the_chair_after_a_connection_stall() {
    for stall in [1.4, 6.0] {
        let mut command_gate = command_gate();
        let (begun, ticks) = (4000, (stall * 240.0) as u64);
        command_gate.take(begun + ticks, 0.0, 0.0);
        // Sent at 60 Hz, each answering the last received clock.
        for sequence in 1..=(stall * 60.0) as u64 {
            let held_back = v1::Command {
                answers_tick: Some(begun),
                ..drive(sequence, 0.3)
            };
            assert!(accept(&mut command_gate, &held_back).is_err());
        }
        assert!(
            !command_gate.has_pending(),
            "{stall} s: a command was accepted"
        );
    }
}

#[test]
fn driving_commands_need_a_tick_and_stops_are_always_accepted() {
    use v1::arm_command::Target;
    let mut command_gate = command_gate();
    command_gate.take(1000, 0.0, 0.0);
    let mut send = |command: &v1::Command| command_gate.accept(&command.encode_to_vec(), 0.0);
    let reason = send(&drive(1, 0.3)).unwrap_err().reason;
    assert!(
        reason.contains("answers_tick is missing") && reason.contains("clock"),
        "{reason}"
    );
    let arm = |sequence, target| v1::Command {
        arm: Some(v1::ArmCommand {
            target: Some(target),
        }),
        base: None,
        ..drive(sequence, 0.0)
    };
    let twist = v1::CartesianTwist {
        twist: Some(v1::Twist {
            linear: Some(v1::Vector3 {
                x: 0.1,
                y: 0.0,
                z: 0.0,
            }),
            angular: Some(v1::Vector3::default()),
        }),
        ..v1::CartesianTwist::default()
    };
    let reason = send(&arm(2, Target::Twist(twist))).unwrap_err().reason;
    assert!(reason.contains("answers_tick is missing"), "{reason}");
    // A future state would never become stale.
    let reason = send(&v1::Command {
        answers_tick: Some(u64::MAX),
        ..drive(3, 0.3)
    });
    assert!(reason.unwrap_err().reason.contains("has not reached"));
    // Stops are accepted without a tick and at any age; goals end by themselves.
    send(&drive(4, 0.0)).unwrap();
    send(&arm(5, Target::Hold(true))).unwrap();
    send(&v1::Command {
        answers_tick: Some(1),
        ..drive(6, 0.0)
    })
    .unwrap();
    let goal = v1::JointTarget {
        positions: vec![0.1; 6],
    };
    send(&arm(7, Target::Joints(goal))).unwrap();
    send(&v1::Command {
        answers_tick: Some(1000),
        ..drive(8, 0.3)
    })
    .unwrap();
    assert_eq!(command_gate.refused(), 3);
}

#[test]
fn a_sequence_number_far_ahead_does_not_block_the_holder() {
    let mut command_gate = command_gate();
    accept(&mut command_gate, &drive(1, 0.1)).unwrap();
    let reason = accept(&mut command_gate, &drive(u64::MAX, 0.1))
        .unwrap_err()
        .reason;
    assert!(reason.contains("jumps by more than 1000000"), "{reason}");
    accept(&mut command_gate, &drive(2 + 1_000_000 - 1, 0.1)).unwrap();
    assert!(accept(&mut command_gate, &drive(2, 0.1)).is_err());
    // Before the first command of a lease a forged number cannot be detected; requesting
    // control again restarts the numbers.
    take_control(&mut command_gate, "ben", "s");
    take_control(&mut command_gate, "me", "r");
    accept(&mut command_gate, &drive(u64::MAX, 0.1)).unwrap();
    let reason = accept(&mut command_gate, &drive(1, 0.1))
        .unwrap_err()
        .reason;
    assert!(reason.contains("requesting control again"), "{reason}");
    take_control(&mut command_gate, "me", "r");
    accept(&mut command_gate, &drive(1, 0.1)).unwrap();
}

#[test]
fn unsealed_commands_are_rejected_in_a_sealed_lease() {
    let mut command_gate = command_gate();
    let sealed = ControlRequest {
        take: true,
        sealed: true,
        ..ControlRequest::default()
    };
    command_gate
        .request_control(life("anna", "a"), &sealed, Instant::now())
        .unwrap();
    let secret = command_gate.lease().holder().unwrap().secret.clone();
    let command = |sequence| {
        let mut command = drive(sequence, 0.3);
        command.commander = "anna".into();
        command.answers_tick = Some(0);
        command.header.as_mut().unwrap().run_id = "a".into();
        command.encode_to_vec()
    };
    let reason = command_gate
        .accept(&command(u64::MAX), 0.0)
        .unwrap_err()
        .reason;
    assert!(reason.contains("no seal"), "{reason}");
    let mut forged = command(1);
    seal::append(&mut forged, &"0".repeat(32));
    assert!(command_gate.accept(&forged, 0.0).is_err());
    let mut own = command(1);
    seal::append(&mut own, &secret);
    command_gate.accept(&own, 0.0).unwrap();
    let again = command_gate.accept(&own, 0.0).unwrap_err().reason;
    assert!(again.contains("sequence"), "{again}");
}

#[test]
fn a_flood_is_limited_to_the_rate_and_the_queue_size() {
    let mut command_gate = command_gate();
    let mut passed = 0;
    for i in 1..10_000 {
        let now = i as f64 * 1e-4;
        let command = v1::Command {
            answers_tick: Some(0),
            ..drive(i, 0.1)
        };
        let command = command.encode_to_vec();
        passed += u32::from(command_gate.accept(&command, now).is_ok());
    }
    assert!(command_gate.pending.len() <= 256);
    assert!((590..=610).contains(&passed), "{passed} passed in 1 s");
    assert_eq!(command_gate.refused(), 9_999 - u64::from(passed));
}

#[test]
fn a_flood_of_one_group_does_not_displace_other_groups() {
    let mut command_gate = command_gate();
    let close = v1::Command {
        base: None,
        gripper: Some(v1::GripperCommand {
            target: Some(v1::gripper_command::Target::Opening(0.0)),
            max_force: None,
        }),
        ..drive(1, 0.0)
    };
    accept(&mut command_gate, &close).unwrap();
    for sequence in 2..600 {
        let bytes = v1::Command {
            answers_tick: Some(0),
            ..drive(sequence, 0.1)
        };
        command_gate
            .accept(&bytes.encode_to_vec(), sequence as f64 * 0.01)
            .unwrap();
    }
    assert_eq!(command_gate.pending.len(), MAX_PENDING);
    let taken = command_gate.take(0, 6.0, 6.0);
    assert!(taken.input.gripper.is_some());
    assert_eq!(taken.commands.first().unwrap().gripper, close.gripper);
    assert_eq!(taken.input.base.unwrap().linear, 0.1);
}

#[test]
fn time_spent_paused_counts_as_age() {
    let mut command_gate = command_gate();
    // Paused for ten minutes after it.
    accept(&mut command_gate, &drive(1, 0.4)).unwrap();
    let late = command_gate.take(0, 1000.0, 600.0);
    assert_eq!(late.input.base, Some(REST));
    assert!(late.stopped.base && !late.stopped.arm);
    // Sent 0.1 s before time resumed, it drives for the rest of 0.25 s.
    let bytes = v1::Command {
        answers_tick: Some(command_gate.next_tick),
        ..drive(2, 0.3)
    };
    command_gate.accept(&bytes.encode_to_vec(), 599.9).unwrap();
    assert_eq!(
        command_gate
            .take(4, 1000.0, 600.0)
            .input
            .base
            .unwrap()
            .linear,
        0.3
    );
    assert!(!command_gate.take(8, 1000.1, 600.1).stopped.any());
    assert!(command_gate.take(12, 1000.2, 600.2).stopped.base);
}

#[test]
fn foreign_keys_and_other_versions_are_rejected_with_a_code() {
    let mut command_gate = command_gate();
    let command = v1::Command {
        commander: "anna".into(),
        ..Default::default()
    };
    let bytes = command.encode_to_vec();
    let refused = command_gate.accept_from("ben", &bytes, 0.0).unwrap_err();
    assert_eq!(refused.code, RefusalCode::Foreign);
    assert!(refused.reason.contains("anna") && refused.reason.contains("ben"));
    // Under its own key the reason is that another commander holds control.
    let refused = command_gate.accept_from("anna", &bytes, 0.0).unwrap_err();
    assert_eq!(refused.code, RefusalCode::ControlHeld);
    let other = OtherVersion { theirs: 1 };
    let refused = command_gate.refuse_version("anna", &other);
    assert_eq!(refused.code, RefusalCode::Version);
    assert_eq!(command_gate.refused(), 3);
}
