//! The bundled robot loads and matches the manufacturers' data; a broken one is
//! rejected with the reason.

use std::path::{Path, PathBuf};

use nalgebra::{Point3, Vector3};

use super::*;

fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets")
}

#[test]
fn masses_add_up_to_the_catalogue() {
    let model = RobotModel::load(&assets(), "wheelarm").unwrap();
    let mass = |names: &dyn Fn(&str) -> bool| -> f64 {
        model
            .links
            .iter()
            .filter(|link| names(&link.name))
            .filter_map(|link| link.inertial.map(|inertial| inertial.mass))
            .sum()
    };
    let gripper = mass(&|name| name.starts_with("robotiq_85_"));
    assert!((gripper - 0.92086).abs() < 1e-4, "gripper {gripper} kg");
    let chair = mass(&|name| name.ends_with("_wheel") || name == "wheelchair_root");
    assert!((chair - 52.0).abs() < 1e-9, "chair {chair} kg");
    let start = model.link("base_link").unwrap();
    let arm: f64 = mass(&|name| {
        let link = model.link(name).unwrap();
        model.chain(start, link).is_some() && !name.starts_with("robotiq_85_")
    });
    assert!((arm - 7.1221).abs() < 1e-9, "arm {arm} kg");
}

#[test]
fn frames_are_at_their_mounts() {
    let model = RobotModel::load(&assets(), "wheelarm").unwrap();
    let poses = model.link_poses(&vec![0.0; model.joints.len()]);
    let at = |name: &str| poses[model.link(name).unwrap()];
    let base = at("base_link");
    assert!((base.translation.vector - Vector3::new(0.42, 0.36, 0.55)).norm() < 1e-12);
    assert!(
        (base * Vector3::x() + Vector3::x()).norm() < 1e-12,
        "yaw 180"
    );
    // The chair camera looks forward and down from the boom, upright; its former mount
    // is available by name.
    for (link, place, down) in [
        ("wheelchair_camera_frame", [0.15, 0.0, 1.75], 52f64),
        ("wheelchair_pole_camera_frame", [-0.05, 0.0, 1.35], 30.0),
    ] {
        let camera = at(link);
        assert!((camera.translation.vector - Vector3::from(place)).norm() < 1e-12);
        let (sin, cos) = down.to_radians().sin_cos();
        assert!((camera * Vector3::z() - Vector3::new(cos, 0.0, -sin)).norm() < 1e-12);
        assert!((camera * Vector3::x() + Vector3::y()).norm() < 1e-12);
    }
    // The inner knuckles' other pins are on the gripper's base at every angle.
    let hand = model.link("robotiq_85_base_link").unwrap();
    for knuckle in [0.0, 0.3, 0.7929] {
        let leader = model.joint("robotiq_85_left_knuckle_joint").unwrap();
        let positions: Vec<f64> = model
            .joints
            .iter()
            .enumerate()
            .map(|(i, joint)| match joint.mimic {
                Some((_, factor, offset)) => factor * knuckle + offset,
                None if i == leader => knuckle,
                None => 0.0,
            })
            .collect();
        let poses = model.link_poses(&positions);
        for (side, sign) in [("left", 1.0), ("right", -1.0)] {
            let link = model
                .link(&format!("robotiq_85_{side}_inner_knuckle_link"))
                .unwrap();
            let pin = poses[hand].inverse()
                * poses[link]
                * Point3::new(-sign * 0.0371575, 0.0, -0.04342168);
            assert!((pin - Point3::new(sign * 0.0127, 0.0, 0.06142)).norm() < 1e-9);
        }
    }
}

#[test]
fn broken_robots_are_refused_with_the_reason() {
    let folder = tempfile_folder("broken");
    let source = assets().join("robots/wheelarm");
    let toml = std::fs::read_to_string(source.join("robot.toml"))
        .unwrap()
        .replace("name = \"wheelarm\"", "name = \"broken\"");
    let urdf = std::fs::read_to_string(source.join("wheelarm.urdf")).unwrap();
    copy_folder(&source.join("meshes"), &folder.join("robots/broken/meshes"));
    let attempt = |toml: &str, urdf: &str| {
        let robot = folder.join("robots/broken");
        std::fs::create_dir_all(&robot).unwrap();
        std::fs::write(robot.join("robot.toml"), toml).unwrap();
        std::fs::write(robot.join("wheelarm.urdf"), urdf).unwrap();
        RobotModel::load(&folder, "broken")
    };
    let refused = |toml: &str, urdf: &str, words: &[&str]| {
        let text = attempt(toml, urdf).unwrap_err().to_string();
        for word in words {
            assert!(text.contains(word), "{text:?} lacks {word:?}");
        }
    };
    attempt(&toml, &urdf).unwrap();
    refused(
        &toml,
        &urdf.replace("\"joint_3\"", "\"elbow\""),
        &["no joint `joint_3`", "wheelarm.urdf"],
    );
    refused(
        &toml,
        &urdf.replace("lower=\"-2.24\"", "lower=\"2.5\""),
        &["joint joint_2", "2.5", "lower below upper"],
    );
    refused(
        &toml,
        &urdf.replace("ixx=\"0.046752\"", "ixx=\"-0.046752\""),
        &["link bicep_link", "positive definite"],
    );
    refused(
        &toml,
        &urdf.replace("name=\"pad\"", "name=\"pads\""),
        &["collision element `pad`"],
    );
    refused(
        &toml.replace("track = 0.496", "track = -0.496"),
        &urdf,
        &["drive.track", "-0.496", "greater than 0"],
    );
    refused(
        &toml.replace("dry_friction = [0.522,", "dry_friction = [-0.522,"),
        &urdf,
        &["arm.dry_friction[0]", "-0.522", "0 or more"],
    );
    refused(
        &toml.replace(
            "tyre_rolling_resistance = 0.015",
            "tyre_rolling_resistance = nan",
        ),
        &urdf,
        &["drive.tyre_rolling_resistance", "NaN", "0 or more"],
    );
    // Unknown keys of every table are rejected, with the line and the nearest known key.
    let line = |text: &str| {
        let before = toml.split(text).next().unwrap_or_default();
        format!("line {}", before.lines().count() + 1)
    };
    for (key, wrong) in [
        ("tool_length = 0.120", "tool_lenght = 0.120"),
        ("wheel_stiffness =", "wheel_stifness ="),
        ("dry_friction = [0.522", "dry_frictions = [0.522"),
        ("stroke = 0.085", "strok = 0.085"),
        ("palm_height = 0.042", "palm_hight = 0.042"),
        ("gyro_noise =", "gyro_nose ="),
    ] {
        let word = |text: &str| text.split(' ').next().unwrap_or_default().to_owned();
        let fix = format!("write `{}` in place of `{}`", word(key), word(wrong));
        refused(&toml.replace(key, wrong), &urdf, &[&fix, &line(key)]);
    }
    refused(
        &toml.replace("role = \"knuckle\" }", "role = \"knuckel\" }"),
        &urdf,
        &["write `knuckle` in place of `knuckel`"],
    );
    for (value, wrong, name, expected) in [
        (
            "tyre_friction = 1.0",
            "inf",
            "drive.tyre_friction",
            "0 to 2",
        ),
        (
            "wheel_stiffness = 1000.0",
            "0.0",
            "drive.wheel_stiffness",
            "N·m/rad",
        ),
        (
            "\nstiffness = 200.0",
            "nan",
            "gripper.stiffness",
            "0.1 to 100000 N·m/rad",
        ),
        (
            "knuckle_armature = 0.005",
            "-0.005",
            "gripper.knuckle_armature",
            "kg·m²",
        ),
        (
            "self_contact_joints = 4",
            "0",
            "arm.self_contact_joints",
            "1 to 15",
        ),
        (
            "finger_lever = 0.1",
            "0.05",
            "gripper.finger_lever",
            "at least 0.0571 m/rad",
        ),
        (
            "max_force = 235.0",
            "20.0",
            "gripper.force",
            "at most gripper.max_force, 20 N",
        ),
    ] {
        let key = value.split(" = ").next().unwrap_or_default();
        let changed = toml.replace(value, &format!("{key} = {wrong}"));
        assert_ne!(changed, toml, "{value}");
        refused(&changed, &urdf, &[name, expected]);
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

/// `wheelarm_wide` is `wheelarm` with another gripper: chair and arm are copies, which
/// `assets/tools/wide_gripper.py` renews.
#[test]
fn robots_with_another_gripper_share_chair_and_arm() {
    let [one, other] = ["wheelarm", "wheelarm_wide"].map(|name| {
        RobotModel::load(&assets(), name).unwrap_or_else(|problem| panic!("{problem}"))
    });
    let hand = one.roles.end_effector;
    assert_eq!(hand, other.roles.end_effector);
    // Links of the chair and the arm come before the hand; their meshes are one file.
    let mut copied = other.links[..hand].to_vec();
    for visual in copied.iter_mut().flat_map(|link| &mut link.visual) {
        if let Shape::Mesh { path, .. } = &mut visual.part.shape {
            *path = path.replace("wheelarm_wide/../", "");
        }
    }
    assert_eq!(one.links[..hand], copied);
    assert_eq!(one.joints[..hand - 1], other.joints[..hand - 1]);
    let (ours, theirs) = (&one.settings, &other.settings);
    assert_eq!(ours.drive, theirs.drive);
    assert_eq!(ours.arm, theirs.arm);
    assert_eq!(ours.imu, theirs.imu);
    assert_eq!(ours.seat, theirs.seat);
    assert_eq!(ours.cameras, theirs.cameras);
    assert_eq!(ours.shell_friction, theirs.shell_friction);
    assert_eq!(ours.home, theirs.home);
    let (ours, theirs) = (&ours.gripper, &theirs.gripper);
    assert!(theirs.stroke > 1.5 * ours.stroke && theirs.max_force < 0.5 * ours.max_force);
    assert!(theirs.closed > 1.1 * ours.closed);
}

fn tempfile_folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("wheelarm-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(folder.join("robots").join(name)).unwrap();
    folder
}

fn copy_folder(from: &Path, to: &Path) {
    let Ok(entries) = std::fs::read_dir(from) else {
        return;
    };
    std::fs::create_dir_all(to).unwrap();
    for entry in entries {
        let path = entry.unwrap().path();
        std::fs::copy(&path, to.join(path.file_name().unwrap())).unwrap();
    }
}
