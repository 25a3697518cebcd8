//! Forced errors, each made once and reported: for example the wrong object is grasped
//! first, and then the right one. [`crate::forced`] lists them.

use nalgebra::Isometry3;

use super::Operator;
use super::plan::plan;
use crate::forced::ForcedError;
use crate::goal::Goal;
use crate::skill::release::Release;

/// The wrong object is the nearest to the goal's that can be grasped, at most this far
/// from it, metres.
const NEAR: f64 = 0.6;

impl Operator {
    /// Begins with the wrong object, when there is one nearby.
    pub(super) fn take_the_wrong_object(&mut self, poses: &[Isometry3<f64>]) {
        let item = self.goal.item();
        let off = |other: usize| {
            (poses[other].translation.vector - poses[item].translation.vector).norm()
        };
        let others = self.scene.grasps.iter().map(|grasp| grasp.item);
        let others = others.filter(|&other| other != item && off(other) < NEAR);
        let slides = matches!(self.goal, Goal::Open { .. } | Goal::Close { .. });
        let nearest = others.min_by(|&a, &b| off(a).total_cmp(&off(b)));
        let Some(other) = nearest.filter(|_| !slides) else {
            self.memory
                .notes
                .push("no other object nearby to take by mistake".to_owned());
            return;
        };
        self.force(ForcedError::WrongObject);
        let wrong = Goal::Lift { item: other };
        self.requested = Some(std::mem::replace(&mut self.goal, wrong));
    }

    /// Goes on with the requested goal.
    pub(super) fn correct(&mut self, goal: Goal) {
        self.memory
            .notes
            .push("that was the wrong object; takes the right one".to_owned());
        self.goal = goal;
        self.forcing = false;
        self.about_to = None;
        self.memory.candidate = None;
        self.memory.refused.clear();
        self.memory.left.clear();
        self.at = 0;
        self.skill = plan(&self.goal, self.extent)[0].begin();
        self.detour = Some(Box::new(Release::after_miss()));
    }

    /// Notes an error that is made on purpose.
    pub(super) fn force(&mut self, error: ForcedError) {
        self.trouble.forced = None;
        self.forcing = true;
        self.erred = true;
        match error {
            // Reported when the hand sets off: until then the way is the same.
            ForcedError::WrongObject => self.about_to = Some(error.incident()),
            ForcedError::WrongGrasp | ForcedError::Drop => self.incident = error.incident(),
        }
        let note = match error {
            ForcedError::WrongGrasp => "forced: closes beside it",
            ForcedError::WrongObject => "forced: takes another object first",
            ForcedError::Drop => "forced: drops it",
        };
        self.memory.notes.push(note.to_owned());
    }
}
