//! Depth as 16-bit millimetres, the convention of ROS REP 118 and of RGB-D
//! cameras: 0 means that nothing was measured.

pub use wheelarm_proto::settings::Depth;

pub(crate) use crate::compress::depth::{millimetres, to_millimetres};

/// What the attribute of a millimetre dataset says.
pub const MILLIMETRES_NOTE: &str =
    "0 where nothing is hit (+inf) or the surface is farther than 65.535 m";
