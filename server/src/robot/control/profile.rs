//! Largest speeds from which a coordinate can still stop in time.

use wheelarm_proto::exact;

/// Commanded share of a joint's speed limit. The rest covers the overshoot of a drive,
/// so that the measured speed is within the limit too.
pub(super) const SPEED_SHARE: f64 = 0.98;

/// Largest speed for the coming step of `dt` seconds from which a coordinate,
/// `distance` before its goal, stops at the goal without overshoot when it brakes by at
/// most `deceleration`. Any unit of distance; 0 at or beyond the goal.
///
/// A speed lasts for a whole step. Stopping from `v` in `n` steps takes `dt (v + (v - a
/// dt) + … )`, n terms, solved for `v`. A coordinate that keeps this speed once can
/// always keep it, and ends exactly at the goal.
#[must_use]
pub(super) fn stopping_speed(distance: f64, deceleration: f64, dt: f64) -> f64 {
    if distance <= 0.0 {
        return 0.0;
    }
    if distance.is_infinite() {
        return f64::INFINITY;
    }
    let change = deceleration * dt;
    let units = distance / (change * dt);
    let steps = (((1.0 + 8.0 * units).sqrt() - 1.0) / 2.0).ceil().max(1.0);
    change * (units / steps + (steps - 1.0) / 2.0)
}

/// `now` moved towards `wanted` by at most `change`.
#[must_use]
pub(super) fn towards(now: f64, wanted: f64, change: f64) -> f64 {
    now + exact::within(wanted - now, -change, change)
}
