//! One camera's preview at one level: the newest image; older images are dropped.

use std::time::{Duration, Instant};

use wheelarm_proto::preview::PreviewLevel;
use wheelarm_proto::v1;
use zenoh::Wait;
use zenoh::handlers::{RingChannel, RingChannelHandler};
use zenoh::pubsub::Subscriber;
use zenoh::sample::Sample;

use super::{Client, ClientError, Server, decode, transport};

/// A subscribed preview; the server encodes it until this is dropped.
pub struct Preview {
    subscriber: Subscriber<RingChannelHandler<Sample>>,
    server: Server,
}

impl Client {
    /// Subscribes to a camera's preview.
    ///
    /// # Errors
    /// [`ClientError::Transport`].
    pub fn preview(&self, camera: &str, level: PreviewLevel) -> Result<Preview, ClientError> {
        let subscriber = self
            .session
            .declare_subscriber(self.keys.preview(camera, level))
            .with(RingChannel::new(1))
            .wait()
            .map_err(transport("subscribing to a preview"))?;
        Ok(Preview {
            subscriber,
            server: self.server.clone(),
        })
    }
}

impl Preview {
    /// The newest image, or `None` when none arrived within `patience`.
    ///
    /// # Errors
    /// [`ClientError::Garbled`], [`ClientError::Transport`] when the session is closed.
    pub fn next(&self, patience: Duration) -> Result<Option<v1::PreviewFrame>, ClientError> {
        let deadline = Instant::now() + patience;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let sample = self
                .subscriber
                .recv_timeout(left)
                .map_err(transport("waiting for a preview"))?;
            match sample {
                Some(s) if self.server.sent(&s) => return decode(s.payload(), "preview").map(Some),
                Some(_) => {}
                None => return Ok(None),
            }
        }
    }

    /// Waits for the newest image.
    ///
    /// # Errors
    /// As [`Preview::next`].
    pub async fn next_async(&self) -> Result<v1::PreviewFrame, ClientError> {
        loop {
            let sample = self
                .subscriber
                .recv_async()
                .await
                .map_err(transport("waiting for a preview"))?;
            if self.server.sent(&sample) {
                return decode(sample.payload(), "preview");
            }
        }
    }
}
