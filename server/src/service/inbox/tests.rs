//! The gate by hand: who gets through, and what becomes of the rest.

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

fn inbox() -> Inbox {
    let assets = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
    let model = crate::robot::RobotModel::load(&assets, "wheelarm").expect("the robot");
    let mut inbox = Inbox::new(GripperMap::new(&model));
    take_control(&mut inbox, "me", "r");
    inbox
}

fn life(name: &str, run_id: &str) -> Life {
    Life {
        name: name.into(),
        run_id: run_id.into(),
    }
}

fn take_control(inbox: &mut Inbox, name: &str, run_id: &str) {
    let asked = Asked {
        take: true,
        ..Asked::default()
    };
    inbox
        .ask(life(name, run_id), &asked, Instant::now())
        .expect("control");
}

/// Sends a command that answers the newest state unless it says another.
fn accept(inbox: &mut Inbox, command: &v1::Command) -> Result<(), Refused> {
    let mut command = command.clone();
    if command.answers_tick.is_none() && !inbox.listening.lock_step {
        command.answers_tick = Some(inbox.next_tick);
    }
    inbox.accept(&command.encode_to_vec(), 0.0)
}

#[test]
fn a_chair_command_brakes_when_it_is_a_quarter_of_a_second_old() {
    let mut inbox = inbox();
    accept(&mut inbox, &drive(1, 0.4)).unwrap();
    assert_eq!(inbox.take(0, 0.0, 0.0).input.base.unwrap().linear, 0.4);
    assert!(inbox.take(4, 0.24, 0.0).input.base.is_none());
    let stale = inbox.take(8, 0.25, 0.0);
    assert!(stale.stopped.any() && stale.input.base.unwrap().linear == 0.0);
    assert!(!inbox.take(12, 0.5, 0.0).stopped.any(), "braked twice");
}

#[test]
fn old_repeated_and_foreign_commands_are_refused_with_a_reason() {
    let mut inbox = inbox();
    accept(&mut inbox, &drive(5, 0.1)).unwrap();
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
        let refused = accept(&mut inbox, &command).unwrap_err();
        assert!(refused.reason.contains(word), "{}", refused.reason);
    }
    assert!(inbox.accept(&[0xff; 7], 0.0).is_err());
    assert!(inbox.accept(&vec![0; MAX_BYTES + 1], 0.0).is_err());
    assert_eq!(inbox.refused(), 7);
    assert_eq!(inbox.take(0, 0.0, 0.0).input.base.unwrap().linear, 0.1);
}

#[test]
fn lock_step_waits_for_the_answer_to_its_own_tick() {
    let mut inbox = inbox();
    let listening = Listening {
        lock_step: true,
        ..Default::default()
    };
    inbox.listen(listening, 100);
    assert!(!inbox.answered(100));
    let early = v1::Command {
        answers_tick: Some(96),
        ..drive(1, 0.1)
    };
    assert!(
        accept(&mut inbox, &early)
            .unwrap_err()
            .reason
            .contains("tick")
    );
    let other = v1::Command {
        commander: "other".into(),
        answers_tick: Some(100),
        ..drive(1, 0.1)
    };
    assert!(accept(&mut inbox, &other).is_err());
    // An answer to what is no control tick, or to none, would wait for ever.
    for (answers_tick, words) in [(Some(102), "no control tick"), (None, "which state")] {
        let off = v1::Command {
            answers_tick,
            ..drive(2, 0.1)
        };
        let refused = accept(&mut inbox, &off).unwrap_err();
        assert_eq!(refused.code, RefusalCode::NoTick);
        assert!(refused.reason.contains(words), "{}", refused.reason);
    }
    accept(
        &mut inbox,
        &v1::Command {
            answers_tick: Some(100),
            ..drive(2, 0.1)
        },
    )
    .unwrap();
    assert!(inbox.answered(100));
    assert_eq!(inbox.take(100, 0.0, 0.0).commands.len(), 1);
    assert!(!inbox.answered(104));
}

#[test]
fn only_the_holder_of_control_is_heard_and_its_end_stops_the_robot() {
    let mut inbox = inbox();
    accept(&mut inbox, &drive(1000, 0.4)).unwrap();
    assert_eq!(inbox.take(0, 0.0, 0.0).input.base.unwrap().linear, 0.4);
    // The same name in another process is somebody else.
    let mut again = drive(0, 0.2);
    again.header.as_mut().unwrap().run_id = "new".into();
    let told = accept(&mut inbox, &again).unwrap_err().reason;
    assert!(told.contains("another process"), "{told}");
    take_control(&mut inbox, "me", "new");
    let stopped = inbox.take(4, 0.02, 0.0);
    assert!(stopped.stopped.any() && stopped.input.base == Some(REST));
    assert_eq!(stopped.input.arm, Some(ArmIntent::Hold));
    // The new holder counts from 0, the former is told who holds control.
    accept(&mut inbox, &again).unwrap();
    assert!(
        !inbox.take(8, 0.04, 0.0).stopped.any(),
        "stopped once is enough"
    );
    assert!(inbox.vanished(&life("me", "new")));
    assert!(inbox.take(12, 0.06, 0.0).stopped.any());
    let told = accept(&mut inbox, &again).unwrap_err().reason;
    assert!(told.contains("ask for control first"), "{told}");
}

#[test]
fn what_moves_when_an_episode_begins_or_ends_is_stopped() {
    let mut inbox = inbox();
    accept(&mut inbox, &drive(1, 0.4)).unwrap();
    inbox.take(0, 0.0, 0.0);
    inbox.listen(Listening::default(), 4);
    assert_eq!(inbox.take(4, 0.02, 0.0).input.base, Some(REST));
    inbox.listen(Listening::default(), 8);
    assert!(!inbox.take(8, 0.04, 0.0).stopped.any(), "it stands already");
    accept(&mut inbox, &drive(2, 0.4)).unwrap();
    inbox.take(12, 0.06, 0.0);
    inbox.renew(Listening::default(), 0);
    assert!(
        !inbox.take(0, 0.08, 0.0).stopped.any(),
        "another robot stands"
    );
}

#[test]
fn what_a_frozen_link_held_back_comes_too_late() {
    let mut inbox = inbox();
    inbox.take(1000, 0.0, 0.0);
    let answering = |sequence, answers_tick| v1::Command {
        answers_tick: Some(answers_tick),
        ..drive(sequence, 0.1)
    };
    let told = accept(&mut inbox, &answering(1, 700)).unwrap_err().reason;
    assert!(told.contains("1.25 s old"), "{told}");
    accept(&mut inbox, &answering(2, 900)).unwrap();
}

#[test]
fn a_stall_of_the_link_lets_nothing_old_drive_the_chair() {
    for stall in [1.4, 6.0] {
        let mut inbox = inbox();
        let (begun, ticks) = (4000, (stall * 240.0) as u64);
        inbox.take(begun + ticks, 0.0, 0.0);
        // Sent at 60 Hz all the while, each answering the last clock that came.
        for sequence in 1..=(stall * 60.0) as u64 {
            let held_back = v1::Command {
                answers_tick: Some(begun),
                ..drive(sequence, 0.3)
            };
            assert!(accept(&mut inbox, &held_back).is_err());
        }
        assert!(!inbox.has_pending(), "{stall} s: something was taken");
    }
}

#[test]
fn what_drives_says_which_state_it_answers_and_what_stops_is_always_taken() {
    use v1::arm_command::Target;
    let mut inbox = inbox();
    inbox.take(1000, 0.0, 0.0);
    let mut send = |command: &v1::Command| inbox.accept(&command.encode_to_vec(), 0.0);
    let told = send(&drive(1, 0.3)).unwrap_err().reason;
    assert!(
        told.contains("answers_tick is missing") && told.contains("clock"),
        "{told}"
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
    let told = send(&arm(2, Target::Twist(twist))).unwrap_err().reason;
    assert!(told.contains("answers_tick is missing"), "{told}");
    // A state that is not there yet would never grow old.
    let told = send(&v1::Command {
        answers_tick: Some(u64::MAX),
        ..drive(3, 0.3)
    });
    assert!(told.unwrap_err().reason.contains("has not reached"));
    // Stops are taken without a tick and from any time; goals end by themselves.
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
    assert_eq!(inbox.refused(), 3);
}

#[test]
fn a_sequence_number_far_ahead_locks_nobody_out() {
    let mut inbox = inbox();
    accept(&mut inbox, &drive(1, 0.1)).unwrap();
    let told = accept(&mut inbox, &drive(u64::MAX, 0.1))
        .unwrap_err()
        .reason;
    assert!(told.contains("jumps by more than 1000000"), "{told}");
    accept(&mut inbox, &drive(2 + 1_000_000 - 1, 0.1)).unwrap();
    assert!(accept(&mut inbox, &drive(2, 0.1)).is_err());
    // Before the first command of a lease nothing tells a number from a forged
    // one; asking again cures it.
    take_control(&mut inbox, "ben", "s");
    take_control(&mut inbox, "me", "r");
    accept(&mut inbox, &drive(u64::MAX, 0.1)).unwrap();
    let told = accept(&mut inbox, &drive(1, 0.1)).unwrap_err().reason;
    assert!(told.contains("asking for control again"), "{told}");
    take_control(&mut inbox, "me", "r");
    accept(&mut inbox, &drive(1, 0.1)).unwrap();
}

#[test]
fn in_a_sealed_lease_nobody_else_commands_in_its_holders_name() {
    let mut inbox = inbox();
    let sealed = Asked {
        take: true,
        sealed: true,
        ..Asked::default()
    };
    inbox
        .ask(life("anna", "a"), &sealed, Instant::now())
        .unwrap();
    let secret = inbox.lease().holder().unwrap().secret.clone();
    let command = |sequence| {
        let mut command = drive(sequence, 0.3);
        command.commander = "anna".into();
        command.answers_tick = Some(0);
        command.header.as_mut().unwrap().run_id = "a".into();
        command.encode_to_vec()
    };
    let told = inbox.accept(&command(u64::MAX), 0.0).unwrap_err().reason;
    assert!(told.contains("no seal"), "{told}");
    let mut forged = command(1);
    seal::append(&mut forged, &"0".repeat(32));
    assert!(inbox.accept(&forged, 0.0).is_err());
    let mut own = command(1);
    seal::append(&mut own, &secret);
    inbox.accept(&own, 0.0).unwrap();
    let again = inbox.accept(&own, 0.0).unwrap_err().reason;
    assert!(again.contains("sequence"), "{again}");
}

#[test]
fn a_flood_costs_no_memory_and_is_cut_to_its_rate() {
    let mut inbox = inbox();
    let mut passed = 0;
    for i in 1..10_000 {
        let now = i as f64 * 1e-4;
        let command = v1::Command {
            answers_tick: Some(0),
            ..drive(i, 0.1)
        };
        let command = command.encode_to_vec();
        passed += u32::from(inbox.accept(&command, now).is_ok());
    }
    assert!(inbox.pending.len() <= 256);
    assert!((590..=610).contains(&passed), "{passed} passed in 1 s");
    assert_eq!(inbox.refused(), 9_999 - u64::from(passed));
}

#[test]
fn a_flood_of_one_group_costs_no_other_its_command() {
    let mut inbox = inbox();
    let close = v1::Command {
        base: None,
        gripper: Some(v1::GripperCommand {
            target: Some(v1::gripper_command::Target::Opening(0.0)),
            max_force: None,
        }),
        ..drive(1, 0.0)
    };
    accept(&mut inbox, &close).unwrap();
    for sequence in 2..600 {
        let bytes = v1::Command {
            answers_tick: Some(0),
            ..drive(sequence, 0.1)
        };
        inbox
            .accept(&bytes.encode_to_vec(), sequence as f64 * 0.01)
            .unwrap();
    }
    assert_eq!(inbox.pending.len(), MAX_PENDING);
    let taken = inbox.take(0, 6.0, 6.0);
    assert!(taken.input.gripper.is_some());
    assert_eq!(taken.commands.first().unwrap().gripper, close.gripper);
    assert_eq!(taken.input.base.unwrap().linear, 0.1);
}

#[test]
fn what_was_sent_while_time_stood_is_as_old_as_it_is() {
    let mut inbox = inbox();
    // Paused for ten minutes behind it.
    accept(&mut inbox, &drive(1, 0.4)).unwrap();
    let late = inbox.take(0, 1000.0, 600.0);
    assert_eq!(late.input.base, Some(REST));
    assert!(late.stopped.base && !late.stopped.arm);
    // Sent 0.1 s before time went on, it drives for what is left of 0.25 s.
    let bytes = v1::Command {
        answers_tick: Some(inbox.next_tick),
        ..drive(2, 0.3)
    };
    inbox.accept(&bytes.encode_to_vec(), 599.9).unwrap();
    assert_eq!(inbox.take(4, 1000.0, 600.0).input.base.unwrap().linear, 0.3);
    assert!(!inbox.take(8, 1000.1, 600.1).stopped.any());
    assert!(inbox.take(12, 1000.2, 600.2).stopped.base);
}

#[test]
fn who_speaks_under_anothers_key_or_another_version_is_refused_with_a_code() {
    let mut inbox = inbox();
    let command = v1::Command {
        commander: "anna".into(),
        ..Default::default()
    };
    let bytes = command.encode_to_vec();
    let refused = inbox.accept_from("ben", &bytes, 0.0).unwrap_err();
    assert_eq!(refused.code, RefusalCode::Foreign);
    assert!(refused.reason.contains("anna") && refused.reason.contains("ben"));
    // Under her own key she is only told that somebody else is in control.
    let refused = inbox.accept_from("anna", &bytes, 0.0).unwrap_err();
    assert_eq!(refused.code, RefusalCode::ControlHeld);
    let other = OtherVersion { theirs: 1 };
    let refused = inbox.refuse_version("anna", &other);
    assert_eq!(refused.code, RefusalCode::Version);
    assert_eq!(inbox.refused(), 3);
}
