//! Script of a replay: initial state and command of each tick, from a recording.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, bail};
use wheelarm_dataset::read::Episode;
use wheelarm_proto::settings::Depth;
use wheelarm_proto::{PHYSICS_VERSION, TICKS_PER_CONTROL, v1};

/// An episode as a script.
#[derive(Clone, Debug)]
pub(super) struct Script {
    pub label: String,
    pub instruction: String,
    pub scenario: v1::Scenario,
    /// Storage of its depth.
    pub depth: Depth,
    /// Version of the physics and of the server that made the episode.
    pub made_by: (u32, String),
    pub snapshot: bytes::Bytes,
    /// Texts of the assets with which it was made.
    pub assets: Vec<v1::AssetText>,
    pub first_tick: u64,
    pub last_tick: u64,
    /// State hashes by tick.
    pub hashes: Vec<(u64, u64)>,
    /// The commands by tick: the applied values with the recorded labels.
    pub commands: BTreeMap<u64, v1::Command>,
}

/// Labels of a command that change no motion, and from which exports mark their rows.
#[derive(Clone, Debug, Default)]
struct Marks {
    phase: i32,
    phase_name: String,
    device: i32,
    mode: i32,
    assistance: i32,
    incident: i32,
}

impl Marks {
    /// Adds the labels of a later command of the same tick.
    fn add(&mut self, command: v1::Command) {
        let later = |old: &mut i32, new: i32| {
            if new != 0 {
                *old = new;
            }
        };
        if command.phase != 0 {
            self.phase = command.phase;
            self.phase_name = command.phase_name;
        }
        later(&mut self.device, command.device);
        later(&mut self.mode, command.mode);
        later(&mut self.incident, command.incident);
        later(&mut self.assistance, command.assistance);
    }

    /// The command for what was `applied`, with these labels.
    fn command(self, applied: v1::Applied) -> v1::Command {
        v1::Command {
            arm: applied.arm,
            base: applied.base,
            gripper: applied.gripper,
            phase: self.phase,
            phase_name: self.phase_name,
            device: self.device,
            mode: self.mode,
            assistance: self.assistance,
            incident: self.incident,
            ..v1::Command::default()
        }
    }
}

/// Storage of depth in a recording.
pub(super) fn depth(episode: &Episode) -> anyhow::Result<Depth> {
    for name in episode.cameras()? {
        let camera = episode.camera(&name)?;
        if !camera.is_empty() && !camera.has_depth() {
            return Ok(Depth::Nothing);
        }
        if camera.millimetres() {
            return Ok(Depth::Millimetres);
        }
    }
    Ok(Depth::Metres)
}

impl Script {
    /// Reads what replay needs and checks that no tick is missing.
    pub fn read(episode: &Episode) -> anyhow::Result<Self> {
        let started = episode.started()?;
        if started.as_recorded {
            bail!(
                "the file was rendered from the states of another recording and has no snapshot to \
                 continue from; replay that recording, or render this one again with \
                 --as-recorded"
            );
        }
        let snapshot = episode.snapshot()?;
        let header = snapshot.header.unwrap_or_default();
        if snapshot.snapshot.is_empty() {
            bail!("the file has no snapshot to start from");
        }
        let applied = by_tick(episode.applied()?, |applied| applied.header.as_ref());
        let mut marks: BTreeMap<u64, Marks> = BTreeMap::new();
        for log in episode.commands()? {
            if let (Some(header), Some(command)) = (log.header, log.command) {
                marks.entry(header.tick).or_default().add(command);
            }
        }
        let last_tick = *applied
            .last_key_value()
            .context("the file has no applied command")?
            .0;
        let ticks = (header.tick..=last_tick).step_by(TICKS_PER_CONTROL as usize);
        for tick in ticks {
            if !applied.contains_key(&tick) {
                bail!(
                    "the applied command of tick {tick} is missing in the file, so the episode cannot be done again exactly"
                );
            }
        }
        let commands = applied.into_iter().map(|(tick, applied)| {
            let marks = marks.remove(&tick).unwrap_or_default();
            (tick, marks.command(applied))
        });
        Ok(Self {
            label: started.label.clone(),
            instruction: started.instruction.clone(),
            scenario: episode.scenario()?,
            depth: depth(episode)?,
            made_by: (started.physics_version, started.version),
            snapshot: snapshot.snapshot,
            assets: snapshot.assets,
            first_tick: header.tick,
            last_tick,
            hashes: episode.state_hashes()?,
            commands: commands.collect(),
        })
    }

    /// Rejects an episode that this version of the physics cannot reproduce.
    pub fn check_physics(&self, file: &Path) -> anyhow::Result<()> {
        let (found, server) = &self.made_by;
        if *found == PHYSICS_VERSION {
            return Ok(());
        }
        let (made, with) = match found {
            0 => (
                "names no physics version, so it was made before there were any".to_owned(),
                format!("server {server} that it was recorded with"),
            ),
            found => (
                format!("was made with physics version {found}"),
                format!("programs of physics version {found} (its server was {server})"),
            ),
        };
        let scenario = &self.scenario;
        bail!(
            "{} {made}; these programs have version {PHYSICS_VERSION}. They would compute other \
             bits from the same commands, so it is not replayed. To render its recorded states: \
             `wheelarm replay {} --as-recorded --out FOLDER`. To compute it again, use the {with}; \
             to record the same scene again: `wheelarm demo --task {} --seed {}`. Its data remain \
             valid: `wheelarm dataset` reads them",
            file.display(),
            file.display(),
            scenario.task(),
            scenario.seed(),
        )
    }
}

/// Cameras of a new recording: the recorded ones in another size if requested,
/// and `others`, which replace those of the same name.
pub(super) fn cameras(
    scenario: &v1::Scenario,
    width: Option<u32>,
    height: Option<u32>,
    others: &[v1::CameraSetting],
) -> Vec<v1::CameraSetting> {
    let mut cameras = scenario.cameras.clone();
    for camera in &mut cameras {
        camera.width = width.unwrap_or(camera.width);
        camera.height = height.unwrap_or(camera.height);
    }
    cameras.retain(|known| others.iter().all(|other| other.name != known.name));
    cameras.extend_from_slice(others);
    cameras.retain(|camera| camera.rate_hz() > 0.0);
    cameras
}

fn by_tick<T>(list: Vec<T>, header: impl Fn(&T) -> Option<&v1::Header>) -> BTreeMap<u64, T> {
    list.into_iter()
        .filter_map(|item| Some((header(&item)?.tick, item)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An episode of the given physics version; 0 for none.
    fn made_by(physics: u32) -> Script {
        Script {
            label: String::new(),
            depth: Depth::Metres,
            instruction: String::new(),
            scenario: v1::Scenario {
                task: Some("pick_mustard".into()),
                seed: Some(7),
                ..v1::Scenario::default()
            },
            made_by: (physics, "0.1.0".into()),
            snapshot: bytes::Bytes::new(),
            assets: Vec::new(),
            first_tick: 0,
            last_tick: 0,
            hashes: Vec::new(),
            commands: BTreeMap::new(),
        }
    }

    #[test]
    fn episode_of_another_physics_is_rejected_with_the_fix() {
        let file = Path::new("old.h5");
        assert!(made_by(PHYSICS_VERSION).check_physics(file).is_ok());
        for version in [0, PHYSICS_VERSION - 1, PHYSICS_VERSION + 1] {
            let words = match version {
                0 => "names no physics version".to_owned(),
                other => format!("was made with physics version {other};"),
            };
            let error = made_by(version).check_physics(file).unwrap_err();
            let error = error.to_string();
            assert!(error.starts_with("old.h5 "), "{error}");
            assert!(error.contains(&words), "{error}");
            assert!(error.contains("--task pick_mustard --seed 7"), "{error}");
        }
    }

    #[test]
    fn cameras_of_a_replay_are_the_recorded_ones_unless_others_are_named() {
        let camera = |text: &str| v1::CameraSetting::from_text(text).unwrap();
        let scenario = v1::Scenario {
            cameras: ["gen3=64x48@10", "room=64x48@10"].map(camera).to_vec(),
            ..v1::Scenario::default()
        };
        let others = ["room=960x540@7.5", "gen3=64x48@0"].map(camera);
        let replayed = cameras(&scenario, Some(32), None, &others[..1]);
        let wanted = ["gen3=32x48@10", "room=960x540@7.5"].map(camera);
        assert_eq!(replayed, wanted);
        // A rate of 0 switches a camera off.
        assert_eq!(cameras(&scenario, None, None, &others), [others[0].clone()]);
        for bad in ["room", "room=960@10", "room=axb@10"] {
            assert!(
                v1::CameraSetting::from_text(bad).is_err(),
                "{bad:?} was accepted"
            );
        }
    }
}
