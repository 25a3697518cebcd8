//! Keyboard control of arm and gripper: each key moves a target by one step. Pure.
//!
//! The keys are those of WheelArm-Sim: n/v, f/h, g/b step along x, y, z of
//! `base_link`, or turn about the tool's own axes. They are labelled as the
//! person on the chair sees them.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use wheelarm_proto::v1;

use crate::watch::chair_directions;

/// Steps at the start, m and rad: those of WheelArm-Sim.
pub const START: [f64; 2] = [0.025, 0.05];
/// Least and greatest translation step, m.
const TRANSLATION: [f64; 2] = [0.002, 0.10];
/// Least and greatest rotation step, rad.
const ROTATION: [f64; 2] = [0.01, 0.40];
/// Factor between two step sizes.
const FINER: f64 = 0.8;
/// Step of the knuckle, rad, as in WheelArm-Sim.
const KNUCKLE: f64 = 0.05;
/// The target may lead the hand by this much, m and rad, or by three steps:
/// a key that repeats faster than the arm moves must not pile up a long way.
const LEAD: [f64; 2] = [0.12, 0.40];
/// After this long without a key the target starts from the last commanded pose, s.
const FORGET: f64 = 1.5;

/// The arm's keys: axis of x, y, z and direction.
pub const KEYS: [(char, usize, f64); 6] = [
    ('n', 0, 1.0),
    ('v', 0, -1.0),
    ('f', 1, 1.0),
    ('h', 1, -1.0),
    ('g', 2, 1.0),
    ('b', 2, -1.0),
];

/// Targets of the arm and the gripper.
#[derive(Clone, Debug, PartialEq)]
pub struct Arm {
    /// Translation step, m, and rotation step, rad.
    pub steps: [f64; 2],
    /// The keys turn instead of moving.
    pub turning: bool,
    /// Targets outside of the reach shell are refused.
    pub shell: bool,
    target: Option<(Isometry3<f64>, f64)>,
    knuckle: Option<(f64, f64)>,
    limits: Option<Limits>,
}

/// Limits of arm and gripper, from the robot description.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Limits {
    /// Greatest knuckle angle, rad.
    knuckle: f64,
    /// Middle of the reach shell in `base_link`, m.
    middle: Vector3<f64>,
    /// Its radii, m.
    radii: [f64; 2],
}

/// Reason for rejecting a step.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Refused {
    /// The arm's pose is unknown.
    #[error("the arm's pose has not come yet")]
    Unknown,
    /// The robot's reach is unknown.
    #[error("the robot's description has not come yet (a switches the reach shell off)")]
    NoRobot,
    /// The arm is slower than the key.
    #[error("the hand is still on its way: {0:.0} mm to go")]
    Ahead(f64),
    /// The same for turning.
    #[error("the hand is still turning: {0:.2} rad to go")]
    Turning(f64),
    /// Outside of the reach shell.
    #[error(
        "outside of the reach shell: {distance:.3} m from the shoulder, allowed {least} to {most} m (a switches it off)"
    )]
    Shell {
        /// Distance from the middle of the shell, m.
        distance: f64,
        /// Inner radius, m.
        least: f64,
        /// Outer radius, m.
        most: f64,
    },
}

impl Arm {
    /// With the steps of WheelArm-Sim.
    #[must_use]
    pub fn new(shell: bool) -> Self {
        Self {
            steps: START,
            turning: false,
            shell,
            target: None,
            knuckle: None,
            limits: None,
        }
    }

    /// Takes the limits of a robot.
    pub fn fit(&mut self, robot: &v1::RobotDescription) {
        let shell = robot.reach.unwrap_or_default();
        let v1::Vector3 { x, y, z } = shell.centre.unwrap_or_default();
        self.limits = Some(Limits {
            knuckle: robot.gripper_or_default().max_knuckle,
            middle: Vector3::new(x, y, z),
            radii: [shell.inner_radius, shell.outer_radius],
        });
    }

    /// Takes the next target from the measured pose: the arm did not follow, or another
    /// client moved it.
    pub fn forget(&mut self) {
        self.target = None;
        self.knuckle = None;
    }

    /// The target of a key pressed at `now`: `desired` is what the server aims
    /// at, `present` where the hand is, both in `base_link`.
    ///
    /// # Errors
    /// [`Refused`]; the target stays as it was.
    pub fn step(
        &mut self,
        axis: usize,
        sign: f64,
        desired: Option<&Isometry3<f64>>,
        present: Option<&Isometry3<f64>>,
        now: f64,
    ) -> Result<Isometry3<f64>, Refused> {
        let from = match &self.target {
            Some((target, at)) if now - at < FORGET => *target,
            _ => *desired.or(present).ok_or(Refused::Unknown)?,
        };
        let [translation, rotation] = self.steps;
        let mut along = Vector3::zeros();
        along[axis] = sign;
        let target = if self.turning {
            from * UnitQuaternion::from_scaled_axis(along * rotation)
        } else {
            Translation3::from(along * translation) * from
        };
        if let Some(present) = present {
            let way = (target.translation.vector - present.translation.vector).norm();
            if way > LEAD[0].max(3.0 * translation) {
                return Err(Refused::Ahead(way * 1e3));
            }
            let turn = target.rotation.angle_to(&present.rotation);
            if turn > LEAD[1].max(3.0 * rotation) {
                return Err(Refused::Turning(turn));
            }
        }
        self.check(&target)?;
        self.target = Some((target, now));
        Ok(target)
    }

    fn check(&self, target: &Isometry3<f64>) -> Result<(), Refused> {
        if !self.shell {
            return Ok(());
        }
        let Limits { middle, radii, .. } = self.limits.ok_or(Refused::NoRobot)?;
        let [least, most] = radii;
        let distance = (target.translation.vector - middle).norm();
        if !(distance > least && distance < most) {
            return Err(Refused::Shell {
                distance,
                least,
                most,
            });
        }
        Ok(())
    }

    /// Knuckle angle for a key pressed at `now`; `commanded` is the knuckle angle of the
    /// last command, rad. `None` before the robot's limits are known.
    pub fn grip(&mut self, closing: bool, commanded: f64, now: f64) -> Option<f64> {
        let most = self.limits?.knuckle;
        let from = match self.knuckle {
            Some((knuckle, at)) if now - at < FORGET => knuckle,
            _ => commanded,
        };
        let step = if closing { KNUCKLE } else { -KNUCKLE };
        let knuckle = (from + step).clamp(0.0, most);
        self.knuckle = Some((knuckle, now));
        Some(knuckle)
    }

    /// Makes the steps of the current mode finer or coarser.
    pub fn resize(&mut self, coarser: bool) {
        let factor = if coarser { 1.0 / FINER } else { FINER };
        let (index, [least, most]) = if self.turning {
            (1, ROTATION)
        } else {
            (0, TRANSLATION)
        };
        self.steps[index] = (self.steps[index] * factor).clamp(least, most);
    }
}

/// Plain name of the motion that the key of `axis` and `sign` causes; `mount`
/// is the rotation of the arm's base on the chair.
#[must_use]
pub fn label(
    axis: usize,
    sign: f64,
    turning: bool,
    tool: Option<&Isometry3<f64>>,
    mount: Option<&UnitQuaternion<f64>>,
) -> &'static str {
    let mut along = Vector3::zeros();
    along[axis] = sign;
    let Some(mount) = mount else {
        return if turning { "turn" } else { "step" };
    };
    if !turning {
        return match dominant(chair_directions(along, mount)) {
            (0, true) => "forward",
            (0, false) => "back",
            (1, true) => "left",
            (1, false) => "right",
            (_, true) => "up",
            (_, false) => "down",
        };
    }
    let Some(tool) = tool else {
        return "turn";
    };
    match dominant(chair_directions(tool.rotation * along, mount)) {
        // About the axis that points forward, left or up of the chair.
        (0, true) => "roll right",
        (0, false) => "roll left",
        (1, true) => "tip down",
        (1, false) => "tip up",
        (_, true) => "turn left",
        (_, false) => "turn right",
    }
}

/// The greatest component and whether it is positive.
fn dominant(vector: [f64; 3]) -> (usize, bool) {
    let mut index = 0;
    for i in 1..3 {
        if vector[i].abs() > vector[index].abs() + 1e-9 {
            index = i;
        }
    }
    (index, vector[index] > 0.0)
}

/// Where the tool points, in words; `mount` is as for [`label`].
#[must_use]
pub fn pointing(tool: &Isometry3<f64>, mount: &UnitQuaternion<f64>) -> &'static str {
    let ahead = tool * Point3::new(0.0, 0.0, 1.0) - tool * Point3::origin();
    match dominant(chair_directions(ahead, mount)) {
        (0, true) => "forward",
        (0, false) => "back",
        (1, true) => "left",
        (1, false) => "right",
        (_, true) => "up",
        (_, false) => "down",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot() -> v1::RobotDescription {
        v1::RobotDescription {
            reach: Some(v1::ReachShell {
                centre: Some(v1::Vector3 {
                    x: 0.0,
                    y: -0.0054,
                    z: 0.2848,
                }),
                inner_radius: 0.41,
                outer_radius: 0.873,
                ..Default::default()
            }),
            gripper: Some(v1::GripperDescription {
                max_knuckle: 0.8,
                ..Default::default()
            }),
            ..Default::default()
        }
    }

    fn half_a_turn() -> UnitQuaternion<f64> {
        UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::PI)
    }

    fn at(x: f64, y: f64, z: f64) -> Isometry3<f64> {
        Isometry3::translation(x, y, z)
    }

    #[test]
    fn keys_step_from_the_last_target_and_then_from_the_arm() {
        let mut arm = Arm::new(false);
        let hand = at(-0.5, 0.0, 0.5);
        assert_eq!(arm.step(0, -1.0, None, None, 0.0), Err(Refused::Unknown));
        let first = arm.step(0, -1.0, None, Some(&hand), 0.0).unwrap();
        let second = arm.step(0, -1.0, None, Some(&hand), 0.1).unwrap();
        assert!((first.translation.x + 0.525).abs() < 1e-12);
        assert!((second.translation.x + 0.55).abs() < 1e-12);
        let desired = at(-0.4, 0.0, 0.5);
        let later = arm.step(2, 1.0, Some(&desired), Some(&hand), 9.0);
        assert_eq!(later.unwrap().translation, at(-0.4, 0.0, 0.525).translation);
    }

    #[test]
    fn a_fast_key_repeat_does_not_accumulate_a_long_way() {
        let mut arm = Arm::new(false);
        let hand = at(-0.5, 0.0, 0.5);
        let taken = (0..30)
            .filter(|i| {
                let now = f64::from(*i) * 0.03;
                arm.step(2, 1.0, None, Some(&hand), now).is_ok()
            })
            .count();
        assert_eq!(taken, 4);
    }

    #[test]
    fn the_reach_shell_of_the_original_is_kept_when_wanted() {
        let mut arm = Arm::new(true);
        let hand = at(-0.5, 0.0, 0.5);
        let unknown = arm.step(2, 1.0, None, Some(&hand), 0.0);
        assert_eq!(unknown, Err(Refused::NoRobot));
        arm.fit(&robot());
        // 0.41 < distance < 0.873 m from (0, -0.0054, 0.2848).
        let inside = at(0.0, -0.0054, 0.2848 + 0.865);
        let refused = arm.step(2, 1.0, None, Some(&inside), 0.0);
        assert!(matches!(refused, Err(Refused::Shell { .. })), "{refused:?}");
        arm.step(2, -1.0, None, Some(&inside), 0.0).unwrap();
        arm.shell = false;
        arm.forget();
        arm.step(2, 1.0, None, Some(&inside), 0.0).unwrap();
    }

    #[test]
    fn labels_are_those_of_the_person_on_the_chair() {
        let mount = half_a_turn();
        let moves = KEYS.map(|(_, axis, sign)| label(axis, sign, false, None, Some(&mount)));
        assert_eq!(moves, ["back", "forward", "right", "left", "up", "down"]);
        // The hand at home: tool z forward, which is -x of the arm's base.
        let forward = UnitQuaternion::rotation_between(&Vector3::z(), &-Vector3::x()).unwrap();
        let tool = Isometry3::from_parts(Translation3::identity(), forward);
        assert_eq!(pointing(&tool, &mount), "forward");
        assert_eq!(label(2, 1.0, true, Some(&tool), Some(&mount)), "roll right");
        let labels = KEYS.map(|(_, axis, sign)| label(axis, sign, true, Some(&tool), Some(&mount)));
        assert!(labels.contains(&"tip up") && labels.contains(&"turn left"));
    }

    #[test]
    fn the_gripper_steps_within_its_range() {
        let mut arm = Arm::new(false);
        assert_eq!(
            arm.grip(true, 0.1, 0.0),
            None,
            "nothing is known of the gripper"
        );
        arm.fit(&robot());
        let mut grip = |closing, commanded, now| arm.grip(closing, commanded, now).unwrap();
        assert!((grip(true, 0.1, 0.0) - 0.15).abs() < 1e-12);
        assert!((grip(true, 0.1, 0.1) - 0.2).abs() < 1e-12);
        assert!((0..40).map(|_| grip(true, 0.0, 0.2)).all(|q| q <= 0.8));
        assert!(grip(false, 0.0, 9.0) >= 0.0);
    }
}
