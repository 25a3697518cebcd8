//! The whole: episodes in, table and figure out.

use std::path::{Path, PathBuf};

use anyhow::ensure;

use super::columns::{split, trial};
use super::errors::{Errors, errors, extrapolated, lasts, repeated, truth};
use super::features::features;
use super::lesson::{Kind, Lesson, LessonOptions};
use super::table::{Ahead, Report, figure};
use crate::episodes::Episode;
use crate::train::{self, Schedule};

/// What is asked for.
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// Folder for all that is made.
    pub out: PathBuf,
    /// Rows that are seen: 20 in the paper's table, 15 in its text.
    pub length: usize,
    /// Epochs at most.
    pub epochs: u64,
    /// Weights of torchvision's ResNet18.
    pub backbone: Option<PathBuf>,
    /// Vectors of words, a text file of word2vec.
    pub vectors: Option<PathBuf>,
    /// Seed of all that is drawn.
    pub seed: u64,
}

/// Trains all rows of the table, or goes on with it, and measures them.
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
    let seen =
        |normal: bool, name: &str| features(episodes, backbone, normal, &options.out.join(name));
    let as_is = seen(false, "features-as-printed.safetensors")?;
    let normal = seen(true, "features.safetensors")?;
    let mut ahead: Vec<Ahead> = Vec::new();
    let mut training = Vec::new();
    let mut drawn = Vec::new();
    for kind in Kind::ALL {
        let lesson_options = LessonOptions {
            length: options.length,
            seed: options.seed,
            ..LessonOptions::of(kind)
        };
        let (length, longest) = (options.length, lesson_options.longest());
        if ahead.is_empty() {
            ahead = lesson_options
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
        let lesson = Lesson::new(
            lesson_options.clone(),
            episodes,
            Some(features),
            (&learned, &held),
            options.vectors.as_deref(),
        )?;
        let depth = match (kind, lesson.sees_depth()) {
            (Kind::CorrectedBlind, _) | (_, true) => "",
            _ => ", without depth: the export has none (--depth)",
        };
        println!("{}: {} steps an epoch{depth}", kind.name(), lesson.epoch());
        let folder = options.out.join(kind.name().replace([',', ' '], "-"));
        let schedule = Schedule {
            out: folder.clone(),
            steps: options.epochs * lesson.epoch(),
            limit: None,
            interval: lesson.epoch(),
            patience: Some(3),
            weight_decay: 1e-4,
            clip: 1.0,
        };
        let (_, told) = train::run(&lesson, lesson.network(), &schedule)?;
        training.push((kind.name().to_owned(), told.seconds, told.step));
        let found = lesson.predict(&lesson.best(&folder)?, &tests);
        for (k, ahead) in ahead.iter_mut().enumerate() {
            let truth = truth(&tests, length, ahead.rows, longest);
            ahead
                .of
                .push((kind.name().to_owned(), errors(&found[k], &truth)));
        }
        drawn.push((kind, found));
    }
    let longest = ahead.last().map_or(1, |a| a.rows);
    let windows = tests
        .iter()
        .map(|t| lasts(t, options.length, longest).len())
        .sum();
    let shown: Vec<_> = drawn
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
        backbone: backbone.map_or("drawn weights, frozen".to_owned(), name),
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
