//! Base placements and paths of the chair: the footprint against oriented boxes, hybrid A*
//! between two poses.
//!
//! Pure: no clock, no random numbers, no messages. The server's sampling of starts and the
//! scripted operator use the same search and get the same result.

pub mod footprint_check;
pub mod hybrid_a_star;
mod nearby;
pub mod obb;
