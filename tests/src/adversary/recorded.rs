//! Recorded commands that broke an earlier version of the physics.

use std::path::Path;

use anyhow::{Context as _, Result};
use prost::Message as _;
use wheelarm_proto::v1;
use wheelarm_proto::{CONTROL_HZ, TICKS_PER_CONTROL};
use wheelarm_server::robot::control::{ControlInput, GripperMap};
use wheelarm_server::service::convert;
use wheelarm_server::sim::{Pacing, Scenario, Simulation};

use super::{Judge, Verdict};

/// Length of a run after its last command, seconds.
const BEYOND: f64 = 2.0;

/// One run: the scenario with its sampled values, then every command with the control tick
/// at which it was applied; each message follows its length.
#[derive(Debug)]
pub struct Recorded {
    scenario: Scenario,
    commands: Vec<v1::Applied>,
}

impl Recorded {
    /// Reads a run.
    ///
    /// # Errors
    /// When the file cannot be read or decoded.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).with_context(|| format!("{}", path.display()))?;
        let mut rest = bytes.as_slice();
        let scenario = v1::Scenario::decode_length_delimited(&mut rest)?;
        let mut commands = Vec::new();
        while !rest.is_empty() {
            commands.push(v1::Applied::decode_length_delimited(&mut rest)?);
        }
        // The commands were recorded in lock-step, and a scenario cannot change the pacing.
        let known = Scenario {
            pacing: Pacing::LockStep,
            ..Scenario::default()
        };
        let scenario = Scenario {
            cameras: Vec::new(),
            pacing: Pacing::Fast,
            ..convert::scenario_over(&known, &scenario)?
        };
        Ok(Self { scenario, commands })
    }

    /// Plays it until two seconds after its last command, which stays in force.
    ///
    /// # Errors
    /// When the scenario cannot be made or a command is malformed.
    pub fn play(&self, assets: &Path) -> Result<Verdict> {
        let mut sim = Simulation::new(assets, self.scenario.clone())?;
        let map = GripperMap::new(sim.model());
        let mut judge = Judge::new(&sim);
        let mut commands = self.commands.iter().peekable();
        let last = self.commands.last().and_then(|c| c.header.as_ref());
        let beyond = (BEYOND * CONTROL_HZ as f64) as u64;
        let last = last.map_or(0, |header| header.tick / TICKS_PER_CONTROL) + beyond;
        for tick in 0..last {
            let mut input = ControlInput::default();
            let now = tick * TICKS_PER_CONTROL;
            while let Some(taken) =
                commands.next_if(|c| c.header.as_ref().is_none_or(|header| header.tick <= now))
            {
                let command = v1::Command {
                    arm: taken.arm.clone(),
                    base: taken.base,
                    gripper: taken.gripper,
                    ..v1::Command::default()
                };
                input = convert::control_input(&command, &map)?;
            }
            sim.step(&input);
            if judge.observe(&sim) {
                break;
            }
        }
        Ok(judge.verdict(&sim))
    }
}
