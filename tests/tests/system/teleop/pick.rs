//! How a person picks up the mustard by keys: looks at the numbers on the
//! screen, presses, looks again. Nothing here counts on time.

use std::f64::consts::PI;
use std::time::{Duration, Instant};

use super::person::Person;

/// Where the chair stands for the grasp, from the bottle: behind it along the
/// way it looks, and to its right, m.
const STAND: [f64; 2] = [1.19, 0.36];
/// Straight way at the end, m.
const STRAIGHT: f64 = 0.55;
/// Longest time for one movement.
const PATIENCE: Duration = Duration::from_secs(30);

fn wrap(angle: f64) -> f64 {
    (angle + PI).rem_euclid(2.0 * PI) - PI
}

/// Waits until `done` says so of the numbers that are read again and again.
fn until<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let since = Instant::now();
    loop {
        if let Some(seen) = look() {
            return seen;
        }
        assert!(since.elapsed() < PATIENCE, "{what} takes too long");
        std::thread::sleep(Duration::from_millis(15));
    }
}

impl Person {
    /// x, y in m and heading in rad.
    fn chair(&self) -> Option<[f64; 3]> {
        let numbers = self.numbers("chair    x")?;
        let [x, y, degrees] = numbers[..] else {
            return None;
        };
        Some([x, y, degrees.to_radians()])
    }

    /// Forward speed, m/s, and turn rate, rad/s.
    fn speed(&self) -> Option<[f64; 2]> {
        self.numbers("speed ")?[..].try_into().ok()
    }

    /// The bottle in `house`: x, y, z, m.
    fn bottle(&self) -> Option<[f64; 3]> {
        self.numbers("at x")?[..].try_into().ok()
    }

    /// The bottle's grasp from the pads: ahead, left, up, m.
    fn away(&self) -> Option<[f64; 3]> {
        self.numbers("mustard ahead")?[..].try_into().ok()
    }

    fn rests(&self) {
        until("coming to rest", || {
            let [speed, rate] = self.speed()?;
            (speed.abs() < 0.01 && rate.abs() < 0.01).then_some(())
        });
    }

    /// Turns on the spot until the chair looks along `heading`, rad.
    fn turns_to(&mut self, heading: f64) {
        for tolerance in [0.06, 0.04] {
            let off = |person: &Self| Some(wrap(heading - person.chair()?[2]));
            let begin = until("the heading", || off(self));
            if begin.abs() < tolerance {
                continue;
            }
            let side = begin.signum();
            self.presses(if side > 0.0 { "j" } else { "l" });
            until("turning", || {
                // The chair runs on while it brakes.
                let rate = self.speed()?[1].abs();
                (side * off(self)? < rate * rate / 5.0 + 0.09 * rate).then_some(())
            });
            self.presses("k");
            self.rests();
        }
    }

    /// Drives straight until the chair is at `x`, `y` or beside it.
    fn drives_to(&mut self, x: f64, y: f64) {
        let ahead = |person: &Self| {
            let [cx, cy, heading] = person.chair()?;
            Some((x - cx) * heading.cos() + (y - cy) * heading.sin())
        };
        let side = until("the way", || ahead(self)).signum();
        self.presses(if side > 0.0 { "i" } else { "," });
        until("driving", || {
            let speed = self.speed()?[0].abs();
            (side * ahead(self)? < speed * speed / 2.5 + 0.09 * speed).then_some(())
        });
        self.presses("k");
        self.rests();
    }

    /// Steps the hand until the bottle is within half a step along one axis.
    /// Where the arm cannot follow, it reaches out a step and tries again.
    fn steps(&mut self, axis: usize, keys: [&str; 2], goal: f64, step: f64) {
        let since = Instant::now();
        let mut before = f64::INFINITY;
        loop {
            let off = until("the bottle's place", || self.away())[axis] - goal;
            let presses = (off.abs() / step).round() as usize;
            if presses == 0 {
                return;
            }
            assert!(
                since.elapsed() < PATIENCE,
                "the hand stays {off:.3} m off along {axis}; the screen:\n{}",
                self.reads()
            );
            if axis == 2 && (off - before).abs() < 0.2 * step {
                self.presses("v");
                self.hand_rests();
            }
            before = off;
            // As many presses as needed, one at a time.
            for _ in 0..presses.min(4) {
                self.presses(if off > 0.0 { keys[0] } else { keys[1] });
                std::thread::sleep(Duration::from_millis(60));
            }
            self.hand_rests();
        }
    }

    fn hand_rests(&self) {
        let mut last = None;
        until("the hand coming to rest", || {
            let now = self.numbers("hand     forward")?;
            let still = last.as_ref() == Some(&now);
            last = Some(now);
            std::thread::sleep(Duration::from_millis(130));
            still.then_some(())
        });
    }

    /// Drives to the table.
    pub fn goes_to_the_bottle(&mut self) {
        let [bx, by, _] = until("the bottle", || self.bottle());
        let goal = [bx + STAND[0], by + STAND[1]];
        let before = [goal[0] + STRAIGHT, goal[1]];
        // Turns slower than the original's 1 rad/s: twice, by ten per cent a press.
        self.presses("cccccc");
        let [x, y, _] = until("the chair", || self.chair());
        self.turns_to((before[1] - y).atan2(before[0] - x));
        self.drives_to(before[0], before[1]);
        self.turns_to(PI);
        self.drives_to(goal[0], goal[1]);
    }

    /// Takes the bottle and lifts it.
    pub fn takes_the_bottle(&mut self) {
        // Nearer, because the elbow cannot bend so far; down beside it, with
        // fine steps sideways; forward.
        self.steps(0, ["v", "n"], 0.17, 0.025);
        self.steps(2, ["g", "b"], 0.0, 0.025);
        self.presses("-----");
        self.steps(1, ["h", "f"], 0.0, 0.008);
        self.presses("=====");
        self.steps(0, ["v", "n"], 0.036, 0.025);
        for _ in 0..14 {
            self.presses("r");
            std::thread::sleep(Duration::from_millis(90));
        }
        until("a firm grip", || {
            let gripper = self.numbers("gripper  open")?;
            (gripper.len() == 3 && gripper[1] > 2.0 && gripper[2] > 2.0).then_some(())
        });
        for _ in 0..7 {
            self.presses("g");
            self.hand_rests();
        }
        self.waits_for("SUCCESS");
    }
}
