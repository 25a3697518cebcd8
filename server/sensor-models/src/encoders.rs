//! Joint encoders, torque sensors and the position of a gripper, with quantisation and
//! noise.

use crate::error::{BadParameter, Bounds};
use crate::noise::Random;
use crate::parameters::Section;

/// Parameters of an arm's and a gripper's sensors.
#[derive(Clone, Debug, PartialEq)]
pub struct EncoderParameters {
    /// Step of a joint position, rad.
    pub position_step: f64,
    /// Offset of each joint's zero, standard deviation, rad.
    pub zero: f64,
    /// Noise of a joint velocity, standard deviation, rad/s.
    pub velocity_noise: f64,
    /// Noise of a joint torque, standard deviation, N·m.
    pub torque_noise: f64,
    /// Offset of a joint torque, standard deviation, N·m.
    pub torque_offset: f64,
    /// Step of the gripper's opening, m.
    pub opening_step: f64,
}

impl EncoderParameters {
    pub(crate) fn read(s: &mut Section<'_>) -> Result<Self, BadParameter> {
        Ok(Self {
            position_step: s.number("position_step", "rad", Bounds(0.0, 0.1))?,
            zero: s.number("zero", "rad", Bounds(0.0, 0.2))?,
            velocity_noise: s.number("velocity_noise", "rad/s", Bounds(0.0, 1.0))?,
            torque_noise: s.number("torque_noise", "N·m", Bounds(0.0, 20.0))?,
            torque_offset: s.number("torque_offset", "N·m", Bounds(0.0, 20.0))?,
            opening_step: s.number("opening_step", "m", Bounds(0.0, 0.05))?,
        })
    }
}

/// True state of the arm, from base to hand, and of the gripper.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Joints {
    /// rad.
    pub positions: Vec<f64>,
    /// rad/s.
    pub velocities: Vec<f64>,
    /// N·m.
    pub efforts: Vec<f64>,
    /// Distance between the gripper's pads, m.
    pub opening: f64,
}

/// The encoder model. Stateless: a sample depends only on tick and true state.
#[derive(Clone, Debug)]
pub struct Encoders {
    parameters: EncoderParameters,
    seed: u64,
    strength: f64,
}

impl Encoders {
    /// Sensors whose noise depends on `seed`, with `strength` times the errors of their
    /// parameters.
    #[must_use]
    pub fn new(parameters: EncoderParameters, seed: u64, strength: f64) -> Self {
        Self {
            parameters,
            seed,
            strength,
        }
    }

    /// The measured values at a tick.
    #[must_use]
    pub fn measure(&self, tick: u64, truth: &Joints) -> Joints {
        let (p, k) = (&self.parameters, self.strength);
        let mut noise = Random::new(self.seed, [tick, 1]);
        // Constant per specimen and joint.
        let fixed = |joint: usize, what: u64| {
            Random::new(self.seed, [u64::MAX - what, joint as u64]).normal()
        };
        let all = truth.positions.iter().enumerate();
        Joints {
            positions: all
                .map(|(j, v)| stepped(v + k * p.zero * fixed(j, 0), k * p.position_step))
                .collect(),
            velocities: truth
                .velocities
                .iter()
                .map(|v| v + k * p.velocity_noise * noise.normal())
                .collect(),
            efforts: truth
                .efforts
                .iter()
                .enumerate()
                .map(|(j, v)| {
                    let offset = p.torque_offset * fixed(j, 1);
                    v + k * (offset + p.torque_noise * noise.normal())
                })
                .collect(),
            opening: stepped(truth.opening, k * p.opening_step),
        }
    }
}

fn stepped(value: f64, step: f64) -> f64 {
    if step > 0.0 {
        (value / step).round() * step
    } else {
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameters() -> EncoderParameters {
        EncoderParameters {
            position_step: 0.001,
            zero: 0.002,
            velocity_noise: 0.01,
            torque_noise: 0.3,
            torque_offset: 0.2,
            opening_step: 0.0004,
        }
    }

    #[test]
    fn positions_are_quantised_and_torques_have_the_given_noise() {
        let truth = Joints {
            positions: vec![0.12345, -1.5],
            velocities: vec![0.1, 0.0],
            efforts: vec![5.0, -2.0],
            opening: 0.0425,
        };
        let encoders = Encoders::new(parameters(), 3, 1.0);
        let all: Vec<_> = (0..4000).map(|t| encoders.measure(t, &truth)).collect();
        for sample in &all {
            for (measured, exact) in sample.positions.iter().zip(&truth.positions) {
                let steps = measured / 0.001;
                assert!((steps - steps.round()).abs() < 1e-6);
                assert!((measured - exact).abs() < 0.01);
            }
        }
        let torque: Vec<f64> = all.iter().map(|s| s.efforts[0]).collect();
        let mean = torque.iter().sum::<f64>() / torque.len() as f64;
        let variance = torque.iter().map(|t| (t - mean).powi(2)).sum::<f64>() / torque.len() as f64;
        assert!(
            (variance.sqrt() / 0.3 - 1.0).abs() < 0.05,
            "{}",
            variance.sqrt()
        );
        assert!((mean - 5.0).abs() < 0.8 && (mean - 5.0).abs() > 1e-3);
        assert_eq!(
            Encoders::new(parameters(), 3, 0.0).measure(7, &truth),
            truth
        );
        assert_ne!(
            all[0],
            Encoders::new(parameters(), 4, 1.0).measure(0, &truth)
        );
    }
}
