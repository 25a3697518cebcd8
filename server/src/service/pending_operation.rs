//! Operations that take long. The simulation thread answers queries meanwhile; other
//! operations wait.

use std::sync::mpsc::Receiver;

use wheelarm_proto::v1;
use zenoh::query::Query;

use super::denied::Denied;
use crate::sim::Simulation;

/// A simulation that was loaded beside the running one.
pub(super) struct Loaded {
    pub(super) sim: Simulation,
    pub(super) asset_texts: Vec<v1::AssetText>,
}

/// Permission of a client to replace the simulation.
pub(super) struct Permission {
    /// Replace it even while another client holds control.
    pub(super) force: bool,
    /// Secret of the lease, if the client holds control.
    pub(super) secret: String,
}

/// A pending operation and the query to answer.
pub(super) enum PendingOperation {
    /// A scenario is loading; the current simulation continues.
    Load {
        query: Query,
        right: Permission,
        loading: Receiver<Result<Loaded, Denied>>,
    },
    /// The loaded simulation replaces the current one after pending images are
    /// rendered.
    Place {
        query: Query,
        right: Permission,
        loaded: Box<Loaded>,
    },
    /// A recorded state is played back when cameras and recorders are ready.
    Show {
        query: Query,
        request: Box<v1::PlaybackRequest>,
    },
    /// An episode begins after earlier images are rendered.
    Start {
        query: Query,
        request: v1::EpisodeStartRequest,
    },
    /// The episode ends after its last images are published; without a query when no
    /// client requested it.
    Stop {
        query: Option<Query>,
        discard: bool,
        cause: v1::EndCause,
    },
}

impl PendingOperation {
    /// Why time is paused; `None` when it is not.
    pub(super) fn pause_reason(&self) -> Option<&'static str> {
        match self {
            Self::Load { .. } | Self::Show { .. } => None,
            Self::Place { .. } | Self::Start { .. } | Self::Stop { .. } => {
                Some("the cameras, which render the last images")
            }
        }
    }
}
