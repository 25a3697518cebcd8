//! Release: opens the gripper, moves the hand back, and stows the arm before another
//! attempt.

use nalgebra::{Isometry3, Point3, Translation3};
use wheelarm_proto::furniture::JointMotion;
use wheelarm_proto::v1::Phase;

use super::motion::{Motion, Progress};
use super::{Act, Now, Skill, Step};

/// Longest time for the fingers to open, seconds.
const LONGEST: f64 = 3.0;
/// Retreats of a hand that stays near, metres: the first reachable one is used.
const RETREAT: [f64; 4] = [0.08, 0.05, 0.03, 0.015];

/// See the module.
#[derive(Clone, Debug)]
pub struct Release {
    go_home: bool,
    begun: Option<f64>,
    /// Of furniture that turns: the handle in its own frame, and where the hand opened,
    /// in `base_link`.
    turned: Option<(Point3<f64>, Isometry3<f64>)>,
    motion: Option<Motion>,
}

impl Release {
    /// After a miss: back home, to look again.
    #[must_use]
    pub fn after_miss() -> Self {
        Self {
            go_home: true,
            begun: None,
            turned: None,
            motion: None,
        }
    }

    /// When the work is done: just away from the handle.
    #[must_use]
    pub fn let_go() -> Self {
        Self {
            go_home: false,
            ..Self::after_miss()
        }
    }
}

/// The point between the pads in the frame of the goal's furniture, when that turns.
fn turning_handle(now: &Now<'_>, held: &Isometry3<f64>) -> Option<Point3<f64>> {
    let slide = now.scene.slides.get(now.goal.slide()?)?;
    let grip = Point3::new(0.0, 0.0, now.scene.tool_length);
    (slide.motion == JointMotion::Turns).then(|| held.inverse_transform_point(&grip))
}

impl Skill for Release {
    fn step(&mut self, now: &mut Now<'_>) -> Step {
        let phase = if self.go_home {
            Phase::Grasping
        } else {
            Phase::Retracting
        };
        let begun = *self.begun.get_or_insert(now.observation.time);
        if let Some(held) = now.memory.held.take() {
            let handle = turning_handle(now, &held);
            self.turned = handle.map(|handle| (handle, now.observation.base_from_tool));
        }
        if let Some(motion) = &self.motion {
            return match motion.step(now) {
                Progress::Moving(tool) => Step::Going(Act {
                    tool,
                    ..Act::named(Phase::Retracting, "retreating")
                }),
                Progress::Late(why) => {
                    now.note(format!("retreating: {why}"));
                    Step::Done
                }
                Progress::Arrived => Step::Done,
            };
        }
        let waited = now.observation.time - begun;
        let pushes = now.memory.candidate.is_some_and(|one| one.push.is_some());
        if !pushes
            && (waited < 0.3
                || (!now.scene.hand.is_open(now.observation.knuckle) && waited < LONGEST))
        {
            return Step::Going(Act {
                base: Some([0.0, 0.0]),
                opening: (waited < 0.05).then_some(now.scene.hand.stroke),
                // A hand that was pressed aside would spring back and drag the door.
                tool: self.turned.map(|(_, tool)| tool),
                ..Act::named(phase, "opening")
            });
        }
        // Straight back first, so that the fingers leave the object.
        let mut start = now.house_from_desired();
        let mut stops = Vec::new();
        if let Some((handle, tool)) = self.turned {
            // A finger beside its middle would catch the bar of a door.
            let aside = (now.object_in_hand() * handle).x;
            start = now.scene.house_from_base(now.observation) * tool;
            start *= Translation3::new(aside, 0.0, 0.0);
            stops.push((start, now.profile.approach_speed));
        }
        let retreat = |by: f64| start * Translation3::new(0.0, 0.0, -by);
        let by = if self.go_home {
            now.profile.grasp.standoff
        } else {
            let reached = RETREAT.into_iter().find(|by| now.reaches(&[retreat(*by)]));
            match reached {
                Some(by) => by,
                // Folded up as it is, it stays where it is.
                None => return Step::Done,
            }
        };
        stops.push((retreat(by), now.profile.approach_speed));
        if let (true, Some(home)) = (self.go_home, now.memory.home) {
            let home = now.scene.house_from_base(now.observation) * home;
            stops.push((home, now.profile.free_speed));
        }
        self.motion = Some(Motion::new(now, &stops));
        Step::Going(Act::named(Phase::Retracting, "retreating"))
    }
}
