//! Lens and mount of the cameras of one robot specimen.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::scenario::{CameraPlace, HOUSE, Lens, Scenario, ScenarioError};
use crate::appearance::camera_error;
use crate::robot::{CameraMount, RobotModel};

/// Fills in the values sampled from `calibration_seed`, and the offsets of the appearance,
/// for robot cameras without their own lens or mount. Each camera has its own random
/// stream, independent of the other cameras.
///
/// # Errors
/// [`ScenarioError::CameraFrame`] for a mount in an unknown frame.
pub(super) fn sample(scenario: &mut Scenario, model: &RobotModel) -> Result<(), ScenarioError> {
    for camera in &mut scenario.cameras {
        if let Some(place) = &camera.place {
            check_place(model, &camera.name, place)?;
        }
        let mounts = &model.settings.cameras;
        let Some(index) = mounts.iter().position(|m| m.name == camera.name) else {
            continue;
        };
        let mount = &mounts[index];
        let (mut lens, mut place) = match scenario.calibration_seed {
            Some(seed) => {
                let mut random = ChaCha8Rng::seed_from_u64(seed);
                random.set_stream(1 + index as u64);
                let (lens, place) = specimen(&mut random, model, mount);
                (Some(lens), place)
            }
            None => (None, None),
        };
        let error = scenario
            .appearance
            .map(|appearance| camera_error(&appearance, index));
        if let Some(focal) = error.and_then(|error| error.focal) {
            let lens = lens.get_or_insert(described(mount));
            lens.focal = lens.focal.map(|f| f * focal);
        }
        if let Some(moved) = error.and_then(|error| error.moved)
            && let Some(at) = place.take().or_else(|| nominal(model, mount))
        {
            place = Some(CameraPlace {
                pose: at.pose * moved,
                ..at
            });
        }
        camera.lens = camera.lens.or(lens);
        if camera.place.is_none() {
            camera.place = place;
        }
    }
    Ok(())
}

/// The lens in the robot's description.
fn described(mount: &CameraMount) -> Lens {
    Lens {
        size: mount.size,
        focal: mount.focal,
        principal: mount.principal,
    }
}

fn check_place(model: &RobotModel, camera: &str, place: &CameraPlace) -> Result<(), ScenarioError> {
    let frames = &model.roles.frames;
    if place.frame == HOUSE || frames.iter().any(|frame| frame.name == place.frame) {
        return Ok(());
    }
    let mut known: Vec<_> = frames.iter().map(|frame| frame.name.as_str()).collect();
    known.push(HOUSE);
    Err(ScenarioError::CameraFrame {
        camera: camera.to_owned(),
        frame: place.frame.clone(),
        known: known.join(", "),
    })
}

/// One specimen of a camera; no mount when no recorded frame carries it rigidly.
fn specimen(
    random: &mut ChaCha8Rng,
    model: &RobotModel,
    mount: &CameraMount,
) -> (Lens, Option<CameraPlace>) {
    // Uniform from 53 bits, -1 to 1; does not depend on a library's sampling.
    let mut within = |most: f64| {
        let share = (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
        (2.0 * share - 1.0) * most
    };
    let tolerance = &mount.tolerance;
    let scale = 1.0 + within(tolerance.focal);
    let principal = mount.principal.map(|p| p + within(tolerance.principal));
    let lens = Lens {
        size: mount.size,
        focal: mount.focal.map(|f| f * scale),
        principal,
    };
    let moved = Vector3::from_fn(|_, _| within(tolerance.position));
    let turned = Vector3::from_fn(|_, _| within(tolerance.rotation_deg.to_radians()));
    let off = Isometry3::from_parts(
        Translation3::from(moved),
        UnitQuaternion::from_scaled_axis(turned),
    );
    let place = nominal(model, mount).map(|place| CameraPlace {
        pose: place.pose * off,
        ..place
    });
    (lens, place)
}

/// Mount of a camera in the description, in the recorded frame that carries it.
fn nominal(model: &RobotModel, mount: &CameraMount) -> Option<CameraPlace> {
    let link = model.link(&mount.link)?;
    // A rigidly attached link does not move relative to the frame when all joints move.
    let [still, moved] = [0.0, 0.1].map(|q| model.link_poses(&vec![q; model.joints.len()]));
    let rigid = |frame: usize| {
        let [a, b] = [&still, &moved].map(|poses| poses[frame].inverse() * poses[link]);
        (a.translation.vector - b.translation.vector).norm() < 1e-9
            && a.rotation.angle_to(&b.rotation) < 1e-9
    };
    let frame = model.roles.frames.iter().find(|frame| rigid(frame.link))?;
    Some(CameraPlace {
        frame: frame.name.clone(),
        pose: still[frame.link].inverse() * still[link] * mount.pose,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::appearance::Appearance;

    fn drawn(seed: Option<u64>) -> Scenario {
        let assets = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
        let model = RobotModel::load(&assets, "wheelarm").unwrap();
        let mut scenario = Scenario {
            calibration_seed: seed,
            ..Scenario::default()
        };
        let usual = model.settings.cameras.iter().filter(|c| !c.on_request);
        scenario.name_cameras(usual.map(|c| c.name.as_str()));
        sample(&mut scenario, &model).unwrap();
        scenario
    }

    #[test]
    fn a_specimen_is_within_its_tolerances_and_deterministic() {
        assert!(drawn(None).cameras.iter().all(|c| c.lens.is_none()));
        let mut widest = 0.0f64;
        for seed in 0..40 {
            let scenario = drawn(Some(seed));
            assert_eq!(scenario, drawn(Some(seed)));
            let [wrist, chair] = &scenario.cameras[..] else {
                panic!("two cameras");
            };
            let frames = [wrist, chair].map(|c| c.place.as_ref().unwrap().frame.as_str());
            assert_eq!(frames, ["end_effector", "wheelchair"]);
            let focal = wrist.lens.unwrap().focal[0] / 1297.7;
            assert!((focal - 1.0).abs() <= 0.01, "{focal}");
            widest = widest.max((focal - 1.0).abs());
            let place = chair.place.as_ref().unwrap().pose.translation.vector;
            // Along each axis of the camera.
            assert!((place - Vector3::new(0.15, 0.0, 1.75)).norm() <= 0.004 * 3f64.sqrt());
        }
        assert!(widest > 0.007, "{widest}");
    }

    #[test]
    fn appearance_moves_cameras_relative_to_their_calibration() {
        let assets = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
        let model = RobotModel::load(&assets, "wheelarm").unwrap();
        let cameras = |appearance: Appearance, calibration_seed| {
            let mut scenario = Scenario {
                calibration_seed,
                appearance: Some(appearance),
                ..Scenario::default()
            };
            scenario.name_cameras(["gen3", "wheelchair"].into_iter());
            sample(&mut scenario, &model).unwrap();
            scenario.cameras
        };
        let off = Appearance::default();
        assert!(cameras(off, None).iter().all(|c| c.place.is_none()));
        let (mut farthest, mut widest) = (0.0f64, 0.0f64);
        for seed in 0..60 {
            for strength in 1..=3 {
                let appearance = Appearance {
                    seed,
                    camera: strength,
                    lens: strength,
                    ..off
                };
                let share = f64::from(strength) / 3.0;
                let plain = drawn(Some(seed)).cameras;
                for (moved, plain) in cameras(appearance, Some(seed)).iter().zip(plain) {
                    let [moved_at, at] = [moved, &plain].map(|c| c.place.as_ref().unwrap().pose);
                    let error = at.inverse() * moved_at;
                    assert!(error.translation.vector.amax() <= 0.015 * share + 1e-12);
                    let turn = error.rotation.angle().to_degrees();
                    assert!(turn <= 8.0 * share + 1e-9, "{turn} at {strength}");
                    let focal = moved.lens.unwrap().focal[0] / plain.lens.unwrap().focal[0];
                    assert!((focal - 1.0).abs() <= 0.12 * share + 1e-12);
                    farthest = farthest.max(turn);
                    widest = widest.max((focal - 1.0).abs());
                }
                assert_eq!(
                    cameras(appearance, Some(seed)),
                    cameras(appearance, Some(seed))
                );
            }
        }
        assert!(farthest > 7.0 && widest > 0.11, "{farthest} {widest}");
    }

    #[test]
    fn given_values_stay_and_a_wrong_frame_is_rejected() {
        let assets = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
        let model = RobotModel::load(&assets, "wheelarm").unwrap();
        let mut scenario = drawn(Some(1));
        let before = scenario.clone();
        scenario.calibration_seed = Some(2);
        sample(&mut scenario, &model).unwrap();
        assert_eq!(scenario.cameras, before.cameras);
        scenario.cameras[0].place.as_mut().unwrap().frame = "moon".to_owned();
        let message = sample(&mut scenario, &model).unwrap_err().to_string();
        assert!(
            message.contains("\"moon\"") && message.contains("end_effector"),
            "{message}"
        );
    }
}
