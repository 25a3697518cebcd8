//! Camera images: each level of each camera is subscribed once while at least one page
//! shows it, and not at all otherwise.

use std::collections::BTreeMap;
use std::sync::{Arc, Weak};

use bytes::Bytes;
use parking_lot::Mutex;
use tokio::sync::watch as latest;
use wheelarm_proto::preview::PreviewLevel;
use wheelarm_proto::{Message, v1};
use wheelarm_sdk::Client;

/// One image as the server sent it.
#[derive(Clone, Debug)]
pub struct Image {
    /// Sequence number within its feed.
    pub number: u64,
    /// Tick of the exposure.
    pub tick: u64,
    /// Simulation time of the exposure, ns.
    pub stamp_nanos: u64,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// JPEG file; empty for a raw level.
    pub jpeg: Bytes,
    /// I420 planes; empty for a compressed level.
    pub i420: Bytes,
}

/// One level of one camera.
pub struct Feed {
    camera: String,
    level: PreviewLevel,
    newest: Mutex<(u64, Option<Arc<Image>>)>,
    pulse: latest::Sender<u64>,
    task: Mutex<Option<tokio::task::AbortHandle>>,
}

impl Feed {
    /// The newest image.
    #[must_use]
    pub fn newest(&self) -> Option<Arc<Image>> {
        self.newest.lock().1.clone()
    }

    /// Its level.
    #[must_use]
    pub fn level(&self) -> PreviewLevel {
        self.level
    }

    fn take(&self, payload: &[u8]) {
        let Ok(frame) = v1::PreviewFrame::decode(payload) else {
            return;
        };
        let header = frame.header.unwrap_or_default();
        {
            let mut newest = self.newest.lock();
            newest.0 += 1;
            newest.1 = Some(Arc::new(Image {
                number: newest.0,
                tick: header.tick,
                stamp_nanos: header.stamp_nanos,
                width: frame.width,
                height: frame.height,
                jpeg: frame.jpeg,
                i420: frame.i420,
            }));
        }
        self.pulse.send_modify(|pulse| *pulse += 1);
    }
}

impl Drop for Feed {
    fn drop(&mut self) {
        if let Some(task) = self.task.get_mut().take() {
            task.abort();
        }
    }
}

/// All feeds.
pub struct Feeds {
    client: latest::Receiver<Option<Client>>,
    open: Mutex<BTreeMap<(String, PreviewLevel), Weak<Feed>>>,
    pulse: latest::Sender<u64>,
}

impl Feeds {
    /// Feeds that subscribe through the current connection.
    #[must_use]
    pub fn new(client: latest::Receiver<Option<Client>>) -> Self {
        Self {
            client,
            open: Mutex::default(),
            pulse: latest::Sender::new(0),
        }
    }

    /// Signals that any feed has a new image.
    #[must_use]
    pub fn pulse(&self) -> latest::Receiver<u64> {
        self.pulse.subscribe()
    }

    /// Subscription to one level of a camera; ends when dropped.
    #[must_use]
    pub fn get(&self, camera: &str, level: PreviewLevel) -> Arc<Feed> {
        let mut open = self.open.lock();
        open.retain(|_, feed| feed.strong_count() > 0);
        let key = (camera.to_owned(), level);
        if let Some(feed) = open.get(&key).and_then(Weak::upgrade) {
            return feed;
        }
        let feed = Arc::new(Feed {
            camera: camera.to_owned(),
            level,
            newest: Mutex::default(),
            pulse: self.pulse.clone(),
            task: Mutex::default(),
        });
        let task = tokio::spawn(keep(Arc::downgrade(&feed), self.client.clone()));
        *feed.task.lock() = Some(task.abort_handle());
        open.insert(key, Arc::downgrade(&feed));
        feed
    }
}

/// Moves the subscriptions to the current connection.
async fn keep(feed: Weak<Feed>, mut clients: latest::Receiver<Option<Client>>) {
    loop {
        let present = clients.borrow_and_update().clone();
        let held = match (present, feed.upgrade()) {
            (_, None) => return,
            (None, _) => None,
            (Some(client), Some(known)) => {
                let taking = Weak::clone(&feed);
                let key = client.keys().preview(&known.camera, known.level);
                let subscribed = client.subscribe(&key, move |sample| {
                    if let Some(feed) = taking.upgrade() {
                        feed.take(&sample.payload().to_bytes());
                    }
                });
                subscribed
                    .inspect_err(|e| {
                        tracing::warn!("cannot subscribe to the images of {}: {e}", known.camera)
                    })
                    .ok()
            }
        };
        let changed = clients.changed().await;
        drop(held);
        if changed.is_err() {
            return;
        }
    }
}
