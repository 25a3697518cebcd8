//! Zenoh on one side, [`Recorder`] on its own thread on the other.

use std::collections::VecDeque;
use std::future::Future;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use tokio::sync::mpsc;
use wheelarm_dataset::writer::WriterOptions;
use wheelarm_proto::keys::check_name;
use wheelarm_proto::schema;
use wheelarm_proto::{Message, TopicId, v1};
use wheelarm_sdk::{Client, ClientError, session_of};
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::sample::{Sample, SampleKind};
use zenoh_ext::{AdvancedSubscriberBuilderExt, HistoryConfig, RecoveryConfig};

use super::queue::{QueueReceiver, QueueSender, queue};
use super::raw::Raw;
use super::recorder::{Input, Output, Recorder};
use super::{ExitSummary, RecordOptions};
use requests::{aside, request_samples, request_snapshot, request_state};

mod requests;

/// Period at which the newest status is published again, so that a lost one delays the
/// server no longer than this.
const STATUS_PERIOD: Duration = Duration::from_millis(500);
/// Period of the requests for the episode state.
const POLL_PERIOD: Duration = Duration::from_secs(5);
/// The transport repairs a link loss shorter than this, and the server's cache returns
/// the samples that were published meanwhile.
const AWAY_PATIENCE: Duration = Duration::from_secs(5);
/// Number of statuses that are published again: of the newest episode and of the last
/// finished ones.
const KEPT_STATUSES: usize = 3;
/// Period at which the recorder checks its deadlines.
const CORE_PERIOD: Duration = Duration::from_millis(50);
/// Longest time for one batch of inputs.
const BATCH_TIME: Duration = Duration::from_millis(5);

/// Records until `options.episodes` are done or `shutdown` completes; calls `report`
/// with every output.
///
/// # Errors
/// When the folder cannot be made, the name is taken, or the session fails.
pub async fn run(
    client: &Client,
    options: RecordOptions,
    shutdown: impl Future<Output = ()>,
    mut report: impl FnMut(&Output),
) -> anyhow::Result<ExitSummary> {
    check(client, &options).await?;
    let (session, keys) = (client.session(), client.keys());
    let writer = WriterOptions {
        depth: options.depth,
        recorder: options.name.clone(),
        scratch: options.scratch.clone(),
        ..Default::default()
    };
    let recorder = Recorder::new(options.out.clone(), writer)
        .with_limit(options.episodes)
        .with_compressed(true);
    let first = recorder.status().clone();
    let (sender, receiver) = queue();
    let (outputs, mut received) = mpsc::unbounded_channel();
    let thread = {
        let sender = sender.clone();
        std::thread::spawn(move || work(recorder, receiver, &sender, &outputs))
    };

    let _subscribers = subscribe_all(client, &sender).await?;
    let cameras = subscribe_cameras(client, &sender, true).await?;
    let _token = session
        .liveliness()
        .declare_token(keys.recorder_alive(&options.name))
        .await
        .map_err(transport("announcing the recorder"))?;
    let publisher = status_publisher(client, &options.name).await?;

    let mut handler = OutputHandler {
        client,
        sender,
        cameras,
        publisher,
        statuses: VecDeque::from([first]),
        summary: ExitSummary::default(),
        limit: options.episodes,
        connection: Connection::new(),
        ending: false,
    };
    let mut again = tokio::time::interval(STATUS_PERIOD);
    let mut poll = tokio::time::interval(POLL_PERIOD);
    let _input = options
        .end_with_stdin
        .then(|| end_with_input(handler.sender.clone()));
    tokio::pin!(shutdown);
    loop {
        tokio::select! {
            output = received.recv() => {
                let Some(output) = output else { break };
                report(&output);
                handler.carry_out(output).await;
            }
            _ = again.tick() => handler.look().await,
            _ = poll.tick(), if !handler.ending => handler.hint(),
            () = &mut shutdown, if !handler.ending => handler.end(),
        }
    }
    if thread.join().is_err() {
        bail!(
            "the recorder's thread panicked; a log it left is kept, see `wheelarm dataset recover`"
        );
    }
    Ok(handler.summary)
}

/// Carries out the outputs of a recorder on the network.
struct OutputHandler<'a> {
    client: &'a Client,
    sender: QueueSender<Raw>,
    /// Keeps the subscriber to the cameras alive.
    cameras: Subscription,
    publisher: Publisher<'static>,
    /// Newest status of each of the last episodes, newest last.
    statuses: VecDeque<v1::RecorderStatus>,
    summary: ExitSummary,
    /// Episodes after which it ends.
    limit: Option<u64>,
    connection: Connection,
    ending: bool,
}

impl OutputHandler<'_> {
    /// Carries out one output.
    async fn carry_out(&mut self, output: Output) {
        match output {
            Output::RequestSnapshot => {
                request_snapshot(self.client, &self.sender);
            }
            Output::RequestState => request_state(self.client, &self.sender),
            Output::RequestSamples { missing, patience } => {
                request_samples(self.client, &self.sender, missing, patience).await;
            }
            Output::SubscribeCameras { compressed } => {
                match subscribe_cameras(self.client, &self.sender, compressed).await {
                    Ok(cameras) => self.cameras = cameras,
                    Err(problem) => {
                        let words = format!("cannot subscribe to the cameras: {problem}");
                        self.summary.failed.push(words);
                        self.end();
                    }
                }
            }
            Output::Status(status) => {
                put(&self.publisher, &status).await;
                keep(&mut self.statuses, status);
            }
            Output::Finished(report) => self.summary.finished.push(report),
            Output::Failed(words) => self.summary.failed.push(words),
            Output::Discarded(_) | Output::Finish(_) => {}
        }
        let done = (self.summary.finished.len() + self.summary.failed.len()) as u64;
        if !self.ending && self.limit.is_some_and(|n| done >= n) {
            self.end();
        }
    }

    /// Checks the link to the server and publishes the statuses again.
    async fn look(&mut self) {
        match self.connection.poll(self.client).await {
            // A server that was restarted has another session.
            LinkState::Up if self.client.look_for_server() => self.hint(),
            LinkState::Up => {
                for status in &self.statuses {
                    put(&self.publisher, status).await;
                }
            }
            LinkState::Restored => self.hint(),
            // The liveliness token of a killed server is not withdrawn for a client
            // whose only connection was to that server.
            LinkState::Lost => self.sender.control(Raw::Ready(Input::ServerLost)),
            LinkState::Down => {}
        }
    }

    fn hint(&self) {
        self.sender.control(Raw::Ready(Input::Hint));
    }

    fn end(&mut self) {
        self.ending = true;
        self.sender.control(Raw::Ready(Input::Shutdown));
    }
}

/// Checks the options, creates the folder and claims the name.
async fn check(client: &Client, options: &RecordOptions) -> anyhow::Result<()> {
    check_name(&options.name)?;
    if options.out.to_str().is_none() {
        bail!(
            "the path of the folder {} is not UTF-8, which HDF5 requires; choose another --out",
            options.out.display()
        );
    }
    let keys = client.keys();
    std::fs::create_dir_all(&options.out)
        .with_context(|| format!("cannot create the folder {}", options.out.display()))?;
    let token = keys.recorder_alive(&options.name);
    let is_taken = aside(client, move |client| client.is_declared(&token)).await?;
    if is_taken? {
        bail!(
            "a recorder named {:?} is connected to {:?} already; choose another --name",
            options.name,
            keys.sim()
        );
    }
    // Of two recorders that start together the server accepts one.
    let claim = v1::EpisodeRequest {
        recorder: options.name.clone(),
        session: client.session().zid().to_string(),
    };
    match aside(client, move |client| client.request(&claim)).await? {
        Err(ClientError::Refused { message, .. }) => bail!(message),
        other => other.map(|_| ()).context("claiming the recorder's name"),
    }
}

async fn status_publisher(client: &Client, name: &str) -> anyhow::Result<Publisher<'static>> {
    client
        .session()
        .declare_publisher(client.keys().recorder(name))
        .encoding(schema::encoding(TopicId::Recorder.info().message))
        .congestion_control(CongestionControl::Block)
        .priority(Priority::InteractiveHigh)
        .express(true)
        .await
        .map_err(transport("declaring the status"))
}

/// The recorder's thread: decodes and feeds the recorder until it is shut down.
fn work(
    mut recorder: Recorder,
    mut receiver: QueueReceiver<Raw>,
    sender: &QueueSender<Raw>,
    outputs: &mpsc::UnboundedSender<Output>,
) {
    let mut dropped = 0;
    let mut ending = false;
    loop {
        let mut out = recorder.tick(Instant::now());
        if receiver.wait(CORE_PERIOD).is_err() {
            return;
        }
        // The receiver of the outputs has failed.
        if outputs.is_closed() {
            return;
        }
        let begun = Instant::now();
        while let Some(raw) = receiver.take() {
            let input = raw.decode();
            ending |= matches!(input, Input::Shutdown);
            out.extend(recorder.handle(input, Instant::now()));
            // A lock-step server waits for the status, and deadlines are checked.
            if begun.elapsed() >= BATCH_TIME {
                break;
            }
        }
        out.extend(recorder.flush());
        drop_superseded(&mut out);
        if receiver.dropped() != dropped {
            tracing::warn!(
                "{} samples were dropped: this host cannot write fast enough; use fewer or smaller images, or lock-step pacing",
                receiver.dropped() - dropped
            );
            dropped = receiver.dropped();
        }
        for output in out {
            let output = match output {
                Output::Finish(finishing) => {
                    let sender = sender.clone();
                    std::thread::spawn(move || {
                        sender.control(Raw::Ready(Input::Done(finishing.run())))
                    });
                    continue;
                }
                output => output,
            };
            if outputs.send(output).is_err() {
                return;
            }
        }
        if ending && recorder.is_done() {
            return;
        }
    }
}

/// Removes each status that is directly followed by one of the same episode and state.
fn drop_superseded(out: &mut Vec<Output>) {
    let of = |status: &v1::RecorderStatus| {
        let header = status.header.as_ref();
        let episode = header.map(|h| (h.run_id.clone(), h.episode));
        (episode, status.state)
    };
    let mut following = None;
    let mut kept: Vec<_> = std::mem::take(out);
    kept.reverse();
    kept.retain(|output| {
        let this = match output {
            Output::Status(status) => Some(of(status)),
            _ => None,
        };
        let is_newest = this.is_none() || this != following;
        following = this;
        is_newest
    });
    kept.reverse();
    *out = kept;
}

/// Keeps a subscriber alive.
type Subscription = Box<dyn std::any::Any + Send>;
type Subscriptions = Vec<Subscription>;

/// Puts the samples of the server's streams into the queue.
fn to_queue(client: &Client, sender: &QueueSender<Raw>) -> impl Fn(Sample) + Send + Sync + use<> {
    let (to, server, keys) = (
        sender.clone(),
        client.server().clone(),
        client.keys().clone(),
    );
    move |sample: Sample| {
        if !server.sent(&sample) {
            return;
        }
        let Some(stream) = keys.stream_of(sample.key_expr().as_str()) else {
            return;
        };
        let (payload, is_images) = (sample.payload().clone(), stream.is_images());
        let bytes = payload.len();
        to.sample(Raw::Sample(stream, payload), bytes, is_images);
    }
}

/// Subscribes to the state streams.
async fn subscribe_states(
    client: &Client,
    sender: &QueueSender<Raw>,
) -> anyhow::Result<Subscription> {
    let samples = client
        .session()
        .declare_subscriber(client.keys().streams())
        .callback(to_queue(client, sender))
        // The cache holds samples that were published before this subscription
        // existed; the recorder drops those of other episodes.
        .history(HistoryConfig::default().detect_late_publishers())
        .recovery(RecoveryConfig::default().heartbeat())
        .await
        .map_err(transport("subscribing to the streams"))?;
    Ok(Box::new(samples))
}

/// Subscribes to the images of `key`, without recovery by the transport: it would request
/// images that are still in flight on a slow line, and images from before the episode.
async fn subscribe_images(
    client: &Client,
    sender: &QueueSender<Raw>,
    key: String,
) -> anyhow::Result<Subscription> {
    let samples = client
        .session()
        .declare_subscriber(key)
        .callback(to_queue(client, sender))
        .await
        .map_err(transport("subscribing to the images"))?;
    Ok(Box::new(samples))
}

/// Subscribes to the cameras, to compressed or exact images.
async fn subscribe_cameras(
    client: &Client,
    sender: &QueueSender<Raw>,
    compressed: bool,
) -> anyhow::Result<Subscription> {
    let topic = match compressed {
        true => TopicId::CompressedCamera,
        false => TopicId::Camera,
    };
    subscribe_images(client, sender, client.keys().topic(topic)).await
}

async fn subscribe_all(
    client: &Client,
    sender: &QueueSender<Raw>,
) -> anyhow::Result<Subscriptions> {
    let (session, keys) = (client.session(), client.keys());
    let from = || client.server().clone();
    let mut subscriptions: Subscriptions = Vec::new();
    // A declared key saves the lookup of the receivers for each sample.
    for topic in TopicId::STATES {
        let key = session.declare_keyexpr(keys.topic(topic)).await;
        subscriptions.push(Box::new(key.map_err(transport("declaring a stream"))?));
    }
    let recovery = || RecoveryConfig::default().heartbeat();

    subscriptions.push(subscribe_states(client, sender).await?);
    subscriptions.push(subscribe_images(client, sender, keys.topic(TopicId::Sensor)).await?);

    for key in [TopicId::EpisodeStart, TopicId::EpisodeStop].map(|t| keys.topic(t)) {
        let (to, server) = (sender.clone(), from());
        let hints = session
            .declare_subscriber(key)
            .callback(move |sample: Sample| {
                if server.sent(&sample) {
                    to.control(Raw::Ready(Input::Hint));
                }
            })
            .recovery(recovery())
            .await
            .map_err(transport("subscribing to the episodes"))?;
        subscriptions.push(Box::new(hints));
    }

    let (to, server) = (sender.clone(), from());
    let alive = session
        .liveliness()
        .declare_subscriber(keys.alive("*"))
        .callback(move |sample: Sample| {
            let ours = session_of(&sample).is_some_and(|id| server.is(id));
            match sample.kind() {
                SampleKind::Delete if ours => to.control(Raw::Ready(Input::ServerLost)),
                SampleKind::Delete => {}
                SampleKind::Put => to.control(Raw::Ready(Input::Hint)),
            }
        })
        .await
        .map_err(transport("watching the server"))?;
    subscriptions.push(Box::new(alive));
    Ok(subscriptions)
}

/// Ends the recorder when its standard input closes.
fn end_with_input(sender: QueueSender<Raw>) -> std::thread::JoinHandle<()> {
    std::thread::spawn(move || {
        let _ = std::io::copy(&mut std::io::stdin().lock(), &mut std::io::sink());
        sender.control(Raw::Ready(Input::Shutdown));
    })
}

/// State of the link to the server.
struct Connection {
    since: Option<Instant>,
    lost: bool,
}

/// Result of [`Connection::poll`].
enum LinkState {
    Up,
    /// Up again after a link loss.
    Restored,
    Down,
    /// Down for so long that the server counts as gone.
    Lost,
}

impl Connection {
    fn new() -> Self {
        Self {
            since: None,
            lost: false,
        }
    }

    async fn poll(&mut self, client: &Client) -> LinkState {
        let info = client.session().info();
        let there = client.is_within()
            || info.routers_zid().await.next().is_some()
            || info.peers_zid().await.next().is_some();
        if there {
            self.lost = false;
            return match self.since.take() {
                Some(_) => LinkState::Restored,
                None => LinkState::Up,
            };
        }
        let since = *self.since.get_or_insert_with(Instant::now);
        if self.lost || since.elapsed() < AWAY_PATIENCE {
            return LinkState::Down;
        }
        self.lost = true;
        LinkState::Lost
    }
}

/// Keeps the newest status of each of the last episodes, newest last.
fn keep(statuses: &mut VecDeque<v1::RecorderStatus>, status: v1::RecorderStatus) {
    let same = |s: &v1::RecorderStatus| {
        let (a, b) = (s.header.as_ref(), status.header.as_ref());
        a.zip(b)
            .is_some_and(|(a, b)| a.run_id == b.run_id && a.episode == b.episode)
    };
    match statuses.iter_mut().find(|s| same(s)) {
        Some(old) => *old = status,
        None => statuses.push_back(status),
    }
    while statuses.len() > KEPT_STATUSES {
        statuses.pop_front();
    }
}

async fn put(publisher: &Publisher<'_>, status: &v1::RecorderStatus) {
    if let Err(problem) = publisher.put(status.encode_to_vec()).await {
        tracing::warn!("cannot publish the recorder's status: {problem}");
    }
}

fn transport(operation: &'static str) -> impl Fn(zenoh::Error) -> anyhow::Error {
    move |cause| anyhow::anyhow!("{operation}: {cause}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_consecutive_statuses_the_newest_is_published() {
        let status = |episode, state: v1::RecorderState, frames| {
            Output::Status(v1::RecorderStatus {
                header: Some(v1::Header {
                    episode,
                    ..Default::default()
                }),
                state: state.into(),
                accepted_frames: frames,
                ..Default::default()
            })
        };
        let ready = |frames| status(1, v1::RecorderState::Ready, frames);
        let finishing = || status(1, v1::RecorderState::Finishing, 4);
        let other = || status(2, v1::RecorderState::Finishing, 0);
        let mut out = vec![
            ready(1),
            ready(2),
            Output::RequestState,
            ready(3),
            ready(4),
            finishing(),
            other(),
        ];
        drop_superseded(&mut out);
        let published: Vec<_> = out
            .iter()
            .map(|output| match output {
                Output::Status(s) => (
                    s.header.as_ref().map_or(0, |h| h.episode),
                    s.accepted_frames,
                ),
                _ => (0, 0),
            })
            .collect();
        assert_eq!(published, [(1, 2), (0, 0), (1, 4), (1, 4), (2, 0)]);
    }
}
