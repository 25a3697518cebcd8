//! A channel of the log: its topic, its schema, and what makes the message of a
//! sample.

use std::sync::Arc;

use prost::{Message, Name};
use wheelarm_proto::TopicId;

use crate::read::Samples;

/// Foxglove's messages.
const FOXGLOVE: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/foxglove.bin"));
/// Ours.
const OURS: &[u8] = wheelarm_proto::MESSAGES_DESCRIPTOR;
/// ROS 2's text message.
const ROS_TEXT: &[u8] = b"string data\n";

/// How the messages of a channel are described and encoded.
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

/// What makes the encoded message of a sample of a stamp.
type Make<'a> = Box<dyn Fn(usize, u64) -> anyhow::Result<Vec<u8>> + Sync + 'a>;

/// A channel of the log.
pub(super) struct Channel<'a> {
    /// Topic.
    pub topic: String,
    /// Schema of its messages.
    pub schema: Schema,
    /// Stamps of the messages, nanoseconds of simulation time.
    pub stamps: Vec<u64>,
    make: Make<'a>,
}

impl<'a> Channel<'a> {
    /// One of Foxglove's messages per stamp.
    pub fn foxglove<M: Message + Name>(
        topic: impl Into<String>,
        stamps: &[u64],
        make: impl Fn(usize, u64) -> anyhow::Result<M> + Sync + 'a,
    ) -> Self {
        Self {
            topic: topic.into(),
            schema: Schema {
                name: M::full_name(),
                language: "protobuf",
                description: FOXGLOVE,
                encoding: "protobuf",
            },
            stamps: stamps.to_vec(),
            make: Box::new(move |i, stamp| Ok(make(i, stamp)?.encode_to_vec())),
        }
    }

    /// Our own messages, as they were recorded.
    pub fn own(topic: &str, id: TopicId, samples: Arc<Samples>) -> Self {
        Self {
            topic: topic.to_owned(),
            schema: Schema {
                name: id.info().message.to_owned(),
                language: "protobuf",
                description: OURS,
                encoding: "protobuf",
            },
            stamps: samples.stamps().to_vec(),
            make: Box::new(move |i, _| Ok(samples.encoded(i)?)),
        }
    }

    /// One text, as ROS 2 writes it: what viewers take a robot description from.
    pub fn text(topic: &str, stamp: u64, text: String) -> Self {
        Self {
            topic: topic.to_owned(),
            schema: Schema {
                name: "std_msgs/msg/String".to_owned(),
                language: "ros2msg",
                description: ROS_TEXT,
                encoding: "cdr",
            },
            stamps: vec![stamp],
            make: Box::new(move |_, _| ros_text(&text)),
        }
    }

    /// The encoded message of sample `i`, whose stamp is known already.
    pub fn message(&self, i: usize, stamp: u64) -> anyhow::Result<Vec<u8>> {
        (self.make)(i, stamp)
    }
}

/// A text as ROS 2 encodes it: little-endian CDR, length with the final NUL.
fn ros_text(text: &str) -> anyhow::Result<Vec<u8>> {
    let mut out = vec![0, 1, 0, 0];
    out.extend(u32::try_from(text.len() + 1)?.to_le_bytes());
    out.extend_from_slice(text.as_bytes());
    out.push(0);
    Ok(out)
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_text_is_encoded_as_ros_does() {
        let bytes = super::ros_text("hi").unwrap();
        assert_eq!(bytes, [0, 1, 0, 0, 3, 0, 0, 0, b'h', b'i', 0]);
    }
}
