//! Inertial measurement unit: orientation, angular velocity and specific force of its
//! link, from the states of two consecutive ticks, with optional noise from the seed.

use nalgebra::{UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use wheelarm_proto::PHYSICS_HZ;
use wheelarm_proto::exact;

use crate::robot::ImuSettings;
use crate::snapshot::BodyState;

/// Standard gravity used by the simulation, m/s².
pub const GRAVITY: f64 = 9.81;

/// Standard deviations of the white noise of one sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Noise {
    /// Of each axis of the angular velocity, rad/s.
    pub angular: f64,
    /// Of each axis of the specific force, m/s².
    pub linear: f64,
    /// Of the orientation about each axis, rad.
    pub orientation: f64,
}

impl Noise {
    /// From the densities of a robot description: white noise of density d sampled at f
    /// Hz has the deviation d·√f.
    #[must_use]
    pub fn from_settings(settings: &ImuSettings) -> Self {
        let root = (PHYSICS_HZ as f64).sqrt();
        Self {
            angular: settings.gyro_noise * root,
            linear: settings.acceleration_noise * root,
            orientation: settings.orientation_noise,
        }
    }
}

/// One measurement, in the IMU link unless noted otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Tick of the measurement.
    pub tick: u64,
    /// world_from_imu.
    pub orientation: UnitQuaternion<f64>,
    /// rad/s.
    pub angular_velocity: Vector3<f64>,
    /// Specific force, m/s²: at rest +9.81 along z.
    pub linear_acceleration: Vector3<f64>,
}

/// State between two measurements.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Imu {
    last_velocity: Option<Vector3<f64>>,
    noise_draws: u64,
    seed: u64,
}

impl Imu {
    /// An IMU whose noise depends on `seed`.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self {
            last_velocity: None,
            noise_draws: 0,
            seed,
        }
    }

    /// Sets the velocity before the first measurement.
    pub fn prime(&mut self, link: &BodyState) {
        self.last_velocity = Some(link.linear);
    }

    /// Measures the link's state at `tick`. Call it once per tick: the acceleration is
    /// the change of velocity over the last one.
    pub fn measure(&mut self, tick: u64, link: &BodyState, noise: Option<Noise>) -> Sample {
        let acceleration = match self.last_velocity.replace(link.linear) {
            Some(last) => (link.linear - last) * PHYSICS_HZ as f64,
            None => Vector3::zeros(),
        };
        let imu_from_world = link.pose.rotation.inverse();
        let mut sample = Sample {
            tick,
            orientation: link.pose.rotation,
            angular_velocity: imu_from_world * link.angular,
            linear_acceleration: imu_from_world * (acceleration + Vector3::new(0.0, 0.0, GRAVITY)),
        };
        if let Some(noise) = noise {
            // One generator per sample, keyed by the count, so that the state to save
            // is two integers.
            let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
            rng.set_stream(self.noise_draws.wrapping_add(1));
            self.noise_draws += 1;
            for axis in 0..3 {
                sample.angular_velocity[axis] += noise.angular * normal(&mut rng);
                sample.linear_acceleration[axis] += noise.linear * normal(&mut rng);
            }
            let mut turn = || noise.orientation * normal(&mut rng);
            let turn = Vector3::new(turn(), turn(), turn());
            sample.orientation *= UnitQuaternion::from_scaled_axis(turn);
        }
        sample
    }
}

/// A standard normal variate by Box and Muller (1958).
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    use rand::Rng;
    let uniform = |bits: u64| ((bits >> 11) as f64 + 0.5) / (1u64 << 53) as f64;
    let (a, b) = (uniform(rng.next_u64()), uniform(rng.next_u64()));
    (-2.0 * exact::ln(a)).sqrt() * exact::cos(std::f64::consts::TAU * b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Isometry3;

    fn still() -> BodyState {
        BodyState {
            pose: Isometry3::identity(),
            linear: Vector3::zeros(),
            angular: Vector3::zeros(),
        }
    }

    #[test]
    fn imu_measures_gravity_at_rest_and_zero_in_free_fall() {
        let mut imu = Imu::new(0);
        imu.measure(0, &still(), None);
        let rest = imu.measure(1, &still(), None);
        assert!((rest.linear_acceleration - Vector3::new(0.0, 0.0, GRAVITY)).norm() < 1e-12);
        let mut falling = still();
        falling.linear.z = -GRAVITY / PHYSICS_HZ as f64;
        assert!(imu.measure(2, &falling, None).linear_acceleration.norm() < 1e-9);
    }

    #[test]
    fn noise_has_the_given_deviation_and_depends_on_the_seed() {
        let noise = Some(Noise {
            angular: 0.01,
            linear: 0.1,
            orientation: 0.001,
        });
        let run = |seed| {
            let mut imu = Imu::new(seed);
            (0..4000)
                .map(|t| imu.measure(t, &still(), noise))
                .collect::<Vec<_>>()
        };
        let samples = run(7);
        assert_eq!(samples, run(7));
        assert_ne!(samples, run(8));
        let n = samples.len() as f64;
        let variance = samples
            .iter()
            .map(|s| s.angular_velocity.x.powi(2))
            .sum::<f64>()
            / n;
        assert!(
            (variance.sqrt() - 0.01).abs() < 0.001,
            "deviation {}",
            variance.sqrt()
        );
    }
}
