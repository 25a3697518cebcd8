//! Acts that take long. The simulation thread goes on answering meanwhile; other
//! acts wait their turn.

use std::sync::mpsc::Receiver;

use wheelarm_proto::v1;
use zenoh::query::Query;

use super::denied::Denied;
use crate::sim::Simulation;

/// A simulation that was set up beside the running one.
pub(super) struct Loaded {
    pub(super) sim: Simulation,
    pub(super) asset_texts: Vec<v1::AssetText>,
}

/// By what right a client takes the world of others away.
pub(super) struct Right {
    /// It insists.
    pub(super) force: bool,
    /// Secret of the lease, from who is in control.
    pub(super) secret: String,
}

/// What is being done, for whom.
pub(super) enum Errand {
    /// A scenario is being set up; the world in force goes on.
    Load {
        asked: Query,
        right: Right,
        loading: Receiver<Result<Loaded, Denied>>,
    },
    /// It takes the place of the one in force when the cameras have drawn that.
    Place {
        asked: Query,
        right: Right,
        loaded: Box<Loaded>,
    },
    /// A recorded state is shown when cameras and recorders are ready for it.
    Show {
        asked: Query,
        request: Box<v1::ShowRequest>,
    },
    /// An episode begins when the cameras have drawn what was before it.
    Start {
        asked: Query,
        request: v1::EpisodeStartRequest,
    },
    /// The episode ends when its last pictures are out; nobody may have asked.
    Stop {
        asked: Option<Query>,
        discard: bool,
        cause: v1::EndCause,
    },
}

impl Errand {
    /// What time is paused for, if it does.
    pub(super) fn holds_up(&self) -> Option<&'static str> {
        match self {
            Self::Load { .. } | Self::Show { .. } => None,
            Self::Place { .. } | Self::Start { .. } | Self::Stop { .. } => {
                Some("the cameras, which draw the last pictures")
            }
        }
    }
}
