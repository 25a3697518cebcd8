//! What answers for a robot, and what can be wrong with it.

use std::ops::RangeInclusive;

use wheelarm_policy::{ActionKind, ChunkError, RowError};
use wheelarm_proto::v1;

/// What answers for a robot.
pub trait Policy: Send + Sync {
    /// What it wants and answers.
    fn spec(&self) -> &v1::PolicySpec;

    /// An episode begins.
    ///
    /// # Errors
    /// [`PolicyError`].
    fn reset(&self, request: v1::PolicyResetRequest) -> Result<(), PolicyError>;

    /// What is to be done.
    ///
    /// # Errors
    /// [`PolicyError`], which ends the episode that asked.
    fn infer(&self, observation: v1::PolicyObservation) -> Result<v1::PolicyChunk, PolicyError>;
}

/// What can be wrong with a policy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PolicyError {
    /// It does not start, or not as a policy.
    #[error("the policy does not start: {0}")]
    Start(String),
    /// It has ended.
    #[error("the policy ended: {0}")]
    Gone(String),
    /// It does not answer.
    #[error("the policy did not answer `{query}` within {seconds:.0} s")]
    Silent {
        /// Query.
        query: &'static str,
        /// How long, wall time.
        seconds: f64,
    },
    /// It says itself why it does not answer.
    #[error("the policy says: {0}")]
    Said(String),
    /// Its answer is no answer.
    #[error("the policy answers `{query}` wrongly: {problem}")]
    Garbled {
        /// Query.
        query: &'static str,
        /// What is wrong with it.
        problem: String,
    },
    /// Its rows cannot be carried out.
    #[error(transparent)]
    Chunk(#[from] ChunkError),
    /// A row of which no command can be made.
    #[error(transparent)]
    Row(#[from] RowError),
    /// The server refused its command.
    #[error("the server refused the policy's command: {0}")]
    Refused(String),
    /// It was made for something else.
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
            Self::Said(_) => "said",
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
/// [`PolicyError::Unfit`] where nobody could carry them out.
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
            "its rate is {} Hz; allowed is what divides {control}, from 1 to {control}",
            spec.rate_hz
        ));
    }
    let (chunk, execute) = (spec.chunk, spec.execute);
    if !(1..=MOST_ROWS).contains(&chunk) || !(1..=chunk).contains(&execute) {
        return unfit(format!(
            "it answers {chunk} rows and carries {execute} of them out; allowed is 1 to {MOST_ROWS} rows, of which one at least is carried out"
        ));
    }
    if spec.history > MOST_MOMENTS || spec.max_batch > MOST_OBSERVATIONS {
        return unfit(format!(
            "it wants {} moments and {} observations at a time; allowed is {MOST_MOMENTS} and {MOST_OBSERVATIONS}",
            spec.history, spec.max_batch
        ));
    }
    for camera in &spec.cameras {
        let sides = [camera.width, camera.height];
        if !sides.iter().all(|side| SIDES.contains(side)) {
            return unfit(format!(
                "it wants pictures of {}x{} pixels of {:?}; allowed is {} to {} a side",
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

/// Most rows of an answer.
const MOST_ROWS: u32 = 1000;
/// Most moments of an observation.
const MOST_MOMENTS: u32 = 64;
/// Most observations of a request.
const MOST_OBSERVATIONS: u32 = 256;
/// Sides that a server's pictures may have, pixels.
const SIDES: RangeInclusive<u32> = 16..=4096;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_nobody_could_carry_out_is_refused_in_words() {
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
        for (words, told) in [
            ("divides 60", wrong(&|s| s.rate_hz = 7.0)),
            ("divides 60", wrong(&|s| s.rate_hz = f64::NAN)),
            ("divides 60", wrong(&|s| s.rate_hz = 0.0)),
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
            assert!(told.contains(words), "{told}");
        }
    }
}
