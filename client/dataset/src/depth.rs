//! Depth as 16-bit millimetres, the convention of ROS REP 118 and of RGB-D
//! cameras: 0 means no measurement.

pub use wheelarm_proto::settings::Depth;

pub(crate) use crate::compress::depth::{millimetres, to_millimetres};

/// Attribute of a millimetre dataset.
pub const MILLIMETRES_NOTE: &str =
    "0 where nothing is hit (+inf) or the surface is farther than 65.535 m";
