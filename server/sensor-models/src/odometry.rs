//! Wheel odometry with wheels that are not as large, and not as far apart, as the
//! robot believes, and that slip. Borenstein and Feng 1996.

use wheelarm_proto::exact;

use crate::error::{BadParameter, Bounds};
use crate::noise::Random;
use crate::parameters::Section;

/// Parameters of wheel odometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OdometryParameters {
    /// Error of each wheel's radius, deviation, as a part.
    pub radius: f64,
    /// Error of the track, deviation, as a part.
    pub track: f64,
    /// Slip of a wheel over a way s: deviation slip·√s, √m.
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

/// What odometry tells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Told {
    /// Position in the odometry frame, m.
    pub position: [f64; 2],
    /// Heading, rad.
    pub heading: f64,
    /// Forward speed, m/s.
    pub linear: f64,
    /// Turn rate, rad/s.
    pub angular: f64,
}

/// Odometry at work.
#[derive(Clone, Debug)]
pub struct OdometryModel {
    parameters: OdometryParameters,
    seed: u64,
    strength: f64,
    /// Believed radii of the left and the right wheel, and believed track, m.
    radii: [f64; 2],
    track: f64,
    last: Option<[f64; 2]>,
    told: Told,
}

impl OdometryModel {
    /// Odometry of wheels of `radius` that stand `track` apart, m, whose errors
    /// follow from `seed`, `strength` times as bad as the parameters say.
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
            told: Told::default(),
        }
    }

    /// Begins anew where the chair stands.
    pub fn restart(&mut self) {
        self.last = None;
        self.told = Told::default();
    }

    /// What it tells after the wheels' angles (rad, unwrapped, left and right) at
    /// a tick, with their speeds (rad/s).
    pub fn update(&mut self, tick: u64, angles: [f64; 2], speeds: [f64; 2]) -> Told {
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
            let (sin, cos) = exact::sin_cos(self.told.heading + turn / 2.0);
            self.told.position[0] += forward * cos;
            self.told.position[1] += forward * sin;
            self.told.heading += turn;
        }
        self.last = Some(angles);
        let [left, right] = [0, 1].map(|i| speeds[i] * self.radii[i]);
        self.told.linear = (right + left) / 2.0;
        self.told.angular = (right - left) / self.track;
        self.told
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHEELS: [f64; 2] = [0.17, 0.5];

    /// Straight on for some metres, told end.
    fn straight(parameters: OdometryParameters, seed: u64, metres: f64) -> Told {
        let mut odometry = OdometryModel::new(parameters, WHEELS, seed, 1.0);
        let steps = (metres / 0.01) as u64;
        let mut told = Told::default();
        for tick in 0..=steps {
            let angle = tick as f64 * 0.01 / WHEELS[0];
            told = odometry.update(tick, [angle; 2], [1.0; 2]);
        }
        told
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
    fn wrong_radii_bend_the_way_in_proportion_and_slip_by_its_root() {
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
            // (right - left)/track: two radii, each off by 0.1 %.
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
    fn without_errors_it_tells_the_truth_and_with_them_what_the_seed_says() {
        let told = straight(NONE, 1, 2.0);
        assert!((told.position[0] - 2.0).abs() < 1e-9 && told.heading.abs() < 1e-12);
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
