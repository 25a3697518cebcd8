//! How an attempt goes: its server is asked on a thread of its own, for an
//! answer that does not come must not hold up the end of the campaign.

use std::sync::Arc;
use std::time::{Duration, Instant};

use parking_lot::Mutex;
use wheelarm_link::{Connect, Link};
use wheelarm_proto::v1;

use super::activity::Activity;

/// How often the server is asked.
const ASK: Duration = Duration::from_secs(1);
/// Longest wait for an answer.
const ANSWER: Duration = Duration::from_secs(20);
/// Longest time without an answer that one question can show, [`ASK`] included:
/// never more than a share of the patience, so that no single one uses it up.
const LONGEST: Duration = Duration::from_secs(25);
/// Questions in a row without an answer before a server counts as hung, at least,
/// for a campaign that was suspended as a whole may lose one.
const QUESTIONS: u32 = 3;

/// Asks the server while it is held.
pub struct Watch {
    seen: Arc<Mutex<Seen>>,
    activity: Activity,
    /// Longest time without an answer that one look can show.
    longest: Duration,
}

struct Seen {
    wanted: bool,
    tick: u64,
    /// When the last answer or its absence was taken in.
    looked: Instant,
    /// For how long the tick has not moved.
    still: Duration,
    waiting_for: String,
    /// For how long nothing has been answered.
    silent: Duration,
    /// When the newest answered question was asked.
    answered: Option<Instant>,
    scenario: Option<v1::Scenario>,
}

impl Seen {
    /// Takes the time since the last look, `longest` at most, for a stall
    /// in silence. A campaign that was suspended as a whole, as schedulers do,
    /// has not stalled.
    fn look(&mut self, longest: Duration) {
        let passed = self.looked.elapsed().min(longest);
        self.still += passed;
        self.silent += passed;
        self.looked = Instant::now();
    }
}

impl Watch {
    /// Watches a server and tells `activity`; its silence is to be told from
    /// slowness within `patience`.
    #[must_use]
    pub fn start(connect: Connect, activity: &Activity, patience: Duration) -> Self {
        let answer = ANSWER.min(patience / QUESTIONS);
        let watch = Self::told(activity, patience);
        let longest = watch.longest;
        let (told, activity) = (Arc::clone(&watch.seen), activity.clone());
        std::thread::spawn(move || {
            let mut open = None;
            while told.lock().wanted {
                if open.is_none() {
                    open = Link::open(&connect).ok();
                }
                let ask = |link: &Link| link.ask_within(&v1::StatusRequest {}, answer);
                let asked = Instant::now();
                told.lock().look(longest);
                if let Some(Ok(status)) = open.as_ref().map(ask) {
                    follow(&status, asked, &told, &activity);
                }
                std::thread::sleep(ASK);
            }
            if let Some(link) = open {
                // The server may be gone already.
                let _ = link.close();
            }
        });
        watch
    }

    /// Goes by what [`Watch::take`] is given, once a second, and [`Watch::look`]s at
    /// the time in between.
    #[must_use]
    pub fn told(activity: &Activity, patience: Duration) -> Self {
        let seen = Arc::new(Mutex::new(Seen {
            wanted: true,
            tick: 0,
            looked: Instant::now(),
            still: Duration::ZERO,
            waiting_for: String::new(),
            silent: Duration::ZERO,
            answered: None,
            scenario: None,
        }));
        Self {
            seen,
            activity: activity.clone(),
            longest: LONGEST.min(patience / QUESTIONS),
        }
    }

    /// Takes what the simulation told of itself.
    pub fn take(&self, status: &v1::Status) {
        self.look();
        follow(status, Instant::now(), &self.seen, &self.activity);
    }

    /// Takes the time since the last look.
    pub fn look(&self) {
        self.seen.lock().look(self.longest);
    }

    /// For how long simulation time has stalled while the server answered.
    #[must_use]
    pub fn stalled(&self) -> Duration {
        let seen = self.seen.lock();
        seen.still.saturating_sub(seen.silent)
    }

    /// For how long the server has answered nothing.
    #[must_use]
    pub fn silent_for(&self) -> Duration {
        self.seen.lock().silent
    }

    /// Whether the server has answered a question that was asked after `since`.
    #[must_use]
    pub fn has_answered_since(&self, since: Instant) -> bool {
        self.seen.lock().answered.is_some_and(|asked| asked > since)
    }

    /// The scenario in force, once the server has told it.
    #[must_use]
    pub fn scenario(&self) -> Option<v1::Scenario> {
        self.seen.lock().scenario.clone()
    }

    /// Whom the server waits for, as the end of a sentence.
    #[must_use]
    pub fn waiting_for(&self) -> String {
        let seen = self.seen.lock();
        if seen.waiting_for.is_empty() {
            return String::new();
        }
        format!("; the server waits for {}", seen.waiting_for)
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.seen.lock().wanted = false;
    }
}

fn follow(status: &v1::Status, asked: Instant, told: &Mutex<Seen>, activity: &Activity) {
    let tick = status.header.as_ref().map_or(0, |h| h.tick);
    let stamp = |header: Option<&v1::Header>| header.map_or(0, |h| h.stamp_nanos);
    let mut told = told.lock();
    told.answered = Some(asked);
    told.silent = Duration::ZERO;
    told.looked = Instant::now();
    if tick != told.tick {
        told.tick = tick;
        told.still = Duration::ZERO;
    }
    told.waiting_for.clone_from(&status.waiting_for);
    told.scenario.clone_from(&status.scenario);
    let Some(started) = &status.episode else {
        return;
    };
    let begun = stamp(started.header.as_ref());
    let seconds = stamp(status.header.as_ref()).saturating_sub(begun) as f64 * 1e-9;
    if told.wanted {
        let rate = format!("{:.2}x real time", status.real_time_factor);
        activity.simulated(seconds, rate);
    }
}
