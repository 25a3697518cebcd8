//! Cuts the stretches around an object out of an episode, by signals alone: pad forces,
//! knuckle angle and pose of the object. Any driver may have recorded the episode.

use nalgebra::Isometry3;

use super::{Demonstration, Putting, Sample, Track};
use crate::goal::Goal;
use crate::observation::Observation;
use crate::scene::SceneModel;
use crate::tool_path::distance;

/// The approach begins this far from the grasp, metres, but not longer before it than
/// so many seconds.
const NEAR: f64 = 0.15;
const LONGEST: f64 = 15.0;
/// A pad presses from this force, N.
const PRESSES: f64 = 1.0;
/// Shorter losses of a grip are none, seconds.
const GAP: f64 = 0.25;
/// An object counts as grasped when it moves by this much at least, metres.
const MOVED: f64 = 0.02;
/// The knuckle closes or opens faster than this, rad/s, over this time, seconds.
const KNUCKLE: [f64; 2] = [0.1, 0.1];
/// It sets out when it moves by this much in a tick, radians; the same in metres is
/// enough of a command.
const SETS_OUT: f64 = 1e-3;
/// It has stalled when it moves less in this time, radians and seconds.
const STALLED: [f64; 2] = [0.008, 0.25];
/// The lift ends at this height, metres; the second one when the object is put into a
/// region.
const UP: f64 = 0.15;
const UP_TO_PUT: f64 = 0.06;
/// The chair rests below these, m/s and rad/s.
const RESTS: [f64; 2] = [0.02, 0.03];
/// After the release the hand moves back by this much, metres.
const BACK: f64 = 0.07;
/// Rests longer than this are shortened to it, seconds.
const REST: f64 = 0.4;
/// The hand rests while it moves less than this in a tick, metres and radians.
const STILL: [f64; 2] = [2e-4, 1e-3];

/// One recorded episode, tick by tick.
pub struct Course<'a> {
    /// Of which episode.
    pub source: &'a str,
    /// Scene of the episode.
    pub scene: &'a SceneModel,
    /// Goal of the task.
    pub goal: &'a Goal,
    /// Observation at each tick.
    pub observations: &'a [Observation],
    /// Commanded opening at each tick, metres; `None` without a command.
    pub commanded: &'a [Option<f64>],
    /// Distance between the pads, metres.
    pub opening: &'a [f64],
}

/// Cuts the stretches around the goal's object out of `course`.
///
/// # Errors
/// In words, what is not to be found in it.
pub fn cut(course: &Course<'_>) -> Result<Demonstration, String> {
    let rows = Rows::of(course);
    let [touch, end] = rows.grip().ok_or("nothing is taken and moved in it")?;
    let begin = rows.closing_begins(touch);
    let first = rows.near_since(begin);
    if begin < first + 2 {
        return Err("the hand does not come near and close".to_owned());
    }
    let closed = rows.has_closed(touch, end);
    let slides = course.goal.slide().is_some();
    let release = course.goal.region().map(|_| rows.opening_begins(end));
    let raised = match slides {
        true => closed,
        false => rows.has_raised(closed, release.unwrap_or(end)),
    };
    let frame_from_house = rows.object[first].inverse();
    let putting = match (course.goal.region(), release) {
        (Some(region), Some(release)) => rows.putting(&region.pose, raised, release),
        _ => None,
    };
    let approach = rows.track(&frame_from_house, first, begin);
    let openings = &course.opening[first..=begin];
    Ok(Demonstration {
        source: course.source.to_owned(),
        approach: without_rests(approach),
        closing: rows.track(&frame_from_house, begin, closed),
        lift: match slides {
            true => Track::default(),
            false => without_rests(rows.track(&frame_from_house, closed, raised)),
        },
        putting,
        object_from_chair: frame_from_house * course.observations[begin].house_from_chair,
        opening: openings.iter().copied().fold(0.0, f64::max),
        width: course.opening[closed],
    })
}

struct Rows<'a> {
    course: &'a Course<'a>,
    time: Vec<f64>,
    tool: Vec<Isometry3<f64>>,
    object: Vec<Isometry3<f64>>,
    knuckle: Vec<f64>,
}

impl<'a> Rows<'a> {
    fn of(course: &'a Course<'a>) -> Self {
        let item = course.goal.item();
        let (scene, observations) = (course.scene, course.observations);
        let object = |observation: &Observation| {
            let poses = scene.poses(observation);
            poses.get(item).copied().unwrap_or_default()
        };
        Self {
            course,
            time: observations
                .iter()
                .map(|observation| observation.time)
                .collect(),
            tool: observations
                .iter()
                .map(|s| scene.house_from_tool(s))
                .collect(),
            object: observations.iter().map(object).collect(),
            knuckle: observations
                .iter()
                .map(|observation| observation.knuckle)
                .collect(),
        }
    }

    /// First and last row of the grip in which the object moves furthest; of equal
    /// grips the last.
    fn grip(&self) -> Option<[usize; 2]> {
        let mut grips: Vec<[usize; 2]> = Vec::new();
        for (i, observation) in self.course.observations.iter().enumerate() {
            if !observation.pad_force.iter().all(|force| *force > PRESSES) {
                continue;
            }
            match grips.last_mut() {
                Some([_, last]) if self.time[i] - self.time[*last] < GAP => *last = i,
                _ => grips.push([i, i]),
            }
        }
        let moved = |[a, b]: &[usize; 2]| {
            let way = (*a..=*b).map(|i| distance(&self.object[*a], &self.object[i]));
            way.fold(0.0, f64::max)
        };
        let all = grips.into_iter().filter(|grip| moved(grip) > MOVED);
        all.max_by(|a, b| moved(a).total_cmp(&moved(b)))
    }

    /// Whether the knuckle moves with `sign` before row `i`, 1 closes.
    fn turns(&self, i: usize, sign: f64) -> bool {
        let from = self.back(i, KNUCKLE[1]);
        let seconds = self.time[i] - self.time[from];
        seconds > 0.0 && sign * (self.knuckle[i] - self.knuckle[from]) / seconds > KNUCKLE[0]
    }

    /// The row so many seconds before another.
    fn back(&self, i: usize, seconds: f64) -> usize {
        self.time.partition_point(|t| *t < self.time[i] - seconds)
    }

    /// Row in which the closing begins that ends in a touch.
    fn closing_begins(&self, touch: usize) -> usize {
        self.stroke_begins(touch, 1.0)
    }

    /// Row in which the opening begins that releases the object held until row `end`.
    fn opening_begins(&self, end: usize) -> usize {
        let last = self.time.len() - 1;
        let after = self.time.partition_point(|t| *t < self.time[end] + 0.5);
        self.stroke_begins(after.min(last), -1.0).min(end)
    }

    fn stroke_begins(&self, from: usize, sign: f64) -> usize {
        let mut begin = from;
        let mut i = from;
        while i > 0 && self.time[begin] - self.time[i] < 2.0 * GAP {
            if self.turns(i, sign) {
                begin = self.back(i, KNUCKLE[1]);
            }
            i -= 1;
        }
        // It was looked at over a while.
        while begin < from && sign * (self.knuckle[begin + 1] - self.knuckle[begin]) < SETS_OUT {
            begin += 1;
        }
        // The command that did it is a little older.
        let course = self.course;
        let asks = |&i: &usize| {
            course.commanded[i].is_some_and(|target| sign * (course.opening[i] - target) > SETS_OUT)
        };
        let command = (self.back(begin, 2.0 * KNUCKLE[1])..=begin).find(asks);
        command.unwrap_or(begin)
    }

    /// Row in which the hand is first near its pose at row `begin`, with the chair at
    /// rest.
    fn near_since(&self, begin: usize) -> usize {
        let mut first = begin;
        while first > 0 {
            let before = first - 1;
            let near = distance(&self.tool[before], &self.tool[begin]) < NEAR
                && self.time[begin] - self.time[before] < LONGEST
                && self.rests(before);
            if !near {
                break;
            }
            first = before;
        }
        first
    }

    fn rests(&self, i: usize) -> bool {
        let [speed, rate] = self.course.observations[i].chair_speed;
        speed.abs() < RESTS[0] && rate.abs() < RESTS[1]
    }

    /// Row in which the fingers have closed after a touch, or in which the object
    /// already moves.
    fn has_closed(&self, touch: usize, end: usize) -> usize {
        let stalls = |&i: &usize| {
            let later = self
                .time
                .partition_point(|t| *t < self.time[i] + STALLED[1]);
            let later = later.min(self.time.len() - 1);
            (self.knuckle[later] - self.knuckle[i]).abs() < STALLED[0]
                || distance(&self.object[i], &self.object[touch]) > 0.3 * MOVED
        };
        (touch..end).find(stalls).unwrap_or(end)
    }

    /// Row in which the lift ends.
    fn has_raised(&self, closed: usize, end: usize) -> usize {
        let rise = |i: usize| self.object[i].translation.z - self.object[closed].translation.z;
        let most = (closed..=end).map(rise).fold(0.0, f64::max);
        let wanted = match self.course.goal.region() {
            Some(_) => UP_TO_PUT,
            None => UP,
        };
        let wanted = wanted.min(0.97 * most);
        let over = |&i: &usize| rise(i) >= wanted || !self.rests(i);
        (closed..end).find(over).unwrap_or(end)
    }

    /// How the object is put down that is released at row `release`.
    fn putting(
        &self,
        house_from_region: &Isometry3<f64>,
        raised: usize,
        release: usize,
    ) -> Option<Putting> {
        let mut first = release;
        while first > raised {
            let before = first - 1;
            if distance(&self.tool[before], &self.tool[release]) > NEAR || !self.rests(before) {
                break;
            }
            first = before;
        }
        let away = |&i: &usize| distance(&self.tool[i], &self.tool[release]) > BACK;
        let last = (release..self.time.len()).find(away);
        let last = last.unwrap_or(self.time.len() - 1);
        let frame_from_house = house_from_region.inverse();
        let before = without_rests(self.track(&frame_from_house, first, release));
        let after = self.track(&frame_from_house, release, last);
        let begin = before.duration();
        let moved = after.samples.into_iter().skip(1).map(|sample| Sample {
            time: sample.time + begin,
            ..sample
        });
        // The command at the release itself belongs to what follows.
        let mut samples = before.samples;
        samples.last_mut()?.opening = self.course.commanded[release];
        samples.extend(moved);
        (last > release + 1).then(|| Putting {
            track: Track { samples },
            release: begin,
            tool_from_object: self.tool[first].inv_mul(&self.object[first]),
        })
    }

    fn track(&self, frame_from_house: &Isometry3<f64>, first: usize, last: usize) -> Track {
        let sample = |i: usize| Sample {
            time: self.time[i] - self.time[first],
            frame_from_tool: frame_from_house * self.tool[i],
            opening: self.course.commanded[i],
        };
        Track {
            samples: (first..=last).map(sample).collect(),
        }
    }
}

/// The same track with long rests shortened: the demonstrator looked or thought.
fn without_rests(track: Track) -> Track {
    let mut out: Vec<Sample> = Vec::new();
    let (mut rested, mut left_out) = (0.0, 0.0);
    let mut before: Option<Sample> = None;
    for sample in track.samples {
        if let Some(before) = before {
            let (a, b) = (&before.frame_from_tool, &sample.frame_from_tool);
            let still = distance(a, b) < STILL[0] && a.rotation.angle_to(&b.rotation) < STILL[1];
            let step = sample.time - before.time;
            rested = match still && sample.opening.is_none() {
                true => rested + step,
                false => 0.0,
            };
            if rested > REST {
                left_out += step;
                // The next sample follows the last one kept.
                if let Some(last) = out.last_mut() {
                    last.frame_from_tool = sample.frame_from_tool;
                }
            } else {
                out.push(Sample {
                    time: sample.time - left_out,
                    ..sample
                });
            }
        } else {
            out.push(sample);
        }
        before = Some(sample);
    }
    Track { samples: out }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand;
    use crate::scene::{Item, SceneModel};
    use nalgebra::{Translation3, UnitQuaternion, Vector3};
    use wheelarm_planning::obb::Obb;

    const DT: f64 = 1.0 / 60.0;

    fn scene() -> SceneModel {
        SceneModel {
            furniture: Vec::new(),
            items: vec![Item {
                name: "can".to_owned(),
                boxes: vec![Obb {
                    pose: Isometry3::identity(),
                    half: Vector3::new(0.03, 0.03, 0.05),
                    round: false,
                }],
            }],
            slides: Vec::new(),
            grasps: Vec::new(),
            chair_from_base: Isometry3::translation(0.4, 0.0, 0.5),
            tool_length: 0.12,
            footprint: [0.0; 4],
            outlines: Vec::new(),
            travel: None,
            arm_range: [0.42, 0.88],
            hand: hand::tests::hand(),
            home: [0.0; 6],
            person: None,
        }
    }

    /// Drives for 1 s, rests for 1 s, moves 0.4 m to the can in 4 s, closes in 0.6 s,
    /// raises it by 0.3 m in 3 s.
    fn episode(goal: &Goal, yaw: f64) -> (Vec<Observation>, Vec<Option<f64>>, Vec<f64>) {
        let can = Isometry3::from_parts(
            Translation3::new(2.0, 1.0, 0.9),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw),
        );
        // The hand approaches along the can's x.
        let can_from_tool =
            UnitQuaternion::from_basis_unchecked(&[Vector3::y(), Vector3::z(), Vector3::x()]);
        let scene = scene();
        let chair = Isometry3::translation(1.0, 1.0, 0.0);
        let put = goal.region().is_some();
        let mut out = (Vec::new(), Vec::new(), Vec::new());
        let steps = if put { 780 } else { 576 };
        for i in 0..steps {
            let t = f64::from(i) * DT;
            let way = (0.4 * (1.0 - (t - 2.0) / 4.0)).clamp(0.0, 0.4);
            let rise = (0.1 * (t - 6.6)).clamp(0.0, 0.3) - (0.1 * (t - 9.6)).clamp(0.0, 0.3);
            let closed = ((t - 6.0) / 0.6).clamp(0.0, 1.0);
            let held = (6.6..12.6).contains(&t);
            let opening = if t < 12.6 { 0.08 - 0.02 * closed } else { 0.08 };
            let back = 0.3 * (t - 12.7).clamp(0.0, 0.3);
            let tool = Translation3::new(0.0, 0.0, rise)
                * can
                * Translation3::new(-0.12 - way - back, 0.0, 0.0)
                * can_from_tool;
            out.0.push(Observation {
                time: t,
                house_from_chair: chair,
                chair_speed: [if t < 1.0 { 0.3 } else { 0.0 }, 0.0],
                base_from_tool: (chair * scene.chair_from_base).inv_mul(&tool),
                arm: [0.0; 6],
                base_from_desired: None,
                arm_problem: String::new(),
                knuckle: 0.8 * (1.0 - opening / 0.085),
                pad_force: if held { [20.0; 2] } else { [0.0; 2] },
                objects: vec![Translation3::new(0.0, 0.0, rise) * can],
                mouth: None,
                lap_force: 0.0,
                person_force: 0.0,
                slides: Vec::new(),
                success: false,
                done: false,
                failure: String::new(),
            });
            out.1.push(match i {
                360 => Some(0.0),
                756 => Some(0.08),
                _ => None,
            });
            out.2.push(opening);
        }
        out
    }

    fn shown(goal: &Goal, yaw: f64) -> Demonstration {
        let (observations, commanded, opening) = episode(goal, yaw);
        let course = Course {
            source: "one",
            scene: &scene(),
            goal,
            observations: &observations,
            commanded: &commanded,
            opening: &opening,
        };
        cut(&course).unwrap()
    }

    #[test]
    fn episode_is_cut_into_approach_closing_and_lift() {
        let shown = shown(&Goal::Lift { item: 0 }, 0.7);
        let [first, grasp] = shown.approach.ends().unwrap();
        assert!((distance(&first, &grasp) - NEAR).abs() < 0.005);
        // To the can, wherever that stood and however it was turned.
        let at = grasp.translation.vector - Vector3::new(-0.12, 0.0, 0.0);
        assert!(at.norm() < 0.001, "{at}");
        assert!(
            (shown.approach.duration() - 1.5).abs() < 0.05,
            "at its own speed"
        );
        assert!((0.5..1.0).contains(&shown.closing.duration()));
        assert_eq!(shown.closing.samples[0].opening, Some(0.0));
        let [low, high] = shown.lift.ends().unwrap();
        assert!((high.translation.z - low.translation.z - UP).abs() < 0.01);
        assert!((shown.width - 0.06).abs() < 0.002);
        assert_eq!(shown.putting, None);
    }

    #[test]
    fn same_motion_relative_to_an_object_is_the_same_demonstration_at_any_pose() {
        let [a, b] = [0.0, 2.5].map(|yaw| shown(&Goal::Lift { item: 0 }, yaw));
        // The ends are the same: which tick was near enough first may be rounding.
        let back = |one: &Demonstration| one.approach.samples.clone().into_iter().rev();
        for (a, b) in back(&a).zip(back(&b)) {
            assert!(distance(&a.frame_from_tool, &b.frame_from_tool) < 1e-9);
        }
    }

    #[test]
    fn putting_is_demonstrated_relative_to_the_region() {
        let region = Obb {
            pose: Isometry3::translation(2.0, 1.0, 0.85),
            half: Vector3::new(0.1, 0.1, 0.0),
            round: false,
        };
        let goal = Goal::Put { item: 0, region };
        let putting = shown(&goal, 0.0).putting.unwrap();
        let at = putting.track.at(putting.release).unwrap();
        let off = at.translation.vector - Vector3::new(-0.12, 0.0, 0.05);
        assert!(off.norm() < 0.005, "{off}");
        let opening = putting.track.opening_between(putting.release - 1e-6, 99.0);
        assert_eq!(opening, Some(0.08));
        let [first, last] = putting.track.ends().unwrap();
        assert!(distance(&first, &at) > 0.1 && distance(&last, &at) > 0.06);
    }

    #[test]
    fn long_rests_are_shortened_and_gripper_commands_are_kept() {
        let sample = |i: u32, x: f64| Sample {
            time: f64::from(i) * 0.1,
            frame_from_tool: Isometry3::translation(x, 0.0, 0.0),
            opening: (i == 40).then_some(0.0),
        };
        let way = |i: u32| match i {
            0..10 => f64::from(i),
            10..50 => 10.0,
            _ => f64::from(i) - 40.0,
        };
        let samples = (0..60).map(|i| sample(i, 0.01 * way(i))).collect();
        let short = without_rests(Track { samples });
        assert!(
            (2.5..4.0).contains(&short.duration()),
            "{}",
            short.duration()
        );
        let commands = short.samples.iter().filter(|s| s.opening.is_some());
        assert_eq!(commands.count(), 1);
        let times = short.samples.windows(2);
        assert!(times.into_iter().all(|w| w[0].time < w[1].time));
    }
}
