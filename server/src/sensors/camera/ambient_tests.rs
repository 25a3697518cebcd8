//! Ambient light of images: contact darkening by objects, and charts of static planes.

use super::tests::{camera, item, looking, renderer, scene, snapshot};
use super::*;
use crate::geometry::Shape;
use nalgebra::Point3;

const SIZE: [u32; 2] = [320, 240];

/// A large floor and `others`, in ambient light only.
pub(super) fn dim(others: Vec<RenderItem>, objects: usize) -> RenderScene {
    let floor = Shape::Cuboid {
        half: [2.0, 2.0, 0.05],
    };
    let mut items = others;
    items.push(item(&floor, [0.6; 3], Binding::World, [0.0, 0.0, -0.05], 9));
    let mut scene = scene(items, objects);
    scene.lighting.sun = [0.0; 3];
    scene
}

/// Green values of the pixels that show `places`.
fn greens(frame: &Frame, places: impl Iterator<Item = [f64; 3]>) -> Vec<i32> {
    let lens = frame.intrinsics;
    let green = |place: [f64; 3]| {
        let p = frame.world_from_optical.inverse() * Point3::from(place);
        let (u, v) = (lens.fx * p.x / p.z + lens.cx, lens.fy * p.y / p.z + lens.cy);
        let pixel = v as usize * lens.width as usize + u as usize;
        i32::from(frame.rgb[pixel * 3 + 1])
    };
    places.map(green).collect()
}

/// A can, 12 cm tall.
pub(super) fn can(object: usize) -> RenderItem {
    let can = Shape::Cylinder {
        radius: 0.04,
        half_height: 0.06,
    };
    let binding = Binding::Object(object);
    item(&can, [0.6; 3], binding, [0.0; 3], 1 + object as u16)
}

#[test]
fn object_darkens_its_support_surface_only_nearby() {
    let scene = dim(vec![can(0)], 1);
    let eye = looking([0.5, -0.6, 0.6], [0.08, 0.0, 0.0]);
    let eye = camera(eye, Intrinsics::centred(SIZE, 0.8));
    let places = || [0.047, 0.07, 0.14, 0.3].map(|x| [x, 0.0, 0.0]).into_iter();
    for (quality, darkens) in [
        (Quality::Draft, false),
        (Quality::Standard, true),
        (Quality::High, true),
    ] {
        let Some(mut renderer) = renderer(&scene, std::slice::from_ref(&eye), quality) else {
            return;
        };
        let mut green_at_height = |z: f64| {
            let now = snapshot(&[[0.0, 0.0, z]]);
            let frame = renderer.render(&now, &[0]).unwrap().remove(0);
            greens(&frame, places())
        };
        let (standing, gone) = (green_at_height(0.06), green_at_height(5.0));
        // Below the floor it darkens nothing above.
        assert_eq!(green_at_height(-0.11), gone, "{quality:?}");
        assert!(gone.iter().all(|green| (green - gone[3]).abs() <= 1));
        let lost: Vec<i32> = gone.iter().zip(&standing).map(|(a, b)| a - b).collect();
        if darkens {
            assert!(lost[0] >= 10, "{quality:?} {lost:?}");
            assert!(
                lost[0] > lost[1] && lost[1] > lost[2],
                "{quality:?} {lost:?}"
            );
            assert!(lost[1] >= 2 && lost[2] <= 1, "{quality:?} {lost:?}");
            assert_eq!(lost[3], 0, "{quality:?}");
        } else {
            assert_eq!(lost, [0; 4]);
        }
    }
}

#[test]
fn every_object_of_a_row_darkens_the_floor() {
    let count = 9;
    let scene = dim((0..count).map(can).collect(), count);
    let eye = looking([0.0, -1.2, 1.5], [0.0, 0.0, 0.0]);
    let eye = camera(eye, Intrinsics::centred([640, 480], 1.0));
    let Some(mut renderer) = renderer(&scene, &[eye], Quality::Standard) else {
        return;
    };
    let at = |i: usize| 0.13 * (i as f64 - 4.0);
    let row = |z: f64| -> Vec<[f64; 3]> { (0..count).map(|i| [at(i), 0.0, z]).collect() };
    // On the side of each can that faces the camera.
    let places = || (0..count).map(|i| [at(i), -0.05, 0.0]);
    let mut green_at_height = |z: f64| {
        let now = snapshot(&row(z));
        let frame = renderer.render(&now, &[0]).unwrap().remove(0);
        greens(&frame, places())
    };
    let (standing, gone) = (green_at_height(0.06), green_at_height(5.0));
    for (i, (a, b)) in gone.iter().zip(&standing).enumerate() {
        assert!(a - b >= 8, "can {i}: {gone:?} {standing:?}");
    }
}

#[test]
fn moved_objects_darken_as_in_a_new_renderer() {
    let count = 3;
    let scene = dim((0..count).map(can).collect(), count);
    let eye = looking([0.0, -1.0, 1.2], [0.0, 0.0, 0.0]);
    let eye = camera(eye, Intrinsics::centred(SIZE, 1.0));
    let new = || renderer(&scene, std::slice::from_ref(&eye), Quality::Standard);
    let Some(mut moved) = new() else {
        return;
    };
    let row = |step: usize| -> Vec<[f64; 3]> {
        // One moves, one moves out of view and back, one stands.
        let away = if step % 2 == 1 { 40.0 } else { 0.0 };
        let shift = 0.02 * step as f64;
        vec![[shift, 0.0, 0.06], [0.2, away, 0.06], [-0.2, 0.0, 0.06]]
    };
    let mut images = Vec::new();
    for step in 0..4 {
        let now = snapshot(&row(step));
        let image = moved.render(&now, &[0]).unwrap().remove(0);
        let expected = new().unwrap().render(&now, &[0]).unwrap().remove(0);
        assert!(image.rgb == expected.rgb, "step {step}");
        images.push(image.rgb);
    }
    assert!(images[0] != images[2]);
}

#[test]
fn light_varies_within_a_triangle() {
    // The long sides of the panel are too short to be divided.
    let panel = Shape::Cuboid {
        half: [0.19, 0.05, 0.05],
    };
    let board = Shape::Cuboid {
        half: [0.02, 0.5, 0.15],
    };
    let panel = item(&panel, [0.6; 3], Binding::World, [0.0, 0.0, -0.05], 1);
    let board = item(&board, [0.6; 3], Binding::World, [0.0, 0.0, 0.15], 2);
    let mut scene = scene(vec![panel, board], 0);
    scene.lighting.sun = [0.0; 3];
    let eye = looking([0.0, -1.0, 1.0], [0.0, 0.0, 0.0]);
    let eye = camera(eye, Intrinsics::centred([640, 480], 0.4));
    for (quality, is_linear) in [
        (Quality::Draft, true),
        (Quality::Standard, false),
        (Quality::High, false),
    ] {
        let Some(mut renderer) = renderer(&scene, std::slice::from_ref(&eye), quality) else {
            return;
        };
        let frame = renderer.render(&snapshot(&[]), &[0]).unwrap().remove(0);
        // On the triangle at the edge that faces the camera.
        let places = [-0.16, -0.035, 0.035, 0.16].map(|x| [x, -0.046, 0.0]);
        let green = greens(&frame, places.into_iter());
        let bend = green[0] + green[3] - green[1] - green[2];
        match is_linear {
            true => assert!(bend.abs() <= 2, "{quality:?} {green:?}"),
            false => assert!(bend >= 5, "{quality:?} {green:?}"),
        }
    }
}

#[test]
fn light_on_a_wall_varies_smoothly_beside_a_cupboard() {
    let wall = Shape::Cuboid {
        half: [2.0, 0.05, 1.2],
    };
    let cupboard = Shape::Cuboid {
        half: [0.4, 0.25, 0.7],
    };
    let wall = item(&wall, [0.6; 3], Binding::World, [0.0, 0.55, 1.2], 1);
    let cupboard = item(&cupboard, [0.6; 3], Binding::World, [-0.4, 0.25, 0.7], 2);
    let scene = dim(vec![wall, cupboard], 0);
    let eye = looking([1.0, -1.2, 1.0], [0.6, 0.5, 0.8]);
    let eye = camera(eye, Intrinsics::centred(SIZE, 1.2));
    let Some(mut renderer) = renderer(&scene, &[eye], Quality::Standard) else {
        return;
    };
    let frame = renderer.render(&snapshot(&[]), &[0]).unwrap().remove(0);
    // Away from the edge of the cupboard, at several heights.
    for z in [0.5, 0.6, 0.75, 0.9, 1.0] {
        let places = (0..55).map(|i| [0.06 + 0.02 * f64::from(i), 0.5, z]);
        let row = greens(&frame, places);
        let (first, last) = (row[0], row[54]);
        assert!(last - first >= 4, "{z}: {row:?}");
        for pair in row.windows(2) {
            assert!((-1..=4).contains(&(pair[1] - pair[0])), "{z}: {row:?}");
        }
        // No kink: the slope changes little over distances of 12 cm.
        for i in 6..49 {
            let bend = row[i + 6] + row[i - 6] - 2 * row[i];
            assert!(bend.abs() <= 8, "{z}, {i}: {row:?}");
        }
    }
}
