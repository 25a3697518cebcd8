//! Stow: brings the arm home from whatever posture it was left in, joint by joint,
//! before the chair moves: a planned path of the hand begins there.

use wheelarm_proto::v1::Phase;

use super::{Act, Now, Skill, Step};

/// The arm is home when no joint is further off than this, radians.
const NEAR: f64 = 0.02;
/// Longest time on the way home, seconds.
const LONGEST: f64 = 15.0;

/// See the module.
#[derive(Clone, Debug, Default)]
pub struct Stow {
    begun: Option<f64>,
}

impl Stow {
    /// Whether an arm at these positions is home.
    #[must_use]
    pub fn is_home(arm: &[f64; 6], home: &[f64; 6]) -> bool {
        arm.iter().zip(home).all(|(a, b)| (a - b).abs() < NEAR)
    }
}

impl Skill for Stow {
    fn step(&mut self, now: &mut Now<'_>) -> Step {
        let begun = *self.begun.get_or_insert(now.observation.time);
        let home = now.scene.home;
        if Self::is_home(&now.observation.arm, &home) {
            return Step::Done;
        }
        if now.observation.time - begun > LONGEST {
            return Step::Impossible("the arm does not come home".to_owned());
        }
        Step::Going(Act {
            joints: Some(home),
            base: Some([0.0, 0.0]),
            ..Act::named(Phase::Navigating, "stowing")
        })
    }
}
