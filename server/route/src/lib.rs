//! Where a chair fits on the floor and how it drives there: the footprint against
//! oriented boxes, hybrid A* between two poses.
//!
//! Pure: no clock, no random numbers, no messages, nothing of the server or of a
//! client. A draw of the server and the scripted operator ask the same question
//! and get the same answer.

pub mod footprint_check;
pub mod hybrid_a_star;
mod nearby;
pub mod obb;
