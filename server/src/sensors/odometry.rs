//! Wheel odometry as computed by the chair's driver: v = (v_right + v_left)/2, ω =
//! (v_right − v_left)/track, midpoint heading.

use serde::{Deserialize, Serialize};
use wheelarm_proto::exact;

/// Dead reckoning from the angles of the driven wheels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Odometry {
    radius: f64,
    track: f64,
    last: Option<[f64; 2]>,
    /// Position in the odometry frame, metres.
    pub position: [f64; 2],
    /// Heading, rad, unwrapped.
    pub heading: f64,
    /// Forward speed, m/s.
    pub linear: f64,
    /// Turn rate, rad/s.
    pub angular: f64,
}

impl Odometry {
    /// Odometry for wheels of `radius` with the given `track`, both in metres.
    #[must_use]
    pub fn new(radius: f64, track: f64) -> Self {
        Self {
            radius,
            track,
            last: None,
            position: [0.0; 2],
            heading: 0.0,
            linear: 0.0,
            angular: 0.0,
        }
    }

    /// Updates with the angles of the left and the right wheel (rad, unwrapped) and
    /// their speeds (rad/s).
    pub fn update(&mut self, angles: [f64; 2], speeds: [f64; 2]) {
        if let Some(last) = self.last {
            let [left, right] = [0, 1].map(|i| (angles[i] - last[i]) * self.radius);
            let (forward, turn) = ((right + left) / 2.0, (right - left) / self.track);
            let middle = self.heading + turn / 2.0;
            self.position[0] += forward * exact::cos(middle);
            self.position[1] += forward * exact::sin(middle);
            self.heading += turn;
        }
        self.last = Some(angles);
        let [left, right] = speeds.map(|s| s * self.radius);
        self.linear = (right + left) / 2.0;
        self.angular = (right - left) / self.track;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wheels_in_opposite_directions_turn_the_chair_on_the_spot() {
        let mut odometry = Odometry::new(0.1325, 0.496);
        let quarter = std::f64::consts::FRAC_PI_2 * 0.496 / 2.0 / 0.1325;
        for i in 0..=100 {
            let a = quarter * f64::from(i) / 100.0;
            odometry.update([-a, a], [0.0; 2]);
        }
        assert!((odometry.heading - std::f64::consts::FRAC_PI_2).abs() < 1e-9);
        assert!(odometry.position.iter().all(|p| p.abs() < 1e-9));
    }
}
