//! Starts and completes long operations: loading a scenario, waiting for cameras.

use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, TryRecvError};
use std::time::Duration;

use wheelarm_proto::v1::FailureCode;
use wheelarm_proto::{Message, v1};

use super::Engine;
use crate::service::denied::Denied;
use crate::service::pending_operation::{Loaded, PendingOperation};
use crate::service::render::RenderThread;
use crate::service::{assets, convert, packs};
use crate::sim::{Scenario, Simulation};

/// Longest CPU time for deformables to settle in a new scenario. CPU time, so that a
/// busy machine accepts the same scenarios as an idle one.
const SETTLING: Duration = Duration::from_secs(5);

/// CPU time of this thread.
fn on_processor() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    let seconds = u64::try_from(time.tv_sec).unwrap_or_default();
    let nanos = u32::try_from(time.tv_nsec).unwrap_or_default();
    Duration::new(seconds, nanos)
}

impl Engine {
    /// Starts loading another scenario.
    ///
    /// # Errors
    /// When an episode runs, or no thread can be started.
    pub(super) fn load(
        &self,
        mut scenario: Scenario,
        snapshot: bytes::Bytes,
        playback: bool,
    ) -> Result<Receiver<Result<Loaded, Denied>>, Denied> {
        if self.episode.is_some() {
            let words = "an episode is running; stop it before a reset";
            return Err(Denied::new(FailureCode::EpisodeRuns, words));
        }
        let (done, loading) = mpsc::sync_channel(1);
        let (folder, wakeup) = (
            self.sim.assets().to_owned(),
            Arc::clone(&self.shared.wakeup),
        );
        let known = self.options.packs.clone();
        let thread = std::thread::Builder::new().name("loading".to_owned());
        let thread = thread.spawn(move || {
            // Count from the first call, before the first settling tick: assets and the
            // base placement take extra time.
            let since = std::cell::OnceCell::new();
            let late = || {
                let since = *since.get_or_init(on_processor);
                on_processor().saturating_sub(since) > SETTLING
            };
            let mut load = || {
                packs::attach(&folder, &known, &mut scenario).map_err(Denied::scenario)?;
                let scenario = std::mem::take(&mut scenario);
                let made = match playback {
                    true => Simulation::for_playback(&folder, scenario, &late),
                    false => Simulation::new_within(&folder, scenario, &late),
                };
                let mut sim = made.map_err(Denied::scenario)?;
                if !snapshot.is_empty() {
                    sim.restore(&snapshot).map_err(Denied::scenario)?;
                }
                let asset_texts = assets::texts(&sim).map_err(Denied::internal)?;
                Ok(Loaded { sim, asset_texts })
            };
            let _ = done.send(load());
            wakeup.raise();
        });
        match thread {
            Ok(_) => Ok(loading),
            Err(e) => Err(Denied::internal(format!("cannot start a thread: {e}"))),
        }
    }

    /// Ends the running episode, if any, once its last images are published.
    pub(super) fn end_episode(&mut self, discard: bool, cause: v1::EndCause) {
        if self.episode.is_none() {
            return;
        }
        match self.pending_operation.take() {
            // A client already requested the end; only the cause changes.
            Some(PendingOperation::Stop { query, discard, .. }) => {
                self.pending_operation = Some(PendingOperation::Stop {
                    query,
                    discard,
                    cause,
                });
                return;
            }
            Some(PendingOperation::Start { query, .. }) => {
                let words = "another episode is running and about to end";
                self.refuse(query, Denied::new(FailureCode::EpisodeRuns, words));
            }
            Some(PendingOperation::Show { query, .. }) => {
                let words = "the episode ends, so no further state of it is shown";
                self.refuse(query, Denied::new(FailureCode::NoEpisode, words));
            }
            // No scenario is loaded while an episode runs.
            Some(PendingOperation::Load { .. } | PendingOperation::Place { .. }) | None => {}
        }
        self.pending_operation = Some(PendingOperation::Stop {
            query: None,
            discard,
            cause,
        });
    }

    /// Continues the pending operation.
    pub(super) fn proceed(&mut self) {
        while let Some(pending_operation) = self.pending_operation.take() {
            let drawn = self.render.as_ref().is_none_or(RenderThread::is_idle);
            match pending_operation {
                PendingOperation::Load {
                    query,
                    right,
                    loading,
                } => match loading.try_recv() {
                    Ok(Ok(loaded)) => {
                        let loaded = Box::new(loaded);
                        self.pending_operation = Some(PendingOperation::Place {
                            query,
                            right,
                            loaded,
                        });
                    }
                    Ok(Err(why)) => self.refuse(query, why),
                    Err(TryRecvError::Empty) => {
                        self.pending_operation = Some(PendingOperation::Load {
                            query,
                            right,
                            loading,
                        });
                        return;
                    }
                    Err(TryRecvError::Disconnected) => {
                        let why = "the scenario could not be set up (the log says why); the world \
                                   is as it was";
                        self.refuse(query, Denied::internal(why));
                    }
                },
                PendingOperation::Show { query, request } if self.cannot_show() => {
                    self.pending_operation = Some(PendingOperation::Show { query, request });
                    return;
                }
                PendingOperation::Show { query, request } => {
                    let answer = self.show(*request);
                    self.reply(query, answer.map(|ack| ack.encode_to_vec()));
                }
                waiting if !drawn => {
                    self.pending_operation = Some(waiting);
                    return;
                }
                PendingOperation::Place {
                    query,
                    right,
                    loaded,
                } => {
                    // Another client may have taken control since the request.
                    let answer = self.may_reset(&right).and_then(|()| self.place(*loaded));
                    self.reply(query, answer.map(|reply| reply.encode_to_vec()));
                }
                PendingOperation::Start { query, request } => {
                    let answer = self.start_episode(request);
                    self.reply(query, answer.map(|reply| reply.encode_to_vec()));
                }
                PendingOperation::Stop {
                    query,
                    discard,
                    cause,
                } => {
                    self.stop_for(query, discard, cause);
                }
            }
        }
    }

    /// Replaces the simulation; the former one stays when the cameras cannot be set up.
    fn place(&mut self, loaded: Loaded) -> Result<v1::ResetReply, Denied> {
        let Loaded { sim, asset_texts } = loaded;
        let names = |sim: &Simulation| -> Vec<String> {
            let objects = sim.scene().objects.iter();
            objects.map(|o| o.name.clone()).collect()
        };
        let (new, old) = (sim.scenario(), self.sim.scenario());
        let renders = self.render.as_ref().is_none_or(|r| r.failure().is_none());
        let same_cameras = renders && new.has_images_of(old) && names(&sim) == names(&self.sim);
        let before = std::mem::replace(&mut self.sim, sim);
        if !same_cameras && let Err(e) = self.start_cameras() {
            self.sim = before;
            self.start_cameras()
                .map_err(|again| Denied::internal(format!("{e}; then {again}")))?;
            return Err(Denied::scenario(e));
        }
        self.asset_texts = asset_texts;
        self.renew();
        Ok(v1::ResetReply {
            header: Some(self.stamp()),
            scenario: Some(convert::scenario(self.sim.scenario())),
        })
    }
}
