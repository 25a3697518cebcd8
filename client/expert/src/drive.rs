//! Follows the path of the chair with a smooth speed profile and a tracking law.

use wheelarm_proto::exact;

use wheelarm_planning::footprint_check::{Pose2, wrap};
use wheelarm_planning::hybrid_a_star::Segment;

/// Limits of a drive, inside the chair's own profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveLimits {
    /// Forward speed, m/s.
    pub speed: f64,
    /// Forward acceleration, m/s²; the chair's own profile allows 0.23.
    pub acceleration: f64,
    /// Braking, m/s².
    pub braking: f64,
    /// Turn rate, rad/s; the chair's own profile allows 0.8.
    pub turn_rate: f64,
    /// Turn acceleration, rad/s²; the chair's own profile allows 0.79.
    pub turn_acceleration: f64,
    /// Forward speed on arcs and near them, m/s: the chair begins to turn late. Infinite
    /// where there is room.
    pub bend_speed: f64,
}

/// Reference pose and velocity of the chair at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// Seconds after the start.
    pub time: f64,
    /// Pose in `house`.
    pub pose: Pose2,
    /// Forward speed, m/s.
    pub speed: f64,
    /// Turn rate, rad/s.
    pub turn_rate: f64,
}

/// A timed path.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    references: Vec<Reference>,
}

/// The speed on arcs applies this far before and after them, metres.
const BEND: f64 = 0.25;
/// Pause between rolling and turning, seconds, in which the chair stops.
const PAUSE: f64 = 0.25;
/// Step of the speed profile, metres.
const STEP: f64 = 0.01;
/// The chair's turn acceleration needs about this long for the change of turn
/// rate at the ends of an arc, seconds. The turn rate that is fed forward is
/// the mean over this window around the present, shifted by the chair's lag.
const RAMP: f64 = 0.6;
const LAG: f64 = 0.05;
/// Gains of the tracking law (Kanayama et al. 1990): 1/s, 1/m², 1/m.
const GAIN_ALONG: f64 = 1.0;
const GAIN_ACROSS: f64 = 8.0;
const GAIN_HEADING: f64 = 5.0;
/// Heading gain while turning on the spot, 1/s.
const GAIN_TURN: f64 = 2.0;

impl Drive {
    /// Times `path` from `start`.
    #[must_use]
    pub fn new(start: Pose2, path: &[Segment], limits: &DriveLimits) -> Self {
        let mut drive = Self {
            references: vec![Reference {
                time: 0.0,
                pose: start,
                speed: 0.0,
                turn_rate: 0.0,
            }],
        };
        let mut rest = path;
        while let Some(first) = rest.first() {
            let run = rest
                .iter()
                .take_while(|segment| belongs(first, segment))
                .count();
            let (head, tail) = rest.split_at(run);
            match first {
                Segment::Turn(_) => {
                    let angle = head
                        .iter()
                        .map(|segment| match segment {
                            Segment::Turn(angle) => *angle,
                            Segment::Roll { .. } => 0.0,
                        })
                        .sum();
                    drive.turn(angle, limits);
                }
                Segment::Roll { length, .. } => drive.roll(head, length.signum(), limits),
            }
            drive.rest(PAUSE);
            rest = tail;
        }
        drive
    }

    fn end(&self) -> Reference {
        // There is always the start.
        self.references[self.references.len() - 1]
    }

    fn rest(&mut self, seconds: f64) {
        let end = self.end();
        self.references.push(Reference {
            time: end.time + seconds,
            speed: 0.0,
            turn_rate: 0.0,
            ..end
        });
    }

    fn turn(&mut self, angle: f64, limits: &DriveLimits) {
        let start = self.end();
        let steps = 100;
        let speeds = profile(
            &vec![limits.turn_rate; steps + 1],
            angle.abs() / steps as f64,
            limits.turn_acceleration,
            limits.turn_acceleration,
        );
        let mut time = start.time;
        for i in 1..=steps {
            time += 2.0 * angle.abs() / steps as f64 / (speeds[i - 1] + speeds[i]);
            self.references.push(Reference {
                time,
                pose: start.pose.turned(angle * i as f64 / steps as f64),
                speed: 0.0,
                turn_rate: speeds[i] * angle.signum(),
            });
        }
    }

    /// Rolls the segments of one direction (`sign`) without a stop.
    fn roll(&mut self, segments: &[Segment], sign: f64, limits: &DriveLimits) {
        let mut poses = vec![self.end().pose];
        let mut curvatures = vec![0.0];
        let total: f64 = segments.iter().map(rolled_length).sum();
        let count = (total / STEP).ceil().max(1.0) as usize;
        let step = total / count as f64;
        let (mut segment, mut begun) = (0, 0.0);
        let mut at = poses[0];
        for i in 1..=count {
            let goal = step * i as f64;
            while segment + 1 < segments.len() && begun + rolled_length(&segments[segment]) < goal {
                begun += rolled_length(&segments[segment]);
                at = segments[segment].after(&at, 1.0);
                segment += 1;
            }
            let length = rolled_length(&segments[segment]).max(1e-9);
            poses.push(segments[segment].after(&at, ((goal - begun) / length).min(1.0)));
            curvatures.push(match segments[segment] {
                Segment::Roll { curvature, .. } => curvature,
                Segment::Turn(_) => 0.0,
            });
        }
        // Driving back is slower.
        let top = limits.speed * if sign < 0.0 { 0.5 } else { 1.0 };
        let caps: Vec<f64> = curvatures
            .iter()
            .map(|k| top.min(limits.turn_rate / k.abs().max(1e-6)))
            .collect();
        let mut caps = caps;
        if limits.bend_speed < top {
            let near = (BEND / step).ceil() as usize;
            for (i, cap) in caps.iter_mut().enumerate() {
                let around = i.saturating_sub(near)..=(i + near).min(count);
                if curvatures[around].iter().any(|curvature| *curvature != 0.0) {
                    *cap = cap.min(limits.bend_speed);
                }
            }
        }
        let speeds = profile(&caps, step, limits.acceleration, limits.braking);
        let mut time = self.end().time;
        for i in 1..=count {
            time += 2.0 * step / (speeds[i - 1] + speeds[i]);
            self.references.push(Reference {
                time,
                pose: poses[i],
                speed: speeds[i] * sign,
                turn_rate: speeds[i] * sign * curvatures[i],
            });
        }
    }

    /// Seconds from start to rest.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.end().time
    }

    /// Final pose.
    #[must_use]
    pub fn goal(&self) -> Pose2 {
        self.end().pose
    }

    /// Reference of the chair `time` seconds after the start.
    #[must_use]
    pub fn reference(&self, time: f64) -> Reference {
        let after = self.references.partition_point(|r| r.time <= time);
        let (Some(a), Some(b)) = (
            after.checked_sub(1).and_then(|i| self.references.get(i)),
            self.references.get(after),
        ) else {
            let mut edge = if after == 0 {
                self.references[0]
            } else {
                self.end()
            };
            edge.time = time;
            return edge;
        };
        let share = (time - a.time) / (b.time - a.time);
        let mix = |from: f64, to: f64| from + (to - from) * share;
        Reference {
            time,
            pose: Pose2 {
                x: mix(a.pose.x, b.pose.x),
                y: mix(a.pose.y, b.pose.y),
                heading: wrap(a.pose.heading + share * wrap(b.pose.heading - a.pose.heading)),
            },
            speed: mix(a.speed, b.speed),
            turn_rate: mix(a.turn_rate, b.turn_rate),
        }
    }

    /// Forward speed and turn rate that keep a chair at `pose` on the path.
    #[must_use]
    pub fn command(&self, time: f64, pose: &Pose2) -> [f64; 2] {
        let now = self.reference(time);
        let before = self.reference(time + LAG - RAMP / 2.0);
        let after = self.reference(time + LAG + RAMP / 2.0);
        let feed = wrap(after.pose.heading - before.pose.heading) / RAMP;
        let [along, across, turn] = pose.to(&now.pose);
        let speed = now.speed * exact::cos(turn) + GAIN_ALONG * along;
        let turn_rate = feed
            + now.speed * GAIN_ACROSS * across
            + now.speed.abs() * GAIN_HEADING * exact::sin(turn)
            + (1.0 - (now.speed.abs() / 0.2).min(1.0)) * GAIN_TURN * turn;
        [speed.clamp(-0.3, 0.6), turn_rate.clamp(-0.8, 0.8)]
    }
}

/// Whether a segment is driven in one go with the first of its run.
fn belongs(first: &Segment, segment: &Segment) -> bool {
    match (first, segment) {
        (Segment::Turn(a), Segment::Turn(b)) => a * b > 0.0,
        (Segment::Roll { length: a, .. }, Segment::Roll { length: b, .. }) => a * b > 0.0,
        _ => false,
    }
}

fn rolled_length(segment: &Segment) -> f64 {
    match segment {
        Segment::Roll { length, .. } => length.abs(),
        Segment::Turn(_) => 0.0,
    }
}

/// Speeds at points `step` apart, from rest to rest, below `caps`.
fn profile(caps: &[f64], step: f64, acceleration: f64, braking: f64) -> Vec<f64> {
    let mut speeds = caps.to_vec();
    let last = speeds.len() - 1;
    // Not exactly at rest, so that every step takes a finite time.
    speeds[0] = speeds[0].min(1e-3);
    speeds[last] = speeds[last].min(1e-3);
    for i in 1..=last {
        let reachable = (speeds[i - 1].powi(2) + 2.0 * acceleration * step).sqrt();
        speeds[i] = speeds[i].min(reachable);
    }
    for i in (0..last).rev() {
        let stoppable = (speeds[i + 1].powi(2) + 2.0 * braking * step).sqrt();
        speeds[i] = speeds[i].min(stoppable);
    }
    speeds
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: DriveLimits = DriveLimits {
        speed: 0.5,
        acceleration: 0.2,
        braking: 0.3,
        turn_rate: 0.6,
        turn_acceleration: 0.6,
        bend_speed: f64::INFINITY,
    };

    /// Follows a path that begins a little beside the chair, which has the
    /// accelerations of `assets/robots/wheelarm/robot.toml`.
    fn follow(start: Pose2, beside: Pose2, path: &[Segment]) -> (Pose2, Pose2, f64) {
        let drive = Drive::new(start, path, &LIMITS);
        let (mut pose, mut v, mut w) = (beside, 0.0_f64, 0.0_f64);
        let dt = 1.0 / 60.0;
        let mut worst = 0.0_f64;
        let mut t = 0.0;
        while t < drive.duration() + 1.5 {
            let [speed, rate] = drive.command(t, &pose);
            v += (speed - v).clamp(-1.25 * dt, 0.23 * dt);
            w += (rate - w).clamp(-0.79 * dt, 0.79 * dt);
            pose = pose.turned(w * dt).rolled(v * dt, 0.0);
            t += dt;
            worst = worst.max(pose.distance(&drive.reference(t).pose));
        }
        (pose, drive.goal(), worst)
    }

    #[test]
    fn bends_are_slower_where_there_is_little_room() {
        let start = Pose2 {
            x: 0.0,
            y: 0.0,
            heading: 0.0,
        };
        let roll = |length, curvature| Segment::Roll { length, curvature };
        let path = [roll(3.0, 0.0), roll(0.8, 1.25), roll(3.0, 0.0)];
        let limits = DriveLimits {
            bend_speed: 0.2,
            ..LIMITS
        };
        let drive = Drive::new(start, &path, &limits);
        let fastest = |part: [f64; 2]| {
            let mut rolled = 0.0;
            let pairs = drive.references.windows(2);
            let speeds = pairs.filter_map(|pair| {
                rolled += pair[0].pose.distance(&pair[1].pose);
                (part[0]..part[1])
                    .contains(&rolled)
                    .then_some(pair[1].speed)
            });
            speeds.fold(0.0, f64::max)
        };
        assert!(fastest([0.0, 2.7]) > 0.45 && fastest([4.1, 6.8]) > 0.45);
        let bend = fastest([2.76, 4.04]);
        assert!(bend < 0.201 && bend > 0.19, "{bend} m/s");
    }

    #[test]
    fn lagging_chair_arrives_within_two_centimetres() {
        let start = Pose2 {
            x: -6.635,
            y: 3.389,
            heading: -std::f64::consts::FRAC_PI_2,
        };
        let straight = |length| Segment::Roll {
            length,
            curvature: 0.0,
        };
        let arc = Segment::Roll {
            length: 0.8 * std::f64::consts::FRAC_PI_2,
            curvature: -1.0 / 0.8,
        };
        let paths: [&[Segment]; 2] = [
            &[straight(0.4), arc, straight(0.3)],
            &[
                Segment::Turn(-1.0),
                straight(1.5),
                Segment::Turn(0.4),
                straight(-0.2),
            ],
        ];
        for path in paths {
            let beside = Pose2 {
                x: start.x + 0.01,
                ..start
            };
            let (pose, goal, worst) = follow(start, beside, path);
            let miss = pose.distance(&goal);
            let turn = wrap(pose.heading - goal.heading).abs();
            assert!(miss < 0.02, "missed by {miss:.3} m on {path:?}");
            assert!(turn < 0.03, "turned {turn:.3} rad too far on {path:?}");
            assert!(worst < 0.10, "strayed {worst:.3} m on {path:?}");
        }
    }
}
