//! Subscribed topics as one queue of decoded samples, in the order of arrival.

use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use wheelarm_proto::TopicId;
use wheelarm_proto::topic::Sample;
use zenoh::bytes::ZBytes;

use super::LinkError;
use super::error::closed;

/// Subscribed topics in one queue, in the order of arrival.
pub struct Streams {
    pub(super) receiver: Receiver<(TopicId, ZBytes)>,
    pub(super) _subscribers: Vec<zenoh::pubsub::Subscriber<()>>,
}

impl Streams {
    /// The next sample, or `None` when nothing came for `patience`.
    ///
    /// # Errors
    /// [`LinkError::Garbled`], [`LinkError::Transport`] when the session is closed.
    pub fn next(&self, patience: Duration) -> Result<Option<Sample>, LinkError> {
        match self.receiver.recv_timeout(patience) {
            Ok((topic, payload)) => match Sample::decode(topic, &payload.to_bytes()) {
                Ok(sample) => Ok(Some(sample)),
                Err(cause) => Err(LinkError::Garbled {
                    what: format!("`{topic}`"),
                    cause,
                }),
            },
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(closed("waiting for a sample")),
        }
    }
}
