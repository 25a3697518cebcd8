//! Lifts the mustard by keys: reads the numbers on the screen, presses a key, reads again. A
//! slow machine shows old numbers, so the next key waits until the screen shows the effect of
//! the last one, and rest is measured by the simulation's clock.

use std::f64::consts::PI;
use std::time::{Duration, Instant};

use super::operator::Operator;

/// Base placement for the grasp, from the bottle in x and y, m.
const PLACEMENT: [f64; 2] = [1.19, 0.36];
/// Final heading of the chair, rad. The bottle is turned: an approach that differs by more than
/// 0.04 rad to the other side pushes it with one finger.
const HEADING: f64 = PI - 0.05;
/// Length of the final straight approach, m.
const STRAIGHT: f64 = 0.55;
/// Tolerance of the base placement, m and rad.
const NEAR: [f64; 2] = [0.05, 0.05];
/// Resolution of the screen, m.
const SHOWN: f64 = 0.001;
/// A hand is at rest when its numbers are constant for this time, simulated s.
const REST: f64 = 0.4;
/// Longest time for one movement.
const PATIENCE: Duration = Duration::from_secs(150);

fn wrap(angle: f64) -> f64 {
    (angle + PI).rem_euclid(2.0 * PI) - PI
}

/// Reads repeatedly until `read` returns a value.
fn until<T>(what: &str, mut read: impl FnMut() -> Option<T>) -> T {
    let since = Instant::now();
    loop {
        if let Some(value) = read() {
            return value;
        }
        assert!(since.elapsed() < PATIENCE, "{what} takes too long");
        std::thread::sleep(Duration::from_millis(15));
    }
}

impl Operator {
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

    fn wait_until_at_rest(&self) {
        until("coming to rest", || {
            let [speed, rate] = self.speed()?;
            (speed.abs() < 0.01 && rate.abs() < 0.01).then_some(())
        });
    }

    /// Repeats a movement until the rest of the way is below `near`, each time at half the speed:
    /// the robot overshoots by the delay of the screen.
    fn close_in(
        &mut self,
        what: &str,
        near: f64,
        left: impl Fn(&Self) -> Option<f64>,
        mut start: impl FnMut(&mut Self, f64),
    ) {
        let mut slower = 0;
        loop {
            let begin = until(what, || left(self));
            if begin.abs() < near {
                break;
            }
            assert!(
                slower < 5,
                "{what}: {begin:.3} left; {}",
                self.screen_text()
            );
            start(self, begin.signum());
            self.press("k");
            self.wait_until_at_rest();
            self.press("zzzzzz");
            slower += 1;
        }
        for _ in 0..slower {
            self.press("qqqqqq");
        }
    }

    /// Turns on the spot until the chair looks along `heading`, rad.
    fn turn_to(&mut self, heading: f64) {
        let off = |operator: &Self| Some(wrap(heading - operator.chair()?[2]));
        self.close_in("the heading", NEAR[1], off, |operator, side| {
            operator.press(if side > 0.0 { "j" } else { "l" });
            until("turning", || {
                // The chair moves further while it brakes.
                let rate = operator.speed()?[1].abs();
                (side * off(operator)? < rate * rate / 5.0 + 0.09 * rate).then_some(())
            });
        });
    }

    /// Drives straight until the chair is at or beside `x`, `y`, m.
    fn drive_to(&mut self, x: f64, y: f64) {
        let ahead = |operator: &Self| {
            let [cx, cy, heading] = operator.chair()?;
            Some((x - cx) * heading.cos() + (y - cy) * heading.sin())
        };
        self.close_in("the way", NEAR[0], ahead, |operator, side| {
            operator.press(if side > 0.0 { "i" } else { "," });
            until("driving", || {
                let speed = operator.speed()?[0].abs();
                (side * ahead(operator)? < speed * speed / 2.5 + 0.09 * speed).then_some(())
            });
        });
    }

    /// Changes the size of a step, mm.
    fn set_step(&mut self, keys: &str, size: f64) {
        self.press(keys);
        let shown = |operator: &Self| operator.numbers("hand   move")?.first().copied();
        until("the step size", || {
            ((shown(self)? - size).abs() < 0.05).then_some(())
        });
    }

    /// Waits until every key so far is processed: changes the step size, waits until the screen
    /// shows it, and changes it back.
    fn wait_for_keys(&mut self) {
        let step = |operator: &Self| operator.numbers("hand   move")?.first().copied();
        let before = until("the step size", || step(self));
        self.press("-");
        until("the finer step", || (step(self)? != before).then_some(()));
        self.press("=");
        until("the coarser step", || (step(self)? == before).then_some(()));
    }

    /// Steps the hand until the bottle is within half a step along one axis. When the arm cannot
    /// follow, steps forward and tries again.
    fn step_along(&mut self, axis: usize, keys: [&str; 2], goal: f64, step: f64) {
        let since = Instant::now();
        let mut before = f64::INFINITY;
        loop {
            let off = until("the bottle's position", || self.away())[axis] - goal;
            // The hand may alternate between two positions one step apart: with the rounding of
            // the screen, one of them counts as reached.
            if off.abs() < step / 2.0 + SHOWN {
                return;
            }
            let presses = (off.abs() / step).round().max(1.0) as usize;
            assert!(
                since.elapsed() < PATIENCE,
                "the hand stays {off:.3} m off along {axis}; the screen:\n{}",
                self.screen_text()
            );
            if axis == 2 && (off - before).abs() < 0.2 * step {
                self.press("v");
                self.wait_until_hand_rests();
            }
            before = off;
            // As many presses as needed, one at a time.
            for _ in 0..presses.min(4) {
                self.press(if off > 0.0 { keys[0] } else { keys[1] });
                self.wait_for_keys();
            }
            self.wait_until_hand_rests();
        }
    }

    fn wait_until_hand_rests(&mut self) {
        self.wait_for_keys();
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

    /// Prints the state for the analysis of a failed run.
    fn print_state(&self, phase: &str) {
        eprintln!(
            "{phase}: chair {:?}, bottle {:?}, from the pads {:?}, hand {:?}",
            self.chair(),
            self.bottle(),
            self.away(),
            self.numbers("hand     forward")
        );
    }

    /// Drives to the table.
    pub fn drive_to_the_bottle(&mut self) {
        let [bx, by, _] = until("the bottle", || self.bottle());
        self.print_state("start");
        let goal = [bx + PLACEMENT[0], by + PLACEMENT[1]];
        let before = [goal[0] + STRAIGHT, goal[1]];
        // Turns slower than WheelArm-Sim's 1 rad/s: twice, by ten per cent a press.
        self.press("cccccc");
        let [x, y, _] = until("the chair", || self.chair());
        self.turn_to((before[1] - y).atan2(before[0] - x));
        self.drive_to(before[0], before[1]);
        self.turn_to(HEADING);
        self.drive_to(goal[0], goal[1]);
        self.print_state("at the table");
    }

    /// Grasps the bottle and lifts it.
    pub fn lift_the_bottle(&mut self) {
        // Forward first, because the elbow cannot bend far enough; then down beside the bottle,
        // sideways in fine steps, and forward.
        self.step_along(0, ["v", "n"], 0.17, 0.025);
        self.print_state("near");
        self.step_along(2, ["g", "b"], 0.0, 0.025);
        self.print_state("beside it");
        self.set_step("-----", 8.2);
        self.step_along(1, ["h", "f"], 0.0, 0.008);
        self.set_step("=====", 25.0);
        self.print_state("before it");
        self.step_along(0, ["v", "n"], 0.036, 0.025);
        // Far beyond the first contact: a light grasp loses the bottle.
        for _ in 0..14 {
            self.press("r");
            self.wait_for_keys();
        }
        until("a firm grip", || self.holds_firmly().then_some(()));
        for _ in 0..7 {
            self.press("g");
            self.wait_until_hand_rests();
        }
        self.wait_for("SUCCESS");
    }
}
