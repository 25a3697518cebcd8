//! State hashes of a replay beside the recorded ones.

/// Recorded state hashes beside those of the replay.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    recorded: Vec<(u64, u64)>,
    states: Vec<(u64, u64)>,
    ticks: usize,
}

impl Comparison {
    /// Compares with `recorded` hashes by tick.
    #[must_use]
    pub fn with(recorded: Vec<(u64, u64)>) -> Self {
        Self {
            recorded,
            states: Vec::new(),
            ticks: 0,
        }
    }

    /// Adds a hash of the replay.
    pub fn insert(&mut self, tick: u64, hash: u64) {
        if !self.states.contains(&(tick, hash)) {
            self.states.push((tick, hash));
        }
    }

    /// Counts a replayed control tick.
    pub fn count_tick(&mut self) {
        self.ticks += 1;
    }

    /// The newest hash of the replay.
    #[must_use]
    pub fn newest(&self) -> Option<u64> {
        self.states.iter().max().map(|(_, hash)| *hash)
    }

    /// Control ticks that were replayed.
    #[must_use]
    pub fn ticks(&self) -> usize {
        self.ticks
    }

    /// Number of equal hashes.
    ///
    /// # Errors
    /// The first tick whose hash differs or is missing.
    pub fn equal_hashes(&self) -> Result<usize, String> {
        let mut equal = 0;
        for (tick, hash) in &self.recorded {
            match self.states.iter().find(|(at, _)| at == tick) {
                Some((_, found)) if found == hash => equal += 1,
                Some((_, found)) => {
                    return Err(format!(
                        "differs at tick {tick} ({:.3} s): state hash {found:016x}, recorded {hash:016x}; {equal} hashes before it are equal",
                        wheelarm_proto::stamp_nanos(*tick) as f64 * 1e-9
                    ));
                }
                None => return Err(format!("no state hash arrived for tick {tick}")),
            }
        }
        if equal == 0 {
            return Err("the recording contains no state hash to compare".to_owned());
        }
        Ok(equal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn comparison(states: &[(u64, u64)]) -> Comparison {
        Comparison {
            recorded: vec![(0, 9), (240, 7), (480, 8)],
            states: states.to_vec(),
            ticks: 200,
        }
    }

    #[test]
    fn equal_hashes_are_counted_and_the_first_difference_is_named() {
        let equal = comparison(&[(0, 9), (240, 7), (480, 8)]).equal_hashes();
        assert_eq!(equal, Ok(3));
        let late = comparison(&[(240, 7), (480, 8)]).equal_hashes();
        assert!(late.unwrap_err().contains("tick 0"));
        let wrong = comparison(&[(0, 9), (240, 6), (480, 5)]).equal_hashes();
        assert!(wrong.unwrap_err().contains("tick 240"));
        let short = comparison(&[(0, 9), (240, 7)]).equal_hashes();
        assert!(short.unwrap_err().contains("tick 480"));
        assert!(comparison(&[]).equal_hashes().is_err());
    }
}
