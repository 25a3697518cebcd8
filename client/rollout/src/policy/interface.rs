//! The interface of policies, and their errors.

use std::ops::RangeInclusive;

use wheelarm_policy::{ActionKind, ChunkError, RowError};
use wheelarm_proto::v1;

/// A policy: returns action chunks for observations.
pub trait Policy: Send + Sync {
    /// Description of its observations and actions.
    fn spec(&self) -> &v1::PolicySpec;

    /// Begins an episode.
    ///
    /// # Errors
    /// [`PolicyError`].
    fn reset(&self, request: v1::PolicyResetRequest) -> Result<(), PolicyError>;

    /// Returns the action chunk for an observation.
    ///
    /// # Errors
    /// [`PolicyError`], which ends the episode.
    fn infer(&self, observation: v1::PolicyObservation) -> Result<v1::PolicyChunk, PolicyError>;
}

/// Errors of a policy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PolicyError {
    /// The process does not start, or is not a policy.
    #[error("the policy does not start: {0}")]
    Start(String),
    /// The policy has ended.
    #[error("the policy ended: {0}")]
    Gone(String),
    /// The policy does not reply.
    #[error("the policy did not reply to `{query}` within {seconds:.0} s")]
    Silent {
        /// Query.
        query: &'static str,
        /// Wall time of the wait, s.
        seconds: f64,
    },
    /// The policy returned an error.
    #[error("the policy returned an error: {0}")]
    Rejected(String),
    /// The reply is malformed.
    #[error("the policy returned a malformed reply to `{query}`: {problem}")]
    Garbled {
        /// Query.
        query: &'static str,
        /// Problem of the reply.
        problem: String,
    },
    /// Its rows cannot be executed.
    #[error(transparent)]
    Chunk(#[from] ChunkError),
    /// A row without a valid command.
    #[error(transparent)]
    Row(#[from] RowError),
    /// The server rejected its command.
    #[error("the server refused the policy's command: {0}")]
    Refused(String),
    /// The policy is incompatible with the robot or the server.
    #[error("the policy does not fit: {0}")]
    Unfit(String),
}

impl PolicyError {
    /// Its kind in one word, for counts.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Start(_) => "start",
            Self::Gone(_) => "ended",
            Self::Silent { .. } => "silent",
            Self::Rejected(_) => "rejected",
            Self::Garbled { .. } => "garbled",
            Self::Chunk(_) => "chunk",
            Self::Row(_) => "row",
            Self::Refused(_) => "refused",
            Self::Unfit(_) => "unfit",
        }
    }
}

/// Kind of the rows of a spec, and control ticks of one.
///
/// # Errors
/// [`PolicyError::Unfit`] when they cannot be executed.
pub fn checked(spec: &v1::PolicySpec) -> Result<(ActionKind, u32), PolicyError> {
    let unfit = |words: String| Err(PolicyError::Unfit(words));
    let kind = match spec.action() {
        v1::PolicyAction::Unspecified | v1::PolicyAction::NextPose => ActionKind::NextPose,
        v1::PolicyAction::NextJoints => ActionKind::NextJoints,
    };
    let control = wheelarm_proto::CONTROL_HZ as f64;
    let ticks = control / spec.rate_hz;
    if !(1.0..=control).contains(&ticks) || ticks.fract() != 0.0 {
        return unfit(format!(
            "its rate is {} Hz; it must divide {control}, from 1 to {control}",
            spec.rate_hz
        ));
    }
    let (chunk, execute) = (spec.chunk, spec.execute);
    if !(1..=MOST_ROWS).contains(&chunk) || !(1..=chunk).contains(&execute) {
        return unfit(format!(
            "its chunks have {chunk} rows, of which {execute} are executed; allowed are 1 to {MOST_ROWS} rows, of which at least one is executed"
        ));
    }
    if spec.history > MOST_MOMENTS || spec.max_batch > MOST_OBSERVATIONS {
        return unfit(format!(
            "it needs {} moments and {} observations at a time; allowed are {MOST_MOMENTS} and {MOST_OBSERVATIONS}",
            spec.history, spec.max_batch
        ));
    }
    for camera in &spec.cameras {
        let sides = [camera.width, camera.height];
        if !sides.iter().all(|side| SIDES.contains(side)) {
            return unfit(format!(
                "it needs images of {}x{} pixels of {:?}; allowed are {} to {} per side",
                camera.width,
                camera.height,
                camera.name,
                SIDES.start(),
                SIDES.end()
            ));
        }
    }
    Ok((kind, ticks as u32))
}

/// Most rows of a chunk.
const MOST_ROWS: u32 = 1000;
/// Most moments of an observation.
const MOST_MOMENTS: u32 = 64;
/// Most observations of a request.
const MOST_OBSERVATIONS: u32 = 256;
/// Allowed sides of images, pixels.
const SIDES: RangeInclusive<u32> = 16..=4096;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_description_is_rejected() {
        let good = v1::PolicySpec {
            rate_hz: 10.0,
            chunk: 20,
            execute: 10,
            ..Default::default()
        };
        assert_eq!(checked(&good), Ok((ActionKind::NextPose, 6)));
        let wrong = |change: &dyn Fn(&mut v1::PolicySpec)| {
            let mut spec = good.clone();
            change(&mut spec);
            checked(&spec).unwrap_err().to_string()
        };
        let camera = |width, height| v1::PolicyCamera {
            name: "gen3".to_owned(),
            width,
            height,
            depth: false,
        };
        for (words, error) in [
            ("divide 60", wrong(&|s| s.rate_hz = 7.0)),
            ("divide 60", wrong(&|s| s.rate_hz = f64::NAN)),
            ("divide 60", wrong(&|s| s.rate_hz = 0.0)),
            ("1 to 1000 rows", wrong(&|s| s.execute = 21)),
            ("1 to 1000 rows", wrong(&|s| s.chunk = 0)),
            ("1 to 1000 rows", wrong(&|s| s.chunk = u32::MAX)),
            ("moments", wrong(&|s| s.history = 1 << 20)),
            (
                "16 to 4096",
                wrong(&|s| s.cameras.push(camera(1 << 30, 16))),
            ),
            ("16 to 4096", wrong(&|s| s.cameras.push(camera(8, 8)))),
        ] {
            assert!(error.contains(words), "{error}");
        }
    }
}
