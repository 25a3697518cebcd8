//! One step of the chair: a given distance or angle, then rest. Pure.

use nalgebra::Isometry3;
use wheelarm_proto::v1;

use crate::watch::Situation;

/// Time between two messages, s.
const RESEND: f64 = 0.05;
/// Tolerance of the goal, m and rad.
const ENOUGH: [f64; 2] = [0.002, 0.004];
/// Least and greatest speeds, m/s and rad/s.
const SPEEDS: [[f64; 2]; 2] = [[0.04, 0.20], [0.08, 0.40]];
/// Speed per remaining distance, 1/s.
const GAIN: f64 = 2.0;
/// Longest time of a step, s.
const LONGEST: f64 = 4.0;

/// A step in progress.
#[derive(Clone, Debug, PartialEq)]
pub struct ChairStep {
    turns: bool,
    /// m forward, or rad to the left.
    way: f64,
    began: f64,
    next: f64,
    house_from_start: Isometry3<f64>,
}

/// Output of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Due {
    /// Nothing is due.
    Nothing,
    /// Speeds.
    Send(v1::BaseCommand),
    /// The step is complete, or timed out.
    Done,
}

impl ChairStep {
    /// Starts at the chair's pose at `time`, s; `None` when the pose is unknown.
    #[must_use]
    pub fn new(turns: bool, way: f64, time: f64, situation: &Situation) -> Option<Self> {
        Some(Self {
            turns,
            way,
            began: time,
            next: time,
            house_from_start: situation.house_from_chair?,
        })
    }

    /// Output that is due at `time`, s.
    pub fn due(&mut self, time: f64, situation: &Situation) -> Due {
        let Some(chair) = situation.house_from_chair else {
            return Due::Done;
        };
        let start_from_chair = self.house_from_start.inverse() * chair;
        let kind = usize::from(self.turns);
        let gone = match self.turns {
            false => start_from_chair.translation.x,
            true => start_from_chair.rotation.euler_angles().2,
        };
        let left = (self.way - gone) * self.way.signum();
        if left < ENOUGH[kind] || time - self.began > LONGEST {
            return Due::Done;
        }
        if time < self.next {
            return Due::Nothing;
        }
        self.next = time + RESEND;
        let [least, most] = SPEEDS[kind];
        let speed = (GAIN * left).clamp(least, most) * self.way.signum();
        Due::Send(match self.turns {
            false => v1::BaseCommand {
                linear: speed,
                angular: 0.0,
            },
            true => v1::BaseCommand {
                linear: 0.0,
                angular: speed,
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_ends_at_its_goal_or_after_its_timeout() {
        let mut situation = Situation::default();
        situation.house_from_chair = Some(Isometry3::translation(3.0, 1.0, 0.0));
        let mut step = ChairStep::new(false, 0.05, 0.0, &situation).unwrap();
        let Due::Send(base) = step.due(0.0, &situation) else {
            panic!("nothing is sent");
        };
        assert!(base.linear > 0.0 && base.linear <= 0.2 && base.angular == 0.0);
        assert_eq!(step.due(0.01, &situation), Due::Nothing);
        situation.house_from_chair = Some(Isometry3::translation(3.049, 1.0, 0.0));
        assert_eq!(step.due(0.2, &situation), Due::Done);
        let mut stuck = ChairStep::new(true, -0.1, 0.0, &situation).unwrap();
        let Due::Send(base) = stuck.due(0.0, &situation) else {
            panic!("nothing is sent");
        };
        assert!(base.angular < 0.0);
        assert_eq!(stuck.due(4.1, &situation), Due::Done);
    }
}
