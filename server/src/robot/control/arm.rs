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

use nalgebra::{Isometry3, Matrix6, Translation3, UnitQuaternion, Vector3, Vector6};
use serde::{Deserialize, Serialize};

use super::profile::stopping_speed;
use super::{ArmIntent, IntentFrame};
use crate::robot::kinematics::screw::rotation_vector;
use crate::robot::kinematics::{ARM_JOINTS, ArmKinematics};
use crate::robot::{ArmSettings, RobotModel};
use crate::snapshot::Snapshot;

/// Distance, m, and angle, rad, up to which joints interpolate to a pose.
const NEAR: (f64, f64) = (0.05, 0.2);
/// Greatest joint change to a near pose, rad.
const NEAR_CHANGE: f64 = 0.4;
/// Spacing of the samples that check a line, m and rad.
const SAMPLE: (f64, f64) = (0.02, 0.1);
/// Greatest joint change between two samples, rad.
const SAMPLE_CHANGE: f64 = 0.35;
/// From the end of a line, m and rad, on which joints interpolate to land exactly.
const LANDING: (f64, f64) = (0.01, 0.05);
/// Steps that a line may stand still before joints interpolate instead: 0.25 s.
const STALL_STEPS: u32 = 60;
/// Length that makes a radian comparable with a metre, m: about half the arm.
const LENGTH: f64 = 0.3;
/// Damping of Cartesian speeds: below this singular value a direction is given up.
const DAMPING: f64 = 0.005;
/// Singular value below which a twist towards a singularity is slowed, m/rad.
const NEARLY_SINGULAR: f64 = 0.033;
/// Rate at which a twist's motion returns to its target, 1/s.
const RETURN_RATE: f64 = 20.0;
/// Distance, m, and angle, rad, by which a twist's target may lead the arm.
const LEAD: (f64, f64) = (0.02, 0.1);
/// Share of the tool speed that is planned; the rest covers the change of the
/// Jacobian while the joints brake.
const TOOL_SHARE: f64 = 0.93;

/// What the arm does.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Motion {
    /// Comes to rest and holds.
    Hold,
    /// Joints interpolate to a goal.
    Joints {
        /// joint_1 to joint_6, rad.
        goal: [f64; 6],
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
        /// Asked: m/s and rad/s, along the base's or the tool's axes.
        wanted: (Vector3<f64>, Vector3<f64>),
        /// Ramped up so far, the same units and axes.
        now: (Vector3<f64>, Vector3<f64>),
    },
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
        let base_link = model
            .link(&model.settings.arm_base_link)
            .unwrap_or_default();
        let poses = model.link_poses(&vec![0.0; model.joints.len()]);
        ArmControl {
            kinematics: ArmKinematics::new(model),
            settings: model.settings.arm,
            tool_length: model.settings.tool_length,
            base_link,
            chair_from_base: poses[base_link],
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
                state.motion = Motion::Joints { goal };
                state.desired = self.kinematics.forward(&goal);
                state.problem = (0..6).find(|&i| goal[i] != asked[i]).map(|i| {
                    format!(
                        "{} is asked to {:.4} rad, its limit is {:.4} rad",
                        ARM_JOINTS[i], asked[i], goal[i]
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
                let wanted = (
                    cut(axes * linear, self.settings.tool_speed),
                    cut(axes * angular, self.settings.tool_turn_rate),
                );
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

    /// Chooses the motion to a pose. An unreachable one brings the arm to rest.
    fn reach(&self, state: &mut ArmState, goal: &Isometry3<f64>) {
        let present = self.kinematics.forward(&state.position);
        let (distance, angle) = apart(&present, goal);
        let near = distance <= NEAR.0 && angle <= NEAR.1;
        let near_joints = near
            .then(|| {
                self.kinematics
                    .solve_local(goal, &state.position, NEAR_CHANGE)
                    .ok()
            })
            .flatten();
        let motion = if let Some(solution) = near_joints {
            Ok(Motion::Joints {
                goal: solution.joints,
            })
        } else if let Some(joints) = self.end_of_line(&state.position, &present, goal) {
            Ok(Motion::Line {
                goal: *goal,
                joints,
                still: 0,
            })
        } else {
            self.kinematics
                .solve_nearest(goal, &state.position)
                .map(|solution| Motion::Joints {
                    goal: solution.joints,
                })
        };
        match motion {
            Ok(motion) => {
                state.motion = motion;
                state.desired = *goal;
            }
            Err(unreachable) => {
                state.motion = Motion::Hold;
                state.problem = Some(unreachable.to_string());
            }
        }
    }

    /// Joint positions at the end of the straight line to `goal`, when the arm
    /// can follow it all the way.
    fn end_of_line(
        &self,
        from: &[f64; 6],
        present: &Isometry3<f64>,
        goal: &Isometry3<f64>,
    ) -> Option<[f64; 6]> {
        let (distance, angle) = apart(present, goal);
        let samples = (distance / SAMPLE.0).max(angle / SAMPLE.1).ceil().max(1.0);
        if samples > 500.0 {
            return None;
        }
        let way = goal.translation.vector - present.translation.vector;
        let turn = rotation_vector(&present.rotation.rotation_to(&goal.rotation));
        let mut joints = *from;
        for i in 1..=samples as usize {
            let part = i as f64 / samples;
            let pose = Isometry3::from_parts(
                Translation3::from(present.translation.vector + way * part),
                UnitQuaternion::from_scaled_axis(turn * part) * present.rotation,
            );
            joints = self
                .kinematics
                .solve_local(&pose, &joints, SAMPLE_CHANGE)
                .ok()?
                .joints;
        }
        Some(joints)
    }

    /// Starts or changes a twist without a jump in speed.
    fn twist(&self, state: &mut ArmState, in_tool: bool, wanted: (Vector3<f64>, Vector3<f64>)) {
        let now = match state.motion {
            Motion::Twist {
                in_tool: before,
                now,
                ..
            } if before == in_tool => now,
            _ => {
                let (pose, jacobian) = self.kinematics.forward_and_jacobian(&state.position);
                let speed = jacobian * Vector6::from(state.velocity);
                let tool = (
                    speed.fixed_rows::<3>(3).into_owned(),
                    speed.fixed_rows::<3>(0).into_owned(),
                );
                state.desired = pose;
                if in_tool {
                    tool
                } else {
                    (pose.rotation * tool.0, pose.rotation * tool.1)
                }
            }
        };
        state.motion = Motion::Twist {
            in_tool,
            wanted,
            now,
        };
    }

    /// One step of `dt` seconds.
    pub(super) fn advance(&self, state: &mut ArmState, dt: f64) {
        let (pose, jacobian) = self.kinematics.forward_and_jacobian(&state.position);
        let wanted = match state.motion {
            Motion::Hold => {
                state.desired = pose;
                [0.0; 6]
            }
            Motion::Joints { goal } => self.towards_joints(&state.position, &goal, dt),
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
        self.follow(state, wanted, &jacobian, dt);
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

    /// Joint speeds that move the end effector straight to a goal.
    fn along_line(
        &self,
        state: &mut ArmState,
        pose: &Isometry3<f64>,
        jacobian: &Matrix6<f64>,
        (goal, joints, still): (Isometry3<f64>, [f64; 6], u32),
        dt: f64,
    ) -> [f64; 6] {
        let way = goal.translation.vector - pose.translation.vector;
        let turn = rotation_vector(&pose.rotation.rotation_to(&goal.rotation));
        let (distance, angle) = (way.norm(), turn.norm());
        let fastest = state
            .velocity
            .iter()
            .fold(0.0_f64, |most, speed| most.max(speed.abs()));
        let still = if fastest < 1e-3 { still + 1 } else { 0 };
        if (distance < LANDING.0 && angle < LANDING.1) || still > STALL_STEPS {
            state.motion = Motion::Joints { goal: joints };
            return self.towards_joints(&state.position, &joints, dt);
        }
        state.motion = Motion::Line {
            goal,
            joints,
            still,
        };
        let settings = &self.settings;
        let linear = stopping_speed(distance, settings.tool_acceleration, dt)
            .min(settings.tool_speed)
            / distance.max(1e-9);
        let angular = stopping_speed(angle, settings.tool_turn_acceleration, dt)
            .min(settings.tool_turn_rate)
            / angle.max(1e-9);
        let rate = linear.min(angular);
        joint_speeds(
            &weighted(jacobian),
            &weighted_twist(pose, &(way * rate), &(turn * rate)),
        )
    }

    /// Joint speeds that follow a twist; its target moves on.
    fn by_twist(
        &self,
        state: &mut ArmState,
        pose: &Isometry3<f64>,
        jacobian: &Matrix6<f64>,
        (in_tool, wanted, now): (
            bool,
            (Vector3<f64>, Vector3<f64>),
            (Vector3<f64>, Vector3<f64>),
        ),
        dt: f64,
    ) -> [f64; 6] {
        let settings = &self.settings;
        let (linear, angular) = now;
        // What an arm that cannot follow has been asked is forgotten at once.
        let forget = |now: Vector3<f64>, wanted: Vector3<f64>| {
            now.zip_map(
                &wanted,
                |now, wanted| if now * wanted < 0.0 { 0.0 } else { now },
            )
        };
        let now = if state.problem.is_some() {
            (forget(linear, wanted.0), forget(angular, wanted.1))
        } else {
            now
        };
        let now = (
            now.0 + cut(wanted.0 - now.0, settings.tool_acceleration * dt),
            now.1 + cut(wanted.1 - now.1, settings.tool_turn_acceleration * dt),
        );
        state.motion = Motion::Twist {
            in_tool,
            wanted,
            now,
        };
        let (linear, angular) = if in_tool {
            let axes = state.desired.rotation;
            (axes * now.0, axes * now.1)
        } else {
            now
        };
        let target = Isometry3::from_parts(
            Translation3::from(state.desired.translation.vector + linear * dt),
            UnitQuaternion::from_scaled_axis(angular * dt) * state.desired.rotation,
        );
        let lag = target.translation.vector - pose.translation.vector;
        let turn = rotation_vector(&pose.rotation.rotation_to(&target.rotation));
        // The target waits for an arm that cannot follow.
        let (held_lag, held_turn) = (cut(lag, LEAD.0), cut(turn, LEAD.1));
        let held = held_lag != lag || held_turn != turn;
        state.desired = Isometry3::from_parts(
            Translation3::from(pose.translation.vector + held_lag),
            UnitQuaternion::new_normalize(
                (UnitQuaternion::from_scaled_axis(held_turn) * pose.rotation).into_inner(),
            ),
        );
        if !held {
            state.problem = None;
        } else if state.problem.is_none() {
            state.problem = Some(self.hindrance(&state.position));
        }
        let twist = weighted_twist(
            pose,
            &(linear + held_lag * RETURN_RATE),
            &(angular + held_turn * RETURN_RATE),
        );
        self.away_from_singularity(&state.position, &weighted(jacobian), twist)
    }

    /// Joint speeds for a twist that brake towards a singularity, so that the
    /// elbow or the wrist comes to rest before it would turn over. Only the
    /// part of the twist that the singularity concerns is slowed, and nothing
    /// on the way out.
    fn away_from_singularity(
        &self,
        position: &[f64; 6],
        weighted_jacobian: &Matrix6<f64>,
        twist: Vector6<f64>,
    ) -> [f64; 6] {
        let speeds = joint_speeds(weighted_jacobian, &twist);
        let (value, direction) = slowest(weighted_jacobian);
        let fastest = speeds
            .iter()
            .fold(0.0_f64, |most, speed| most.max(speed.abs()));
        if value >= NEARLY_SINGULAR || fastest == 0.0 {
            return speeds;
        }
        let ahead: [f64; 6] = std::array::from_fn(|i| position[i] + speeds[i] * 0.01 / fastest);
        let ahead = weighted(&self.kinematics.jacobian_body(&ahead));
        if slowest(&ahead).0 >= value {
            return speeds;
        }
        // From the limits, joint speeds fall like those of a braking joint.
        let excess = (0..6)
            .map(|i| speeds[i].abs() / self.kinematics.speed()[i])
            .fold(1.0, f64::max);
        let twist = twist / excess;
        let left = value / NEARLY_SINGULAR;
        let part = left.sqrt().min(3.0 * left);
        // The rest is slowed by its share, so that the arm does not slide off.
        let along = direction.dot(&twist);
        let rest = 1.0 - (along.abs() / twist.norm()) * (1.0 - part);
        let slowed = twist * rest - direction * (along * (rest - part));
        joint_speeds(weighted_jacobian, &slowed)
    }

    /// Why a twist is not followed.
    fn hindrance(&self, position: &[f64; 6]) -> String {
        let (lower, upper) = (self.kinematics.lower(), self.kinematics.upper());
        let at_limit =
            (0..6).find(|&i| position[i] - lower[i] < 0.01 || upper[i] - position[i] < 0.01);
        match at_limit {
            Some(i) => format!(
                "the twist is not followed: {} is at its limit, {:.4} rad",
                ARM_JOINTS[i], position[i]
            ),
            None => "the twist is not followed: the arm is stretched or its wrist is straight"
                .to_owned(),
        }
    }

    /// Moves the joint speeds towards the wanted ones within all limits, and
    /// the joints by them.
    fn follow(&self, state: &mut ArmState, mut wanted: [f64; 6], jacobian: &Matrix6<f64>, dt: f64) {
        let speed = self.kinematics.speed();
        let tool_speed = self.tool_speed(jacobian, &wanted);
        let excess = (0..6).map(|i| wanted[i].abs() / speed[i]).fold(
            tool_speed / (TOOL_SHARE * self.settings.tool_speed),
            f64::max,
        );
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
        let (lower, upper) = (self.kinematics.lower(), self.kinematics.upper());
        for i in 0..6 {
            // Once below the stopping speed, a joint can always stay below it.
            let room = |distance: f64| stopping_speed(distance, self.settings.acceleration, dt);
            let velocity = (state.velocity[i] + part * change[i]).clamp(
                -room(state.position[i] - lower[i]),
                room(upper[i] - state.position[i]),
            );
            state.velocity[i] = velocity;
            state.position[i] += velocity * dt;
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

/// Distance, m, and angle, rad, between two poses.
fn apart(one: &Isometry3<f64>, other: &Isometry3<f64>) -> (f64, f64) {
    (
        (other.translation.vector - one.translation.vector).norm(),
        rotation_vector(&one.rotation.rotation_to(&other.rotation)).norm(),
    )
}

/// The vector, shortened to `longest`.
fn cut(vector: Vector3<f64>, longest: f64) -> Vector3<f64> {
    let length = vector.norm();
    if length > longest {
        vector * (longest / length)
    } else {
        vector
    }
}

/// Body Jacobian with its angular rows in metres, so that all rows compare.
fn weighted(jacobian: &Matrix6<f64>) -> Matrix6<f64> {
    let mut weighted = *jacobian;
    for column in 0..6 {
        for row in 0..3 {
            weighted[(row, column)] *= LENGTH;
        }
    }
    weighted
}

/// A velocity along the base's axes as a twist in the end effector's frame,
/// weighted like the Jacobian.
fn weighted_twist(
    pose: &Isometry3<f64>,
    linear: &Vector3<f64>,
    angular: &Vector3<f64>,
) -> Vector6<f64> {
    let linear = pose.rotation.inverse_transform_vector(linear);
    let angular = pose.rotation.inverse_transform_vector(angular) * LENGTH;
    Vector6::new(
        angular.x, angular.y, angular.z, linear.x, linear.y, linear.z,
    )
}

/// Joint speeds for a weighted twist, by damped least squares.
fn joint_speeds(weighted: &Matrix6<f64>, twist: &Vector6<f64>) -> [f64; 6] {
    let normal = weighted.tr_mul(weighted) + Matrix6::identity() * (DAMPING * DAMPING);
    // Positive definite by the damping.
    match normal.cholesky() {
        Some(factors) => factors.solve(&weighted.tr_mul(twist)).into(),
        None => [0.0; 6],
    }
}

/// Least singular value of a weighted Jacobian, m/rad, and the direction of
/// twist that it makes slow.
fn slowest(weighted: &Matrix6<f64>) -> (f64, Vector6<f64>) {
    let eigen = (weighted * weighted.transpose()).symmetric_eigen();
    let (index, value) = eigen.eigenvalues.argmin();
    (
        value.max(0.0).sqrt(),
        eigen.eigenvectors.column(index).into_owned(),
    )
}
