//! Rejected commands that wait for their reply. A flood is not amplified: some are
//! answered one by one, the rest by one summary per second.

use super::command_gate::{Bucket, Refused};

/// Rejections answered one by one: per second, and burst.
const ANSWERED: (f64, f64) = (20.0, 64.0);

/// Interval between two summaries, s.
const SUMMARY_SECS: f64 = 1.0;

/// Longest reason, characters.
const LONGEST: usize = 512;

/// A rejection to publish, with the number of commands it covers.
pub type Answer = (Refused, u64);

/// Rejections that wait to be published.
#[derive(Debug)]
pub struct Refusals {
    bucket: Bucket,
    waiting: Vec<Answer>,
    /// The newest rejection not answered individually, and their number.
    withheld: Option<Answer>,
    summed: f64,
}

impl Default for Refusals {
    fn default() -> Self {
        Self {
            bucket: Bucket::new(ANSWERED.0, ANSWERED.1),
            waiting: Vec::new(),
            withheld: None,
            summed: 0.0,
        }
    }
}

impl Refusals {
    /// Adds a rejection; `now` in seconds of a monotonic clock.
    pub fn push(&mut self, mut refused: Refused, now: f64) {
        // The reason may contain text of the sender.
        if let Some((end, _)) = refused.reason.char_indices().nth(LONGEST) {
            refused.reason.truncate(end);
            refused.reason.push('…');
        }
        if self.bucket.take(now) {
            self.waiting.push((refused, 1));
        } else {
            let before = self.withheld.as_ref().map_or(0, |(_, count)| *count);
            self.withheld = Some((refused, before + 1));
        }
    }

    /// Rejections to publish at `now`.
    pub fn take(&mut self, now: f64) -> Vec<Answer> {
        let mut answers = std::mem::take(&mut self.waiting);
        if now - self.summed >= SUMMARY_SECS
            && let Some(summary) = self.withheld.take()
        {
            self.summed = now;
            answers.push(summary);
        }
        answers
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheelarm_proto::v1::RefusalCode;

    #[test]
    fn every_refusal_is_reported_and_a_flood_is_summarized() {
        let mut refusals = Refusals::default();
        let (mut answers, mut reported) = (0, 0);
        let mut take = |refusals: &mut Refusals, now| {
            for (_, count) in refusals.take(now) {
                answers += 1;
                reported += count;
            }
        };
        let mut sent = 0;
        for tick in 0..180 {
            let now = 5.0 + f64::from(tick) / 60.0;
            for _ in 0..1000 {
                sent += 1;
                let refused = Refused {
                    commander: "flood".into(),
                    sequence: sent,
                    code: RefusalCode::Rate,
                    reason: "too many".into(),
                };
                refusals.push(refused, now);
            }
            take(&mut refusals, now);
        }
        take(&mut refusals, 20.0);
        assert_eq!(reported, sent);
        assert!(answers < 64 + 3 * 20 + 6, "{answers} answers");
    }
}
