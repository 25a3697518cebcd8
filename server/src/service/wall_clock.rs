//! The wall clock, for people and connections; the simulation never uses it.

use std::time::{SystemTime, UNIX_EPOCH};

/// Nanoseconds since 1970.
pub fn unix_nanos() -> u64 {
    let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH);
    since_1970.map_or(0, |t| u64::try_from(t.as_nanos()).unwrap_or(u64::MAX))
}
