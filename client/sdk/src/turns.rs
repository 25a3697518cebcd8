//! Turns of a commander: each control tick that needs a command, after the samples
//! published before it.
//!
//! In lock-step, simulation time waits for the command. A command with
//! `Command.over_ticks` covers several ticks, and the next turn follows them. In real
//! time turns arrive at 60 Hz, with or without commands.

use std::time::{Duration, Instant};

use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TICKS_PER_CONTROL, TopicId, v1};

use super::{Client, ClientError, Commander, Streams};

/// Silence after which a status query checks whether simulation time waits for this
/// commander: a clock may be lost, or published before the subscription.
const SILENCE: Duration = Duration::from_secs(1);
/// Longest delay of samples published before such a reply. A command sent without them
/// would use an older state.
const GRACE: Duration = Duration::from_millis(250);

/// What a commander has to handle next.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "a turn is short-lived")]
pub enum Turn {
    /// A control tick needs a command; its clock.
    Answer(v1::Clock),
    /// The server refused one of its commands.
    Refused(v1::Refusal),
    /// An episode has ended.
    Ended(v1::EpisodeStopped),
    /// No sample arrived within the patience; the status of the server.
    Silent(v1::Status),
}

/// A commander and its queue of turns.
pub struct Turns {
    client: Client,
    commander: Commander,
    streams: Streams,
    /// Header of the tick that needs a command.
    due: v1::Header,
    covered: Covered,
}

/// Ticks that the newest command covers.
#[derive(Debug, Default)]
struct Covered {
    run: String,
    episode: u64,
    /// First covered tick, and the first tick after them.
    ticks: [u64; 2],
}

impl Covered {
    fn answered(&mut self, header: &v1::Header, ticks: u64) {
        self.run.clone_from(&header.run_id);
        self.episode = header.episode;
        self.ticks = [header.tick, header.tick + ticks];
    }

    /// Whether a tick needs a command.
    fn is_due(&self, header: &v1::Header) -> bool {
        let [first, behind] = self.ticks;
        // Between episodes a reset sets simulation time back.
        let set_back = header.episode == 0 && header.tick < first;
        self.run != header.run_id
            || self.episode != header.episode
            || header.tick >= behind
            || set_back
    }
}

impl Client {
    /// Acquires control as [`Client::commander`] does, and subscribes to `topics` and the
    /// topics of a commander.
    ///
    /// # Errors
    /// As [`Client::commander`].
    pub fn turns(&self, name: &str, take: bool, topics: &[TopicId]) -> Result<Turns, ClientError> {
        let mut wanted = vec![TopicId::Clock, TopicId::Refusal, TopicId::EpisodeStop];
        wanted.extend(
            topics
                .iter()
                .filter(|topic| !wanted.contains(topic))
                .copied()
                .collect::<Vec<_>>(),
        );
        let streams = self.streams(&wanted)?;
        Ok(Turns {
            commander: self.commander(name, take)?,
            client: self.clone(),
            streams,
            due: v1::Header::default(),
            covered: Covered::default(),
        })
    }
}

impl Turns {
    /// Waits for the next turn until no sample has arrived for `patience`. Calls `taken`
    /// with each sample of the requested topics in order of arrival; the clock of a tick
    /// follows its other samples.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn next(
        &mut self,
        patience: Duration,
        taken: &mut dyn FnMut(Sample),
    ) -> Result<Turn, ClientError> {
        let (mut received_at, mut waiting) = (Instant::now(), None);
        loop {
            let left = patience.saturating_sub(received_at.elapsed());
            let next = self.streams.next(match waiting {
                Some(_) => GRACE,
                None => left.min(SILENCE),
            })?;
            if next.is_some() {
                (received_at, waiting) = (Instant::now(), None);
            }
            match next {
                Some(Sample::Clock(clock)) => {
                    let header = clock.header.clone().unwrap_or_default();
                    taken(Sample::Clock(clock.clone()));
                    if self.covered.is_due(&header) {
                        self.due = header;
                        return Ok(Turn::Answer(clock));
                    }
                }
                Some(Sample::Refusal(refusal)) if refusal.commander == self.commander.name() => {
                    // A tick without an accepted command is due again.
                    let late = [v1::RefusalCode::Answered, v1::RefusalCode::TooOld];
                    if !late.contains(&refusal.code()) {
                        self.covered = Covered::default();
                    }
                    return Ok(Turn::Refused(refusal));
                }
                Some(Sample::EpisodeStop(stopped)) => return Ok(Turn::Ended(stopped)),
                Some(sample) => taken(sample),
                None => {
                    if let Some(clock) = waiting.take() {
                        let clock: v1::Clock = clock;
                        self.due = clock.header.clone().unwrap_or_default();
                        return Ok(Turn::Answer(clock));
                    }
                    let status = self.client.request(&v1::StatusRequest {})?;
                    let header = status.header.clone().unwrap_or_default();
                    let waits = status.episode.is_some() && !status.paused;
                    if waits && self.covered.is_due(&header) {
                        // Samples published before the reply may still be in flight.
                        waiting = Some(v1::Clock {
                            header: Some(header),
                            real_time_factor: status.real_time_factor,
                        });
                        continue;
                    }
                    if received_at.elapsed() >= patience {
                        return Ok(Turn::Silent(status));
                    }
                }
            }
        }
    }

    /// Sends the command for the newest [`Turn::Answer`].
    ///
    /// # Errors
    /// [`ClientError::Transport`].
    pub fn answer(&mut self, command: v1::Command) -> Result<(), ClientError> {
        let ticks = u64::from(command.over_ticks.max(1)) * TICKS_PER_CONTROL;
        self.commander.answer(&self.due, command)?;
        self.covered.answered(&self.due, ticks);
        Ok(())
    }

    /// The commander of these turns.
    #[must_use]
    pub fn commander(&self) -> &Commander {
        &self.commander
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(episode: u64, tick: u64) -> v1::Header {
        v1::Header {
            run_id: "run".into(),
            episode,
            tick,
            ..Default::default()
        }
    }

    #[test]
    fn tick_is_due_once_and_again_after_time_is_set_back() {
        let mut covered = Covered::default();
        assert!(covered.is_due(&at(1, 0)));
        covered.answered(&at(1, 40), 8);
        // A clock older than a reply of `status` does not start a turn.
        assert!(!covered.is_due(&at(1, 36)) && !covered.is_due(&at(1, 44)));
        assert!(covered.is_due(&at(1, 48)) && covered.is_due(&at(2, 0)));
        covered.answered(&at(0, 40), 4);
        assert!(!covered.is_due(&at(0, 40)) && covered.is_due(&at(0, 0)));
    }
}
