//! Wheel odometry with errors of the wheel radii and the track, and with slip
//! (Borenstein and Feng 1996).

use wheelarm_proto::exact;

use crate::error::{BadParameter, Bounds};
use crate::noise::Random;
use crate::parameters::Section;

/// Parameters of wheel odometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OdometryParameters {
    /// Relative error of each wheel's radius, standard deviation.
    pub radius: f64,
    /// Relative error of the track, standard deviation.
    pub track: f64,
    /// Slip of a wheel over a distance s: standard deviation slip·√s, √m.
    pub slip: f64,
    /// Step of a wheel's angle, rad.
    pub angle_step: f64,
}

impl OdometryParameters {
    pub(crate) fn read(s: &mut Section<'_>) -> Result<Self, BadParameter> {
        let part = Bounds(0.0, 0.3);
        Ok(Self {
            radius: s.number("radius", "1", part)?,
            track: s.number("track", "1", part)?,
            slip: s.number("slip", "√m", part)?,
            angle_step: s.number("angle_step", "rad", part)?,
        })
    }
}

/// Measured odometry.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OdometryReading {
    /// Position in the odometry frame, m.
    pub position: [f64; 2],
    /// Heading, rad.
    pub heading: f64,
    /// Forward speed, m/s.
    pub linear: f64,
    /// Turn rate, rad/s.
    pub angular: f64,
}

/// State of the odometry.
#[derive(Clone, Debug)]
pub struct OdometryModel {
    parameters: OdometryParameters,
    seed: u64,
    strength: f64,
    /// Assumed radii of the left and the right wheel, and assumed track, m.
    radii: [f64; 2],
    track: f64,
    last: Option<[f64; 2]>,
    reading: OdometryReading,
}

impl OdometryModel {
    /// Odometry of wheels of `radius` with the given `track`, m, whose errors depend on
    /// `seed`, with `strength` times the errors of the parameters.
    #[must_use]
    pub fn new(
        parameters: OdometryParameters,
        [radius, track]: [f64; 2],
        seed: u64,
        strength: f64,
    ) -> Self {
        let mut random = Random::new(seed, [0, u64::MAX]);
        let mut off = |of: f64| 1.0 + (strength * of * random.normal()).clamp(-0.5, 0.5);
        Self {
            radii: [
                radius * off(parameters.radius),
                radius * off(parameters.radius),
            ],
            track: track * off(parameters.track),
            parameters,
            seed,
            strength,
            last: None,
            reading: OdometryReading::default(),
        }
    }

    /// Restarts at the chair's pose.
    pub fn restart(&mut self) {
        self.last = None;
        self.reading = OdometryReading::default();
    }

    /// The reading after the wheels' angles (rad, unwrapped, left and right) at a tick,
    /// with their speeds (rad/s).
    pub fn update(&mut self, tick: u64, angles: [f64; 2], speeds: [f64; 2]) -> OdometryReading {
        let step = self.strength * self.parameters.angle_step;
        let angles = angles.map(|a| {
            if step > 0.0 {
                (a / step).round() * step
            } else {
                a
            }
        });
        if let Some(last) = self.last {
            let mut random = Random::new(self.seed, [tick, 3]);
            let mut way = |i: usize| {
                let way = (angles[i] - last[i]) * self.radii[i];
                let slip = self.parameters.slip * way.abs().sqrt() * random.normal();
                way + self.strength * slip
            };
            let (left, right) = (way(0), way(1));
            let (forward, turn) = ((right + left) / 2.0, (right - left) / self.track);
            let (sin, cos) = exact::sin_cos(self.reading.heading + turn / 2.0);
            self.reading.position[0] += forward * cos;
            self.reading.position[1] += forward * sin;
            self.reading.heading += turn;
        }
        self.last = Some(angles);
        let [left, right] = [0, 1].map(|i| speeds[i] * self.radii[i]);
        self.reading.linear = (right + left) / 2.0;
        self.reading.angular = (right - left) / self.track;
        self.reading
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHEELS: [f64; 2] = [0.17, 0.5];

    /// Drives straight for some metres; returns the final reading.
    fn straight(parameters: OdometryParameters, seed: u64, metres: f64) -> OdometryReading {
        let mut odometry = OdometryModel::new(parameters, WHEELS, seed, 1.0);
        let steps = (metres / 0.01) as u64;
        let mut reading = OdometryReading::default();
        for tick in 0..=steps {
            let angle = tick as f64 * 0.01 / WHEELS[0];
            reading = odometry.update(tick, [angle; 2], [1.0; 2]);
        }
        reading
    }

    fn deviation(of: impl Fn(u64) -> f64) -> f64 {
        let all: Vec<f64> = (0..400).map(of).collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        (all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / all.len() as f64).sqrt()
    }

    const NONE: OdometryParameters = OdometryParameters {
        radius: 0.0,
        track: 0.0,
        slip: 0.0,
        angle_step: 0.0,
    };

    #[test]
    fn heading_error_grows_linearly_by_radii_and_with_the_root_by_slip() {
        let radii = OdometryParameters {
            radius: 0.001,
            ..NONE
        };
        let slip = OdometryParameters {
            slip: 0.002,
            ..NONE
        };
        let heading = |parameters: OdometryParameters, metres: f64| {
            deviation(|seed| straight(parameters, seed, metres).heading)
        };
        for metres in [1.0_f64, 4.0] {
            // (right - left)/track: two radii, each with an error of 0.1 %.
            let expected = 2.0_f64.sqrt() * 0.001 * metres / WHEELS[1];
            let found = heading(radii, metres);
            assert!(
                (found / expected - 1.0).abs() < 0.12,
                "{found}, expected {expected}"
            );
            let expected = 2.0_f64.sqrt() * 0.002 * metres.sqrt() / WHEELS[1];
            let found = heading(slip, metres);
            assert!(
                (found / expected - 1.0).abs() < 0.12,
                "{found}, expected {expected}"
            );
        }
    }

    #[test]
    fn odometry_is_exact_without_errors_and_depends_on_the_seed() {
        let reading = straight(NONE, 1, 2.0);
        assert!((reading.position[0] - 2.0).abs() < 1e-9 && reading.heading.abs() < 1e-12);
        let all = OdometryParameters {
            radius: 0.01,
            track: 0.01,
            slip: 0.002,
            angle_step: 0.001,
        };
        assert_eq!(straight(all, 1, 1.0), straight(all, 1, 1.0));
        assert_ne!(straight(all, 1, 1.0), straight(all, 2, 1.0));
    }
}
