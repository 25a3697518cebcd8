//! The pictures of one camera: subscribed at the level that the link carries
//! while somebody watches, and not at all while nobody does.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use bytes::Bytes;
use parking_lot::Mutex;
use tokio::sync::watch as latest;
use wheelarm_proto::preview::PreviewLevel;
use wheelarm_proto::{Message, v1};
use zenoh::pubsub::Subscriber;

use wheelarm_drive::ladder::Ladder;
use wheelarm_link::Link;

/// Nobody watches any more after this long without a question.
const FORGOTTEN: Duration = Duration::from_secs(5);
/// How often the level is looked at.
const LOOK: Duration = Duration::from_millis(200);
/// Longest wait of a question for a new picture.
const PATIENCE: Duration = Duration::from_secs(4);
/// Viewers that are told apart; more share the last place.
const VIEWERS: usize = 32;

/// One picture.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Counts up by one per picture of this feed.
    pub number: u64,
    /// JPEG file.
    pub jpeg: Bytes,
    /// Its level.
    pub level: PreviewLevel,
    /// Simulation time, s.
    pub time: f64,
    /// Growth of the delay over the quickest picture, s.
    pub growth: f64,
}

struct Judge {
    ladder: Ladder,
    /// Number of the newest picture that each viewer got.
    viewers: BTreeMap<String, u64>,
    asked: Option<Instant>,
    count: u64,
}

/// Pictures of one camera.
pub struct Feed {
    camera: String,
    began: Instant,
    judge: Mutex<Judge>,
    newest: latest::Sender<Option<Arc<Picture>>>,
}

impl Feed {
    /// A feed that subscribes through whatever link there is.
    pub fn open(camera: &str, link: latest::Receiver<Option<Link>>) -> Arc<Self> {
        let feed = Arc::new(Self {
            camera: camera.to_owned(),
            began: Instant::now(),
            judge: Mutex::new(Judge {
                ladder: Ladder::new(0.0),
                viewers: BTreeMap::new(),
                asked: None,
                count: 0,
            }),
            newest: latest::Sender::new(None),
        });
        tokio::spawn(keep(Arc::clone(&feed), link));
        feed
    }

    fn now(&self) -> f64 {
        self.began.elapsed().as_secs_f64()
    }

    fn judge(&self) -> parking_lot::MutexGuard<'_, Judge> {
        self.judge.lock()
    }

    /// The level that is wanted now; `None` while nobody watches.
    fn wanted(&self) -> Option<PreviewLevel> {
        let now = self.now();
        let mut judge = self.judge();
        let watched = judge.asked.is_some_and(|at| at.elapsed() < FORGOTTEN);
        if !watched {
            judge.viewers.clear();
            return None;
        }
        judge.ladder.decide(now);
        Some(judge.ladder.level())
    }

    fn take(&self, payload: &[u8]) {
        let Ok(frame) = v1::PreviewFrame::decode(payload) else {
            return;
        };
        let Some(level) = PreviewLevel::told(frame.level()) else {
            return;
        };
        let header = frame.header.unwrap_or_default();
        let sent = frame.sent_unix_nanos as f64 * 1e-9;
        let here = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .unwrap_or_default()
            .as_secs_f64();
        let now = self.now();
        let picture = {
            let mut judge = self.judge();
            if level == judge.ladder.level() {
                judge.ladder.came(header.sequence, here - sent, now);
            }
            judge.count += 1;
            Picture {
                number: judge.count,
                jpeg: frame.jpeg,
                level,
                time: header.stamp_nanos as f64 * 1e-9,
                growth: judge.ladder.growth(),
            }
        };
        self.newest.send_replace(Some(Arc::new(picture)));
    }

    /// The newest picture that `viewer` has not got yet; waits for one a while.
    pub async fn next(&self, viewer: &str, after: u64) -> Option<Arc<Picture>> {
        let mut newest = self.newest.subscribe();
        let last = {
            let mut judge = self.judge();
            judge.asked = Some(Instant::now());
            // A number from the page's time with an earlier program says nothing.
            let after = if after > judge.count { 0 } else { after };
            judge.viewers.get(viewer).copied().unwrap_or(0).max(after)
        };
        let is_new = |picture: &Option<Arc<Picture>>| {
            // Another question of the same viewer may have got it meanwhile.
            let got = self.judge().viewers.get(viewer).copied().unwrap_or(0);
            picture
                .as_ref()
                .is_some_and(|p| p.number > last && p.number > got)
        };
        let found = tokio::time::timeout(PATIENCE, newest.wait_for(is_new)).await;
        let picture = found.ok()?.ok()?.clone()?;
        let mut judge = self.judge();
        judge.asked = Some(Instant::now());
        let known = judge.viewers.contains_key(viewer) || judge.viewers.len() < VIEWERS;
        if known {
            let before = judge.viewers.insert(viewer.to_owned(), picture.number);
            if let Some(before) = before {
                let skipped = picture.number.saturating_sub(before + 1);
                judge.ladder.shown(skipped);
            }
        }
        Some(picture)
    }
}

/// Keeps the subscription at the wanted level of the present link.
async fn keep(feed: Arc<Feed>, mut link: latest::Receiver<Option<Link>>) {
    let mut held: Option<(Subscriber<()>, PreviewLevel)> = None;
    let mut look = tokio::time::interval(LOOK);
    loop {
        tokio::select! {
            _ = look.tick() => {}
            changed = link.changed() => {
                if changed.is_err() {
                    return;
                }
                held = None;
                feed.judge().ladder.restart();
            }
        }
        let wanted = feed.wanted();
        if wanted == held.as_ref().map(|(_, level)| *level) {
            continue;
        }
        let present = link.borrow().clone();
        let (Some(level), Some(link)) = (wanted, present) else {
            held = None;
            continue;
        };
        let taking = Arc::clone(&feed);
        let key = link.keys().preview(&feed.camera, level);
        let subscriber = link.subscribe(&key, move |sample| {
            taking.take(&sample.payload().to_bytes())
        });
        match subscriber {
            // The new one stands before the old one goes.
            Ok(subscriber) => held = Some((subscriber, level)),
            Err(error) => tracing::warn!("no preview of {}: {error}", feed.camera),
        }
    }
}
