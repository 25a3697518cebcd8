//! A synthetic motion for images: the chair drives from its start to the coffee
//! table within 6 s, the arm waves, the first object bobs. No physics.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use wheelarm_server::robot::RobotModel;
use wheelarm_server::scene::Scene;
use wheelarm_server::snapshot::{BodyState, JointState, Snapshot};

/// The state at `time` seconds.
pub fn moving(robot: &RobotModel, scene: &Scene, time: f64) -> Snapshot {
    let along = (time / 6.0).min(1.0);
    let root = Isometry3::from_parts(
        Translation3::new(-6.635 - 1.2 * along, 3.389 - 1.4 * along, 0.0),
        UnitQuaternion::from_euler_angles(0.0, 0.0, -std::f64::consts::FRAC_PI_2 * (1.0 + along)),
    );
    let mut positions = vec![0.0; robot.joints.len()];
    for (i, joint) in robot.joints.iter().enumerate() {
        let number = joint
            .name
            .strip_prefix("joint_")
            .and_then(|n| n.parse::<usize>().ok());
        if let Some(angle) = number.and_then(|n| robot.settings.home.get(n - 1)) {
            positions[i] = angle + 0.15 * (time + i as f64).sin();
        }
    }
    let body = |pose| BodyState {
        pose,
        linear: Vector3::zeros(),
        angular: Vector3::zeros(),
    };
    let mut objects: Vec<BodyState> = scene.objects.iter().map(|o| body(o.pose)).collect();
    if let Some(first) = objects.first_mut() {
        first.pose.translation.z += 0.05 * time.sin().abs();
    }
    Snapshot {
        tick: 0,
        joints: vec![JointState::default(); robot.joints.len()],
        links: robot
            .link_poses(&positions)
            .iter()
            .map(|p| body(root * p))
            .collect(),
        objects,
        skins: Vec::new(),
        furniture_joints: Vec::new(),
        sliding: scene
            .joints
            .iter()
            .map(|joint| BodyState::resting(scene.furniture[joint.furniture].pose))
            .collect(),
        contacts: Vec::new(),
        anomalies: Vec::new(),
        person: None,
    }
}
