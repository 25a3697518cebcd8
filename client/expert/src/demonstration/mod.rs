//! Demonstrations: the motion of the hand around an object while it was grasped,
//! relative to the object, and around a region while it was put down, relative to the
//! region. Free motion is planned again in every scene.
//!
//! `cut` makes them of an episode, `adapt` makes grasp candidates of them. Pure.

pub mod adapt;
pub mod cut;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// Pose of the hand at a time, and the command of the gripper then.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// Seconds since the beginning of its track.
    pub time: f64,
    /// End effector in the frame of the track.
    pub frame_from_tool: Isometry3<f64>,
    /// Commanded opening at this time, metres.
    pub opening: Option<f64>,
}

/// A stretch of a demonstration.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Track {
    /// In the order of their times, the first at 0.
    pub samples: Vec<Sample>,
}

/// A recorded way to put an object down.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Putting {
    /// From above the region until the hand has left the object, in the region's frame.
    pub track: Track,
    /// When the gripper opened, seconds since the track's beginning.
    pub release: f64,
    /// The object in the end effector's frame when it was put down.
    #[serde(rename = "tool_from_thing")]
    pub tool_from_object: Isometry3<f64>,
}

/// A recorded grasp. Tracks are in the frame of the object, or of the slide, before the
/// hand came near.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Demonstration {
    /// Of which episode.
    pub source: String,
    /// The last stretch of the reach, up to where the gripper begins to close.
    pub approach: Track,
    /// The gripper closes.
    pub closing: Track,
    /// The object is raised; empty for a slide.
    pub lift: Track,
    /// How the object was put down, if it was.
    pub putting: Option<Putting>,
    /// The chair, `wheelchair_root`, in the same frame.
    #[serde(rename = "thing_from_chair")]
    pub object_from_chair: Isometry3<f64>,
    /// Widest opening of the approach, metres.
    pub opening: f64,
    /// Distance between the pads while the object was held, metres.
    pub width: f64,
}

/// Demonstrations for an operator.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Demonstrations {
    /// The demonstrations; when empty, the operator plans its own grasps.
    pub list: Vec<Demonstration>,
    /// Seed of the preference among them and of the deviation of the hand.
    pub seed: u64,
    /// Deviation of the hand from what was shown, metres along each axis; ten times as
    /// many radians about it.
    pub noise: f64,
}

/// Radians of noise for a metre of it.
const RADIANS: f64 = 10.0;
/// The noise changes within this time, seconds.
const KNOT: f64 = 0.5;
/// At the closing of the fingers the deviation is at most this share of their clearance
/// around the object: a smooth bottle that is grasped askew slips.
const OF_ROOM: f64 = 1.0 / 16.0;
/// It becomes so within this time, seconds.
const FADE: f64 = 1.0;
/// Of two demonstrations the next one in the order of liking costs this much more.
const LIKING: f64 = 0.3;

impl Demonstrations {
    /// Additional cost of each demonstration, from a random order of preference, so
    /// that episodes with different seeds use all of them.
    #[must_use]
    pub fn costs(&self) -> Vec<f64> {
        let mut order: Vec<usize> = (0..self.list.len()).collect();
        order.shuffle(&mut ChaCha8Rng::seed_from_u64(self.seed));
        let mut costs = vec![0.0; order.len()];
        for (rank, index) in order.into_iter().enumerate() {
            costs[index] = LIKING * rank as f64;
        }
        costs
    }

    /// Deviation of the hand during `seconds`, in its own frame, on its way to an
    /// object around which its open fingers leave `room`, metres.
    #[must_use]
    pub fn wander(&self, seconds: f64, room: f64) -> Wander {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ 0x6f66_6620_6279);
        // Nearly normal: the sum of twelve uniform samples.
        let mut normal = || (0..12).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>();
        let knots = (seconds.max(0.0) / KNOT).ceil() as usize + 1;
        let mut sample = |scale: f64| Vector3::from_fn(|_, _| normal() * scale);
        let least = self.noise.min(OF_ROOM * room.max(0.0));
        let deviation = |knot: usize| {
            // The last two knots have the end between them.
            let left = (seconds - KNOT * (knot + 1) as f64) / FADE;
            least + (self.noise - least) * left.clamp(0.0, 1.0)
        };
        Wander {
            knots: (0..knots)
                .map(|knot| [sample(deviation(knot)), sample(RADIANS * deviation(knot))])
                .collect(),
        }
    }
}

/// Deviation of the hand over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wander {
    knots: Vec<[Vector3<f64>; 2]>,
}

impl Wander {
    /// A constant deviation.
    #[must_use]
    pub fn still(offset: [Vector3<f64>; 2]) -> Self {
        Self {
            knots: vec![offset],
        }
    }

    /// Translation, metres, and rotation vector, radians, at a time.
    #[must_use]
    pub fn offset(&self, time: f64) -> [Vector3<f64>; 2] {
        let Some(last) = self.knots.last() else {
            return [Vector3::zeros(); 2];
        };
        let at = (time / KNOT).max(0.0);
        let index = at as usize;
        match (self.knots.get(index), self.knots.get(index + 1)) {
            (Some(a), Some(b)) => [0, 1].map(|i| a[i].lerp(&b[i], at - index as f64)),
            _ => *last,
        }
    }

    /// The same as a pose in the end effector's frame.
    #[must_use]
    pub fn at(&self, time: f64) -> Isometry3<f64> {
        let [by, turn] = self.offset(time);
        Isometry3::from_parts(
            Translation3::from(by),
            UnitQuaternion::from_scaled_axis(turn),
        )
    }
}

impl Track {
    /// Seconds from start to end.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.samples.last().map_or(0.0, |sample| sample.time)
    }

    /// Whether there is nothing of it.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// First and last pose.
    #[must_use]
    pub fn ends(&self) -> Option<[Isometry3<f64>; 2]> {
        let (first, last) = (self.samples.first()?, self.samples.last()?);
        Some([first.frame_from_tool, last.frame_from_tool])
    }

    /// Pose of the hand `time` seconds after the start.
    #[must_use]
    pub fn at(&self, time: f64) -> Option<Isometry3<f64>> {
        let after = self.samples.partition_point(|sample| sample.time <= time);
        let before = self.samples.get(after.max(1) - 1)?;
        let Some(next) = self.samples.get(after).filter(|_| after > 0) else {
            return Some(before.frame_from_tool);
        };
        let share = (time - before.time) / (next.time - before.time).max(1e-9);
        let (a, b) = (&before.frame_from_tool, &next.frame_from_tool);
        Some(a.lerp_slerp(b, share.clamp(0.0, 1.0)))
    }

    /// Last commanded opening after `from` and not after `to` (seconds), metres.
    #[must_use]
    pub fn opening_between(&self, from: f64, to: f64) -> Option<f64> {
        let among = self.samples.iter();
        among
            .filter(|sample| from < sample.time && sample.time <= to)
            .filter_map(|sample| sample.opening)
            .next_back()
    }

    /// Poses along it, about `spacing` metres from each other, with both ends, in the
    /// world of a frame at `world_from_frame`.
    #[must_use]
    pub fn stops(&self, world_from_frame: &Isometry3<f64>, spacing: f64) -> Vec<Isometry3<f64>> {
        let mut stops: Vec<Isometry3<f64>> = Vec::new();
        let Some(last) = self.samples.last() else {
            return stops;
        };
        for sample in &self.samples {
            let pose = &sample.frame_from_tool;
            let is_next = stops.last().is_none_or(|before| {
                let way = (pose.translation.vector - before.translation.vector).norm();
                way.max(0.3 * pose.rotation.angle_to(&before.rotation)) >= spacing
            });
            if is_next {
                stops.push(*pose);
            }
        }
        if stops.last() != Some(&last.frame_from_tool) {
            stops.push(last.frame_from_tool);
        }
        stops.iter().map(|pose| world_from_frame * pose).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line() -> Track {
        let sample = |i: u32| Sample {
            time: f64::from(i) * 0.1,
            frame_from_tool: Isometry3::translation(0.0, 0.0, f64::from(i) * 0.01),
            opening: (i == 3).then_some(0.05),
        };
        Track {
            samples: (0..=10).map(sample).collect(),
        }
    }

    #[test]
    fn track_is_interpolated_between_samples_and_held_at_its_ends() {
        let track = line();
        let z = |time| track.at(time).unwrap().translation.z;
        assert!((z(0.25) - 0.025).abs() < 1e-12);
        assert!((z(-1.0), z(9.0)) == (0.0, 0.1));
        assert_eq!(track.opening_between(0.0, 0.25), None);
        assert_eq!(track.opening_between(0.25, 0.31), Some(0.05));
        assert_eq!(track.opening_between(0.31, 9.0), None);
    }

    #[test]
    fn track_in_a_moved_frame_keeps_its_poses_relative_to_the_frame() {
        let track = line();
        let frame = Isometry3::new(Vector3::new(1.0, -2.0, 0.8), Vector3::new(0.0, 0.0, 2.1));
        let stops = track.stops(&frame, 0.03);
        assert_eq!(stops.len(), 5);
        for (stop, z) in stops.iter().zip([0.0, 0.03, 0.06, 0.09, 0.1]) {
            let back = frame.inv_mul(stop);
            let off = back.translation.vector - Vector3::new(0.0, 0.0, z);
            assert!(off.norm() < 1e-9, "{off}");
            assert!(back.rotation.angle() < 1e-9);
        }
    }

    #[test]
    fn noise_is_small_smooth_and_the_same_for_a_seed() {
        let shown = |seed| Demonstrations {
            list: Vec::new(),
            seed,
            noise: 0.002,
        };
        let wander = shown(5).wander(3.0, 0.05);
        assert_eq!(wander, shown(5).wander(3.0, 0.05));
        assert_ne!(wander, shown(6).wander(3.0, 0.05));
        let mut before = wander.at(0.0);
        for i in 0..180 {
            let now = wander.at(f64::from(i) / 60.0);
            assert!(now.translation.vector.norm() < 0.02);
            let step = (now.translation.vector - before.translation.vector).norm();
            assert!(step < 0.001, "{step}");
            before = now;
        }
        let still = Demonstrations::default().wander(1.0, 0.05);
        assert_eq!(still.at(0.3), Isometry3::identity());
    }

    #[test]
    fn fingers_with_little_clearance_close_at_the_demonstrated_pose() {
        let off = |room: f64, time: f64| {
            let squares = (0..400).map(|seed| {
                let shown = Demonstrations {
                    list: Vec::new(),
                    seed,
                    noise: 0.002,
                };
                shown.wander(3.2, room).offset(time)[0].norm_squared()
            });
            (squares.sum::<f64>() / 1200.0).sqrt()
        };
        assert!((0.0018..0.0022).contains(&off(0.011, 1.0)));
        assert!(off(0.011, 3.2) < 0.0007);
        assert!(off(0.05, 3.2) > 0.0012);
    }
}
