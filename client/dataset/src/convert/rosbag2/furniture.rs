//! Topics of furniture on joints.

use std::sync::Arc;

use wheelarm_proto::v1;

use super::channel::{Channel, posed};
use crate::convert::links::{self, Descriptions};
use crate::convert::ros2::JointState;
use crate::read::Samples;

/// The joints, and the links below those that move; names are those of
/// `/furniture_description`.
pub(super) fn joints<'a>(
    out: &mut Vec<Channel<'a>>,
    samples: &Arc<Samples>,
    described: &'a Descriptions,
) {
    let names = samples.context().furniture_joints.clone();
    let furniture = described.furniture.as_ref();
    if let Some(moving) = furniture.map(|furniture| links::moving(furniture, &names)) {
        out.push(Channel::per_sample(
            "/tf",
            samples,
            move |m: v1::FurnitureJoints, stamp| posed(&moving, &m.positions, stamp),
        ));
    }
    out.push(Channel::per_sample(
        "/furniture/joint_states",
        samples,
        move |m: v1::FurnitureJoints, stamp| JointState {
            stamp,
            names: names.clone(),
            positions: m.positions,
            velocities: m.velocities,
            efforts: Vec::new(),
        },
    ));
}
