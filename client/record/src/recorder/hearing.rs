//! In which form the cameras' pictures are heard: compressed once by the server for
//! all recorders, or as they are.

use std::time::{Duration, Instant};

use super::super::episode::Recording;
use super::super::gaps::Missing;
use super::port::Output;

/// How often is looked for cameras of which nothing came compressed.
pub const PROBE_PERIOD: Duration = Duration::from_secs(5);

/// What is wanted, and what is heard now.
#[derive(Debug, Default)]
pub struct Hearing {
    /// The cameras' pictures are wanted in their compressed form.
    wants: bool,
    /// They are heard in it now.
    hears: bool,
    /// When was looked last for cameras that do not come compressed.
    probed: Option<Instant>,
}

impl Hearing {
    /// Hears the pictures in the compressed form, or as they are.
    #[must_use]
    pub fn new(compressed: bool) -> Self {
        Self {
            wants: compressed,
            hears: compressed,
            probed: None,
        }
    }

    /// An episode begins whose server does or does not compress pictures: what is to
    /// be heard from now on, where it changes.
    pub fn begin(&mut self, offered: bool) -> Option<Output> {
        self.change(self.wants && offered)
    }

    fn change(&mut self, compressed: bool) -> Option<Output> {
        self.probed = None;
        let changes = self.hears != compressed;
        self.hears = compressed;
        changes.then_some(Output::Hear { compressed })
    }

    /// Asks for pictures of cameras of which nothing came compressed as they are: one
    /// that comes shows that a router, say, lets no compressed ones through.
    pub fn probe(&mut self, recording: &Recording, now: Instant) -> Vec<Output> {
        // Nothing may be published yet: it may wait for other recorders.
        if !self.hears || recording.away.is_some() || recording.newest.is_none() {
            self.probed = None;
            return Vec::new();
        }
        let since = *self.probed.get_or_insert(now);
        if now.saturating_duration_since(since) < PROBE_PERIOD {
            return Vec::new();
        }
        self.probed = Some(now);
        let ask = |stream| {
            Output::AskSamples(Missing {
                stream,
                first: 0,
                // The transport's numbers wrap: half of them is all that lie ahead.
                last: u64::from(u32::MAX / 2),
            })
        };
        recording.silent().map(ask).collect()
    }

    /// A picture came as it is: of a camera of which nothing came compressed all are
    /// heard so from now on.
    pub fn came_exact(&mut self, recording: &Recording, stream: &str) -> Option<Output> {
        if !self.hears || recording.silent().all(|silent| silent != stream) {
            return None;
        }
        tracing::warn!("pictures do not come compressed; they are taken as they are");
        self.wants = false;
        self.change(false)
    }
}
