//! Messages from the transport's callbacks to the recorder's thread.

use bytes::Bytes;
use wheelarm_proto::StreamId;
use zenoh::bytes::ZBytes;

use super::recorder::Input;

/// An undecoded input: callbacks do no work.
#[expect(
    clippy::large_enum_variant,
    reason = "one such message per episode; samples are the small ones"
)]
pub(super) enum Raw {
    Sample(StreamId, ZBytes),
    Ready(Input),
}

impl Raw {
    pub fn decode(self) -> Input {
        match self {
            Self::Ready(input) => input,
            Self::Sample(stream, payload) => Input::Sample {
                stream: stream.to_string(),
                payload: Bytes::from(payload.to_bytes().into_owned()),
            },
        }
    }
}
