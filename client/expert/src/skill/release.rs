//! Release: opens the gripper, moves the hand back, and stows the arm before another
//! attempt.

use nalgebra::Translation3;
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
    motion: Option<Motion>,
}

impl Release {
    /// After a miss: back home, to look again.
    #[must_use]
    pub fn after_miss() -> Self {
        Self {
            go_home: true,
            begun: None,
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

impl Skill for Release {
    fn step(&mut self, now: &mut Now<'_>) -> Step {
        let phase = if self.go_home {
            Phase::Grasping
        } else {
            Phase::Retracting
        };
        let begun = *self.begun.get_or_insert(now.observation.time);
        now.memory.held = None;
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
        if waited < 0.3 || (!now.scene.hand.is_open(now.observation.knuckle) && waited < LONGEST) {
            return Step::Going(Act {
                base: Some([0.0, 0.0]),
                opening: (waited < 0.05).then_some(now.scene.hand.stroke),
                ..Act::named(phase, "opening")
            });
        }
        // Straight back first, so that the fingers leave the object.
        let start = now.house_from_desired();
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
        let mut stops = vec![(retreat(by), now.profile.approach_speed)];
        if let (true, Some(home)) = (self.go_home, now.memory.home) {
            let home = now.scene.house_from_base(now.observation) * home;
            stops.push((home, now.profile.free_speed));
        }
        self.motion = Some(Motion::new(now, &stops));
        Step::Going(Act::named(Phase::Retracting, "retreating"))
    }
}
