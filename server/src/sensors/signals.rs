//! What sensor models make of the robot's signals: encoders, torques, gripper,
//! wheel odometry, inertial measurement. Their state begins with the episode, so
//! that a replay makes the same bits.

use wheelarm_sensors::encoders::{Encoders, Joints};
use wheelarm_sensors::imu::ImuModel;
use wheelarm_sensors::noise::key_of;
use wheelarm_sensors::odometry::{OdometryModel, Told};

use super::imu;
use super::models::Device;
use crate::robot::RobotModel;
use crate::snapshot::Snapshot;

/// The models of signals that a scenario has on.
#[derive(Clone, Debug, Default)]
pub struct Signals {
    encoders: Option<Encoders>,
    odometry: Option<OdometryModel>,
    imu: Option<ImuModel>,
    told: Told,
}

/// Seed of a model: two models of one scenario draw nothing alike, or the error of one
/// would tell that of the other.
fn own(seed: u64, model: &str) -> u64 {
    seed ^ key_of(model)
}

impl Signals {
    /// Those of `devices` on a robot.
    #[must_use]
    pub fn new(devices: &[Device], robot: &RobotModel) -> Self {
        let mut signals = Self::default();
        let wheels = [robot.settings.wheel_radius, robot.settings.track];
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
        }
        signals
    }

    /// Begins anew: odometry where the chair stands, biases as when switched on.
    pub fn restart(&mut self) {
        self.told = Told::default();
        if let Some(odometry) = &mut self.odometry {
            odometry.restart();
        }
        if let Some(imu) = &mut self.imu {
            imu.restart();
        }
    }

    /// Takes the state after a control tick.
    pub fn update(&mut self, snapshot: &Snapshot, robot: &RobotModel) {
        let Some(odometry) = &mut self.odometry else {
            return;
        };
        let wheels = robot.roles.wheels.map(|wheel| snapshot.joints[wheel]);
        self.told = odometry.update(
            snapshot.tick,
            wheels.map(|wheel| wheel.position),
            wheels.map(|wheel| wheel.velocity),
        );
    }

    /// Odometry after the last [`Signals::update`], where its model is on.
    #[must_use]
    pub fn odometry(&self) -> Option<Told> {
        self.odometry.as_ref().map(|_| self.told)
    }

    /// The arm's joints and the gripper's opening (m), where the model is on.
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

    /// Angular velocity (rad/s) and specific force (m/s²) of a measurement as the
    /// model tells it, where it is on; `rate` is that of the measurements, Hz.
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
    use wheelarm_sensors::noise::Random;

    #[test]
    fn no_model_draws_what_another_one_does() {
        let first = |model| {
            let mut random = Random::new(own(7, model), [0, u64::MAX]);
            [random.normal(), random.normal()]
        };
        let all = ["encoders", "odometry", "imu"].map(first);
        for (i, one) in all.iter().enumerate() {
            assert!(all[i + 1..].iter().all(|other| other != one), "{all:?}");
        }
    }
}
