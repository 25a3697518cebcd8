//! Requests of a recorder to its server.

use std::time::Duration;

use wheelarm_proto::{StreamId, v1};
use wheelarm_sdk::Client;
use zenoh::query::{ConsolidationMode, QueryTarget, ReplyKeyExpr};

use super::super::Missing;
use super::super::queue::QueueSender;
use super::super::raw::Raw;
use super::super::recorder::Input;

/// Longest wait for the episode state; a lost request is repeated. On a slow line the
/// reply arrives after images that are already in flight.
const STATE_TIMEOUT: Duration = Duration::from_secs(15);
/// Longest wait for the snapshot.
const SNAPSHOT_TIMEOUT: Duration = Duration::from_secs(10);

/// Runs `work`, which blocks until the server replies, on a blocking thread.
pub(super) fn aside<T: Send + 'static>(
    client: &Client,
    work: impl FnOnce(&Client) -> T + Send + 'static,
) -> tokio::task::JoinHandle<T> {
    let client = client.clone();
    tokio::task::spawn_blocking(move || work(&client))
}

pub(super) fn request_snapshot(client: &Client, sender: &QueueSender<Raw>) {
    let sender = sender.clone();
    aside(client, move |client| {
        let reply = client.request_within(&v1::SnapshotRequest {}, SNAPSHOT_TIMEOUT);
        sender.control(Raw::Ready(Input::Snapshot(
            reply.map_err(|e| e.to_string()),
        )));
    });
}

/// A pending request for samples; sends [`Input::Answered`] when it is dropped.
struct PendingRequest {
    to: QueueSender<Raw>,
    missing: Missing,
}

impl Drop for PendingRequest {
    fn drop(&mut self) {
        let answered = Input::Answered(self.missing.clone());
        self.to.control(Raw::Ready(answered));
    }
}

/// Requests missing samples from the cache of a stream's publisher and waits no longer
/// than `patience`. The transport numbers the samples of a stream as their headers do.
pub(super) async fn request_samples(
    client: &Client,
    sender: &QueueSender<Raw>,
    missing: Missing,
    patience: Duration,
) {
    let (session, keys, server) = (client.session(), client.keys(), client.server().clone());
    let id = StreamId::parse(&missing.stream);
    let key = keys.stream(&id);
    let first = missing.first;
    let last = missing
        .last
        .map_or_else(String::new, |last| last.to_string());
    tracing::debug!("requesting {} {first}..{last} again", missing.stream);
    let pending = PendingRequest {
        to: sender.clone(),
        missing,
    };
    let request = session
        .get(format!("{key}/@adv/**?_sn={first}..{last}"))
        .callback(move |reply| {
            let Ok(sample) = reply.into_result() else {
                return;
            };
            if sample.key_expr().as_str() != key || !server.sent(&sample) {
                return;
            }
            let payload = sample.payload().clone();
            let bytes = payload.len();
            let raw = Raw::Sample(id.clone(), payload);
            pending.to.sample(raw, bytes, id.is_images());
        })
        .consolidation(ConsolidationMode::None)
        .accept_replies(ReplyKeyExpr::Any)
        .target(QueryTarget::All)
        .timeout(patience)
        .await;
    if let Err(problem) = request {
        tracing::debug!("cannot request samples: {problem}");
    }
}

/// Requests the running episode and the ended ones.
pub(super) fn request_state(client: &Client, sender: &QueueSender<Raw>) {
    let sender = sender.clone();
    aside(client, move |client| {
        let reply = client.request_within(&v1::EpisodeRequest::default(), STATE_TIMEOUT);
        sender.control(Raw::Ready(Input::State(reply.map_err(|e| e.to_string()))));
    });
}
