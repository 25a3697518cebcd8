//! Sensor models of the robot's signals: encoders, torques, gripper, wheel odometry,
//! inertial measurement, laser scanner. Their state starts with the episode, so that a replay gives
//! the same bits.

use wheelarm_proto::random::fnv1a;
use wheelarm_sensor_models::encoders::{Encoders, Joints};
use wheelarm_sensor_models::imu::ImuModel;
use wheelarm_sensor_models::odometry::{OdometryModel, OdometryReading};
use wheelarm_sensor_models::scanner::ScannerModel;

use super::imu;
use super::models::Device;
use crate::robot::RobotModel;
use crate::snapshot::Snapshot;

/// The active models of signals.
#[derive(Clone, Debug, Default)]
pub struct Signals {
    encoders: Option<Encoders>,
    odometry: Option<OdometryModel>,
    imu: Option<ImuModel>,
    scanner: Option<ScannerModel>,
    reading: OdometryReading,
}

/// Seed of a model: two models of one scenario must use different streams, or their
/// errors would be correlated.
fn own(seed: u64, model: &str) -> u64 {
    seed ^ fnv1a(model)
}

impl Signals {
    /// The models of `devices` on a robot.
    #[must_use]
    pub fn new(devices: &[Device], robot: &RobotModel) -> Self {
        let mut signals = Self::default();
        let wheels = [
            robot.settings.drive.wheel_radius,
            robot.settings.drive.track,
        ];
        for Device {
            seed,
            strength,
            model,
            ..
        } in devices
        {
            if let Some(p) = &model.encoders {
                signals.encoders =
                    Some(Encoders::new(p.clone(), own(*seed, "encoders"), *strength));
            }
            if let Some(p) = model.odometry {
                signals.odometry = Some(OdometryModel::new(
                    p,
                    wheels,
                    own(*seed, "odometry"),
                    *strength,
                ));
            }
            if let Some(p) = model.imu {
                signals.imu = Some(ImuModel::new(p, own(*seed, "imu"), *strength));
            }
            if let Some(p) = model.scanner {
                signals.scanner = Some(ScannerModel::new(p, own(*seed, "scanner"), *strength));
            }
        }
        signals
    }

    /// Restarts: odometry at the chair's pose, biases as after switching on.
    pub fn restart(&mut self) {
        self.reading = OdometryReading::default();
        if let Some(odometry) = &mut self.odometry {
            odometry.restart();
        }
        if let Some(imu) = &mut self.imu {
            imu.restart();
        }
    }

    /// Updates with the state after a control tick.
    pub fn update(&mut self, snapshot: &Snapshot, robot: &RobotModel) {
        let Some(odometry) = &mut self.odometry else {
            return;
        };
        let wheels = robot.roles.wheels.map(|wheel| snapshot.joints[wheel]);
        self.reading = odometry.update(
            snapshot.tick,
            wheels.map(|wheel| wheel.position),
            wheels.map(|wheel| wheel.velocity),
        );
    }

    /// Odometry after the last [`Signals::update`], if its model is active.
    #[must_use]
    pub fn odometry(&self) -> Option<OdometryReading> {
        self.odometry.as_ref().map(|_| self.reading)
    }

    /// The arm's joints and the gripper's opening (m), if the model is active.
    #[must_use]
    pub fn joints(&self, snapshot: &Snapshot, robot: &RobotModel, opening: f64) -> Option<Joints> {
        let encoders = self.encoders.as_ref()?;
        let arm = robot.roles.arm.map(|joint| snapshot.joints[joint]);
        let truth = Joints {
            positions: arm.iter().map(|joint| joint.position).collect(),
            velocities: arm.iter().map(|joint| joint.velocity).collect(),
            efforts: arm.iter().map(|joint| joint.effort).collect(),
            opening,
        };
        Some(encoders.measure(snapshot.tick, &truth))
    }

    /// Measured distances of a scan (m), if the model is active; `limits` are the least and
    /// the greatest that the scanner measures.
    #[must_use]
    pub fn scan(&self, tick: u64, ranges: &[f32], limits: [f64; 2]) -> Option<Vec<f32>> {
        let scanner = self.scanner.as_ref()?;
        Some(scanner.measure(tick, ranges, limits))
    }

    /// Measured angular velocity (rad/s) and specific force (m/s²), if the model is
    /// active; `rate` is that of the measurements, Hz.
    pub fn imu(&mut self, sample: &imu::Sample, rate: f64) -> Option<[[f64; 3]; 2]> {
        let truth = [
            sample.angular_velocity.into(),
            sample.linear_acceleration.into(),
        ];
        let imu = self.imu.as_mut()?;
        Some(imu.measure(sample.tick, rate, truth))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheelarm_sensor_models::noise::Random;

    #[test]
    fn models_use_different_random_streams() {
        let first = |model| {
            let mut random = Random::new(own(7, model), [0, u64::MAX]);
            [random.normal(), random.normal()]
        };
        let all = ["encoders", "odometry", "imu", "scanner"].map(first);
        for (i, one) in all.iter().enumerate() {
            assert!(all[i + 1..].iter().all(|other| other != one), "{all:?}");
        }
    }
}
