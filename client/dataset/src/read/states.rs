//! The states of a recording as the messages they were, for showing them again.

use std::collections::BTreeMap;

use wheelarm_proto::{Topic, v1};

use super::Episode;
use super::error::ReadError;

impl Episode {
    /// Every recorded state of robot, objects and furniture, with what was
    /// applied and judged, oldest first: what the query `playback` takes.
    ///
    /// # Errors
    /// When a stream is absent or cannot be read.
    pub fn states(&self) -> Result<Vec<v1::PlaybackRequest>, ReadError> {
        let (robot, roles) = self.roles()?;
        let joints = self.messages_of::<v1::JointState>()?;
        let mut poses = self.by_tick::<v1::PoseSet>()?;
        let mut objects = self.by_tick::<v1::ObjectPoses>()?;
        let mut furniture = self.by_tick::<v1::FurnitureJoints>()?;
        let mut evaluations = self.by_tick::<v1::Evaluation>()?;
        let mut shapes = self.by_tick::<v1::Deformable>()?;
        let mut phases = self.by_tick::<v1::PhaseSample>()?;
        let mut contacts = self.by_tick::<v1::Contacts>()?;
        let mut odometry = self.by_tick::<v1::Odometry>()?;
        let mut imu = self.messages_of::<v1::Imu>()?.into_iter().peekable();
        let mut applied = self.messages_of::<v1::Applied>()?.into_iter().peekable();
        let mut commands = self.messages_of::<v1::CommandLog>()?.into_iter().peekable();
        let last = joints.len().saturating_sub(1);
        let states = joints
            .into_iter()
            .enumerate()
            .map(|(index, (tick, mut joints))| {
                // What came behind the last state goes with it.
                let until = if index == last { u64::MAX } else { tick };
                // The first recordings lack it; it follows from the knuckle.
                if joints.opening.is_none() {
                    let knuckle = joints.positions.get(roles.knuckle);
                    joints.opening = knuckle.and_then(|&knuckle| robot.opening(knuckle));
                }
                v1::PlaybackRequest {
                    tick,
                    joints: Some(joints),
                    poses: Some(poses.remove(&tick).unwrap_or_default()),
                    objects: Some(objects.remove(&tick).unwrap_or_default()),
                    furniture: Some(furniture.remove(&tick).unwrap_or_default()),
                    deformable: shapes.remove(&tick),
                    applied_samples: up_to(&mut applied, until),
                    commands: up_to(&mut commands, until),
                    evaluation: evaluations.remove(&tick),
                    phase: phases.remove(&tick),
                    odometry: odometry.remove(&tick),
                    contacts: contacts.remove(&tick),
                    imu_samples: up_to(&mut imu, until),
                }
            });
        Ok(states.collect())
    }

    fn by_tick<M: Topic>(&self) -> Result<BTreeMap<u64, M>, ReadError> {
        Ok(self.messages_of()?.into_iter().collect())
    }
}

/// Those that come next and are not later than a tick.
fn up_to<M>(
    samples: &mut std::iter::Peekable<impl Iterator<Item = (u64, M)>>,
    tick: u64,
) -> Vec<M> {
    std::iter::from_fn(|| samples.next_if(|(at, _)| *at <= tick))
        .map(|(_, sample)| sample)
        .collect()
}
