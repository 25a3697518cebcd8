//! Playback of recorded states in place of simulated ones: new images of an episode
//! from another version of the physics.
//!
//! Only the poses of links are computed, from joints; the world does not move.

use std::sync::Arc;

use wheelarm_proto::furniture::JointMotion;

use super::{Simulation, Step};
use crate::snapshot::{BodyState, JointState, PersonState, Snapshot};

/// One recorded state.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedState {
    /// Physics tick, 240 per second.
    pub tick: u64,
    /// The recorded joints, in the order of [`Simulation::recorded_joints`].
    pub joints: Vec<JointState>,
    /// The robot's root link in `house`.
    pub root: BodyState,
    /// Objects in the order of `Scene::objects`.
    pub objects: Vec<BodyState>,
    /// Furniture on joints, in the order of `Scene::joints`.
    pub furniture_joints: Vec<JointState>,
    /// Shape of the deformable; unchanged when absent.
    pub skin: Option<RecordedSkin>,
}

/// The recorded shape of a deformable.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedSkin {
    /// Vertices in `house`, metres.
    pub vertices: Vec<nalgebra::Point3<f32>>,
    /// Elastic energy, J.
    pub elastic_energy: f64,
    /// Kinetic energy, J.
    pub kinetic_energy: f64,
}

/// Why a recorded state does not match the simulation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "the recorded state has {found} {what}, the scenario in force {expected}; reset to the \
     recording's scenario first"
)]
pub struct IncompatibleState {
    /// What differs in number.
    pub what: &'static str,
    /// Number in the recording.
    pub found: usize,
    /// Number in the scenario in force.
    pub expected: usize,
}

fn same(what: &'static str, found: usize, expected: usize) -> Result<(), IncompatibleState> {
    match found == expected {
        true => Ok(()),
        false => Err(IncompatibleState {
            what,
            found,
            expected,
        }),
    }
}

impl Simulation {
    /// Plays back a recorded state. Until another scenario is set up, no step runs and
    /// nothing is evaluated, hashed or saved.
    ///
    /// # Errors
    /// [`IncompatibleState`]; the previous state stays.
    pub fn show(&mut self, recorded: &RecordedState) -> Result<Step, IncompatibleState> {
        let snapshot = self.snapshot_of(recorded)?;
        self.snapshot = Arc::new(snapshot);
        self.shown = true;
        Ok(Step {
            imu: Vec::new(),
            frames: self.frames_now(),
        })
    }

    /// Whether recorded states are played back.
    #[must_use]
    pub fn is_shown(&self) -> bool {
        self.shown
    }

    fn snapshot_of(&self, recorded: &RecordedState) -> Result<Snapshot, IncompatibleState> {
        let now = &self.snapshot;
        let recorded_joints = self.model.roles.joints.len();
        same("joints", recorded.joints.len(), recorded_joints)?;
        same("objects", recorded.objects.len(), now.objects.len())?;
        let slides = recorded.furniture_joints.len();
        same("furniture joints", slides, now.furniture_joints.len())?;
        let mut skins = now.skins.clone();
        if let Some(skin) = &recorded.skin {
            same("soft objects", 1, skins.len())?;
            same("vertices", skin.vertices.len(), skins[0].vertices.len())?;
            skins[0].vertices.clone_from(&skin.vertices);
            skins[0].elastic_energy = skin.elastic_energy;
            skins[0].kinetic_energy = skin.kinetic_energy;
        }
        let joints = self.joints_of(&recorded.joints);
        let positions: Vec<f64> = joints.iter().map(|j| j.position).collect();
        let root = &recorded.root;
        let links = self.model.link_poses(&positions).into_iter();
        let sliding = self.scene.joints.iter().zip(&recorded.furniture_joints);
        let sliding = sliding.map(|(joint, state)| {
            let closed = self.scene.furniture[joint.furniture].pose;
            let velocity = joint.axis.into_inner() * state.velocity;
            let still = BodyState::resting(joint.pose(&closed, state.position));
            match joint.motion {
                JointMotion::Slides => BodyState {
                    linear: velocity,
                    ..still
                },
                JointMotion::Turns => BodyState {
                    angular: velocity,
                    ..still
                },
            }
        });
        Ok(Snapshot {
            tick: recorded.tick,
            joints,
            links: links
                .map(|own_from_link| root.carrying(own_from_link))
                .collect(),
            objects: recorded.objects.clone(),
            skins,
            furniture_joints: recorded.furniture_joints.clone(),
            sliding: sliding.collect(),
            contacts: Vec::new(),
            person: self.motion.map(|motion| PersonState {
                head: motion.head_pose(recorded.tick),
                ..PersonState::default()
            }),
            anomalies: Vec::new(),
        })
    }

    /// All joints from the recorded ones; the others follow these or are 0.
    fn joints_of(&self, recorded: &[JointState]) -> Vec<JointState> {
        let mut joints = vec![None; self.model.joints.len()];
        for (role, &state) in self.model.roles.joints.iter().zip(recorded) {
            joints[role.joint] = Some(state);
        }
        let message = joints.clone();
        for (joint, state) in self.model.joints.iter().zip(&mut joints) {
            if let (None, Some((leader, times, plus))) = (&state, joint.mimic) {
                *state = message[leader].map(|leader| JointState {
                    position: leader.position * times + plus,
                    velocity: leader.velocity * times,
                    effort: 0.0,
                });
            }
        }
        joints.into_iter().map(Option::unwrap_or_default).collect()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::robot::control::{BaseIntent, ControlInput};
    use crate::sim::tests::{scenario, simulation};

    fn recorded(sim: &Simulation) -> RecordedState {
        let snapshot = sim.snapshot();
        RecordedState {
            tick: snapshot.tick,
            joints: sim.recorded_joints().to_vec(),
            root: snapshot.links[0],
            objects: snapshot.objects.clone(),
            furniture_joints: snapshot.furniture_joints.clone(),
            skin: snapshot.skins.first().map(|skin| RecordedSkin {
                vertices: skin.vertices.clone(),
                elastic_energy: skin.elastic_energy,
                kinetic_energy: skin.kinetic_energy,
            }),
        }
    }

    fn apart(a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
        (a.translation.vector - b.translation.vector).norm() + a.rotation.angle_to(&b.rotation)
    }

    #[test]
    fn a_played_back_state_equals_the_recorded_one() {
        for task in ["place_teddy_bear", "open_drawer"] {
            let mut sim = simulation(scenario(task));
            let drive = ControlInput {
                base: Some(BaseIntent {
                    linear: 0.3,
                    angular: 0.5,
                }),
                ..ControlInput::default()
            };
            for _ in 0..20 {
                sim.step(&drive);
            }
            let mut other = simulation(scenario(task));
            assert!(!other.is_shown());
            other.show(&recorded(&sim)).expect("it fits");
            assert!(other.is_shown() && other.hash_due().is_none() && other.save().is_err());
            let (was, is) = (sim.snapshot(), other.snapshot());
            assert_eq!((was.tick, &was.skins), (is.tick, &is.skins));
            for (was, is) in was.links.iter().zip(&is.links) {
                assert!(apart(&was.pose, &is.pose) < 1e-4, "{was:?} {is:?}");
            }
            for (was, is) in was.sliding.iter().zip(&is.sliding) {
                assert!(apart(&was.pose, &is.pose) < 1e-4, "{was:?} {is:?}");
            }
            assert_eq!(other.recorded_joints().to_vec(), recorded(&sim).joints);
            // A step does not move a played-back state.
            other.step(&drive);
            assert_eq!(other.snapshot().tick, was.tick);
        }
    }

    #[test]
    fn a_state_of_another_scene_is_rejected_without_change() {
        let mut sim = simulation(scenario("pick_mustard"));
        let mut wrong = recorded(&sim);
        wrong.objects.pop();
        let before = Arc::clone(sim.snapshot());
        let refused = sim.show(&wrong).map(|_| ()).unwrap_err();
        assert!(refused.to_string().contains("objects"), "{refused}");
        assert!(!sim.is_shown());
        assert_eq!(&before, sim.snapshot());
    }
}
