//! Zenoh on one side, [`RecorderCore`] on its own thread on the other.

use std::future::Future;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use bytes::Bytes;
use tokio::sync::mpsc;
use wheelarm_dataset::writer::WriterOptions;
use wheelarm_proto::keys::{Keys, Query, check_name};
use wheelarm_proto::{Message, v1};
use zenoh::Session;
use zenoh::bytes::ZBytes;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::sample::{Sample, SampleKind};
use zenoh_ext::{AdvancedSubscriberBuilderExt, HistoryConfig, RecoveryConfig};

use super::core::{Input, Output, RecorderCore};
use super::queue::{Entrance, Exit, queue};
use super::{ExitSummary, RecordArgs};

/// The newest status is published again after this time: a lost one holds
/// nobody up for longer.
const STATUS_PERIOD: Duration = Duration::from_millis(500);
/// The server is asked what it runs after this time.
const POLL_PERIOD: Duration = Duration::from_secs(5);
/// How often the core looks at its deadlines.
const CORE_PERIOD: Duration = Duration::from_millis(50);
/// Longest wait for the answer to a query.
const QUERY_TIMEOUT: Duration = Duration::from_secs(10);

/// What callbacks put into the queue: undecoded.
#[allow(
    clippy::large_enum_variant,
    reason = "one such message per episode; samples are the small ones"
)]
enum Raw {
    Stream(String, ZBytes),
    Camera(String, ZBytes),
    Start(ZBytes),
    Stop(ZBytes),
    Ready(Input),
}

/// Records until `args.episodes` are done or `shutdown` completes; prints a
/// line per episode.
///
/// # Errors
/// When the folder cannot be made, the name is taken, or the session fails.
pub async fn run(
    session: Session,
    keys: Keys,
    args: RecordArgs,
    shutdown: impl Future<Output = ()>,
) -> anyhow::Result<ExitSummary> {
    run_with(session, keys, args, shutdown, |output| match output {
        Output::Finished(r) => {
            let state = if r.complete { "complete" } else { "PARTIAL" };
            let mb = r.bytes as f64 / 1e6;
            println!(
                "{}: {state}, {} frames, {} samples, {} missed, {mb:.1} MB",
                r.path.display(),
                r.frames,
                r.samples,
                r.missed
            );
            for problem in &r.problems {
                println!("  {problem}");
            }
        }
        Output::Failed(words) => eprintln!("recording failed: {words}"),
        Output::Discarded(label) => println!("{label}: discarded"),
        Output::AskSnapshot | Output::AskStatus | Output::Status(_) => {}
    })
    .await
}

/// As [`run`], telling every output to `tell`.
///
/// # Errors
/// As [`run`].
pub async fn run_with(
    session: Session,
    keys: Keys,
    args: RecordArgs,
    shutdown: impl Future<Output = ()>,
    mut tell: impl FnMut(&Output),
) -> anyhow::Result<ExitSummary> {
    check_name(&args.name)?;
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("the folder {} cannot be made", args.out.display()))?;
    if taken(&session, &keys.recorder_alive(&args.name)).await? {
        bail!(
            "a recorder named {:?} is connected to {:?} already; choose another --name",
            args.name,
            keys.sim()
        );
    }
    let options = WriterOptions {
        depth: args.depth.into(),
        recorder: args.name.clone(),
        ..Default::default()
    };
    let core = RecorderCore::new(args.out.clone(), options);
    let first = core.status().clone();
    let (entrance, exit) = queue();
    let (outputs, mut told) = mpsc::unbounded_channel();
    let thread = std::thread::spawn(move || work(core, &exit, &outputs));

    let _subscribers = subscribe(&session, &keys, &entrance).await?;
    let _token = session
        .liveliness()
        .declare_token(keys.recorder_alive(&args.name))
        .await
        .map_err(transport("announcing the recorder"))?;
    let publisher = session
        .declare_publisher(keys.recorder(&args.name))
        .congestion_control(CongestionControl::Block)
        .priority(Priority::InteractiveHigh)
        .express(true)
        .await
        .map_err(transport("declaring the status"))?;

    let mut latest = first;
    let mut summary = ExitSummary::default();
    let mut again = tokio::time::interval(STATUS_PERIOD);
    let mut poll = tokio::time::interval(POLL_PERIOD);
    let mut ending = false;
    tokio::pin!(shutdown);
    loop {
        tokio::select! {
            output = told.recv() => {
                let Some(output) = output else { break };
                tell(&output);
                match output {
                    Output::AskSnapshot => {
                        tokio::spawn(ask_snapshot(session.clone(), keys.clone(), entrance.clone()));
                    }
                    Output::AskStatus => {
                        tokio::spawn(ask_status(session.clone(), keys.clone(), entrance.clone()));
                    }
                    Output::Status(status) => {
                        latest = status;
                        put(&publisher, &latest).await;
                    }
                    Output::Finished(report) => summary.finished.push(report),
                    Output::Failed(words) => summary.failed.push(words),
                    Output::Discarded(_) => {}
                }
                let done = (summary.finished.len() + summary.failed.len()) as u64;
                if !ending && args.episodes.is_some_and(|n| done >= n) {
                    ending = true;
                    entrance.control(Raw::Ready(Input::Shutdown));
                }
            }
            _ = again.tick() => put(&publisher, &latest).await,
            _ = poll.tick(), if !ending => {
                tokio::spawn(ask_status(session.clone(), keys.clone(), entrance.clone()));
            }
            () = &mut shutdown, if !ending => {
                ending = true;
                entrance.control(Raw::Ready(Input::Shutdown));
            }
        }
    }
    if thread.join().is_err() {
        bail!(
            "the recorder's thread panicked; a log it left is kept, see `wheelarm dataset recover`"
        );
    }
    Ok(summary)
}

/// The recorder's thread: decodes and feeds the core until it is shut down.
fn work(mut core: RecorderCore, exit: &Exit<Raw>, outputs: &mpsc::UnboundedSender<Output>) {
    let mut dropped = 0;
    loop {
        let mut out = core.tick(Instant::now());
        let Ok(item) = exit.next(CORE_PERIOD) else {
            return;
        };
        let input = item.and_then(decode);
        let last = matches!(input, Some(Input::Shutdown));
        if let Some(input) = input {
            out.extend(core.handle(input, Instant::now()));
        }
        if exit.dropped() != dropped {
            tracing::warn!(
                "{} samples were dropped: this host cannot compress and write fast enough; use --depth u16, fewer pictures, or lock-step pacing",
                exit.dropped() - dropped
            );
            dropped = exit.dropped();
        }
        for output in out {
            if outputs.send(output).is_err() {
                return;
            }
        }
        if last {
            return;
        }
    }
}

fn decode(raw: Raw) -> Option<Input> {
    fn message<M: Message + Default>(payload: &ZBytes, what: &str) -> Option<M> {
        M::decode(payload.to_bytes().as_ref())
            .inspect_err(|e| tracing::warn!("{what} cannot be read: {e}"))
            .ok()
    }
    let owned = |payload: ZBytes| Bytes::from(payload.to_bytes().into_owned());
    match raw {
        Raw::Ready(input) => Some(input),
        Raw::Start(payload) => message(&payload, "episode/start").map(Input::Started),
        Raw::Stop(payload) => message(&payload, "episode/stop").map(Input::Stopped),
        Raw::Stream(stream, payload) => Some(Input::Sample {
            stream,
            payload: owned(payload),
        }),
        Raw::Camera(camera, payload) => Some(Input::Sample {
            stream: format!("camera/{camera}"),
            payload: owned(payload),
        }),
    }
}

/// Keeps the subscribers alive.
type Held = Vec<Box<dyn std::any::Any + Send>>;

async fn subscribe(
    session: &Session,
    keys: &Keys,
    entrance: &Entrance<Raw>,
) -> anyhow::Result<Held> {
    fn last(sample: &Sample) -> String {
        let key = sample.key_expr().as_str();
        key.rsplit('/').next().unwrap_or_default().to_owned()
    }
    let mut held: Held = Vec::new();
    // The cache holds samples that were published before this subscription
    // was known: of a running episode they are wanted, others are left out.
    let history = || HistoryConfig::default().detect_late_publishers();
    let recovery = || RecoveryConfig::default().heartbeat();

    let to = entrance.clone();
    let streams = session
        .declare_subscriber(keys.stream("*"))
        .callback(move |sample: Sample| {
            let bytes = sample.payload().len();
            let raw = Raw::Stream(last(&sample), sample.payload().clone());
            to.sample(raw, bytes, false);
        })
        .history(history())
        .recovery(recovery())
        .await
        .map_err(transport("subscribing to the streams"))?;
    held.push(Box::new(streams));

    let to = entrance.clone();
    let cameras = session
        .declare_subscriber(keys.camera("*"))
        .callback(move |sample: Sample| {
            let bytes = sample.payload().len();
            let raw = Raw::Camera(last(&sample), sample.payload().clone());
            to.sample(raw, bytes, true);
        })
        .history(history())
        .recovery(recovery())
        .await
        .map_err(transport("subscribing to the cameras"))?;
    held.push(Box::new(cameras));

    let to = entrance.clone();
    let start = session
        .declare_subscriber(keys.episode_start())
        .callback(move |sample: Sample| to.control(Raw::Start(sample.payload().clone())))
        .recovery(recovery())
        .await
        .map_err(transport("subscribing to the start of episodes"))?;
    held.push(Box::new(start));

    let to = entrance.clone();
    let stop = session
        .declare_subscriber(keys.episode_stop())
        .callback(move |sample: Sample| to.control(Raw::Stop(sample.payload().clone())))
        .recovery(recovery())
        .await
        .map_err(transport("subscribing to the end of episodes"))?;
    held.push(Box::new(stop));

    let to = entrance.clone();
    let alive = session
        .liveliness()
        .declare_subscriber(keys.alive())
        .callback(move |sample: Sample| {
            if sample.kind() == SampleKind::Delete {
                to.control(Raw::Ready(Input::ServerLost));
            }
        })
        .await
        .map_err(transport("watching the server"))?;
    held.push(Box::new(alive));
    Ok(held)
}

/// Whether somebody holds the token already.
async fn taken(session: &Session, token: &str) -> anyhow::Result<bool> {
    let replies = session
        .liveliness()
        .get(token)
        .timeout(Duration::from_secs(1))
        .await
        .map_err(transport("asking for other recorders"))?;
    while let Ok(reply) = replies.recv_async().await {
        if reply.result().is_ok() {
            return Ok(true);
        }
    }
    Ok(false)
}

async fn put(publisher: &zenoh::pubsub::Publisher<'_>, status: &v1::RecorderStatus) {
    if let Err(problem) = publisher.put(status.encode_to_vec()).await {
        tracing::warn!("the recorder's status cannot be published: {problem}");
    }
}

async fn ask_snapshot(session: Session, keys: Keys, entrance: Entrance<Raw>) {
    let reply = ask(&session, keys.query(Query::Snapshot)).await;
    entrance.control(Raw::Ready(Input::Snapshot(reply)));
}

/// Learns of an episode that runs already, or of an end that got lost.
async fn ask_status(session: Session, keys: Keys, entrance: Entrance<Raw>) {
    let asked = Instant::now();
    let status: v1::Status = match ask(&session, keys.query(Query::Status)).await {
        Ok(status) => status,
        Err(words) => {
            tracing::debug!("no status: {words}");
            return;
        }
    };
    let run_id = status.header.map(|h| h.run_id).unwrap_or_default();
    let number = |s: &v1::EpisodeStarted| s.header.as_ref().map_or(0, |h| h.episode);
    entrance.control(Raw::Ready(Input::Running {
        asked,
        run_id,
        episode: status.episode.as_ref().map_or(0, number),
    }));
    if let Some(started) = status.episode {
        entrance.control(Raw::Ready(Input::Started(started)));
    }
}

async fn ask<R: Message + Default>(session: &Session, key: String) -> Result<R, String> {
    let replies = session
        .get(&key)
        .priority(Priority::InteractiveHigh)
        .express(true)
        .timeout(QUERY_TIMEOUT)
        .await
        .map_err(|e| e.to_string())?;
    let reply = replies
        .recv_async()
        .await
        .map_err(|_| format!("nobody answers {key}"))?;
    match reply.result() {
        Ok(sample) => R::decode(sample.payload().to_bytes().as_ref()).map_err(|e| e.to_string()),
        Err(error) => {
            let failure = v1::Failure::decode(error.payload().to_bytes().as_ref());
            Err(failure.map_or_else(|e| e.to_string(), |f| f.message))
        }
    }
}

fn transport(operation: &'static str) -> impl Fn(zenoh::Error) -> anyhow::Error {
    move |cause| anyhow::anyhow!("{operation}: {cause}")
}
