//! State hashes of a replay beside the recorded ones.

use std::process::ExitCode;

/// Recorded hashes beside those of the replay.
#[derive(Clone, Debug)]
pub(super) struct Comparison {
    recorded: Vec<(u64, u64)>,
    seen: Vec<(u64, u64)>,
    ticks: usize,
}

impl Comparison {
    /// Compares with `recorded` hashes by tick.
    pub fn with(recorded: Vec<(u64, u64)>) -> Self {
        Self {
            recorded,
            seen: Vec::new(),
            ticks: 0,
        }
    }

    /// A control tick is over.
    pub fn tick(&mut self) {
        self.ticks += 1;
    }

    /// A hash that the replay came to.
    pub fn take(&mut self, tick: u64, hash: u64) {
        self.seen.push((tick, hash));
    }

    /// Number of equal hashes, or the first tick that differs.
    fn outcome(&mut self) -> Result<usize, String> {
        self.seen.sort_unstable();
        self.seen.dedup();
        let mut equal = 0;
        for (tick, hash) in &self.recorded {
            match self.seen.iter().find(|(seen, _)| seen == tick) {
                Some((_, seen)) if seen == hash => equal += 1,
                Some((_, seen)) => {
                    return Err(format!(
                        "differs at tick {tick} ({:.3} s): state hash {seen:016x}, recorded {hash:016x}; {equal} hashes before it are equal",
                        wheelarm_proto::stamp_nanos(*tick) as f64 * 1e-9
                    ));
                }
                None => return Err(format!("no state hash came for tick {tick}")),
            }
        }
        if equal == 0 {
            return Err("the recording holds no state hash that could be compared".to_owned());
        }
        Ok(equal)
    }

    /// What came of it in words; exit code 1 when something differs.
    pub fn report(&mut self) -> (String, ExitCode) {
        let (words, code) = match self.outcome() {
            Ok(equal) => (format!("{equal} hashes equal"), ExitCode::SUCCESS),
            Err(problem) => (problem, ExitCode::FAILURE),
        };
        (format!("replayed {} ticks, {words}", self.ticks), code)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn comparison(seen: &[(u64, u64)]) -> Comparison {
        Comparison {
            recorded: vec![(0, 9), (240, 7), (480, 8)],
            seen: seen.to_vec(),
            ticks: 200,
        }
    }

    #[test]
    fn equal_hashes_are_counted_and_the_first_difference_is_named() {
        assert_eq!(comparison(&[(0, 9), (240, 7), (480, 8)]).outcome(), Ok(3));
        let late = comparison(&[(240, 7), (480, 8)]).outcome();
        assert!(late.unwrap_err().contains("tick 0"));
        let wrong = comparison(&[(0, 9), (240, 6), (480, 5)]).outcome();
        assert!(wrong.unwrap_err().contains("tick 240"));
        let short = comparison(&[(0, 9), (240, 7)]).outcome();
        assert!(short.unwrap_err().contains("tick 480"));
        assert!(comparison(&[]).outcome().is_err());
    }
}
