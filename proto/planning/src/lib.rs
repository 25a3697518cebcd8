//! Collision-free poses of a chair on the floor, and paths between them: the footprint
//! against oriented boxes, and hybrid A*.
//!
//! Pure: no clock, no random numbers, no messages, independent of server and clients.
//! Sampling in the server and the scripted operator use the same functions and get the
//! same result.

pub mod footprint_check;
pub mod hybrid_a_star;
mod nearby;
pub mod obb;
