//! The arm: an intent becomes a motion, a motion becomes joint targets.
//!
//! Whatever the motion asks, one rule makes the targets: the wanted joint
//! speeds are scaled together to the joints' and the tool's speed limits, and
//! the present speeds move towards them, all by the same fraction, within the
//! joint acceleration. So the direction of a motion survives its limits, and
//! an intent may change at any time without a jump.
//!
//! How a Cartesian pose is reached:
//! - near (0.05 m and 0.2 rad) on the same branch: joints interpolate, which
//!   is straight to a millimetre there; streamed poses take this way;
//! - further: along a straight line, when samples of it have joint positions
//!   within the limits and without jumps;
//! - else: joints interpolate to the solution that turns them least.

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

/// Share of the tool speed that is planned; the rest covers the change of the
/// Jacobian while the joints brake.
const TOOL_SHARE: f64 = 0.91;

/// Joint acceleration that the guard of a person may ask for, in units of the arm's own.
const GUARD_BRAKING: f64 = 4.0;

/// What the arm does.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Motion {
    /// Comes to rest and holds.
    Hold,
    /// Joints interpolate to a goal.
    Joints {
        /// From base to hand, rad.
        goal: [f64; 6],
        /// Goal before it in a stream of goals, rad.
        from: [f64; 6],
        /// Steps until the goal has taken the place of the one before.
        left: u32,
    },
    /// The end effector moves straight.
    Line {
        /// base_from_end_effector.
        goal: Isometry3<f64>,
        /// Joint positions at the end of the line, rad.
        joints: [f64; 6],
        /// Steps without motion.
        still: u32,
    },
    /// The end effector moves by a twist.
    Twist {
        /// The twist turns with the end effector.
        in_tool: bool,
        /// Asked, along the base's or the tool's axes.
        wanted: Velocity,
        /// Ramped up so far, along the same axes.
        now: Velocity,
    },
}

/// Greatest joint change between neighbouring goals of a stream, rad.
const STREAM_CHANGE: f64 = 0.1;

impl Motion {
    /// Joints interpolate to a goal.
    fn to(goal: [f64; 6]) -> Motion {
        Motion::Joints {
            goal,
            from: goal,
            left: 0,
        }
    }

    /// As [`Motion::to`]; a goal near the one before is a stream's, and takes its
    /// place during the control tick: towards goals that jump at each control
    /// tick and stand still in between, the arm would brake 60 times a second.
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
            _ => Motion::to(goal),
        }
    }

    /// Where joints that interpolate are led to now, rad.
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
    /// What the arm does.
    pub motion: Motion,
    /// base_from_end_effector that the motion leads to.
    pub desired: Isometry3<f64>,
    /// Why the last intent is not followed.
    pub problem: Option<String>,
}

/// What does not change: kinematics and limits.
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

    /// Takes a new intent.
    pub(super) fn take(&self, state: &mut ArmState, intent: &ArmIntent, snapshot: &Snapshot) {
        let problem = state.problem.take();
        match *intent {
            ArmIntent::Hold => state.motion = Motion::Hold,
            ArmIntent::Joints(asked) => {
                let mut goal = asked;
                self.kinematics.clamp(&mut goal);
                state.motion = state.motion.on_to(goal);
                state.desired = self.kinematics.forward(&goal);
                state.problem = (0..6).find(|&i| goal[i] != asked[i]).map(|i| {
                    format!(
                        "{} is asked to {:.4} rad, its limit is {:.4} rad",
                        joint_word(i),
                        asked[i],
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
                // Its own problem lasts until the arm follows again.
                if matches!(state.motion, Motion::Twist { .. }) {
                    state.problem = problem;
                }
                self.twist(state, in_tool, wanted);
            }
        }
    }

    /// base_from_frame now; `tool` stands for the end effector.
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

    /// Takes the commanded positions back to the lead that the guard allows.
    pub(super) fn shorten_lead(&self, state: &mut ArmState, guard: &Guard) {
        let (_, jacobian) = self.kinematics.forward_and_jacobian(&state.position);
        guard.shorten_lead(&mut state.position, &self.settings.stiffness, |lead| {
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

    /// Moves the joint speeds towards the wanted ones within all limits, and
    /// the joints by them.
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
        // Once below the stopping speed, a joint can always stay below it.
        let room = |distance: f64| stopping_speed(distance, self.settings.acceleration, dt);
        if guard.is_some() {
            // A joint that stops at its end no longer turns against the others.
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
            // Beside a person it may brake harder than it may accelerate. Without any limit
            // the speeds of light links jump where the nearest point changes.
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
        // Rounding only: the stopping speed lands on the limit.
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
