//! Conversion of disturbances between message and scenario.

use wheelarm_proto::check::{self, Invalid};
use wheelarm_proto::v1;

use super::convert;
use crate::sim::{Disturbance, Disturbances, MAX_STRENGTH, Simulation};

/// Converts the disturbances of a scenario.
pub(super) fn to_proto(value: &Disturbances) -> v1::Disturbances {
    v1::Disturbances {
        seed: value.seed,
        noise: value.noise,
        pushes: value.pushes,
        slips: value.slips,
    }
}

/// Converts requested disturbances; `None` when every strength is 0.
///
/// # Errors
/// [`Invalid`] that names the field.
pub(super) fn from_proto(message: &v1::Disturbances) -> Result<Option<Disturbances>, Invalid> {
    let strength = |what, value: u32| {
        check::within(what, f64::from(value), 0.0, f64::from(MAX_STRENGTH)).map(|_| value)
    };
    let requested = Disturbances {
        seed: message.seed,
        noise: strength("disturbances.noise", message.noise)?,
        pushes: strength("disturbances.pushes", message.pushes)?,
        slips: strength("disturbances.slips", message.slips)?,
    };
    let any = requested.noise + requested.pushes + requested.slips > 0;
    Ok(any.then_some(requested))
}

/// The disturbance of one control tick as a message.
pub(super) fn message(of: &Disturbance, sim: &Simulation) -> v1::Disturbance {
    let pushed = of.push.map(|(on, _)| sim.body_of(on));
    let name = |body| convert::body_name(body, sim.model(), sim.scene());
    v1::Disturbance {
        header: None,
        joint_offsets: of.joints[1].to_vec(),
        wheel_factors: of.wheels.to_vec(),
        pushed: pushed.map_or_else(String::new, name),
        push_force: of.push.map(|(_, force)| convert::vector(&force)),
        grip_factor: of.grip,
    }
}
