//! Tests after a task: the hand moves to and fro with what it holds; what was put down rests.

use nalgebra::Isometry3;
use wheelarm_proto::v1;

/// Speed of the hand, m/s.
const SPEED: f64 = 0.3;
/// Control ticks of one stroke, of the whole test, and of the rest after it, at 60 Hz.
const STROKE: u32 = 12;
const SHAKEN: u32 = 180;
const REST: u32 = 30;
/// Largest motion of the object in the hand, metres.
const SLIP: f64 = 0.020;

/// The command of a tick of the test; `None` after its end.
#[must_use]
pub fn command(tick: u32) -> Option<v1::Command> {
    if tick >= SHAKEN + REST {
        return None;
    }
    // Half a stroke first: the hand stays about its place.
    let stroke = (tick + STROKE / 2) / STROKE;
    let speed = if stroke.is_multiple_of(2) {
        SPEED
    } else {
        -SPEED
    };
    let twist = v1::Twist {
        linear: Some(v1::Vector3 {
            x: 0.0,
            y: speed,
            z: 0.0,
        }),
        angular: Some(v1::Vector3::default()),
    };
    let target = match tick < SHAKEN {
        true => v1::arm_command::Target::Twist(v1::CartesianTwist {
            frame: v1::CommandFrame::BaseLink.into(),
            twist: Some(twist),
        }),
        false => v1::arm_command::Target::Hold(true),
    };
    Some(v1::Command {
        arm: Some(v1::ArmCommand {
            target: Some(target),
        }),
        phase: v1::Phase::Retracting.into(),
        phase_name: "shaking".to_owned(),
        ..v1::Command::default()
    })
}

/// The failure of a grasp whose object moved so far in the hand, metres.
#[must_use]
pub fn verdict(moved: f64) -> Option<String> {
    (moved > SLIP).then(|| format!("slipped: {:.0} mm in the hand when shaken", moved * 1e3))
}

/// Longest motion after the release, seconds.
const LONGEST_MOTION: f64 = 2.0;
/// Motion below which an object rests: metres, and radians.
const STILL: [f64; 2] = [1.0e-4, 2.0e-3];
/// Control ticks for which an object that was put down is watched, at 60 Hz: the engine lets a
/// body sleep 2 s after it became slow.
const WATCHED: usize = 180;

/// Begin of the words of [`Rest`].
const STILL_AFTER: &str = "put down: still after ";

/// Seconds from the release to the last motion, of a note of the expert; absent in other notes.
#[must_use]
pub fn still_after(note: &str) -> Option<f64> {
    let (_, rest) = note.split_once(STILL_AFTER)?;
    rest.split_once(" s")
        .and_then(|(number, _)| number.parse().ok())
}

/// An object that was put down: its poses after the task, each with its time.
#[derive(Clone, Debug)]
pub struct Rest {
    /// Time of the release, seconds.
    released: f64,
    poses: Vec<(f64, Isometry3<f64>)>,
}

impl Rest {
    /// Begins.
    #[must_use]
    pub fn new(released: f64) -> Self {
        Self {
            released,
            poses: Vec::new(),
        }
    }

    /// Adds a pose at a time; returns whether that was the last.
    pub fn add(&mut self, time: f64, pose: &Isometry3<f64>) -> bool {
        self.poses.push((time, *pose));
        self.poses.len() >= WATCHED
    }

    /// Seconds from the release to the last motion, and to the tick from which the pose keeps
    /// its bits. The former is 0 for an object that does not move while it is watched, which
    /// begins when the task is done; the latter is absent for one that does not sleep.
    fn times(&self) -> (f64, Option<f64>) {
        let Some((_, last)) = self.poses.last() else {
            return (0.0, None);
        };
        let moves = |pose: &Isometry3<f64>| {
            let off = last.inverse() * pose;
            off.translation.vector.norm() > STILL[0] || off.rotation.angle() > STILL[1]
        };
        let since = |time: f64| time - self.released;
        let moved = self.poses.iter().rev().find(|(_, pose)| moves(pose));
        let awake = self.poses.iter().rev().find(|(_, pose)| pose != last);
        let asleep = awake.map_or(self.poses[0].0, |(time, _)| *time);
        let sleeps = asleep < self.poses[self.poses.len() - 1].0 - 0.1;
        (
            moved.map_or(0.0, |(time, _)| since(*time)),
            sleeps.then(|| since(asleep)),
        )
    }

    /// The times in words, which [`still_after`] reads.
    #[must_use]
    pub fn words(&self) -> String {
        let (moved, asleep) = self.times();
        let asleep = asleep.map_or("awake".to_owned(), |s| format!("asleep after {s:.2} s"));
        format!("{STILL_AFTER}{moved:.2} s, {asleep}")
    }

    /// The failure of an object that moves for long or does not sleep.
    #[must_use]
    pub fn verdict(&self) -> Option<String> {
        let (moved, asleep) = self.times();
        if moved > LONGEST_MOTION {
            return Some(format!(
                "does not rest: moves {moved:.1} s after the release"
            ));
        }
        asleep
            .is_none()
            .then(|| "does not rest: creeps, so that it does not sleep".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn object_rests_when_its_pose_keeps_its_bits() {
        let watched = |creep: f64, settled: f64| {
            let mut rest = Rest::new(10.0);
            for tick in 0.. {
                let time = 10.5 + f64::from(tick) / 60.0;
                let x = creep * (time - 10.0).min(settled);
                if rest.add(time, &Isometry3::translation(x, 0.0, 0.7)) {
                    return rest;
                }
            }
            rest
        };
        let rest = watched(0.01, 1.5);
        assert_eq!(rest.verdict(), None, "{}", rest.words());
        let (moved, asleep) = rest.times();
        assert!((1.4..1.5).contains(&moved) && (1.4..1.6).contains(&asleep.unwrap()));
        let read = still_after(&format!("12.50 s {}", rest.words())).unwrap();
        assert!((read - moved).abs() < 0.01, "{read}");
        // A task that ends long after the release.
        let mut rest = Rest::new(7.0);
        let mut time = 10.5;
        while !rest.add(time, &Isometry3::translation(0.0, 0.0, 0.7)) {
            time += 1.0 / 60.0;
        }
        assert_eq!(rest.verdict(), None, "{}", rest.words());
        let late = watched(0.01, 2.5).verdict().unwrap();
        assert!(late.contains("moves 2.5 s"), "{late}");
        let creeping = watched(1.0e-5, 9.0).verdict().unwrap();
        assert!(creeping.contains("creeps"), "{creeping}");
    }

    #[test]
    fn hand_returns_to_its_place_and_rests() {
        let mut sum = 0.0;
        let mut last = None;
        for tick in 0.. {
            let Some(command) = command(tick) else {
                break;
            };
            last = command.arm.and_then(|arm| arm.target);
            if let Some(v1::arm_command::Target::Twist(twist)) = &last {
                sum += twist.twist.and_then(|t| t.linear).unwrap_or_default().y;
            }
        }
        assert!(sum.abs() <= SPEED * f64::from(STROKE), "{sum}");
        assert_eq!(last, Some(v1::arm_command::Target::Hold(true)));
    }

    #[test]
    fn object_that_slips_by_centimetres_fails() {
        assert_eq!(verdict(0.004), None);
        assert!(verdict(0.032).unwrap().starts_with("slipped"));
    }
}
