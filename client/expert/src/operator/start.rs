//! Chooses where to begin: at the start of the plan, or at the present pose of the
//! hand.

use nalgebra::Point3;

use super::Operator;
use super::plan::{Stage, plan};
use crate::observation::Observation;
use crate::skill::look_around::LookAround;
use crate::skill::reach::Reach;
use crate::skill::stow::Stow;

/// A pad presses on something from this force, N.
const PRESSES: f64 = 2.0;
/// A held object is at most this far from the point where the pads meet, metres.
const HELD: f64 = 0.02;
/// A faster chair counts as driving, m/s and rad/s.
const SLOW: [f64; 2] = [0.05, 0.1];
/// Objects further beyond the arm's range are not tried on the spot, metres.
const NEARLY: f64 = 0.2;

impl Operator {
    /// Chooses what to begin with: the plan from its start, with the arm home, or what
    /// can be gone on with on the spot.
    pub(super) fn set_off(&mut self, observation: &Observation) {
        let is_home = Stow::is_home(&observation.arm, &self.scene.home);
        let [speed, rate] = observation.chair_speed;
        // A moving chair with the arm stowed continues to drive.
        let drives = is_home && (speed.abs() > SLOW[0] || rate.abs() > SLOW[1]);
        // An object already between both pads is kept.
        let presses = observation.pad_force.iter().all(|force| *force > PRESSES);
        let stage = match presses && self.is_between_pads(observation) {
            true => Stage::Grasp,
            false => Stage::Reach,
        };
        let plan = plan(&self.goal, self.extent);
        let at = plan.iter().position(|other| *other == stage);
        self.on_the_spot &= !drives && at.is_some() && self.is_near(observation);
        if self.on_the_spot {
            self.at = at.unwrap_or_default();
            self.skill = match stage {
                Stage::Reach => Box::new(Reach::on_the_spot()),
                _ => stage.begin(),
            };
            if is_home {
                self.memory.home = Some(observation.base_from_tool);
            }
        } else if self.is_confined(observation) {
            // It stays stowed until the stop.
            self.begun_stowed = true;
        } else if self.looks_around {
            self.detour = Some(Box::new(LookAround::default()));
        } else if !is_home {
            self.detour = Some(Box::new(Stow::default()));
        }
    }

    /// Whether the arm is in its travel posture and has no room to leave it.
    fn is_confined(&self, observation: &Observation) -> bool {
        let travel = self.scene.travel.as_ref();
        let is_stowed =
            travel.is_some_and(|travel| Stow::is_home(&observation.arm, &travel.joints));
        is_stowed && {
            let check = self.scene.change_check(&self.scene.poses(observation));
            check.is_some_and(|check| !check.is_free(&observation.chair(), 0.0))
        }
    }

    /// Whether the goal's object, and not another, is where the pads meet.
    fn is_between_pads(&self, observation: &Observation) -> bool {
        let pads = Point3::new(0.0, 0.0, self.scene.tool_length);
        let point = self.object_in_hand(observation).inverse() * pads;
        let boxes = self.scene.items[self.goal.item()].boxes.iter();
        boxes.map(|obb| obb.distance(&point)).any(|off| off < HELD)
    }

    /// Whether the arm may reach the object from the present pose of the chair.
    fn is_near(&self, observation: &Observation) -> bool {
        let poses = self.scene.poses(observation);
        let base = self.scene.house_from_base(observation).translation.vector;
        let object = poses.get(self.goal.item());
        object.is_some_and(|object| {
            let away = (object.translation.vector - base).xy().norm();
            away < self.scene.arm_range[1] + NEARLY
        })
    }
}
