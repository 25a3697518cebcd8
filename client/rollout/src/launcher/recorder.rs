//! A recorder of a command's own: `wheelarm record` at its server.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::bail;
use serde::{Deserialize, Serialize};
use wheelarm_proto::settings::{Depth, Named};
use wheelarm_proto::v1;
use wheelarm_sdk::{Client, Connect};

use super::process::{Input, Launch, Process, Program};
use crate::limits;
use crate::serde_text::named;

/// Settings of a recording.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Record {
    /// Folder for the file.
    pub out: PathBuf,
    /// Folder for the recording before it is complete; `out` when absent.
    #[serde(default)]
    pub scratch: Option<PathBuf>,
    /// Storage of depth.
    #[serde(with = "named")]
    pub depth: Depth,
    /// Name of the recorder at the server.
    pub name: String,
}

impl Record {
    /// Records into `out`, depth in metres.
    #[must_use]
    pub fn new(name: &str, out: &Path) -> Self {
        Self {
            out: out.to_owned(),
            scratch: None,
            depth: Depth::Metres,
            name: name.to_owned(),
        }
    }
}

/// Lifetime of a recorder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lifetime {
    /// It records one episode and exits. Its messages go to `recorder.log` in its folder,
    /// and it is killed with this process: the episode is made again.
    OneEpisode,
    /// It records every episode. It ends with this process in good order and leaves a
    /// partial file.
    Lasting,
}

/// A recorder; killed when dropped.
#[derive(Debug)]
pub struct Recorder {
    name: String,
    /// The process.
    pub process: Process,
}

impl Recorder {
    /// Starts a recorder at a server.
    ///
    /// # Errors
    /// When it cannot be started.
    pub fn start(connect: &Connect, record: &Record, lifetime: Lifetime) -> anyhow::Result<Self> {
        let mut arguments: Vec<OsString> = [
            "--connect",
            &connect.endpoint,
            "--sim",
            &connect.sim,
            "record",
            "--name",
            &record.name,
            "--depth",
            record.depth.name(),
        ]
        .map(OsString::from)
        .to_vec();
        arguments.extend(["--out".into(), (&record.out).into()]);
        if let Some(scratch) = &record.scratch {
            arguments.extend(["--scratch".into(), scratch.into()]);
        }
        let (more, input, folder): (&[&str], _, _) = match lifetime {
            Lifetime::OneEpisode => (
                &["--episodes", "1"],
                Input::Text(String::new()),
                Some(record.out.clone()),
            ),
            Lifetime::Lasting => (&["--end-with-stdin"], Input::Lifeline, None),
        };
        arguments.extend(more.iter().map(OsString::from));
        let process = Process::start(Launch {
            name: "recorder",
            program: Program::Own("wheelarm"),
            environment: Vec::new(),
            arguments,
            input,
            folder,
        })?;
        Ok(Self {
            name: record.name.clone(),
            process,
        })
    }

    /// Waits until it has finished the file of an episode.
    ///
    /// # Errors
    /// When the recording failed, the recorder ended or takes too long.
    pub fn finished(
        &mut self,
        client: &Client,
        episode: u64,
    ) -> anyhow::Result<v1::RecorderStatus> {
        let deadline = Instant::now() + limits::FINISH;
        loop {
            let status = client.request(&v1::StatusRequest {})?;
            let ours = status.recorders.into_iter().find(|recorder| {
                let header = recorder.header.as_ref();
                recorder.recorder == self.name && header.is_some_and(|h| h.episode == episode)
            });
            if let Some(status) = ours {
                match status.state() {
                    v1::RecorderState::Finished => return Ok(status),
                    v1::RecorderState::Failed => bail!("the recording failed: {}", status.message),
                    _ => {}
                }
            }
            if let Some(status) = self.process.ended()? {
                bail!("the recorder ended ({status}):\n{}", self.process.tail());
            }
            if Instant::now() > deadline {
                bail!(
                    "the recorder did not finish within {:.0} s:\n{}",
                    limits::FINISH.as_secs_f64(),
                    self.process.tail()
                );
            }
            std::thread::sleep(limits::LOOK);
        }
    }

    /// Lets it end in good order: what it has of an episode becomes a partial
    /// file.
    pub fn end(mut self) {
        // One that cannot be watched is killed when dropped.
        let _ = self.process.end();
    }
}
