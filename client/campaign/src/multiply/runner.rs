//! Runs the new episodes of one worker.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use anyhow::Context;
use wheelarm_dataset::publish;
use wheelarm_dataset::read::Episode;
use wheelarm_proto::settings::{Depth, Quality};
use wheelarm_proto::v1;
use wheelarm_rollout::{
    Backend, DemonstrationFile, Driver, Finished, InProcess, Limits, Record, Rollout, WorkerOptions,
};

use super::args::MultiplyArgs;
use super::entry::Entry;
use super::mark;
use super::sources::Sources;
use crate::episode_seed::mixed;

/// Runs one episode at a time.
pub struct Runner<'a> {
    args: &'a MultiplyArgs,
    sources: &'a Sources,
    shown: &'a Path,
    backend: InProcess,
    /// Files stay here until they are complete and known to be of a success.
    staging: PathBuf,
}

impl<'a> Runner<'a> {
    /// Runner number `index`; its worker starts with the first episode.
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
            backend: InProcess::new(WorkerOptions {
                assets: args.assets.clone(),
                packs: sources.packs.before(&args.packs.packs),
                adapter: None,
                folder: Some(args.out.clone()),
            }),
            staging: args.out.join("staging").join(index.to_string()),
        }
    }

    /// Runs one scene. A failed episode is an [`Entry`] too.
    ///
    /// # Errors
    /// When something fails that is not part of the episode.
    pub fn episode(&self, seed: u64) -> anyhow::Result<Entry> {
        let begun = Instant::now();
        if self.staging.exists() {
            let cleared = std::fs::remove_dir_all(&self.staging);
            cleared.with_context(|| format!("clearing {}", self.staging.display()))?;
        }
        std::fs::create_dir_all(&self.staging)
            .with_context(|| format!("making the folder {}", self.staging.display()))?;
        let label = format!("{}-multiplied-seed{seed}", self.args.task);
        let result = self.backend.run(&self.rollout(seed, &label))?;
        let entry = Entry {
            seed,
            wall_seconds: begun.elapsed().as_secs_f64(),
            ..Entry::default()
        };
        let entry = match result {
            Ok(finished) => self.judged(entry, &label, finished)?,
            Err(failure) => Entry {
                end: "broke".to_owned(),
                why: failure.reason,
                ..entry
            },
        };
        // Files of failures are not kept.
        let _ = std::fs::remove_dir_all(&self.staging);
        let _ = std::fs::remove_dir(self.args.out.join("staging"));
        Ok(entry)
    }

    /// The result of an episode; publishes its file if the task succeeded.
    fn judged(&self, entry: Entry, label: &str, finished: Finished) -> anyhow::Result<Entry> {
        let file = self.staging.join(format!("{label}.h5"));
        let mut entry = Entry {
            seconds: finished.seconds(),
            end: finished.end(),
            why: finished.why().unwrap_or_default(),
            ..entry
        };
        let is_success = finished.succeeded();
        entry.source = finished.source.unwrap_or_default();
        entry.notes = finished.notes;
        if !is_success {
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

    fn rollout(&self, seed: u64, label: &str) -> Rollout {
        let args = self.args;
        Rollout {
            scenario: v1::Scenario {
                scene: self.sources.scene.clone(),
                packs: self.sources.refs.clone(),
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
            driver: Driver::Demonstrations(DemonstrationFile {
                file: self.shown.to_owned(),
                seed: mixed(seed ^ mixed(args.seed)),
                noise: args.noise,
            }),
            record: Some(Record {
                depth: Depth::Nothing,
                ..Record::new("multiply", &self.staging)
            }),
            limits: Limits::patience(args.patience),
            folder: None,
            observer: Arc::new(()),
        }
    }
}
