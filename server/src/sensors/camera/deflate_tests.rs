//! Streams deflated on the GPU decompress to the image.

use wheelarm_codec::depth::to_millimetres;
use wheelarm_codec::{Deflate, inflate};
use wheelarm_proto::settings::Depth;

use super::packing_tests::{SIZES, both, sizes};
use super::tests::{camera, floor_and_box, looking, snapshot};
use super::*;

/// Colour, depth in its stored form, and IDs, with the bytes of their elements.
fn planes(frame: &Frame, kept: Depth) -> [(Vec<u8>, usize); 3] {
    let depth = match kept {
        Depth::Metres => (frame.depth.to_vec(), 4),
        Depth::Millimetres => {
            let mut millimetres = Vec::new();
            to_millimetres(&frame.depth, &mut millimetres);
            (millimetres, 2)
        }
        Depth::Nothing => (Vec::new(), 1),
    };
    [(frame.rgb.to_vec(), 1), depth, (frame.ids.to_vec(), 2)]
}

/// Number of deflated planes; those must decompress to the exact ones.
fn check(frame: &Frame, kept: Depth) -> usize {
    let mut count = 0;
    for ((exact, element), stream) in planes(frame, kept).iter().zip(&frame.deflated) {
        let Some(stream) = stream else { continue };
        // The checksum at the end is of the original bytes.
        let again = inflate(stream, *element, exact.len()).unwrap();
        assert!(again == exact[..], "{:?} {kept:?}", frame.intrinsics);
        count += 1;
    }
    count
}

#[test]
fn streams_of_every_size_decompress_to_the_image() {
    let scene = floor_and_box();
    let cameras = sizes();
    let all: Vec<usize> = (0..cameras.len()).collect();
    for (quality, kept) in [
        (Quality::Fast, Depth::Metres),
        (Quality::High, Depth::Metres),
        (Quality::Fast, Depth::Millimetres),
        (Quality::Fast, Depth::Nothing),
    ] {
        let all_planes = if kept == Depth::Nothing { 2 } else { 3 };
        let Some([mut adapter, _]) = both(&scene, &cameras, quality) else {
            return;
        };
        for &camera in &all {
            adapter.deflate(camera, Some(kept));
        }
        let mut counts = vec![0; SIZES.len()];
        // Long enough for codes from previous images.
        for i in 0..11 {
            let now = snapshot(&[[0.2 - 0.1 * f64::from(i), 0.1, 0.6]]);
            for frame in adapter.render(&now, &all).unwrap() {
                counts[frame.camera] += check(&frame, kept);
            }
        }
        // All except possibly those of the first image, which uses other codes and may
        // exceed its room.
        let least = 10 * all_planes;
        assert!(counts.iter().all(|&count| count >= least), "{counts:?}");
        adapter.deflate(1, None);
        let now = snapshot(&[[0.2, 0.1, 0.6]]);
        let frames = adapter.render(&now, &all).unwrap();
        let counts: Vec<_> = frames.iter().map(|frame| check(frame, kept)).collect();
        let expected = [1, 0, 1, 1, 1, 1].map(|some| some * all_planes);
        assert_eq!(counts, expected);
    }
}

#[test]
fn a_large_image_compresses_as_well_as_on_the_cpu() {
    let scene = floor_and_box();
    let eye = camera(
        looking([2.5, 1.0, 1.5], [0.0; 3]),
        Intrinsics::centred([640, 362], 1.1),
    );
    let Some([mut adapter, mut processor]) =
        both(&scene, std::slice::from_ref(&eye), Quality::Standard)
    else {
        return;
    };
    let now = snapshot(&[[0.2, 0.1, 0.6]]);
    processor.deflate(0, Some(Depth::Metres));
    let plain = processor.render(&now, &[0]).unwrap();
    assert_eq!(plain[0].deflated, Deflated::default());
    let mut deflate = Deflate::default();
    for kept in [Depth::Metres, Depth::Millimetres] {
        adapter.deflate(0, Some(kept));
        let mut last = Vec::new();
        for _ in 0..4 {
            last = adapter.render(&now, &[0]).unwrap();
            check(&last[0], kept);
        }
        let exact = planes(&last[0], kept);
        assert!(exact == planes(&plain[0], kept));
        // Every 64 bytes take a few bits, even in uniform data.
        for ((exact, element), stream) in exact.iter().zip(&last[0].deflated) {
            let (mut out, stream) = (Vec::new(), stream.as_ref().unwrap());
            let usual = deflate.append(exact, *element, &mut out);
            println!("{kept:?}: {} bytes, {usual} on the CPU", stream.len());
            assert!(
                stream.len() < usual * 5 / 4 + exact.len() / 64,
                "{} {usual}",
                stream.len()
            );
        }
    }
}

/// Renderers of one device, each in its own thread, create shaders and streams at the
/// same time.
#[test]
fn several_renderers_of_one_device_deflate_at_once() {
    let scene = floor_and_box();
    let cameras = sizes();
    let graphics = Graphics::for_test().packing(Packing::Adapter);
    let mut renderers = Vec::new();
    for _ in 0..3 {
        match Renderer::over(&graphics, &scene, &cameras, Quality::Fast) {
            Ok(renderer) => renderers.push(renderer),
            Err(reason @ RenderError::NoDriver) => {
                wheelarm_proto::program::skipped(&reason.to_string());
                return;
            }
            Err(other) => panic!("{other}"),
        }
    }
    let together = std::sync::Barrier::new(renderers.len());
    std::thread::scope(|threads| {
        for mut renderer in renderers {
            let together = &together;
            threads.spawn(move || {
                renderer.deflate(0, Some(Depth::Metres));
                together.wait();
                let mut count = 0;
                for i in 0..6 {
                    let now = snapshot(&[[0.2 - 0.1 * f64::from(i), 0.1, 0.6]]);
                    let frames = renderer.render(&now, &[0]).unwrap();
                    count += check(&frames[0], Depth::Metres);
                }
                assert!(count >= 15, "{count}");
            });
        }
    });
}
