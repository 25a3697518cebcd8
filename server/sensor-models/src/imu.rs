//! An inertial measurement unit: white noise and a bias with a random walk (El-Sheimy,
//! Hou and Niu 2008). The noise dominates at short times, the walk at long ones.

use crate::error::{BadParameter, Bounds};
use crate::noise::Random;
use crate::parameters::Section;

/// Parameters of one triad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriadParameters {
    /// Density of the white noise, unit/√Hz.
    pub density: f64,
    /// Bias after switching on, standard deviation, unit.
    pub bias: f64,
    /// Random walk of the bias, unit/√s.
    pub walk: f64,
}

/// Parameters of an IMU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuParameters {
    /// rad/s.
    pub gyroscope: TriadParameters,
    /// m/s².
    pub accelerometer: TriadParameters,
}

impl ImuParameters {
    pub(crate) fn read(s: &mut Section<'_>) -> Result<Self, BadParameter> {
        let bounds = Bounds(0.0, 10.0);
        let mut triad = |name: &str, unit: &str| {
            Ok(TriadParameters {
                density: s.number(&format!("{name}_density"), &format!("{unit}/√Hz"), bounds)?,
                bias: s.number(&format!("{name}_bias"), unit, bounds)?,
                walk: s.number(&format!("{name}_walk"), &format!("{unit}/√s"), bounds)?,
            })
        };
        Ok(Self {
            gyroscope: triad("gyroscope", "rad/s")?,
            accelerometer: triad("accelerometer", "m/s²")?,
        })
    }
}

/// Ticks per second.
const TICKS: f64 = wheelarm_proto::PHYSICS_HZ as f64;

/// State of an IMU.
#[derive(Clone, Debug)]
pub struct ImuModel {
    parameters: [TriadParameters; 2],
    seed: u64,
    strength: f64,
    /// Bias of each axis, and its tick.
    bias: Option<([[f64; 3]; 2], u64)>,
}

impl ImuModel {
    /// An IMU whose noise depends on `seed`, with `strength` times the errors of its
    /// parameters.
    #[must_use]
    pub fn new(parameters: ImuParameters, seed: u64, strength: f64) -> Self {
        Self {
            parameters: [parameters.gyroscope, parameters.accelerometer],
            seed,
            strength,
            bias: None,
        }
    }

    /// Switches it off and on again.
    pub fn restart(&mut self) {
        self.bias = None;
    }

    /// Measured angular velocity (rad/s) and specific force (m/s²) at a tick; `rate` is
    /// the sample rate, Hz. Ticks must not decrease.
    pub fn measure(&mut self, tick: u64, rate: f64, truth: [[f64; 3]; 2]) -> [[f64; 3]; 2] {
        let (mut bias, last) = self.bias.unwrap_or_else(|| {
            let mut random = Random::new(self.seed, [0, u64::MAX]);
            let start = self
                .parameters
                .map(|p| [0; 3].map(|_| p.bias * random.normal()));
            (start, tick)
        });
        let mut random = Random::new(self.seed, [tick, 2]);
        let root = (tick.saturating_sub(last) as f64 / TICKS).sqrt();
        let mut out = truth;
        for (triad, p) in self.parameters.iter().enumerate() {
            for axis in 0..3 {
                bias[triad][axis] += p.walk * root * random.normal();
                let white = p.density * rate.sqrt() * random.normal();
                out[triad][axis] += self.strength * (bias[triad][axis] + white);
            }
        }
        self.bias = Some((bias, tick));
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameters() -> ImuParameters {
        ImuParameters {
            gyroscope: TriadParameters {
                density: 1e-4,
                bias: 2e-3,
                walk: 1e-3,
            },
            accelerometer: TriadParameters {
                density: 1e-3,
                bias: 0.02,
                walk: 1e-4,
            },
        }
    }

    fn run(seed: u64, seconds: u64) -> Vec<f64> {
        let mut imu = ImuModel::new(parameters(), seed, 1.0);
        let ticks = (0..seconds * 240).step_by(2);
        let samples = ticks.map(|t| imu.measure(t, 120.0, [[0.0; 3]; 2])[0][1]);
        samples.collect()
    }

    /// Allan deviation of samples at 120 Hz, averaged over `seconds`.
    fn allan(all: &[f64], seconds: f64) -> f64 {
        let n = (seconds * 120.0) as usize;
        let means: Vec<f64> = all
            .chunks_exact(n)
            .map(|c| c.iter().sum::<f64>() / n as f64)
            .collect();
        let squares = means.windows(2).map(|w| (w[1] - w[0]).powi(2));
        (squares.sum::<f64>() / (2.0 * (means.len() - 1) as f64)).sqrt()
    }

    #[test]
    fn noise_is_white_at_short_times_and_a_random_walk_at_long_times() {
        let all = run(5, 6000);
        // Density/√τ; the walk is still negligible.
        let short = allan(&all, 0.025);
        assert!(
            (short / (1e-4 / 0.025_f64.sqrt()) - 1.0).abs() < 0.1,
            "{short}"
        );
        // K·√(τ/3): doubles when the time is four times as long.
        for seconds in [5.0, 20.0] {
            let found = allan(&all, seconds);
            let expected = 1e-3 * (seconds / 3.0_f64).sqrt();
            assert!(
                (found / expected - 1.0).abs() < 0.2,
                "{found}, expected {expected}"
            );
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_bits_also_after_a_restart() {
        assert_eq!(run(5, 2), run(5, 2));
        assert_ne!(run(5, 2), run(6, 2));
        let mut imu = ImuModel::new(parameters(), 5, 1.0);
        let first = imu.measure(480, 120.0, [[0.0; 3]; 2]);
        imu.measure(960, 120.0, [[0.0; 3]; 2]);
        imu.restart();
        assert_eq!(first, imu.measure(480, 120.0, [[0.0; 3]; 2]));
        let mut perfect = ImuModel::new(parameters(), 5, 0.0);
        let truth = [[0.1, 0.2, 0.3], [0.0, 0.0, 9.81]];
        assert_eq!(perfect.measure(0, 120.0, truth), truth);
    }
}
