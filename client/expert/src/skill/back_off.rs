//! Backing off: the chair rolls backwards while the hand carries an object.

use nalgebra::{Isometry3, Translation3, Vector3};

use super::Now;
use crate::clearance::held_balls;
use wheelarm_planning::floor_map::STOP_CLEARANCE;

/// Name of the phase in which the chair backs off.
pub const BACKING_OFF: &str = "carrying and backing off";

/// Peak speed of the chair for a drive at the second speed, m/s.
const PEAK: [f64; 2] = [0.12, 0.45];
/// Lowest mean speed, m/s.
const SLOWEST: f64 = 0.03;
/// Spacing at which the way back is checked, metres.
const SPACING: f64 = 0.05;
/// Room behind the chair beyond where it stops, metres.
const BEHIND: f64 = 0.10;
/// Shares of the way back at which the hand is checked.
const SHARES: [f64; 2] = [0.5, 1.0];
/// The chair speeds up and slows down within this share of the time.
const RAMP: f64 = 0.3;

/// The chair's movement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BackOff {
    since: f64,
    seconds: f64,
    peak: f64,
}

impl BackOff {
    /// The movement for a hand with an object that passes `poses` in `house` meanwhile, within
    /// `seconds` where that is not too slow. `None` without the habit, or where chair, hand or
    /// object would touch anything.
    #[must_use]
    pub fn plan(now: &Now<'_>, poses: &[Isometry3<f64>], seconds: f64) -> Option<Self> {
        let by = now.profile.habits?.back_off?;
        let footprint = now.scene.footprint_check(now.poses);
        let chair = now.observation.chair();
        let steps = ((by + BEHIND) / SPACING).ceil() as usize;
        let is_free =
            |i| footprint.is_free(&chair.rolled(-SPACING * i as f64, 0.0), STOP_CLEARANCE);
        if !(1..=steps).all(is_free) {
            return None;
        }
        let item = now.goal.item();
        let held = now.memory.held.unwrap_or_else(|| now.object_in_hand());
        let balls = held_balls(&now.scene.items[item].boxes, &held);
        let width = now.memory.candidate.map_or(0.0, |taken| taken.width);
        let back = now.observation.house_from_chair.rotation * Vector3::x() * -by;
        let moved = |share: f64| {
            let offset = Translation3::from(back * share);
            poses.iter().map(move |pose| offset * pose)
        };
        for share in SHARES {
            let line: Vec<_> = poses.iter().take(1).copied().chain(moved(share)).collect();
            let around = now.scene.around(&line, now.poses, Some(item));
            let is_free = around.hand_is_free(&now.scene.hand, width, &line, 0.0)
                && (line.windows(2)).all(|leg| around.is_free(&balls, &leg[0], &leg[1], 0.0));
            if !is_free {
                return None;
            }
        }
        let peak = PEAK[0] * (now.profile.drive.speed / PEAK[1]).min(1.0);
        let quickest = by / (peak * (1.0 - RAMP));
        let seconds = seconds.min(by / SLOWEST).max(quickest);
        Some(Self {
            since: now.observation.time,
            seconds,
            peak: by / (seconds * (1.0 - RAMP)),
        })
    }

    /// Whether the chair has arrived by `time`.
    #[must_use]
    pub fn is_over(&self, time: f64) -> bool {
        time >= self.since + self.seconds
    }

    /// Forward speed, m/s, and turn rate, rad/s, of the chair at `time`.
    #[must_use]
    pub fn command(&self, time: f64) -> [f64; 2] {
        let share = (time - self.since) / self.seconds;
        let ramp = (share.min(1.0 - share) / RAMP).clamp(0.0, 1.0);
        [-self.peak * ramp, 0.0]
    }
}
