//! Why a service ends early.

use wheelarm_proto::program::without_source_places;

use crate::sensors::camera::RenderError;
use crate::sensors::models::SensorError;
use crate::sim::SimError;

/// Why a service ended early.
#[derive(Debug, thiserror::Error)]
pub enum ServiceError {
    /// The transport.
    #[error("Zenoh: {0}")]
    Zenoh(String),
    /// An endpoint to listen on or to connect to.
    #[error("{0}")]
    Endpoint(String),
    /// Keys or users.
    #[error(transparent)]
    Access(#[from] wheelarm_access::AccessError),
    /// The cameras.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A scenario.
    #[error(transparent)]
    Sim(Box<SimError>),
    /// The table of materials for sensor models.
    #[error(transparent)]
    Sensors(#[from] SensorError),
    /// An asset file that is to be stored with recordings.
    #[error("cannot read {0}")]
    Assets(String),
    /// Another server has this name.
    #[error("a server named {0:?} is already on this network; choose another with --sim NAME")]
    NameTaken(String),
    /// The simulation thread.
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
