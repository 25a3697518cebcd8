//! Exported rows replayed open loop at their own rate through public commands,
//! each on the scenario that it was recorded in: how many succeed, by task and
//! by kind of action. The rows are those of `wheelarm dataset export`.
//!
//! `replay_rows [--jobs N] [--only KIND] RECORDINGS…`, where KIND is one of
//! `next-pose`, `next-joints`, `applied` and `shifted` (next-pose with every row
//! one too late).

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Parser;
use wheelarm_dataset::convert::batch;
use wheelarm_policy::ActionKind;
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
    #[arg(long)]
    only: Option<String>,
}

/// Name, kind of action, and rows by which the actions come late.
const VARIANTS: [(&str, ActionKind, usize); 4] = [
    ("next-pose", ActionKind::NextPose, 0),
    ("next-joints", ActionKind::NextJoints, 0),
    ("applied", ActionKind::Applied, 0),
    ("shifted", ActionKind::NextPose, 1),
];

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
    let wanted = |name: &str| arguments.only.as_deref().is_none_or(|only| only == name);
    let work: Vec<_> = files
        .iter()
        .flat_map(|file| VARIANTS.map(|variant| (file, variant)))
        .filter(|(_, (name, ..))| wanted(name))
        .collect();
    let results = batch::parallel(work.len(), arguments.jobs, |i| {
        let (file, (name, kind, shift)) = work[i];
        let rows = Rows::read(file, kind, shift)?;
        let task = rows.scenario.task().to_owned();
        let seed = rows.scenario.seed();
        let played = rows
            .play(&format!("rows-{}-{i}", std::process::id()))
            .unwrap_or_else(|problem| Played {
                success: false,
                chair_off: f64::NAN,
                words: format!("{problem:#}"),
            });
        println!(
            "{task:<20} seed {seed:<5} {name:<12} {} chair off by {:.1} mm  {}",
            if played.success { "yes" } else { "NO " },
            1e3 * played.chair_off,
            played.words
        );
        Ok((task, name, played))
    })?;
    let mut table: BTreeMap<(&str, &str), [usize; 2]> = BTreeMap::new();
    for (task, name, played) in &results {
        let cell = table.entry((task, name)).or_default();
        cell[0] += usize::from(played.success);
        cell[1] += 1;
    }
    for ((task, name), [done, all]) in table {
        println!("{task:<20} {name:<12} {done} of {all}");
    }
    Ok(())
}
