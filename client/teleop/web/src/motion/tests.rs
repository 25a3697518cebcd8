//! Every safety rule, without a page and without a server.

use nalgebra::Isometry3;
use wheelarm_proto::geometry::{self, normalized};
use wheelarm_proto::v1;
use wheelarm_proto::v1::arm_command::Target;

use super::*;
use crate::protocol::{Clutch, Part};
use crate::watch::tests::described;

/// A robot at rest at a tick, its hand 0.5 m ahead of the arm's base.
fn at(tick: u64) -> Situation {
    let mut situation = Situation::default();
    situation.take_robot(&described());
    situation.header.tick = tick;
    situation.house_from_chair = Some(Isometry3::identity());
    situation.base_from_tool = Some(Isometry3::translation(-0.5, 0.0, 0.5));
    situation.applied = Some(v1::Applied {
        desired_pose: situation.base_from_tool.as_ref().map(geometry::pose),
        ..v1::Applied::default()
    });
    situation
}

/// An operator who drives a robot at 240 ticks per second.
struct TestDriver {
    motion: Motion,
    situation: Situation,
    seq: u32,
    time: f64,
    in_control: bool,
    goal: bool,
    /// Age of the displayed image, ticks; `None` without an image.
    late: Option<u64>,
    mode: v1::InputMode,
}

impl TestDriver {
    fn new() -> Self {
        let mut motion = Motion::default();
        motion.fit(&described());
        Self {
            motion,
            situation: at(10_000),
            seq: 0,
            time: 0.0,
            in_control: true,
            goal: false,
            late: Some(24),
            mode: v1::InputMode::Hold,
        }
    }

    fn intent(&mut self, epoch: u32, action: Action) -> Intent {
        self.seq += 1;
        Intent {
            seq: self.seq,
            epoch,
            shown: self.late.map(|late| self.situation.header.tick - late),
            ms: 0.0,
            device: v1::Device::Keyboard,
            mode: self.mode,
            speed: 5,
            action,
        }
    }

    fn take(&mut self, intent: &Intent) -> Vec<Out> {
        let now = Now {
            time: self.time,
            situation: &self.situation,
            in_control: self.in_control,
            goal: self.goal,
            lock_step: false,
        };
        self.motion.take(intent, now)
    }

    fn send(&mut self, epoch: u32, action: Action) -> Vec<Out> {
        let intent = self.intent(epoch, action);
        self.take(&intent)
    }

    /// Advances time and the simulation.
    fn wait(&mut self, seconds: f64) -> Vec<Out> {
        let mut out = Vec::new();
        for _ in 0..(seconds / 0.01).round() as u32 {
            self.time += 0.01;
            self.situation.header.tick = 10_000 + (self.time * 240.0) as u64;
            let now = Now {
                time: self.time,
                situation: &self.situation,
                in_control: self.in_control,
                goal: self.goal,
                lock_step: false,
            };
            out.extend(self.motion.tick(now));
        }
        out
    }

    /// Holds a key for a while, sent 20 times a second.
    fn hold(&mut self, epoch: u32, held: Held, seconds: f64) -> Vec<Out> {
        let mut out = Vec::new();
        for _ in 0..(seconds / 0.05).round() as u32 {
            out.extend(self.send(epoch, Action::Drive(held)));
            out.extend(self.wait(0.05));
        }
        out
    }
}

fn forward() -> Held {
    Held {
        chair: [1.0, 0.0],
        ..Held::default()
    }
}

fn up() -> Held {
    Held {
        hand: [0.0, 0.0, 1.0],
        ..Held::default()
    }
}

fn commands(out: &[Out]) -> Vec<&v1::Command> {
    let sent = out.iter().filter_map(|one| match one {
        Out::Send { command, .. } => Some(&**command),
        _ => None,
    });
    sent.collect()
}

fn drives(out: &[Out]) -> bool {
    commands(out)
        .iter()
        .any(|c| wheelarm_proto::check::drives(c))
}

fn stops(out: &[Out]) -> bool {
    commands(out)
        .iter()
        .any(|c| wheelarm_proto::check::stops(c))
}

fn refusals(out: &[Out]) -> Vec<&'static str> {
    let refused = out.iter().filter_map(|one| match one {
        Out::Refuse { code, .. } => Some(*code),
        _ => None,
    });
    refused.collect()
}

#[test]
fn a_held_key_drives_and_its_release_stops() {
    let mut driver = TestDriver::new();
    let out = driver.hold(1, forward(), 0.5);
    assert_eq!(commands(&out).len(), 10);
    for command in commands(&out) {
        let base = command.base.unwrap();
        assert!(base.linear > 0.5 && base.angular == 0.0, "{base:?}");
        assert_eq!(command.device(), v1::Device::Keyboard);
        assert_eq!(command.mode(), v1::InputMode::Hold);
        assert_eq!(command.assistance(), v1::Assistance::None);
        assert_eq!(command.phase(), v1::Phase::Navigating);
    }
    let out = driver.send(1, Action::Drive(Held::default()));
    assert!(stops(&out) && !drives(&out));
    assert!(!driver.motion.is_moving());
    // It is repeated, and then no more.
    assert_eq!(commands(&driver.wait(1.0)).len(), 2);
    assert_eq!(driver.wait(1.0), []);
}

#[test]
fn a_command_answers_the_displayed_image_and_a_stop_the_newest_state() {
    let mut driver = TestDriver::new();
    let out = driver.send(1, Action::Drive(forward()));
    assert!(
        matches!(
            &out[..],
            [Out::Send {
                shown: Some(9976),
                seq: Some(1),
                ..
            }]
        ),
        "{out:?}"
    );
    let out = driver.send(1, Action::Stop);
    let sent = out.iter().find(|one| matches!(one, Out::Send { .. }));
    assert!(
        matches!(
            sent,
            Some(Out::Send {
                shown: None,
                seq: Some(2),
                ..
            })
        ),
        "{out:?}"
    );
    let command = commands(&out)[0];
    assert_eq!(command.base, Some(v1::BaseCommand::default()));
    let arm = command.arm.as_ref().and_then(|arm| arm.target.as_ref());
    assert_eq!(arm, Some(&Target::Hold(true)));
}

#[test]
fn every_intent_is_accepted_once_and_in_order() {
    let mut driver = TestDriver::new();
    let first = driver.intent(1, Action::Drive(forward()));
    let second = driver.intent(1, Action::Drive(Held::default()));
    assert!(drives(&driver.take(&first)));
    assert!(stops(&driver.take(&second)));
    // The other lane delivers both again, later.
    assert_eq!(driver.take(&first), []);
    assert_eq!(driver.take(&second), []);
}

#[test]
fn the_speed_is_capped_by_the_age_of_the_image() {
    let mut driver = TestDriver::new();
    for (late, cap) in [(0, 0.63), (120, 0.424), (216, 0.310)] {
        driver.late = Some(late);
        let out = driver.send(1, Action::Drive(forward()));
        let base = commands(&out)[0].base.unwrap();
        assert!((base.linear - cap).abs() < 0.01, "{late}: {base:?}");
        // No corner of the chair turns faster either.
        let turn = Held {
            chair: [0.0, 1.0],
            ..Held::default()
        };
        let out = driver.send(1, Action::Drive(turn));
        let base = commands(&out)[0].base.unwrap();
        assert!(
            base.angular <= 1.0 && base.angular * 1.0 <= speed::cap(late as f64 / 240.0) + 1e-9
        );
    }
}

#[test]
fn an_old_image_allows_steps_and_a_frozen_one_only_a_stop() {
    let mut driver = TestDriver::new();
    let step = Action::Step {
        part: Part::Hand,
        axis: 2,
        sign: 1.0,
    };
    driver.late = Some(300);
    assert_eq!(
        refusals(&driver.send(1, Action::Drive(forward()))),
        ["TOO_OLD"]
    );
    // The same press is refused once, in words, and moves nothing when it is fresh.
    assert_eq!(driver.send(1, Action::Drive(forward())), []);
    driver.late = Some(10);
    assert_eq!(driver.send(1, Action::Drive(forward())), []);
    driver.late = Some(300);
    assert_eq!(commands(&driver.send(2, step)).len(), 1);
    for late in [Some(500), None] {
        driver.late = late;
        let epoch = driver.seq + 10;
        assert_eq!(refusals(&driver.send(epoch, step)), ["FROZEN"], "{late:?}");
        let stop = driver.send(epoch, Action::Stop);
        assert!(stops(&stop), "{late:?}");
    }
}

#[test]
fn an_image_that_freezes_while_driving_stops_the_chair_for_good() {
    let mut driver = TestDriver::new();
    assert!(drives(&driver.hold(1, forward(), 0.3)));
    let frozen = driver.situation.header.tick;
    let mut out = Vec::new();
    for _ in 0..30 {
        let mut intent = driver.intent(1, Action::Drive(forward()));
        intent.shown = Some(frozen);
        out.extend(driver.take(&intent));
        out.extend(driver.wait(0.05));
    }
    assert!(stops(&out));
    assert!(!driver.motion.is_moving());
    // A new image arrives while the key is still held.
    assert!(!drives(&driver.hold(1, forward(), 0.5)));
    assert!(drives(&driver.hold(2, forward(), 0.1)));
}

#[test]
fn a_silent_page_is_braked_and_its_queued_messages_move_nothing() {
    let mut driver = TestDriver::new();
    assert!(drives(&driver.hold(1, forward(), 0.3)));
    // The connection stalls for a second; then all messages arrive at once.
    let queued: Vec<Intent> = (0..20)
        .map(|_| driver.intent(1, Action::Drive(forward())))
        .collect();
    let out = driver.wait(STALL + 0.02);
    assert!(stops(&out), "{out:?}");
    let out = driver.wait(1.0);
    assert!(!drives(&out));
    for intent in &queued {
        assert!(!drives(&driver.take(intent)));
    }
    // The key is still held, and images are fresh again.
    assert!(!drives(&driver.hold(1, forward(), 1.0)));
    assert!(drives(&driver.hold(2, forward(), 0.1)));
}

#[test]
fn a_latch_ends_by_itself_after_two_seconds() {
    let mut driver = TestDriver::new();
    driver.mode = v1::InputMode::Latch;
    let out = driver.hold(1, forward(), 1.9);
    assert!(drives(&out) && !stops(&out));
    let out = driver.hold(1, forward(), 1.0);
    assert!(stops(&out));
    assert!(!driver.motion.is_moving());
    assert!(!drives(&driver.hold(1, forward(), 0.5)));
    // Renewed by a press: two seconds more.
    let out = driver.hold(2, forward(), 1.9);
    assert!(drives(&out) && driver.motion.is_moving());
    let out = driver.hold(3, forward(), 1.9);
    assert!(drives(&out) && !stops(&out));
}

#[test]
fn a_contact_or_a_refusal_ends_the_press() {
    for mode in [v1::InputMode::Latch, v1::InputMode::Hold] {
        let mut driver = TestDriver::new();
        driver.mode = mode;
        driver.hold(1, forward(), 0.3);
        let now = Now {
            time: driver.time,
            situation: &driver.situation,
            in_control: true,
            goal: false,
            lock_step: false,
        };
        let out = driver.motion.cut("contact", now);
        assert!(stops(&out) && !driver.motion.is_moving());
        assert!(!drives(&driver.hold(1, forward(), 0.5)), "{mode:?}");
        assert!(drives(&driver.hold(2, forward(), 0.1)));
    }
}

#[test]
fn without_control_nothing_moves_and_a_stop_still_stops() {
    let mut driver = TestDriver::new();
    driver.in_control = false;
    assert_eq!(
        refusals(&driver.send(1, Action::Drive(forward()))),
        ["NO_CONTROL"]
    );
    assert!(stops(&driver.send(1, Action::Stop)));
    // Control is granted while the key is still held.
    driver.in_control = true;
    driver.motion.forget();
    assert!(!drives(&driver.hold(1, forward(), 0.3)));
    assert!(drives(&driver.hold(2, forward(), 0.1)));
}

#[test]
fn manual_input_ends_a_goal_and_holds() {
    let step = Action::Step {
        part: Part::Grip,
        axis: 0,
        sign: 1.0,
    };
    for action in [
        Action::Drive(forward()),
        Action::Drive(up()),
        step,
        Action::Stop,
    ] {
        let mut driver = TestDriver::new();
        driver.goal = true;
        let out = driver.send(1, action);
        assert!(out.contains(&Out::EndGoal), "{action:?}");
        assert!(stops(&out) && !drives(&out), "{action:?}: {out:?}");
        driver.goal = false;
        assert!(!drives(&driver.hold(1, forward(), 0.2)), "{action:?}");
    }
    // Idle messages do not end it.
    let mut driver = TestDriver::new();
    driver.goal = true;
    assert_eq!(driver.send(1, Action::Alive), []);
    assert_eq!(driver.send(1, Action::Drive(Held::default())), []);
}

#[test]
fn a_repeated_step_message_is_one_step() {
    let mut driver = TestDriver::new();
    let step = Action::Step {
        part: Part::Hand,
        axis: 0,
        sign: -1.0,
    };
    let out = driver.send(1, step);
    let Some(Target::Step(step_command)) = commands(&out)[0].arm.clone().unwrap().target else {
        panic!("{out:?}");
    };
    assert_eq!(step_command.frame(), v1::CommandFrame::Wheelchair);
    assert!((step_command.translation.unwrap().x + 0.10).abs() < 1e-12);
    assert_eq!(driver.send(1, step), []);
    assert_eq!(commands(&driver.send(2, step)).len(), 1);
    // The hand does not follow: the lead does not grow.
    if let Some(applied) = &mut driver.situation.applied {
        applied.desired_pose = Some(geometry::pose(&Isometry3::translation(-0.65, 0.0, 0.5)));
    }
    assert_eq!(refusals(&driver.send(3, step)), ["AHEAD"]);
}

#[test]
fn a_step_of_the_chair_ends_by_itself_and_by_a_stop() {
    let step = Action::Step {
        part: Part::Chair,
        axis: 0,
        sign: 1.0,
    };
    let mut driver = TestDriver::new();
    let out = driver.send(1, step);
    assert!(drives(&out), "{out:?}");
    for _ in 0..10 {
        driver.send(1, Action::Alive);
        driver.wait(0.05);
    }
    assert!(driver.motion.is_moving());
    driver.situation.house_from_chair = Some(Isometry3::translation(0.10, 0.0, 0.0));
    let out = driver.wait(0.02);
    assert!(stops(&out) && !driver.motion.is_moving());
    assert!(drives(&driver.send(2, step)));
    assert!(stops(&driver.send(2, Action::Stop)));
    assert!(!drives(&driver.wait(1.0)));
    // A vanished page does not finish its step.
    assert!(drives(&driver.send(3, step)));
    let out = driver.wait(GONE + 0.05);
    assert!(stops(&out) && !driver.motion.is_moving());
}

#[test]
fn the_hand_moves_along_the_axes_of_the_chair_and_holds_when_released() {
    let mut driver = TestDriver::new();
    let out = driver.send(1, Action::Drive(up()));
    let Some(Target::Twist(target)) = commands(&out)[0].arm.clone().unwrap().target else {
        panic!("{out:?}");
    };
    assert_eq!(target.frame(), v1::CommandFrame::Wheelchair);
    let linear = target.twist.unwrap().linear.unwrap();
    assert!(
        linear.z > 0.1 && linear.x == 0.0 && linear.y == 0.0,
        "{linear:?}"
    );
    // With chair input the hand is released.
    let out = driver.send(1, Action::Drive(forward()));
    let command = commands(&out)[0];
    let arm = command.arm.clone().unwrap().target;
    assert_eq!(arm, Some(Target::Hold(true)));
    assert!(command.base.unwrap().linear > 0.0);
}

#[test]
fn the_fingers_move_at_the_chosen_speed_within_their_range() {
    let mut driver = TestDriver::new();
    let close = Held {
        grip: -1.0,
        ..Held::default()
    };
    let out = driver.hold(1, close, 0.5);
    let openings: Vec<f64> = commands(&out)
        .iter()
        .filter_map(|c| match c.gripper.as_ref()?.target.as_ref()? {
            v1::gripper_command::Target::Opening(m) => Some(*m),
            v1::gripper_command::Target::Knuckle(_) => None,
        })
        .collect();
    assert!(openings.is_sorted_by(|a, b| a >= b), "{openings:?}");
    let first = openings[0];
    let last = *openings.last().unwrap();
    assert!((first - last - 0.45 * 0.085).abs() < 0.003, "{openings:?}");
    let out = driver.hold(2, close, 3.0);
    let last = commands(&out).last().unwrap().gripper.unwrap();
    let shut = v1::gripper_command::Target::Opening(0.0);
    assert_eq!(last.target, Some(shut));
}

#[test]
fn a_clutch_engages_without_a_jump_and_again_only_with_a_new_press() {
    let mut driver = TestDriver::new();
    driver.mode = v1::InputMode::Stream;
    let moved = |x| Held {
        clutch: Some(Clutch {
            moved: [x, 0.0, 0.0],
            turn: [0.0, 0.0, 0.0, 1.0],
        }),
        ..Held::default()
    };
    let pose = |out: &[Out]| match commands(out)[0].arm.clone().unwrap().target {
        Some(Target::Pose(target)) => normalized("pose", target.pose.as_ref()).unwrap(),
        other => panic!("{other:?}"),
    };
    let out = driver.send(1, Action::Drive(moved(0.0)));
    assert!((pose(&out).translation.x + 0.5).abs() < 1e-9);
    let out = driver.send(1, Action::Drive(moved(0.02)));
    assert!((pose(&out).translation.x + 0.52).abs() < 1e-9);
    let out = driver.send(1, Action::Drive(Held::default()));
    assert!(stops(&out));
    assert_eq!(driver.send(1, Action::Drive(moved(0.05))), []);
    // The hand is where it is: engaging anew latches it there.
    let out = driver.send(2, Action::Drive(moved(0.0)));
    assert!((pose(&out).translation.x + 0.5).abs() < 1e-9);
}
