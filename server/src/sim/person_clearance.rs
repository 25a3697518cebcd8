//! Distance of the arm to the person in the chair: for `reach`, and for the guard's
//! speed of the grasp point near the face (`person_guard`).

use nalgebra::Point3;

use super::Simulation;
use super::arm_balls::distance;
use crate::people::BodyPart;
use crate::robot::ARM_JOINTS;

/// Speed of the grasp point at the face under the guard, m/s.
const GUARD_SPEED: f64 = 0.03;
/// Additional speed per metre beyond [`GUARD_NEAR`], 1/s.
const GUARD_RATE: f64 = 0.4;
/// Metres.
const GUARD_NEAR: f64 = 0.15;

impl Simulation {
    /// The part of the person that the arm is too close to with its joints at these
    /// positions, rad; `None` when it is clear or the chair is empty.
    #[must_use]
    pub fn arm_meets(&self, arm: &[f64; ARM_JOINTS]) -> Option<&str> {
        let person = self.person.as_ref()?;
        let joints = self.snapshot.joints.iter();
        let mut positions: Vec<f64> = joints.map(|joint| joint.position).collect();
        for (&joint, &position) in self.model.roles.arm.iter().zip(arm) {
            positions[joint] = position;
        }
        self.arm_balls
            .meets(person, &self.model.link_poses(&positions))
    }

    /// Largest speed of the grasp point that the guard allows now, m/s; `None` without
    /// a person or with the guard off.
    #[must_use]
    pub fn guarded_speed(&self) -> Option<f64> {
        let requested = self.scenario.person.as_ref().filter(|person| person.guard);
        let (person, _) = self.person.as_ref().zip(requested)?;
        let head = self.snapshot.person.as_ref()?.head;
        let chair = self.snapshot.links.first()?.pose;
        let hand = self.snapshot.links.get(self.model.roles.end_effector)?.pose;
        let tip = Point3::new(0.0, 0.0, self.model.settings.tool_length);
        let tip = chair.inverse() * hand * tip;
        let head_parts = person.capsules.iter();
        let head_parts = head_parts.filter(|c| matches!(c.part, BodyPart::Head | BodyPart::Face));
        let gaps = head_parts.map(|c| distance(&tip, &person.ends(c, &head)) - c.radius);
        let gap = gaps.fold(f64::INFINITY, f64::min);
        Some(GUARD_SPEED + GUARD_RATE * (gap - GUARD_NEAR).max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::people::{HeadPose, PersonSetting};
    use crate::robot::control::{ArmIntent, ControlInput, IntentFrame};
    use crate::sim::Scenario;
    use crate::sim::tests::simulation;

    fn seated(guard: bool) -> Simulation {
        simulation(Scenario {
            task: String::new(),
            cameras: Vec::new(),
            person: Some(PersonSetting {
                body: "man_p50".to_owned(),
                posture: "hands_in_lap".to_owned(),
                motion: Some(0.0),
                guard,
                ..PersonSetting::default()
            }),
            ..Scenario::default()
        })
    }

    #[test]
    fn the_arm_is_clear_at_home_and_not_when_it_swings_inwards() {
        let sim = seated(false);
        let home = sim.model().settings.home;
        assert_eq!(sim.arm_meets(&home), None);
        let turned = |shoulder: i32, elbow: i32| {
            let mut arm = home;
            arm[0] += 0.2 * f64::from(shoulder);
            arm[2] += 0.2 * f64::from(elbow);
            arm
        };
        let all = || (-15..=15).flat_map(|i| (0..10).map(move |j| turned(i, j)));
        let met: Vec<[f64; ARM_JOINTS]> = all().filter(|q| sim.arm_meets(q).is_some()).collect();
        assert!(
            !met.is_empty(),
            "no position of shoulder and elbow is too close"
        );
        let empty = simulation(Scenario {
            task: String::new(),
            cameras: Vec::new(),
            ..Scenario::default()
        });
        assert!(all().all(|arm| empty.arm_meets(&arm).is_none()));
    }

    /// Commands 0.5 m/s towards the face: under the guard the grasp point keeps to the
    /// speed that its distance allows, measured over 0.2 s because braking takes time.
    #[test]
    fn the_guard_slows_the_arm_near_the_face() {
        // Ticks until the grasp point is within `near` of the mouth, metres.
        let ticks = |guard: bool, near: f64| {
            let mut sim = seated(guard);
            let tip = |sim: &Simulation| {
                let hand = sim.snapshot.links[sim.model.roles.end_effector].pose;
                hand * Point3::new(0.0, 0.0, sim.model.settings.tool_length)
            };
            let mut last = tip(&sim);
            let mut window = (last, None);
            for tick in 0..1200 {
                let person = sim.person.as_ref().expect("a person");
                let mouth = sim.snapshot.links[0].pose * person.mouth(&HeadPose::default());
                let way = mouth.translation.vector - last.coords;
                if way.norm() < near {
                    return tick;
                }
                let allowed = sim.guarded_speed();
                assert_eq!(allowed.is_some(), guard);
                sim.step(&ControlInput {
                    arm: Some(ArmIntent::Twist {
                        frame: IntentFrame::House,
                        linear: way.normalize() * 0.5,
                        angular: Vector3::zeros(),
                    }),
                    ..ControlInput::default()
                });
                last = tip(&sim);
                if tick % 12 == 0 {
                    let speed = (last - window.0).norm() * 5.0;
                    if let Some(allowed) = window.1 {
                        assert!(speed < 1.1 * allowed + 0.02, "{speed} of {allowed} m/s");
                    }
                    window = (last, allowed);
                }
            }
            panic!("{near} m from the mouth was never reached");
        };
        let (free, guarded) = (ticks(false, 0.25), ticks(true, 0.25));
        assert!(2 * guarded > 3 * free, "{guarded} {free}");
    }
}
