//! The contract of WheelArm: messages, key expressions, units and frames.
//!
//! Contains data and the functions that must give the same bits everywhere ([`exact`],
//! [`random`]), but no transport and no simulation. Every client depends on this crate
//! and on no other part of the server.
//!
//! Conventions: right-handed frames, z up, x forward, y left; SI units and
//! radians; quaternions x y z w; `house` is the world frame.

pub mod appearance;
pub mod bundle;
pub mod cache;
pub mod check;
pub mod defaults;
pub mod digest;
pub mod endpoint;
pub mod exact;
#[cfg(feature = "nalgebra")]
pub mod furniture;
#[cfg(feature = "nalgebra")]
pub mod geometry;
pub mod installed;
pub mod keys;
pub mod label;
pub mod limits;
#[cfg(feature = "log")]
pub mod log;
pub mod output;
pub mod parallel;
pub mod person;
pub mod preview;
pub mod program;
pub mod random;
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

/// Only the messages as an encoded `FileDescriptorSet`, for self-describing files.
pub const MESSAGES_DESCRIPTOR: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/messages.bin"));

/// Version of the stored layout of recordings.
pub const SCHEMA_VERSION: &str = "1";

/// Version of the messages, queries, topics and keys. Programs of different versions do
/// not communicate; `proto/README.md` says when it is raised.
///
/// - 1: up to the first version that sent a number.
/// - 2: identity in keys, codes beside texts, absence where it has a meaning.
/// - 3: names of the field: `color`, `segmentation`, `appearance`, `playback`.
pub const CONTRACT_VERSION: u32 = 3;

/// Version of the physics: programs of the same version compute the same bits from the
/// same saved state and commands, and read each other's saved states.
///
/// Rule: every change that alters a state hash or the layout of a saved state raises
/// this number by one and is listed in the changelog. That covers control, world,
/// sensors, tasks and their assets, and the versions of the crates that compute. The
/// number is part of saved states, `EpisodeStarted` and the file attribute
/// `physics_version`; a replay of another version is refused.
///
/// - 1: up to the first version that sent a number.
/// - 2: joint signals that agree with the motion, own transcendental functions.
/// - 3: rounded rims of the robot, softer contacts with fixed bodies, an arm
///   that brakes what outruns it, even ramps of the chair, debts of soft objects.
/// - 4: the chair camera's boom, sampling by area.
/// - 5: a person's capsules as polygons, bodies that touch a person stop rocking, soft
///   objects solved in single precision and asleep at rest.
/// - 6: contacts begin a tick with 0.9 of the last one's impulses.
/// - 7: a person's capsules with six to ten sides or, where no body rests on them, round;
///   a head that moves once in a control tick. Without a person the bits are those of 6.
/// - 8: the repairs of an outside audit (contacts, starts, joints); the changelog lists them.
/// - 9: multibody dynamics by tree, exact implicit Coriolis terms.
pub const PHYSICS_VERSION: u32 = 9;

/// Largest number of contacts in one sample of the streams `contact` and `person`.
pub const MAX_CONTACTS: usize = 16;
