//! Where to begin: with the plan from its start, or where somebody else left the hand.

use nalgebra::Point3;

use super::Operator;
use super::plan::{Stage, plan};
use crate::observation::Observation;
use crate::skill::look_around::LookAround;
use crate::skill::reach::Reach;
use crate::skill::stow::Stow;

/// A pad presses on something from this force, N.
const PRESSES: f64 = 2.0;
/// What the pads hold lies no further than this from where they meet, metres.
const HELD: f64 = 0.02;
/// A chair that goes faster is under way, m/s and rad/s.
const SLOW: [f64; 2] = [0.05, 0.1];
/// What lies further beyond the arm's range is not tried on the spot, metres.
const NEARLY: f64 = 0.2;

impl Operator {
    /// Chooses what to begin with: the plan from its start, with the arm home, or what
    /// can be gone on with on the spot.
    pub(super) fn set_off(&mut self, seen: &Observation) {
        let is_home = Stow::is_home(&seen.arm, &self.scene.home);
        let [speed, rate] = seen.chair_speed;
        // A chair under way with the arm home goes on driving.
        let drives = is_home && (speed.abs() > SLOW[0] || rate.abs() > SLOW[1]);
        // The thing between both pads already is held on to.
        let presses = seen.pad_force.iter().all(|force| *force > PRESSES);
        let stage = match presses && self.is_between_pads(seen) {
            true => Stage::Grasp,
            false => Stage::Reach,
        };
        let plan = plan(&self.goal, self.extent);
        let at = plan.iter().position(|other| *other == stage);
        self.on_the_spot &= !drives && at.is_some() && self.is_near(seen);
        if self.on_the_spot {
            self.at = at.unwrap_or_default();
            self.skill = match stage {
                Stage::Reach => Box::new(Reach::on_the_spot()),
                _ => stage.begin(),
            };
            if is_home {
                self.memory.home = Some(seen.base_from_tool);
            }
        } else if self.looks_around {
            self.detour = Some(Box::new(LookAround::default()));
        } else if !is_home {
            self.detour = Some(Box::new(Stow::default()));
        }
    }

    /// The goal's thing is where the pads meet, and not another.
    fn is_between_pads(&self, seen: &Observation) -> bool {
        let pads = Point3::new(0.0, 0.0, self.scene.tool_length);
        let point = self.thing_in_hand(seen).inverse() * pads;
        let boxes = self.scene.items[self.goal.item()].boxes.iter();
        boxes.map(|obb| obb.distance(&point)).any(|off| off < HELD)
    }

    /// The thing may be in the arm's reach from where the chair stands.
    fn is_near(&self, seen: &Observation) -> bool {
        let poses = self.scene.poses(seen);
        let base = self.scene.house_from_base(seen).translation.vector;
        let thing = poses.get(self.goal.item());
        thing.is_some_and(|thing| {
            let away = (thing.translation.vector - base).xy().norm();
            away < self.scene.arm_range[1] + NEARLY
        })
    }
}
