//! Motion of head and jaw: a track that depends only on a seed and the tick, so that it
//! is not part of any state.

use wheelarm_proto::PHYSICS_HZ;

use super::random::uniform;

/// Rotation of head and jaw relative to the posture, rad.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct HeadPose {
    /// To the left.
    pub yaw: f64,
    /// Down.
    pub pitch: f64,
    /// To the right.
    pub roll: f64,
    /// The jaw down.
    pub jaw: f64,
}

/// Range of the motion relative to a posture, rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadLimits {
    /// To either side.
    pub yaw: f64,
    /// Up.
    pub up: f64,
    /// Down.
    pub down: f64,
    /// To either side.
    pub roll: f64,
    /// The jaw down.
    pub jaw: f64,
}

/// The motion of one person.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Seed of the motion.
    pub seed: u64,
    /// 0 is motionless, 1 like a waiting person.
    pub strength: f64,
    /// The mouth stays open, as if waiting for a sip.
    pub mouth_open: bool,
    /// Range.
    pub limits: HeadLimits,
}

/// Ticks between two target orientations of the head. [choice: 1.5 s]
const AIM: u64 = PHYSICS_HZ * 3 / 2;
/// Share of the interval that is motion; the rest is a pause. [choice]
const TURN: f64 = 0.5;
/// Share of the range used at strength 1: yaw, pitch, roll. [choice]
const USED: [f64; 3] = [0.4, 0.3, 0.3];
/// Length of windows with possible speech, and half of a syllable, ticks. [choice: 6 s,
/// 0.2 s]
const TALK: u64 = PHYSICS_HZ * 6;
const SYLLABLE: u64 = PHYSICS_HZ / 5;
/// Share of windows with speech; largest opening of the jaw then.
const TALK_SHARE: f64 = 0.3;
const TALK_JAW: f64 = 0.4;
/// Opening of a waiting mouth, and the time to open it, ticks.
const WAITING_JAW: f64 = 0.8;
const OPENING: f64 = PHYSICS_HZ as f64;

/// From 0 to 1 with zero speed at both ends.
fn smooth(part: f64) -> f64 {
    let part = part.clamp(0.0, 1.0);
    part * part * (3.0 - 2.0 * part)
}

impl Motion {
    /// Orientation of head and jaw at a physics tick; straight and shut at tick 0.
    #[must_use]
    pub fn head_pose(&self, tick: u64) -> HeadPose {
        let l = &self.limits;
        let pitch = self.turn(2, tick) * USED[1];
        HeadPose {
            yaw: self.turn(1, tick) * USED[0] * l.yaw,
            pitch: pitch * if pitch < 0.0 { l.up } else { l.down },
            roll: self.turn(3, tick) * USED[2] * l.roll,
            jaw: l.jaw * self.jaw(tick),
        }
    }

    /// -1 to 1 times the strength.
    fn turn(&self, row: u64, tick: u64) -> f64 {
        let aim = |place: u64| match place {
            0 => 0.0,
            _ => 2.0 * uniform(self.seed, row, place) - 1.0,
        };
        let (place, part) = (tick / AIM, (tick % AIM) as f64 / AIM as f64);
        let (from, to) = (aim(place), aim(place + 1));
        self.strength * (from + (to - from) * smooth(part / TURN))
    }

    /// Share of the jaw's range.
    fn jaw(&self, tick: u64) -> f64 {
        if self.mouth_open {
            return WAITING_JAW * smooth(tick as f64 / OPENING);
        }
        let window = tick / TALK;
        let talks = window > 0 && uniform(self.seed, 4, window) < TALK_SHARE;
        if !talks || self.strength == 0.0 {
            return 0.0;
        }
        // Shut at the ends of every syllable, and therefore of the window.
        let (syllable, within) = (tick / SYLLABLE, tick % SYLLABLE);
        let part = within as f64 / SYLLABLE as f64;
        let open = smooth(1.0 - (2.0 * part - 1.0).abs());
        TALK_JAW * self.strength * uniform(self.seed, 5, syllable) * open
    }
}
