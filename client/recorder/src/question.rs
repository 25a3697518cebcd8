//! What is asked of the server's cache until it comes or is given up.

use std::time::{Duration, Instant};

/// Pause between an answer without what is wanted and the next question; it doubles, up
/// to [`LONGEST`].
pub(super) const PAUSE: Duration = Duration::from_secs(1);
const LONGEST: Duration = Duration::from_secs(4);
/// Answered so many times in vain, a sample is given up: a server in lock-step waits as
/// long.
pub(super) const TRIES: u32 = 5;
/// Longest wait for an answer of a server in lock-step, which waits too: a picture takes
/// seconds on a slow line.
pub(super) const LOCK_STEP_PATIENCE: Duration = Duration::from_secs(15);
/// Longest wait for an answer of one in real time, whose cache soon forgets what is
/// wanted.
pub(super) const REAL_TIME_PATIENCE: Duration = Duration::from_secs(3);

/// One question.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Question {
    /// How often it was asked; once more than [`TRIES`] is given up.
    tries: u32,
    stage: Stage,
}

#[derive(Clone, Copy, Debug, Default)]
enum Stage {
    #[default]
    New,
    /// Asked then; what is wanted may be under way.
    Asked(Instant),
    /// Answered then.
    Answered(Instant),
}

impl Question {
    /// Whether to ask at `now`.
    pub fn request(&mut self, now: Instant) -> bool {
        let due = match self.stage {
            Stage::New => true,
            // Its answer will not be told any more.
            Stage::Asked(at) => now.saturating_duration_since(at) >= 2 * LOCK_STEP_PATIENCE,
            Stage::Answered(at) => now.saturating_duration_since(at) >= self.pause(),
        };
        if !due || self.is_given_up() {
            return false;
        }
        self.tries += 1;
        self.stage = Stage::Asked(now);
        !self.is_given_up()
    }

    fn pause(&self) -> Duration {
        (PAUSE * 2_u32.saturating_pow(self.tries.saturating_sub(1))).min(LONGEST)
    }

    /// All that the server sends for it has come at `now`, or too late.
    pub fn answered(&mut self, now: Instant) {
        if let Stage::Asked(_) = self.stage {
            self.stage = Stage::Answered(now);
        }
    }

    /// The connection was lost, and with it what was under way: what was not given up is
    /// asked as if for the first time.
    pub fn begin_again(&mut self) {
        if !self.is_given_up() {
            *self = Self::default();
        }
    }

    /// How often it was asked.
    pub fn tries(&self) -> u32 {
        self.tries
    }

    /// Whether it was answered in vain so often that it is asked no more.
    pub fn is_given_up(&self) -> bool {
        self.tries > TRIES
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_question_is_repeated_after_its_answer_and_given_up_after_five() {
        let start = Instant::now();
        let at = |seconds: u32| start + seconds * PAUSE;
        let mut question = Question::default();
        assert!(question.request(start));
        assert!(!question.request(at(20)), "the answer may be under way");
        question.begin_again();
        assert!(question.request(at(20)), "the connection was lost");
        assert_eq!(question.tries(), 1);
        let (mut asked, mut seconds) = (1, 20);
        while !question.is_given_up() {
            question.answered(at(seconds));
            // One that comes twice counts once.
            question.answered(at(seconds + 9));
            while !question.is_given_up() && !question.request(at(seconds)) {
                seconds += 1;
                assert!(seconds < 60, "{question:?}");
            }
            asked += u32::from(!question.is_given_up());
        }
        // Pauses of 1, 2, 4, 4 and 4 s, and the step that shows the last is over.
        assert_eq!((asked, seconds), (TRIES, 36));
        question.begin_again();
        assert!(!question.request(at(1000)));
        let mut forgotten = Question::default();
        assert!(forgotten.request(start));
        assert!(forgotten.request(start + 2 * LOCK_STEP_PATIENCE));
    }
}
