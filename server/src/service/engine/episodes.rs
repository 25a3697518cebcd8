//! How an episode goes: from its announcement, through the wait for its
//! recorders, to its manifest.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use wheelarm_proto::v1::{FailureCode, WaitingFor};
use wheelarm_proto::{Message, StreamId, TopicId, check, v1};

use super::{Engine, NAP, Next, Waits};
use crate::service::denied::Denied;
use crate::service::episode::{Episode, Stage, Unacknowledged};
use crate::service::inbox::Listening;
use crate::service::recorders::Progress;
use crate::service::{convert, describe};
use crate::sim::Pacing;

/// How long an announced episode waits for recorders that are not there, s.
const ABSENT_SECS: u64 = 30;

/// How long it waits for recorders that are there, but still finish files, s.
const PRESENT_SECS: u64 = 120;

/// How long a server that ends waits for its recorders to get the rest, s.
const FAREWELL_SECS: u64 = 10;

/// Longest wait for recorders to receive the manifest before `episode_stop` is answered, s.
/// What was lost on a slow line is fetched first.
const ACKNOWLEDGED_SECS: u64 = 10;

/// Ended episodes whose manifests are kept for recorders that ask late.
const ENDED_EPISODES: usize = 8;

impl Engine {
    /// Ends the episode and answers `asked` when its recorders have the manifest.
    pub(super) fn stop_for(
        &mut self,
        asked: Option<zenoh::query::Query>,
        discard: bool,
        cause: v1::EndCause,
    ) {
        let episode = self.episode.as_ref();
        let participants =
            episode.map_or_else(Vec::new, |e| [&e.participants[..], &e.lost[..]].concat());
        let stopped = self.stop_episode(discard, cause);
        let Some(asked) = asked else {
            return;
        };
        match stopped {
            Some(stopped) => self.unacknowledged.push(Unacknowledged {
                asked,
                stopped,
                participants,
                since: Instant::now(),
            }),
            None => {
                let words = "no episode is running";
                self.refuse(asked, Denied::new(FailureCode::NoEpisode, words));
            }
        }
        self.answer_acknowledged(false);
    }

    /// Answers those whose recorders have the manifest or have had their time, or `all`.
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
            self.reply(answer.asked, Ok(answer.stopped.encode_to_vec()));
        }
    }

    /// Announces an episode; simulation time goes on when its recorders are ready.
    /// What the cameras drew before it is out.
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
                "the state is broken, no episode can begin: {words}; ask for `reset` first"
            );
            return Err(Denied::new(FailureCode::Broken, words));
        }
        check::label(&request.label)?;
        check::instruction(request.instruction.as_deref().unwrap_or_default())?;
        let lock_step = self.sim.scenario().pacing == Pacing::LockStep;
        let shown = self.sim.is_shown();
        if shown {
            // Nobody commands what was recorded.
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
                "a practice episode is not recorded: ask for 0 recorders, or leave `practice` out",
            ));
        }
        if let Some(limit) = request.time_limit_seconds {
            check::within("time_limit_seconds", limit, 1.0, check::MAX_TIME_LIMIT)?;
        }
        // In lock-step time waits for every recorder that is there.
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
        if let Some(lag) = &mut self.lag {
            lag.restart();
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
            // The file says which limit was in force, and a replay takes it from there.
            scenario.time_limit_seconds = Some(limit);
        }
        self.episode = Some(Episode {
            number,
            started: started.clone(),
            snapshot: snapshot.into(),
            stage: Stage::Waiting,
            replayed: request.replay,
            required,
            pictures: BTreeMap::new(),
            participants: Vec::new(),
            lost: Vec::new(),
            since: Instant::now(),
            running_since: Instant::now(),
        });
        if required > 0 {
            // Whoever asks at once is not told that it runs.
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

    /// What is told of an episode that begins at the present tick; `shown` when it
    /// shows recorded states instead of simulating.
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

    /// In lock-step time waits for whoever holds control; `wanted` must be that one.
    fn check_commander(&self, wanted: &str) -> Result<(), Denied> {
        let inbox = self.shared.inbox.lock();
        let holder = inbox.lease().holder().map(|h| h.life.name.as_str());
        match holder {
            Some(holder) if wanted.is_empty() || wanted == holder => Ok(()),
            Some(holder) => {
                let words = format!(
                    "in lock-step the simulation waits for one commander: {wanted:?} is asked \
                     for, but {holder:?} holds control (query `lease`)"
                );
                Err(Denied::new(FailureCode::ControlHeld, words))
            }
            None => Err(Denied::new(
                FailureCode::NoControl,
                "in lock-step the simulation waits for one commander, and nobody holds control: \
                 ask for it first (query `lease`), or hold it from another terminal with \
                 `wheelarm lease hold`",
            )),
        }
    }

    /// Closes the running episode, whose pictures are all out, and publishes its
    /// manifest.
    pub(super) fn stop_episode(
        &mut self,
        discard: bool,
        cause: v1::EndCause,
    ) -> Option<v1::EpisodeStopped> {
        if let Some(render) = &self.render {
            // What has arrived is out, the rest never comes.
            render
                .sensed()
                .stands(self.episode_number(), self.sim.snapshot().tick);
            render.sensed().settle();
        }
        let episode = self.episode.take()?;
        let tick = self.sim.snapshot().tick;
        let (cameras, sensors) = (self.camera_names(), self.sensor_names());
        let outbox = &self.shared.outbox;
        let mut manifest = outbox.manifest(episode.number, &cameras, &sensors);
        // Pictures that fell due but were never drawn are missing, not absent.
        for line in &mut manifest {
            let stream = StreamId::parse(&line.stream);
            let camera = stream.camera_name().unwrap_or_default();
            let due = episode.pictures.get(camera).copied().unwrap_or_default();
            if due > line.count {
                line.count = due;
                line.last = line.first + due - 1;
            }
        }
        let stopped = v1::EpisodeStopped {
            header: Some(self.shared.outbox.header(episode.number, tick)),
            // Of a practice episode there is nothing to keep.
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
        // Whoever hears of the end may ask for it at once.
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

    /// Whether an announced episode may run, which its recorders decide.
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

    /// Those that were lost in the episode are not waited for any more.
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

    /// Whom the cameras, or time, have left too far behind.
    pub(super) fn recorder_without_credit(&self) -> Option<String> {
        let episode = self.episode.as_ref()?;
        let published = Progress {
            // Those that are still being drawn as well: the cache holds no more.
            pictures: episode.pictures.values().sum(),
            tick: self.sim.snapshot().tick,
        };
        self.shared.recorders.lock().without_credit(
            self.shared.outbox.run_id(),
            episode.number,
            &episode.participants,
            published,
        )
    }

    /// Keeps the session open until the recorders have got the rest.
    pub(super) fn wait_for_files(&mut self, episode: u64, participants: &[String]) {
        let since = Instant::now();
        while since.elapsed() < Duration::from_secs(FAREWELL_SECS) {
            // They ask for the manifest.
            while let Some(request) = self.shared.desk.next(false) {
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
            self.shared.signal.wait(NAP);
        }
    }
}
