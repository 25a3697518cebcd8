//! Conversions between messages of the contract and types of the core: scenario
//! ([`scenario()`]), scene and task (`scene`), commands and robot state (`robot`).
//! Every incoming message is checked by `wheelarm_proto::check` first.

mod map;
mod robot;
mod scenario;
mod scene;

pub use map::home_map;
pub use robot::{
    applied_groups, arm_problem, body_twist, control_input, frame_pose, reach_problem,
};
pub use scenario::{scenario, scenario_over};
pub use scene::{
    anomaly_kind, body_name, evaluation, fault_kind, furniture_joint, goal, goal_kind,
};
pub use wheelarm_proto::geometry::{isometry, pose, quaternion, vector};
