//! The log of a program, on standard error. Its rate is limited: a repeated fault, a
//! clock step or a flood must not fill a disk.

use std::collections::HashMap;
use std::io::Write;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use tracing::callsite::Identifier;
use tracing::{Metadata, level_filters::LevelFilter};
use tracing_subscriber::filter::{DynFilterFn, EnvFilter, FilterExt};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{Layer, Registry};

/// Lines per place in the code within [`PERIOD`].
const LINES: u32 = 100;
/// The period in which lines are counted.
const PERIOD: Duration = Duration::from_secs(10);

/// Starts the log. `default` is the filter without `RUST_LOG`; `writer` creates the
/// output.
pub fn start<W>(default: &str, ansi: bool, writer: W)
where
    W: for<'a> tracing_subscriber::fmt::MakeWriter<'a> + Send + Sync + 'static,
{
    let named = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(default));
    let limit = Mutex::new(Limit::default());
    let bounded = DynFilterFn::new(move |metadata: &Metadata<'_>, _: &_| {
        if !metadata.is_event() {
            return true;
        }
        let verdict = match limit.lock() {
            Ok(mut limit) => limit.take(metadata.callsite(), Instant::now()),
            Err(_) => Verdict::Write { left_out: 0 },
        };
        // Not through the log, which is running here. A closed output must not end the
        // program.
        let mut output = std::io::stderr();
        let target = metadata.target();
        let _ = match verdict {
            Verdict::Write { left_out: 0 } | Verdict::LeaveOut { first: false } => Ok(()),
            Verdict::Write { left_out } => {
                writeln!(output, "{left_out} lines of {target} were omitted")
            }
            Verdict::LeaveOut { first: true } => writeln!(
                output,
                "{target} repeats itself: further lines of this kind are omitted for {} s",
                PERIOD.as_secs()
            ),
        };
        matches!(verdict, Verdict::Write { .. })
    })
    .with_max_level_hint(LevelFilter::TRACE);
    let lines = tracing_subscriber::fmt::layer::<Registry>()
        .with_ansi(ansi)
        .with_writer(writer)
        .with_filter(named.and(bounded));
    tracing_subscriber::registry().with(lines).init();
}

/// Decision about a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    /// Write it; `left_out` similar lines were omitted before.
    Write { left_out: u64 },
    /// Omit it, as the first one of its period or a later one.
    LeaveOut { first: bool },
}

/// Lines of every place in the code, counted per period.
#[derive(Debug)]
struct Limit<K = Identifier> {
    places: HashMap<K, Count>,
}

#[derive(Clone, Copy, Debug)]
struct Count {
    since: Instant,
    lines: u64,
}

impl<K> Default for Limit<K> {
    fn default() -> Self {
        Self {
            places: HashMap::new(),
        }
    }
}

impl<K: std::hash::Hash + Eq> Limit<K> {
    fn take(&mut self, place: K, now: Instant) -> Verdict {
        let new = Count {
            since: now,
            lines: 0,
        };
        let count = self.places.entry(place).or_insert(new);
        let limit = u64::from(LINES);
        let mut left_out = 0;
        if now.saturating_duration_since(count.since) >= PERIOD {
            left_out = count.lines.saturating_sub(limit);
            *count = new;
        }
        count.lines += 1;
        match count.lines <= limit {
            true => Verdict::Write { left_out },
            false => Verdict::LeaveOut {
                first: count.lines == limit + 1,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_applies_to_each_place_in_the_code() {
        let mut limit = Limit::default();
        let begin = Instant::now();
        let flood = 10 * u64::from(LINES);
        let written = (0..flood)
            .filter(|_| matches!(limit.take("a", begin), Verdict::Write { .. }))
            .count();
        assert_eq!(written, LINES as usize);
        assert_eq!(limit.take("b", begin), Verdict::Write { left_out: 0 });
        let later = begin + PERIOD;
        let left_out = flood - u64::from(LINES);
        assert_eq!(limit.take("a", later), Verdict::Write { left_out });
        assert_eq!(limit.take("a", later), Verdict::Write { left_out: 0 });
        let notices = (0..flood)
            .filter(|_| limit.take("a", later) == Verdict::LeaveOut { first: true })
            .count();
        assert_eq!(notices, 1, "logged once per period");
    }
}
