//! Plays a stretch of a demonstration in place of a planned movement: at its
//! demonstrated speed and with its gripper commands.

use nalgebra::Isometry3;

use super::Now;
use crate::demonstration::{Track, Wander};
use crate::tool_path::distance;

/// The hand counts as arrived within this, metres and radians.
const ARRIVED: [f64; 2] = [0.008, 0.04];
/// Extra time for the hand to arrive, seconds.
const ARRIVAL_TIME: f64 = 2.5;
/// Time from rest to full speed, seconds.
const RAMP: f64 = 0.3;

/// A stretch under way.
#[derive(Clone, Debug, PartialEq)]
pub struct Play {
    track: Track,
    base_from_frame: Isometry3<f64>,
    /// After the poses of the track.
    after: Isometry3<f64>,
    wander: Wander,
    begun: f64,
    /// Time of the track up to which gripper commands were sent, seconds.
    commanded_until: f64,
}

/// State of the playback.
#[derive(Clone, Debug, PartialEq)]
pub enum Played {
    /// Under way, with the target of this tick in `base_link` and the opening of the
    /// gripper, metres, if it changes.
    Moving(Option<Isometry3<f64>>, Option<f64>),
    /// There.
    Arrived,
    /// The time is over and the hand is not there: how far off it is, metres.
    Late(f64),
}

impl Play {
    /// Begins, with the frame of the track at `house_from_frame`.
    #[must_use]
    pub fn new(now: &Now<'_>, track: &Track, house_from_frame: &Isometry3<f64>) -> Self {
        Self {
            track: track.clone(),
            base_from_frame: now
                .scene
                .house_from_base(now.observation)
                .inv_mul(house_from_frame),
            after: Isometry3::identity(),
            wander: Wander::default(),
            begun: now.observation.time,
            commanded_until: -1.0,
        }
    }

    /// With something after its poses, in the end effector's frame.
    #[must_use]
    pub fn after(mut self, after: Isometry3<f64>) -> Self {
        self.after = after;
        self
    }

    /// With the hand off by this.
    #[must_use]
    pub fn off(mut self, wander: Wander) -> Self {
        self.wander = wander;
        self
    }

    /// Deviation of the hand at its end.
    #[must_use]
    pub fn off_at_end(&self) -> Wander {
        Wander::still(self.wander.offset(self.track.duration()))
    }

    /// Seconds of the track.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.track.duration()
    }

    /// Seconds of the track that have passed.
    #[must_use]
    pub fn time(&self, now: &Now<'_>) -> f64 {
        let passed = now.observation.time - self.begun;
        match passed < RAMP {
            true => passed * passed / (2.0 * RAMP),
            false => passed - RAMP / 2.0,
        }
    }

    fn at(&self, time: f64) -> Option<Isometry3<f64>> {
        let pose = self.track.at(time)?;
        Some(self.base_from_frame * pose * self.after * self.wander.at(time))
    }

    /// Moves on.
    pub fn step(&mut self, now: &Now<'_>) -> Played {
        let (time, duration) = (self.time(now), self.track.duration());
        let Some(end) = self.at(duration) else {
            return Played::Arrived;
        };
        let opening = self.track.opening_between(self.commanded_until, time);
        self.commanded_until = time;
        if time >= duration && opening.is_none() {
            let tool = &now.observation.base_from_tool;
            let off = distance(tool, &end);
            if off < ARRIVED[0] && tool.rotation.angle_to(&end.rotation) < ARRIVED[1] {
                return Played::Arrived;
            }
            if time > duration + ARRIVAL_TIME {
                return Played::Late(off);
            }
        }
        // The target of this tick takes effect during the next one.
        Played::Moving(self.at(time + 1.0 / 60.0), opening)
    }
}
