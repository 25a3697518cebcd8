//! One recorder process for every server behind a router: each server gets a
//! recorder of its own and a folder of its own, as soon as it is seen.

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

/// What is told of many servers, each by its name.
#[derive(Debug)]
pub enum Told<'a> {
    /// It is recorded from now on.
    Recording(&'a str),
    /// What its recorder put out.
    Output(&'a str, &'a Output),
    /// It is not recorded, and why.
    Left(&'a str, &'a anyhow::Error),
}

/// Records the episodes of every server that `session` leads to, each into a
/// folder of its name below `options.out`, until `options.episodes` of them all
/// are done or `shutdown` completes.
///
/// # Errors
/// When the servers cannot be watched. A server whose recorder fails is told
/// and left out until it comes back.
pub async fn run_many(
    session: &Session,
    endpoint: &str,
    options: &RecordOptions,
    shutdown: impl Future<Output = ()>,
    tell: impl Fn(&Told<'_>) + Clone + Send + Sync + 'static,
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
                // A server that goes is its recorder's business: it closes the
                // episode and takes the next one when the server comes back.
                if sample.kind() == SampleKind::Put && joined.insert(sim.clone()) {
                    let link = Client::over(session.clone(), endpoint, &sim)?;
                    tell(&Told::Recording(&sim));
                    let (ended, episodes) = (ended.clone(), episodes.clone());
                    recorders.spawn(one(link, sim, options.clone(), ended, episodes, tell.clone()));
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
                add(&mut summary, &sim, result, &tell);
            }
            () = &mut shutdown => {
                end.send_replace(true);
            }
        }
    }
    while let Some(result) = recorders.join_next().await {
        let (sim, result) = result.context("a recorder panicked")?;
        add(&mut summary, &sim, result, &tell);
    }
    Ok(summary)
}

/// Records one server into a folder of its name.
async fn one(
    link: Client,
    sim: String,
    options: RecordOptions,
    mut ended: watch::Receiver<bool>,
    episodes: mpsc::UnboundedSender<()>,
    tell: impl Fn(&Told<'_>),
) -> (String, anyhow::Result<ExitSummary>) {
    let options = RecordOptions {
        out: options.out.join(&sim),
        scratch: options.scratch.map(|scratch| scratch.join(&sim)),
        // They are counted over all servers.
        episodes: None,
        ..options
    };
    let shutdown = async move {
        // A sender that is gone ends the recorder as well.
        let _ = ended.wait_for(|ended| *ended).await;
    };
    let result = run(&link, options, shutdown, |output| {
        tell(&Told::Output(&sim, output));
        if matches!(output, Output::Finished(_) | Output::Failed(_)) {
            // Nobody counts any more when the end is near.
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
    tell: &impl Fn(&Told<'_>),
) {
    match result {
        Ok(more) => {
            summary.finished.extend(more.finished);
            summary.failed.extend(more.failed);
        }
        Err(problem) => {
            tell(&Told::Left(sim, &problem));
            summary.failed.push(format!("{sim}: {problem:#}"));
        }
    }
}
