//! Subscribed streams as one queue of decoded samples, in the order of arrival.

use std::time::Duration;

use crossbeam_channel::{Receiver, RecvTimeoutError};
use wheelarm_proto::keys::Keys;
use wheelarm_proto::{names, v1};
use zenoh::bytes::ZBytes;

use super::{LinkError, decode};

/// What a client can subscribe to with [`Link::streams`](super::Link::streams).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// `joint_state`.
    JointState,
    /// `pose`.
    Pose,
    /// `odometry`.
    Odometry,
    /// `object_pose`.
    ObjectPose,
    /// `furniture_joint`.
    FurnitureJoint,
    /// `contact`.
    Contact,
    /// `evaluation`.
    Evaluation,
    /// `applied`.
    Applied,
    /// `phase`.
    Phase,
    /// `state_hash`.
    StateHash,
    /// `event`.
    Event,
    /// `clock`.
    Clock,
    /// Refused commands.
    Refusal,
    /// End of an episode.
    EpisodeStop,
}

impl Stream {
    /// The key under which `keys` publishes it.
    #[must_use]
    pub fn key(self, keys: &Keys) -> String {
        match self {
            Self::Refusal => keys.refusal(),
            Self::EpisodeStop => keys.episode_stop(),
            Self::Event => keys.stream(names::EVENT_STREAM),
            stream => keys.stream(stream.name()),
        }
    }

    /// Name of the stream.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::JointState => "joint_state",
            Self::Pose => "pose",
            Self::Odometry => "odometry",
            Self::ObjectPose => "object_pose",
            Self::FurnitureJoint => "furniture_joint",
            Self::Contact => "contact",
            Self::Evaluation => "evaluation",
            Self::Applied => "applied",
            Self::Phase => "phase",
            Self::StateHash => "state_hash",
            Self::Event => names::EVENT_STREAM,
            Self::Clock => "clock",
            Self::Refusal => "refusal",
            Self::EpisodeStop => "episode_stop",
        }
    }

    fn read(self, payload: &ZBytes) -> Result<Received, LinkError> {
        let what = self.name();
        Ok(match self {
            Self::JointState => Received::JointState(decode(payload, what)?),
            Self::Pose => Received::Pose(decode(payload, what)?),
            Self::Odometry => Received::Odometry(decode(payload, what)?),
            Self::ObjectPose => Received::ObjectPose(decode(payload, what)?),
            Self::FurnitureJoint => Received::FurnitureJoint(decode(payload, what)?),
            Self::Contact => Received::Contact(decode(payload, what)?),
            Self::Evaluation => Received::Evaluation(decode(payload, what)?),
            Self::Applied => Received::Applied(decode(payload, what)?),
            Self::Phase => Received::Phase(decode(payload, what)?),
            Self::StateHash => Received::StateHash(decode(payload, what)?),
            Self::Event => Received::Event(decode(payload, what)?),
            Self::Clock => Received::Clock(decode(payload, what)?),
            Self::Refusal => Received::Refusal(decode(payload, what)?),
            Self::EpisodeStop => Received::EpisodeStop(Box::new(decode(payload, what)?)),
        })
    }
}

/// One decoded sample.
#[derive(Clone, Debug, PartialEq)]
pub enum Received {
    /// `joint_state`.
    JointState(v1::JointState),
    /// `pose`.
    Pose(v1::PoseSet),
    /// `odometry`.
    Odometry(v1::Odometry),
    /// `object_pose`.
    ObjectPose(v1::ObjectPoses),
    /// `furniture_joint`.
    FurnitureJoint(v1::FurnitureJoints),
    /// `contact`.
    Contact(v1::Contacts),
    /// `evaluation`.
    Evaluation(v1::Evaluation),
    /// `applied`.
    Applied(v1::Applied),
    /// `phase`.
    Phase(v1::PhaseSample),
    /// `state_hash`.
    StateHash(v1::StateHash),
    /// `event`.
    Event(v1::Event),
    /// `clock`.
    Clock(v1::Clock),
    /// Refused command.
    Refusal(v1::Refusal),
    /// End of an episode.
    EpisodeStop(Box<v1::EpisodeStopped>),
}

/// Subscribed streams in one queue, in the order of arrival.
pub struct Streams {
    pub(super) receiver: Receiver<(Stream, ZBytes)>,
    pub(super) _subscribers: Vec<zenoh::pubsub::Subscriber<()>>,
}

impl Streams {
    /// The next sample, or `None` when nothing came for `patience`.
    ///
    /// # Errors
    /// [`LinkError::Garbled`].
    pub fn next(&self, patience: Duration) -> Result<Option<Received>, LinkError> {
        match self.receiver.recv_timeout(patience) {
            Ok((stream, payload)) => stream.read(&payload).map(Some),
            Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => Ok(None),
        }
    }
}
