//! One topic, typed by its message.

use std::marker::PhantomData;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use bytes::Bytes;
use wheelarm_proto::Topic;
use zenoh::bytes::ZBytes;
use zenoh::pubsub::Subscriber;

use super::error::closed;
use super::{Client, ClientError};

/// A subscribed topic: every message of it, in the order of arrival.
pub struct Samples<M> {
    receiver: Receiver<ZBytes>,
    _subscriber: Subscriber<()>,
    _message: PhantomData<M>,
}

impl Client {
    /// Subscribes to the topic of a message: `client.samples::<v1::Imu>()`. The
    /// queue has no bound.
    ///
    /// # Errors
    /// [`ClientError::Transport`].
    pub fn samples<M: Topic>(&self) -> Result<Samples<M>, ClientError> {
        let (sender, receiver) = std::sync::mpsc::channel();
        let subscriber = self.subscribe(&self.keys().topic(M::TOPIC), move |sample| {
            // A closed queue means that `Samples` was dropped.
            let _ = sender.send(sample.payload().clone());
        })?;
        Ok(Samples {
            receiver,
            _subscriber: subscriber,
            _message: PhantomData,
        })
    }
}

impl<M: Topic> Samples<M> {
    /// The next message, or `None` when none arrived within `patience`.
    ///
    /// # Errors
    /// [`ClientError::Garbled`], [`ClientError::Transport`] when the session is closed.
    pub fn next(&self, patience: Duration) -> Result<Option<M>, ClientError> {
        match self.receiver.recv_timeout(patience) {
            Ok(payload) => match M::decode(Bytes::from(payload.to_bytes().into_owned())) {
                Ok(message) => Ok(Some(message)),
                Err(cause) => Err(ClientError::Garbled {
                    what: format!("`{}`", M::NAME),
                    cause,
                }),
            },
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(closed("waiting for a sample")),
        }
    }
}
