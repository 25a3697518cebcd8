//! Plays back late streams of arm goals evenly.
//!
//! A client that moves the arm by poses or joint positions sends one goal per state,
//! meant for the tick that it answers. On a busy host or a long connection goals arrive
//! late and in bunches. Applied on arrival, the arm would brake in every gap and then
//! catch up.
//!
//! The stream is therefore delayed by the largest lateness of the last two seconds, and
//! played at its intended pace, interpolated between neighbouring goals. A stream with
//! constant lateness is not delayed: every goal is applied on arrival. Goals are never
//! extrapolated. An intent outside a stream (a far pose, a step, a twist, a stop) is
//! applied at once.

use std::collections::VecDeque;

use wheelarm_proto::{PHYSICS_HZ, TICKS_PER_CONTROL};

use crate::robot::control::ArmIntent;

/// How long the lateness of a goal is remembered, ticks.
const MEMORY: u64 = 2 * PHYSICS_HZ;
/// Goals later than this are not part of a stream, ticks: 0.25 s.
const LATEST: u64 = PHYSICS_HZ / 4;
/// Largest spacing between the states of neighbouring goals, ticks: 0.1 s.
const SPACING: u64 = PHYSICS_HZ / 10;
/// Largest distance between neighbouring goals, m and rad.
const NEAR: (f64, f64) = (0.05, 0.2);
/// How much faster than intended a stream is played after its lateness decreased.
const HASTE: f64 = 0.02;

/// A goal and the tick that it answers.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Goal {
    tick: u64,
    intent: ArmIntent,
}

/// The stream of goals for the arm.
#[derive(Debug, Default)]
pub(super) struct GoalStream {
    /// Goals from the last one played, oldest first.
    goal_stream: VecDeque<Goal>,
    /// Ticks at which goals arrived, and their lateness, ticks.
    late: VecDeque<(u64, u64)>,
    /// Delay of the stream, ticks.
    held: f64,
    /// Last intent returned.
    last: Option<ArmIntent>,
}

impl GoalStream {
    /// Drops the stream.
    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Adds an arm intent that arrived for the control tick at `tick` and answers the
    /// state of `answers`; 0 means none. Returns the intent when it is not part of a
    /// stream and applies at once.
    pub(super) fn push(&mut self, tick: u64, answers: u64, intent: ArmIntent) -> Option<ArmIntent> {
        let late = tick.saturating_sub(answers);
        let alone = answers == 0 || answers > tick || late > LATEST;
        let goes_on = self.goal_stream.back().is_some_and(|last| {
            answers > last.tick
                && answers - last.tick <= SPACING
                && between(&last.intent, &intent, 0.5).is_some()
        });
        if alone || !goes_on {
            self.goal_stream.clear();
            self.last = Some(intent);
        }
        if !alone && between(&intent, &intent, 0.5).is_some() {
            self.late.push_back((tick, late));
            self.goal_stream.push_back(Goal {
                tick: answers,
                intent,
            });
        }
        (alone || !goes_on).then_some(intent)
    }

    /// Returns the arm intent for the control tick at `tick`, if it changed.
    pub(super) fn play(&mut self, tick: u64) -> Option<ArmIntent> {
        self.late
            .retain(|(arrived, _)| tick.saturating_sub(*arrived) < MEMORY);
        let latest = self.late.iter().map(|(_, late)| *late).max().unwrap_or(0) as f64;
        self.held = if self.goal_stream.len() > 1 {
            latest.max(self.held - HASTE * TICKS_PER_CONTROL as f64)
        } else {
            latest
        };
        let newest = self.goal_stream.back()?;
        let now = (tick as f64 - self.held).min(newest.tick as f64);
        // Keep the goal before that time; the next one follows it.
        while self
            .goal_stream
            .get(1)
            .is_some_and(|next| next.tick as f64 <= now)
        {
            self.goal_stream.pop_front();
        }
        let from = self.goal_stream.front()?;
        let intent = match self.goal_stream.get(1) {
            Some(to) if now > from.tick as f64 => {
                let part = (now - from.tick as f64) / (to.tick - from.tick) as f64;
                between(&from.intent, &to.intent, part)?
            }
            // Before the start of the stream, or at its end.
            _ => from.intent,
        };
        if self.last.as_ref() == Some(&intent) {
            return None;
        }
        self.last = Some(intent);
        Some(intent)
    }
}

/// The goal at share `part` between two neighbouring goals; `None` when they are too
/// far apart or not goals.
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
    use wheelarm_proto::random::{SPLITMIX64_STEP, splitmix64};

    /// Length of the test, s.
    const LONG: f64 = 8.0;

    /// A hand that swings by 0.1 m from rest: lateral position at a time, metres.
    fn way(time: f64) -> f64 {
        let gentle = (time / 2.0).min(1.0);
        0.1 * gentle * gentle * (1.4 * time).sin()
    }

    /// A pseudo-random number below `most`.
    fn chance(seed: u64, most: u64) -> u64 {
        splitmix64(seed.wrapping_sub(1).wrapping_mul(SPLITMIX64_STEP)) % most
    }

    /// Moves the arm along a path when the goal of each state arrives `late(tick)`
    /// ticks late. Returns the jitter, rad/s: the largest rms over the joints of the
    /// difference between a velocity and the mean of its neighbours 1/60 s away. Also
    /// returns the largest distance of the hand from the intended position, metres.
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
        let mut goal_stream = GoalStream::default();
        let mut coming: Vec<(u64, u64)> = Vec::new();
        let mut velocities: Vec<[f64; 6]> = Vec::new();
        let mut off: f64 = 0.0;
        let mut arrived = 0;
        for tick in (0..(LONG * PHYSICS_HZ as f64) as u64).step_by(4) {
            // Goals arrive in order.
            arrived = (tick + late(tick)).max(arrived);
            coming.push((arrived, tick));
            let mut reason = None;
            for (_, answers) in coming.extract_if(.., |(when, _)| *when <= tick) {
                let pose = at((answers + 4) as f64 / PHYSICS_HZ as f64);
                let intent = ArmIntent::Pose {
                    frame: IntentFrame::ArmBase,
                    pose,
                };
                reason = if smooth {
                    goal_stream.push(tick, answers, intent).or(reason)
                } else {
                    Some(intent)
                };
            }
            if smooth {
                reason = goal_stream.play(tick).or(reason);
            }
            sim.step(&ControlInput {
                arm: reason,
                ..ControlInput::default()
            });
            let joints = sim.recorded_joints();
            velocities.push(std::array::from_fn(|i| joints[4 + i].velocity));
            let led = at((tick + 4) as f64 / PHYSICS_HZ as f64);
            let distance = hand(&sim).translation.vector - led.translation.vector;
            off = off.max(distance.norm());
        }
        // From the time at which the stream has shown its lateness.
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
    fn goals_with_varying_lateness_move_the_arm_evenly() {
        let on_time = led(|_| 0, true);
        assert_eq!(on_time, led(|_| 0, false), "goals on time are unchanged");
        let late = |tick: u64| chance(tick, 10) * 4;
        let (raw, _) = led(late, false);
        let (even, off) = led(late, true);
        println!(
            "jitter rad/s: on time {:.4}, on arrival {raw:.4}, evenly {even:.4}",
            on_time.0
        );
        println!(
            "distance of the hand from the goal: on time {:.4} m, late {off:.4} m",
            on_time.1
        );
        assert!(on_time.0 < 0.005, "{on_time:?}");
        assert!(raw > 0.01, "the test shows nothing: {raw}");
        assert!(even < 0.005, "{even}");
        // 36 ticks at 0.14 m/s.
        assert!(off < 0.15 * 0.15 + on_time.1, "{off}");
    }

    #[test]
    fn an_intent_outside_a_stream_applies_at_once_and_ends_the_stream() {
        let pose = |y: f64| ArmIntent::Pose {
            frame: IntentFrame::ArmBase,
            pose: Isometry3::translation(0.4, y, 0.3),
        };
        let mut goal_stream = GoalStream::default();
        // The first goal applies at once, even when it is late.
        assert_eq!(goal_stream.push(20, 4, pose(0.0)), Some(pose(0.0)));
        assert_eq!(goal_stream.play(20), None);
        assert_eq!(goal_stream.push(24, 8, pose(0.001)), None);
        assert_eq!(goal_stream.play(24), Some(pose(0.001)), "constant lateness");
        // A far pose and a stop do not wait behind the stream.
        assert_eq!(goal_stream.push(28, 12, pose(0.3)), Some(pose(0.3)));
        assert_eq!(
            goal_stream.push(32, 28, ArmIntent::Hold),
            Some(ArmIntent::Hold)
        );
        assert_eq!(goal_stream.play(32), None);
        assert_eq!(
            goal_stream.play(400),
            None,
            "no goal is played after a stop"
        );
        // Goals that name no state apply on arrival.
        assert_eq!(goal_stream.push(400, 0, pose(0.1)), Some(pose(0.1)));
        assert_eq!(goal_stream.push(404, 0, pose(0.101)), Some(pose(0.101)));
        // A stream of ten goals per second on time is not delayed.
        let mut goal_stream = GoalStream::default();
        for i in 0..20 {
            let (tick, goal) = (24 * i + 24, pose(0.01 * i as f64));
            let reason = goal_stream.push(tick, tick, goal);
            assert_eq!(reason.or(goal_stream.play(tick)), Some(goal));
            assert_eq!(goal_stream.play(tick + 4), None);
        }
    }

    #[test]
    fn the_end_of_a_late_stream_is_reached_and_never_passed() {
        let joints = |x: f64| ArmIntent::Joints([x; 6]);
        let mut goal_stream = GoalStream::default();
        let mut reason = Vec::new();
        let mut tick = 0;
        for i in 0..50 {
            let answers = 4 * i + 4;
            tick = (answers + chance(i, 10) * 4).max(tick);
            reason.extend(goal_stream.push(tick, answers, joints(0.01 * i as f64)));
            reason.extend(goal_stream.play(tick));
        }
        for later in 1..100 {
            reason.extend(goal_stream.play(tick + 4 * later));
        }
        let ways: Vec<f64> = reason
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
