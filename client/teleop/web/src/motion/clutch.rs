//! A tracked controller leads the robot's hand while a clutch is engaged. Pure.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use crate::protocol::Clutch;

/// Longest motion of one message, m and rad.
const STEP: [f64; 2] = [0.025, 0.10];
/// The target leads the hand by this at most, m and rad.
const LEAD: [f64; 2] = [0.12, 0.40];

/// An engaged clutch.
#[derive(Clone, Debug, PartialEq)]
pub struct Engaged {
    epoch: u32,
    /// The end effector in `base_link` when it was engaged.
    latched: Isometry3<f64>,
    /// Newest target, in `base_link`.
    target: Isometry3<f64>,
}

impl Engaged {
    /// Engages at `present`, in `base_link`: the hand does not move.
    #[must_use]
    pub fn new(epoch: u32, present: Isometry3<f64>) -> Self {
        Self {
            epoch,
            latched: present,
            target: present,
        }
    }

    /// The press that engaged it.
    #[must_use]
    pub fn epoch(&self) -> u32 {
        self.epoch
    }

    /// The target after the controller has moved by `clutch`; `mount` is the rotation of
    /// the arm's base on the chair, `present` the pose of the hand.
    pub fn follow(
        &mut self,
        clutch: &Clutch,
        mount: &UnitQuaternion<f64>,
        present: &Isometry3<f64>,
    ) -> Isometry3<f64> {
        let [x, y, z, w] = clutch.turn;
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        let base_from_chair = mount.inverse();
        let wanted = Isometry3::from_parts(
            Translation3::from(
                self.latched.translation.vector + base_from_chair * Vector3::from(clutch.moved),
            ),
            (base_from_chair * turn * mount) * self.latched.rotation,
        );
        let step = near(&self.target, &wanted, STEP);
        self.target = near(present, &step, LEAD);
        self.target
    }
}

/// `wanted`, or the point on the way from `from` that is within `most`, m and rad.
fn near(from: &Isometry3<f64>, wanted: &Isometry3<f64>, most: [f64; 2]) -> Isometry3<f64> {
    let way = wanted.translation.vector - from.translation.vector;
    let way = way * (most[0] / way.norm().max(most[0]));
    let turn = from.rotation.rotation_to(&wanted.rotation).scaled_axis();
    let turn = turn * (most[1] / turn.norm().max(most[1]));
    Isometry3::from_parts(
        Translation3::from(from.translation.vector + way),
        UnitQuaternion::from_scaled_axis(turn) * from.rotation,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moved(x: f64) -> Clutch {
        Clutch {
            moved: [x, 0.0, 0.0],
            turn: [0.0, 0.0, 0.0, 1.0],
        }
    }

    #[test]
    fn engaging_moves_nothing_and_no_message_moves_far() {
        let mount = UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::PI);
        let hand = Isometry3::translation(-0.5, 0.0, 0.5);
        let mut engaged = Engaged::new(1, hand);
        let first = engaged.follow(&moved(0.0), &mount, &hand);
        assert!((first.translation.vector - hand.translation.vector).norm() < 1e-12);
        // 0.2 m forward of the chair is -x of the base, 25 mm at a time.
        let next = engaged.follow(&moved(0.2), &mount, &hand);
        assert!((next.translation.x + 0.525).abs() < 1e-9, "{next}");
        for _ in 0..20 {
            engaged.follow(&moved(0.2), &mount, &hand);
        }
        // The hand did not follow: the target waits.
        let lead = engaged.follow(&moved(0.2), &mount, &hand);
        assert!((lead.translation.x + 0.62).abs() < 1e-9, "{lead}");
    }

    #[test]
    fn a_turned_controller_turns_the_hand_about_the_axes_of_the_chair() {
        let mount = UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::PI);
        let hand = Isometry3::translation(-0.5, 0.0, 0.5);
        let mut engaged = Engaged::new(1, hand);
        let half = 0.04_f64;
        let clutch = Clutch {
            moved: [0.0; 3],
            turn: [half.sin(), 0.0, 0.0, half.cos()],
        };
        let target = engaged.follow(&clutch, &mount, &hand);
        let axis = mount * target.rotation.scaled_axis();
        assert!(
            (axis - Vector3::new(0.08, 0.0, 0.0)).norm() < 1e-9,
            "{axis}"
        );
    }
}
