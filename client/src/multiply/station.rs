//! Where one new episode is made after another: by a worker in one process.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use wheelarm_dataset::publish;
use wheelarm_dataset::read::Episode;
use wheelarm_proto::settings::{Depth, Named, Quality};
use wheelarm_proto::v1;
use wheelarm_rollout::launcher::{Ongoing, Worker, WorkerOptions};
use wheelarm_rollout::limits;
use wheelarm_rollout::protocol::{Order, Recording, ShownFile, Told, Tried};

use super::args::MultiplyArgs;
use super::ledger::Entry;
use super::mark;
use super::sources::Sources;
use crate::episode_seed::mixed;

/// A place for one episode at a time.
pub struct Station<'a> {
    args: &'a MultiplyArgs,
    sources: &'a Sources,
    shown: &'a Path,
    worker: Option<Arc<Worker>>,
    /// Files lie here until they are whole and known to be of a success.
    staging: PathBuf,
}

/// What an episode came to.
enum Came {
    Tried(Box<Tried>),
    Broke(String),
}

impl<'a> Station<'a> {
    /// Number `index`; the worker is started with the first episode.
    pub fn new(
        args: &'a MultiplyArgs,
        sources: &'a Sources,
        shown: &'a Path,
        index: usize,
    ) -> Self {
        Self {
            args,
            sources,
            shown,
            worker: None,
            staging: args.out.join("staging").join(index.to_string()),
        }
    }

    /// Tries one scene. What breaks in it is an [`Entry`] too.
    ///
    /// # Errors
    /// When something else than the simulation and the task fails.
    pub fn episode(&mut self, seed: u64) -> anyhow::Result<Entry> {
        let begun = Instant::now();
        if self.staging.exists() {
            let cleared = std::fs::remove_dir_all(&self.staging);
            cleared.with_context(|| format!("clearing {}", self.staging.display()))?;
        }
        std::fs::create_dir_all(&self.staging)
            .with_context(|| format!("making the folder {}", self.staging.display()))?;
        let worker = match self.worker.take() {
            Some(worker) if !worker.is_worn() && worker.death(Duration::ZERO)?.is_none() => worker,
            _ => Worker::start(&WorkerOptions {
                assets: self.args.assets.clone(),
                adapter: None,
                folder: Some(self.args.out.clone()),
            })?,
        };
        let label = format!("{}-multiplied-seed{seed}", self.args.task);
        let mut ongoing = worker.begin(self.order(seed, &label))?;
        let came = self.follow(&mut ongoing)?;
        drop(ongoing);
        let entry = Entry {
            seed,
            kept: false,
            source: String::new(),
            end: String::new(),
            why: String::new(),
            label: String::new(),
            seconds: 0.0,
            wall_seconds: begun.elapsed().as_secs_f64(),
            notes: Vec::new(),
        };
        let entry = match came {
            Came::Tried(tried) => {
                self.worker = Some(worker);
                self.judged(entry, &label, *tried)?
            }
            Came::Broke(why) => Entry {
                end: "broke".to_owned(),
                why,
                ..entry
            },
        };
        // Nothing is left of what failed.
        let _ = std::fs::remove_dir_all(&self.staging);
        let _ = std::fs::remove_dir(self.args.out.join("staging"));
        Ok(entry)
    }

    /// What a try is worth, and its file in its place where it is worth something.
    fn judged(&self, entry: Entry, label: &str, tried: Tried) -> anyhow::Result<Entry> {
        let report = tried.report();
        let file = self.staging.join(format!("{label}.h5"));
        let mut entry = Entry {
            source: tried.source.unwrap_or_default(),
            seconds: report.seconds(),
            end: match report.succeeded() {
                true => "success".to_owned(),
                false => failed(&report.evaluation),
            },
            why: report.why().unwrap_or_default(),
            notes: tried.notes,
            ..entry
        };
        if !report.succeeded() {
            return Ok(entry);
        }
        let summary = Episode::open(&file)?.summary()?;
        if !(summary.success && summary.complete) {
            entry.end = "incomplete file".to_owned();
            entry.why = summary.problems.join("; ");
            return Ok(entry);
        }
        let hindered = self.args.disturb.map(|d| format!(", disturb {}", d.text()));
        let hindered = hindered.unwrap_or_default();
        let how = format!(
            "seed {}, noise {} m{hindered}",
            self.args.seed, self.args.noise
        );
        mark::write(&file, &entry.source, &how)?;
        let target = self.args.out.join(format!("{label}.h5"));
        publish::file(&file, &target)
            .with_context(|| format!("putting {} in its place", target.display()))?;
        entry.kept = true;
        entry.label = label.to_owned();
        Ok(entry)
    }

    fn order(&self, seed: u64, label: &str) -> Order {
        let args = self.args;
        Order {
            number: 0,
            scenario: v1::Scenario {
                scene: self.sources.scene.clone(),
                robot: self.sources.robot.clone(),
                task: Some(args.task.clone()),
                seed: Some(seed),
                starts: args.starts.code().into(),
                pacing: v1::Pacing::LockStep.into(),
                quality: Quality::Standard.code().into(),
                disturbances: args.disturb.map(|d| d.disturbances(seed.into())),
                ..v1::Scenario::default()
            },
            label: label.to_owned(),
            record: Some(Recording {
                out: self.staging.clone(),
                scratch: None,
                depth: Depth::Nothing.name().to_owned(),
                name: "multiply".to_owned(),
            }),
            log: None,
            profile_seed: None,
            forced: None,
            shown: Some(ShownFile {
                file: self.shown.to_owned(),
                seed: mixed(seed ^ mixed(args.seed)),
                noise: args.noise,
            }),
        }
    }

    /// Waits until nothing is left of an episode that went to its end, or says how it
    /// broke.
    fn follow(&self, ongoing: &mut Ongoing) -> anyhow::Result<Came> {
        let worker = Arc::clone(ongoing.worker());
        let mut tried: Option<Box<Tried>> = None;
        let (mut heard, mut newest) = (Instant::now(), None);
        loop {
            match ongoing.next(limits::LOOK) {
                Some(Told::Tried(done)) => {
                    heard = Instant::now();
                    tried = Some(done);
                }
                Some(Told::Over) => {
                    return match tried {
                        Some(tried) => Ok(Came::Tried(tried)),
                        None => bail!("the worker told nothing of it:\n{}", worker.tail()),
                    };
                }
                Some(Told::Status(status)) => {
                    let tick = status.header.map(|header| header.tick);
                    if newest != tick {
                        (newest, heard) = (tick, Instant::now());
                    }
                }
                Some(Told::Scenario(words)) => return Ok(Came::Broke(words)),
                Some(Told::Panicked(words)) => {
                    return Ok(Came::Broke(format!("the operator panicked: {words}")));
                }
                Some(Told::Broke(words)) => return Ok(Came::Broke(words)),
                Some(Told::Recorded { code, words }) if code != 0 => {
                    bail!("the recording failed: {words}\n{}", worker.tail())
                }
                Some(Told::Trouble(words)) => bail!("{words}\n{}", worker.tail()),
                Some(Told::Recorded { .. }) => heard = Instant::now(),
                None => {
                    if let Some(death) = worker.death(Duration::ZERO)? {
                        return Ok(Came::Broke(death));
                    }
                    let patience = match tried {
                        None => self.args.patience,
                        Some(_) => limits::FINISH,
                    };
                    if heard.elapsed() > patience {
                        worker.kill();
                        let words = "the worker stalled and was ended".to_owned();
                        return Ok(Came::Broke(words));
                    }
                }
            }
        }
    }
}

/// How a task failed, in a word or two; `gave up` where the task itself had not.
fn failed(evaluation: &v1::Evaluation) -> String {
    use v1::FailureReason as Reason;
    match evaluation.failure_reason() {
        Reason::Unspecified | Reason::None => "gave up".to_owned(),
        reason => {
            let name = reason.as_str_name().trim_start_matches("FAILURE_REASON_");
            name.to_lowercase().replace('_', " ")
        }
    }
}
