//! Images of the bundled home.

use std::collections::BTreeSet;
use std::path::Path;

use nalgebra::Translation3;

use super::tests::{camera, looking, renderer, snapshot};
use super::*;
use crate::robot::RobotModel;
use crate::scene::Scene;
use crate::snapshot::BodyState;

fn load() -> (RobotModel, Scene, RenderScene) {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
    let robot = RobotModel::load(&assets, "wheelarm").unwrap();
    let home = Scene::load(&assets, "home").unwrap();
    let scene = RenderScene::new(&robot, &home, &assets).unwrap();
    (robot, home, scene)
}

#[test]
fn ids_of_the_home_follow_the_legend() {
    let (robot, home, scene) = load();
    for (i, object) in home.objects.iter().enumerate() {
        assert_eq!(scene.instances[i], (i as u16 + 1, object.name.clone()));
    }
    let names = |from: &str| scene.instances.iter().position(|(_, n)| n == from);
    assert!(names("floor") > names("base_link") && names("base_link") >= Some(home.objects.len()));

    // Every object is visible from above by its own ID; the cans from below the next
    // board of the shelf.
    let cameras: Vec<_> = home
        .objects
        .iter()
        .map(|o| {
            let p = o.pose.translation;
            let up = if o.name.starts_with("coke") {
                0.25
            } else {
                0.6
            };
            let eye = [p.x + 0.1, p.y, p.z + up];
            camera(
                looking(eye, [p.x, p.y, p.z]),
                Intrinsics::centred([64, 48], 0.8),
            )
        })
        .collect();
    let Some(mut renderer) = renderer(&scene, &cameras, Quality::Fast) else {
        return;
    };
    // Out of view.
    let rest = BodyState::resting(Translation3::new(0.0, 0.0, -50.0).into());
    let mut snapshot = snapshot(&vec![[0.0; 3]; home.objects.len()]);
    snapshot.links = vec![rest; robot.links.len()];
    let slides = home.joints.iter();
    let slides = slides.map(|joint| BodyState::resting(home.furniture[joint.furniture].pose));
    snapshot.sliding = slides.collect();
    for (body, object) in snapshot.objects.iter_mut().zip(&home.objects) {
        body.pose = object.pose;
    }
    let all: Vec<usize> = (0..cameras.len()).collect();
    for frame in renderer.render(&snapshot, &all).unwrap() {
        let id = scene.instances[frame.camera].0;
        assert_eq!(
            frame.ids()[24 * 64 + 32],
            id,
            "{}",
            home.objects[frame.camera].name
        );
    }
}

#[test]
fn a_part_of_an_image_and_a_fresh_renderer_show_the_same() {
    let (robot, home, scene) = load();
    let whole = Intrinsics::centred([320, 180], 1.2);
    let [left, top] = [170_u32, 95];
    let part = Intrinsics {
        width: 120,
        height: 70,
        cx: whole.cx - f64::from(left),
        cy: whole.cy - f64::from(top),
        ..whole
    };
    let views = [
        looking([-7.0, 3.0, 1.6], [-9.1, 0.0, 0.6]),
        looking([-10.5, 5.5, 1.8], [-7.0, 2.0, 0.5]),
        looking([-4.0, 1.0, 1.4], [-8.0, 3.0, 0.9]),
    ];
    let cameras: Vec<_> = views
        .iter()
        .flat_map(|view| [camera(*view, whole), camera(*view, part)])
        .collect();
    let Some(mut renderer) = renderer(&scene, &cameras, Quality::Standard) else {
        return;
    };
    let mut here = snapshot(&vec![[0.0; 3]; home.objects.len()]);
    let slides = home.joints.iter();
    let slides = slides.map(|joint| BodyState::resting(home.furniture[joint.furniture].pose));
    here.sliding = slides.collect();
    for (body, object) in here.objects.iter_mut().zip(&home.objects) {
        body.pose = object.pose;
    }
    let link = |i| BodyState::resting(Translation3::new(-8.0, 3.0, 0.05 * f64::from(i)).into());
    here.links = (0..robot.links.len() as u32).map(link).collect();
    let mut there = here.clone();
    for body in there.objects.iter_mut().chain(&mut there.links) {
        body.pose.translation.x += 0.4;
    }
    let all: Vec<usize> = (0..cameras.len()).collect();
    let elsewhere = renderer.render(&there, &all).unwrap();
    let frames = renderer.render(&here, &all).unwrap();
    // Shadows updated in part, and all of them.
    let mut other = super::tests::renderer(&scene, &cameras, Quality::Standard).unwrap();
    let fresh = other.render(&here, &all).unwrap();
    for (frame, fresh) in frames.iter().zip(&fresh) {
        assert_eq!(frame.rgb, fresh.rgb);
        assert_eq!(frame.depth, fresh.depth);
        assert_eq!(frame.ids, fresh.ids);
    }
    assert_ne!(elsewhere[0].rgb, frames[0].rgb);
    for pair in frames.chunks(2) {
        let [whole, part] = [&pair[0], &pair[1]];
        let ids = |frame: &Frame| frame.ids.as_chunks::<2>().0.to_vec();
        let (of_whole, of_part) = (ids(whole), ids(part));
        let cut =
            (0..70).flat_map(|y| &of_whole[(y + top as usize) * 320 + left as usize..][..120]);
        // Edges may be off by a pixel: adapters compute them in single precision.
        let others = cut.zip(&of_part).filter(|(a, b)| a != b).count();
        assert!(others <= of_part.len() / 200, "{others}");
        let kinds: BTreeSet<_> = of_part.iter().collect();
        assert!(kinds.len() > 4, "{}", kinds.len());
    }
}

#[test]
fn filters_of_standard_leave_depth_and_ids_of_draft() {
    let (robot, home, scene) = load();
    let lens = Intrinsics::centred([320, 180], 1.2);
    let views = [
        looking([-7.0, 3.0, 1.6], [-9.1, 0.0, 0.6]),
        looking([-4.0, 1.0, 1.4], [-8.0, 3.0, 0.9]),
        looking([-6.2, 2.6, 1.6], [-3.9, 4.4, 0.75]),
    ];
    let cameras = views.map(|view| camera(view, lens));
    let mut now = snapshot(&vec![[0.0; 3]; home.objects.len()]);
    let slides = home.joints.iter();
    let slides = slides.map(|joint| BodyState::resting(home.furniture[joint.furniture].pose));
    now.sliding = slides.collect();
    for (body, object) in now.objects.iter_mut().zip(&home.objects) {
        body.pose = object.pose;
    }
    let link = |i| BodyState::resting(Translation3::new(-8.0, 3.0, 0.05 * f64::from(i)).into());
    now.links = (0..robot.links.len() as u32).map(link).collect();
    let images = |quality| Some(renderer(&scene, &cameras, quality)?.render(&now, &[0, 1, 2]));
    let (Some(draft), Some(standard)) = (images(Quality::Draft), images(Quality::Standard)) else {
        return;
    };
    for (draft, standard) in draft.unwrap().iter().zip(&standard.unwrap()) {
        assert_ne!(draft.rgb, standard.rgb);
        assert_eq!(draft.depth, standard.depth);
        assert_eq!(draft.ids, standard.ids);
    }
}
