//! The recorder's state machine, without a network or a clock: callers pass inputs and
//! the time, and carry out the returned outputs.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use bytes::Bytes;
use wheelarm_dataset::columns::header_of;
use wheelarm_dataset::writer::{WriterOptions, check_free};
use wheelarm_proto::v1;

use self::camera_subscription::CameraSubscription;
pub use self::port::{Input, Output};
use self::prebuffer::Prebuffer;
use super::episode::{Accepted, Made, Recording, id};
use super::gaps::Missing;

mod camera_subscription;
mod ending;
mod port;
mod prebuffer;
mod protocol;
mod status;

/// Longest wait for the next of the samples that the manifest lists.
pub const MANIFEST_PATIENCE: Duration = Duration::from_secs(10);
/// After a link loss a stalled or disconnected server may return with the same episode
/// within this time. Later it counts as gone.
pub const AWAY_PATIENCE: Duration = Duration::from_secs(60);
/// Longest wait for samples in flight of a replaced server.
const FAREWELL_PATIENCE: Duration = Duration::from_secs(2);
/// Pause before the snapshot is requested again.
const SNAPSHOT_RETRY: Duration = Duration::from_secs(2);
/// Longest wait for the snapshot.
const SNAPSHOT_PATIENCE: Duration = Duration::from_secs(30);
/// Pause before the episode state is requested again after a failed request.
const STATE_RETRY: Duration = Duration::from_millis(500);
/// Least pause between a reply and the next request.
const HINT_PAUSE: Duration = Duration::from_millis(20);
/// Episodes whose files may be written at the same time; the next one waits.
const MAX_FINISHING: usize = 2;

/// The state of a recorder.
pub struct Recorder {
    dir: PathBuf,
    options: WriterOptions,
    stage: Stage,
    prebuffer: Prebuffer,
    /// Run and number of the last handled episode.
    last: Option<(String, u64)>,
    /// Announced while the one before was not finished.
    next: Option<Box<v1::EpisodeStarted>>,
    state_query: StateQuery,
    /// Run of the server and number of the newest episode that began here or had ended
    /// before the recorder joined.
    begun: Option<(String, u64)>,
    status: v1::RecorderStatus,
    /// Last status of the episodes whose files are being written.
    finishing: Vec<v1::RecorderStatus>,
    /// Limit of episodes, and the number recorded, lost or in progress.
    limit: Option<u64>,
    counted: u64,
    camera_subscription: CameraSubscription,
    /// Shutdown was requested.
    is_ending: bool,
    out: Vec<Output>,
}

/// The request for the episode state: one at a time, so that replies cannot overtake each
/// other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum StateQuery {
    Idle,
    /// The reply is pending.
    Pending,
    /// Pending, and a hint arrived since: it is sent again.
    PendingAgain,
    /// It is sent again at this time.
    RetryAt(Instant),
}

enum Stage {
    Idle,
    /// Waiting for the snapshot.
    Opening {
        started: Box<v1::EpisodeStarted>,
        since: Instant,
        requested: Instant,
        stopped: Option<Box<v1::EpisodeStopped>>,
    },
    Recording(Box<Recording>),
    /// Ended; samples in flight may still arrive.
    Stopping {
        recording: Box<Recording>,
        stopped: Option<Box<v1::EpisodeStopped>>,
        deadline: Instant,
        /// Number of samples at the last check.
        samples: u64,
        /// Why it ends without a manifest.
        reason: &'static str,
    },
}

/// The server neither runs the episode nor lists its end.
const END_LOST: &str = "the server reports no end of the episode";
/// The server or the link to it is lost.
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
            prebuffer: Prebuffer::default(),
            last: None,
            next: None,
            state_query: StateQuery::Idle,
            begun: None,
            status,
            finishing: Vec::new(),
            limit: None,
            counted: 0,
            camera_subscription: CameraSubscription::default(),
            is_ending: false,
            out: Vec::new(),
        }
    }

    /// Starts with the images that the server compresses once for all recorders, or with
    /// exact ones; [`Output::SubscribeCameras`] changes it.
    #[must_use]
    pub fn with_compressed(mut self, compressed: bool) -> Self {
        self.camera_subscription = CameraSubscription::new(compressed);
        self
    }

    /// Records at most `limit` episodes; discarded ones do not count.
    #[must_use]
    pub fn with_limit(mut self, limit: Option<u64>) -> Self {
        self.limit = limit;
        self
    }

    /// Whether the file of every ended episode is written.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.finishing.is_empty()
    }

    /// The newest status.
    #[must_use]
    pub fn status(&self) -> &v1::RecorderStatus {
        &self.status
    }

    /// Handles one input.
    pub fn handle(&mut self, input: Input, now: Instant) -> Vec<Output> {
        match input {
            Input::Hint => self.request_state(),
            Input::State(reply) => self.episode_state(reply, now),
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

    /// Call after a batch of inputs: passes them to the log and publishes the credit.
    pub fn flush(&mut self) -> Vec<Output> {
        if let Stage::Recording(recording) | Stage::Stopping { recording, .. } = &mut self.stage {
            recording.flush();
        }
        if self.has_new_credit() {
            self.publish();
        }
        std::mem::take(&mut self.out)
    }

    /// Checks deadlines and repeats requests; call periodically.
    pub fn tick(&mut self, now: Instant) -> Vec<Output> {
        if matches!(self.state_query, StateQuery::RetryAt(time) if now >= time) {
            self.state_query = StateQuery::Idle;
            self.request_state();
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
        if let Stage::Opening {
            since, requested, ..
        } = &mut self.stage
        {
            if now.duration_since(*since) > SNAPSHOT_PATIENCE {
                self.fail("the server did not answer the query `snapshot`, without which an episode cannot be replayed".into());
            } else if now.duration_since(*requested) > SNAPSHOT_RETRY {
                *requested = now;
                self.out.push(Output::RequestSnapshot);
            }
        }
        if let Stage::Recording(recording) = &self.stage {
            self.out
                .extend(self.camera_subscription.probe(recording, now));
        }
        let receives_compressed = self.camera_subscription.is_compressed();
        let (recording, stopped) = match &mut self.stage {
            Stage::Recording(recording) if recording.away.is_none() => (Some(recording), None),
            Stage::Stopping {
                recording, stopped, ..
            } => (Some(recording), stopped.as_deref()),
            _ => (None, None),
        };
        if let Some(recording) = recording {
            let patience = recording.patience();
            let wanted = recording
                .wanted(stopped, receives_compressed, now)
                .into_iter();
            let requests = wanted.map(|missing| Output::RequestSamples { missing, patience });
            self.out.extend(requests);
        }
        // Given-up samples no longer hold back the credit.
        if self.has_new_credit() {
            self.publish();
        }
        self.settle(now);
        std::mem::take(&mut self.out)
    }

    /// Run and number of the current episode.
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
        // Every reply repeats it.
        let not_new = |known: &(String, u64)| known.0 == new.0 && known.1 >= new.1;
        if self.current().is_some_and(|c| not_new(&c)) || self.last.as_ref().is_some_and(not_new) {
            return;
        }
        // Its images may still be in flight: they have a lower priority than the
        // announcement of the next episode, which waits for us.
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
                    self.report_too_busy(&former);
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
            .extend(self.camera_subscription.begin(started.compressed_cameras));
        let free = check_free(&self.dir, self.options.scratch.as_deref(), &started.label);
        self.stage = Stage::Opening {
            started: Box::new(started),
            since: now,
            requested: now,
            stopped: None,
        };
        if let Err(problem) = free {
            // Reported at once, so that the server does not wait for this recorder.
            self.fail_existing(&problem);
            return;
        }
        self.out.push(Output::RequestSnapshot);
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
                for (header, stream, payload) in self.prebuffer.take() {
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
                tracing::warn!("cannot decode a sample of {stream}: {problem}");
                return;
            }
        };
        let of = (header.run_id.clone(), header.episode);
        let current = self.current();
        // A cached sample of an earlier episode of this server.
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
            _ if self.last.as_ref() != Some(&of) => self.prebuffer.keep(header, stream, payload),
            _ => {}
        }
    }

    /// Records a sample of the current episode; skips others.
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
            Ok(Accepted::State | Accepted::Skipped) => {}
            Err(words) => {
                let words = recording.failed(&words);
                self.fail(words);
            }
        }
    }

    /// A request for samples is answered.
    fn answered(&mut self, missing: &Missing, now: Instant) {
        if self.camera_subscription.answered(missing, now) {
            return;
        }
        if let Stage::Recording(recording) | Stage::Stopping { recording, .. } = &mut self.stage {
            recording.answered(missing, now);
        }
    }

    /// Episodes follow faster than their files can be written.
    fn report_too_busy(&mut self, started: &v1::EpisodeStarted) {
        self.prebuffer.forget(Some(&id(started.header.as_ref())));
        self.out.push(Output::Failed(format!(
            "episode {:?} ended while the files of {MAX_FINISHING} earlier ones were still being written; it is not recorded",
            started.label
        )));
    }
}

#[cfg(test)]
mod tests;
