//! Bytes of the log: the preamble, the record header, camera payloads.

use prost::Message;
use wheelarm_proto::v1;

use crate::depth::Depth;

/// First bytes of a log; the digit is the version of the format.
pub(crate) const FILE_MAGIC: &[u8; 8] = b"WHLLOG1\n";
/// First bytes of a record.
const RECORD_MAGIC: u32 = 0x5743_4552;
/// Bytes of a record before its payload.
pub const RECORD_HEADER: usize = 40;
/// Greatest payload of a record, bytes. A 4096x4096 frame with float32 depth
/// has 128 MiB before compression.
pub const MAX_PAYLOAD: usize = 1 << 30;

/// Greatest snapshot of an episode, bytes; the shipped homes have about 1 MB.
pub const MAX_SNAPSHOT: usize = 256 << 20;
/// Greatest message that describes an episode (start, end, scenario, robot), bytes.
pub const MAX_MESSAGE: usize = 16 << 20;

/// The preamble of a log: everything but the samples.
#[derive(Clone, PartialEq, Message)]
pub struct Preamble {
    /// The episode.
    #[prost(message, optional, tag = "1")]
    pub started: Option<v1::EpisodeStarted>,
    /// Initial state of a replay.
    #[prost(message, optional, tag = "2")]
    pub snapshot: Option<v1::SnapshotReply>,
    /// Name of the recorder.
    #[prost(string, tag = "3")]
    pub recorder: String,
    /// Version of the recorder's software.
    #[prost(string, tag = "4")]
    pub software: String,
    /// Depth is stored as 16-bit millimetres instead of float32 metres.
    #[prost(bool, tag = "5")]
    pub depth_millimetres: bool,
    /// Stream names by record stream number; cameras as `camera/NAME`.
    #[prost(string, repeated, tag = "6")]
    pub streams: Vec<String>,
    /// Cameras are stored without depth.
    #[prost(bool, tag = "7")]
    pub without_depth: bool,
}

impl Preamble {
    /// How the cameras' depth is stored.
    #[must_use]
    pub fn depth(&self) -> Depth {
        match (self.without_depth, self.depth_millimetres) {
            (true, _) => Depth::Nothing,
            (false, true) => Depth::Millimetres,
            (false, false) => Depth::Metres,
        }
    }
}

/// Retransmitted samples of one stream, which arrived out of order.
#[derive(Clone, PartialEq, Message)]
pub struct Recovered {
    /// Stream name.
    #[prost(string, tag = "1")]
    pub stream: String,
    /// Number of samples.
    #[prost(uint64, tag = "2")]
    pub count: u64,
}

/// Received messages of one stream.
#[derive(Clone, PartialEq, Message)]
pub struct Received {
    /// Stream name.
    #[prost(string, tag = "1")]
    pub stream: String,
    /// Digest of the messages in order, as in `StreamCount` of the manifest.
    #[prost(bytes = "vec", tag = "2")]
    pub digest: Vec<u8>,
    /// Sequence numbers that arrived with two contents.
    #[prost(uint64, tag = "3")]
    pub doubtful: u64,
    /// Digest of the compressed messages, if every sample arrived as one; empty
    /// otherwise.
    #[prost(bytes = "vec", tag = "4")]
    pub compressed: Vec<u8>,
}

/// Last record of a log that was closed in order.
#[derive(Clone, PartialEq, Message)]
pub struct Closing {
    /// The server's closing message with the manifest, if it arrived.
    #[prost(message, optional, tag = "1")]
    pub stopped: Option<v1::EpisodeStopped>,
    /// Why the recording ended early; empty when it did not.
    #[prost(string, tag = "2")]
    pub reason: String,
    /// Retransmitted samples, by stream.
    #[prost(message, repeated, tag = "3")]
    pub recovered: Vec<Recovered>,
    /// Received messages, by stream.
    #[prost(message, repeated, tag = "4")]
    pub received: Vec<Received>,
}

/// Kind of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A message of a state stream as it was encoded.
    State,
    /// A camera frame, see [`CameraParts`].
    Camera,
    /// A [`Closing`].
    Closing,
}

impl Kind {
    fn byte(self) -> u8 {
        match self {
            Self::State => 1,
            Self::Camera => 2,
            Self::Closing => 3,
        }
    }

    fn from_byte(byte: u8) -> Option<Self> {
        match byte {
            1 => Some(Self::State),
            2 => Some(Self::Camera),
            3 => Some(Self::Closing),
            _ => None,
        }
    }
}

/// A record without its payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordHeader {
    /// Kind of the payload.
    pub kind: Kind,
    /// Number of the stream in [`Preamble::streams`].
    pub stream: u16,
    /// Sequence number of the sample.
    pub sequence: u64,
    /// Simulation time, nanoseconds.
    pub stamp_nanos: u64,
    /// Physics tick.
    pub tick: u64,
}

/// Starts a record: reserves its header; the caller appends the payload.
#[must_use]
pub fn begin_record(capacity: usize) -> Vec<u8> {
    begin_record_in(Vec::new(), capacity)
}

/// The same in an existing buffer, whose content is dropped.
#[must_use]
pub fn begin_record_in(mut out: Vec<u8>, capacity: usize) -> Vec<u8> {
    out.clear();
    out.reserve(RECORD_HEADER + capacity);
    out.resize(RECORD_HEADER, 0);
    out
}

/// Fills in the header of a record whose payload is complete.
pub fn finish_record(record: &mut [u8], header: &RecordHeader) {
    let length = record.len().saturating_sub(RECORD_HEADER);
    let length = u32::try_from(length).unwrap_or(u32::MAX);
    record[..4].copy_from_slice(&RECORD_MAGIC.to_le_bytes());
    record[8] = header.kind.byte();
    record[9] = 0;
    record[10..12].copy_from_slice(&header.stream.to_le_bytes());
    record[12..16].copy_from_slice(&length.to_le_bytes());
    record[16..24].copy_from_slice(&header.sequence.to_le_bytes());
    record[24..32].copy_from_slice(&header.stamp_nanos.to_le_bytes());
    record[32..40].copy_from_slice(&header.tick.to_le_bytes());
    let crc = crc32fast::hash(&record[8..]);
    record[4..8].copy_from_slice(&crc.to_le_bytes());
}

/// A parsed record header with its CRC and the payload's length.
pub(super) struct RawHeader {
    pub header: RecordHeader,
    pub crc: u32,
    pub length: usize,
}

/// Parses a record header; `None` when it is invalid.
pub(super) fn parse_header(bytes: &[u8; RECORD_HEADER]) -> Option<RawHeader> {
    let u32_at = |i: usize| {
        let mut b = [0; 4];
        b.copy_from_slice(&bytes[i..i + 4]);
        u32::from_le_bytes(b)
    };
    let u64_at = |i: usize| {
        let mut b = [0; 8];
        b.copy_from_slice(&bytes[i..i + 8]);
        u64::from_le_bytes(b)
    };
    if u32_at(0) != RECORD_MAGIC || bytes[9] != 0 {
        return None;
    }
    let length = usize::try_from(u32_at(12)).ok()?;
    (length <= MAX_PAYLOAD).then_some(RawHeader {
        header: RecordHeader {
            kind: Kind::from_byte(bytes[8])?,
            stream: u16::from_le_bytes([bytes[10], bytes[11]]),
            sequence: u64_at(16),
            stamp_nanos: u64_at(24),
            tick: u64_at(32),
        },
        crc: u32_at(4),
        length,
    })
}

/// A camera payload: the message without its images, then the compressed
/// images, each after its u32 length.
#[derive(Clone, Copy, Debug)]
pub struct CameraParts<'a> {
    /// `CameraFrame` whose `rgb`, `depth` and `ids` are empty, or `SensorFrame`
    /// without `rgb` and `depth`; images that it does not have are empty below.
    pub meta: &'a [u8],
    /// zlib stream of RGB8.
    pub rgb: &'a [u8],
    /// zlib stream of the shuffled depth.
    pub depth: &'a [u8],
    /// zlib stream of the instance ids.
    pub ids: &'a [u8],
}

impl<'a> CameraParts<'a> {
    /// Parses a payload; `None` when its lengths do not add up.
    #[must_use]
    pub fn parse(payload: &'a [u8]) -> Option<Self> {
        let (meta, rest) = part(payload)?;
        let (rgb, rest) = part(rest)?;
        let (depth, rest) = part(rest)?;
        let (ids, rest) = part(rest)?;
        rest.is_empty().then_some(Self {
            meta,
            rgb,
            depth,
            ids,
        })
    }
}

fn part(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<4>()?;
    rest.split_at_checked(usize::try_from(u32::from_le_bytes(*length)).ok()?)
}
