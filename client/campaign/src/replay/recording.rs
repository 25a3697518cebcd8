//! Runs the episode of a replay, and reports its new recording.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

use wheelarm_proto::settings::Depth;
use wheelarm_proto::v1;
use wheelarm_rollout::{Backend, Driver, Finished, Limits, Processes, REPLAY, Record, Rollout};

use super::args::ReplayArgs;
use crate::multiply::mark;

/// Runs `driver` as the episode `label` on a server that renders with `adapter`, its choice
/// without one. Scene, task, robot, seed and, unless the options name it, quality are those
/// of the recorded `scenario`, and depth is stored as in the recording.
///
/// # Errors
/// When a program does not start, or the episode fails.
pub(super) fn run(
    args: &ReplayArgs,
    scenario: &v1::Scenario,
    cameras: Vec<v1::CameraSetting>,
    (depth, adapter): (Depth, Option<&str>),
    (label, driver): (String, Driver),
) -> anyhow::Result<Finished> {
    let quality = args.quality.map(|quality| quality.code().into());
    let rollout = Rollout {
        scenario: v1::Scenario {
            scene: scenario.scene.clone(),
            packs: scenario.packs.clone(),
            task: Some(scenario.task().to_owned()),
            robot: scenario.robot.clone(),
            seed: Some(scenario.seed()),
            pacing: v1::Pacing::LockStep.into(),
            quality: quality.unwrap_or(scenario.quality),
            appearance: scenario.appearance,
            person: scenario.person.clone(),
            cameras,
            ..v1::Scenario::default()
        },
        label,
        driver,
        record: args.out.as_ref().map(|out| Record {
            depth,
            ..Record::new(REPLAY, out)
        }),
        limits: Limits::default(),
        folder: None,
        observer: Arc::new(()),
    };
    let backend = Processes::new(args.assets.clone(), adapter.map(str::to_owned))
        .with_packs(&args.packs.packs);
    Ok(backend.run(&rollout)??)
}

/// A new recording.
pub(super) struct Recorded(v1::RecorderStatus);

impl Recorded {
    /// The new recording of an episode; absent when it was not recorded. It keeps the mark
    /// of a multiplied source.
    ///
    /// # Errors
    /// When the mark cannot be written.
    pub fn new(args: &ReplayArgs, finished: &Finished) -> anyhow::Result<Option<Self>> {
        let Some(status) = &finished.recorded else {
            return Ok(None);
        };
        mark::keep(&args.file, Path::new(&status.path))?;
        Ok(Some(Self(status.clone())))
    }

    /// File and state as text.
    pub fn line(&self) -> String {
        let Self(status) = self;
        format!(
            "{} ({}, {} missed)",
            status.path,
            if status.complete {
                "complete"
            } else {
                "NOT complete"
            },
            status.missed
        )
    }

    /// 3 when it is not complete.
    pub fn code(&self) -> ExitCode {
        match self.0.complete && self.0.missed == 0 {
            true => ExitCode::SUCCESS,
            false => ExitCode::from(3),
        }
    }
}
