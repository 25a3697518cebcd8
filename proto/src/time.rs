//! Timestamps are computed from the tick, never read from a clock.

/// Physics ticks per second of simulation time.
pub const PHYSICS_HZ: u64 = 240;
/// Control ticks per second of simulation time.
pub const CONTROL_HZ: u64 = 60;
/// Physics ticks per control tick.
pub const TICKS_PER_CONTROL: u64 = PHYSICS_HZ / CONTROL_HZ;

/// In lock-step, time may run at most this many ticks beyond a recorder's
/// [`RecorderStatus.credit_tick`](crate::v1::RecorderStatus).
pub const CREDIT_TICKS: u64 = 480;

/// A recorder sends its credit at least once in this many ticks.
pub const CREDIT_STATUS_TICKS: u64 = CREDIT_TICKS / 10;

/// Simulation time of a physics tick in nanoseconds: `tick · 10⁹ / 240`, rounded.
#[must_use]
pub fn stamp_nanos(tick: u64) -> u64 {
    let exact = u128::from(tick) * 1_000_000_000;
    let hz = u128::from(PHYSICS_HZ);
    u64::try_from((exact + hz / 2) / hz).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_are_rounded_and_whole_seconds_are_exact() {
        assert_eq!(stamp_nanos(0), 0);
        assert_eq!(stamp_nanos(1), 4_166_667);
        assert_eq!(stamp_nanos(2), 8_333_333);
        assert_eq!(stamp_nanos(240 * 3600), 3_600_000_000_000);
    }
}
