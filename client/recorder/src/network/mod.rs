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

use super::queue::{Entrance, Exit, queue};
use super::raw::Raw;
use super::recorder::{Input, Output, Recorder};
use super::{ExitSummary, RecordOptions};
use asking::{aside, ask_samples, ask_snapshot, ask_state};

mod asking;

/// The newest status is published again after this time: a lost one holds
/// nobody up for longer.
const STATUS_PERIOD: Duration = Duration::from_millis(500);
/// The server is asked what it runs after this time.
const POLL_PERIOD: Duration = Duration::from_secs(5);
/// A connection that is away for less than this is repaired by the transport,
/// and what was published meanwhile comes out of the server's cache.
const AWAY_PATIENCE: Duration = Duration::from_secs(5);
/// Statuses that are published again: of the newest episode and of those that
/// became files lately.
const KEPT_STATUSES: usize = 3;
/// How often the recorder looks at its deadlines.
const CORE_PERIOD: Duration = Duration::from_millis(50);
/// Longest time for what came together.
const BATCH_TIME: Duration = Duration::from_millis(5);

/// Records until `options.episodes` are done or `shutdown` completes; every
/// output is told to `tell`.
///
/// # Errors
/// When the folder cannot be made, the name is taken, or the session fails.
pub async fn run(
    link: &Client,
    options: RecordOptions,
    shutdown: impl Future<Output = ()>,
    mut tell: impl FnMut(&Output),
) -> anyhow::Result<ExitSummary> {
    check(link, &options).await?;
    let (session, keys) = (link.session(), link.keys());
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
    let (entrance, exit) = queue();
    let (outputs, mut told) = mpsc::unbounded_channel();
    let thread = {
        let entrance = entrance.clone();
        std::thread::spawn(move || work(recorder, exit, &entrance, &outputs))
    };

    let _subscribers = subscribe(link, &entrance).await?;
    let cameras = hear_cameras(link, &entrance, true).await?;
    let _token = session
        .liveliness()
        .declare_token(keys.recorder_alive(&options.name))
        .await
        .map_err(transport("announcing the recorder"))?;
    let publisher = status_publisher(link, &options.name).await?;

    let mut desk = Desk {
        link,
        entrance,
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
        .then(|| end_with_input(desk.entrance.clone()));
    tokio::pin!(shutdown);
    loop {
        tokio::select! {
            output = told.recv() => {
                let Some(output) = output else { break };
                tell(&output);
                desk.carry_out(output).await;
            }
            _ = again.tick() => desk.look().await,
            _ = poll.tick(), if !desk.ending => desk.hint(),
            () = &mut shutdown, if !desk.ending => desk.end(),
        }
    }
    if thread.join().is_err() {
        bail!(
            "the recorder's thread panicked; a log it left is kept, see `wheelarm dataset recover`"
        );
    }
    Ok(desk.summary)
}

/// What a recorder does on the network, and what it has to remember for that.
struct Desk<'a> {
    link: &'a Client,
    entrance: Entrance<Raw>,
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

impl Desk<'_> {
    /// Does what the recorder wants done.
    async fn carry_out(&mut self, output: Output) {
        match output {
            Output::AskSnapshot => {
                ask_snapshot(self.link, &self.entrance);
            }
            Output::AskState => ask_state(self.link, &self.entrance),
            Output::AskSamples { missing, patience } => {
                ask_samples(self.link, &self.entrance, missing, patience).await;
            }
            Output::Hear { compressed } => {
                match hear_cameras(self.link, &self.entrance, compressed).await {
                    Ok(cameras) => self.cameras = cameras,
                    Err(problem) => {
                        let words = format!("the cameras are not heard: {problem}");
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

    /// Looks whether the server is there, and publishes the status again.
    async fn look(&mut self) {
        match self.connection.look(self.link).await {
            // A server that was restarted has another session.
            Seen::There if self.link.look_for_server() => self.hint(),
            Seen::There => {
                for status in &self.statuses {
                    put(&self.publisher, status).await;
                }
            }
            Seen::Back => self.hint(),
            // A killed server takes its liveliness token back for nobody
            // whose only link was the one to it.
            Seen::Lost => self.entrance.control(Raw::Ready(Input::ServerLost)),
            Seen::Away => {}
        }
    }

    fn hint(&self) {
        self.entrance.control(Raw::Ready(Input::Hint));
    }

    fn end(&mut self) {
        self.ending = true;
        self.entrance.control(Raw::Ready(Input::Shutdown));
    }
}

/// Checks the options, makes the folder, and sees that the name is free.
async fn check(link: &Client, options: &RecordOptions) -> anyhow::Result<()> {
    check_name(&options.name)?;
    if options.out.to_str().is_none() {
        bail!(
            "the folder {} is not in UTF-8, which HDF5 cannot take; choose another --out",
            options.out.display()
        );
    }
    let keys = link.keys();
    std::fs::create_dir_all(&options.out)
        .with_context(|| format!("the folder {} cannot be made", options.out.display()))?;
    let token = keys.recorder_alive(&options.name);
    let is_taken = aside(link, move |link| link.is_declared(&token)).await?;
    if is_taken? {
        bail!(
            "a recorder named {:?} is connected to {:?} already; choose another --name",
            options.name,
            keys.sim()
        );
    }
    // Of two that start together the server takes one.
    let claim = v1::EpisodeRequest {
        recorder: options.name.clone(),
        session: link.session().zid().to_string(),
    };
    match aside(link, move |link| link.request(&claim)).await? {
        Err(ClientError::Refused { message, .. }) => bail!(message),
        other => other.map(|_| ()).context("claiming the recorder's name"),
    }
}

async fn status_publisher(link: &Client, name: &str) -> anyhow::Result<Publisher<'static>> {
    link.session()
        .declare_publisher(link.keys().recorder(name))
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
    mut exit: Exit<Raw>,
    entrance: &Entrance<Raw>,
    outputs: &mpsc::UnboundedSender<Output>,
) {
    let mut dropped = 0;
    let mut ending = false;
    loop {
        let mut out = recorder.tick(Instant::now());
        if exit.wait(CORE_PERIOD).is_err() {
            return;
        }
        // Whoever carries the outputs out has failed.
        if outputs.is_closed() {
            return;
        }
        let begun = Instant::now();
        while let Some(raw) = exit.take() {
            let input = raw.decode();
            ending |= matches!(input, Input::Shutdown);
            out.extend(recorder.handle(input, Instant::now()));
            // A lock-step server waits for the status, and deadlines are looked at.
            if begun.elapsed() >= BATCH_TIME {
                break;
            }
        }
        out.extend(recorder.flush());
        newest_status(&mut out);
        if exit.dropped() != dropped {
            tracing::warn!(
                "{} samples were dropped: this host cannot write fast enough; use fewer or smaller pictures, or lock-step pacing",
                exit.dropped() - dropped
            );
            dropped = exit.dropped();
        }
        for output in out {
            let output = match output {
                Output::Finish(finishing) => {
                    let entrance = entrance.clone();
                    std::thread::spawn(move || {
                        entrance.control(Raw::Ready(Input::Done(finishing.run())))
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

/// Leaves out statuses that another one of the same kind follows at once.
fn newest_status(out: &mut Vec<Output>) {
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
type Held = Vec<Subscription>;

/// Puts the samples of the server's streams into the queue.
fn to_queue(link: &Client, entrance: &Entrance<Raw>) -> impl Fn(Sample) + Send + Sync + use<> {
    let (to, server, keys) = (entrance.clone(), link.server().clone(), link.keys().clone());
    move |sample: Sample| {
        if !server.sent(&sample) {
            return;
        }
        let Some(stream) = keys.stream_of(sample.key_expr().as_str()) else {
            return;
        };
        let (payload, pictures) = (sample.payload().clone(), stream.is_images());
        let bytes = payload.len();
        to.sample(Raw::Sample(stream, payload), bytes, pictures);
    }
}

/// Listens to the states.
async fn hear_states(link: &Client, entrance: &Entrance<Raw>) -> anyhow::Result<Subscription> {
    let samples = link
        .session()
        .declare_subscriber(link.keys().streams())
        .callback(to_queue(link, entrance))
        // The cache holds samples that were published before this subscription
        // was known: of a running episode they are wanted, others are left out.
        .history(HistoryConfig::default().detect_late_publishers())
        .recovery(RecoveryConfig::default().heartbeat())
        .await
        .map_err(transport("subscribing to the streams"))?;
    Ok(Box::new(samples))
}

/// Listens to the pictures below `key`. What lacks is asked for by the recorder alone: the
/// transport would ask for what is still under way on a slow line, and for pictures of
/// the time before the episode.
async fn hear_pictures(
    link: &Client,
    entrance: &Entrance<Raw>,
    key: String,
) -> anyhow::Result<Subscription> {
    let samples = link
        .session()
        .declare_subscriber(key)
        .callback(to_queue(link, entrance))
        .await
        .map_err(transport("subscribing to the pictures"))?;
    Ok(Box::new(samples))
}

/// Listens to the cameras, compressed or as they are.
async fn hear_cameras(
    link: &Client,
    entrance: &Entrance<Raw>,
    compressed: bool,
) -> anyhow::Result<Subscription> {
    let topic = match compressed {
        true => TopicId::CompressedCamera,
        false => TopicId::Camera,
    };
    hear_pictures(link, entrance, link.keys().topic(topic)).await
}

async fn subscribe(link: &Client, entrance: &Entrance<Raw>) -> anyhow::Result<Held> {
    let (session, keys) = (link.session(), link.keys());
    let from = || link.server().clone();
    let mut held: Held = Vec::new();
    // Where a key is declared, who gets its samples is not looked up for each.
    for topic in TopicId::STATES {
        let key = session.declare_keyexpr(keys.topic(topic)).await;
        held.push(Box::new(key.map_err(transport("declaring a stream"))?));
    }
    let recovery = || RecoveryConfig::default().heartbeat();

    held.push(hear_states(link, entrance).await?);
    held.push(hear_pictures(link, entrance, keys.topic(TopicId::Sensor)).await?);

    for key in [TopicId::EpisodeStart, TopicId::EpisodeStop].map(|t| keys.topic(t)) {
        let (to, server) = (entrance.clone(), from());
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
        held.push(Box::new(hints));
    }

    let (to, server) = (entrance.clone(), from());
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
    held.push(Box::new(alive));
    Ok(held)
}

/// Ends the recorder with its standard input: with the program that holds it.
fn end_with_input(entrance: Entrance<Raw>) -> std::thread::JoinHandle<()> {
    std::thread::spawn(move || {
        let _ = std::io::copy(&mut std::io::stdin().lock(), &mut std::io::sink());
        entrance.control(Raw::Ready(Input::Shutdown));
    })
}

/// Whether the way to the server stands.
struct Connection {
    since: Option<Instant>,
    lost: bool,
}

/// What a look at the connection showed.
enum Seen {
    There,
    /// It is there again.
    Back,
    Away,
    /// It is away for so long that the server must be taken for gone.
    Lost,
}

impl Connection {
    fn new() -> Self {
        Self {
            since: None,
            lost: false,
        }
    }

    async fn look(&mut self, link: &Client) -> Seen {
        let info = link.session().info();
        let there = link.is_within()
            || info.routers_zid().await.next().is_some()
            || info.peers_zid().await.next().is_some();
        if there {
            self.lost = false;
            return match self.since.take() {
                Some(_) => Seen::Back,
                None => Seen::There,
            };
        }
        let since = *self.since.get_or_insert_with(Instant::now);
        if self.lost || since.elapsed() < AWAY_PATIENCE {
            return Seen::Away;
        }
        self.lost = true;
        Seen::Lost
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
        tracing::warn!("the recorder's status cannot be published: {problem}");
    }
}

fn transport(operation: &'static str) -> impl Fn(zenoh::Error) -> anyhow::Error {
    move |cause| anyhow::anyhow!("{operation}: {cause}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_statuses_that_follow_each_other_the_newest_is_told() {
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
            Output::AskState,
            ready(3),
            ready(4),
            finishing(),
            other(),
        ];
        newest_status(&mut out);
        let told: Vec<_> = out
            .iter()
            .map(|output| match output {
                Output::Status(s) => (
                    s.header.as_ref().map_or(0, |h| h.episode),
                    s.accepted_frames,
                ),
                _ => (0, 0),
            })
            .collect();
        assert_eq!(told, [(1, 2), (0, 0), (1, 4), (1, 4), (2, 0)]);
    }
}
