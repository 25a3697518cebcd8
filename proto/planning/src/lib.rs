//! Collision-free poses of a chair on the floor, and paths between them: the footprint
//! against oriented boxes, the floor map of a home with its distance fields, hybrid A*, and
//! the reach map of an arm.
//!
//! Pure: no clock, no random numbers, no messages, independent of server and clients.
//! Sampling in the server and the scripted operator use the same functions and get the
//! same result.

pub mod arm_access;
pub mod closed_hand;
pub mod distance_field;
pub mod floor_map;
pub mod floor_space;
pub mod footprint_check;
pub mod grid;
pub mod handle;
pub mod hinged_leaf;
pub mod hybrid_a_star;
mod lattice;
pub mod leaf_push;
mod nearby;
pub mod obb;
pub mod occupancy;
pub mod posture_routes;
pub mod postures;
pub mod price;
pub mod reach_map;
pub mod reached;
pub mod route_planner;
