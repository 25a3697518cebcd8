//! Images of scenes whose parts come from the caches.

use std::path::{Path, PathBuf};

use nalgebra::Translation3;
use wheelarm_proto::cache::{LIMIT, Store};

use super::tests::{camera, looking, snapshot};
use super::*;
use crate::geometry::Family;
use crate::robot::RobotModel;
use crate::scene::Scene;
use crate::snapshot::{BodyState, Snapshot};

/// The home, and the same with other layers of textures and other bodies.
fn scenes() -> ([RenderScene; 2], Snapshot) {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
    let robot = RobotModel::load(&assets, "wheelarm").unwrap();
    let home = Scene::load(&assets, "home").unwrap();
    let scene = RenderScene::new(&robot, &home, &assets).unwrap();
    let mut other = scene.clone();
    other.items.reverse();
    let is_fabric = |item: &RenderItem| item.material.family == Some(Family::Fabric);
    other.items.retain(|item| !is_fabric(item));
    assert!(other.items.len() < scene.items.len());
    let mut now = snapshot(&vec![[0.0; 3]; home.objects.len()]);
    let rest = BodyState::resting(Translation3::new(0.0, 0.0, -50.0).into());
    now.links = vec![rest; robot.links.len()];
    let slides = home.joints.iter();
    let slides = slides.map(|joint| BodyState::resting(home.furniture[joint.furniture].pose));
    now.sliding = slides.collect();
    for (body, object) in now.objects.iter_mut().zip(&home.objects) {
        body.pose = object.pose;
    }
    ([scene, other], now)
}

/// The first image of a renderer; `None` without a driver.
fn image(
    graphics: &Graphics,
    scene: &RenderScene,
    now: &Snapshot,
    warms_up: bool,
) -> Option<[Bytes; 3]> {
    let view = camera(
        looking([-5.6, 2.9, 1.9], [-8.6, 1.7, 0.7]),
        Intrinsics::centred([320, 180], 1.2),
    );
    let renderer = Renderer::over(graphics, scene, &[view], Quality::Standard);
    let mut renderer = match renderer {
        Err(reason @ RenderError::NoDriver) => {
            wheelarm_proto::program::skipped(&reason.to_string());
            return None;
        }
        renderer => renderer.unwrap(),
    };
    if warms_up {
        renderer.warm_up(now, 0).unwrap();
    }
    let frame = renderer.render(now, &[0]).unwrap().remove(0);
    Some([frame.rgb, frame.depth, frame.ids])
}

#[test]
fn images_are_the_same_in_every_state_of_the_cache() {
    let ([scene, other], now) = scenes();
    let fresh = |scene| image(&Graphics::for_test(), scene, &now, false);
    let Some(wanted) = fresh(&scene).zip(fresh(&other)) else {
        return;
    };
    assert!(wanted.0 != wanted.1);
    let folder = std::env::temp_dir().join(format!("scenes{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    let store = |folder: &Path| Store::at(Some(folder.to_owned()), LIMIT);
    let process = |folder: &Path| Graphics::for_test().caching(store(folder));
    let check = |graphics: &Graphics, state: &str| {
        // The second scene copies layers of the first, the third uses its parts.
        for (scene, wanted) in [
            (&scene, &wanted.0),
            (&other, &wanted.1),
            (&scene, &wanted.0),
        ] {
            let image = image(graphics, scene, &now, true).unwrap();
            assert!(image == *wanted, "{state}");
        }
    };
    check(&process(&folder), "without entries");
    let stored = store(&folder).usage().unwrap();
    assert!(stored.entries > 10, "{stored:?}");
    check(&process(&folder), "with entries");
    assert_eq!(store(&folder).usage().unwrap(), stored);
    for state in ["damaged", "half-written"] {
        for (i, path) in entries(&folder).into_iter().enumerate() {
            let mut bytes = std::fs::read(&path).unwrap();
            match state {
                "damaged" => {
                    let at = i * 7919 % bytes.len();
                    bytes[at] ^= 0x10;
                }
                _ => bytes.truncate(bytes.len() / 2),
            }
            std::fs::write(&path, bytes).unwrap();
        }
        check(&process(&folder), state);
        assert_eq!(store(&folder).usage().unwrap(), stored, "{state}");
    }
    // The folder cannot be made.
    check(&process(&entries(&folder)[0].join("cache")), "unwritable");
    std::fs::remove_dir_all(&folder).unwrap();
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let files = std::fs::read_dir(folder).unwrap();
    let mut paths: Vec<PathBuf> = files.map(|file| file.unwrap().path()).collect();
    paths.sort();
    paths
}
