//! Pictures of one camera, or of a sensor on one, decoded; the newest few are kept,
//! older ones are let go.

use std::time::{Duration, Instant};

use bytes::Bytes;
use wheelarm_proto::{Message, v1};
use zenoh::handlers::{IntoHandler, RingChannel, RingChannelHandler};
use zenoh::pubsub::Subscriber;
use zenoh::sample::Sample;

use super::{Client, ClientError, Frame, transport};

/// A subscribed camera.
pub struct Camera {
    pictures: RingChannelHandler<Sample>,
    _subscriber: Subscriber<()>,
}

impl Client {
    /// Subscribes to a camera. Up to `kept` pictures wait to be taken; when
    /// another comes the oldest is let go, which the sequence numbers of the
    /// headers tell. With 1 the newest is taken.
    ///
    /// # Errors
    /// [`ClientError::NoCamera`] with those in use when it is none of them, else as
    /// [`Client::request`] and [`Client::subscribe`].
    pub fn camera(&self, name: &str, kept: usize) -> Result<Camera, ClientError> {
        let status = self.request(&v1::StatusRequest {})?;
        let cameras = status.scenario.unwrap_or_default().cameras;
        let on = cameras.iter().filter(|one| one.rate_hz != Some(0.0));
        let names: Vec<&str> = on.map(|one| one.name.as_str()).collect();
        if !names.contains(&name) {
            return Err(ClientError::NoCamera {
                camera: name.to_owned(),
                found: match names.is_empty() {
                    true => "none".to_owned(),
                    false => names.join(", "),
                },
            });
        }
        let (ring, pictures) = RingChannel::new(kept.max(1)).into_handler();
        let key = self.keys().camera(name);
        let subscriber = self.subscribe(&key, move |sample| ring.call(sample))?;
        Ok(Camera {
            pictures,
            _subscriber: subscriber,
        })
    }
}

/// A subscribed sensor on a camera.
pub struct SensorImages {
    pictures: RingChannelHandler<Sample>,
    _subscriber: Subscriber<()>,
}

impl Client {
    /// Subscribes to a sensor on a camera, by the name that `sensors` tells. Up to
    /// `kept` pictures wait to be taken; then the oldest is let go.
    ///
    /// # Errors
    /// As [`Client::subscribe`].
    pub fn sensor(&self, name: &str, kept: usize) -> Result<SensorImages, ClientError> {
        let (ring, pictures) = RingChannel::new(kept.max(1)).into_handler();
        let key = self.keys().sensor(name);
        let subscriber = self.subscribe(&key, move |sample| ring.call(sample))?;
        Ok(SensorImages {
            pictures,
            _subscriber: subscriber,
        })
    }
}

impl SensorImages {
    /// The next picture, or `None` when none came for `patience`.
    ///
    /// # Errors
    /// [`ClientError::Garbled`] when it cannot be read, [`ClientError::Transport`] when
    /// the session is closed.
    pub fn next(&self, patience: Duration) -> Result<Option<v1::SensorFrame>, ClientError> {
        let sample = self
            .pictures
            .recv_deadline(Instant::now() + patience)
            .map_err(transport("waiting for a sensor's picture"))?;
        sample
            .map(|sample| {
                // Planes share these bytes.
                let bytes = Bytes::from(sample.payload().to_bytes().into_owned());
                v1::SensorFrame::decode(bytes).map_err(|cause| ClientError::Garbled {
                    what: "a sensor's picture".to_owned(),
                    cause,
                })
            })
            .transpose()
    }
}

impl Camera {
    /// The next picture, or `None` when none came for `patience`.
    ///
    /// # Errors
    /// [`ClientError::Garbled`] and [`ClientError::Frame`] when it cannot be read,
    /// [`ClientError::Transport`] when the session is closed.
    pub fn next(&self, patience: Duration) -> Result<Option<Frame>, ClientError> {
        let deadline = Instant::now() + patience;
        let sample = self
            .pictures
            .recv_deadline(deadline)
            .map_err(transport("waiting for a picture"))?;
        let Some(sample) = sample else {
            return Ok(None);
        };
        // Planes share these bytes.
        let bytes = Bytes::from(sample.payload().to_bytes().into_owned());
        let message = v1::CameraFrame::decode(bytes).map_err(|cause| ClientError::Garbled {
            what: "a picture".to_owned(),
            cause,
        })?;
        Ok(Some(Frame::read(message)?))
    }
}
