//! Summary of a file: its attributes, and the account of every stream.

use hdf5::Location;

use super::error::ReadError;
use super::{Episode, number, text, texts};
use crate::account::StreamAccount;
use crate::ending::PHYSICS;

/// Summary of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    /// Label of the episode.
    pub label: String,
    /// Instruction sentence.
    pub instruction: String,
    /// Task, activity and area.
    pub task: [String; 3],
    /// Seed of the scenario.
    pub seed: u64,
    /// The task succeeded.
    pub success: bool,
    /// Why it failed; empty when it did not.
    pub failure_reason: String,
    /// Why the episode ended, a value of [`crate::ending::end_cause`];
    /// empty when that is unknown.
    pub end_cause: String,
    /// Text of irregularities of the simulation.
    pub anomalies: Vec<String>,
    /// Its codes in the same order, for example `escaped`; none in older files.
    pub anomaly_kinds: Vec<String>,
    /// Conditions with their state and measured value at the end.
    pub conditions: Vec<(String, bool, f64)>,
    /// Whether the first image of a camera shows the target of the task; `None` in
    /// recordings without instance IDs or a target, and in older ones.
    pub target_in_first_images: Option<bool>,
    /// Its states were played back from another recording, not computed.
    pub as_recorded: bool,
    /// It contains every published sample.
    pub complete: bool,
    /// Reasons why it is not complete.
    pub problems: Vec<String>,
    /// One account per stream.
    pub streams: Vec<StreamAccount>,
    /// First and last simulation time of any stream, nanoseconds.
    pub span_nanos: (u64, u64),
    /// Wall seconds that the episode took.
    pub wall_seconds: Option<f64>,
    /// Server version, adapter, recorder, recorder version, quality, pacing.
    pub origin: [String; 6],
    /// Unit of the depth images.
    pub depth_unit: String,
    /// Version of the layout.
    pub schema_version: String,
}

impl Episode {
    /// Label of the episode, as stored there.
    ///
    /// # Errors
    /// When the attribute is absent.
    pub fn label(&self) -> Result<String, ReadError> {
        text(&self.file, "label").map_err(|e| self.hdf5("label", e))
    }

    /// What the file says of itself.
    ///
    /// # Errors
    /// When an attribute is absent, or the label could not name a file.
    pub fn summary(&self) -> Result<Summary, ReadError> {
        let at: &Location = &self.file;
        let string = |name: &str| text(at, name).map_err(|e| self.hdf5(name, e));
        let label = string("label")?;
        // It names files and folders of the export.
        wheelarm_proto::check::label(&label).map_err(|problem| ReadError::Content {
            path: self.path.clone(),
            what: "the attribute `label`".to_owned(),
            reason: format!("{problem}; leave the file out, or give it such a label"),
        })?;
        let instruction = string("instruction")?;
        wheelarm_proto::check::instruction(&instruction).map_err(|problem| ReadError::Content {
            path: self.path.clone(),
            what: "the attribute `instruction`".to_owned(),
            reason: format!("{problem}; leave the file out, or copy it again"),
        })?;
        let mut conditions = Vec::new();
        for name in at.attr_names().map_err(|e| self.hdf5("attributes", e))? {
            if let Some(condition) = name.strip_prefix("condition ")
                && let Ok(holds) = number::<bool>(at, &name)
            {
                let value = number(at, &format!("condition value {condition}"));
                conditions.push((condition.to_owned(), holds, value.unwrap_or(f64::NAN)));
            }
        }
        let mut span = (u64::MAX, 0);
        let mut streams = Vec::new();
        for name in self.streams()? {
            let group = self.group(&name)?;
            let stamps = self.u64s(&name, "stamp_nanos")?;
            if let (Some(first), Some(last)) = (stamps.first(), stamps.last()) {
                span = (span.0.min(*first), span.1.max(*last));
            }
            let count = |what: &str| number::<u64>(&group, what).unwrap_or(0);
            let least = |what: &str| number::<u64>(&group, &format!("{what}_at_least")).ok();
            let digest = |what: &str| text(&group, what).unwrap_or_default();
            let unknown = least("expected").zip(least("missed"));
            let counts = || (count("expected"), count("missed"));
            let (expected, missed) = unknown.unwrap_or_else(counts);
            streams.push(StreamAccount {
                expected,
                received: count("received"),
                missed,
                counted: unknown.is_none(),
                recovered: count("recovered"),
                digest: digest("digest"),
                published: digest("digest_published"),
                stream: name,
            });
        }
        if span.0 > span.1 {
            span = (0, 0);
        }
        Ok(Summary {
            label,
            instruction,
            task: [string("task")?, string("activity")?, string("area")?],
            seed: number(at, "seed").map_err(|e| self.hdf5("seed", e))?,
            success: number(at, "success").map_err(|e| self.hdf5("success", e))?,
            failure_reason: string("failure_reason")?,
            end_cause: text(at, "end_cause").unwrap_or_default(),
            anomalies: texts(at, "anomalies").unwrap_or_default(),
            anomaly_kinds: texts(at, "anomaly_kinds").unwrap_or_default(),
            conditions,
            complete: number(at, "complete").map_err(|e| self.hdf5("complete", e))?,
            target_in_first_images: number(at, "target_in_first_images").ok(),
            as_recorded: number(at, "as_recorded").unwrap_or_default(),
            problems: texts(at, "problems").map_err(|e| self.hdf5("problems", e))?,
            streams,
            span_nanos: span,
            wall_seconds: number(at, "wall_seconds").ok(),
            origin: [
                string("server_version")?,
                string("adapter")?,
                string("recorder")?,
                string("recorder_version")?,
                string("quality")?,
                string("pacing")?,
            ],
            depth_unit: string("depth_unit")?,
            schema_version: string("schema_version")?,
        })
    }

    /// Whether the simulation broke in it: it is neither a success nor fit for training.
    #[must_use]
    pub fn is_broken(&self) -> bool {
        text(&self.file, "end_cause").is_ok_and(|cause| cause == PHYSICS)
    }
}
