//! A laser scanner: noise that grows with the distance, a resolution, and rays without an
//! answer.

use crate::error::{BadParameter, Bounds};
use crate::noise::Random;
use crate::parameters::Section;

/// Parameters of a laser scanner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScannerParameters {
    /// Standard deviation of the white noise at distance 0, metres.
    pub noise: f64,
    /// Growth of the standard deviation with the distance, metres per metre.
    pub relative_noise: f64,
    /// Step of the reported distances, metres; 0 is none.
    pub step: f64,
    /// Probability that a ray has no answer.
    pub dropout: f64,
}

impl ScannerParameters {
    pub(crate) fn read(s: &mut Section<'_>) -> Result<Self, BadParameter> {
        Ok(Self {
            noise: s.number("noise", "m", Bounds(0.0, 0.1))?,
            relative_noise: s.number("relative_noise", "1", Bounds(0.0, 0.1))?,
            step: s.number("step", "m", Bounds(0.0, 0.1))?,
            dropout: s.number("dropout", "1", Bounds(0.0, 0.3))?,
        })
    }
}

/// A laser scanner. It has no state: its noise depends on seed, tick and ray.
#[derive(Clone, Debug)]
pub struct ScannerModel {
    parameters: ScannerParameters,
    seed: u64,
    strength: f64,
}

impl ScannerModel {
    /// A scanner whose noise depends on `seed`, with `strength` times the errors of its
    /// parameters.
    #[must_use]
    pub fn new(parameters: ScannerParameters, seed: u64, strength: f64) -> Self {
        Self {
            parameters,
            seed,
            strength,
        }
    }

    /// Reported distances at a tick, metres, of true ones: +infinity without an answer or
    /// beyond the greatest distance of `limits`, -infinity below the least one.
    #[must_use]
    pub fn measure(&self, tick: u64, truth: &[f32], [least, greatest]: [f64; 2]) -> Vec<f32> {
        let p = &self.parameters;
        let step = p.step * self.strength;
        let measured = truth.iter().zip(0..).map(|(&distance, ray)| {
            let mut random = Random::new(self.seed, [tick, ray]);
            let is_lost = random.uniform() < p.dropout * self.strength;
            let distance = f64::from(distance);
            if is_lost {
                return f32::INFINITY;
            }
            if !distance.is_finite() {
                return distance as f32;
            }
            let deviation = self.strength * (p.noise + p.relative_noise * distance);
            let mut reported = distance + deviation * random.normal();
            if step > 0.0 {
                reported = (reported / step).round() * step;
            }
            match reported {
                near if near < least => f32::NEG_INFINITY,
                far if far > greatest => f32::INFINITY,
                within => within as f32,
            }
        });
        measured.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PARAMETERS: ScannerParameters = ScannerParameters {
        noise: 0.002,
        relative_noise: 0.005,
        step: 0.0005,
        dropout: 0.02,
    };

    #[test]
    fn noise_grows_with_the_distance_and_rays_are_lost_at_their_rate() {
        let scanner = ScannerModel::new(PARAMETERS, 3, 1.0);
        for distance in [0.5_f32, 6.0] {
            let truth = [distance; 720];
            let scans = (0..60).flat_map(|k| scanner.measure(4 * k, &truth, [0.06, 12.0]));
            let all: Vec<f32> = scans.collect();
            let answered: Vec<f64> = all
                .iter()
                .copied()
                .filter(|d| d.is_finite())
                .map(f64::from)
                .collect();
            let lost = 1.0 - answered.len() as f64 / all.len() as f64;
            assert!((lost - 0.02).abs() < 0.004, "{lost}");
            let errors = answered.iter().map(|d| (d - f64::from(distance)).powi(2));
            let deviation = (errors.sum::<f64>() / answered.len() as f64).sqrt();
            let expected = 0.002 + 0.005 * f64::from(distance);
            assert!(
                (deviation / expected - 1.0).abs() < 0.03,
                "{deviation}, expected {expected}"
            );
        }
    }

    #[test]
    fn strength_0_is_the_truth_and_limits_hold() {
        let perfect = ScannerModel::new(PARAMETERS, 3, 0.0);
        let truth = [0.3, 11.999, f32::INFINITY, f32::NEG_INFINITY];
        assert_eq!(perfect.measure(8, &truth, [0.06, 12.0]), truth);
        let scanner = ScannerModel::new(PARAMETERS, 3, 1.0);
        let edge = [[0.0605_f32; 300], [11.99; 300]].concat();
        let measured = scanner.measure(8, &edge, [0.06, 12.0]);
        let (near, far) = measured.split_at(300);
        assert!(near.contains(&f32::NEG_INFINITY) && far.contains(&f32::INFINITY));
        let within = |d: &f32| !d.is_finite() || (0.06..=12.0).contains(d);
        assert!(measured.iter().all(within));
        assert_eq!(scanner.measure(8, &edge, [0.06, 12.0]), measured);
        assert_ne!(scanner.measure(12, &edge, [0.06, 12.0]), measured);
    }
}
