//! What follows a task in a trial of an object: shaking, and rest.

use wheelarm_proto::v1;
use wheelarm_sdk::Turn;

use super::{DriverError, PATIENCE, Progress, Work};
use crate::observation::Observation;
use crate::operator::{Operator, Outcome};
use crate::shake;

/// What a test of the object returns.
enum Tested {
    /// The command of the tick.
    Command(Box<v1::Command>),
    /// It goes on.
    Going,
    /// Its failure, if it has one, and notes.
    Done(Option<String>, Vec<String>),
}

impl Work<'_> {
    /// Shakes the object in the hand; fails when it slips.
    pub(super) fn shake(
        &mut self,
        progress: &mut dyn FnMut(&Progress<'_>),
    ) -> Result<Outcome, DriverError> {
        let (mut tick, mut held) = (0, None);
        self.tested("shaking", progress, |operator, observation| {
            let Some(observation) = observation else {
                return Tested::Command(Box::new(shake::command(tick).unwrap_or_default()));
            };
            let at = operator.object_in_hand(observation).translation.vector;
            let start = *held.get_or_insert(at);
            tick += 1;
            match shake::command(tick) {
                Some(_) => Tested::Going,
                None => Tested::Done(shake::verdict((at - start).norm()), Vec::new()),
            }
        })
    }

    /// Watches the object that was put down; fails when it does not rest.
    pub(super) fn rest(
        &mut self,
        progress: &mut dyn FnMut(&Progress<'_>),
    ) -> Result<Outcome, DriverError> {
        let mut rest = shake::Rest::new(self.pressed);
        self.tested("resting", progress, |operator, observation| {
            let Some(observation) = observation else {
                return Tested::Command(Box::default());
            };
            let pose = operator.object(observation);
            let is_last = pose.is_none_or(|pose| rest.add(observation.time, &pose));
            match is_last {
                false => Tested::Going,
                true => Tested::Done(rest.verdict(), vec![rest.words()]),
            }
        })
    }

    /// Answers ticks until a test is done. It is called twice a tick: for a command, and with the
    /// observation.
    fn tested(
        &mut self,
        phase: &str,
        progress: &mut dyn FnMut(&Progress<'_>),
        mut test: impl FnMut(&Operator, Option<&Observation>) -> Tested,
    ) -> Result<Outcome, DriverError> {
        let mut silent = 0;
        loop {
            let collector = &mut self.collector;
            let clock = match self.turns.next(PATIENCE, &mut |s| collector.take(s))? {
                Turn::Answer(clock) => clock,
                Turn::Refused(_) => continue,
                Turn::Ended(end) => match self.ended(end)? {
                    Some(outcome) => return Ok(outcome),
                    None => continue,
                },
                Turn::Silent(status) => {
                    silent += 1;
                    match self.silent(silent, &status)? {
                        Some(outcome) => return Ok(outcome),
                        None => continue,
                    }
                }
            };
            silent = 0;
            let stamp = clock.header.as_ref().map_or(0, |h| h.stamp_nanos);
            let command = match test(&self.operator, None) {
                Tested::Command(command) => *command,
                Tested::Going | Tested::Done(..) => v1::Command::default(),
            };
            self.turns.answer(command)?;
            let Some(observation) = self.collector.observe(stamp)? else {
                continue;
            };
            let (verdict, notes) = match test(&self.operator, Some(&observation)) {
                Tested::Done(verdict, notes) => (Some(verdict), notes),
                Tested::Going | Tested::Command(_) => (None, Vec::new()),
            };
            progress(&Progress {
                time: stamp.saturating_sub(self.first.stamp_nanos) as f64 * 1e-9,
                phase,
                factor: clock.real_time_factor,
                notes: &notes,
            });
            if let Some(failure) = verdict {
                return Ok(failure.map_or(Outcome::Success, Outcome::Failure));
            }
        }
    }
}
