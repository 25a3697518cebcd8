//! What a recorder asks the server.

use std::time::Duration;

use wheelarm_proto::{StreamId, v1};
use wheelarm_sdk::Client;
use zenoh::query::{ConsolidationMode, QueryTarget, ReplyKeyExpr};

use super::super::Missing;
use super::super::queue::Entrance;
use super::super::raw::Raw;
use super::super::recorder::Input;

/// Longest wait for the state; a question that was lost on the way is repeated. On a
/// slow line its answer comes behind pictures that are on their way already.
const STATE_TIMEOUT: Duration = Duration::from_secs(15);
/// Longest wait for the snapshot.
const SNAPSHOT_TIMEOUT: Duration = Duration::from_secs(10);

/// Does `work`, which waits for the server, on a thread for waiting.
pub(super) fn aside<T: Send + 'static>(
    link: &Client,
    work: impl FnOnce(&Client) -> T + Send + 'static,
) -> tokio::task::JoinHandle<T> {
    let link = link.clone();
    tokio::task::spawn_blocking(move || work(&link))
}

pub(super) fn ask_snapshot(link: &Client, entrance: &Entrance<Raw>) {
    let entrance = entrance.clone();
    aside(link, move |link| {
        let reply = link.request_within(&v1::SnapshotRequest {}, SNAPSHOT_TIMEOUT);
        entrance.control(Raw::Ready(Input::Snapshot(
            reply.map_err(|e| e.to_string()),
        )));
    });
}

/// A question for samples that is not answered yet; tells when it is.
struct Unanswered {
    to: Entrance<Raw>,
    missing: Missing,
}

impl Drop for Unanswered {
    fn drop(&mut self) {
        let answered = Input::Answered(self.missing.clone());
        self.to.control(Raw::Ready(answered));
    }
}

/// Asks the cache of a stream's publisher for what did not come, and waits no longer than
/// `patience`. The transport numbers the samples of a stream as their headers do.
pub(super) async fn ask_samples(
    link: &Client,
    entrance: &Entrance<Raw>,
    missing: Missing,
    patience: Duration,
) {
    let (session, keys, server) = (link.session(), link.keys(), link.server().clone());
    let id = StreamId::parse(&missing.stream);
    let key = keys.stream(&id);
    let first = missing.first;
    let last = missing
        .last
        .map_or_else(String::new, |last| last.to_string());
    tracing::debug!("asking for {} {first}..{last} again", missing.stream);
    let unanswered = Unanswered {
        to: entrance.clone(),
        missing,
    };
    let asked = session
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
            unanswered.to.sample(raw, bytes, id.is_images());
        })
        .consolidation(ConsolidationMode::None)
        .accept_replies(ReplyKeyExpr::Any)
        .target(QueryTarget::All)
        .timeout(patience)
        .await;
    if let Err(problem) = asked {
        tracing::debug!("samples cannot be asked for: {problem}");
    }
}

/// Asks what runs and what has ended.
pub(super) fn ask_state(link: &Client, entrance: &Entrance<Raw>) {
    let entrance = entrance.clone();
    aside(link, move |link| {
        let reply = link.request_within(&v1::EpisodeRequest::default(), STATE_TIMEOUT);
        entrance.control(Raw::Ready(Input::State(reply.map_err(|e| e.to_string()))));
    });
}
