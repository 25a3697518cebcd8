//! How an attempt goes: its server is asked on a thread of its own, for an
//! answer that does not come must not hold up the end of the campaign.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use wheelarm_proto::keys::Query;
use wheelarm_proto::v1;

use super::attempt::SIM;
use super::progress::lock;
use crate::link::{ConnectArgs, Link};

/// How often the server is asked.
const ASK: Duration = Duration::from_secs(1);
/// Longest time that one question can take.
const LONGEST: Duration = Duration::from_secs(25);

/// How an attempt goes, for people.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Progress {
    /// Simulated seconds.
    pub seconds: f64,
    /// What it does, in a word or two.
    pub doing: String,
}

/// Where an attempt tells how it goes.
pub type Board = Arc<Mutex<Progress>>;

/// Asks the server while it is held.
pub struct Watch {
    seen: Arc<Mutex<Seen>>,
}

struct Seen {
    wanted: bool,
    tick: u64,
    /// When the last answer or its absence was taken in.
    looked: Instant,
    /// For how long the tick has not moved.
    still: Duration,
    waiting_for: String,
    /// The last question was not answered.
    silent: bool,
    scenario: Option<v1::Scenario>,
}

impl Seen {
    /// Takes the time since the last look for standing still. A campaign that
    /// was suspended as a whole, as schedulers do, has not stood still.
    fn look(&mut self) {
        self.still += self.looked.elapsed().min(LONGEST);
        self.looked = Instant::now();
    }
}

impl Watch {
    /// Watches the server at `endpoint` and tells `board`.
    #[must_use]
    pub fn start(endpoint: String, board: &Board) -> Self {
        let seen = Arc::new(Mutex::new(Seen {
            wanted: true,
            tick: 0,
            looked: Instant::now(),
            still: Duration::ZERO,
            waiting_for: String::new(),
            silent: true,
            scenario: None,
        }));
        let (told, board) = (Arc::clone(&seen), Arc::clone(board));
        std::thread::spawn(move || {
            let args = ConnectArgs {
                connect: endpoint,
                sim: SIM.to_owned(),
                connect_timeout: 10.0,
            };
            let wanted = || {
                let told = lock(&told);
                told.wanted
            };
            let mut open = None;
            while wanted() {
                if open.is_none() {
                    open = Link::open(&args).ok();
                }
                let ask = |link: &Link| link.ask::<v1::Status>(Query::Status).ok();
                // A server that does not answer counts as standing still.
                lock(&told).look();
                let status = open.as_ref().and_then(ask);
                lock(&told).silent = status.is_none();
                if let Some(status) = status {
                    follow(&status, &told, &board);
                }
                std::thread::sleep(ASK);
            }
            if let Some(link) = open {
                // The server may be gone already.
                let _ = link.close();
            }
        });
        Self { seen }
    }

    /// For how long simulation time has stood still.
    #[must_use]
    pub fn stalled(&self) -> Duration {
        lock(&self.seen).still
    }

    /// Whether the server did not answer the last question.
    #[must_use]
    pub fn is_silent(&self) -> bool {
        lock(&self.seen).silent
    }

    /// The scenario in force, once the server has told it.
    #[must_use]
    pub fn scenario(&self) -> Option<v1::Scenario> {
        lock(&self.seen).scenario.clone()
    }

    /// Whom the server waits for, as the end of a sentence.
    #[must_use]
    pub fn waiting_for(&self) -> String {
        let seen = lock(&self.seen);
        if seen.waiting_for.is_empty() {
            return String::new();
        }
        format!("; the server waits for {}", seen.waiting_for)
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        lock(&self.seen).wanted = false;
    }
}

fn follow(status: &v1::Status, told: &Mutex<Seen>, board: &Board) {
    let tick = status.header.as_ref().map_or(0, |h| h.tick);
    let stamp = |header: Option<&v1::Header>| header.map_or(0, |h| h.stamp_nanos);
    let mut told = lock(told);
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
    let mut progress = lock(board);
    if told.wanted {
        progress.seconds = seconds;
        progress.doing = format!("{:.2}x real time", status.real_time_factor);
    }
}
