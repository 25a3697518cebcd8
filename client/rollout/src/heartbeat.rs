//! The heartbeat of an episode: for how long the server has been silent, and for how
//! long simulated time has not advanced.
//!
//! Both clocks count the time between two calls of [`Heartbeat::update`], but never more
//! than [`Heartbeat::longest`] per call. An episode that a job scheduler suspended as a
//! whole therefore does not count as stalled when it continues.

use std::sync::Arc;
use std::time::{Duration, Instant};

use parking_lot::{Mutex, MutexGuard};
use wheelarm_proto::v1;

use crate::failure::{Failure, FailureCause};

/// Longest time that one update may add.
const LONGEST: Duration = Duration::from_secs(25);
/// Looks without an answer before a server counts as silent, at least.
const UPDATES: u32 = 3;

/// The shared clocks of one episode.
#[derive(Clone, Debug)]
pub struct Heartbeat {
    state: Arc<Mutex<State>>,
    longest: Duration,
}

#[derive(Debug)]
struct State {
    tick: u64,
    updated: Instant,
    /// Time for which the tick has not changed.
    still: Duration,
    /// Time for which the server has not answered.
    silent: Duration,
    /// Send time of the newest request that was answered.
    answered: Option<Instant>,
    /// The driver waits for its policy, so time need not advance.
    policy_turn: bool,
    waiting_for: String,
    seconds: f64,
    scenario: Option<v1::Scenario>,
}

impl Heartbeat {
    /// Starts the clocks of an episode whose server may be silent for `patience`.
    #[must_use]
    pub fn new(patience: Duration) -> Self {
        Self {
            state: Arc::new(Mutex::new(State {
                tick: 0,
                updated: Instant::now(),
                still: Duration::ZERO,
                silent: Duration::ZERO,
                answered: None,
                policy_turn: false,
                waiting_for: String::new(),
                seconds: 0.0,
                scenario: None,
            })),
            longest: LONGEST.min(patience / UPDATES),
        }
    }

    /// Longest time that one update may add.
    #[must_use]
    pub fn longest(&self) -> Duration {
        self.longest
    }

    /// Adds the time since the last update to both clocks.
    pub fn update(&self) {
        let mut state = self.state.lock();
        let passed = state.updated.elapsed().min(self.longest);
        state.updated = Instant::now();
        state.silent += passed;
        if !state.policy_turn {
            state.still += passed;
        }
    }

    /// The server answered a status request that was sent at `sent`.
    pub fn status(&self, status: &v1::Status, sent: Instant) {
        let tick = status.header.as_ref().map_or(0, |header| header.tick);
        let mut state = self.state.lock();
        state.answered = Some(sent);
        state.silent = Duration::ZERO;
        state.updated = Instant::now();
        if tick != state.tick {
            state.tick = tick;
            state.still = Duration::ZERO;
        }
        state.waiting_for.clone_from(&status.waiting_for);
        if status.scenario.is_some() {
            state.scenario.clone_from(&status.scenario);
        }
        if let Some(seconds) = episode_seconds(status) {
            state.seconds = seconds;
        }
    }

    /// The driver received a control tick, `seconds` simulated seconds after the first.
    pub fn tick(&self, seconds: f64) {
        self.alive().seconds = seconds;
    }

    /// The server set the scenario up, with its sampled values.
    pub fn set_scenario(&self, scenario: &v1::Scenario) {
        self.alive().scenario = Some(scenario.clone());
    }

    /// The driver begins or ends to wait for its policy. Meanwhile simulated time need
    /// not advance: the policy has its own time limit.
    pub fn set_policy_turn(&self, is_on: bool) {
        self.alive().policy_turn = is_on;
    }

    /// Sets both clocks to zero.
    fn alive(&self) -> MutexGuard<'_, State> {
        let mut state = self.state.lock();
        state.updated = Instant::now();
        (state.still, state.silent) = (Duration::ZERO, Duration::ZERO);
        state
    }

    /// Time for which the server has not answered.
    #[must_use]
    pub fn silent_for(&self) -> Duration {
        self.state.lock().silent
    }

    /// Time for which simulated time has not advanced while the server answered.
    #[must_use]
    pub fn stalled_for(&self) -> Duration {
        let state = self.state.lock();
        match state.policy_turn {
            true => Duration::ZERO,
            false => state.still.saturating_sub(state.silent),
        }
    }

    /// Whether the server answered a request that was sent after `since`.
    #[must_use]
    pub fn has_answered_since(&self, since: Instant) -> bool {
        self.state.lock().answered.is_some_and(|sent| sent > since)
    }

    /// Simulated seconds of the episode so far.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.state.lock().seconds
    }

    /// The scenario in force; absent before the server reported it.
    #[must_use]
    pub fn scenario(&self) -> Option<v1::Scenario> {
        self.state.lock().scenario.clone()
    }

    /// A failure at this point of the episode.
    #[must_use]
    pub fn failure(&self, cause: FailureCause, reason: String) -> Failure {
        Failure {
            cause,
            reason,
            seconds: self.seconds(),
            scenario: self.scenario().map(Box::new),
        }
    }

    /// The client that the server waits for, as the end of a sentence; empty for none.
    #[must_use]
    pub fn waiting_for(&self) -> String {
        let state = self.state.lock();
        match state.waiting_for.as_str() {
            "" => String::new(),
            client => format!("; the server waits for {client}"),
        }
    }
}

/// Simulated seconds since the running episode began; absent between episodes.
#[must_use]
pub fn episode_seconds(status: &v1::Status) -> Option<f64> {
    let stamp = |header: Option<&v1::Header>| header.map_or(0, |h| h.stamp_nanos);
    let started = status.episode.as_ref()?;
    let begun = stamp(started.header.as_ref());
    let now = stamp(status.header.as_ref());
    Some(now.saturating_sub(begun) as f64 * 1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(tick: u64) -> v1::Status {
        v1::Status {
            header: Some(v1::Header {
                tick,
                ..v1::Header::default()
            }),
            ..v1::Status::default()
        }
    }

    /// Moves the time of the last update back by `passed`.
    fn pass(heartbeat: &Heartbeat, passed: Duration) {
        let mut state = heartbeat.state.lock();
        state.updated = state.updated.checked_sub(passed).expect("an earlier time");
        drop(state);
        heartbeat.update();
    }

    #[test]
    fn replying_server_without_progress_stalls_and_silent_one_does_not() {
        let second = Duration::from_secs(1);
        let heartbeat = Heartbeat::new(60 * second);
        heartbeat.status(&status(4), Instant::now());
        for _ in 0..5 {
            pass(&heartbeat, second);
            heartbeat.status(&status(4), Instant::now());
        }
        assert!(heartbeat.stalled_for() >= 5 * second);
        assert!(heartbeat.silent_for() < second);
        heartbeat.status(&status(8), Instant::now());
        assert_eq!(heartbeat.stalled_for(), Duration::ZERO);
        for _ in 0..5 {
            pass(&heartbeat, second);
        }
        assert!(heartbeat.silent_for() >= 5 * second);
        assert!(heartbeat.stalled_for() < second);
    }

    #[test]
    fn update_after_a_suspension_adds_at_most_a_third_of_the_patience() {
        let patience = Duration::from_secs(6);
        let heartbeat = Heartbeat::new(patience);
        pass(&heartbeat, Duration::from_secs(30));
        assert_eq!(heartbeat.silent_for(), patience / UPDATES);
    }

    #[test]
    fn time_need_not_advance_during_inference() {
        let second = Duration::from_secs(1);
        let heartbeat = Heartbeat::new(60 * second);
        heartbeat.set_policy_turn(true);
        for _ in 0..5 {
            pass(&heartbeat, second);
            heartbeat.status(&status(4), Instant::now());
        }
        assert_eq!(heartbeat.stalled_for(), Duration::ZERO);
        heartbeat.set_policy_turn(false);
        pass(&heartbeat, second);
        heartbeat.status(&status(4), Instant::now());
        assert!(heartbeat.stalled_for() >= second, "the pause is over");
    }
}
