//! The simulation thread: waits for what the pacing asks for, steps, publishes.
//!
//! Everything that changes the simulation happens here. What is asked is in
//! `answers`, what takes long in `errands`, how an episode goes in `episodes`.

mod anomalies;
mod answers;
mod episodes;
mod errands;
mod show;
mod tidings;

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use bytes::Bytes;
use nalgebra::Isometry3;
use wheelarm_proto::keys::Keys;
use wheelarm_proto::settings::Depth;
use wheelarm_proto::v1;
use wheelarm_proto::v1::WaitingFor;

use super::episode::{Episode, Stage, Unacknowledged};
use super::errand::Errand;
use super::error::ServiceError;
use super::inbox::{Listening, Standing};
use super::lag::Lag;
use super::pace::Pace;
use super::render::RenderThread;
use super::shared::Shared;
use super::waiting::Waiting;
use super::{assets, publish};
use crate::robot::control::GripperMap;
use crate::sensors::camera::Graphics;
use crate::sensors::signals::Signals;
use crate::sim::{Pacing, Simulation};
use crate::snapshot::{Anomaly, BodyRef, Snapshot};

/// Time for queries before each control tick. While a tick is not due they have
/// all of it; a flood waits its turn and never holds physics up.
const QUERIES: Duration = Duration::from_millis(2);

/// Longest sleep of the loop, so that a lost wake-up costs little.
pub(in crate::service) const NAP: Duration = Duration::from_millis(50);

/// What a service needs to know beside the simulation.
#[derive(Clone, Debug)]
pub struct Options {
    /// Keys of this server.
    pub keys: Keys,
    /// The adapter that draws; another service may draw on it, too.
    pub graphics: Graphics,
    /// Physics only: no pictures, no driver needed.
    pub no_cameras: bool,
    /// Form of depth in compressed pictures: metres, unless all who record keep it in
    /// another, as the one recorder of a campaign's worker may.
    pub depth: Depth,
    /// Who may connect, for who asks.
    pub access: v1::Access,
}

/// The simulation thread.
pub struct Engine {
    pub(in crate::service) sim: Simulation,
    pub(in crate::service) shared: Arc<Shared>,
    /// An act that takes long.
    pub(in crate::service) errand: Option<Errand>,
    pub(in crate::service) options: Options,
    pub(in crate::service) render: Option<RenderThread>,
    pub(in crate::service) episode: Option<Episode>,
    pub(in crate::service) paused: bool,
    pub(in crate::service) waiting_for: Waits,
    pub(in crate::service) waiting: Waiting,
    pub(in crate::service) pace: Pace,
    pub(in crate::service) episodes: u64,
    /// Answers to `episode_stop` that wait for recorders.
    pub(in crate::service) unacknowledged: Vec<Unacknowledged>,
    /// The last episodes that ended, oldest first.
    pub(in crate::service) ended: VecDeque<v1::EpisodeStopped>,
    pub(in crate::service) seen_anomalies: Vec<Anomaly>,
    /// What was odd since the episode began, with its words.
    pub(in crate::service) anomalies: Vec<(v1::AnomalyKind, String)>,
    /// Pairs whose hard collision has been told in this episode.
    pub(in crate::service) seen_collisions: Vec<(BodyRef, BodyRef)>,
    /// Asset files as they were when the simulation was set up.
    pub(in crate::service) asset_texts: Vec<v1::AssetText>,
    /// Answers that stay the same, made once.
    pub(in crate::service) made: Made,
    /// The recorded state that is shown.
    pub(super) shown: Option<v1::ShowRequest>,
    /// Sensor models of the robot's signals.
    pub(in crate::service) signals: Signals,
    /// The way from the gate to the robot's control, where it takes time.
    pub(in crate::service) lag: Option<Lag>,
}

/// Answers that stay the same while a scenario and an episode are in force.
#[derive(Default)]
pub(in crate::service) struct Made {
    pub(in crate::service) scene: Option<Arc<v1::SceneReply>>,
    /// Of one episode.
    pub(in crate::service) snapshot: Option<(u64, Bytes)>,
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
        let asset_texts = assets::texts(&sim).map_err(ServiceError::Assets)?;
        let mut engine = Self {
            asset_texts,
            pace: Pace::new(sim.scenario().pacing),
            signals: Signals::new(sim.devices(), sim.model()),
            lag: Lag::of(sim.devices()),
            sim,
            shared,
            errand: None,
            options,
            render: None,
            episode: None,
            paused: false,
            waiting_for: Waits::default(),
            waiting: Waiting::new(),
            episodes: 0,
            unacknowledged: Vec::new(),
            ended: VecDeque::new(),
            seen_anomalies: Vec::new(),
            anomalies: Vec::new(),
            seen_collisions: Vec::new(),
            made: Made::default(),
            shown: None,
        };
        engine.start_cameras()?;
        engine.listen(Listening::default());
        Ok(engine)
    }

    pub(in crate::service) fn start_cameras(&mut self) -> Result<(), ServiceError> {
        self.render = None;
        let wanted = self.wanted_cameras();
        if !wanted.is_empty() {
            let render = RenderThread::start(
                &self.sim,
                &self.options.graphics,
                self.options.depth,
                Arc::clone(&self.shared.outbox),
                Arc::clone(&self.shared.signal),
            )?;
            tracing::info!("cameras on {}", render.adapter);
            self.render = Some(render);
        }
        Ok(self.shared.outbox.declare(&wanted, &self.sensor_names())?)
    }

    /// Picture sensors on the cameras that are drawn.
    pub(in crate::service) fn sensor_names(&self) -> Vec<String> {
        let render = self.render.as_ref();
        render.map_or_else(Vec::new, |render| render.sensed().names())
    }

    /// Cameras that are drawn: none when they could not be set up again after a
    /// reset that failed.
    pub(in crate::service) fn camera_names(&self) -> Vec<String> {
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

    pub(in crate::service) fn episode_number(&self) -> u64 {
        self.episode.as_ref().map_or(0, |e| e.number)
    }

    pub(in crate::service) fn listen(&self, listening: Listening) {
        self.shared
            .inbox
            .lock()
            .listen(listening, self.sim.snapshot().tick);
    }

    /// Runs until told to stop; a running episode is closed, not discarded.
    pub fn run(mut self) {
        self.publish_state();
        while !self.shared.stop.load(Ordering::Acquire) {
            self.proceed();
            self.answer_acknowledged(false);
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
        self.answer_acknowledged(true);
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

    /// Decides whether the next control tick may be taken.
    fn next(&mut self) -> Next {
        self.waiting_for = Waits::default();
        if let Some(words) = self.sim.broken() {
            let words = format!("a `reset`, for the state is broken: {words}");
            self.waiting_for = Waits::new(WaitingFor::Reset, words);
            return Next::Wait(NAP);
        }
        if let Some(failure) = self.render.as_ref().and_then(RenderThread::failure) {
            let words = format!("the cameras, which failed: {failure}");
            self.waiting_for = Waits::new(WaitingFor::FailedCameras, words);
            return Next::Wait(NAP);
        }
        if let Some(what) = self.errand.as_ref().and_then(Errand::holds_up) {
            self.waiting_for = Waits::new(WaitingFor::Cameras, what);
            return Next::Wait(NAP);
        }
        if self.sim.is_shown() {
            return self.next_shown();
        }
        // Waiting here and not in the queue, it goes on answering.
        if self.paused || self.render.as_ref().is_some_and(RenderThread::is_full) {
            return Next::Wait(NAP);
        }
        let lock_step = self.sim.scenario().pacing == Pacing::LockStep;
        let Some(episode) = &self.episode else {
            if lock_step {
                let words = "an episode (lock-step time is paused between episodes)";
                self.waiting_for = Waits::new(WaitingFor::Episode, words);
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
                let recorders = self.shared.recorders.lock();
                let why = if recorders.is_away(&recorder) {
                    ", whose connection is lost"
                } else if recorders.is_silent(&recorder, Instant::now()) {
                    ", which does not answer; time goes on when it does or has ended"
                } else {
                    ""
                };
                drop(recorders);
                let words = format!("recorder {recorder}{why}");
                self.waiting_for = Waits::new(WaitingFor::Credit, words);
                return Next::Wait(NAP);
            }
            if !self.shared.inbox.lock().answered(self.sim.snapshot().tick) {
                self.waiting_for = match self.shared.inbox.lock().lease().holder() {
                    Some(holder) => {
                        let words = format!("the commander {:?}", holder.life.name);
                        Waits::new(WaitingFor::Commander, words)
                    }
                    None => {
                        let words = "a commander, for nobody holds control";
                        Waits::new(WaitingFor::Control, words)
                    }
                };
                return Next::Wait(NAP);
            }
        }
        self.when_due()
    }

    fn when_due(&self) -> Next {
        let command_waits = self.shared.inbox.lock().has_pending();
        let wait = self.pace.wait(Instant::now(), command_waits);
        wait.map_or(Next::Step, Next::Wait)
    }

    fn step(&mut self) {
        let tick = self.sim.snapshot().tick;
        let now = match self.sim.scenario().pacing {
            Pacing::RealTime => self.shared.now(),
            Pacing::LockStep | Pacing::Fast => self.sim.snapshot().stamp_nanos() as f64 * 1e-9,
        };
        let mut taken = {
            let mut inbox = self.shared.inbox.lock();
            inbox.stands(self.standing());
            inbox.take(tick, now, self.shared.now())
        };
        let replayed = self.episode.as_ref().is_some_and(|e| e.replayed);
        if let Some(lag) = self.lag.as_mut().filter(|_| !replayed) {
            let input = std::mem::take(&mut taken.input);
            taken.input = lag.pass(tick, input, taken.stopped);
        }
        let episode = self.episode_number();
        let outbox = Arc::clone(&self.shared.outbox);
        publish::disturbance(&outbox, episode, &self.sim);
        let yields = self.pace.is_real_time() && !taken.commands.is_empty();
        let step = self.sim.step_telling(&taken.input, |targets, control| {
            publish::applied(&outbox, episode, tick, &taken, targets, control);
            if yields {
                // Who sends it may have been woken on this processor, and the step
                // that follows is longer than all of its work. Where time is what the
                // host gives, drawing threads would take the time of the step.
                std::thread::yield_now();
            }
        });
        self.pace.tick(Instant::now());
        if self.sim.broken().is_some() {
            self.break_off();
            return;
        }
        publish::imu(&outbox, episode, &step.imu);
        let rate = self.sim.scenario().imu_rate_hz;
        publish::sensed_imu(&outbox, episode, &step.imu, rate, &mut self.signals);
        self.publish_state();
        self.publish_anomalies();
        self.draw(step.frames);
    }

    /// What is in force before the next control tick.
    fn standing(&self) -> Standing {
        let (control, snapshot) = (self.sim.control(), self.sim.snapshot());
        let state = control.state();
        let base = self.sim.model().roles.arm_base;
        let house_from = |link: usize| {
            snapshot
                .links
                .get(link)
                .map_or_else(Isometry3::identity, |l| l.pose)
        };
        let house_from_base = house_from(base);
        Standing {
            joints: state.arm.position,
            tool: control.kinematics().forward(&state.arm.position),
            chair_from_base: house_from(0).inverse() * house_from_base,
            house_from_base,
            base: control.base_velocity_command(),
            knuckle: state.gripper.position,
        }
    }

    pub(in crate::service) fn publish_state(&mut self) {
        let tick = self.sim.snapshot().tick;
        self.shared.stamp_is(self.episode_number(), tick);
        if let Some(render) = &self.render {
            render.sensed().stands(self.episode_number(), tick);
        }
        if self.sim.is_shown() {
            self.publish_shown();
            return;
        }
        let inbox = self.shared.inbox.lock();
        let (phase, name) = inbox.phase();
        let phase = (phase, name.to_owned());
        drop(inbox);
        self.signals.update(self.sim.snapshot(), self.sim.model());
        publish::state(
            &self.shared.outbox,
            self.episode_number(),
            &self.sim,
            &self.signals,
            (phase.0, &phase.1),
            self.pace.factor(),
        );
    }

    pub(in crate::service) fn draw(&mut self, frames: Vec<(Arc<Snapshot>, Vec<usize>)>) {
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

    pub(in crate::service) fn event(&self, kind: v1::EventKind, text: &str) {
        self.tell(v1::Event {
            kind: kind.into(),
            text: text.to_owned(),
            ..v1::Event::default()
        });
    }

    /// Publishes something that happened, with what programs want of it.
    pub(in crate::service) fn tell(&self, event: v1::Event) {
        tracing::info!("{}: {}", event.kind().word(), event.text);
        let tick = self.sim.snapshot().tick;
        self.shared.outbox.put(self.episode_number(), tick, event);
    }

    /// Begins anew with the simulation that was just put in place.
    pub(in crate::service) fn renew(&mut self) {
        let mut inbox = self.shared.inbox.lock();
        inbox.fit(GripperMap::new(self.sim.model()));
        inbox.renew(Listening::default(), self.sim.snapshot().tick);
        drop(inbox);
        self.forget_anomalies();
        self.made = Made::default();
        self.shown = None;
        self.signals = Signals::new(self.sim.devices(), self.sim.model());
        self.lag = Lag::of(self.sim.devices());
        self.pace.restart();
        self.publish_state();
    }
}

/// Whom or what time waits for.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::service) struct Waits {
    /// For programs.
    pub(in crate::service) code: WaitingFor,
    /// For people; empty when it waits for nothing.
    pub(in crate::service) words: String,
}

impl Waits {
    pub(in crate::service) fn new(code: WaitingFor, words: impl Into<String>) -> Self {
        let words = words.into();
        Self { code, words }
    }
}

pub(in crate::service) enum Next {
    Step,
    Wait(Duration),
}
