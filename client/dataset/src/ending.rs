//! Reasons for the end of an episode, as stored in files.

use wheelarm_proto::v1;

/// `end_cause` of an episode that ended because the simulation broke.
pub const PHYSICS: &str = "physics";

/// Why the episode ended, in a word; empty when the end is unknown.
#[must_use]
pub fn end_cause(cause: v1::EndCause) -> &'static str {
    match cause {
        v1::EndCause::Unspecified => "",
        v1::EndCause::Requested => "asked",
        v1::EndCause::Physics => PHYSICS,
        v1::EndCause::Recorders => "recorders",
        v1::EndCause::Shutdown => "shutdown",
    }
}
