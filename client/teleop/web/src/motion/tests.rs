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
struct Desk {
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

impl Desk {
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

    fn say(&mut self, epoch: u32, action: Action) -> Vec<Out> {
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
            out.extend(self.say(epoch, Action::Drive(held)));
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
    let mut desk = Desk::new();
    let out = desk.hold(1, forward(), 0.5);
    assert_eq!(commands(&out).len(), 10);
    for command in commands(&out) {
        let base = command.base.unwrap();
        assert!(base.linear > 0.5 && base.angular == 0.0, "{base:?}");
        assert_eq!(command.device(), v1::Device::Keyboard);
        assert_eq!(command.mode(), v1::InputMode::Hold);
        assert_eq!(command.assistance(), v1::Assistance::None);
        assert_eq!(command.phase(), v1::Phase::Navigating);
    }
    let out = desk.say(1, Action::Drive(Held::default()));
    assert!(stops(&out) && !drives(&out));
    assert!(!desk.motion.is_moving());
    // It is repeated, and then no more.
    assert_eq!(commands(&desk.wait(1.0)).len(), 2);
    assert_eq!(desk.wait(1.0), []);
}

#[test]
fn a_command_answers_the_picture_that_was_shown_and_a_stop_the_newest_state() {
    let mut desk = Desk::new();
    let out = desk.say(1, Action::Drive(forward()));
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
    let out = desk.say(1, Action::Stop);
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
fn every_intent_is_taken_once_and_in_order() {
    let mut desk = Desk::new();
    let first = desk.intent(1, Action::Drive(forward()));
    let second = desk.intent(1, Action::Drive(Held::default()));
    assert!(drives(&desk.take(&first)));
    assert!(stops(&desk.take(&second)));
    // The other lane delivers both again, later.
    assert_eq!(desk.take(&first), []);
    assert_eq!(desk.take(&second), []);
}

#[test]
fn the_speed_is_capped_by_the_age_of_the_picture() {
    let mut desk = Desk::new();
    for (late, cap) in [(0, 0.63), (120, 0.424), (216, 0.310)] {
        desk.late = Some(late);
        let out = desk.say(1, Action::Drive(forward()));
        let base = commands(&out)[0].base.unwrap();
        assert!((base.linear - cap).abs() < 0.01, "{late}: {base:?}");
        // No corner of the chair turns faster either.
        let turn = Held {
            chair: [0.0, 1.0],
            ..Held::default()
        };
        let out = desk.say(1, Action::Drive(turn));
        let base = commands(&out)[0].base.unwrap();
        assert!(
            base.angular <= 1.0 && base.angular * 1.0 <= speed::cap(late as f64 / 240.0) + 1e-9
        );
    }
}

#[test]
fn an_old_picture_allows_steps_and_a_frozen_one_only_a_stop() {
    let mut desk = Desk::new();
    let step = Action::Step {
        part: Part::Hand,
        axis: 2,
        sign: 1.0,
    };
    desk.late = Some(300);
    assert_eq!(
        refusals(&desk.say(1, Action::Drive(forward()))),
        ["TOO_OLD"]
    );
    // The same press is refused once, in words, and moves nothing when it is fresh.
    assert_eq!(desk.say(1, Action::Drive(forward())), []);
    desk.late = Some(10);
    assert_eq!(desk.say(1, Action::Drive(forward())), []);
    desk.late = Some(300);
    assert_eq!(commands(&desk.say(2, step)).len(), 1);
    for late in [Some(500), None] {
        desk.late = late;
        let epoch = desk.seq + 10;
        assert_eq!(refusals(&desk.say(epoch, step)), ["FROZEN"], "{late:?}");
        let stop = desk.say(epoch, Action::Stop);
        assert!(stops(&stop), "{late:?}");
    }
}

#[test]
fn a_picture_that_freezes_while_driving_stops_the_chair_for_good() {
    let mut desk = Desk::new();
    assert!(drives(&desk.hold(1, forward(), 0.3)));
    let frozen = desk.situation.header.tick;
    let mut out = Vec::new();
    for _ in 0..30 {
        let mut intent = desk.intent(1, Action::Drive(forward()));
        intent.shown = Some(frozen);
        out.extend(desk.take(&intent));
        out.extend(desk.wait(0.05));
    }
    assert!(stops(&out));
    assert!(!desk.motion.is_moving());
    // A new image arrives while the key is still held.
    assert!(!drives(&desk.hold(1, forward(), 0.5)));
    assert!(drives(&desk.hold(2, forward(), 0.1)));
}

#[test]
fn a_silent_page_is_braked_and_what_was_queued_moves_nothing() {
    let mut desk = Desk::new();
    assert!(drives(&desk.hold(1, forward(), 0.3)));
    // The connection stalls for a second; then all messages arrive at once.
    let queued: Vec<Intent> = (0..20)
        .map(|_| desk.intent(1, Action::Drive(forward())))
        .collect();
    let out = desk.wait(STALL + 0.02);
    assert!(stops(&out), "{out:?}");
    let out = desk.wait(1.0);
    assert!(!drives(&out));
    for intent in &queued {
        assert!(!drives(&desk.take(intent)));
    }
    // The key is still held, and images are fresh again.
    assert!(!drives(&desk.hold(1, forward(), 1.0)));
    assert!(drives(&desk.hold(2, forward(), 0.1)));
}

#[test]
fn a_latch_ends_by_itself_after_two_seconds() {
    let mut desk = Desk::new();
    desk.mode = v1::InputMode::Latch;
    let out = desk.hold(1, forward(), 1.9);
    assert!(drives(&out) && !stops(&out));
    let out = desk.hold(1, forward(), 1.0);
    assert!(stops(&out));
    assert!(!desk.motion.is_moving());
    assert!(!drives(&desk.hold(1, forward(), 0.5)));
    // Renewed by a press: two seconds more.
    let out = desk.hold(2, forward(), 1.9);
    assert!(drives(&out) && desk.motion.is_moving());
    let out = desk.hold(3, forward(), 1.9);
    assert!(drives(&out) && !stops(&out));
}

#[test]
fn a_contact_or_a_refusal_ends_the_press() {
    for mode in [v1::InputMode::Latch, v1::InputMode::Hold] {
        let mut desk = Desk::new();
        desk.mode = mode;
        desk.hold(1, forward(), 0.3);
        let now = Now {
            time: desk.time,
            situation: &desk.situation,
            in_control: true,
            goal: false,
            lock_step: false,
        };
        let out = desk.motion.cut("contact", now);
        assert!(stops(&out) && !desk.motion.is_moving());
        assert!(!drives(&desk.hold(1, forward(), 0.5)), "{mode:?}");
        assert!(drives(&desk.hold(2, forward(), 0.1)));
    }
}

#[test]
fn without_control_nothing_moves_and_a_stop_still_stops() {
    let mut desk = Desk::new();
    desk.in_control = false;
    assert_eq!(
        refusals(&desk.say(1, Action::Drive(forward()))),
        ["NO_CONTROL"]
    );
    assert!(stops(&desk.say(1, Action::Stop)));
    // Control is granted while the key is still held.
    desk.in_control = true;
    desk.motion.forget();
    assert!(!drives(&desk.hold(1, forward(), 0.3)));
    assert!(drives(&desk.hold(2, forward(), 0.1)));
}

#[test]
fn whatever_is_done_by_hand_ends_a_goal_and_holds() {
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
        let mut desk = Desk::new();
        desk.goal = true;
        let out = desk.say(1, action);
        assert!(out.contains(&Out::EndGoal), "{action:?}");
        assert!(stops(&out) && !drives(&out), "{action:?}: {out:?}");
        desk.goal = false;
        assert!(!drives(&desk.hold(1, forward(), 0.2)), "{action:?}");
    }
    // Idle messages do not end it.
    let mut desk = Desk::new();
    desk.goal = true;
    assert_eq!(desk.say(1, Action::Alive), []);
    assert_eq!(desk.say(1, Action::Drive(Held::default())), []);
}

#[test]
fn a_step_is_one_step_however_often_it_is_said() {
    let mut desk = Desk::new();
    let step = Action::Step {
        part: Part::Hand,
        axis: 0,
        sign: -1.0,
    };
    let out = desk.say(1, step);
    let Some(Target::Step(step_told)) = commands(&out)[0].arm.clone().unwrap().target else {
        panic!("{out:?}");
    };
    assert_eq!(step_told.frame(), v1::CommandFrame::Wheelchair);
    assert!((step_told.translation.unwrap().x + 0.10).abs() < 1e-12);
    assert_eq!(desk.say(1, step), []);
    assert_eq!(commands(&desk.say(2, step)).len(), 1);
    // The hand does not follow: the lead does not grow.
    if let Some(applied) = &mut desk.situation.applied {
        applied.desired_pose = Some(geometry::pose(&Isometry3::translation(-0.65, 0.0, 0.5)));
    }
    assert_eq!(refusals(&desk.say(3, step)), ["AHEAD"]);
}

#[test]
fn a_step_of_the_chair_ends_by_itself_and_by_a_stop() {
    let step = Action::Step {
        part: Part::Chair,
        axis: 0,
        sign: 1.0,
    };
    let mut desk = Desk::new();
    let out = desk.say(1, step);
    assert!(drives(&out), "{out:?}");
    for _ in 0..10 {
        desk.say(1, Action::Alive);
        desk.wait(0.05);
    }
    assert!(desk.motion.is_moving());
    desk.situation.house_from_chair = Some(Isometry3::translation(0.10, 0.0, 0.0));
    let out = desk.wait(0.02);
    assert!(stops(&out) && !desk.motion.is_moving());
    assert!(drives(&desk.say(2, step)));
    assert!(stops(&desk.say(2, Action::Stop)));
    assert!(!drives(&desk.wait(1.0)));
    // A vanished page does not finish its step.
    assert!(drives(&desk.say(3, step)));
    let out = desk.wait(GONE + 0.05);
    assert!(stops(&out) && !desk.motion.is_moving());
}

#[test]
fn the_hand_moves_along_the_axes_of_the_chair_and_holds_when_let_go() {
    let mut desk = Desk::new();
    let out = desk.say(1, Action::Drive(up()));
    let Some(Target::Twist(told)) = commands(&out)[0].arm.clone().unwrap().target else {
        panic!("{out:?}");
    };
    assert_eq!(told.frame(), v1::CommandFrame::Wheelchair);
    let linear = told.twist.unwrap().linear.unwrap();
    assert!(
        linear.z > 0.1 && linear.x == 0.0 && linear.y == 0.0,
        "{linear:?}"
    );
    // With chair input the hand is released.
    let out = desk.say(1, Action::Drive(forward()));
    let command = commands(&out)[0];
    let arm = command.arm.clone().unwrap().target;
    assert_eq!(arm, Some(Target::Hold(true)));
    assert!(command.base.unwrap().linear > 0.0);
}

#[test]
fn the_fingers_go_as_fast_as_is_wanted_and_no_further_than_they_can() {
    let mut desk = Desk::new();
    let close = Held {
        grip: -1.0,
        ..Held::default()
    };
    let out = desk.hold(1, close, 0.5);
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
    let out = desk.hold(2, close, 3.0);
    let last = commands(&out).last().unwrap().gripper.unwrap();
    let shut = v1::gripper_command::Target::Opening(0.0);
    assert_eq!(last.target, Some(shut));
}

#[test]
fn a_clutch_engages_without_a_jump_and_again_only_with_a_new_press() {
    let mut desk = Desk::new();
    desk.mode = v1::InputMode::Stream;
    let moved = |x| Held {
        clutch: Some(Clutch {
            moved: [x, 0.0, 0.0],
            turn: [0.0, 0.0, 0.0, 1.0],
        }),
        ..Held::default()
    };
    let pose = |out: &[Out]| match commands(out)[0].arm.clone().unwrap().target {
        Some(Target::Pose(told)) => normalized("pose", told.pose.as_ref()).unwrap(),
        other => panic!("{other:?}"),
    };
    let out = desk.say(1, Action::Drive(moved(0.0)));
    assert!((pose(&out).translation.x + 0.5).abs() < 1e-9);
    let out = desk.say(1, Action::Drive(moved(0.02)));
    assert!((pose(&out).translation.x + 0.52).abs() < 1e-9);
    let out = desk.say(1, Action::Drive(Held::default()));
    assert!(stops(&out));
    assert_eq!(desk.say(1, Action::Drive(moved(0.05))), []);
    // The hand is where it is: engaging anew latches it there.
    let out = desk.say(2, Action::Drive(moved(0.0)));
    assert!((pose(&out).translation.x + 0.5).abs() < 1e-9);
}
