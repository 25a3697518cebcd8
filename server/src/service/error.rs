//! Why a service ends early.

use wheelarm_proto::program::without_source_places;

use crate::sensors::camera::RenderError;
use crate::sensors::models::SensorError;
use crate::sim::SimError;

/// Why a service ended early.
#[derive(Debug, thiserror::Error)]
pub enum ServiceError {
    /// Error of the transport.
    #[error("Zenoh: {0}")]
    Zenoh(String),
    /// Invalid endpoint.
    #[error("{0}")]
    Endpoint(String),
    /// Invalid keys or users.
    #[error(transparent)]
    Access(#[from] wheelarm_access::AccessError),
    /// Error of the cameras.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// Invalid scenario.
    #[error(transparent)]
    Sim(Box<SimError>),
    /// Invalid table of materials for sensor models.
    #[error(transparent)]
    Sensors(#[from] SensorError),
    /// Unreadable asset file that recordings store.
    #[error("cannot read {0}")]
    Assets(String),
    /// Another server uses this name.
    #[error("a server named {0:?} is already on this network; choose another with --sim NAME")]
    NameTaken(String),
    /// Failure of the simulation thread.
    #[error("the simulation thread {0}")]
    Thread(String),
}

impl From<SimError> for ServiceError {
    fn from(e: SimError) -> Self {
        Self::Sim(Box::new(e))
    }
}

impl From<zenoh::Error> for ServiceError {
    fn from(e: zenoh::Error) -> Self {
        Self::Zenoh(without_source_places(&e.to_string()))
    }
}
