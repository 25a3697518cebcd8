//! A channel of the log: its topic, its schema, and what makes the message of a
//! sample.

use std::sync::Arc;

use prost::{Message, Name};
use wheelarm_proto::TopicId;

use crate::convert::ros2::{RosMessage, Text};
use crate::convert::series::Series;
use crate::read::Samples;

/// Foxglove's messages.
const FOXGLOVE: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/foxglove.bin"));
/// Ours.
const OURS: &[u8] = wheelarm_proto::MESSAGES_DESCRIPTOR;
/// ROS 2's text message.
const ROS_TEXT: &[u8] = b"string data\n";

/// Schema and encoding of a channel's messages.
pub(super) struct Schema {
    /// Full name of the message.
    pub name: String,
    /// Language of the description.
    pub language: &'static str,
    /// The description.
    pub description: &'static [u8],
    /// Encoding of the messages.
    pub encoding: &'static str,
}

/// A channel of the log.
pub(super) type Channel<'a> = Series<'a, Schema>;

impl<'a> Channel<'a> {
    /// One of Foxglove's messages per stamp.
    pub fn foxglove<M: Message + Name>(
        topic: impl Into<String>,
        stamps: &[u64],
        make: impl Fn(usize, u64) -> anyhow::Result<M> + Sync + 'a,
    ) -> Self {
        let schema = Schema {
            name: M::full_name(),
            language: "protobuf",
            description: FOXGLOVE,
            encoding: "protobuf",
        };
        Self::new(topic, schema, stamps.to_vec(), move |i, stamp| {
            Ok(make(i, stamp)?.encode_to_vec())
        })
    }

    /// Our own messages, as they were recorded.
    pub fn own(topic: &str, id: TopicId, samples: Arc<Samples>) -> Self {
        let schema = Schema {
            name: id.info().message.to_owned(),
            language: "protobuf",
            description: OURS,
            encoding: "protobuf",
        };
        let stamps = samples.stamps().to_vec();
        Self::new(topic, schema, stamps, move |i, _| Ok(samples.encoded(i)?))
    }

    /// One text, as ROS 2 writes it: viewers read a robot description from it.
    pub fn text(topic: &str, stamp: u64, text: String) -> Self {
        let schema = Schema {
            name: Text::NAME.to_owned(),
            language: "ros2msg",
            description: ROS_TEXT,
            encoding: "cdr",
        };
        let encoded = Text(text).encoded();
        Self::new(topic, schema, vec![stamp], move |_, _| Ok(encoded.clone()))
    }
}
