//! Keyboard control of the chair: directions latch, speeds change in steps. Pure.

use wheelarm_proto::v1;

/// Speeds at the start, m/s and rad/s: those of teleop_twist_keyboard.
pub const START: [f64; 2] = [0.5, 1.0];
/// Least speeds, m/s and rad/s.
const LEAST: [f64; 2] = [0.02, 0.05];
/// Greatest speeds, m/s and rad/s: the chair's own command range. The server
/// cuts to the caps of its robot.
const GREATEST: [f64; 2] = [1.667, 1.68];
/// Time between two messages while a direction is latched: 20 Hz.
const RESEND: f64 = 0.05;
/// Repetitions of a stop.
const STOPS: u8 = 3;

/// The chair's keys and their directions: forward, left.
pub const DIRECTIONS: [(char, [f64; 2]); 8] = [
    ('u', [1.0, 1.0]),
    ('i', [1.0, 0.0]),
    ('o', [1.0, -1.0]),
    ('j', [0.0, 1.0]),
    ('l', [0.0, -1.0]),
    ('m', [-1.0, -1.0]),
    (',', [-1.0, 0.0]),
    ('.', [-1.0, 1.0]),
];

/// The key that stops the chair.
const STOP: char = 'k';

/// The speed keys, with their factors of forward speed and turn rate.
pub const SPEEDS: [(char, [f64; 2]); 6] = [
    ('q', [1.1, 1.1]),
    ('z', [0.9, 0.9]),
    ('w', [1.1, 1.0]),
    ('x', [0.9, 1.0]),
    ('e', [1.0, 1.1]),
    ('c', [1.0, 0.9]),
];

/// Commanded motion of the chair.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    /// Forward speed, m/s, and turn rate, rad/s, of a latched direction.
    pub speeds: [f64; 2],
    /// Latched direction: forward and left, each -1, 0 or 1.
    pub direction: Option<[f64; 2]>,
    /// Seconds after the last key until the chair stops by itself, if set.
    pub dead_man: Option<f64>,
    last_key: f64,
    next: f64,
    stops: u8,
}

impl Drive {
    /// A chair at rest.
    #[must_use]
    pub fn new(dead_man: Option<f64>) -> Self {
        Self {
            speeds: START,
            direction: None,
            dead_man,
            last_key: 0.0,
            next: 0.0,
            stops: 0,
        }
    }

    /// Handles a key of the chair; returns whether it is one.
    pub fn key(&mut self, key: char, now: f64) -> bool {
        if let Some((_, direction)) = DIRECTIONS.iter().find(|(k, _)| *k == key) {
            self.direction = Some(*direction);
            self.last_key = now;
            self.next = now;
            return true;
        }
        if key == STOP {
            self.stop(now);
            return true;
        }
        let Some((_, [linear, angular])) = SPEEDS.iter().find(|(k, _)| *k == key) else {
            return false;
        };
        self.speeds = [
            (self.speeds[0] * linear).clamp(LEAST[0], GREATEST[0]),
            (self.speeds[1] * angular).clamp(LEAST[1], GREATEST[1]),
        ];
        true
    }

    /// Stops the chair; the stop is repeated a few times.
    pub fn stop(&mut self, now: f64) {
        self.direction = None;
        self.stops = STOPS;
        self.next = now;
    }

    /// Clears the direction without a message, for a lost connection.
    pub fn forget(&mut self) {
        self.direction = None;
        self.stops = 0;
    }

    /// Current speeds, m/s and rad/s.
    #[must_use]
    pub fn commanded_speeds(&self) -> [f64; 2] {
        let [forward, left] = self.direction.unwrap_or_default();
        [forward * self.speeds[0], left * self.speeds[1]]
    }

    /// The message that is due at `now`, s.
    pub fn due(&mut self, now: f64) -> Option<v1::BaseCommand> {
        if let (Some(limit), Some(_)) = (self.dead_man, self.direction)
            && now - self.last_key > limit
        {
            self.stop(now);
        }
        if now < self.next || (self.direction.is_none() && self.stops == 0) {
            return None;
        }
        self.stops = self.stops.saturating_sub(1);
        self.next = now + RESEND;
        let [linear, angular] = self.commanded_speeds();
        Some(v1::BaseCommand { linear, angular })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sent(drive: &mut Drive, from: f64, to: f64) -> Vec<[f64; 2]> {
        let mut sent = Vec::new();
        let mut now = from;
        while now < to {
            if let Some(base) = drive.due(now) {
                sent.push([base.linear, base.angular]);
            }
            now += 0.01;
        }
        sent
    }

    #[test]
    fn a_direction_is_repeated_at_20_hz_until_k() {
        let mut drive = Drive::new(None);
        assert!(drive.key('o', 0.0));
        let messages = sent(&mut drive, 0.0, 2.0);
        assert!((36..=41).contains(&messages.len()), "{}", messages.len());
        assert!(messages.iter().all(|m| *m == [0.5, -1.0]));
        drive.key('k', 2.0);
        assert_eq!(sent(&mut drive, 2.0, 4.0), [[0.0, 0.0]; 3]);
    }

    #[test]
    fn speeds_change_by_a_tenth_while_driving() {
        let mut drive = Drive::new(None);
        drive.key('i', 0.0);
        drive.key('w', 0.0);
        assert!((drive.commanded_speeds()[0] - 0.55).abs() < 1e-12);
        for _ in 0..100 {
            drive.key('z', 0.0);
        }
        assert_eq!(drive.speeds, LEAST);
    }

    #[test]
    fn with_a_dead_man_switch_a_silent_keyboard_stops_the_chair() {
        let mut drive = Drive::new(Some(1.0));
        drive.key('i', 0.0);
        let messages = sent(&mut drive, 0.0, 3.0);
        assert_eq!(messages.last(), Some(&[0.0, 0.0]));
        assert_eq!(drive.direction, None);
    }
}
