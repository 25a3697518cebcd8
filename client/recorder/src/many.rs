//! One recorder process for every server behind a router: each server gets its own
//! recorder and folder as soon as its liveliness token appears.

use std::collections::BTreeSet;
use std::future::Future;

use anyhow::{Context, anyhow};
use tokio::sync::{mpsc, watch};
use tokio::task::JoinSet;
use wheelarm_proto::keys::Keys;
use zenoh::Session;
use zenoh::sample::SampleKind;

use wheelarm_sdk::Client;

use super::network::run;
use super::{ExitSummary, Output, RecordOptions};

/// Events of several servers, each with the server's name.
#[derive(Debug)]
pub enum ServerEvent<'a> {
    /// Recording of the server starts.
    Recording(&'a str),
    /// An output of the server's recorder.
    Output(&'a str, &'a Output),
    /// The server is not recorded, with the reason.
    NotRecorded(&'a str, &'a anyhow::Error),
}

/// Records the episodes of every server that `session` reaches, each into the folder
/// `options.out`/NAME, until `options.episodes` in total are done or `shutdown` completes.
///
/// # Errors
/// When the servers cannot be watched. A server whose recorder fails is reported as
/// [`ServerEvent::NotRecorded`] and skipped until it returns.
pub async fn run_many(
    session: &Session,
    endpoint: &str,
    options: &RecordOptions,
    shutdown: impl Future<Output = ()>,
    report: impl Fn(&ServerEvent<'_>) + Clone + Send + Sync + 'static,
) -> anyhow::Result<ExitSummary> {
    let servers = session
        .liveliness()
        .declare_subscriber(Keys::all_alive())
        .history(true)
        .await
        .map_err(|e| anyhow!("watching for servers: {e}"))?;
    let (end, ended) = watch::channel(false);
    let (episodes, mut done) = mpsc::unbounded_channel();
    let mut recorders = JoinSet::new();
    let mut joined = BTreeSet::new();
    let mut summary = ExitSummary::default();
    let mut left = options.episodes;
    tokio::pin!(shutdown);
    while !*ended.borrow() {
        tokio::select! {
            sample = servers.recv_async() => {
                let sample = sample.map_err(|e| anyhow!("watching for servers: {e}"))?;
                let Some((sim, _)) = Keys::server_of(sample.key_expr().as_str()) else { continue };
                // The recorder itself handles the loss of its server: it closes the
                // episode and records the next one when the server returns.
                if sample.kind() == SampleKind::Put && joined.insert(sim.clone()) {
                    let client = Client::over(session.clone(), endpoint, &sim)?;
                    report(&ServerEvent::Recording(&sim));
                    let (ended, episodes) = (ended.clone(), episodes.clone());
                    recorders.spawn(one(client, sim, options.clone(), ended, episodes, report.clone()));
                }
            }
            Some(()) = done.recv() => {
                left = left.map(|left| left.saturating_sub(1));
                if left == Some(0) {
                    end.send_replace(true);
                }
            }
            Some(result) = recorders.join_next(), if !recorders.is_empty() => {
                let (sim, result) = result.context("a recorder panicked")?;
                joined.remove(&sim);
                add(&mut summary, &sim, result, &report);
            }
            () = &mut shutdown => {
                end.send_replace(true);
            }
        }
    }
    while let Some(result) = recorders.join_next().await {
        let (sim, result) = result.context("a recorder panicked")?;
        add(&mut summary, &sim, result, &report);
    }
    Ok(summary)
}

/// Records one server into a folder of its name.
async fn one(
    client: Client,
    sim: String,
    options: RecordOptions,
    mut ended: watch::Receiver<bool>,
    episodes: mpsc::UnboundedSender<()>,
    report: impl Fn(&ServerEvent<'_>),
) -> (String, anyhow::Result<ExitSummary>) {
    let options = RecordOptions {
        out: options.out.join(&sim),
        scratch: options.scratch.map(|scratch| scratch.join(&sim)),
        // Episodes are counted over all servers.
        episodes: None,
        ..options
    };
    let shutdown = async move {
        // A dropped sender ends the recorder as well.
        let _ = ended.wait_for(|ended| *ended).await;
    };
    let result = run(&client, options, shutdown, |output| {
        report(&ServerEvent::Output(&sim, output));
        if matches!(output, Output::Finished(_) | Output::Failed(_)) {
            // The receiver is dropped near the end.
            let _ = episodes.send(());
        }
    })
    .await;
    (sim, result)
}

fn add(
    summary: &mut ExitSummary,
    sim: &str,
    result: anyhow::Result<ExitSummary>,
    report: &impl Fn(&ServerEvent<'_>),
) {
    match result {
        Ok(more) => {
            summary.finished.extend(more.finished);
            summary.failed.extend(more.failed);
        }
        Err(problem) => {
            report(&ServerEvent::NotRecorded(sim, &problem));
            summary.failed.push(format!("{sim}: {problem:#}"));
        }
    }
}
