//! How acts that take long are begun and ended: a scenario is read, cameras
//! finish what they draw.

use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, TryRecvError};
use std::time::Duration;

use wheelarm_proto::v1::FailureCode;
use wheelarm_proto::{Message, v1};

use super::Engine;
use crate::service::denied::Denied;
use crate::service::errand::{Errand, Loaded};
use crate::service::render::RenderThread;
use crate::service::{assets, convert};
use crate::sim::{Scenario, Simulation};

/// Longest time for soft objects to settle in a new scenario, on the processor: a
/// busy machine refuses nothing that an idle one takes.
const SETTLING: Duration = Duration::from_secs(5);

/// Time that this thread has run on a processor.
fn on_processor() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    let seconds = u64::try_from(time.tv_sec).unwrap_or_default();
    let nanos = u32::try_from(time.tv_nsec).unwrap_or_default();
    Duration::new(seconds, nanos)
}

impl Engine {
    /// Begins to set up another scenario.
    ///
    /// # Errors
    /// When an episode runs, or no thread can be started.
    pub(super) fn load(
        &self,
        scenario: Scenario,
        snapshot: bytes::Bytes,
        playback: bool,
    ) -> Result<Receiver<Result<Loaded, Denied>>, Denied> {
        if self.episode.is_some() {
            let words = "an episode is running; stop it before a reset";
            return Err(Denied::new(FailureCode::EpisodeRuns, words));
        }
        let (done, loading) = mpsc::sync_channel(1);
        let (folder, signal) = (
            self.sim.assets().to_owned(),
            Arc::clone(&self.shared.signal),
        );
        let thread = std::thread::Builder::new().name("loading".to_owned());
        let thread = thread.spawn(move || {
            // Counted from when it is first asked, before the first tick of settling:
            // assets and the way of a start take time of their own.
            let since = std::cell::OnceCell::new();
            let late = || {
                let since = *since.get_or_init(on_processor);
                on_processor().saturating_sub(since) > SETTLING
            };
            let load = || {
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
            signal.raise();
        });
        match thread {
            Ok(_) => Ok(loading),
            Err(e) => Err(Denied::internal(format!("no thread can be started: {e}"))),
        }
    }

    /// Ends the running episode, if there is one, as soon as its last pictures
    /// are out.
    pub(super) fn end_episode(&mut self, discard: bool, cause: v1::EndCause) {
        if self.episode.is_none() {
            return;
        }
        match self.errand.take() {
            // A client has asked for the end; this is why it comes.
            Some(Errand::Stop { asked, discard, .. }) => {
                self.errand = Some(Errand::Stop {
                    asked,
                    discard,
                    cause,
                });
                return;
            }
            Some(Errand::Start { asked, .. }) => {
                let words = "another episode is running and just ends";
                self.refuse(asked, Denied::new(FailureCode::EpisodeRuns, words));
            }
            Some(Errand::Show { asked, .. }) => {
                let words = "the episode ends, so no further state of it is shown";
                self.refuse(asked, Denied::new(FailureCode::NoEpisode, words));
            }
            // A scenario is not set up while an episode runs.
            Some(Errand::Load { .. } | Errand::Place { .. }) | None => {}
        }
        self.errand = Some(Errand::Stop {
            asked: None,
            discard,
            cause,
        });
    }

    /// Goes on with what was begun.
    pub(super) fn proceed(&mut self) {
        while let Some(errand) = self.errand.take() {
            let drawn = self.render.as_ref().is_none_or(RenderThread::is_idle);
            match errand {
                Errand::Load {
                    asked,
                    right,
                    loading,
                } => match loading.try_recv() {
                    Ok(Ok(loaded)) => {
                        let loaded = Box::new(loaded);
                        self.errand = Some(Errand::Place {
                            asked,
                            right,
                            loaded,
                        });
                    }
                    Ok(Err(why)) => self.refuse(asked, why),
                    Err(TryRecvError::Empty) => {
                        self.errand = Some(Errand::Load {
                            asked,
                            right,
                            loading,
                        });
                        return;
                    }
                    Err(TryRecvError::Disconnected) => {
                        let why = "the scenario could not be set up (the log says why); the world \
                                   is as it was";
                        self.refuse(asked, Denied::internal(why));
                    }
                },
                Errand::Show { asked, request } if self.cannot_show() => {
                    self.errand = Some(Errand::Show { asked, request });
                    return;
                }
                Errand::Show { asked, request } => {
                    let answer = self.show(*request);
                    self.reply(asked, answer.map(|ack| ack.encode_to_vec()));
                }
                waiting if !drawn => {
                    self.errand = Some(waiting);
                    return;
                }
                Errand::Place {
                    asked,
                    right,
                    loaded,
                } => {
                    // Somebody may have taken control since it was asked for.
                    let answer = self.may_reset(&right).and_then(|()| self.place(*loaded));
                    self.reply(asked, answer.map(|reply| reply.encode_to_vec()));
                }
                Errand::Start { asked, request } => {
                    let answer = self.start_episode(request);
                    self.reply(asked, answer.map(|reply| reply.encode_to_vec()));
                }
                Errand::Stop {
                    asked,
                    discard,
                    cause,
                } => {
                    self.stop_for(asked, discard, cause);
                }
            }
        }
    }

    /// Puts a simulation in the place of the one in force, which stays when the
    /// cameras cannot be set up for it.
    fn place(&mut self, loaded: Loaded) -> Result<v1::ResetReply, Denied> {
        let Loaded { sim, asset_texts } = loaded;
        let names = |sim: &Simulation| -> Vec<String> {
            let objects = sim.scene().objects.iter();
            objects.map(|o| o.name.clone()).collect()
        };
        let (new, old) = (sim.scenario(), self.sim.scenario());
        let drawn = |of: &Scenario| of.person.as_ref().and_then(|person| person.drawn.clone());
        let drawing = self.render.as_ref().is_none_or(|r| r.failure().is_none());
        let same_cameras = drawing
            && new.cameras == old.cameras
            && new.sensors == old.sensors
            && (new.sensors.is_empty() || new.seed == old.seed)
            && new.scene == old.scene
            && new.robot == old.robot
            && new.task == old.task
            && new.quality == old.quality
            && new.look == old.look
            && drawn(new) == drawn(old)
            && names(&sim) == names(&self.sim);
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
