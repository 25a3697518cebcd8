//! The contract of WheelArm: messages, key expressions, units and frames.
//!
//! Data, and the functions that must come out alike everywhere ([`exact`]): no
//! transport, no simulation. Every process that speaks to a
//! server depends on this crate and on nothing else of the server.
//!
//! Conventions: right-handed frames, z up, x forward, y left; SI units and
//! radians; quaternions x y z w; `house` is the world frame.

pub mod bundle;
pub mod check;
pub mod digest;
pub mod endpoint;
pub mod exact;
#[cfg(feature = "nalgebra")]
pub mod geometry;
pub mod installed;
pub mod keys;
pub mod label;
#[cfg(feature = "log")]
pub mod log;
pub mod look;
pub mod output;
pub mod person;
pub mod preview;
pub mod program;
pub mod restart;
pub mod robot;
pub mod rpc;
pub mod schema;
pub mod seal;
pub mod seeds;
pub mod settings;
#[cfg(feature = "signals")]
pub mod signals;
mod time;
pub mod topic;
mod words;

pub use time::{
    CONTROL_HZ, CREDIT_STATUS_TICKS, CREDIT_TICKS, PHYSICS_HZ, TICKS_PER_CONTROL, stamp_nanos,
};

/// Messages of package `wheelarm.v1`.
#[expect(clippy::doc_markdown, reason = "generated from the .proto files")]
pub mod v1 {
    include!(concat!(env!("OUT_DIR"), "/wheelarm.v1.rs"));
}

pub use prost::{DecodeError, Message};
pub use rpc::{Query, Rpc};
pub use topic::{StreamId, Topic, TopicId};

/// The whole contract as an encoded `FileDescriptorSet`: messages, service and
/// the options that declare topics.
pub const CONTRACT_DESCRIPTOR: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/contract.bin"));

/// The messages alone as an encoded `FileDescriptorSet`, for files that carry
/// their own description.
pub const MESSAGES_DESCRIPTOR: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/messages.bin"));

/// Version of the stored layout of recordings.
pub const SCHEMA_VERSION: &str = "1";

/// Version of the messages, queries, topics and keys. Programs of two versions
/// do not speak to each other; `proto/README.md` says when it is raised.
///
/// - 1: up to the first version that told none.
/// - 2: identity in keys, codes beside words, absence where it means something.
pub const CONTRACT_VERSION: u32 = 2;

/// Version of the physics: programs of the same version compute the same bits
/// from the same saved state and the same commands, and read each other's
/// saved states.
///
/// The rule: every change after which a state hash differs, or a saved state
/// has another layout, raises this number by one and says so in the changelog.
/// That is control, world, sensors, tasks and their assets, and the versions of
/// the crates that compute. It stands in the saved state, in `EpisodeStarted`
/// and in the attribute `physics_version` of a file; a replay of another
/// version is refused.
///
/// - 1: up to the first version that told none.
/// - 2: joint signals that agree with the motion, own transcendental functions.
/// - 3: rounded rims of the robot, softer contacts with what stands fixed, an arm
///   that brakes what outruns it, even ramps of the chair, debts of soft objects.
/// - 4: the chair camera's boom, draws by area.
/// - 5: a person's capsules as polygons, what touches somebody stops rocking, soft
///   objects solved in single precision and asleep where they lie still.
/// - 6: contacts begin a tick with 0.9 of the last one's impulses.
/// - 7: a person's capsules with six to ten sides or, where nothing lies on them, round;
///   a head that moves once in a control tick. Without a person the bits are those of 6.
/// - 8: the repairs of an outside audit (contacts, starts, joints); the changelog lists them.
pub const PHYSICS_VERSION: u32 = 8;

/// Contacts that one sample of the streams `contact` and `person` holds at most.
pub const MAX_CONTACTS: usize = 16;
