//! Watch: waits until the task's conditions hold, and a moment longer.

use wheelarm_proto::v1::Phase;

use super::{Act, Now, Skill, Step};

/// Longest time to wait for the task's conditions, seconds.
const WAIT: f64 = 6.0;
/// Success is watched for this long before the work is over, seconds.
const WATCH: f64 = 1.0;

/// See the module.
#[derive(Clone, Debug, Default)]
pub struct Watch {
    begun: Option<f64>,
    success_since: Option<f64>,
}

impl Skill for Watch {
    fn step(&mut self, now: &mut Now<'_>) -> Step {
        let observation = now.observation;
        if let Some(why) = now.slipped() {
            return Step::Missed(why);
        }
        let begun = *self.begun.get_or_insert(observation.time);
        self.success_since = observation
            .success
            .then(|| self.success_since.unwrap_or(observation.time));
        if self
            .success_since
            .is_some_and(|first| observation.time - first >= WATCH)
        {
            return Step::Done;
        }
        if observation.time - begun > WAIT && self.success_since.is_none() {
            return Step::Missed("the task's conditions do not hold".to_owned());
        }
        let act = Act::named(Phase::Retracting, "holding");
        Step::Going(Act {
            base: Some([0.0, 0.0]),
            ..act
        })
    }
}
