//! The rig of a replay: a server with the recording's scenario, and a
//! recorder where it is recorded again.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use wheelarm_link::Link;
use wheelarm_proto::settings::Depth;
use wheelarm_proto::v1;
use wheelarm_rollout::launcher::{Recorder, RecorderOptions, Server, ServerOptions};

use super::args::ReplayArgs;
use crate::multiply::mark;

/// Name under which a replay commands and records.
pub(super) const NAME: &str = "replay";

/// A server, the link to it, and a recorder if there is to be a new file.
pub(super) struct Rig {
    pub server: Server,
    pub link: Link,
    recorder: Option<Recorder>,
    /// What is replayed.
    source: PathBuf,
}

impl Rig {
    /// Starts them; draws on `adapter`, the server's choice without one. Scene, task,
    /// robot, seed and, unless the options say otherwise, quality are the recording's;
    /// so is the form of its depth.
    ///
    /// # Errors
    /// When one of them does not start.
    pub fn start(
        args: &ReplayArgs,
        scenario: &v1::Scenario,
        cameras: Vec<v1::CameraSetting>,
        depth: Depth,
        adapter: Option<&str>,
    ) -> anyhow::Result<Self> {
        let quality = args.quality.map(|quality| quality.code().into());
        let server = Server::start(&ServerOptions {
            scenario: v1::Scenario {
                scene: scenario.scene.clone(),
                task: Some(scenario.task().to_owned()),
                robot: scenario.robot.clone(),
                seed: Some(scenario.seed()),
                pacing: v1::Pacing::LockStep.into(),
                quality: quality.unwrap_or(scenario.quality),
                look: scenario.look,
                person: scenario.person.clone(),
                cameras,
                ..v1::Scenario::default()
            },
            assets: args.assets.clone(),
            adapter: adapter.map(str::to_owned),
            ..ServerOptions::default()
        })?;
        let link = server.link()?;
        let options = args.out.as_deref().map(|out| RecorderOptions {
            depth,
            ..RecorderOptions::lasting(NAME, out)
        });
        let recorder = options
            .map(|options| Recorder::start(server.connect(), &options))
            .transpose()?;
        Ok(Self {
            server,
            link,
            recorder,
            source: args.file.clone(),
        })
    }

    /// Recorders that an episode is to wait for.
    pub fn recorders(&self) -> u32 {
        u32::from(self.recorder.is_some())
    }

    /// The finished file of an episode that has ended, if it was recorded.
    ///
    /// # Errors
    /// When the recording failed.
    pub fn recorded(&mut self, started: &v1::EpisodeStarted) -> anyhow::Result<Option<Recorded>> {
        let number = started.header.as_ref().map_or(0, |header| header.episode);
        let Some(recorder) = self.recorder.as_mut() else {
            return Ok(None);
        };
        let recorded = Recorded(recorder.finished(&self.link, number)?);
        mark::keep(&self.source, Path::new(&recorded.0.path))?;
        Ok(Some(recorded))
    }

    /// Ends them.
    ///
    /// # Errors
    /// When the server cannot be asked.
    pub fn stop(self) -> anyhow::Result<()> {
        drop(self.recorder);
        self.server.stop(self.link)
    }
}

/// A new recording.
pub(super) struct Recorded(v1::RecorderStatus);

impl Recorded {
    /// File and state in a few words.
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
