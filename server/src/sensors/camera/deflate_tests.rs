//! What the adapter deflates is the picture, whatever reads it.

use wheelarm_compress::{Deflate, inflate};

use super::packing_tests::{SIZES, both, sizes};
use super::tests::{camera, floor_and_box, looking, snapshot};
use super::*;

/// Bytes of the elements of colour, depth and ids.
const ELEMENTS: [usize; 3] = [1, 4, 2];

fn planes(frame: &Frame) -> [&Bytes; 3] {
    [&frame.rgb, &frame.depth, &frame.ids]
}

/// How many of the planes were deflated; those that were hold the exact ones.
fn check(frame: &Frame) -> usize {
    let mut count = 0;
    for ((exact, stream), element) in planes(frame).iter().zip(&frame.deflated).zip(ELEMENTS) {
        let Some(stream) = stream else { continue };
        // Its end holds a checksum that was not made from these bytes.
        let again = inflate(stream, element, exact.len()).unwrap();
        assert!(again == exact[..], "{:?}", frame.intrinsics);
        count += 1;
    }
    count
}

#[test]
fn streams_of_every_size_are_the_picture() {
    let scene = floor_and_box();
    let cameras = sizes();
    let all: Vec<usize> = (0..cameras.len()).collect();
    for quality in [Quality::Fast, Quality::High] {
        let Some([mut adapter, _]) = both(&scene, &cameras, quality) else {
            return;
        };
        for &camera in &all {
            adapter.deflate(camera, true);
        }
        let mut counts = vec![0; SIZES.len()];
        // Long enough for codes of pictures before.
        for i in 0..11 {
            let now = snapshot(&[[0.2 - 0.1 * f64::from(i), 0.1, 0.6]]);
            for frame in adapter.render(&now, &all).unwrap() {
                counts[frame.camera] += check(&frame);
            }
        }
        // All but those of the first picture at most: of other codes, it may want more
        // room than there is.
        assert!(counts.iter().all(|&count| count >= 30), "{counts:?}");
        adapter.deflate(1, false);
        let now = snapshot(&[[0.2, 0.1, 0.6]]);
        let frames = adapter.render(&now, &all).unwrap();
        let counts: Vec<_> = frames.iter().map(check).collect();
        assert_eq!(counts, [3, 0, 3, 3, 3, 3]);
    }
}

#[test]
fn a_large_picture_shrinks_as_the_processor_makes_it_shrink() {
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
    processor.deflate(0, true);
    let plain = processor.render(&now, &[0]).unwrap();
    assert_eq!(plain[0].deflated, Deflated::default());
    adapter.deflate(0, true);
    let mut last = Vec::new();
    for _ in 0..4 {
        last = adapter.render(&now, &[0]).unwrap();
        check(&last[0]);
    }
    let mut deflate = Deflate::default();
    // Each 64 bytes take a few bits, be they ever so even.
    for (i, (exact, stream)) in planes(&last[0]).iter().zip(&last[0].deflated).enumerate() {
        assert_eq!(exact, &planes(&plain[0])[i]);
        let (mut out, stream) = (Vec::new(), stream.as_ref().unwrap());
        let usual = deflate.append(exact, ELEMENTS[i], &mut out);
        println!(
            "plane {i}: {} bytes, {usual} by the processor",
            stream.len()
        );
        assert!(
            stream.len() < usual * 5 / 4 + exact.len() / 64,
            "{} {usual}",
            stream.len()
        );
    }
}
