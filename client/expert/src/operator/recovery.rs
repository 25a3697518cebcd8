//! Chooses what follows a failed skill: another attempt, another base placement, or the
//! end.

use wheelarm_proto::v1;

use super::plan::{Stage, plan};
use super::{Operator, Outcome};
use crate::skill::navigate::Purpose;
use crate::skill::release::Release;
use crate::skill::stow::Stow;

/// Attempts at the object before the operator gives up.
const ATTEMPTS: usize = 3;
/// The same where the scenario hinders the robot.
const HINDERED_ATTEMPTS: usize = 8;
/// Stops from which the arm did not reach before it gives up.
const STOPS: usize = 4;

impl Operator {
    /// Begins again from the start of the plan, with the arm home.
    fn begin_again(&mut self, why: &str) {
        self.memory.notes.push(format!("{why}, begins again"));
        self.memory.held = None;
        self.on_the_spot = false;
        self.opened = false;
        self.at = 0;
        self.skill = plan(&self.goal, self.extent)[0].begin();
        self.detour = Some(Box::new(Stow::default()));
    }

    /// Ends this attempt: releases, backs off and looks again; or returns the outcome.
    pub(super) fn missed(&mut self, why: &str) -> Option<Outcome> {
        if self.on_the_spot {
            self.begin_again(why);
            return None;
        }
        if let Some(goal) = self.requested.take() {
            self.correct(goal);
            return None;
        }
        self.memory.held = None;
        // Another attempt is made without habits.
        self.profile.habits = None;
        match std::mem::take(&mut self.forcing) {
            // Meant so: it does not count.
            true => self.memory.notes.push(why.to_owned()),
            false => {
                self.attempts += 1;
                self.erred = true;
                let moved = why.starts_with("it was moved");
                self.incident = match moved {
                    true => v1::Incident::Moved,
                    false => v1::Incident::Missed,
                };
                let note = format!("attempt {}: {why}", self.attempts);
                self.memory.notes.push(note);
            }
        }
        let most = match self.trouble.hindered {
            true => HINDERED_ATTEMPTS,
            false => ATTEMPTS,
        };
        let reach = plan(&self.goal, self.extent)
            .iter()
            .position(|stage| matches!(stage, Stage::Reach | Stage::Before));
        let Some(reach) = reach else {
            return Some(Outcome::Failure(why.to_owned()));
        };
        if self.attempts >= most {
            return Some(Outcome::Failure(format!("{why}, after {most} attempts")));
        }
        self.at = reach;
        self.skill = plan(&self.goal, self.extent)[reach].begin();
        self.detour = Some(Box::new(Release::after_miss()));
        None
    }

    /// Drives to another place for the present skill; or the end.
    pub(super) fn elsewhere(&mut self, why: String) -> Option<Outcome> {
        if self.on_the_spot {
            self.begin_again(&why);
            return None;
        }
        if let Some(goal) = self.requested.take() {
            self.correct(goal);
            return None;
        }
        self.profile.habits = None;
        self.stops += 1;
        if self.stops >= STOPS {
            return Some(Outcome::Failure(format!(
                "{why}, from none of {STOPS} stops"
            )));
        }
        self.memory
            .notes
            .push(format!("{why}, looks for another place"));
        let stage = plan(&self.goal, self.extent)[self.at];
        let purpose = if stage == Stage::Place {
            Purpose::Put
        } else {
            Purpose::Take
        };
        self.skill = stage.begin();
        self.detour = Some(Stage::Navigate(purpose).begin());
        None
    }
}
