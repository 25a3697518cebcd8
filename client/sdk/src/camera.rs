//! Decoded images of one camera, or of a sensor on one. The newest few are kept; older
//! images are dropped.

use std::time::{Duration, Instant};

use bytes::Bytes;
use wheelarm_proto::{Message, v1};
use zenoh::handlers::{IntoHandler, RingChannel, RingChannelHandler};
use zenoh::pubsub::Subscriber;
use zenoh::sample::Sample;

use super::{Client, ClientError, Frame, transport};

/// A subscribed camera.
pub struct Camera {
    images: RingChannelHandler<Sample>,
    _subscriber: Subscriber<()>,
}

impl Client {
    /// Subscribes to a camera. The queue holds `kept` images, and a full queue drops the
    /// oldest; sequence numbers of the headers show the gap. With 1, [`Camera::next`]
    /// returns the newest image.
    ///
    /// # Errors
    /// [`ClientError::NoCamera`], which lists the cameras in use, else as
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
        let (ring, images) = RingChannel::new(kept.max(1)).into_handler();
        let key = self.keys().camera(name);
        let subscriber = self.subscribe(&key, move |sample| ring.call(sample))?;
        Ok(Camera {
            images,
            _subscriber: subscriber,
        })
    }
}

/// A subscribed sensor on a camera.
pub struct SensorImages {
    images: RingChannelHandler<Sample>,
    _subscriber: Subscriber<()>,
}

impl Client {
    /// Subscribes to a sensor on a camera, by its name in the reply of `sensors`. The
    /// queue holds `kept` images, and a full queue drops the oldest.
    ///
    /// # Errors
    /// As [`Client::subscribe`].
    pub fn sensor(&self, name: &str, kept: usize) -> Result<SensorImages, ClientError> {
        let (ring, images) = RingChannel::new(kept.max(1)).into_handler();
        let key = self.keys().sensor(name);
        let subscriber = self.subscribe(&key, move |sample| ring.call(sample))?;
        Ok(SensorImages {
            images,
            _subscriber: subscriber,
        })
    }
}

impl SensorImages {
    /// The next image, or `None` when none arrived within `patience`.
    ///
    /// # Errors
    /// [`ClientError::Garbled`] for a damaged message, [`ClientError::Transport`] when
    /// the session is closed.
    pub fn next(&self, patience: Duration) -> Result<Option<v1::SensorFrame>, ClientError> {
        let sample = self
            .images
            .recv_deadline(Instant::now() + patience)
            .map_err(transport("waiting for a sensor image"))?;
        sample
            .map(|sample| {
                // Planes share these bytes.
                let bytes = Bytes::from(sample.payload().to_bytes().into_owned());
                v1::SensorFrame::decode(bytes).map_err(|cause| ClientError::Garbled {
                    what: "a sensor image".to_owned(),
                    cause,
                })
            })
            .transpose()
    }
}

impl Camera {
    /// The next image, or `None` when none arrived within `patience`.
    ///
    /// # Errors
    /// [`ClientError::Garbled`] and [`ClientError::Frame`] for a damaged message,
    /// [`ClientError::Transport`] when the session is closed.
    pub fn next(&self, patience: Duration) -> Result<Option<Frame>, ClientError> {
        let deadline = Instant::now() + patience;
        let sample = self
            .images
            .recv_deadline(deadline)
            .map_err(transport("waiting for an image"))?;
        let Some(sample) = sample else {
            return Ok(None);
        };
        // Planes share these bytes.
        let bytes = Bytes::from(sample.payload().to_bytes().into_owned());
        let message = v1::CameraFrame::decode(bytes).map_err(|cause| ClientError::Garbled {
            what: "an image".to_owned(),
            cause,
        })?;
        Ok(Some(Frame::from_proto(message)?))
    }
}
