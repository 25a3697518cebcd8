//! How a person picks up the mustard by keys: looks at the numbers on the
//! screen, presses, looks again. A slow machine shows old numbers, so nothing
//! is pressed again before the screen has answered what was pressed, and rest
//! is measured by the simulation's clock.

use std::f64::consts::PI;
use std::time::{Duration, Instant};

use super::person::Person;

/// Where the chair stands for the grasp, from the bottle: behind it along the
/// way it looks, and to its right, m.
const STAND: [f64; 2] = [1.19, 0.36];
/// Where the chair looks at last, rad: the bottle stands turned, and a hand that
/// comes more than 0.04 rad from the other side pushes it with one finger.
const LOOKS: f64 = PI - 0.05;
/// Straight way at the end, m.
const STRAIGHT: f64 = 0.55;
/// The chair stands well enough, m and rad.
const NEAR: [f64; 2] = [0.05, 0.05];
/// The screen shows no less, m.
const SHOWN: f64 = 0.001;
/// A hand whose numbers stay for so long rests, simulated s.
const REST: f64 = 0.4;
/// Longest time for one movement: something hangs.
const PATIENCE: Duration = Duration::from_secs(150);

fn wrap(angle: f64) -> f64 {
    (angle + PI).rem_euclid(2.0 * PI) - PI
}

/// Waits until `done` says so of the numbers that are read again and again.
fn until<T>(what: &str, mut appearance: impl FnMut() -> Option<T>) -> T {
    let since = Instant::now();
    loop {
        if let Some(seen) = appearance() {
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

    /// Both pads press, N.
    fn holds_firmly(&self) -> bool {
        let gripper = self.numbers("gripper  open").unwrap_or_default();
        gripper.len() == 3 && gripper[1] > 2.0 && gripper[2] > 2.0
    }

    fn rests(&self) {
        until("coming to rest", || {
            let [speed, rate] = self.speed()?;
            (speed.abs() < 0.01 && rate.abs() < 0.01).then_some(())
        });
    }

    /// Makes a movement until what is left of it is below `near`, each time at
    /// half the speed of the time before: it runs on by what a slow screen
    /// hides.
    fn closes_in(
        &mut self,
        what: &str,
        near: f64,
        left: impl Fn(&Self) -> Option<f64>,
        mut goes: impl FnMut(&mut Self, f64),
    ) {
        let mut slower = 0;
        loop {
            let begin = until(what, || left(self));
            if begin.abs() < near {
                break;
            }
            assert!(slower < 5, "{what}: {begin:.3} left; {}", self.reads());
            goes(self, begin.signum());
            self.presses("k");
            self.rests();
            self.presses("zzzzzz");
            slower += 1;
        }
        for _ in 0..slower {
            self.presses("qqqqqq");
        }
    }

    /// Turns on the spot until the chair looks along `heading`, rad.
    fn turns_to(&mut self, heading: f64) {
        let off = |person: &Self| Some(wrap(heading - person.chair()?[2]));
        self.closes_in("the heading", NEAR[1], off, |person, side| {
            person.presses(if side > 0.0 { "j" } else { "l" });
            until("turning", || {
                // The chair runs on while it brakes.
                let rate = person.speed()?[1].abs();
                (side * off(person)? < rate * rate / 5.0 + 0.09 * rate).then_some(())
            });
        });
    }

    /// Drives straight until the chair is at `x`, `y` or beside it.
    fn drives_to(&mut self, x: f64, y: f64) {
        let ahead = |person: &Self| {
            let [cx, cy, heading] = person.chair()?;
            Some((x - cx) * heading.cos() + (y - cy) * heading.sin())
        };
        self.closes_in("the way", NEAR[0], ahead, |person, side| {
            person.presses(if side > 0.0 { "i" } else { "," });
            until("driving", || {
                let speed = person.speed()?[0].abs();
                (side * ahead(person)? < speed * speed / 2.5 + 0.09 * speed).then_some(())
            });
        });
    }

    /// Changes the size of a step, mm.
    fn sets_step(&mut self, keys: &str, size: f64) {
        self.presses(keys);
        let shown = |person: &Self| person.numbers("hand   move")?.first().copied();
        until("the step size", || {
            ((shown(self)? - size).abs() < 0.05).then_some(())
        });
    }

    /// Every key so far has been taken: the step size, which is changed last,
    /// stands changed on the screen, and back.
    fn is_heard(&mut self) {
        let step = |person: &Self| person.numbers("hand   move")?.first().copied();
        let before = until("the step size", || step(self));
        self.presses("-");
        until("the finer step", || (step(self)? != before).then_some(()));
        self.presses("=");
        until("the coarser step", || (step(self)? == before).then_some(()));
    }

    /// Steps the hand until the bottle is within half a step along one axis.
    /// Where the arm cannot follow, it reaches out a step and tries again.
    fn steps(&mut self, axis: usize, keys: [&str; 2], goal: f64, step: f64) {
        let since = Instant::now();
        let mut before = f64::INFINITY;
        loop {
            let off = until("the bottle's place", || self.away())[axis] - goal;
            // Of the two places a step apart that it comes to rest at in turns, one
            // counts as near enough, as the screen rounds.
            if off.abs() < step / 2.0 + SHOWN {
                return;
            }
            let presses = (off.abs() / step).round().max(1.0) as usize;
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
                self.is_heard();
            }
            self.hand_rests();
        }
    }

    fn hand_rests(&mut self) {
        self.is_heard();
        let mut last: Option<(Vec<f64>, f64)> = None;
        until("the hand coming to rest", || {
            let time = *self.numbers("hand-picked")?.first()?;
            let now = self.numbers("hand     forward")?;
            match &last {
                Some((before, since)) if *before == now => {
                    return (time - since >= REST).then_some(());
                }
                _ => last = Some((now, time)),
            }
            None
        });
    }

    /// What a failed run is judged by.
    fn tells(&self, phase: &str) {
        eprintln!(
            "{phase}: chair {:?}, bottle {:?}, from the pads {:?}, hand {:?}",
            self.chair(),
            self.bottle(),
            self.away(),
            self.numbers("hand     forward")
        );
    }

    /// Drives to the table.
    pub fn goes_to_the_bottle(&mut self) {
        let [bx, by, _] = until("the bottle", || self.bottle());
        self.tells("begins");
        let goal = [bx + STAND[0], by + STAND[1]];
        let before = [goal[0] + STRAIGHT, goal[1]];
        // Turns slower than WheelArm-Sim's 1 rad/s: twice, by ten per cent a press.
        self.presses("cccccc");
        let [x, y, _] = until("the chair", || self.chair());
        self.turns_to((before[1] - y).atan2(before[0] - x));
        self.drives_to(before[0], before[1]);
        self.turns_to(LOOKS);
        self.drives_to(goal[0], goal[1]);
        self.tells("stands at the table");
    }

    /// Takes the bottle and lifts it.
    pub fn takes_the_bottle(&mut self) {
        // Nearer, because the elbow cannot bend so far; down beside it, with
        // fine steps sideways; forward.
        self.steps(0, ["v", "n"], 0.17, 0.025);
        self.tells("near");
        self.steps(2, ["g", "b"], 0.0, 0.025);
        self.tells("beside it");
        self.sets_step("-----", 8.2);
        self.steps(1, ["h", "f"], 0.0, 0.008);
        self.sets_step("=====", 25.0);
        self.tells("before it");
        self.steps(0, ["v", "n"], 0.036, 0.025);
        // Far beyond the first touch: a light grip loses the bottle.
        for _ in 0..14 {
            self.presses("r");
            self.is_heard();
        }
        until("a firm grip", || self.holds_firmly().then_some(()));
        for _ in 0..7 {
            self.presses("g");
            self.hand_rests();
        }
        self.waits_for("SUCCESS");
    }
}
