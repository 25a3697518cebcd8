//! The whole measurement: episodes in, tables and figures out.

use std::path::{Path, PathBuf};

use anyhow::ensure;

use super::columns::{split, trial};
use super::errors::{Errors, errors, extrapolated, lasts, repeated, truth};
use super::features::features;
use super::table::{Ahead, Report, figure};
use super::training_task::{BaselineTask, Kind, TaskOptions};
use crate::episodes::Episode;
use crate::train::{self, Schedule};

/// Options of a measurement.
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// Folder for the output.
    pub out: PathBuf,
    /// Rows of a window: 20 in the paper's table, 15 in its text.
    pub length: usize,
    /// Most epochs.
    pub epochs: u64,
    /// Weights of torchvision's ResNet18.
    pub backbone: Option<PathBuf>,
    /// Word vectors, a text file of word2vec.
    pub vectors: Option<PathBuf>,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// Trains the networks of the table, or continues their training, and measures them.
///
/// # Errors
/// When there are fewer than three seeds, or a file cannot be read or written.
pub fn run(episodes: &[Episode], options: &RunOptions) -> anyhow::Result<Report> {
    std::fs::create_dir_all(&options.out)?;
    let trials = episodes
        .iter()
        .enumerate()
        .map(|(number, e)| trial(number, e));
    let [learned, held, tests] = split(trials.collect::<anyhow::Result<_>>()?);
    ensure!(
        !learned.is_empty() && !held.is_empty() && !tests.is_empty(),
        "the episodes have fewer than three seeds: 24 are split 16, 4 and 4"
    );
    let backbone = options.backbone.as_deref();
    let visual =
        |normal: bool, name: &str| features(episodes, backbone, normal, &options.out.join(name));
    let as_is = visual(false, "features-as-printed.safetensors")?;
    let normal = visual(true, "features.safetensors")?;
    let mut ahead: Vec<Ahead> = Vec::new();
    let mut training = Vec::new();
    let mut predictions = Vec::new();
    for kind in Kind::ALL {
        let task_options = TaskOptions {
            length: options.length,
            seed: options.seed,
            ..TaskOptions::of(kind)
        };
        let (length, longest) = (options.length, task_options.longest());
        if ahead.is_empty() {
            ahead = task_options
                .ahead
                .iter()
                .map(|&rows| {
                    let truth = truth(&tests, length, rows, longest);
                    let on = extrapolated(&tests, length, rows, longest);
                    Ahead {
                        rows,
                        seconds: rows as f64 * 0.1,
                        of: vec![
                            (
                                "repeat last".to_owned(),
                                errors(&repeated(&tests, length, longest), &truth),
                            ),
                            ("constant velocity".to_owned(), errors(&on, &truth)),
                        ],
                    }
                })
                .collect();
        }
        let features = if kind == Kind::AsPrinted {
            &as_is
        } else {
            &normal
        };
        let task = BaselineTask::new(
            task_options.clone(),
            episodes,
            Some(features),
            (&learned, &held),
            options.vectors.as_deref(),
        )?;
        let depth = match (kind, task.uses_depth()) {
            (Kind::CorrectedBlind, _) | (_, true) => "",
            _ => ", without depth: export with --depth to include it",
        };
        println!("{}: {} steps an epoch{depth}", kind.name(), task.epoch());
        let folder = options.out.join(kind.name().replace([',', ' '], "-"));
        let schedule = Schedule {
            out: folder.clone(),
            steps: options.epochs * task.epoch(),
            limit: None,
            interval: task.epoch(),
            patience: Some(3),
            weight_decay: 1e-4,
            clip: 1.0,
        };
        let (_, progress) = train::run(&task, task.network(), &schedule)?;
        training.push((kind.name().to_owned(), progress.seconds, progress.step));
        let found = task.predict(&task.best(&folder)?, &tests);
        for (k, ahead) in ahead.iter_mut().enumerate() {
            let truth = truth(&tests, length, ahead.rows, longest);
            ahead
                .of
                .push((kind.name().to_owned(), errors(&found[k], &truth)));
        }
        predictions.push((kind, found));
    }
    let longest = ahead.last().map_or(1, |a| a.rows);
    let windows = tests
        .iter()
        .map(|t| lasts(t, options.length, longest).len())
        .sum();
    let shown: Vec<_> = predictions
        .iter()
        .filter(|(kind, _)| *kind != Kind::CorrectedBlind)
        .collect();
    for (k, ahead) in ahead.iter().enumerate() {
        let lines: Vec<_> = shown
            .iter()
            .map(|(kind, found)| (kind.name(), &found[k]))
            .collect();
        let path = options.out.join(format!("figure-{}.png", ahead.rows));
        figure(
            &path,
            (0, &tests[0]),
            options.length,
            longest,
            ahead.rows,
            &lines,
        )?;
    }
    let report = Report {
        trials: [learned.len(), held.len(), tests.len()],
        windows,
        backbone: backbone.map_or("random weights, frozen".to_owned(), name),
        training,
        ahead,
    };
    report.write(&options.out)?;
    Ok(report)
}

fn name(path: &Path) -> String {
    path.file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}

/// Errors of a predictor in a report.
#[must_use]
pub fn of<'a>(report: &'a Report, rows: usize, name: &str) -> Option<&'a Errors> {
    let ahead = report.ahead.iter().find(|ahead| ahead.rows == rows)?;
    let found = ahead.of.iter().find(|(known, _)| known == name)?;
    Some(&found.1)
}
