//! Random adversarial policies that try to break the physics.
//!
//! A [`Run`] is a scenario in process, without a network and without cameras:
//! a policy drives the robot at 60 Hz and a judge checks every control tick.

mod guard;
mod judge;
mod policy;
mod recorded;

use std::path::Path;

use anyhow::Result;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use wheelarm_proto::CONTROL_HZ;
use wheelarm_server::sim::{Pacing, Scenario, Simulation};

use crate::TASKS;

pub use guard::{GuardRun, GuardVerdict};
pub use judge::{Judge, Verdict};
pub use policy::{Kind, Policy};
pub use recorded::Recorded;

/// Initial pose of the chair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// Sampled from the seed.
    Sampled,
    /// In front of the kitchen table, within reach of its objects.
    KitchenTable,
    /// In front of the wall beside the kitchen table.
    Wall,
}

/// One run of one policy.
#[derive(Clone, Copy, Debug)]
pub struct Run {
    /// Task below assets/tasks.
    pub task: &'static str,
    /// Kind of policy.
    pub kind: Kind,
    /// Seed of the scene and of the policy.
    pub seed: u64,
    /// Initial pose of the chair.
    pub start: Start,
}

/// `rigid` runs over the rigid tasks and `soft` runs at the bear, with the kinds in turn.
#[must_use]
pub fn runs(rigid: usize, soft: usize, first_seed: u64) -> Vec<Run> {
    let tasks: Vec<&'static str> = TASKS
        .into_iter()
        // Later tasks are left out, so that runs that broke an earlier physics keep their tasks.
        .filter(|task| {
            ![
                "place_teddy_bear",
                "close_drawer",
                "serve_drink",
                "serve_remote",
                "serve_spoonful",
                "take_floor_crackers",
                "throw_meat_can",
            ]
            .contains(task)
        })
        .collect();
    let rigid = (0..rigid).map(|i| {
        let kind = Kind::ANYWHERE[i % Kind::ANYWHERE.len()];
        let start = if i % 3 == 0 {
            Start::KitchenTable
        } else {
            Start::Sampled
        };
        let (task, seed) = (tasks[i % tasks.len()], first_seed + i as u64);
        Run {
            task,
            kind,
            seed,
            start,
        }
    });
    let soft = (0..soft).map(|i| {
        let kind = Kind::AT_THE_BEAR[i % Kind::AT_THE_BEAR.len()];
        let start = if kind == Kind::SqueezeAtWall {
            Start::Wall
        } else {
            Start::KitchenTable
        };
        let (task, seed) = ("place_teddy_bear", first_seed + 10_000 + i as u64);
        Run {
            task,
            kind,
            seed,
            start,
        }
    });
    rigid.chain(soft).collect()
}

impl Run {
    /// The scenario of this run.
    #[must_use]
    pub fn scenario(&self) -> Scenario {
        Scenario {
            task: self.task.to_owned(),
            seed: self.seed,
            cameras: Vec::new(),
            pacing: Pacing::Fast,
            start: match self.start {
                Start::Sampled => None,
                Start::KitchenTable => Some(chair_at(-3.85, 2.48, 86.0)),
                Start::Wall => Some(chair_at(-3.85, 2.48, 60.0)),
            },
            ..Scenario::default()
        }
    }

    /// Plays it for `seconds`; ends early when the judge finds it broken.
    ///
    /// # Errors
    /// When the scenario cannot be made.
    pub fn play(&self, assets: &Path, seconds: f64) -> Result<Verdict> {
        let mut sim = Simulation::new(assets, self.scenario())?;
        let mut policy = Policy::new(self.kind, self.seed, &sim);
        let mut judge = Judge::new(&sim);
        let ticks = (seconds * CONTROL_HZ as f64) as u64;
        for tick in 0..ticks {
            let input = policy.input(tick, &sim);
            sim.step(&input);
            if judge.observe(&sim) {
                break;
            }
        }
        Ok(judge.verdict(&sim))
    }
}

fn chair_at(x: f64, y: f64, degrees: f64) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), degrees.to_radians());
    Isometry3::from_parts(Vector3::new(x, y, 0.0).into(), turn)
}
