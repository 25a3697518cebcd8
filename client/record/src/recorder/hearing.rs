//! In which form the cameras' pictures are heard: compressed once by the server for
//! all recorders, or as they are.

use std::time::{Duration, Instant};

use super::super::episode::Recording;
use super::super::gaps::Missing;
use super::port::Output;

/// How often is looked at first for cameras of which nothing came compressed: the
/// server's cache holds few pictures.
pub const LOOK: Duration = Duration::from_millis(100);
/// So long it is looked so often, afterwards as often as this.
pub const PROBE_PERIOD: Duration = Duration::from_secs(5);
/// A camera whose pictures were there as they are for so long and not compressed does
/// not come compressed: a server that is slow for once does not count.
pub const PATIENCE: Duration = Duration::from_secs(2);

/// What is wanted, and what is heard now.
#[derive(Debug, Default)]
pub struct Hearing {
    /// The cameras' pictures are wanted in their compressed form.
    wants: bool,
    /// They are heard in it now.
    hears: bool,
    /// There are cameras of which nothing came compressed.
    silence: Option<Silence>,
}

/// Cameras that are not heard.
#[derive(Debug)]
struct Silence {
    since: Instant,
    /// When was looked last.
    looked: Instant,
    /// Since when one of them has pictures as they are.
    exact: Option<Instant>,
}

impl Hearing {
    /// Hears the pictures in the compressed form, or as they are.
    #[must_use]
    pub fn new(compressed: bool) -> Self {
        Self {
            wants: compressed,
            hears: compressed,
            silence: None,
        }
    }

    /// An episode begins whose server does or does not compress pictures: what is to
    /// be heard from now on, where it changes.
    pub fn begin(&mut self, offered: bool) -> Option<Output> {
        self.change(self.wants && offered)
    }

    fn change(&mut self, compressed: bool) -> Option<Output> {
        self.silence = None;
        let changes = self.hears != compressed;
        self.hears = compressed;
        changes.then_some(Output::Hear { compressed })
    }

    /// Asks for the new pictures of cameras of which nothing came compressed as they
    /// are. Where they come so and not compressed, a router, say, lets no compressed
    /// ones through, and all are heard as they are from now on.
    pub fn probe(&mut self, recording: &Recording, now: Instant) -> Vec<Output> {
        // Nothing may be published yet: it may wait for other recorders.
        let waits = recording.away.is_some() || recording.newest.is_none();
        let silent: Vec<String> = match self.hears && !waits {
            true => recording.silent().collect(),
            false => Vec::new(),
        };
        if silent.is_empty() {
            self.silence = None;
            return Vec::new();
        }
        let silence = self.silence.get_or_insert(Silence {
            since: now,
            looked: now,
            exact: None,
        });
        let next = |stream: &String| recording.next(stream);
        if silent.iter().any(|stream| next(stream).is_some()) {
            let since = *silence.exact.get_or_insert(now);
            if now.saturating_duration_since(since) >= PATIENCE {
                tracing::warn!("pictures do not come compressed; they are taken as they are");
                self.wants = false;
                return self.change(false).into_iter().collect();
            }
        }
        let is_young = now.saturating_duration_since(silence.since) < PROBE_PERIOD;
        let pause = if is_young { LOOK } else { PROBE_PERIOD };
        if now.saturating_duration_since(silence.looked) < pause {
            return Vec::new();
        }
        silence.looked = now;
        let ask = |stream: String| {
            Output::AskSamples(Missing {
                first: next(&stream).unwrap_or(0),
                stream,
                // The transport's numbers wrap: half of them is all that lie ahead.
                last: u64::from(u32::MAX / 2),
            })
        };
        silent.into_iter().map(ask).collect()
    }
}
