//! The query `playback`: plays back recorded states in place of simulated ones.

use nalgebra::{Isometry3, Point3, Vector3};
use wheelarm_proto::check::{self, Invalid};
use wheelarm_proto::v1;
use wheelarm_proto::v1::FailureCode;

use super::queries::decode;
use super::{Engine, NAP, Next, Waits};
use crate::service::convert;
use crate::service::denied::Denied;
use crate::service::episode::Stage;
use crate::service::render::RenderThread;
use crate::sim::{Pacing, RecordedSkin, RecordedState};
use crate::snapshot::{BodyState, JointState};

/// Why commands are rejected during playback.
const CLOSED: &str = "a recording is played back, nothing is simulated; request `reset` first";

/// Largest number of states of each kind.
const MOST: usize = 4096;

/// Latest tick that can be played back: a hundred years.
const LAST_TICK: u64 = 100 * 366 * 86_400 * wheelarm_proto::PHYSICS_HZ;

impl Engine {
    /// Decodes the request and checks whether a recorded state may be played back.
    pub(super) fn to_show(&self, payload: &[u8]) -> Result<v1::PlaybackRequest, Denied> {
        let request: v1::PlaybackRequest = decode(payload)?;
        if self.sim.scenario().pacing != Pacing::LockStep {
            let words = "recorded states are shown in lock-step only, where no time goes on by \
                         itself; start a server with --pacing lock-step";
            return Err(Denied::new(FailureCode::Pacing, words));
        }
        if self.episode.is_some() && !self.sim.is_shown() {
            let words = "a simulated episode is running; stop it before playing back a recording";
            return Err(Denied::new(FailureCode::EpisodeRuns, words));
        }
        self.may("a recording would take the place of its world", false, "")?;
        let now = self.sim.snapshot().tick;
        if request.tick > LAST_TICK {
            let words = format!(
                "tick {} is more than a hundred years from the start; show the tick that was \
                 recorded",
                request.tick
            );
            return Err(Denied::new(FailureCode::Invalid, words));
        }
        if self.episode.is_some() && request.tick <= now {
            let words = format!(
                "tick {} is shown after tick {now}; show the states of an episode in order",
                request.tick
            );
            return Err(Denied::new(FailureCode::Invalid, words));
        }
        Ok(request)
    }

    /// Whether the next state must wait for recorders, cameras or credit.
    pub(super) fn cannot_show(&self) -> bool {
        let waits = self
            .episode
            .as_ref()
            .is_some_and(|e| e.stage == Stage::Waiting);
        waits
            || self.paused
            || self.render.as_ref().is_some_and(RenderThread::is_full)
            || self.recorder_without_credit().is_some()
    }

    /// Plays back a state and publishes its recorded values.
    pub(super) fn show(&mut self, request: v1::PlaybackRequest) -> Result<v1::Ack, Denied> {
        let frames = self.sim.model().roles.frames.iter();
        let root = frames.map(|f| f.parent).position(|parent| parent.is_none());
        let recorded = recorded(&request, root.unwrap_or_default())?;
        let step = self.sim.show(&recorded);
        let step = step.map_err(|why| Denied::new(FailureCode::Invalid, why.to_string()))?;
        self.shared.command_gate.lock().close(CLOSED);
        self.shown = Some(request);
        // Nothing is published before recorders are ready; the first state is published
        // then.
        self.publish_state();
        self.draw(step.frames);
        Ok(v1::Ack {
            header: Some(self.stamp()),
        })
    }

    /// Publishes the current state as it was recorded.
    pub(super) fn publish_shown(&self) {
        let (Some(shown), outbox) = (&self.shown, &self.shared.outbox) else {
            return;
        };
        let (episode, tick) = (self.episode_number(), shown.tick);
        for sample in &shown.applied_samples {
            let at = sample.header.as_ref().map_or(tick, |h| h.tick);
            outbox.put(episode, at, sample.clone());
        }
        for sample in &shown.commands {
            let at = sample.header.as_ref().map_or(tick, |h| h.tick);
            outbox.put(episode, at, sample.clone());
        }
        for sample in &shown.imu_samples {
            let at = sample.header.as_ref().map_or(tick, |h| h.tick);
            outbox.put(episode, at, sample.clone());
        }
        macro_rules! put {
            ($($sample:expr),*) => {$(
                if let Some(sample) = &$sample {
                    outbox.put(episode, tick, sample.clone());
                }
            )*};
        }
        put!(
            shown.joints,
            shown.poses,
            shown.objects,
            shown.furniture,
            shown.deformable,
            shown.evaluation,
            shown.phase,
            shown.odometry,
            shown.contacts
        );
        let clock = v1::Clock {
            header: None,
            real_time_factor: 0.0,
        };
        outbox.put(episode, tick, clock);
    }

    /// What time waits for during playback.
    pub(super) fn next_shown(&mut self) -> Next {
        if let Some(episode) = &self.episode
            && episode.stage == Stage::Waiting
        {
            return self.wait_for_recorders();
        }
        self.report_lost_recorders();
        self.waiting_for = match self.recorder_without_credit() {
            Some(recorder) => Waits::new(v1::WaitingFor::Credit, format!("recorder {recorder}")),
            None => Waits::new(
                v1::WaitingFor::Commander,
                "the next state of the recording that is shown (`playback`), or a `reset`",
            ),
        };
        Next::Wait(NAP)
    }
}

/// Joint states as parallel lists; velocities and efforts may be absent.
fn joints(
    what: &'static str,
    positions: &[f64],
    velocities: &[f64],
    efforts: &[f64],
) -> Result<Vec<JointState>, Invalid> {
    check::few(what, positions, MOST)?;
    let at = |list: &[f64], i: usize| list.get(i).copied().unwrap_or_default();
    let all = positions.iter().enumerate().map(|(i, &position)| {
        Ok(JointState {
            position: check::within(what, position, -1e6, 1e6)?,
            velocity: check::within(what, at(velocities, i), -1e6, 1e6)?,
            effort: check::within(what, at(efforts, i), -1e9, 1e9)?,
        })
    });
    all.collect()
}

fn body(
    what: &'static str,
    pose: Option<&v1::Pose>,
    twist: Option<&v1::Twist>,
) -> Result<BodyState, Invalid> {
    let vector = |v: Option<&v1::Vector3>| -> Result<Vector3<f64>, Invalid> {
        match v {
            Some(v) => Ok(Vector3::from(check::vector(what, Some(v))?)),
            None => Ok(Vector3::zeros()),
        }
    };
    let pose: Isometry3<f64> = convert::isometry(what, pose)?;
    Ok(BodyState {
        pose,
        linear: vector(twist.and_then(|t| t.linear.as_ref()))?,
        angular: vector(twist.and_then(|t| t.angular.as_ref()))?,
    })
}

/// Converts the state of a request and checks every number; `root` is the frame of the
/// robot's root link.
fn recorded(request: &v1::PlaybackRequest, root: usize) -> Result<RecordedState, Invalid> {
    let default = v1::JointState::default();
    let state = request.joints.as_ref().unwrap_or(&default);
    let root = request.poses.as_ref().and_then(|p| p.frames.get(root));
    let root = body(
        "poses",
        root.and_then(|f| f.pose.as_ref()),
        root.and_then(|f| f.twist.as_ref()),
    )?;
    let objects = request.objects.clone().unwrap_or_default();
    check::few("objects", &objects.poses, MOST)?;
    let twists = objects
        .twists
        .iter()
        .map(Some)
        .chain(std::iter::repeat(None));
    let bodies = objects.poses.iter().zip(twists);
    let bodies = bodies.map(|(pose, twist)| body("objects", Some(pose), twist));
    let furniture = request.furniture.clone().unwrap_or_default();
    let skin = request.deformable.as_ref().map(|soft| {
        let (points, _) = soft.vertices.as_chunks::<3>();
        let points = points.iter().map(|&[x, y, z]| {
            for value in [x, y, z] {
                check::within("deformable", f64::from(value), -1e6, 1e6)?;
            }
            Ok(Point3::new(x, y, z))
        });
        Ok::<_, Invalid>(RecordedSkin {
            vertices: points.collect::<Result<Vec<_>, Invalid>>()?,
            elastic_energy: check::finite("deformable", soft.elastic_energy)?,
            kinetic_energy: check::finite("deformable", soft.kinetic_energy)?,
        })
    });
    Ok(RecordedState {
        tick: request.tick,
        joints: joints(
            "joints",
            &state.positions,
            &state.velocities,
            &state.efforts,
        )?,
        root,
        objects: bodies.collect::<Result<_, _>>()?,
        furniture_joints: joints(
            "furniture",
            &furniture.positions,
            &furniture.velocities,
            &[],
        )?,
        skin: skin.transpose()?,
    })
}
