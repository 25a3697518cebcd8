//! What a recording tells a replay: where to start and what to do at each tick.

use std::collections::BTreeMap;

use anyhow::{Context, bail};
use wheelarm_dataset::read::Episode;
use wheelarm_proto::{TICKS_PER_CONTROL, v1};

/// An episode as a script.
#[derive(Clone, Debug)]
pub(super) struct Script {
    pub label: String,
    pub instruction: String,
    pub scenario: v1::Scenario,
    pub snapshot: bytes::Bytes,
    pub first_tick: u64,
    pub last_tick: u64,
    /// State hashes by tick.
    pub hashes: Vec<(u64, u64)>,
    applied: BTreeMap<u64, v1::Applied>,
    phases: BTreeMap<u64, (i32, String)>,
}

impl Script {
    /// Reads what replay needs and checks that no tick is missing.
    pub fn read(episode: &Episode) -> anyhow::Result<Self> {
        let started = episode.started()?;
        let snapshot = episode.snapshot()?;
        let header = snapshot.header.unwrap_or_default();
        if snapshot.snapshot.is_empty() {
            bail!("the file holds no snapshot to start from");
        }
        let applied = by_tick(episode.applied()?, |applied| applied.header.as_ref());
        let phases = episode
            .commands()?
            .into_iter()
            .filter_map(|log| Some((log.header?.tick, log.command?)))
            .map(|(tick, command)| (tick, (command.phase, command.phase_name)))
            .collect();
        let last_tick = *applied
            .last_key_value()
            .context("the file holds no applied command")?
            .0;
        let script = Self {
            label: started.label.clone(),
            instruction: started.instruction.clone(),
            scenario: episode.scenario()?,
            snapshot: snapshot.snapshot,
            first_tick: header.tick,
            last_tick,
            hashes: episode.state_hashes()?,
            applied,
            phases,
        };
        let ticks = (script.first_tick..=last_tick).step_by(TICKS_PER_CONTROL as usize);
        for tick in ticks {
            if !script.applied.contains_key(&tick) {
                bail!(
                    "the applied command of tick {tick} is missing in the file, so the episode cannot be done again exactly"
                );
            }
        }
        Ok(script)
    }

    /// What was newly applied at `tick`, as a command.
    pub fn command(&self, tick: u64) -> anyhow::Result<v1::Command> {
        let applied = self
            .applied
            .get(&tick)
            .with_context(|| format!("the recording has no tick {tick}"))?;
        let (phase, phase_name) = self.phases.get(&tick).cloned().unwrap_or_default();
        Ok(v1::Command {
            arm: applied.arm.clone(),
            base: applied.base,
            gripper: applied.gripper,
            phase,
            phase_name,
            ..v1::Command::default()
        })
    }

    /// Cameras of a new recording: the recorded ones in another size if asked,
    /// and `others` as `NAME=WIDTHxHEIGHT@HZ`.
    pub fn cameras(
        &self,
        width: Option<u32>,
        height: Option<u32>,
        others: &[String],
    ) -> anyhow::Result<Vec<v1::CameraSetting>> {
        let mut cameras = self.scenario.cameras.clone();
        for camera in &mut cameras {
            camera.width = width.unwrap_or(camera.width);
            camera.height = height.unwrap_or(camera.height);
        }
        for text in others {
            let camera = camera_setting(text)?;
            cameras.retain(|known| known.name != camera.name);
            cameras.push(camera);
        }
        cameras.retain(|camera| camera.rate_hz > 0.0);
        Ok(cameras)
    }

    /// Quality of the recorded pictures, as the server takes it.
    pub fn quality(&self) -> &'static str {
        match self.scenario.quality() {
            v1::RenderQuality::Fast => "fast",
            v1::RenderQuality::High => "high",
            v1::RenderQuality::Standard | v1::RenderQuality::Unspecified => "standard",
        }
    }
}

fn by_tick<T>(list: Vec<T>, header: impl Fn(&T) -> Option<&v1::Header>) -> BTreeMap<u64, T> {
    list.into_iter()
        .filter_map(|item| Some((header(&item)?.tick, item)))
        .collect()
}

/// Reads `NAME=WIDTHxHEIGHT@HZ`.
fn camera_setting(text: &str) -> anyhow::Result<v1::CameraSetting> {
    let read = || {
        let (name, rest) = text.split_once('=')?;
        let (size, rate) = rest.split_once('@')?;
        let (width, height) = size.split_once('x')?;
        Some(v1::CameraSetting {
            name: name.to_owned(),
            width: width.parse().ok()?,
            height: height.parse().ok()?,
            rate_hz: rate.parse().ok()?,
        })
    };
    read().with_context(|| {
        format!("{text:?} is not NAME=WIDTHxHEIGHT@HZ, for example room=960x540@10")
    })
}

/// A camera as the server's option.
pub(super) fn camera_option(camera: &v1::CameraSetting) -> String {
    format!(
        "{}={}x{}@{}",
        camera.name, camera.width, camera.height, camera.rate_hz
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_are_read_and_wrong_ones_refused() {
        let camera = camera_setting("room=960x540@7.5").unwrap();
        assert_eq!(camera_option(&camera), "room=960x540@7.5");
        for bad in ["room", "room=960@10", "room=axb@10", "room=960x540"] {
            assert!(camera_setting(bad).is_err(), "{bad:?} was taken");
        }
    }
}
