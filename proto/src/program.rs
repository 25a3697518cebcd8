//! What programs tell the one that started them: the line by which a server says
//! that it serves, and exit codes. People read the rest.

use std::fmt;

/// The first line of a server's standard output, as soon as it serves.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ready {
    /// Where it listens.
    pub endpoint: String,
    /// Its name.
    pub sim: String,
}

impl fmt::Display for Ready {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ready {} sim={}", self.endpoint, self.sim)
    }
}

impl Ready {
    /// Reads the line.
    #[must_use]
    pub fn parse(line: &str) -> Option<Self> {
        let mut words = line.strip_prefix("ready ")?.split_whitespace();
        let endpoint = words.next()?.to_owned();
        let sim = words.next()?.strip_prefix("sim=")?.to_owned();
        Some(Self { endpoint, sim })
    }
}

/// Exit code of a server whose scenario cannot be simulated.
pub const EXIT_SCENARIO: u8 = 4;

/// Exit code of an operator that tried its task and did not do it. Any other
/// failure is not the task's.
pub const EXIT_NOT_DONE: u8 = 5;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_read_as_it_is_written() {
        let ready = Ready {
            endpoint: "tcp/127.0.0.1:7447".to_owned(),
            sim: "sim".to_owned(),
        };
        assert_eq!(Ready::parse(&ready.to_string()), Some(ready));
        assert_eq!(Ready::parse("ready"), None);
    }
}
