//! Makes attempts, in the way that the campaign's workers run.

use std::time::Instant;

use super::activity::Activity;
use super::attempt::{Attempt, Halt, Outcome, Setup};
use super::episode::Episode;
use super::slot::{Permit, Slot};
use super::stop::Stop;
use super::{by_process, by_socket};
use crate::way::Way;

/// Makes one attempt; the file lies in the staging folder afterwards. `permit`
/// is held while it simulates and is over before the file is finished.
///
/// # Errors
/// When a program of the attempt broke, with its last words.
pub fn attempt(
    setup: &Setup,
    (episode, number): (&Episode, u32),
    (slot, permit): (&Slot, Permit<'_>),
    stop: &Stop,
    activity: &Activity,
) -> anyhow::Result<Outcome> {
    let attempt = Attempt {
        setup,
        slot,
        episode,
        number,
        seed: episode.seed_of(number),
        staging: setup.folder.stage(&episode.id)?,
        stop,
        activity,
        begun: Instant::now(),
    };
    let made = match setup.way {
        Way::Process => by_process::run(&attempt, permit),
        Way::Socket => by_socket::run(&attempt, permit),
    };
    match made {
        Ok(outcome) => Ok(outcome),
        Err(Halt::Over(outcome)) => Ok(*outcome),
        Err(Halt::Trouble(problem)) => Err(problem),
    }
}
