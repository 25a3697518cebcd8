//! Between the messages of the contract and the types of the core: what is
//! simulated ([`scenario()`]), what stands there and how it goes (`scene`), what the
//! robot is asked and does (`robot`). Everything that enters goes through
//! `wheelarm_proto::check` first.

mod robot;
mod scenario;
mod scene;

pub use robot::{
    applied_groups, arm_problem, body_twist, control_input, frame_pose, reach_problem,
};
pub use scenario::{scenario, scenario_over};
pub use scene::{
    anomaly_kind, body_name, evaluation, fault_kind, furniture_joint, goal, goal_kind,
};
pub use wheelarm_proto::geometry::{isometry, pose, quaternion, vector};
