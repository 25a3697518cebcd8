//! The arm: converts an intent to a motion, and a motion to joint targets.
//!
//! One rule computes the targets of every motion: the wanted joint speeds are scaled
//! together to the speed limits of joints and tool, and the present speeds approach
//! them, all by the same fraction, within the joint acceleration. So limits do not
//! change the direction of a motion, and an intent may change at any time without a
//! jump.
//!
//! A Cartesian pose is reached in one of three ways:
//! - near (0.05 m and 0.2 rad) on the same branch: joints interpolate, which is
//!   straight to a millimetre; streamed poses use this;
//! - further: along a straight line, if its samples have joint positions within the
//!   limits and without jumps;
//! - otherwise: joints interpolate to the solution with the smallest rotation.

mod cartesian;
mod line;
mod twist;

use nalgebra::{Isometry3, Matrix6, Translation3, UnitQuaternion, Vector3, Vector6};
use serde::{Deserialize, Serialize};
use wheelarm_proto::exact;

pub use self::cartesian::Velocity;
use super::profile::{SPEED_SHARE, stopping_speed};
use super::{ArmIntent, Guard, IntentFrame, TICKS};
use crate::robot::kinematics::{ArmKinematics, joint_word};
use crate::robot::{ArmSettings, RobotModel};
use crate::snapshot::Snapshot;

/// Share of the tool speed that is planned; the rest covers the change of the Jacobian
/// while the joints brake.
const TOOL_SHARE: f64 = 0.91;

/// Joint acceleration available to the person guard, in units of the arm's own.
const GUARD_BRAKING: f64 = 4.0;

/// Motion of the arm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Motion {
    /// Brakes and holds.
    Hold,
    /// Joints interpolate to a goal.
    Joints {
        /// From base to hand, rad.
        goal: [f64; 6],
        /// Previous goal in a stream of goals, rad.
        from: [f64; 6],
        /// Steps until the goal has replaced the previous one.
        left: u32,
    },
    /// The end effector moves along a straight line.
    Line {
        /// base_from_end_effector.
        goal: Isometry3<f64>,
        /// Joint positions at the end of the line, rad.
        joints: [f64; 6],
        /// Steps without motion.
        still: u32,
    },
    /// The end effector moves with a twist.
    Twist {
        /// The twist rotates with the end effector.
        in_tool: bool,
        /// Commanded twist, along the base's or the tool's axes.
        wanted: Velocity,
        /// Present twist of the ramp, along the same axes.
        now: Velocity,
    },
}

/// Largest joint change between neighbouring goals of a stream, rad.
const STREAM_CHANGE: f64 = 0.1;

impl Motion {
    /// Joints interpolate to a goal.
    fn toward(goal: [f64; 6]) -> Motion {
        Motion::Joints {
            goal,
            from: goal,
            left: 0,
        }
    }

    /// As [`Motion::to`]. A goal near the previous one is part of a stream and replaces
    /// it gradually during the control tick: with goals that jump at each control tick
    /// the arm would brake 60 times per second.
    fn on_to(&self, goal: [f64; 6]) -> Motion {
        let near = |before: [f64; 6]| {
            let mut pairs = before.iter().zip(&goal);
            pairs.all(|(b, g)| (g - b).abs() <= STREAM_CHANGE)
        };
        match *self {
            Motion::Joints { .. } if near(self.aim()) => Motion::Joints {
                goal,
                from: self.aim(),
                left: TICKS as u32,
            },
            _ => Motion::toward(goal),
        }
    }

    /// Present goal of interpolating joints, rad.
    fn aim(&self) -> [f64; 6] {
        let Motion::Joints { goal, from, left } = *self else {
            return [0.0; 6];
        };
        let part = f64::from(left) / TICKS as f64;
        std::array::from_fn(|i| goal[i] - (goal[i] - from[i]) * part)
    }
}

/// State of the arm's control.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ArmState {
    /// Commanded positions of joint_1 to joint_6, rad.
    pub position: [f64; 6],
    /// Their speeds, rad/s.
    pub velocity: [f64; 6],
    /// Present motion.
    pub motion: Motion,
    /// base_from_end_effector at the goal of the motion.
    pub desired: Isometry3<f64>,
    /// Why the last intent is not followed.
    pub problem: Option<String>,
}

/// Constant data: kinematics and limits.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ArmControl {
    pub kinematics: ArmKinematics,
    settings: ArmSettings,
    tool_length: f64,
    /// Link of the arm's base.
    base_link: usize,
    /// chair_from_base.
    chair_from_base: Isometry3<f64>,
}

impl ArmControl {
    pub(super) fn new(model: &RobotModel) -> ArmControl {
        ArmControl {
            kinematics: ArmKinematics::new(model),
            settings: model.settings.arm,
            tool_length: model.settings.tool_length,
            base_link: model.roles.arm_base,
            chair_from_base: model.arm_mount(),
        }
    }

    /// At rest at given joint positions.
    pub(super) fn at_rest(&self, joints: &[f64; 6]) -> ArmState {
        let mut position = *joints;
        self.kinematics.clamp(&mut position);
        ArmState {
            position,
            velocity: [0.0; 6],
            motion: Motion::Hold,
            desired: self.kinematics.forward(&position),
            problem: None,
        }
    }

    /// Accepts a new intent.
    pub(super) fn take(&self, state: &mut ArmState, intent: &ArmIntent, snapshot: &Snapshot) {
        let problem = state.problem.take();
        match *intent {
            ArmIntent::Hold => state.motion = Motion::Hold,
            ArmIntent::Joints(commanded) => {
                let mut goal = commanded;
                self.kinematics.clamp(&mut goal);
                state.motion = state.motion.on_to(goal);
                state.desired = self.kinematics.forward(&goal);
                state.problem = (0..6).find(|&i| goal[i] != commanded[i]).map(|i| {
                    format!(
                        "{} is commanded to {:.4} rad, its limit is {:.4} rad",
                        joint_word(i),
                        commanded[i],
                        goal[i]
                    )
                });
            }
            ArmIntent::Pose { frame, pose } => {
                let present = self.kinematics.forward(&state.position);
                let goal = self.base_from(frame, &present, snapshot) * pose;
                self.reach(state, &goal);
            }
            ArmIntent::Step {
                frame,
                translation,
                rotation,
            } => {
                let axes = self.base_from(frame, &state.desired, snapshot).rotation;
                let turn = UnitQuaternion::from_scaled_axis(rotation);
                let goal = Isometry3::from_parts(
                    Translation3::from(state.desired.translation.vector + axes * translation),
                    state.desired.rotation * turn,
                );
                self.reach(state, &goal);
            }
            ArmIntent::Twist {
                frame,
                linear,
                angular,
            } => {
                let in_tool = frame == IntentFrame::EndEffector;
                let axes = if in_tool {
                    UnitQuaternion::identity()
                } else {
                    self.base_from(frame, &Isometry3::identity(), snapshot)
                        .rotation
                };
                let velocity = Velocity { linear, angular };
                let wanted = velocity
                    .turned(&axes)
                    .cut(self.settings.tool_speed, self.settings.tool_turn_rate);
                // The twist's problem lasts until the arm follows again.
                if matches!(state.motion, Motion::Twist { .. }) {
                    state.problem = problem;
                }
                self.twist(state, in_tool, wanted);
            }
        }
    }

    /// Present base_from_frame; `tool` is the end effector.
    fn base_from(
        &self,
        frame: IntentFrame,
        tool: &Isometry3<f64>,
        snapshot: &Snapshot,
    ) -> Isometry3<f64> {
        match frame {
            IntentFrame::ArmBase => Isometry3::identity(),
            IntentFrame::EndEffector => *tool,
            IntentFrame::Wheelchair => self.chair_from_base.inverse(),
            IntentFrame::House => snapshot
                .links
                .get(self.base_link)
                .map_or_else(Isometry3::identity, |base| base.pose.inverse()),
        }
    }

    /// Reduces the lead of the commanded positions to that allowed by the guard.
    pub(super) fn shorten_lead(&self, state: &mut ArmState, guard: &Guard) {
        let (_, jacobian) = self.kinematics.forward_and_jacobian(&state.position);
        guard.shorten_lead(&mut state.position, &self.settings, |lead| {
            self.tool_speed(&jacobian, lead)
        });
        self.kinematics.clamp(&mut state.position);
    }

    /// One step of `dt` seconds.
    pub(super) fn advance(&self, state: &mut ArmState, guard: Option<&Guard>, dt: f64) {
        let (pose, jacobian) = self.kinematics.forward_and_jacobian(&state.position);
        let wanted = match state.motion {
            Motion::Hold => {
                state.desired = pose;
                [0.0; 6]
            }
            Motion::Joints { goal, from, left } => {
                let left = left.saturating_sub(1);
                state.motion = Motion::Joints { goal, from, left };
                self.towards_joints(&state.position, &state.motion.aim(), dt)
            }
            Motion::Line {
                goal,
                joints,
                still,
            } => self.along_line(state, &pose, &jacobian, (goal, joints, still), dt),
            Motion::Twist {
                in_tool,
                wanted,
                now,
            } => self.by_twist(state, &pose, &jacobian, (in_tool, wanted, now), dt),
        };
        self.follow(state, wanted, &jacobian, guard, dt);
    }

    /// Joint speeds that interpolate to a goal and stop there.
    fn towards_joints(&self, position: &[f64; 6], goal: &[f64; 6], dt: f64) -> [f64; 6] {
        let way: [f64; 6] = std::array::from_fn(|i| goal[i] - position[i]);
        let longest = way.iter().fold(0.0_f64, |most, part| most.max(part.abs()));
        if longest == 0.0 {
            return [0.0; 6];
        }
        let rate = stopping_speed(longest, self.settings.acceleration, dt) / longest;
        way.map(|part| part * rate)
    }

    /// Moves the joint speeds towards the wanted ones within all limits, and integrates
    /// them.
    fn follow(
        &self,
        state: &mut ArmState,
        mut wanted: [f64; 6],
        jacobian: &Matrix6<f64>,
        guard: Option<&Guard>,
        dt: f64,
    ) {
        let speed = self.kinematics.speed();
        let (lower, upper) = (self.kinematics.lower(), self.kinematics.upper());
        // A joint below the stopping speed can always stay below it.
        let room = |distance: f64| stopping_speed(distance, self.settings.acceleration, dt);
        if guard.is_some() {
            // A joint that stops at its limit no longer affects the others.
            for i in 0..6 {
                let (below, above) = (state.position[i] - lower[i], upper[i] - state.position[i]);
                wanted[i] = exact::within(wanted[i], -room(below), room(above));
            }
        }
        let tool_speed = self.tool_speed(jacobian, &wanted);
        let most = self.settings.tool_speed;
        let most = guard.map_or(most, |guard| guard.tool_speed.min(most));
        let excess = (0..6)
            .map(|i| wanted[i].abs() / (SPEED_SHARE * speed[i]))
            .fold(tool_speed / (TOOL_SHARE * most), f64::max);
        if excess > 1.0 {
            wanted = wanted.map(|part| part / excess);
        }
        let change: [f64; 6] = std::array::from_fn(|i| wanted[i] - state.velocity[i]);
        let largest = change
            .iter()
            .fold(0.0_f64, |most, part| most.max(part.abs()));
        let allowed = self.settings.acceleration * dt;
        let part = if largest > allowed {
            allowed / largest
        } else {
            1.0
        };
        let (least, greatest): ([f64; 6], [f64; 6]) = (
            std::array::from_fn(|i| -room(state.position[i] - lower[i])),
            std::array::from_fn(|i| room(upper[i] - state.position[i])),
        );
        let mut velocity: [f64; 6] = std::array::from_fn(|i| {
            exact::within(state.velocity[i] + part * change[i], least[i], greatest[i])
        });
        if let Some(guard) = guard {
            // Near a person it may brake harder than it may accelerate. Without a limit
            // the speeds of light links would jump where the nearest point changes.
            let before = state.velocity;
            let most = GUARD_BRAKING * allowed;
            let least = std::array::from_fn(|i| least[i].max(-SPEED_SHARE * speed[i]));
            let greatest = std::array::from_fn(|i| greatest[i].min(SPEED_SHARE * speed[i]));
            guard.bound(&mut velocity, &least, &greatest);
            for i in 0..6 {
                let eased = exact::within(velocity[i], before[i] - most, before[i] + most);
                velocity[i] = exact::within(eased, least[i], greatest[i]);
            }
        }
        state.velocity = velocity;
        for (position, velocity) in state.position.iter_mut().zip(velocity) {
            *position += velocity * dt;
        }
        // Rounding only: the stopping speed ends exactly at the limit.
        self.kinematics.clamp(&mut state.position);
    }

    /// Speed of the grasp point, m/s.
    fn tool_speed(&self, jacobian: &Matrix6<f64>, velocity: &[f64; 6]) -> f64 {
        let twist = jacobian * Vector6::from(*velocity);
        let angular = twist.fixed_rows::<3>(0).into_owned();
        let linear = twist.fixed_rows::<3>(3).into_owned();
        (linear + angular.cross(&Vector3::new(0.0, 0.0, self.tool_length))).norm()
    }
}
