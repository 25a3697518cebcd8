//! Images packed on the GPU equal those packed on the CPU, bit for bit.

use super::ambient_tests::{can, dim};
use super::tests::{camera, floor_and_box, item, looking, scene, snapshot};
use super::*;
use crate::appearance::{Irradiance, Reflection};
use crate::geometry::Shape;

/// Two equal renderers with different packing; `None`, with the reason printed, only
/// without a Vulkan driver.
pub(super) fn both(
    scene: &RenderScene,
    cameras: &[CameraSpec],
    quality: Quality,
) -> Option<[Renderer; 2]> {
    let made = [Packing::Adapter, Packing::Processor].map(|packing| {
        let graphics = Graphics::for_test().packing(packing);
        match Renderer::over(&graphics, scene, cameras, quality) {
            Ok(renderer) => Some(renderer),
            Err(reason @ RenderError::NoDriver) => {
                wheelarm_proto::program::skipped(&reason.to_string());
                None
            }
            Err(other) => panic!("{other}"),
        }
    });
    let [Some(adapter), Some(processor)] = made else {
        return None;
    };
    Some([adapter, processor])
}

/// Odd and even sizes, rows with and without padding in copies, and the smallest.
pub(super) const SIZES: [[u32; 2]; 6] = [[225, 127], [64, 48], [97, 61], [3, 5], [2, 1], [1, 1]];

pub(super) fn sizes() -> Vec<CameraSpec> {
    let ranges = [[0.05, 20.0], [0.0123, 2.9], [0.3, f64::INFINITY]];
    let sizes = SIZES.iter().zip(ranges.iter().cycle());
    sizes
        .map(|(&size, &range)| CameraSpec {
            range,
            ..camera(
                looking([2.5, 1.0, 1.5], [0.0; 3]),
                Intrinsics::centred(size, 1.1),
            )
        })
        .collect()
}

#[test]
fn both_pack_the_same_bits_of_every_size_and_quality() {
    let scene = floor_and_box();
    let cameras = sizes();
    let all: Vec<usize> = (0..cameras.len()).collect();
    for quality in [
        Quality::Fast,
        Quality::Draft,
        Quality::Standard,
        Quality::High,
    ] {
        let Some([mut adapter, mut processor]) = both(&scene, &cameras, quality) else {
            return;
        };
        for at in [[0.2, 0.1, 0.6], [-0.9, 0.4, 0.35]] {
            let now = snapshot(&[at]);
            let one = adapter.render(&now, &all).unwrap();
            let two = processor.render(&now, &all).unwrap();
            for (one, two) in one.iter().zip(&two) {
                let [width, height] = SIZES[one.camera].map(|side| side as usize);
                assert_eq!(one.rgb.len(), width * height * 3);
                assert_eq!(one.depth.len(), width * height * 4);
                assert_eq!(one.ids.len(), width * height * 2);
                assert_eq!(one.rgb, two.rgb, "{quality:?} {width}x{height}");
                assert_eq!(one.depth, two.depth, "{quality:?} {width}x{height}");
                assert_eq!(one.ids, two.ids, "{quality:?} {width}x{height}");
            }
            let ids = one[0].ids();
            assert!(ids.iter().any(|id| *id != ids[0]));
        }
    }
}

#[test]
fn both_darken_surfaces_near_objects_alike() {
    // Lists of one to eight capsules, on planes with and without the ambient map.
    let count = 12;
    let board = Shape::Cuboid {
        half: [0.02, 0.5, 0.15],
    };
    let mut items: Vec<RenderItem> = (0..count).map(can).collect();
    items.push(item(&board, [0.6; 3], Binding::World, [0.3, 0.0, 0.15], 40));
    let scene = dim(items, count);
    let eye = looking([-0.8, -0.9, 1.1], [0.0, 0.0, 0.0]);
    let eye = camera(eye, Intrinsics::centred([323, 241], 0.9));
    for quality in [Quality::Standard, Quality::High] {
        let Some([mut adapter, mut processor]) = both(&scene, std::slice::from_ref(&eye), quality)
        else {
            return;
        };
        let near = |i: usize| [0.09 * (i % 3) as f64, 0.09 * (i / 3) as f64, 0.06];
        let apart = |i: usize| [0.25 * (i % 3) as f64 - 0.4, 0.2 * (i / 3) as f64, 0.06];
        for place in [near, apart] {
            let places: Vec<[f64; 3]> = (0..count).map(place).collect();
            let now = snapshot(&places);
            let one = adapter.render(&now, &[0]).unwrap();
            let two = processor.render(&now, &[0]).unwrap();
            assert!(one[0].rgb == two[0].rgb, "{quality:?}");
            assert_eq!((&one[0].depth, &one[0].ids), (&two[0].depth, &two[0].ids));
        }
    }
}

#[test]
fn both_pack_the_same_ids_beyond_a_byte() {
    let ball = Shape::Sphere { radius: 0.2 };
    let place = |i: usize| [2.0, i as f64 * 0.5 - 1.0, 0.0];
    let ids = [1, 255, 256, 300, 4001];
    let items = ids
        .iter()
        .enumerate()
        .map(|(i, id)| item(&ball, [0.5; 3], Binding::Object(i), [0.0; 3], *id));
    let scene = scene(items.collect(), ids.len());
    let eye = camera(
        looking([0.0; 3], [1.0, 0.0, 0.0]),
        Intrinsics::centred([101, 63], 1.2),
    );
    for quality in [Quality::Draft, Quality::Standard, Quality::High] {
        let Some([mut adapter, mut processor]) = both(&scene, std::slice::from_ref(&eye), quality)
        else {
            return;
        };
        let now = snapshot(&[0, 1, 2, 3, 4].map(place));
        let one = adapter.render(&now, &[0]).unwrap();
        let two = processor.render(&now, &[0]).unwrap();
        assert_eq!(one[0].ids, two[0].ids);
        assert_eq!((&one[0].rgb, &one[0].depth), (&two[0].rgb, &two[0].depth));
        let visible = one[0].ids();
        assert!(ids.iter().all(|id| visible.contains(id)));
    }
}

#[test]
fn held_images_stay_valid_and_their_memory_is_reused() {
    let scene = floor_and_box();
    let eye = camera(
        looking([2.5, 1.0, 1.5], [0.0; 3]),
        Intrinsics::centred([33, 21], 1.1),
    );
    let Some([mut adapter, mut processor]) =
        both(&scene, std::slice::from_ref(&eye), Quality::Standard)
    else {
        return;
    };
    let place = |i: usize| snapshot(&[[-0.9 + 0.1 * i as f64, 0.1, 0.6]]);
    // More than are shared without a copy.
    let kept: Vec<Frame> = (0..20)
        .flat_map(|i| adapter.render(&place(i), &[0]).unwrap())
        .collect();
    for (i, kept) in kept.iter().enumerate() {
        let again = processor.render(&place(i), &[0]).unwrap();
        assert_eq!(kept.rgb, again[0].rgb, "{i}");
        assert_eq!((&kept.depth, &kept.ids), (&again[0].depth, &again[0].ids));
    }
    let [spare, lent] = adapter.ring(0).counts();
    assert_eq!(lent, 12);
    // One plane is enough to hold an image.
    let depth: Vec<_> = kept.into_iter().map(|frame| frame.depth).collect();
    assert_eq!(adapter.ring(0).counts(), [spare, lent]);
    drop(depth);
    assert_eq!(adapter.ring(0).counts(), [spare + lent, 0]);
    let last = adapter.render(&place(3), &[0]).unwrap();
    assert_eq!(adapter.ring(0).counts(), [spare + lent - 1, 1]);
    // It outlives the renderer.
    drop(adapter);
    let again = processor.render(&place(3), &[0]).unwrap();
    assert_eq!(last[0].rgb, again[0].rgb);
}

/// Light of the same strength from all directions, with transparent glass.
fn even_light() -> Surrounding {
    let levels = std::iter::successors(Some(Reflection::SIDE), |side| Some(side / 2));
    let levels = levels.take(5).map(|side| vec![120; side * side * 4]);
    Surrounding {
        irradiance: Irradiance([nalgebra::Matrix4::identity(); 3]),
        reflection: Reflection {
            levels: levels.collect(),
        },
        lamps: Vec::new(),
    }
}

/// Where nothing is hit, images show the same sky, also through glass and independent
/// of earlier images.
#[test]
fn both_show_the_sky_where_nothing_is_hit() {
    let ball = Shape::Sphere { radius: 0.2 };
    let pane = Shape::Cuboid {
        half: [0.01, 0.4, 0.4],
    };
    let own = |shape, i, id| item(shape, [0.5, 0.3, 0.2], Binding::Object(i), [0.0; 3], id);
    let mut glass = own(&pane, 1, 2);
    glass.material.transmission = 0.8;
    let mut all = scene(vec![own(&ball, 0, 1), glass], 2);
    all.lighting.sky = [0.31, 0.47, 0.9];
    let eye = camera(
        looking([0.0; 3], [1.0, 0.0, 0.0]),
        Intrinsics::centred([123, 67], 1.2),
    );
    let away = [-3.0, 0.0, 0.0];
    for lit in [false, true] {
        all.surrounding = lit.then(even_light);
        for quality in [
            Quality::Fast,
            Quality::Draft,
            Quality::Standard,
            Quality::High,
        ] {
            let Some([mut adapter, mut processor]) =
                both(&all, std::slice::from_ref(&eye), quality)
            else {
                return;
            };
            for objects in [
                [[2.0, 0.5, 0.0], away],
                [[2.0, -0.5, 0.0], away],
                [[3.0, 0.1, 0.0], [1.5, 0.0, 0.0]],
                [away, [1.5, 0.3, 0.1]],
                [away, away],
            ] {
                let now = snapshot(&objects);
                let one = adapter.render(&now, &[0]).unwrap();
                let two = processor.render(&now, &[0]).unwrap();
                assert!(one[0].rgb == two[0].rgb, "{lit} {quality:?} {objects:?}");
                assert_eq!((&one[0].depth, &one[0].ids), (&two[0].depth, &two[0].ids));
                let nothing = one[0].ids().iter().filter(|id| **id == 0).count();
                let is_empty = objects == [away, away];
                assert_eq!(nothing == 123 * 67, is_empty, "{objects:?}");
                assert!(nothing > 0);
            }
        }
    }
}
