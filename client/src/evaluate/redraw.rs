//! Failed episodes drawn again, larger, from their recordings: the same states as
//! they were, with a contact sheet of each.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, bail};
use wheelarm_dataset::read::Episode;
use wheelarm_dataset::sheet::sheet;
use wheelarm_proto::v1;

use super::args::EvaluateArgs;
use super::entry::{Entry, Job};
use super::scope::Scope;
use crate::replay::{self, ReplayArgs};

/// Width and height, pixels.
const SIZE: [u32; 2] = [1280, 720];
/// Pictures per second.
const RATE: f64 = 5.0;

/// An episode that was drawn again.
#[derive(Clone, Debug, PartialEq)]
pub struct Redrawn {
    /// Task.
    pub task: String,
    /// Seed.
    pub seed: u64,
    /// The new file.
    pub file: PathBuf,
    /// Its contact sheet.
    pub sheet: PathBuf,
    /// Whether the states were the same again, in words.
    pub states: String,
}

/// Draws the first failures of each cause, as many as asked.
///
/// # Errors
/// When a program does not start or a file cannot be read or written.
pub fn draw(args: &EvaluateArgs, scope: &Scope, entries: &[Entry]) -> anyhow::Result<Vec<Redrawn>> {
    let Some(most) = args.redraw_failures else {
        return Ok(Vec::new());
    };
    let folder = args.out.join("redrawn");
    let mut out = Vec::new();
    for entry in chosen(entries, most as usize) {
        let label = label(scope, entry);
        let recording = args.out.join(format!("{label}.h5"));
        if !recording.is_file() {
            println!(
                "not redrawn: {} seed {}: there is no {}; do it again in another --out",
                entry.task,
                entry.seed,
                recording.display()
            );
            continue;
        }
        std::fs::create_dir_all(&folder)
            .with_context(|| format!("making the folder {}", folder.display()))?;
        let file = folder.join(format!("{label}-replay.h5"));
        let picture = folder.join(format!("{label}.png"));
        let about = || format!("drawing {} again", recording.display());
        if !file.is_file() {
            println!("draws {} seed {} again", entry.task, entry.seed);
            again(args, &recording, &folder).with_context(about)?;
        }
        let episode = Episode::open(&file).with_context(about)?;
        sheet(&episode, &picture).with_context(about)?;
        out.push(Redrawn {
            task: entry.task.clone(),
            seed: entry.seed,
            file,
            sheet: picture,
            states: "equal state hashes".to_owned(),
        });
    }
    Ok(out)
}

/// Failures, in turns one of each cause.
fn chosen(entries: &[Entry], most: usize) -> Vec<&Entry> {
    let mut causes: Vec<((&str, String), Vec<&Entry>)> = Vec::new();
    for entry in entries.iter().filter(|entry| !entry.success) {
        let key = (entry.task.as_str(), entry.cause());
        match causes.iter_mut().find(|(known, _)| *known == key) {
            Some((_, all)) => all.push(entry),
            None => causes.push((key, vec![entry])),
        }
    }
    for (_, all) in &mut causes {
        all.sort_by_key(|entry| entry.seed);
    }
    let longest = causes.iter().map(|(_, all)| all.len()).max().unwrap_or(0);
    let turns =
        (0..longest).flat_map(|turn| causes.iter().filter_map(move |(_, all)| all.get(turn)));
    turns.take(most).copied().collect()
}

/// Label of an episode's recording.
fn label(scope: &Scope, entry: &Entry) -> String {
    let job = Job {
        task: entry.task.clone(),
        seed: entry.seed,
        variation: scope.variation.clone(),
        policy: entry.policy.clone(),
    };
    job.label()
}

/// Replays a recording with large pictures; its states must be the same.
fn again(args: &EvaluateArgs, recording: &Path, folder: &Path) -> anyhow::Result<()> {
    let camera = |name: &str| v1::CameraSetting {
        name: name.to_owned(),
        width: SIZE[0],
        height: SIZE[1],
        rate_hz: Some(RATE),
        ..Default::default()
    };
    let episode = Episode::open(recording)?;
    let (robot, _) = episode.roles()?;
    let cameras = robot.cameras.iter().map(|own| camera(&own.name)).collect();
    drop(episode);
    let code = replay::run(&ReplayArgs {
        file: recording.to_path_buf(),
        out: Some(folder.to_path_buf()),
        width: None,
        height: None,
        camera: cameras,
        looks: None,
        look_seed: 1,
        look_axes: None,
        jobs: None,
        as_recorded: false,
        quality: None,
        assets: args.assets.clone(),
    })?;
    if code != ExitCode::SUCCESS {
        bail!("its states were not the same again, or the new recording is not complete");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_of_each_cause_is_drawn_before_two_of_any() {
        let entry = |seed: u64, end: &str| {
            let text = format!(
                r#"{{"task":"pick_bowl","seed":{seed},"success":{},"why":"","end":"{end}","conditions":[],"seconds":9.0,"factor":1.0,"hash":"","notes":[]}}"#,
                end == "success"
            );
            serde_json::from_str::<Entry>(&text).unwrap()
        };
        let ends = ["timeout", "timeout", "success", "dropped", "timeout"];
        let entries: Vec<Entry> = (0..)
            .zip(ends)
            .map(|(seed, end)| entry(seed, end))
            .collect();
        let seeds = |most| -> Vec<u64> {
            let chosen = chosen(&entries, most);
            chosen.iter().map(|entry| entry.seed).collect()
        };
        assert_eq!(seeds(2), [0, 3]);
        assert_eq!(seeds(9), [0, 3, 1, 4]);
    }
}
