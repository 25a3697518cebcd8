//! Renders failed episodes again, larger, from their recordings: the same states, with a
//! contact sheet of each.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, bail};
use wheelarm_dataset::read::Episode;
use wheelarm_dataset::sheet::sheet;
use wheelarm_proto::v1;

use super::args::EvaluateArgs;
use super::entry::Entry;
use crate::replay::{self, ReplayArgs};

/// Width and height, pixels.
const SIZE: [u32; 2] = [1280, 720];
/// Images per second.
const RATE: f64 = 5.0;

/// An episode that was rendered again.
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
    /// Comparison of the states, as text.
    pub states: String,
}

/// Renders the first failures of each cause, at most `--redraw-failures`.
///
/// # Errors
/// When a program does not start or a file cannot be read or written.
pub fn render_failures(args: &EvaluateArgs, entries: &[Entry]) -> anyhow::Result<Vec<Redrawn>> {
    let Some(most) = args.redraw_failures else {
        return Ok(Vec::new());
    };
    let folder = args.out.join("redrawn");
    let mut out = Vec::new();
    for entry in chosen(entries, most as usize) {
        let Some((label, recording)) = recorded(&args.out, entry) else {
            continue;
        };
        std::fs::create_dir_all(&folder)
            .with_context(|| format!("making the folder {}", folder.display()))?;
        let file = folder.join(format!("{label}-replay.h5"));
        let image = folder.join(format!("{label}.png"));
        let about = || format!("rendering {} again", recording.display());
        if !is_of(&file, &recording) {
            if file.is_file() {
                std::fs::remove_file(&file).with_context(about)?;
            }
            println!("renders {} seed {} again", entry.task, entry.seed);
            render(args, &recording, &folder).with_context(about)?;
        }
        let episode = Episode::open(&file).with_context(about)?;
        sheet(&episode, &image).with_context(about)?;
        out.push(Redrawn {
            task: entry.task.clone(),
            seed: entry.seed,
            file,
            sheet: image,
            states: "equal state hashes".to_owned(),
        });
    }
    Ok(out)
}

/// Failures, one of each cause in turn.
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

/// Label and file of an episode's recording; prints the reason and the fix when it does not
/// exist.
fn recorded(folder: &Path, entry: &Entry) -> Option<(String, PathBuf)> {
    let label = entry.recording();
    let file = label.as_ref().map(|l| folder.join(format!("{l}.h5")));
    if let Some(found) = label.zip(file.clone().filter(|file| file.is_file())) {
        return Some(found);
    }
    let why = file.map_or("it was not recorded".to_owned(), |file| {
        format!("{} does not exist", file.display())
    });
    println!(
        "not redrawn: {} seed {}: {why}; repeat it in another --out",
        entry.task, entry.seed
    );
    None
}

/// Whether a replay exists and was rendered from this recording, not from an earlier one of
/// the same name.
fn is_of(replay: &Path, recording: &Path) -> bool {
    let written = |file: &Path| file.metadata().and_then(|file| file.modified());
    match (written(replay), written(recording)) {
        (Ok(rendered), Ok(recorded)) => rendered >= recorded,
        _ => false,
    }
}

/// Replays a recording with large images; its states must be the same.
fn render(args: &EvaluateArgs, recording: &Path, folder: &Path) -> anyhow::Result<()> {
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
        appearances: None,
        appearance_seed: 1,
        appearance_axes: None,
        jobs: None,
        as_recorded: false,
        quality: None,
        graphics: args.graphics.clone(),
        assets: args.assets.clone(),
        packs: args.packs.clone(),
    })?;
    if code != ExitCode::SUCCESS {
        bail!("its states differ, or the new recording is not complete");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_failure_of_each_cause_is_chosen_before_a_second() {
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

    #[test]
    fn recording_is_the_one_named_by_the_entry() {
        let folder = tempfile::tempdir().unwrap();
        let entry = |label: &str| {
            let text = format!(
                r#"{{"task":"pick_bowl","seed":0,{label}"success":false,"why":"","conditions":[],"seconds":9.0,"factor":1.0,"hash":"","notes":[]}}"#
            );
            serde_json::from_str::<Entry>(&text).unwrap()
        };
        for name in ["pick_bowl-seed0", "pick_bowl-seed0-2"] {
            std::fs::write(folder.path().join(format!("{name}.h5")), "").unwrap();
        }
        let found = |label: &str| recorded(folder.path(), &entry(label)).map(|(label, _)| label);
        let second = found(r#""label":"pick_bowl-seed0-2","#);
        assert_eq!(second.as_deref(), Some("pick_bowl-seed0-2"));
        assert_eq!(found("").as_deref(), Some("pick_bowl-seed0"), "an old line");
        assert_eq!(found(r#""label":"","#), None, "it was not recorded");
        assert_eq!(found(r#""label":"pick_bowl-seed0-3","#), None);
    }

    #[test]
    fn replay_older_than_its_recording_is_rejected() {
        let folder = tempfile::tempdir().unwrap();
        let [recording, replay] = ["a.h5", "b.h5"].map(|name| folder.path().join(name));
        let write = |path: &Path, at: u64| {
            let file = std::fs::File::create(path).unwrap();
            let at = std::time::UNIX_EPOCH + std::time::Duration::from_secs(at);
            file.set_modified(at).unwrap();
        };
        write(&recording, 20);
        assert!(!is_of(&replay, &recording));
        write(&replay, 10);
        assert!(!is_of(&replay, &recording));
        write(&replay, 30);
        assert!(is_of(&replay, &recording));
    }
}
