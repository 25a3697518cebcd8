//! Limits that server and clients must agree on. Each is written here and nowhere else.

use crate::PHYSICS_HZ;

/// Age of the newest command at which the server brakes the chair, s.
pub const STALE_COMMAND_SECONDS: f64 = 0.25;

/// Largest age of the state that a moving command may answer, ticks. The server's command
/// gate rejects older ones.
pub const MAX_COMMAND_AGE_TICKS: u64 = 240;

/// Largest age of the state that a moving command may answer, s.
pub const MAX_COMMAND_AGE_SECONDS: f64 = MAX_COMMAND_AGE_TICKS as f64 / PHYSICS_HZ as f64;

/// Images of each camera that the server may publish ahead of the slowest recorder. Its cache
/// for gap recovery holds as many.
pub const CREDIT_IMAGES: u64 = 6;

/// Allowed widths and heights of images, pixels.
pub const IMAGE_SIDES: std::ops::RangeInclusive<u32> = 16..=4096;
