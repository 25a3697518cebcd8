//! A commander's turns: every control tick that it is to answer, with what was
//! published up to it.
//!
//! In lock-step time waits for the answer; with `Command.over_ticks` it stands
//! for several ticks, and the next turn comes behind them. In real time the
//! turns come at 60 Hz whether they are answered or not.

use std::time::{Duration, Instant};

use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TICKS_PER_CONTROL, TopicId, v1};

use super::{Client, ClientError, Commander, Streams};

/// Silence after which the server is asked whether time waits for us: a clock
/// may have been published before this commander listened, or be lost.
const SILENCE: Duration = Duration::from_secs(1);
/// How long samples that were published before such an answer may still take:
/// whoever answered without them would answer another state.
const GRACE: Duration = Duration::from_millis(250);

/// What a commander is told.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "a turn is looked at and dropped")]
pub enum Turn {
    /// A control tick is to be answered; its clock.
    Answer(v1::Clock),
    /// One of its commands was refused.
    Refused(v1::Refusal),
    /// An episode has ended.
    Ended(v1::EpisodeStopped),
    /// Nothing came within the patience; what the server says that it does.
    Silent(v1::Status),
}

/// A commander that takes its turns.
pub struct Turns {
    link: Client,
    commander: Commander,
    streams: Streams,
    /// The tick to be answered.
    asked: v1::Header,
    covered: Covered,
}

/// What the newest answer stands for.
#[derive(Debug, Default)]
struct Covered {
    run: String,
    episode: u64,
    /// First tick that was answered, and the first behind.
    ticks: [u64; 2],
}

impl Covered {
    fn answered(&mut self, header: &v1::Header, ticks: u64) {
        self.run.clone_from(&header.run_id);
        self.episode = header.episode;
        self.ticks = [header.tick, header.tick + ticks];
    }

    /// Whether a tick is not answered yet.
    fn is_due(&self, header: &v1::Header) -> bool {
        let [first, behind] = self.ticks;
        // Between episodes a reset sets time back.
        let set_back = header.episode == 0 && header.tick < first;
        self.run != header.run_id
            || self.episode != header.episode
            || header.tick >= behind
            || set_back
    }
}

impl Client {
    /// Takes control as `name`, as [`Client::commander`] does, and subscribes to
    /// `topics` beside what a commander is told.
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
            link: self.clone(),
            streams,
            asked: v1::Header::default(),
            covered: Covered::default(),
        })
    }
}

impl Turns {
    /// Waits for the next turn until nothing at all has come for `patience`.
    /// What is published until then, of the topics that were asked for, goes to
    /// `taken` in its order; a tick's clock comes after its other samples.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn next(
        &mut self,
        patience: Duration,
        taken: &mut dyn FnMut(Sample),
    ) -> Result<Turn, ClientError> {
        let (mut heard, mut waiting) = (Instant::now(), None);
        loop {
            let left = patience.saturating_sub(heard.elapsed());
            let next = self.streams.next(match waiting {
                Some(_) => GRACE,
                None => left.min(SILENCE),
            })?;
            if next.is_some() {
                (heard, waiting) = (Instant::now(), None);
            }
            match next {
                Some(Sample::Clock(clock)) => {
                    let header = clock.header.clone().unwrap_or_default();
                    taken(Sample::Clock(clock.clone()));
                    if self.covered.is_due(&header) {
                        self.asked = header;
                        return Ok(Turn::Answer(clock));
                    }
                }
                Some(Sample::Refusal(refusal)) if refusal.commander == self.commander.name() => {
                    // A tick that is not answered is offered again.
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
                        self.asked = clock.header.clone().unwrap_or_default();
                        return Ok(Turn::Answer(clock));
                    }
                    let status = self.link.request(&v1::StatusRequest {})?;
                    let header = status.header.clone().unwrap_or_default();
                    let waits = status.episode.is_some() && !status.paused;
                    if waits && self.covered.is_due(&header) {
                        // What was published before may still be on its way.
                        waiting = Some(v1::Clock {
                            header: Some(header),
                            real_time_factor: status.real_time_factor,
                        });
                        continue;
                    }
                    if heard.elapsed() >= patience {
                        return Ok(Turn::Silent(status));
                    }
                }
            }
        }
    }

    /// Answers the newest [`Turn::Answer`].
    ///
    /// # Errors
    /// [`ClientError::Transport`].
    pub fn answer(&mut self, command: v1::Command) -> Result<(), ClientError> {
        let ticks = u64::from(command.over_ticks.max(1)) * TICKS_PER_CONTROL;
        self.commander.answer(&self.asked, command)?;
        self.covered.answered(&self.asked, ticks);
        Ok(())
    }

    /// The commander whose turns they are.
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
    fn a_tick_is_answered_once_and_anew_when_time_was_set_back() {
        let mut covered = Covered::default();
        assert!(covered.is_due(&at(1, 0)));
        covered.answered(&at(1, 40), 8);
        // A clock that was overtaken by an answer to `status` is no turn.
        assert!(!covered.is_due(&at(1, 36)) && !covered.is_due(&at(1, 44)));
        assert!(covered.is_due(&at(1, 48)) && covered.is_due(&at(2, 0)));
        covered.answered(&at(0, 40), 4);
        assert!(!covered.is_due(&at(0, 40)) && covered.is_due(&at(0, 0)));
    }
}
