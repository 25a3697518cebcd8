//! The simulation thread: waits for what the pacing asks for, steps, publishes.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use wheelarm_proto::keys::Query;
use wheelarm_proto::{check, names, v1};

use super::episode::{Episode, Stage};
use super::errand::Errand;
use super::inbox::Listening;
use super::pace::Pace;
use super::render::RenderThread;
use super::waiting::Waiting;
use super::{Options, ServiceError, Shared, answer, convert, lock, publish};
use crate::sim::{Pacing, Simulation};
use crate::snapshot::{Anomaly, BodyRef, Snapshot};

/// Pictures that may be published beyond what the slowest recorder accepted.
/// The transport's cache holds as many of each camera.
pub(super) const CREDIT_WINDOW: u64 = 8;

/// How long an announced episode waits for recorders that are not there, s.
const ABSENT_SECS: u64 = 30;

/// How long it waits for recorders that are there, but still finish files, s.
const PRESENT_SECS: u64 = 120;

/// How long a server that ends waits for its recorders to get the rest, s.
const FAREWELL_SECS: u64 = 10;

/// Ended episodes whose manifests are kept for recorders that ask late.
const ENDED_EPISODES: usize = 8;

/// Time for queries before each control tick. While a tick is not due they have
/// all of it; a flood waits its turn and never holds physics up.
const QUERIES: Duration = Duration::from_millis(2);

/// Longest sleep of the loop, so that a lost wake-up costs little.
const NAP: Duration = Duration::from_millis(50);

/// A query with its kind.
pub struct Request {
    /// Kind.
    pub query: Query,
    /// The query to answer.
    pub asked: zenoh::query::Query,
}

/// The simulation thread.
pub struct Engine {
    pub(super) sim: Simulation,
    pub(super) shared: Arc<Shared>,
    /// An act that takes long.
    pub(super) errand: Option<Errand>,
    pub(super) options: Options,
    pub(super) render: Option<RenderThread>,
    pub(super) episode: Option<Episode>,
    pub(super) paused: bool,
    pub(super) waiting_for: String,
    pub(super) waiting: Waiting,
    pub(super) pace: Pace,
    episodes: u64,
    /// The last episodes that ended, oldest first.
    pub(super) ended: VecDeque<v1::EpisodeStopped>,
    pub(super) seen_anomalies: Vec<Anomaly>,
    /// What was odd since the episode began, in words.
    pub(super) anomalies: Vec<String>,
    /// Pairs whose hard collision has been told in this episode.
    pub(super) seen_collisions: Vec<(BodyRef, BodyRef)>,
    /// Asset files as they were when the simulation was set up.
    pub(super) asset_texts: Vec<v1::AssetText>,
    /// Answers that stay the same, made once.
    pub(super) made: answer::Made,
}

impl Engine {
    /// Sets up the cameras and declares the streams.
    ///
    /// # Errors
    /// [`ServiceError`], for example when there is no Vulkan driver.
    pub fn new(
        sim: Simulation,
        shared: Arc<Shared>,
        options: Options,
    ) -> Result<Self, ServiceError> {
        let asset_texts = answer::asset_texts(&sim).map_err(ServiceError::Assets)?;
        let mut engine = Self {
            asset_texts,
            pace: Pace::new(sim.scenario().pacing),
            sim,
            shared,
            errand: None,
            options,
            render: None,
            episode: None,
            paused: false,
            waiting_for: String::new(),
            waiting: Waiting::new(),
            episodes: 0,
            ended: VecDeque::new(),
            seen_anomalies: Vec::new(),
            anomalies: Vec::new(),
            seen_collisions: Vec::new(),
            made: answer::Made::default(),
        };
        engine.start_cameras()?;
        engine.listen(Listening::default());
        Ok(engine)
    }

    pub(super) fn start_cameras(&mut self) -> Result<(), ServiceError> {
        self.render = None;
        let wanted = self.wanted_cameras();
        if !wanted.is_empty() {
            let render = RenderThread::start(
                &self.sim,
                self.options.adapter.as_deref(),
                Arc::clone(&self.shared.outbox),
                Arc::clone(&self.shared.signal),
            )?;
            tracing::info!("cameras on {}", render.adapter);
            self.render = Some(render);
        }
        Ok(self.shared.outbox.declare(&wanted)?)
    }

    /// Cameras that are drawn: none when they could not be set up again after a
    /// reset that failed.
    pub(super) fn camera_names(&self) -> Vec<String> {
        match &self.render {
            Some(_) => self.wanted_cameras(),
            None => Vec::new(),
        }
    }

    /// Cameras that the scenario asks for.
    fn wanted_cameras(&self) -> Vec<String> {
        if self.options.no_cameras {
            return Vec::new();
        }
        let cameras = self.sim.scenario().cameras.iter();
        cameras
            .filter(|c| c.rate_hz > 0.0)
            .map(|c| c.name.clone())
            .collect()
    }

    pub(super) fn episode_number(&self) -> u64 {
        self.episode.as_ref().map_or(0, |e| e.number)
    }

    fn listen(&self, listening: Listening) {
        lock(&self.shared.inbox).listen(listening, self.sim.snapshot().tick);
    }

    /// Runs until told to stop; a running episode is closed, not discarded.
    pub fn run(mut self) {
        self.publish_state();
        while !self.shared.stop.load(Ordering::Acquire) {
            self.proceed();
            self.answer_some();
            self.publish_refusals();
            self.publish_tidings();
            let next = self.next();
            self.tell_of_waiting();
            match next {
                Next::Step => self.step(),
                Next::Wait(how_long) if !self.may_answer() => {
                    self.shared.signal.wait(how_long.min(NAP));
                }
                // There is time for the next queries.
                Next::Wait(_) => {}
            }
        }
        if let Some(episode) = &self.episode {
            let (number, participants) = (episode.number, episode.participants.clone());
            if let Some(render) = &self.render {
                render.drain();
            }
            self.stop_episode(false, v1::EndCause::Shutdown);
            self.wait_for_files(number, &participants);
        }
    }

    /// Whether a query waits that could be answered now.
    fn may_answer(&self) -> bool {
        self.shared.replies.has_room() && self.shared.desk.is_waiting(self.errand.is_none())
    }

    /// Answers queries, in order, for as long as one turn may take.
    fn answer_some(&mut self) {
        let since = Instant::now();
        while self.may_answer() && since.elapsed() < QUERIES {
            let Some(request) = self.shared.desk.next(self.errand.is_none()) else {
                return;
            };
            self.answer(request);
            self.proceed();
        }
    }

    /// Keeps the session open until the recorders have got the rest.
    fn wait_for_files(&mut self, episode: u64, participants: &[String]) {
        let since = Instant::now();
        while since.elapsed() < Duration::from_secs(FAREWELL_SECS) {
            // They ask for the manifest.
            while let Some(request) = self.shared.desk.next(false) {
                self.answer(request);
            }
            let mut recorders = lock(&self.shared.recorders);
            recorders.expire(Instant::now());
            let waiting = recorders.slowest(&self.shared.run_id, episode, participants);
            drop(recorders);
            if waiting.is_none() {
                return;
            }
            self.shared.signal.wait(NAP);
        }
    }

    /// Decides whether the next control tick may be taken.
    fn next(&mut self) -> Next {
        self.waiting_for.clear();
        if let Some(words) = self.sim.broken() {
            self.waiting_for = format!("a `reset`, for the state is broken: {words}");
            return Next::Wait(NAP);
        }
        if let Some(failure) = self.render.as_ref().and_then(RenderThread::failure) {
            self.waiting_for = format!("the cameras, which failed: {failure}");
            return Next::Wait(NAP);
        }
        if let Some(what) = self.errand.as_ref().and_then(Errand::holds_up) {
            what.clone_into(&mut self.waiting_for);
            return Next::Wait(NAP);
        }
        // Waiting here and not in the queue, it goes on answering.
        if self.paused || self.render.as_ref().is_some_and(RenderThread::is_full) {
            return Next::Wait(NAP);
        }
        let lock_step = self.sim.scenario().pacing == Pacing::LockStep;
        let Some(episode) = &self.episode else {
            if lock_step {
                "an episode (lock-step time stands still between episodes)"
                    .clone_into(&mut self.waiting_for);
                return Next::Wait(NAP);
            }
            return self.when_due();
        };
        if episode.stage == Stage::Waiting {
            return self.wait_for_recorders();
        }
        self.report_lost_recorders();
        if lock_step {
            if let Some(recorder) = self.recorder_without_credit() {
                let away = lock(&self.shared.recorders).is_away(&recorder);
                let lost = ["", ", whose connection is lost"][usize::from(away)];
                self.waiting_for = format!("recorder {recorder}{lost}");
                return Next::Wait(NAP);
            }
            if !lock(&self.shared.inbox).answered(self.sim.snapshot().tick) {
                self.waiting_for = match lock(&self.shared.inbox).lease().holder() {
                    Some(holder) => format!("the commander {:?}", holder.life.name),
                    None => "a commander, for nobody holds control".to_owned(),
                };
                return Next::Wait(NAP);
            }
        }
        self.when_due()
    }

    fn when_due(&self) -> Next {
        let command_waits = lock(&self.shared.inbox).has_pending();
        let wait = self.pace.wait(Instant::now(), command_waits);
        wait.map_or(Next::Step, Next::Wait)
    }

    fn wait_for_recorders(&mut self) -> Next {
        let Some(episode) = &mut self.episode else {
            return Next::Wait(NAP);
        };
        let (ready, failed) = {
            let recorders = lock(&self.shared.recorders);
            let run = &self.shared.run_id;
            (
                recorders.ready(run, episode.number),
                recorders.failed(run, episode.number),
            )
        };
        if ready.len() >= episode.required {
            episode.participants = ready;
            episode.stage = Stage::Running;
            episode.running_since = Instant::now();
            self.pace.restart();
            self.publish_state();
            let frames = self.sim.frames_now();
            self.draw(frames);
            return Next::Wait(Duration::ZERO);
        }
        let (have, need) = (ready.len(), episode.required);
        let mut text = format!("recorders: {have} of {need} ready");
        for (name, reason) in &failed {
            text.push_str(&format!("; {name} failed: {reason}"));
        }
        let present = lock(&self.shared.recorders).present();
        let patience = if present >= need {
            PRESENT_SECS
        } else {
            ABSENT_SECS
        };
        let too_long = episode.since.elapsed() > Duration::from_secs(patience);
        if !failed.is_empty() || too_long {
            let text = format!("episode ended before it began, {text}");
            self.event("note", &text);
            self.end_episode(true, v1::EndCause::Recorders);
        }
        self.waiting_for = text;
        Next::Wait(NAP)
    }

    fn report_lost_recorders(&mut self) {
        let Some(episode) = &mut self.episode else {
            return;
        };
        let lost = {
            let mut recorders = lock(&self.shared.recorders);
            recorders.expire(Instant::now());
            recorders.lost_of(&episode.participants)
        };
        episode.participants.retain(|name| !lost.contains(name));
        for name in lost {
            self.event("note", &format!("recorder {name} was lost in this episode"));
        }
    }

    fn recorder_without_credit(&self) -> Option<String> {
        let episode = self.episode.as_ref()?;
        // Those that are still being drawn as well: the cache holds no more.
        let published = episode.pictures.values().sum::<u64>();
        let recorders = lock(&self.shared.recorders);
        let (name, accepted) =
            recorders.slowest(&self.shared.run_id, episode.number, &episode.participants)?;
        (published >= accepted.min(published).saturating_add(CREDIT_WINDOW)).then_some(name)
    }

    fn step(&mut self) {
        let tick = self.sim.snapshot().tick;
        let now = match self.sim.scenario().pacing {
            Pacing::RealTime => self.shared.now(),
            Pacing::LockStep | Pacing::Fast => self.sim.snapshot().stamp_nanos() as f64 * 1e-9,
        };
        let taken = lock(&self.shared.inbox).take(tick, now);
        let episode = self.episode_number();
        let outbox = Arc::clone(&self.shared.outbox);
        let step = self.sim.step_telling(&taken.input, |targets, control| {
            publish::applied(&outbox, episode, tick, &taken, targets, control);
        });
        self.pace.tick(Instant::now());
        if self.sim.broken().is_some() {
            self.break_off();
            return;
        }
        publish::imu(&outbox, episode, &step.imu);
        self.publish_state();
        self.publish_anomalies();
        self.draw(step.frames);
    }

    fn publish_state(&self) {
        let tick = self.sim.snapshot().tick;
        self.shared.stamp_is(self.episode_number(), tick);
        let inbox = lock(&self.shared.inbox);
        let (phase, name) = inbox.phase();
        let phase = (phase, name.to_owned());
        drop(inbox);
        publish::state(
            &self.shared.outbox,
            self.episode_number(),
            &self.sim,
            (phase.0, &phase.1),
            self.pace.factor(),
        );
    }

    fn draw(&mut self, frames: Vec<(Arc<Snapshot>, Vec<usize>)>) {
        let number = self.episode_number();
        let Some(render) = &self.render else {
            return;
        };
        for (snapshot, mut cameras) in frames {
            if self.episode.is_none() {
                // Between episodes only what somebody looks at is drawn.
                cameras.retain(|&camera| render.is_watched(camera));
            }
            if cameras.is_empty() {
                continue;
            }
            if let Some(episode) = &mut self.episode {
                for &camera in &cameras {
                    let name = &self.sim.scenario().cameras[camera].name;
                    *episode.pictures.entry(name.clone()).or_default() += 1;
                }
            }
            render.draw(snapshot, cameras, number);
        }
    }

    pub(super) fn event(&self, kind: &str, text: &str) {
        tracing::info!("{kind}: {text}");
        let event = v1::Event {
            header: None,
            kind: kind.to_owned(),
            text: text.to_owned(),
        };
        let tick = self.sim.snapshot().tick;
        self.shared
            .outbox
            .state(names::EVENT_STREAM, self.episode_number(), tick, event);
    }

    /// Announces an episode; simulation time goes on when its recorders are ready.
    /// What the cameras drew before it is out.
    pub(super) fn start_episode(
        &mut self,
        request: v1::EpisodeStartRequest,
    ) -> Result<v1::EpisodeStarted, String> {
        if let Some(running) = &self.episode {
            let label = &running.started.label;
            return Err(format!("episode {label:?} is running; stop it first"));
        }
        if let Some(words) = self.sim.broken() {
            return Err(format!(
                "the state is broken, no episode can begin: {words}; ask for `reset` first"
            ));
        }
        check::label(&request.label).map_err(|e| e.to_string())?;
        check::instruction(&request.instruction).map_err(|e| e.to_string())?;
        let lock_step = self.sim.scenario().pacing == Pacing::LockStep;
        if lock_step {
            self.check_commander(&request.commander)?;
        } else if request.replay {
            return Err(
                "`replay` switches off the rule that stops the chair when its commander falls \
                 silent: it is for lock-step, where time waits for every command; start a server \
                 with --pacing lock-step"
                    .to_owned(),
            );
        }
        // In lock-step time waits for every recorder that is there.
        let required = match lock_step {
            true => lock(&self.shared.recorders)
                .present()
                .max(request.require_recorders as usize),
            false => request.require_recorders as usize,
        };
        lock(&self.shared.recorders).begin();
        if !request.replay {
            self.sim.begin_episode();
        }
        let snapshot = self.sim.save().map_err(|e| e.to_string())?;
        self.episodes += 1;
        let number = self.episodes;
        let scenario = self.sim.scenario();
        let task = self.sim.task();
        let instruction = match request.instruction.as_str() {
            "" => scenario.instruction.clone(),
            given => given.to_owned(),
        };
        let tick = self.sim.snapshot().tick;
        let started = v1::EpisodeStarted {
            header: Some(self.shared.outbox.header(number, tick)),
            label: request.label,
            instruction,
            scenario: Some(convert::scenario(scenario)),
            activity: task.map(|t| t.activity.clone()).unwrap_or_default(),
            area: task.map(|t| t.area.clone()).unwrap_or_default(),
            streams: names::STREAMS.iter().map(|s| (*s).to_owned()).collect(),
            cameras: self.camera_names(),
            adapter: self
                .render
                .as_ref()
                .map(|r| r.adapter.clone())
                .unwrap_or_default(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            objects: self
                .sim
                .scene()
                .objects
                .iter()
                .map(|o| o.name.clone())
                .collect(),
            joints: self
                .sim
                .scene()
                .joints
                .iter()
                .map(|j| j.name.clone())
                .collect(),
            physics_version: wheelarm_proto::PHYSICS_VERSION,
        };
        self.episode = Some(Episode {
            number,
            started: started.clone(),
            snapshot: snapshot.into(),
            stage: Stage::Waiting,
            required,
            pictures: BTreeMap::new(),
            participants: Vec::new(),
            since: Instant::now(),
            running_since: Instant::now(),
        });
        if required > 0 {
            // Whoever asks at once is not told that it runs.
            self.waiting_for = format!("recorders: 0 of {required} ready");
        }
        self.listen(Listening {
            episode: number,
            lock_step,
            replay: request.replay,
        });
        self.forget_anomalies();
        self.shared.outbox.episode_start(tick, started.clone());
        Ok(started)
    }

    /// In lock-step time waits for whoever holds control; `wanted` must be that one.
    fn check_commander(&self, wanted: &str) -> Result<(), String> {
        let inbox = lock(&self.shared.inbox);
        let holder = inbox.lease().holder().map(|h| h.life.name.as_str());
        match holder {
            Some(holder) if wanted.is_empty() || wanted == holder => Ok(()),
            Some(holder) => Err(format!(
                "in lock-step the simulation waits for one commander: {wanted:?} is asked for, but \
                 {holder:?} holds control (query `lease`)"
            )),
            None => Err(
                "in lock-step the simulation waits for one commander, and nobody holds control: \
                 ask for it first (query `lease`), or hold it from another terminal with \
                 `wheelarm lease hold`"
                    .to_owned(),
            ),
        }
    }

    /// Closes the running episode, whose pictures are all out, and publishes its
    /// manifest.
    pub(super) fn stop_episode(
        &mut self,
        discard: bool,
        cause: v1::EndCause,
    ) -> Option<v1::EpisodeStopped> {
        let episode = self.episode.take()?;
        let tick = self.sim.snapshot().tick;
        let mut manifest = self
            .shared
            .outbox
            .manifest(episode.number, &self.camera_names());
        // Pictures that fell due but were never drawn are missing, not absent.
        for line in &mut manifest {
            let camera = line.stream.strip_prefix("camera/").unwrap_or_default();
            let due = episode.pictures.get(camera).copied().unwrap_or_default();
            if due > line.count {
                line.count = due;
                line.last = line.first + due - 1;
            }
        }
        let stopped = v1::EpisodeStopped {
            header: Some(self.shared.outbox.header(episode.number, tick)),
            discard,
            evaluation: Some(convert::evaluation(self.sim.evaluation())),
            manifest,
            wall_seconds: episode.running_since.elapsed().as_secs_f64(),
            cause: cause.into(),
            anomalies: self.anomalies.clone(),
        };
        // Whoever hears of the end may ask for it at once.
        self.ended.push_back(stopped.clone());
        if self.ended.len() > ENDED_EPISODES {
            self.ended.pop_front();
        }
        self.shared.outbox.episode_stop(tick, stopped.clone());
        self.listen(Listening::default());
        self.pace.restart();
        Some(stopped)
    }

    /// Begins anew with the simulation that was just put in place.
    pub(super) fn renew(&mut self) {
        lock(&self.shared.inbox).renew(Listening::default(), self.sim.snapshot().tick);
        self.forget_anomalies();
        self.made = answer::Made::default();
        self.pace.restart();
        self.publish_state();
    }
}

enum Next {
    Step,
    Wait(Duration),
}
