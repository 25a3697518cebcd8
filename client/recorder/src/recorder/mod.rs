//! What a recorder does with every message, without a network and without a
//! clock of its own: inputs and the time go in, outputs come out.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use bytes::Bytes;
use wheelarm_dataset::columns::header_of;
use wheelarm_dataset::writer::{WriterOptions, check_free};
use wheelarm_proto::v1;

use self::early::Early;
use self::hearing::Hearing;
pub use self::port::{Input, Output};
use super::episode::{Accepted, Made, Recording, id};
use super::gaps::Missing;

mod early;
mod ending;
mod hearing;
mod port;
mod protocol;
mod telling;

/// Longest wait for the next of the samples that the manifest lists.
pub const MANIFEST_PATIENCE: Duration = Duration::from_secs(10);
/// A server that is away may come back with the same episode: one that stood
/// still, or one behind a link that broke. Afterwards it is taken for gone.
pub const AWAY_PATIENCE: Duration = Duration::from_secs(60);
/// Longest wait for what a server that was replaced had sent.
const FAREWELL_PATIENCE: Duration = Duration::from_secs(2);
/// Pause before the snapshot is asked for again.
const SNAPSHOT_RETRY: Duration = Duration::from_secs(2);
/// Longest wait for the snapshot.
const SNAPSHOT_PATIENCE: Duration = Duration::from_secs(30);
/// Pause before the state is asked for again when there was no answer.
const STATE_RETRY: Duration = Duration::from_millis(500);
/// Least pause between an answer and the next question.
const HINT_PAUSE: Duration = Duration::from_millis(20);
/// Episodes that may be made into files at the same time; the next one waits.
const MAX_FINISHING: usize = 2;

/// The state of a recorder.
pub struct Recorder {
    dir: PathBuf,
    options: WriterOptions,
    stage: Stage,
    early: Early,
    /// Run and number of the episode that was dealt with last.
    last: Option<(String, u64)>,
    /// Announced while the one before was not finished.
    next: Option<Box<v1::EpisodeStarted>>,
    asking: Asking,
    /// Run of the server and number of the newest episode that was begun here,
    /// or was over when the recorder came.
    begun: Option<(String, u64)>,
    status: v1::RecorderStatus,
    /// Last status of the episodes that are being made into files.
    finishing: Vec<v1::RecorderStatus>,
    /// Episodes to record, and how many are recorded, lost or under way.
    limit: Option<u64>,
    counted: u64,
    hearing: Hearing,
    /// It was told to end.
    is_ending: bool,
    out: Vec<Output>,
}

/// Whether the server is being asked what it runs: one question at a time, so
/// that answers cannot overtake each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Asking {
    No,
    /// The answer is awaited.
    Yes,
    /// Something happened since it was asked: it will be asked again.
    Again,
    /// There was no answer; it is asked again at this time.
    At(Instant),
}

enum Stage {
    Idle,
    /// Waiting for the snapshot.
    Opening {
        started: Box<v1::EpisodeStarted>,
        since: Instant,
        asked: Instant,
        stopped: Option<Box<v1::EpisodeStopped>>,
    },
    Recording(Box<Recording>),
    /// The end was told; samples that are still under way may come.
    Stopping {
        recording: Box<Recording>,
        stopped: Option<Box<v1::EpisodeStopped>>,
        deadline: Instant,
        /// Samples at the last look.
        samples: u64,
        /// Why it ends without a manifest.
        reason: &'static str,
    },
}

/// The server says that it does not run the episode any more.
const END_LOST: &str = "the end of the episode was not told";
/// The server, or the way to it, is gone.
const SERVER_LOST: &str = "the server went away before the episode ended";

impl Recorder {
    /// A recorder that writes into `dir`.
    #[must_use]
    pub fn new(dir: PathBuf, options: WriterOptions) -> Self {
        let status = v1::RecorderStatus {
            header: Some(v1::Header::default()),
            recorder: options.recorder.clone(),
            state: v1::RecorderState::Idle.into(),
            ..Default::default()
        };
        Self {
            dir,
            options,
            stage: Stage::Idle,
            early: Early::default(),
            last: None,
            next: None,
            asking: Asking::No,
            begun: None,
            status,
            finishing: Vec::new(),
            limit: None,
            counted: 0,
            hearing: Hearing::default(),
            is_ending: false,
            out: Vec::new(),
        }
    }

    /// Hears the cameras' pictures in the form that the server compresses once for
    /// all recorders; [`Output::Hear`] says where they come as they are.
    #[must_use]
    pub fn with_compressed(mut self, compressed: bool) -> Self {
        self.hearing = Hearing::new(compressed);
        self
    }

    /// Records at most `limit` episodes; discarded ones do not count.
    #[must_use]
    pub fn with_limit(mut self, limit: Option<u64>) -> Self {
        self.limit = limit;
        self
    }

    /// Whether no episode is still to be made into its file.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.finishing.is_empty()
    }

    /// The newest status.
    #[must_use]
    pub fn status(&self) -> &v1::RecorderStatus {
        &self.status
    }

    /// Takes one input.
    pub fn handle(&mut self, input: Input, now: Instant) -> Vec<Output> {
        match input {
            Input::Hint => self.request(),
            Input::State(reply) => self.told(reply, now),
            Input::Snapshot(reply) => self.snapshot(reply, now),
            Input::Sample { stream, payload } => self.sample(stream, payload),
            Input::Answered(missing) => self.answered(&missing, now),
            Input::ServerLost => self.server_lost(now),
            Input::Done(Made { of, result }) => self.done(&of, result, now),
            Input::Shutdown => self.shut_down(),
        }
        self.settle(now);
        std::mem::take(&mut self.out)
    }

    /// After inputs that came together: hands them to the log, and tells the credit.
    pub fn flush(&mut self) -> Vec<Output> {
        if let Stage::Recording(recording) | Stage::Stopping { recording, .. } = &mut self.stage {
            recording.flush();
        }
        if self.has_new_credit() {
            self.publish();
        }
        std::mem::take(&mut self.out)
    }

    /// Lets time pass: deadlines and repeated questions.
    pub fn tick(&mut self, now: Instant) -> Vec<Output> {
        if matches!(self.asking, Asking::At(time) if now >= time) {
            self.asking = Asking::No;
            self.request();
        }
        if let Stage::Recording(recording) = &self.stage
            && let Some(since) = recording.away
            && now.duration_since(since) > AWAY_PATIENCE
        {
            self.end(SERVER_LOST);
        }
        // A full disk or a removed log is reported at once, and not with the next sample.
        let failure = match &self.stage {
            Stage::Recording(recording) | Stage::Stopping { recording, .. } => recording.failure(),
            _ => None,
        };
        if let Some(words) = failure {
            self.fail(words);
        }
        if let Stage::Opening { since, asked, .. } = &mut self.stage {
            if now.duration_since(*since) > SNAPSHOT_PATIENCE {
                self.fail("the server did not answer the query `snapshot`, without which an episode cannot be replayed".into());
            } else if now.duration_since(*asked) > SNAPSHOT_RETRY {
                *asked = now;
                self.out.push(Output::AskSnapshot);
            }
        }
        if let Stage::Recording(recording) = &self.stage {
            self.out.extend(self.hearing.probe(recording, now));
        }
        let hears_compressed = self.hearing.hears_compressed();
        let (recording, stopped) = match &mut self.stage {
            Stage::Recording(recording) if recording.away.is_none() => (Some(recording), None),
            Stage::Stopping {
                recording, stopped, ..
            } => (Some(recording), stopped.as_deref()),
            _ => (None, None),
        };
        if let Some(recording) = recording {
            let patience = recording.patience();
            let wanted = recording.wanted(stopped, hears_compressed, now).into_iter();
            let asked = wanted.map(|missing| Output::AskSamples { missing, patience });
            self.out.extend(asked);
        }
        // What is given up holds nobody up any more.
        if self.has_new_credit() {
            self.publish();
        }
        self.settle(now);
        std::mem::take(&mut self.out)
    }

    /// Run and number of the episode at hand.
    fn current(&self) -> Option<(String, u64)> {
        let started = match &self.stage {
            Stage::Idle => return None,
            Stage::Opening { started, .. } => started,
            Stage::Recording(r) | Stage::Stopping { recording: r, .. } => &r.started,
        };
        Some(id(started.header.as_ref()))
    }

    fn started(&mut self, started: v1::EpisodeStarted, now: Instant) {
        let new = id(started.header.as_ref());
        // Every answer tells it again.
        let not_new = |known: &(String, u64)| known.0 == new.0 && known.1 >= new.1;
        if self.current().is_some_and(|c| not_new(&c)) || self.last.as_ref().is_some_and(not_new) {
            return;
        }
        // Its pictures may still be under way, for they have a lower priority
        // than the announcement of the next episode, which waits for us.
        let busy = self.finishing.len() >= MAX_FINISHING;
        let under_way = matches!(
            &self.stage,
            Stage::Stopping {
                stopped: Some(_),
                ..
            }
        );
        if under_way || busy {
            if let Some(former) = self.next.replace(Box::new(started)) {
                let new = self.next.as_ref().map(|n| id(n.header.as_ref()));
                if Some(id(former.header.as_ref())) != new {
                    self.too_busy(&former);
                }
            }
            return;
        }
        if started.practice {
            self.last = Some(new);
            return;
        }
        if self.is_ending || self.limit.is_some_and(|limit| self.counted >= limit) {
            return;
        }
        self.give_up_opening();
        self.end(END_LOST);
        self.status = v1::RecorderStatus {
            header: started.header.clone(),
            recorder: self.options.recorder.clone(),
            state: v1::RecorderState::Idle.into(),
            ..Default::default()
        };
        self.out
            .extend(self.hearing.begin(started.compressed_cameras));
        let free = check_free(&self.dir, self.options.scratch.as_deref(), &started.label);
        self.stage = Stage::Opening {
            started: Box::new(started),
            since: now,
            asked: now,
            stopped: None,
        };
        if let Err(problem) = free {
            // Told at once, so that nobody waits for a snapshot in vain.
            self.fail_taken(&problem);
            return;
        }
        self.out.push(Output::AskSnapshot);
    }

    fn snapshot(&mut self, reply: Result<v1::SnapshotReply, String>, now: Instant) {
        let Stage::Opening { started, .. } = &self.stage else {
            return;
        };
        let reply = match reply {
            Ok(reply) => reply,
            Err(words) => {
                tracing::debug!("no snapshot yet: {words}");
                self.too_late_to_open();
                return;
            }
        };
        let (wanted, got) = (id(started.header.as_ref()), id(reply.header.as_ref()));
        if wanted != got {
            tracing::debug!("the snapshot is of episode {}, wanted {}", got.1, wanted.1);
            self.too_late_to_open();
            return;
        }
        let Stage::Opening {
            started, stopped, ..
        } = std::mem::replace(&mut self.stage, Stage::Idle)
        else {
            return;
        };
        let label = started.label.clone();
        match Recording::open(&self.dir, *started, &reply, &self.options) {
            Ok(recording) => {
                self.status.state = v1::RecorderState::Ready.into();
                self.stage = Stage::Recording(Box::new(recording));
                self.publish();
                for (header, stream, payload) in self.early.take() {
                    self.take(&header, &stream, payload);
                }
                if let Some(stopped) = stopped {
                    self.stopped(&stopped, now);
                }
            }
            Err(problem) => {
                self.last = Some(wanted);
                self.fail_with(format!("episode {label:?}: {problem}"));
            }
        }
    }

    fn sample(&mut self, stream: String, payload: Bytes) {
        let header = match header_of(&payload) {
            Ok(header) => header,
            Err(problem) => {
                tracing::warn!("a sample of {stream} cannot be read: {problem}");
                return;
            }
        };
        let of = (header.run_id.clone(), header.episode);
        let current = self.current();
        // What a cache still has of an earlier episode of this server.
        if current.as_ref().is_some_and(|c| c.0 == of.0 && c.1 > of.1) {
            if let Stage::Recording(recording) | Stage::Stopping { recording, .. } = &mut self.stage
            {
                recording.is_older(&stream, header.sequence);
            }
            return;
        }
        if header.episode == 0 {
            return;
        }
        match &self.stage {
            Stage::Recording(_) | Stage::Stopping { .. } if current.as_ref() == Some(&of) => {
                self.take(&header, &stream, payload);
            }
            // Streams have different priorities: samples may overtake the
            // message that opens their episode.
            _ if self.last.as_ref() != Some(&of) => self.early.keep(header, stream, payload),
            _ => {}
        }
    }

    /// Takes a sample of the episode at hand; those of others are left out.
    fn take(&mut self, header: &v1::Header, stream: &str, payload: Bytes) {
        if self.current() != Some(id(Some(header))) {
            return;
        }
        let (Stage::Recording(recording) | Stage::Stopping { recording, .. }) = &mut self.stage
        else {
            return;
        };
        match recording.take(stream, header.sequence, payload) {
            Ok(Accepted::Frame) => self.publish(),
            Ok(Accepted::State | Accepted::Not) => {}
            Err(words) => {
                let words = recording.failed(&words);
                self.fail(words);
            }
        }
    }

    /// A question for samples is answered.
    fn answered(&mut self, missing: &Missing, now: Instant) {
        if self.hearing.answered(missing, now) {
            return;
        }
        if let Stage::Recording(recording) | Stage::Stopping { recording, .. } = &mut self.stage {
            recording.answered(missing, now);
        }
    }

    /// Episodes come faster than their files can be made.
    fn too_busy(&mut self, started: &v1::EpisodeStarted) {
        self.early.forget(Some(&id(started.header.as_ref())));
        self.out.push(Output::Failed(format!(
            "episode {:?} ended while {MAX_FINISHING} earlier ones were still being made into files; it is not recorded",
            started.label
        )));
    }
}

#[cfg(test)]
mod tests;
