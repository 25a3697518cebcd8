//! The gripper: the exact map between knuckle angle and opening, and the knuckle's
//! speed profile.

use serde::{Deserialize, Serialize};
use wheelarm_proto::exact;

use super::profile::{SPEED_SHARE, stopping_speed, towards};
use super::{FingerBound, GripperIntent};
use crate::geometry::Shape;
use crate::robot::{GripperSettings, PAD, RobotModel};

/// Geometry of the parallelogram fingers, from the URDF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GripperMap {
    /// Distance of the knuckle pin from the middle of the gripper, m.
    pin: f64,
    /// Knuckle pin to tip pin at angle 0: outwards and along the tool, m.
    crank: [f64; 2],
    /// Tip pin inwards to the pad's face, m.
    pad: f64,
    /// Largest commanded opening, m.
    stroke: f64,
    /// Largest commanded knuckle angle, rad.
    max_knuckle: f64,
    /// Largest commanded force cap, N.
    max_force: f64,
}

impl GripperMap {
    /// From the left finger's joints and pad, which `RobotModel::load` has checked.
    #[must_use]
    pub fn new(model: &RobotModel) -> GripperMap {
        let hand = model.roles.end_effector;
        let (knuckle, tip) = (model.roles.knuckles[0], model.roles.finger_tips[0]);
        let poses = model.link_poses(&vec![0.0; model.joints.len()]);
        let in_hand = |joint: usize| {
            poses[hand]
                .inv_mul(&poses[model.joints[joint].child])
                .translation
                .vector
        };
        let (knuckle_in_hand, tip_in_hand) = (in_hand(knuckle), in_hand(tip));
        let pad = model.links[model.joints[tip].child]
            .collision
            .iter()
            .find(|collider| collider.name == PAD)
            .map_or(0.0, |collider| match collider.part.shape {
                Shape::Cuboid { half } => half[0] - collider.part.pose.translation.x,
                _ => -collider.part.pose.translation.x,
            });
        GripperMap {
            pin: knuckle_in_hand.x,
            crank: [
                tip_in_hand.x - knuckle_in_hand.x,
                tip_in_hand.z - knuckle_in_hand.z,
            ],
            pad,
            stroke: model.settings.gripper.stroke,
            max_knuckle: model.joints[knuckle].limits.upper,
            max_force: model.settings.gripper.max_force,
        }
    }

    /// Distance of the knuckle pin from the middle of the gripper, m.
    #[must_use]
    pub fn pin(&self) -> f64 {
        self.pin
    }

    /// Knuckle pin to tip pin at angle 0: outwards and along the tool, m.
    #[must_use]
    pub fn crank(&self) -> [f64; 2] {
        self.crank
    }

    /// Tip pin inwards to the pad's face, m.
    #[must_use]
    pub fn pad(&self) -> f64 {
        self.pad
    }

    /// Largest commanded opening, m.
    #[must_use]
    pub fn stroke(&self) -> f64 {
        self.stroke
    }

    /// Largest commanded knuckle angle, rad.
    #[must_use]
    pub fn max_knuckle(&self) -> f64 {
        self.max_knuckle
    }

    /// Largest commanded force cap, N.
    #[must_use]
    pub fn max_force(&self) -> f64 {
        self.max_force
    }

    /// Distance between the pads, m, at a knuckle angle, rad.
    #[must_use]
    pub fn opening(&self, knuckle: f64) -> f64 {
        let (sin, cos) = exact::sin_cos(knuckle);
        2.0 * (self.pin + self.crank[0] * cos - self.crank[1] * sin - self.pad)
    }

    /// Knuckle angle, rad, at which the pads are `opening` m apart; clamped to the
    /// linkage's range.
    #[must_use]
    pub fn knuckle(&self, opening: f64) -> f64 {
        let [out, along] = self.crank;
        let cosine = (opening / 2.0 - self.pin + self.pad) / exact::hypot(out, along);
        exact::acos(cosine.clamp(-1.0, 1.0)) - exact::atan2(along, out)
    }

    /// Travel of each pad per knuckle angle, m/rad; a force of F at each pad needs F
    /// times this torque at each knuckle, N·m.
    #[must_use]
    pub fn lever(&self, knuckle: f64) -> f64 {
        let (sin, cos) = exact::sin_cos(knuckle);
        self.crank[0] * sin + self.crank[1] * cos
    }
}

/// Commanded and present state of the knuckle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GripperState {
    /// Commanded knuckle angle, rad.
    pub goal: f64,
    /// Present set point of the knuckle angle, rad.
    pub position: f64,
    /// Its speed, rad/s.
    pub velocity: f64,
    /// Cap of the force at each pad, N.
    pub force: f64,
}

impl GripperState {
    /// At rest at a knuckle angle, rad; 0 is open.
    pub(super) fn new(settings: &GripperSettings, knuckle: f64) -> GripperState {
        GripperState {
            goal: knuckle,
            position: knuckle,
            velocity: 0.0,
            force: settings.force,
        }
    }

    /// Accepts a new intent, limited to the range.
    pub(super) fn take(&mut self, intent: &GripperIntent, settings: &GripperSettings) {
        self.goal = exact::within(intent.knuckle, 0.0, settings.closed);
        self.force = intent.max_force.map_or(settings.force, |cap| {
            exact::within(cap, 0.0, settings.max_force)
        });
    }

    /// One step towards the goal, within the limit near a person.
    pub(super) fn advance(
        &mut self,
        settings: &GripperSettings,
        bound: Option<FingerBound>,
        dt: f64,
    ) {
        let way = self.goal - self.position;
        let most = SPEED_SHARE * settings.speed;
        let most = bound.map_or(most, |bound| {
            let beside = if way > 0.0 {
                bound.closing
            } else {
                bound.opening
            };
            beside.min(most)
        });
        let speed = stopping_speed(way.abs(), settings.acceleration, dt).min(most);
        let room = |distance: f64| stopping_speed(distance, settings.acceleration, dt);
        // A reversed command must not carry the knuckle beyond its range.
        let velocity = towards(
            self.velocity,
            speed.copysign(way),
            settings.acceleration * dt,
        );
        let velocity = bound.map_or(velocity, |bound| {
            exact::within(velocity, -bound.opening, bound.closing)
        });
        self.velocity = exact::within(
            velocity,
            -room(self.position),
            room(settings.closed - self.position),
        );
        self.position = exact::within(self.position + self.velocity * dt, 0.0, settings.closed);
    }
}
