//! Lifecycle of an episode: announcement, wait for recorders, manifest.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use wheelarm_proto::v1::{FailureCode, WaitingFor};
use wheelarm_proto::{Message, StreamId, TopicId, check, v1};

use super::{Engine, NAP, Next, Waits};
use crate::service::command_gate::Listening;
use crate::service::denied::Denied;
use crate::service::episode::{Episode, PendingStopReply, Stage};
use crate::service::recorders::Progress;
use crate::service::{convert, describe};
use crate::sim::Pacing;

/// Longest wait of an announced episode for absent recorders, s.
const ABSENT_SECS: u64 = 30;

/// Longest wait for connected recorders that still finish files, s.
const PRESENT_SECS: u64 = 120;

/// Longest wait at shutdown for recorders to receive the rest, s.
const FAREWELL_SECS: u64 = 10;

/// Longest wait for recorders to receive the manifest before `episode_stop` is
/// answered, s. Samples lost on a slow connection are retransmitted first.
const ACKNOWLEDGED_SECS: u64 = 10;

/// Ended episodes whose manifests are kept for late recorders.
const ENDED_EPISODES: usize = 8;

impl Engine {
    /// Ends the episode and answers `query` when its recorders have the manifest.
    pub(super) fn stop_for(
        &mut self,
        query: Option<zenoh::query::Query>,
        discard: bool,
        cause: v1::EndCause,
    ) {
        let episode = self.episode.as_ref();
        let participants =
            episode.map_or_else(Vec::new, |e| [&e.participants[..], &e.lost[..]].concat());
        let stopped = self.stop_episode(discard, cause);
        let Some(query) = query else {
            return;
        };
        match stopped {
            Some(stopped) => self.unacknowledged.push(PendingStopReply {
                query,
                stopped,
                participants,
                since: Instant::now(),
            }),
            None => {
                let words = "no episode is running";
                self.refuse(query, Denied::new(FailureCode::NoEpisode, words));
            }
        }
        self.answer_acknowledged(false);
    }

    /// Answers the stop queries whose recorders have the manifest or have timed out;
    /// with `all`, every one.
    pub(super) fn answer_acknowledged(&mut self, all: bool) {
        if self.unacknowledged.is_empty() {
            return;
        }
        let now = Instant::now();
        let waiting = std::mem::take(&mut self.unacknowledged);
        let patience = Duration::from_secs(ACKNOWLEDGED_SECS);
        let (waiting, due): (Vec<_>, Vec<_>) = {
            let mut recorders = self.shared.recorders.lock();
            recorders.expire(now);
            let run = self.shared.outbox.run_id();
            waiting.into_iter().partition(|answer| {
                let header = answer.stopped.header.as_ref();
                let episode = header.map_or(0, |header| header.episode);
                !all && now.duration_since(answer.since) < patience
                    && recorders.is_anyone_recording(run, episode, &answer.participants, now)
            })
        };
        self.unacknowledged = waiting;
        for mut answer in due {
            let header = answer.stopped.header.as_ref();
            let episode = header.map_or(0, |header| header.episode);
            if !answer.stopped.discard {
                answer.stopped.unconfirmed_recorders = self.shared.recorders.lock().unconfirmed(
                    self.shared.outbox.run_id(),
                    episode,
                    &answer.participants,
                );
            }
            self.reply(answer.query, Ok(answer.stopped.encode_to_vec()));
        }
    }

    /// Announces an episode; simulation time resumes when its recorders are ready.
    /// Earlier images are already published.
    pub(super) fn start_episode(
        &mut self,
        request: v1::EpisodeStartRequest,
    ) -> Result<v1::EpisodeStarted, Denied> {
        if let Some(running) = &self.episode {
            let label = &running.started.label;
            let words = format!("episode {label:?} is running; stop it first");
            return Err(Denied::new(FailureCode::EpisodeRuns, words));
        }
        if let Some(words) = self.sim.broken() {
            let words = format!(
                "the state is broken, no episode can begin: {words}; request `reset` first"
            );
            return Err(Denied::new(FailureCode::Broken, words));
        }
        check::label(&request.label)?;
        check::instruction(request.instruction.as_deref().unwrap_or_default())?;
        let lock_step = self.sim.scenario().pacing == Pacing::LockStep;
        let shown = self.sim.is_shown();
        if shown {
            // A recording needs no commander.
        } else if lock_step {
            self.check_commander(&request.commander)?;
        } else if request.replay {
            return Err(Denied::new(
                FailureCode::Pacing,
                "`replay` switches off the rule that stops the chair when its commander falls \
                 silent: it is for lock-step, where time waits for every command; start a server \
                 with --pacing lock-step",
            ));
        }
        if request.practice && request.require_recorders > 0 {
            return Err(Denied::new(
                FailureCode::Invalid,
                "a practice episode is not recorded: require 0 recorders, or leave `practice` out",
            ));
        }
        if let Some(limit) = request.time_limit_seconds {
            check::within("time_limit_seconds", limit, 1.0, check::MAX_TIME_LIMIT)?;
        }
        // In lock-step, time waits for every connected recorder.
        let required = match lock_step && !request.practice {
            true => self
                .shared
                .recorders
                .lock()
                .present(Instant::now())
                .max(request.require_recorders as usize),
            false => request.require_recorders as usize,
        };
        self.shared.recorders.lock().begin();
        if !request.replay && !shown {
            self.sim.begin_episode(request.time_limit_seconds);
        }
        self.signals.restart();
        if let Some(command_delay) = &mut self.command_delay {
            command_delay.restart();
        }
        let snapshot = match shown {
            true => Vec::new(),
            false => self.sim.save().map_err(Denied::internal)?,
        };
        self.episodes += 1;
        let number = self.episodes;
        let tick = self.sim.snapshot().tick;
        let mut started = self.announcement(number, &request, shown);
        if let (Some(limit), Some(scenario)) = (request.time_limit_seconds, &mut started.scenario) {
            // Record the limit in force, so that a replay uses it.
            scenario.time_limit_seconds = Some(limit);
        }
        self.episode = Some(Episode {
            number,
            started: started.clone(),
            snapshot: snapshot.into(),
            stage: Stage::Waiting,
            replayed: request.replay,
            required,
            images: BTreeMap::new(),
            participants: Vec::new(),
            lost: Vec::new(),
            since: Instant::now(),
            running_since: Instant::now(),
        });
        if required > 0 {
            // An immediate status query must not report that the episode runs.
            let words = format!("recorders: 0 of {required} ready");
            self.waiting_for = Waits::new(WaitingFor::Recorders, words);
        }
        self.listen(Listening {
            episode: number,
            lock_step,
            replay: request.replay,
        });
        self.forget_anomalies();
        self.shared.outbox.put(number, tick, started.clone());
        Ok(started)
    }

    /// Announcement of an episode that begins at the present tick; `shown` when it
    /// plays back recorded states.
    fn announcement(
        &self,
        number: u64,
        request: &v1::EpisodeStartRequest,
        shown: bool,
    ) -> v1::EpisodeStarted {
        let scenario = self.sim.scenario();
        let task = self.sim.task();
        v1::EpisodeStarted {
            header: Some(self.shared.outbox.header(number, self.sim.snapshot().tick)),
            label: request.label.clone(),
            instruction: match &request.instruction {
                Some(instruction) => instruction.clone(),
                None => scenario.instruction.clone(),
            },
            scenario: Some(convert::scenario(scenario)),
            activity: task.map(|t| t.activity.clone()).unwrap_or_default(),
            area: task.map(|t| t.area.name.clone()).unwrap_or_default(),
            streams: TopicId::STATES.map(|s| s.name().to_owned()).to_vec(),
            cameras: self.camera_names(),
            sensors: self.sensor_names(),
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
            joint_types: (self.sim.scene().joints.iter())
                .map(|joint| joint.motion.joint_type().into())
                .collect(),
            robot: Some(describe::robot(self.sim.model(), &self.arm_mount())),
            physics_version: match shown {
                true => 0,
                false => wheelarm_proto::PHYSICS_VERSION,
            },
            as_recorded: shown,
            compressed_cameras: true,
            practice: request.practice,
        }
    }

    /// In lock-step, time waits for the holder of control; `wanted` must be that
    /// commander.
    fn check_commander(&self, wanted: &str) -> Result<(), Denied> {
        let command_gate = self.shared.command_gate.lock();
        let holder = command_gate.lease().holder().map(|h| h.life.name.as_str());
        match holder {
            Some(holder) if wanted.is_empty() || wanted == holder => Ok(()),
            Some(holder) => {
                let words = format!(
                    "in lock-step the simulation waits for one commander: the request names \
                     {wanted:?}, but {holder:?} holds control (query `lease`)"
                );
                Err(Denied::new(FailureCode::ControlHeld, words))
            }
            None => Err(Denied::new(
                FailureCode::NoControl,
                "in lock-step the simulation waits for one commander, and no commander holds control: \
                 ask for it first (query `lease`), or hold it from another terminal with \
                 `wheelarm lease hold`",
            )),
        }
    }

    /// Ends the running episode, after all its images are published, and publishes its
    /// manifest.
    pub(super) fn stop_episode(
        &mut self,
        discard: bool,
        cause: v1::EndCause,
    ) -> Option<v1::EpisodeStopped> {
        if let Some(render) = &self.render {
            // Publish images that have arrived; later ones are dropped.
            render
                .sensor_images()
                .set_tick(self.episode_number(), self.sim.snapshot().tick);
            render.sensor_images().settle();
        }
        let episode = self.episode.take()?;
        let tick = self.sim.snapshot().tick;
        let (cameras, sensors) = (self.camera_names(), self.sensor_names());
        let outbox = &self.shared.outbox;
        let mut manifest = outbox.manifest(episode.number, &cameras, &sensors);
        // Images that were due but never rendered count as missing.
        for line in &mut manifest {
            let stream = StreamId::parse(&line.stream);
            let camera = stream.camera_name().unwrap_or_default();
            let due = episode.images.get(camera).copied().unwrap_or_default();
            if due > line.count {
                line.count = due;
                line.last = line.first + due - 1;
            }
        }
        let stopped = v1::EpisodeStopped {
            header: Some(self.shared.outbox.header(episode.number, tick)),
            // A practice episode is never kept.
            discard: discard || episode.started.practice,
            evaluation: match &self.shown {
                Some(shown) => shown.evaluation.clone(),
                None => Some(convert::evaluation(self.sim.evaluation())),
            },
            manifest,
            wall_seconds: episode.running_since.elapsed().as_secs_f64(),
            cause: cause.into(),
            anomalies: self
                .anomalies
                .iter()
                .map(|(_, words)| words.clone())
                .collect(),
            anomaly_kinds: self
                .anomalies
                .iter()
                .map(|(kind, _)| (*kind).into())
                .collect(),
            unconfirmed_recorders: Vec::new(),
        };
        // Recorders may query the end as soon as it is published.
        self.ended.push_back(stopped.clone());
        if self.ended.len() > ENDED_EPISODES {
            self.ended.pop_front();
        }
        self.shared
            .outbox
            .put(episode.number, tick, stopped.clone());
        self.listen(Listening::default());
        self.pace.restart();
        Some(stopped)
    }

    /// Whether an announced episode may run; its recorders decide.
    pub(super) fn wait_for_recorders(&mut self) -> Next {
        let Some(episode) = &mut self.episode else {
            return Next::Wait(NAP);
        };
        let now = Instant::now();
        let (ready, failed, silent, present) = {
            let recorders = self.shared.recorders.lock();
            let run = self.shared.outbox.run_id();
            (
                recorders.ready(run, episode.number),
                recorders.failed(run, episode.number),
                recorders.silent(now),
                recorders.present(now),
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
        for name in &silent {
            text.push_str(&format!("; {name} does not answer"));
        }
        let patience = if present >= need {
            PRESENT_SECS
        } else {
            ABSENT_SECS
        };
        let too_long = episode.since.elapsed() > Duration::from_secs(patience);
        if !failed.is_empty() || too_long {
            let text = format!("episode ended before it began, {text}");
            self.event(v1::EventKind::Note, &text);
            self.end_episode(true, v1::EndCause::Recorders);
        }
        self.waiting_for = Waits::new(WaitingFor::Recorders, text);
        Next::Wait(NAP)
    }

    /// Reports lost recorders; they are not waited for any more.
    pub(super) fn report_lost_recorders(&mut self) {
        let Some(episode) = &mut self.episode else {
            return;
        };
        let lost = {
            let mut recorders = self.shared.recorders.lock();
            recorders.expire(Instant::now());
            recorders.lost_of(&episode.participants)
        };
        episode.participants.retain(|name| !lost.contains(name));
        episode.lost.extend(lost.iter().cloned());
        for name in lost {
            let words = format!("recorder {name} was lost in this episode");
            self.event(v1::EventKind::Note, &words);
        }
    }

    /// The recorder whose credit images or time have exceeded.
    pub(super) fn recorder_without_credit(&self) -> Option<String> {
        let episode = self.episode.as_ref()?;
        let published = Progress {
            // Includes images still being rendered: the cache holds no more.
            images: episode.images.values().sum(),
            tick: self.sim.snapshot().tick,
        };
        self.shared.recorders.lock().without_credit(
            self.shared.outbox.run_id(),
            episode.number,
            &episode.participants,
            published,
        )
    }

    /// Keeps the session open until the recorders have received the rest.
    pub(super) fn wait_for_files(&mut self, episode: u64, participants: &[String]) {
        let since = Instant::now();
        while since.elapsed() < Duration::from_secs(FAREWELL_SECS) {
            // Recorders query the manifest.
            while let Some(request) = self.shared.request_queue.next(false) {
                self.answer(request);
            }
            let mut recorders = self.shared.recorders.lock();
            let now = Instant::now();
            recorders.expire(now);
            let run = self.shared.outbox.run_id();
            let waiting = recorders.is_anyone_recording(run, episode, participants, now);
            drop(recorders);
            if !waiting {
                return;
            }
            self.shared.wakeup.wait(NAP);
        }
    }
}
