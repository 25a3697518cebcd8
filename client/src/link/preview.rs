//! One camera's preview at one level: the newest picture, older ones are let go.

use std::time::Duration;

use wheelarm_proto::preview::PreviewLevel;
use wheelarm_proto::v1;
use zenoh::Wait;
use zenoh::handlers::{RingChannel, RingChannelHandler};
use zenoh::pubsub::Subscriber;
use zenoh::sample::Sample;

use super::{Link, LinkError, decode, transport};

/// A subscribed preview; the server encodes it while this lives.
pub struct Preview {
    subscriber: Subscriber<RingChannelHandler<Sample>>,
}

impl Link {
    /// Subscribes to a camera's preview.
    ///
    /// # Errors
    /// [`LinkError::Transport`].
    pub fn preview(&self, camera: &str, level: PreviewLevel) -> Result<Preview, LinkError> {
        let subscriber = self
            .session
            .declare_subscriber(self.keys.preview(camera, level))
            .with(RingChannel::new(1))
            .wait()
            .map_err(transport("subscribing to a preview"))?;
        Ok(Preview { subscriber })
    }
}

impl Preview {
    /// The newest picture, or `None` when none came for `patience`.
    ///
    /// # Errors
    /// [`LinkError::Garbled`], [`LinkError::Transport`] when the session is closed.
    pub fn next(&self, patience: Duration) -> Result<Option<v1::PreviewFrame>, LinkError> {
        let sample = self
            .subscriber
            .recv_timeout(patience)
            .map_err(transport("waiting for a preview"))?;
        sample.map(|s| decode(s.payload(), "preview")).transpose()
    }

    /// The newest picture, as soon as there is one.
    ///
    /// # Errors
    /// As [`Preview::next`].
    pub async fn next_async(&self) -> Result<v1::PreviewFrame, LinkError> {
        let sample = self
            .subscriber
            .recv_async()
            .await
            .map_err(transport("waiting for a preview"))?;
        decode(sample.payload(), "preview")
    }
}
