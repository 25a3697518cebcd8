//! Tests of the images, on any Vulkan adapter.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::*;
use crate::appearance::{Appearance, SampledAppearance};
use crate::geometry::mesh::build;
use crate::geometry::{Material, Shape, Texture, texture};
use crate::robot::RobotModel;
use crate::scene::{Lighting, Scene};
use crate::snapshot::{BodyState, Snapshot};

const LIGHT: Lighting = Lighting {
    sun_direction: [0.0, 0.6, 0.8],
    sun: [2.5, 2.5, 2.5],
    sky: [0.5, 0.5, 0.5],
    ground: [0.3, 0.3, 0.3],
};

pub(super) fn item(
    shape: &Shape,
    color: [f32; 3],
    binding: Binding,
    at: [f64; 3],
    id: u16,
) -> RenderItem {
    let mesh = Arc::new(build(shape, Path::new(".")).unwrap());
    RenderItem {
        coarse: mesh.clone(),
        mesh,
        material: Material {
            name: String::new(),
            color,
            roughness: 0.8,
            metallic: 0.0,
            emission: 0.0,
            texture: None,
            family: None,
            transmission: 0.0,
        },
        binding,
        body_from_mesh: Translation3::from(at).into(),
        instance: id,
        casts_shadow: true,
    }
}

pub(super) fn scene(items: Vec<RenderItem>, objects: usize) -> RenderScene {
    RenderScene {
        instances: items.iter().map(|i| (i.instance, String::new())).collect(),
        items,
        lighting: LIGHT,
        links: 0,
        skins: Vec::new(),
        objects,
        sliding: 0,
        textures: BTreeMap::new(),
        person: None,
        surrounding: None,
    }
}

pub(super) fn snapshot(objects: &[[f64; 3]]) -> Snapshot {
    let body = |at: &[f64; 3]| BodyState {
        pose: Translation3::from(*at).into(),
        linear: Vector3::zeros(),
        angular: Vector3::zeros(),
    };
    Snapshot {
        tick: 0,
        joints: Vec::new(),
        links: Vec::new(),
        objects: objects.iter().map(body).collect(),
        skins: Vec::new(),
        furniture_joints: Vec::new(),
        sliding: Vec::new(),
        person: None,
        contacts: Vec::new(),
        anomalies: Vec::new(),
    }
}

/// world_from_optical: at `eye`, looking at `target`, upright.
pub(super) fn looking(eye: [f64; 3], target: [f64; 3]) -> Isometry3<f64> {
    let eye = Point3::from(eye);
    let z = (Point3::from(target) - eye).normalize();
    let x = z.cross(&Vector3::z()).normalize();
    let turn = Rotation3::from_basis_unchecked(&[x, z.cross(&x), z]);
    let turn = UnitQuaternion::from_rotation_matrix(&turn);
    Isometry3::from_parts(eye.coords.into(), turn)
}

pub(super) fn camera(mount: Isometry3<f64>, intrinsics: Intrinsics) -> CameraSpec {
    CameraSpec {
        name: "test".into(),
        binding: Binding::World,
        mount,
        intrinsics,
        range: [0.05, 20.0],
    }
}

/// `None`, with the reason printed, only without a Vulkan driver.
pub(super) fn renderer(
    scene: &RenderScene,
    cameras: &[CameraSpec],
    quality: Quality,
) -> Option<Renderer> {
    renderer_over(&Graphics::for_test(), scene, cameras, quality)
}

/// The same with the caches of other scenes.
fn renderer_over(
    graphics: &Graphics,
    scene: &RenderScene,
    cameras: &[CameraSpec],
    quality: Quality,
) -> Option<Renderer> {
    match Renderer::over(graphics, scene, cameras, quality) {
        Ok(renderer) => Some(renderer),
        Err(reason @ RenderError::NoDriver) => {
            wheelarm_proto::program::skipped(&reason.to_string());
            None
        }
        Err(other) => panic!("{other}"),
    }
}

fn depth(frame: &Frame) -> Vec<f32> {
    let (numbers, _) = frame.depth.as_chunks::<4>();
    numbers.iter().map(|b| f32::from_le_bytes(*b)).collect()
}

#[test]
fn depth_is_metres_along_the_optical_axis() {
    let half = Shape::Cuboid { half: [0.5; 3] };
    let scene = scene(
        vec![item(&half, [0.8; 3], Binding::Object(0), [0.0; 3], 7)],
        1,
    );
    // Padded rows: neither 225 x 4 nor 225 is a multiple of 256.
    let lens = Intrinsics::centred([225, 127], 1.2);
    let eye = camera(looking([0.0; 3], [1.0, 0.0, 0.0]), lens);
    for quality in [
        Quality::Fast,
        Quality::Draft,
        Quality::Standard,
        Quality::High,
    ] {
        let Some(mut renderer) = renderer(&scene, std::slice::from_ref(&eye), quality) else {
            return;
        };
        for distance in [0.7, 2.0, 9.0] {
            let frame = &renderer
                .render(&snapshot(&[[distance + 0.5, 0.1, 0.0]]), &[0])
                .unwrap()[0];
            let z = depth(frame);
            assert_eq!(z.len(), 225 * 127);
            assert_eq!(frame.rgb.len(), 225 * 127 * 3);
            let ids = frame.ids();
            let hit: Vec<usize> = (0..z.len()).filter(|&i| ids[i] == 7).collect();
            assert!(!hit.is_empty());
            for (&z, &id) in z.iter().zip(&ids) {
                match id {
                    7 => assert!(
                        (f64::from(z) - distance).abs() < 1e-3,
                        "{} at {distance}",
                        z
                    ),
                    0 => assert_eq!(z, f32::INFINITY),
                    other => panic!("unknown id {other}"),
                }
            }
            // The face covers the pixels whose centres are on it.
            let on_face = |i: usize| {
                let u = (i % 225) as f64 + 0.5;
                let v = (i / 225) as f64 + 0.5;
                // x of the camera is -y of the world.
                let y = -(u - lens.cx) / lens.fx * distance;
                let x = (v - lens.cy) / lens.fy * distance;
                (y - 0.1).abs() < 0.5 && x.abs() < 0.5
            };
            assert_eq!(hit.len(), (0..z.len()).filter(|&i| on_face(i)).count());
        }
        let far = &renderer
            .render(&snapshot(&[[25.0, 0.0, 0.0]]), &[0])
            .unwrap()[0];
        assert!(
            far.ids().contains(&7),
            "beyond the range it is still rendered"
        );
        assert!(depth(far).iter().all(|z| *z == f32::INFINITY));
    }
}

#[test]
fn a_point_is_projected_by_the_intrinsics() {
    let points = [
        [2.0, 0.3, 0.2],
        [3.0, -0.8, 0.5],
        [2.5, 0.9, -0.6],
        [4.0, 0.0, 0.0],
    ];
    let ball = Shape::Sphere { radius: 0.03 };
    let items = (0..points.len())
        .map(|i| {
            item(
                &ball,
                [0.5; 3],
                Binding::Object(i),
                [0.0; 3],
                100 + i as u16,
            )
        })
        .collect();
    let scene = scene(items, points.len());
    let lens = Intrinsics {
        width: 300,
        height: 200,
        fx: 260.0,
        fy: 240.0,
        cx: 121.3,
        cy: 132.8,
    };
    let pose = looking([-0.5, 0.1, 0.3], [3.0, 0.2, 0.0]);
    let Some(mut renderer) = renderer(&scene, &[camera(pose, lens)], Quality::Standard) else {
        return;
    };
    let frame = &renderer.render(&snapshot(&points), &[0]).unwrap()[0];
    assert!((frame.world_from_optical.to_homogeneous() - pose.to_homogeneous()).norm() < 1e-12);
    for (i, point) in points.iter().enumerate() {
        let p = pose.inverse() * Point3::from(*point);
        let (u, v) = (lens.fx * p.x / p.z + lens.cx, lens.fy * p.y / p.z + lens.cy);
        let id = 100 + i as u16;
        let (mut count, mut sum_u, mut sum_v) = (0.0, 0.0, 0.0);
        for (k, found) in frame.ids().iter().enumerate() {
            if *found == id {
                count += 1.0;
                sum_u += (k % 300) as f64 + 0.5;
                sum_v += (k / 300) as f64 + 0.5;
            }
        }
        assert_eq!(frame.ids()[v as usize * 300 + u as usize], id);
        assert!(
            (sum_u / count - u).abs() < 0.35,
            "u {} expected {u}",
            sum_u / count
        );
        assert!(
            (sum_v / count - v).abs() < 0.35,
            "v {} expected {v}",
            sum_v / count
        );
    }
}

/// A floor with a floating box whose shadow falls away from the sun.
pub(super) fn floor_and_box() -> RenderScene {
    let floor = Shape::Cuboid {
        half: [2.0, 2.0, 0.05],
    };
    let cube = Shape::Cuboid { half: [0.3; 3] };
    let mut items = vec![
        item(&cube, [0.9, 0.1, 0.1], Binding::Object(0), [0.0; 3], 1),
        item(&floor, [0.8; 3], Binding::World, [0.0, 0.0, -0.05], 2),
    ];
    items[1].material.texture = Some(Texture {
        pattern: "planks".into(),
        metres: 1.0,
        file: None,
    });
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
    let planks = texture::read(&assets, "planks").unwrap();
    RenderScene {
        textures: [("planks".to_owned(), planks)].into(),
        ..scene(items, 1)
    }
}

#[test]
fn light_and_shadow_follow_the_sun() {
    let lens = Intrinsics::centred([160, 120], 1.0);
    let pose = looking([3.5, 0.0, 2.5], [0.0, 0.0, 0.2]);
    let mean = |frame: &Frame, at: [f64; 3]| {
        let p = pose.inverse() * Point3::from(at);
        let (u, v) = (lens.fx * p.x / p.z + lens.cx, lens.fy * p.y / p.z + lens.cy);
        let mut sum = [0.0; 3];
        for dy in -2..=2 {
            for dx in -2..=2 {
                let i = (v as i32 + dy) * 160 + u as i32 + dx;
                for (k, sum) in sum.iter_mut().enumerate() {
                    *sum += f64::from(frame.rgb[i as usize * 3 + k]) / 25.0;
                }
            }
        }
        sum
    };
    for quality in [
        Quality::Fast,
        Quality::Draft,
        Quality::Standard,
        Quality::High,
    ] {
        let Some(mut renderer) = renderer(&floor_and_box(), &[camera(pose, lens)], quality) else {
            return;
        };
        let frame = &renderer
            .render(&snapshot(&[[0.0, 0.0, 0.8]]), &[0])
            .unwrap()[0];
        // The sun is at +y; 0.8 m of height shift the shadow by 0.6 m to -y.
        let (shade, sunny) = (mean(frame, [0.0, -0.6, 0.0]), mean(frame, [0.0, 0.9, 0.0]));
        assert!(
            sunny.iter().all(|c| (120.0..250.0).contains(c)),
            "sunlit floor {sunny:?}"
        );
        if quality == Quality::Fast {
            assert!(
                shade[1] > 0.8 * sunny[1],
                "{quality:?}: {shade:?} {sunny:?}"
            );
        } else {
            assert!(
                shade[1] < 0.7 * sunny[1],
                "{quality:?}: {shade:?} {sunny:?}"
            );
            assert!(shade[1] > 30.0, "shade is not black: {shade:?}");
        }
        let top = mean(frame, [0.0, 0.0, 1.1]);
        assert!(top[0] > 2.0 * top[1], "the box is red: {top:?}");
    }
}

#[test]
fn standard_filters_the_edges_of_shadows() {
    let floor = Shape::Cuboid {
        half: [8.0, 8.0, 0.05],
    };
    let cube = Shape::Cuboid { half: [0.3; 3] };
    let items = vec![
        item(&cube, [0.5; 3], Binding::Object(0), [0.0; 3], 1),
        item(&floor, [0.5; 3], Binding::World, [0.0, 0.0, -0.05], 2),
    ];
    let scene = scene(items, 1);
    // In front of the edge x = 0.3 of the shadow of a floating cube.
    let pose = looking([0.3, -0.9, 0.35], [0.3, -0.6, 0.0]);
    let eye = camera(pose, Intrinsics::centred([200, 120], 1.0));
    let steepest = |quality| {
        let mut renderer = renderer(&scene, std::slice::from_ref(&eye), quality)?;
        let frame = &renderer
            .render(&snapshot(&[[0.0, 0.0, 0.8]]), &[0])
            .unwrap()[0];
        let row = &frame.rgb[60 * 600..61 * 600];
        let green = |x: usize| i32::from(row[x * 3 + 1]);
        assert!((green(0) - green(199)).abs() > 60, "{quality:?}");
        (0..199).map(|x| (green(x + 1) - green(x)).abs()).max()
    };
    let (Some(draft), Some(standard)) = (steepest(Quality::Draft), steepest(Quality::Standard))
    else {
        return;
    };
    assert!(3 * standard <= 2 * draft, "{standard} {draft}");
}

#[test]
fn the_same_snapshot_gives_the_same_bytes_independent_of_earlier_images() {
    let cameras = [
        camera(
            looking([2.5, 1.0, 1.5], [0.0; 3]),
            Intrinsics::centred([200, 120], 1.1),
        ),
        camera(
            looking([-2.0, 0.5, 2.0], [0.0; 3]),
            Intrinsics::centred([97, 61], 0.9),
        ),
    ];
    let scene = floor_and_box();
    let Some(mut first) = renderer(&scene, &cameras, Quality::Standard) else {
        return;
    };
    let here = snapshot(&[[0.2, 0.1, 0.6]]);
    let there = snapshot(&[[-0.9, 0.4, 0.35]]);
    let bytes = |frames: Vec<Frame>| -> Vec<_> {
        frames
            .into_iter()
            .map(|f| (f.rgb.to_vec(), f.depth.to_vec(), f.ids.to_vec()))
            .collect()
    };
    let once = bytes(first.render(&here, &[0, 1]).unwrap());
    let moved = bytes(first.render(&there, &[0, 1]).unwrap());
    assert_ne!(once, moved);
    // Held frames are not overwritten.
    let kept = first.render(&here, &[0, 1]).unwrap();
    let again = first.render(&there, &[0, 1]).unwrap();
    assert_eq!(bytes(kept), once);
    assert_eq!(bytes(again), moved);
    // Two batches in flight are returned in order.
    first.submit(&here, &[0, 1]).unwrap();
    first.submit(&there, &[1]).unwrap();
    assert!(matches!(
        first.submit(&here, &[0]),
        Err(RenderError::InFlight)
    ));
    assert!(matches!(
        first.render(&here, &[0]),
        Err(RenderError::InFlight)
    ));
    assert_eq!(bytes(first.collect().unwrap()), once);
    first.submit(&here, &[0]).unwrap();
    assert_eq!(bytes(first.collect().unwrap())[0], moved[1]);
    assert_eq!(bytes(first.collect().unwrap())[0], once[0]);
    assert!(first.collect().unwrap().is_empty());
    // One camera only, or another renderer, gives the same bytes.
    assert_eq!(bytes(first.render(&here, &[1]).unwrap())[0], once[1]);
    let mut second = renderer(&scene, &cameras, Quality::Standard).unwrap();
    assert_eq!(bytes(second.render(&there, &[0, 1]).unwrap()), moved);
}

#[test]
fn ids_beyond_a_byte_are_correct_in_every_quality() {
    let ball = Shape::Sphere { radius: 0.02 };
    let at = |i: usize| {
        [
            2.0,
            (i % 20) as f64 * 0.1 - 0.95,
            (i / 20) as f64 * 0.1 - 0.7,
        ]
    };
    let count = 300;
    let items =
        (0..count).map(|i| item(&ball, [0.5; 3], Binding::Object(i), [0.0; 3], 1 + i as u16));
    let scene = scene(items.collect(), count);
    let places: Vec<_> = (0..count).map(at).collect();
    let lens = Intrinsics::centred([400, 320], 1.0);
    let eye = camera(looking([0.0; 3], [1.0, 0.0, 0.0]), lens);
    for quality in [
        Quality::Fast,
        Quality::Draft,
        Quality::Standard,
        Quality::High,
    ] {
        let Some(mut renderer) = renderer(&scene, std::slice::from_ref(&eye), quality) else {
            return;
        };
        let frame = &renderer.render(&snapshot(&places), &[0]).unwrap()[0];
        let ids = frame.ids();
        let z = depth(frame);
        for (i, [x, y, up]) in places.iter().enumerate() {
            let u = (lens.fx * -y / x + lens.cx) as usize;
            let v = (lens.fy * -up / x + lens.cy) as usize;
            assert_eq!(ids[v * 400 + u], 1 + i as u16, "{quality:?}");
            assert!((z[v * 400 + u] - 1.98).abs() < 0.005);
        }
    }
}

#[test]
fn a_look_changes_only_colours_and_glass_keeps_depth_and_id() {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
    let robot = RobotModel::load(&assets, "wheelarm").unwrap();
    let home = Scene::load(&assets, "home").unwrap();
    let bottle = home.object_named("glass_bottle").unwrap();
    let at = Point3::from(home.objects[bottle].pose.translation.vector) + Vector3::z() * 0.2;
    let eye = at + Vector3::new(-0.6, 0.3, 0.2);
    let lens = Intrinsics::centred([192, 144], 0.9);
    let mount = looking(eye.coords.into(), at.coords.into());
    let cameras = [camera(mount, lens)];
    let mut now = snapshot(&vec![[0.0; 3]; home.objects.len()]);
    let gone = BodyState::resting(Translation3::new(0.0, 0.0, -50.0).into());
    now.links = vec![gone; robot.links.len()];
    let slides = home.joints.iter();
    let slides = slides.map(|joint| BodyState::resting(home.furniture[joint.furniture].pose));
    now.sliding = slides.collect();
    for (body, object) in now.objects.iter_mut().zip(&home.objects) {
        body.pose = object.pose;
    }
    let scenes = [0, 1, 2].map(|seed| {
        let appearance = Appearance {
            seed,
            light: 3,
            background: 3,
            materials: 3,
            exposure: 3,
            ..Appearance::default()
        };
        let appearance =
            (seed > 0).then(|| SampledAppearance::new(appearance, &home, &assets).unwrap());
        RenderScene::with_appearance(&robot, &home, &assets, appearance.as_ref()).unwrap()
    });
    let graphics = Graphics::for_test();
    for quality in [Quality::Draft, Quality::Standard, Quality::High] {
        let image = |seed: usize| {
            let renderer = renderer_over(&graphics, &scenes[seed], &cameras, quality);
            let frame = renderer?.render(&now, &[0]);
            Some(frame.unwrap().remove(0))
        };
        let Some(plain) = image(0) else {
            return;
        };
        let [one, two] = [1, 2].map(|seed| image(seed).unwrap());
        assert_ne!(one.rgb, two.rgb);
        for appearance in [&one, &two] {
            assert_ne!(appearance.rgb, plain.rgb);
            assert_eq!(
                (&appearance.depth, &appearance.ids),
                (&plain.depth, &plain.ids)
            );
        }
        let id = u16::try_from(bottle + 1).unwrap();
        assert!(one.ids().iter().filter(|i| **i == id).count() > 100);
        assert_eq!(image(1).unwrap().rgb, one.rgb);
    }
}

#[test]
fn invalid_requests_are_rejected_by_name() {
    let scene = floor_and_box();
    let lens = Intrinsics::centred([32, 32], 1.0);
    let good = camera(Isometry3::identity(), lens);
    let Some(mut ready) = renderer(&scene, std::slice::from_ref(&good), Quality::Fast) else {
        return;
    };
    let text = |r: Result<Vec<Frame>, RenderError>| r.unwrap_err().to_string();
    let one = snapshot(&[[0.0; 3]]);
    assert!(text(ready.render(&one, &[3])).contains("camera 3"));
    assert!(text(ready.render(&snapshot(&[]), &[0])).contains("0 objects"));
    assert!(ready.render(&one, &[0]).is_ok());
    assert!(ready.render(&one, &[]).unwrap().is_empty());

    let cameras = std::slice::from_ref(&good);
    let error = Renderer::new(&scene, cameras, Quality::Fast, Some("no such card"));
    let error = error.err().unwrap().to_string();
    assert!(error.contains("no such card"), "{error}");
    assert!(error.contains(&Renderer::adapters()[0].name), "{error}");

    let mut bad = good.clone();
    bad.intrinsics.fx = 0.0;
    bad.name = "wrist".into();
    let error = Renderer::new(&scene, &[bad], Quality::Fast, None)
        .err()
        .unwrap()
        .to_string();
    assert!(
        error.contains("wrist") && error.contains("focal length"),
        "{error}"
    );
    let mut bad = good;
    bad.binding = Binding::Object(1);
    let error = Renderer::new(&scene, &[bad], Quality::Fast, None)
        .err()
        .unwrap()
        .to_string();
    assert!(error.contains("body 1, there are 1"), "{error}");
}

#[test]
fn a_lens_scales_with_the_width_and_keeps_its_centre() {
    let lens = Intrinsics {
        width: 1280,
        height: 720,
        fx: 1297.7,
        fy: 1297.7,
        cx: 620.9,
        cy: 238.3,
    };
    let half = lens.resized([640, 360]);
    assert_eq!(
        (half.fx, half.cx, half.cy),
        (1297.7 / 2.0, 620.9 / 2.0, 238.3 / 2.0)
    );
    // A square image has the same horizontal view, extended equally above and below.
    let square = lens.resized([640, 640]);
    assert_eq!((square.fx, square.cx), (half.fx, half.cx));
    assert!((square.cy - half.cy - 140.0).abs() < 1e-9);
}

#[test]
fn the_renderer_can_move_to_another_thread() {
    fn is_send<T: Send>() {}
    is_send::<Renderer>();
    is_send::<Frame>();
}
