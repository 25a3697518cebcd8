//! A channel of a bag: its topic, its type, and what makes the message of a sample.

use std::sync::Arc;

use wheelarm_proto::Topic;

use crate::convert::ros2::{RosMessage, TFMessage, Transform};
use crate::convert::series::Series;
use crate::pose::Pose;
use crate::read::Samples;
use crate::urdf::Joint;

/// Metadata of messages in a bag.
pub(super) struct Kind {
    /// Full name of their type.
    pub name: &'static str,
    /// Whether late subscribers get the last one.
    pub latched: bool,
}

/// Messages of one source.
pub(super) type Channel<'a> = Series<'a, Kind>;

impl<'a> Channel<'a> {
    pub fn of<M: RosMessage>(
        topic: impl Into<String>,
        stamps: &[u64],
        make: impl Fn(usize, u64) -> anyhow::Result<M> + Sync + 'a,
    ) -> Self {
        let kind = Kind {
            name: M::NAME,
            latched: false,
        };
        Self::new(topic, kind, stamps.to_vec(), move |i, stamp| {
            Ok(make(i, stamp)?.encoded())
        })
    }

    /// A message of every sample of a stream.
    pub fn per_sample<T: Topic, M: RosMessage>(
        topic: impl Into<String>,
        samples: &Arc<Samples>,
        make: impl Fn(T, u64) -> M + Sync + 'a,
    ) -> Self {
        let stream = samples.clone();
        Self::of(topic, samples.stamps(), move |i, stamp| {
            Ok(make(stream.message(i)?, stamp))
        })
    }

    /// One message that is valid from `stamp` on.
    pub fn latched<M: RosMessage>(topic: &str, stamp: u64, message: &M) -> Self {
        let kind = Kind {
            name: M::NAME,
            latched: true,
        };
        let bytes = message.encoded();
        Self::new(topic, kind, vec![stamp], move |_, _| Ok(bytes.clone()))
    }
}

/// Pose of a frame in its parent.
pub(super) fn transform(stamp: u64, parent: &str, child: &str, pose: Pose) -> Transform {
    Transform {
        stamp,
        parent: parent.to_owned(),
        child: child.to_owned(),
        pose,
    }
}

/// The children of moving joints at their positions.
pub(super) fn posed(moving: &[(usize, &Joint)], positions: &[f64], stamp: u64) -> TFMessage {
    let each = moving.iter().map(|(place, joint)| {
        let position = positions.get(*place).copied().unwrap_or(f64::NAN);
        transform(stamp, &joint.parent, &joint.child, joint.pose(position))
    });
    TFMessage(each.collect())
}
