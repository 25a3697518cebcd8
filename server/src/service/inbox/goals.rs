//! Streams of arm goals that come late, played back evenly.
//!
//! Whoever leads the arm by poses or joint positions sends one per state, each
//! meant for the tick that it answers. On a busy host or a long link they come
//! late by turns and in bunches; taken as they come, the arm would brake in
//! every gap and hurry after it. So a stream is held back by as much as its
//! latest goal of the last two seconds was late, and gone through at the pace in
//! which it was meant, straight between neighbouring goals. A stream that is on
//! time, or late by always the same, is not held back: every goal is taken when
//! it comes. No goal is ever run past, and whatever is no stream (a far pose, a
//! step, a twist, a stop) is taken at once.

use std::collections::VecDeque;

use wheelarm_proto::{PHYSICS_HZ, TICKS_PER_CONTROL};

use crate::robot::control::ArmIntent;

/// How long a late goal is remembered, ticks.
const MEMORY: u64 = 2 * PHYSICS_HZ;
/// Goals that are later are no stream, ticks: 0.25 s.
const LATEST: u64 = PHYSICS_HZ / 4;
/// Neighbours of a stream answer states at most this far apart, ticks: 0.1 s.
const SPACING: u64 = PHYSICS_HZ / 10;
/// Neighbours of a stream are at most this far apart, m and rad.
const NEAR: (f64, f64) = (0.05, 0.2);
/// How much faster than meant a stream is gone through that has become less late.
const HASTE: f64 = 0.02;

/// A goal and the tick that it answers.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Goal {
    tick: u64,
    intent: ArmIntent,
}

/// The stream that leads the arm.
#[derive(Debug, Default)]
pub(super) struct Goals {
    /// Goals from the one played last on, oldest first.
    goals: VecDeque<Goal>,
    /// Ticks at which goals came, and how late they were, ticks.
    late: VecDeque<(u64, u64)>,
    /// How far the stream is held back, ticks.
    held: f64,
    /// What was taken last.
    last: Option<ArmIntent>,
}

impl Goals {
    /// Forgets the stream.
    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    /// A command's intent for the arm that came for the control tick at `tick`
    /// and answers the state of `answers`; 0 answers none. Returns the intent
    /// when it is no part of a stream and taken at once.
    pub(super) fn came(&mut self, tick: u64, answers: u64, intent: ArmIntent) -> Option<ArmIntent> {
        let late = tick.saturating_sub(answers);
        let alone = answers == 0 || answers > tick || late > LATEST;
        let goes_on = self.goals.back().is_some_and(|last| {
            answers > last.tick
                && answers - last.tick <= SPACING
                && between(&last.intent, &intent, 0.5).is_some()
        });
        if alone || !goes_on {
            self.goals.clear();
            self.last = Some(intent);
        }
        if !alone && between(&intent, &intent, 0.5).is_some() {
            self.late.push_back((tick, late));
            self.goals.push_back(Goal {
                tick: answers,
                intent,
            });
        }
        (alone || !goes_on).then_some(intent)
    }

    /// What the arm is to be told at the control tick at `tick`, if anything new.
    pub(super) fn play(&mut self, tick: u64) -> Option<ArmIntent> {
        self.late
            .retain(|(came, _)| tick.saturating_sub(*came) < MEMORY);
        let latest = self.late.iter().map(|(_, late)| *late).max().unwrap_or(0) as f64;
        self.held = if self.goals.len() > 1 {
            latest.max(self.held - HASTE * TICKS_PER_CONTROL as f64)
        } else {
            latest
        };
        let newest = self.goals.back()?;
        let now = (tick as f64 - self.held).min(newest.tick as f64);
        // The goal before that time stays, the one after it comes next.
        while self
            .goals
            .get(1)
            .is_some_and(|next| next.tick as f64 <= now)
        {
            self.goals.pop_front();
        }
        let from = self.goals.front()?;
        let intent = match self.goals.get(1) {
            Some(to) if now > from.tick as f64 => {
                let part = (now - from.tick as f64) / (to.tick - from.tick) as f64;
                between(&from.intent, &to.intent, part)?
            }
            // The stream begins later, or this is its end.
            _ => from.intent,
        };
        if self.last.as_ref() == Some(&intent) {
            return None;
        }
        self.last = Some(intent);
        Some(intent)
    }
}

/// The goal at a share of the way between two of a stream; `None` when they are
/// too far apart, or no goals.
fn between(from: &ArmIntent, to: &ArmIntent, part: f64) -> Option<ArmIntent> {
    match (from, to) {
        (ArmIntent::Joints(from), ArmIntent::Joints(to)) => {
            let near = from.iter().zip(to).all(|(a, b)| (b - a).abs() <= NEAR.1);
            let joints = std::array::from_fn(|i| from[i] + (to[i] - from[i]) * part);
            near.then_some(ArmIntent::Joints(joints))
        }
        (
            ArmIntent::Pose { frame, pose: from },
            ArmIntent::Pose {
                frame: other,
                pose: to,
            },
        ) if frame == other => {
            let way = (to.translation.vector - from.translation.vector).norm();
            let near = way <= NEAR.0 && from.rotation.angle_to(&to.rotation) <= NEAR.1;
            let pose = near.then(|| from.lerp_slerp(to, part))?;
            Some(ArmIntent::Pose {
                frame: *frame,
                pose,
            })
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::control::{ControlInput, IntentFrame};
    use crate::sim::{Scenario, Simulation};
    use nalgebra::{Isometry3, Translation3};

    /// Seconds of the way that is led.
    const LONG: f64 = 8.0;

    /// A hand that swings by 0.1 m, from rest: metres to the side at a time.
    fn way(time: f64) -> f64 {
        let gentle = (time / 2.0).min(1.0);
        0.1 * gentle * gentle * (1.4 * time).sin()
    }

    /// A pseudo-random number below `most` (splitmix64).
    fn chance(seed: u64, most: u64) -> u64 {
        let mut z = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % most
    }

    /// The greatest rms, over the arm's joints, of how much a velocity differs
    /// from the mean of its neighbours 1/60 s before and after, rad/s, when the
    /// goal of each state comes `late(tick)` ticks late; and the greatest
    /// distance of the hand from where it was led to at that time, metres.
    fn led(late: impl Fn(u64) -> u64, smooth: bool) -> (f64, f64) {
        let assets = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
        let scenario = Scenario {
            task: String::new(),
            cameras: Vec::new(),
            ..Scenario::default()
        };
        let mut sim = Simulation::new(&assets, scenario).expect("a simulation");
        let start = sim.control().desired_pose();
        let at = |time: f64| Translation3::new(0.0, way(time), 0.0) * start;
        let hand = |sim: &Simulation| -> Isometry3<f64> {
            let joints = sim.recorded_joints();
            let arm = std::array::from_fn(|i| joints[4 + i].position);
            sim.control().kinematics().forward(&arm)
        };
        let mut goals = Goals::default();
        let mut coming: Vec<(u64, u64)> = Vec::new();
        let mut velocities: Vec<[f64; 6]> = Vec::new();
        let mut off: f64 = 0.0;
        let mut arrived = 0;
        for tick in (0..(LONG * PHYSICS_HZ as f64) as u64).step_by(4) {
            // Goals come in order.
            arrived = (tick + late(tick)).max(arrived);
            coming.push((arrived, tick));
            let mut told = None;
            for (_, answers) in coming.extract_if(.., |(when, _)| *when <= tick) {
                let pose = at((answers + 4) as f64 / PHYSICS_HZ as f64);
                let intent = ArmIntent::Pose {
                    frame: IntentFrame::ArmBase,
                    pose,
                };
                told = if smooth {
                    goals.came(tick, answers, intent).or(told)
                } else {
                    Some(intent)
                };
            }
            if smooth {
                told = goals.play(tick).or(told);
            }
            sim.step(&ControlInput {
                arm: told,
                ..ControlInput::default()
            });
            let joints = sim.recorded_joints();
            velocities.push(std::array::from_fn(|i| joints[4 + i].velocity));
            let led = at((tick + 4) as f64 / PHYSICS_HZ as f64);
            let distance = hand(&sim).translation.vector - led.translation.vector;
            off = off.max(distance.norm());
        }
        // From the time on at which the stream has shown how late it can be.
        let settled = &velocities[120..];
        let rms = |joint: usize| {
            let squares = settled.windows(3).map(|w| {
                let jump = w[1][joint] - (w[0][joint] + w[2][joint]) / 2.0;
                jump * jump
            });
            (squares.sum::<f64>() / (settled.len() - 2) as f64).sqrt()
        };
        ((0..6).map(rms).fold(0.0, f64::max), off)
    }

    #[test]
    fn goals_that_come_late_by_turns_move_the_arm_evenly() {
        let on_time = led(|_| 0, true);
        assert_eq!(on_time, led(|_| 0, false), "on time nothing is changed");
        let late = |tick: u64| chance(tick, 10) * 4;
        let (raw, _) = led(late, false);
        let (even, off) = led(late, true);
        println!(
            "jitter rad/s: on time {:.4}, as they come {raw:.4}, evenly {even:.4}",
            on_time.0
        );
        println!(
            "hand from where it is led: on time {:.4} m, late {off:.4} m",
            on_time.1
        );
        assert!(on_time.0 < 0.005, "{on_time:?}");
        assert!(raw > 0.01, "the test shows nothing: {raw}");
        assert!(even < 0.005, "{even}");
        // 36 ticks at 0.14 m/s.
        assert!(off < 0.15 * 0.15 + on_time.1, "{off}");
    }

    #[test]
    fn what_is_no_stream_is_taken_at_once_and_ends_the_stream() {
        let pose = |y: f64| ArmIntent::Pose {
            frame: IntentFrame::ArmBase,
            pose: Isometry3::translation(0.4, y, 0.3),
        };
        let mut goals = Goals::default();
        // The first goal is taken at once, also when it is late.
        assert_eq!(goals.came(20, 4, pose(0.0)), Some(pose(0.0)));
        assert_eq!(goals.play(20), None);
        assert_eq!(goals.came(24, 8, pose(0.001)), None);
        assert_eq!(goals.play(24), Some(pose(0.001)), "always late by the same");
        // A far pose and a stop do not wait behind the stream.
        assert_eq!(goals.came(28, 12, pose(0.3)), Some(pose(0.3)));
        assert_eq!(goals.came(32, 28, ArmIntent::Hold), Some(ArmIntent::Hold));
        assert_eq!(goals.play(32), None);
        assert_eq!(goals.play(400), None, "nothing comes back after a stop");
        // Goals that name no state are taken as they come.
        assert_eq!(goals.came(400, 0, pose(0.1)), Some(pose(0.1)));
        assert_eq!(goals.came(404, 0, pose(0.101)), Some(pose(0.101)));
        // A stream of ten goals a second on time is not held back.
        let mut goals = Goals::default();
        for i in 0..20 {
            let (tick, goal) = (24 * i + 24, pose(0.01 * i as f64));
            let told = goals.came(tick, tick, goal);
            assert_eq!(told.or(goals.play(tick)), Some(goal));
            assert_eq!(goals.play(tick + 4), None);
        }
    }

    #[test]
    fn the_end_of_a_late_stream_is_reached_and_never_passed() {
        let joints = |x: f64| ArmIntent::Joints([x; 6]);
        let mut goals = Goals::default();
        let mut told = Vec::new();
        let mut tick = 0;
        for i in 0..50 {
            let answers = 4 * i + 4;
            tick = (answers + chance(i, 10) * 4).max(tick);
            told.extend(goals.came(tick, answers, joints(0.01 * i as f64)));
            told.extend(goals.play(tick));
        }
        for later in 1..100 {
            told.extend(goals.play(tick + 4 * later));
        }
        let ways: Vec<f64> = told
            .iter()
            .map(|intent| match intent {
                ArmIntent::Joints(joints) => joints[0],
                _ => f64::NAN,
            })
            .collect();
        assert!(ways.windows(2).all(|w| w[0] < w[1]), "{ways:?}");
        assert_eq!(ways.last(), Some(&(0.01 * 49.0)));
    }
}
