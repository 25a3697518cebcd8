//! The simulation thread: waits as the pacing requires, steps, publishes.
//!
//! Only this thread changes the simulation. Queries are answered in `queries`, long
//! operations run in `pending_operations`, the lifecycle of episodes is in `episodes`.

mod anomalies;
mod episodes;
mod event_queue;
mod pack_queries;
mod pending_operations;
mod playback;
mod queries;

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use bytes::Bytes;
use nalgebra::Isometry3;
use wheelarm_pack::Store as PackStore;
use wheelarm_proto::keys::Keys;
use wheelarm_proto::settings::Depth;
use wheelarm_proto::v1;
use wheelarm_proto::v1::WaitingFor;

use super::command_delay::CommandDelay;
use super::command_gate::{Listening, SetPoints};
use super::episode::{Episode, PendingStopReply, Stage};
use super::error::ServiceError;
use super::pace::Pace;
use super::pending_operation::PendingOperation;
use super::render::RenderThread;
use super::shared::Shared;
use super::uploads::Uploads;
use super::waiting::Waiting;
use super::{assets, publish};
use crate::robot::control::GripperMap;
use crate::sensors::camera::Graphics;
use crate::sensors::signals::Signals;
use crate::sim::{Pacing, Simulation};
use crate::snapshot::{Anomaly, BodyRef, Snapshot};

/// Time for queries before a control tick that is due, so that a flood never delays
/// physics. While no tick is due, queries have all the time.
const QUERIES: Duration = Duration::from_millis(2);

/// Longest sleep of the loop, so that a lost wake-up costs little.
pub(in crate::service) const NAP: Duration = Duration::from_millis(50);

/// Options of a service.
#[derive(Clone, Debug)]
pub struct Options {
    /// Keys of this server.
    pub keys: Keys,
    /// The GPU adapter that renders; other services may share it.
    pub graphics: Graphics,
    /// Physics only: no images, no driver needed.
    pub no_cameras: bool,
    /// Form of depth in compressed images: metres, unless all recorders store another
    /// form, as the single recorder of a campaign worker may.
    pub depth: Depth,
    /// Access mode, reported to clients.
    pub access: v1::Access,
    /// Folders of world packs.
    pub packs: PackStore,
}

/// The simulation thread.
pub struct Engine {
    pub(in crate::service) sim: Simulation,
    pub(in crate::service) shared: Arc<Shared>,
    /// An operation that takes long.
    pub(in crate::service) pending_operation: Option<PendingOperation>,
    pub(in crate::service) options: Options,
    pub(in crate::service) render: Option<RenderThread>,
    pub(in crate::service) episode: Option<Episode>,
    pub(in crate::service) paused: bool,
    pub(in crate::service) waiting_for: Waits,
    pub(in crate::service) waiting: Waiting,
    pub(in crate::service) pace: Pace,
    pub(in crate::service) episodes: u64,
    /// Replies to `episode_stop` that wait for recorders.
    pub(in crate::service) unacknowledged: Vec<PendingStopReply>,
    /// The last ended episodes, oldest first.
    pub(in crate::service) ended: VecDeque<v1::EpisodeStopped>,
    pub(in crate::service) reported_anomalies: Vec<Anomaly>,
    /// Anomalies since the episode began, with their texts.
    pub(in crate::service) anomalies: Vec<(v1::AnomalyKind, String)>,
    /// Pairs whose hard collision was reported in this episode.
    pub(in crate::service) reported_collisions: Vec<(BodyRef, BodyRef)>,
    /// Asset files as read when the simulation was set up.
    pub(in crate::service) asset_texts: Vec<v1::AssetText>,
    /// Replies that stay the same, encoded once.
    pub(in crate::service) made: Made,
    /// A world pack that a client sends.
    pub(in crate::service) uploads: Uploads,
    /// The recorded state that is played back.
    pub(super) shown: Option<v1::PlaybackRequest>,
    /// Sensor models of the robot's signals.
    pub(in crate::service) signals: Signals,
    /// Delay of commands behind the gate, if a sensor model defines one.
    pub(in crate::service) command_delay: Option<CommandDelay>,
}

/// Replies that stay the same for one scenario and episode.
#[derive(Default)]
pub(in crate::service) struct Made {
    pub(in crate::service) scene: Option<Arc<v1::SceneReply>>,
    /// With the number of its episode.
    pub(in crate::service) snapshot: Option<(u64, Bytes)>,
}

impl Engine {
    /// Sets up the cameras and declares the streams.
    ///
    /// # Errors
    /// [`ServiceError`], for example without a Vulkan driver.
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
            command_delay: CommandDelay::from_devices(sim.devices()),
            sim,
            shared,
            pending_operation: None,
            options,
            render: None,
            episode: None,
            paused: false,
            waiting_for: Waits::default(),
            waiting: Waiting::new(),
            episodes: 0,
            unacknowledged: Vec::new(),
            ended: VecDeque::new(),
            reported_anomalies: Vec::new(),
            anomalies: Vec::new(),
            reported_collisions: Vec::new(),
            made: Made::default(),
            uploads: Uploads::default(),
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
                Arc::clone(&self.shared.wakeup),
            )?;
            tracing::info!("cameras on {}", render.adapter);
            self.render = Some(render);
        }
        Ok(self.shared.outbox.declare(&wanted, &self.sensor_names())?)
    }

    /// Image sensors on the rendered cameras.
    pub(in crate::service) fn sensor_names(&self) -> Vec<String> {
        let render = self.render.as_ref();
        render.map_or_else(Vec::new, |render| render.sensor_images().names())
    }

    /// Rendered cameras: none if they could not be set up again after a failed reset.
    pub(in crate::service) fn camera_names(&self) -> Vec<String> {
        match &self.render {
            Some(_) => self.wanted_cameras(),
            None => Vec::new(),
        }
    }

    /// Cameras of the scenario.
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
            .command_gate
            .lock()
            .listen(listening, self.sim.snapshot().tick);
    }

    /// Runs until stopped; a running episode is closed, not discarded.
    pub fn run(mut self) {
        self.publish_state();
        while !self.shared.stop.load(Ordering::Acquire) {
            self.proceed();
            self.answer_acknowledged(false);
            self.answer_some();
            self.publish_refusals();
            self.publish_queued_events();
            let next = self.next();
            self.log_waiting();
            match next {
                Next::Step => self.step(),
                Next::Wait(how_long) if !self.may_answer() => {
                    self.shared.wakeup.wait(how_long.min(NAP));
                }
                // Not due yet: answer more queries.
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

    /// Whether a query waits that can be answered now.
    fn may_answer(&self) -> bool {
        self.shared.replies.has_room()
            && self
                .shared
                .request_queue
                .is_waiting(self.pending_operation.is_none())
    }

    /// Answers queries in order, for at most [`QUERIES`].
    fn answer_some(&mut self) {
        let since = Instant::now();
        while self.may_answer() && since.elapsed() < QUERIES {
            let Some(request) = self
                .shared
                .request_queue
                .next(self.pending_operation.is_none())
            else {
                return;
            };
            self.answer(request);
            self.proceed();
        }
    }

    /// Decides whether the next control tick may run.
    fn next(&mut self) -> Next {
        self.waiting_for = Waits::default();
        if let Some(words) = self.sim.broken() {
            let words = format!("a `reset`, because the state is broken: {words}");
            self.waiting_for = Waits::new(WaitingFor::Reset, words);
            return Next::Wait(NAP);
        }
        if let Some(failure) = self.render.as_ref().and_then(RenderThread::failure) {
            let words = format!("the cameras, which failed: {failure}");
            self.waiting_for = Waits::new(WaitingFor::FailedCameras, words);
            return Next::Wait(NAP);
        }
        if let Some(what) = self
            .pending_operation
            .as_ref()
            .and_then(PendingOperation::pause_reason)
        {
            self.waiting_for = Waits::new(WaitingFor::Cameras, what);
            return Next::Wait(NAP);
        }
        if self.sim.is_shown() {
            return self.next_shown();
        }
        // Waiting here and not in the queue keeps queries answered.
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
            if !self
                .shared
                .command_gate
                .lock()
                .answered(self.sim.snapshot().tick)
            {
                self.waiting_for = match self.shared.command_gate.lock().lease().holder() {
                    Some(holder) => {
                        let words = format!("the commander {:?}", holder.life.name);
                        Waits::new(WaitingFor::Commander, words)
                    }
                    None => {
                        let words = "a commander: no commander holds control";
                        Waits::new(WaitingFor::Control, words)
                    }
                };
                return Next::Wait(NAP);
            }
        }
        self.when_due()
    }

    fn when_due(&self) -> Next {
        let command_waits = self.shared.command_gate.lock().has_pending();
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
            let mut command_gate = self.shared.command_gate.lock();
            command_gate.set_set_points(self.set_points());
            command_gate.take(tick, now, self.shared.now())
        };
        let replayed = self.episode.as_ref().is_some_and(|e| e.replayed);
        if let Some(command_delay) = self.command_delay.as_mut().filter(|_| !replayed) {
            let input = std::mem::take(&mut taken.input);
            taken.input = command_delay.pass(tick, input, taken.stopped);
        }
        let episode = self.episode_number();
        let outbox = Arc::clone(&self.shared.outbox);
        publish::disturbance(&outbox, episode, &self.sim);
        let yields = self.pace.is_real_time() && !taken.commands.is_empty();
        let step = self.sim.step_telling(&taken.input, |targets, control| {
            publish::applied(&outbox, episode, tick, &taken, targets, control);
            if yields {
                // Yield once so that a publisher woken on this core sends `applied`
                // before the longer physics step. Not in other pacings, where render
                // threads would take the time of the step.
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

    /// Set points in force before the next control tick.
    fn set_points(&self) -> SetPoints {
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
        SetPoints {
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
        self.shared.set_stamp(self.episode_number(), tick);
        if let Some(render) = &self.render {
            render.sensor_images().set_tick(self.episode_number(), tick);
        }
        if self.sim.is_shown() {
            self.publish_shown();
            return;
        }
        let command_gate = self.shared.command_gate.lock();
        let (phase, name) = command_gate.phase();
        let phase = (phase, name.to_owned());
        drop(command_gate);
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
                // Between episodes only watched cameras are rendered.
                cameras.retain(|&camera| render.is_watched(camera));
            }
            if cameras.is_empty() {
                continue;
            }
            if let Some(episode) = &mut self.episode {
                for &camera in &cameras {
                    let name = &self.sim.scenario().cameras[camera].name;
                    *episode.images.entry(name.clone()).or_default() += 1;
                }
            }
            render.draw(snapshot, cameras, number);
        }
    }

    pub(in crate::service) fn event(&self, kind: v1::EventKind, text: &str) {
        self.publish_event(v1::Event {
            kind: kind.into(),
            text: text.to_owned(),
            ..v1::Event::default()
        });
    }

    /// Publishes an event.
    pub(in crate::service) fn publish_event(&self, event: v1::Event) {
        tracing::info!("{}: {}", event.kind().word(), event.text);
        let tick = self.sim.snapshot().tick;
        self.shared.outbox.put(self.episode_number(), tick, event);
    }

    /// Resets the engine for a simulation that was just replaced.
    pub(in crate::service) fn renew(&mut self) {
        let mut command_gate = self.shared.command_gate.lock();
        command_gate.set_gripper(GripperMap::new(self.sim.model()));
        command_gate.renew(Listening::default(), self.sim.snapshot().tick);
        drop(command_gate);
        self.forget_anomalies();
        self.made = Made::default();
        self.shown = None;
        self.signals = Signals::new(self.sim.devices(), self.sim.model());
        self.command_delay = CommandDelay::from_devices(self.sim.devices());
        self.pace.restart();
        self.publish_state();
    }
}

/// What time waits for.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::service) struct Waits {
    /// Machine-readable code.
    pub(in crate::service) code: WaitingFor,
    /// Text for people; empty when time does not wait.
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
