//! Exported rows replayed open loop at their own rate through public commands,
//! each on the scenario that it was recorded in: how many succeed, by task and
//! by kind of action, and how far chair and hand were from where they had been.
//! The rows are those of `wheelarm dataset export`, made anew, or with `--rows`
//! read from the Parquet files of a LeRobot set that was exported from them.
//!
//! `replay_rows [--jobs N] [--only KIND | --rows SET] RECORDINGS…`, where KIND is one of
//! `next-pose`, `next-joints`, `applied` and `shifted` (next-pose with every row
//! one too late).

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Parser;
use wheelarm_dataset::convert::batch;
use wheelarm_policy::ActionKind;
use wheelarm_tests::exported::Exported;
use wheelarm_tests::rows::{Played, Rows};

#[derive(Parser)]
struct Arguments {
    /// Recordings, or folders with some.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Servers at one time.
    #[arg(long, default_value_t = 1)]
    jobs: usize,
    /// One kind of rows; all without it.
    #[arg(long, conflicts_with = "rows")]
    only: Option<String>,
    /// A LeRobot set: its rows are played instead.
    #[arg(long, value_name = "SET")]
    rows: Option<PathBuf>,
}

/// Name, kind of action, and rows by which the actions come late.
const VARIANTS: [(&str, ActionKind, usize); 4] = [
    ("next-pose", ActionKind::NextPose, 0),
    ("next-joints", ActionKind::NextJoints, 0),
    ("applied", ActionKind::Applied, 0),
    ("shifted", ActionKind::NextPose, 1),
];

/// Rows of a set, whose kind follows from its names.
const EXPORTED: [(&str, ActionKind, usize); 1] = [("exported", ActionKind::NextPose, 0)];

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    let mut files = Vec::new();
    for path in &arguments.files {
        if path.is_dir() {
            let inside = std::fs::read_dir(path)?.flatten().map(|entry| entry.path());
            files.extend(inside.filter(|p| p.extension().is_some_and(|e| e == "h5")));
        } else {
            files.push(path.clone());
        }
    }
    files.sort();
    let exported = arguments.rows.as_deref().map(Exported::read).transpose()?;
    let variants = match exported {
        Some(_) => &EXPORTED[..],
        None => &VARIANTS,
    };
    let wanted = |name: &str| arguments.only.as_deref().is_none_or(|only| only == name);
    let work: Vec<_> = files
        .iter()
        .flat_map(|file| variants.iter().map(move |variant| (file, *variant)))
        .filter(|(_, (name, ..))| wanted(name))
        .collect();
    let results = batch::parallel(work.len(), arguments.jobs, |i| {
        let (file, (name, kind, shift)) = work[i];
        let rows = match &exported {
            Some(set) => Rows::exported(file, set)?,
            None => Rows::read(file, kind, shift)?,
        };
        let task = rows.scenario.task().to_owned();
        let seed = rows.scenario.seed();
        let played = rows
            .play(&format!("rows-{}-{i}", std::process::id()))
            .unwrap_or_else(|problem| Played {
                success: false,
                off: [f64::NAN; 2],
                words: format!("{problem:#}"),
            });
        println!(
            "{task:<20} seed {seed:<5} {name:<12} {} off by {:>6.2} mm chair, {:>6.2} mm hand  {}",
            if played.success { "yes" } else { "NO " },
            1e3 * played.off[0],
            1e3 * played.off[1],
            played.words
        );
        Ok((task, name, played))
    })?;
    let mut table: BTreeMap<(&str, &str), Vec<&Played>> = BTreeMap::new();
    for (task, name, played) in &results {
        table.entry((task, name)).or_default().push(played);
    }
    for ((task, name), played) in table {
        let done = played.iter().filter(|played| played.success).count();
        let mean =
            |k: usize| 1e3 * played.iter().map(|p| p.off[k]).sum::<f64>() / played.len() as f64;
        println!(
            "{task:<20} {name:<12} {done} of {}, off by {:.2} mm chair, {:.2} mm hand",
            played.len(),
            mean(0),
            mean(1)
        );
    }
    Ok(())
}
