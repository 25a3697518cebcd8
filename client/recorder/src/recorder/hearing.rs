//! In which form the cameras' pictures are heard: compressed once by the server for
//! all recorders, or as they are.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use wheelarm_proto::StreamId;

use super::super::episode::Recording;
use super::super::gaps::Missing;
use super::port::Output;

/// A camera is looked for after this time of the episode without anything of it: the
/// server's cache holds few pictures.
pub const LOOK: Duration = Duration::from_millis(300);
/// Pause after a look that brought pictures; after one that brought none the pause
/// doubles.
const AGAIN: Duration = Duration::from_millis(100);
/// Longest pause.
pub const LONGEST: Duration = Duration::from_secs(5);
/// A camera whose pictures were there as they are for so long and not compressed does
/// not come compressed: a server that is slow for once does not count.
pub const PATIENCE: Duration = Duration::from_secs(2);
/// The same in lock-step: a compressed one may still be under way on a slow line.
const LOCK_STEP_PATIENCE: Duration = Duration::from_secs(10);

/// What is wanted, and what is heard now.
#[derive(Debug, Default)]
pub struct Hearing {
    /// The cameras' pictures are wanted in their compressed form.
    wants: bool,
    /// They are heard in it now.
    hears: bool,
    /// Cameras of which nothing came compressed in this episode, by stream.
    silent: BTreeMap<String, Silence>,
}

/// A camera that is not heard.
#[derive(Debug)]
struct Silence {
    /// When was looked last.
    looked: Instant,
    pause: Duration,
    /// Number that was asked for first then.
    first: u64,
    /// The answer is awaited.
    is_asked: bool,
    /// It was looked for in its compressed form, or need not be.
    is_small_asked: bool,
    /// Since when pictures as they are are there.
    exact: Option<Instant>,
}

/// Pause before the first look. In lock-step time waits and nothing is forgotten: a
/// picture that is under way on a slow line has all the time it needs, while one that is
/// asked for as it is, five times as long, would keep that line.
fn first_pause(recording: &Recording) -> Duration {
    match recording.is_lock_step() {
        true => LONGEST,
        false => LOOK,
    }
}

impl Hearing {
    /// Hears the pictures in the compressed form, or as they are.
    #[must_use]
    pub fn new(compressed: bool) -> Self {
        Self {
            wants: compressed,
            hears: compressed,
            silent: BTreeMap::new(),
        }
    }

    /// An episode begins whose server does or does not compress pictures: what is to
    /// be heard from now on, where it changes.
    pub fn begin(&mut self, offered: bool) -> Option<Output> {
        self.change(self.wants && offered)
    }

    fn change(&mut self, compressed: bool) -> Option<Output> {
        self.silent.clear();
        let changes = self.hears != compressed;
        self.hears = compressed;
        changes.then_some(Output::Hear { compressed })
    }

    /// Asks for the new pictures of cameras of which nothing came compressed as they
    /// are. Where they come so and not compressed, a router, say, lets no compressed
    /// ones through, and all are heard as they are from now on.
    pub fn probe(&mut self, recording: &Recording, now: Instant) -> Vec<Output> {
        // Nothing is published yet: it may wait for other recorders.
        if !self.hears || recording.away.is_some() || !recording.is_under_way() {
            self.silent.clear();
            return Vec::new();
        }
        let still: Vec<String> = recording.silent().collect();
        self.silent.retain(|stream, _| still.contains(stream));
        let mut out = Vec::new();
        for stream in still {
            let next = recording.next(&stream);
            let silence = self.silent.entry(stream.clone()).or_insert(Silence {
                looked: now,
                pause: first_pause(recording),
                first: 0,
                is_asked: false,
                is_small_asked: !recording.is_lock_step(),
                exact: None,
            });
            if next.is_some() {
                let since = *silence.exact.get_or_insert(now);
                let patience = match recording.is_lock_step() {
                    true => LOCK_STEP_PATIENCE,
                    false => PATIENCE,
                };
                if now.saturating_duration_since(since) >= patience {
                    tracing::warn!("pictures do not come compressed; they are taken as they are");
                    self.wants = false;
                    return self.change(false).into_iter().collect();
                }
            }
            let first = next.unwrap_or(0);
            if first > silence.first {
                silence.pause = AGAIN;
            }
            let rests = now.saturating_duration_since(silence.looked) < silence.pause;
            if silence.is_asked || rests {
                continue;
            }
            let small = StreamId::parse(&stream)
                .camera_name()
                .map(StreamId::compressed);
            let asked = match small.filter(|_| !silence.is_small_asked) {
                Some(small) => small.to_string(),
                None => stream,
            };
            *silence = Silence {
                looked: now,
                pause: (2 * silence.pause).min(LONGEST),
                first,
                is_asked: true,
                is_small_asked: true,
                exact: silence.exact,
            };
            out.push(Output::AskSamples {
                missing: Missing::behind(asked, first),
                patience: recording.patience(),
            });
        }
        out
    }

    /// Whether the cameras are heard in their compressed form.
    #[must_use]
    pub fn hears_compressed(&self) -> bool {
        self.hears
    }

    /// A question was answered; whether it was one of these.
    pub fn answered(&mut self, missing: &Missing, now: Instant) -> bool {
        let stream = StreamId::parse(&missing.stream).exact().to_string();
        let silence = self.silent.get_mut(&stream);
        let Some(silence) = silence.filter(|s| s.is_asked && missing.last.is_none()) else {
            return false;
        };
        (silence.is_asked, silence.looked) = (false, now);
        true
    }
}
