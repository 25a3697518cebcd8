//! Images that the server compressed.

use super::super::super::latest;
use super::super::camera_subscription::{LONGEST, LOOK, PATIENCE};
use super::*;
use wheelarm_dataset::compress::Deflate;
use wheelarm_dataset::compress::depth::to_millimetres;
use wheelarm_dataset::depth::Depth;
use wheelarm_proto::digest::{Digest, StreamDigest, of_message};

/// An exact image; its colours depend on `sequence`.
fn exact(sequence: u64) -> v1::CameraFrame {
    v1::CameraFrame {
        header: Some(header(1, sequence, 24 * sequence)),
        camera: "gen3".into(),
        intrinsics: Some(v1::Intrinsics {
            width: 4,
            height: 2,
            ..Default::default()
        }),
        pose: Some(v1::Pose {
            position: Some(v1::Vector3 {
                x: 0.25,
                ..Default::default()
            }),
            orientation: Some(v1::Quaternion {
                w: 1.0,
                ..Default::default()
            }),
        }),
        color: (0..24).map(|i| i * 3 + sequence as u8).collect(),
        depth: (0..8_u8)
            .flat_map(|i| (0.25 * f32::from(i)).to_le_bytes())
            .collect(),
        segmentation: (0..16).collect(),
        color_format: v1::PixelFormat::Rgb8.into(),
        depth_format: v1::PixelFormat::DepthMetresF32.into(),
        segmentation_format: v1::PixelFormat::IdU16.into(),
    }
}

fn exact_digest(sequence: u64) -> Digest {
    of_message([&exact(sequence).encode_to_vec()[..]])
}

pub(super) fn compressed(sequence: u64) -> v1::CompressedCameraFrame {
    let frame = exact(sequence);
    let plane = |bytes: &[u8], element| {
        let mut out = Vec::new();
        Deflate::default().append(bytes, element, &mut out);
        Bytes::from(out)
    };
    v1::CompressedCameraFrame {
        header: frame.header,
        camera: frame.camera,
        intrinsics: frame.intrinsics,
        pose: frame.pose,
        color: plane(&frame.color, 1),
        depth: plane(&frame.depth, 4),
        segmentation: plane(&frame.segmentation, 2),
        color_format: frame.color_format,
        depth_format: frame.depth_format,
        segmentation_format: frame.segmentation_format,
        digest: exact_digest(sequence).to_vec().into(),
    }
}

pub(super) fn sample(stream: &str, message: &impl Message) -> Input {
    Input::Sample {
        stream: stream.into(),
        payload: message.encode_to_vec().into(),
    }
}

fn begins(label: &str, compressed_cameras: bool) -> v1::EpisodeStarted {
    v1::EpisodeStarted {
        compressed_cameras,
        ..started(1, label)
    }
}

/// A recorder that receives compressed images, in episode 1.
fn bench() -> Bench {
    bench_with(Depth::Metres)
}

/// The same, storing depth as `depth`.
fn bench_with(depth: Depth) -> Bench {
    let mut b = Bench::new();
    let options = WriterOptions {
        depth,
        ..WriterOptions::default()
    };
    b.recorder = Recorder::new(b.dir.path().to_owned(), options).with_compressed(true);
    let out = b.feed(runs(begins("small", true)));
    assert!(matches!(out[..], [Output::RequestSnapshot]), "{out:?}");
    b.feed(snapshot(1));
    b
}

/// The end of an episode of three images, with their digests.
fn stopped_with_digests() -> v1::EpisodeStopped {
    let mut end = stopped(1, 0, 3);
    let all: Vec<_> = (0..3).map(exact_digest).collect();
    end.manifest[1].digest = StreamDigest::from_messages(&all).to_vec();
    let all: Vec<_> = (0..3)
        .map(|i| of_message([&compressed(i).encode_to_vec()[..]]))
        .collect();
    end.manifest[1].compressed_digest = StreamDigest::from_messages(&all).to_vec();
    end
}

fn tick(sequence: u64) -> v1::Clock {
    v1::Clock {
        header: Some(header(1, sequence, sequence)),
        real_time_factor: 1.0,
    }
}

fn clock(sequence: u64) -> Input {
    sample("clock", &tick(sequence))
}

/// The manifest entry of `count` clock samples.
fn clocks(count: u64) -> v1::StreamCount {
    let all: Vec<_> = (0..count)
        .map(|i| of_message([&tick(i).encode_to_vec()[..]]))
        .collect();
    v1::StreamCount {
        stream: "clock".into(),
        first: 0,
        last: count - 1,
        count,
        digest: StreamDigest::from_messages(&all).to_vec(),
        ..Default::default()
    }
}

/// The images of a file as their original messages.
fn images(path: &Path) -> Vec<Vec<u8>> {
    let episode = Episode::open(path).unwrap();
    let camera = episode.camera("gen3").unwrap();
    (0..3)
        .map(|i| camera.encoded(&episode, i).unwrap().unwrap())
        .collect()
}

#[test]
fn compressed_images_are_stored_exactly_and_count_as_credit() {
    let mut b = bench();
    for i in 0..3 {
        let out = b.feed(sample("compressed/gen3", &compressed(i)));
        assert!(matches!(out[..], [Output::Status(_)]), "{out:?}");
    }
    assert_eq!(b.recorder.status().accepted_frames, 3);
    // A repeated image in either form adds no credit and no doubt.
    assert!(b.feed(sample("compressed/gen3", &compressed(1))).is_empty());
    assert!(b.feed(sample("camera/gen3", &exact(1))).is_empty());
    let out = b.feed(ended(stopped_with_digests()));
    let done = report(&out);
    assert!(done.complete, "{:?}", done.problems);
    let expected: Vec<_> = (0..3).map(|i| exact(i).encode_to_vec()).collect();
    assert_eq!(images(&done.path), expected);
}

#[test]
fn an_uncompressed_or_lost_image_is_requested_as_exact_image() {
    let mut b = bench();
    b.feed(sample("compressed/gen3", &compressed(0)));
    let empty = v1::CompressedCameraFrame {
        header: exact(1).header,
        ..Default::default()
    };
    assert!(b.feed(sample("compressed/gen3", &empty)).is_empty());
    let requested = |out: Vec<Output>| match &out[..] {
        [Output::RequestSamples { missing: m, .. }] => (m.stream.clone(), m.first, m.last),
        other => panic!("{other:?}"),
    };
    let moment = Duration::from_millis(50);
    let exact_one = || ("camera/gen3".to_owned(), 1, Some(1));
    assert_eq!(requested(b.wait(moment)), exact_one());
    // A pending request is not repeated at once.
    b.feed(sample("compressed/gen3", &empty));
    assert!(b.wait(moment).is_empty());
    assert_eq!(requested(b.wait(Duration::from_secs(1))), exact_one());
    b.feed(sample("camera/gen3", &exact(1)));
    assert!(b.wait(Duration::from_secs(1)).is_empty());
    // The last image is lost: the compressed form is requested first.
    b.feed(ended(stopped_with_digests()));
    let small = || ("compressed/gen3".to_owned(), 2, Some(2));
    assert_eq!(requested(b.wait(moment)), small());
    assert_eq!(requested(b.wait(Duration::from_secs(1))), small());
    let out = b.wait(Duration::from_secs(2));
    assert_eq!(requested(out), ("camera/gen3".to_owned(), 2, Some(2)));
    let out = b.feed(sample("camera/gen3", &exact(2)));
    let done = report(&out);
    assert!(done.complete, "{:?}", done.problems);
    let expected: Vec<_> = (0..3).map(|i| exact(i).encode_to_vec()).collect();
    assert_eq!(images(&done.path), expected);
}

#[test]
fn each_image_of_a_gap_is_requested_in_its_available_form() {
    let mut b = bench();
    b.feed(sample("compressed/gen3", &compressed(0)));
    let empty = v1::CompressedCameraFrame {
        header: exact(2).header,
        ..Default::default()
    };
    b.feed(sample("compressed/gen3", &empty));
    b.feed(sample("compressed/gen3", &compressed(4)));
    let mut requested: Vec<(String, u64, u64)> = Vec::new();
    let (small, full) = ("compressed/gen3", "camera/gen3");
    for _ in 0..10 {
        let out = b.wait(Duration::from_secs(4)).into_iter();
        requested.extend(out.filter_map(|output| match output {
            Output::RequestSamples { missing: m, .. } => Some((m.stream, m.first, m.last?)),
            _ => None,
        }));
    }
    let times = |stream: &str, first, last| {
        let requested = requested.iter();
        let same = requested.filter(|requested| **requested == (stream.to_owned(), first, last));
        same.count()
    };
    for number in [1, 3] {
        assert_eq!(
            (times(small, number, number), times(full, number, number)),
            (2, 3)
        );
    }
    assert_eq!(times(full, 2, 2), 5);
    assert_eq!(requested.len(), 15, "{requested:?}");
    // All three are given up and no longer hold the credit.
    assert_eq!(b.recorder.status().credit_frames, Some(5));
}

#[test]
fn compressed_depth_is_converted_to_the_stored_format() {
    for depth in [Depth::Metres, Depth::Millimetres, Depth::Nothing] {
        let stored = |is_compressed: bool| {
            let mut b = bench_with(depth);
            for i in 0..3 {
                b.feed(match is_compressed {
                    true => sample("compressed/gen3", &compressed(i)),
                    false => sample("camera/gen3", &exact(i)),
                });
            }
            let out = b.feed(ended(stopped_with_digests()));
            let done = report(&out);
            assert!(done.complete, "{:?}", done.problems);
            let episode = Episode::open(&done.path).unwrap();
            let camera = episode.camera("gen3").unwrap();
            let frames = (0..3).map(|i| camera.frame(&episode, i).unwrap());
            frames.map(|frame| format!("{frame:?}")).collect::<Vec<_>>()
        };
        let exact = stored(false);
        assert_eq!(stored(true), exact, "{depth:?}");
        assert_eq!(exact[0].contains("1.75"), depth != Depth::Nothing);
    }
    // Depth in the stored format is copied; otherwise the exact image is requested.
    let mut millimetres = Vec::new();
    to_millimetres(&exact(0).depth, &mut millimetres);
    let mut kept = Vec::new();
    Deflate::default().append(&millimetres, 2, &mut kept);
    let kept = Bytes::from(kept);
    let [in_metres, in_millimetres] = [
        v1::PixelFormat::DepthMetresF32,
        v1::PixelFormat::DepthMillimetresU16,
    ];
    for (stored, format, depth, is_taken) in [
        (Depth::Millimetres, in_millimetres, kept.clone(), true),
        (Depth::Metres, in_millimetres, kept, false),
        (Depth::Nothing, in_metres, Bytes::new(), true),
        (Depth::Metres, in_metres, Bytes::new(), false),
    ] {
        let mut b = bench_with(stored);
        let frame = v1::CompressedCameraFrame {
            depth,
            depth_format: format.into(),
            ..compressed(0)
        };
        let mut out = b.feed(sample("compressed/gen3", &frame));
        out.extend(b.wait(Duration::from_secs(1)));
        let asks = |o: &Output| {
            matches!(o, Output::RequestSamples { missing: m, .. }
                if m.stream == "camera/gen3" && m.first == 0)
        };
        assert_eq!(
            !out.iter().any(asks),
            is_taken,
            "{stored:?} {format:?}: {out:?}"
        );
        if !is_taken {
            continue;
        }
        for i in 1..3 {
            b.feed(sample("camera/gen3", &exact(i)));
        }
        let out = b.feed(ended(stopped_with_digests()));
        let episode = Episode::open(&report(&out).path).unwrap();
        let camera = episode.camera("gen3").unwrap();
        let read = camera.frame(&episode, 0).unwrap().depth;
        match stored {
            Depth::Nothing => assert!(read.is_empty()),
            // Zero means no measurement in millimetres.
            _ => {
                let whole: Vec<f32> = read.iter().map(|m| (m * 1000.0).round()).collect();
                assert_eq!(
                    whole[1..],
                    [250.0, 500.0, 750.0, 1000.0, 1250.0, 1500.0, 1750.0]
                );
            }
        }
    }
    // Depth that cannot be inflated fails the log with a reason and no other image.
    let mut b = bench_with(Depth::Millimetres);
    let broken = v1::CompressedCameraFrame {
        depth: Bytes::from_static(b"no stream"),
        ..compressed(0)
    };
    let mut out = b.feed(sample("compressed/gen3", &broken));
    out.extend(b.feed(ended(stopped_with_digests())));
    out.extend(b.wait(MANIFEST_PATIENCE));
    let is_failure = |o: &Output| matches!(o, Output::Failed(words) if words.contains("inflated"));
    assert!(out.iter().any(is_failure), "{out:?}");
}

#[test]
fn failed_requests_do_not_hold_the_credit() {
    let mut b = bench();
    b.feed(sample("compressed/gen3", &compressed(0)));
    for sequence in 1..3 {
        let empty = v1::CompressedCameraFrame {
            header: exact(sequence).header,
            ..Default::default()
        };
        b.feed(sample("compressed/gen3", &empty));
    }
    let mut requested = 0;
    for _ in 0..20 {
        for output in b.wait(Duration::from_secs(1)) {
            match output {
                // No sample arrives any more: newer ones are requested.
                Output::RequestSamples { missing: m, .. } if m.last.is_none() => {}
                Output::RequestSamples { missing: m, .. } => {
                    assert_eq!(
                        (m.stream.as_str(), m.first, m.last),
                        ("camera/gen3", 1, Some(2))
                    );
                    requested += 1;
                }
                Output::Status(status) => assert_eq!((status.missed, requested), (2, 5)),
                other => panic!("{other:?}"),
            }
        }
    }
    assert_eq!((requested, b.recorder.status().missed), (5, 2));
    // It arrives after all.
    b.feed(sample("camera/gen3", &exact(2)));
    assert_eq!(b.recorder.status().missed, 1);
}

#[test]
fn without_compressed_images_the_recorder_subscribes_to_exact_ones() {
    let mut b = bench();
    // The server waits for others: nothing is published yet.
    assert!(b.wait(2 * LONGEST).is_empty());
    b.feed(hash(1, 0));
    assert!(b.wait(2 * LONGEST).is_empty());
    b.feed(clock(0));
    assert!(b.wait(LOOK / 2).is_empty());
    let asks = |out: &[Output], from| matches!(out, [Output::RequestSamples { missing: m, .. }] if (m.stream.as_str(), m.first) == ("camera/gen3", from));
    let out = b.wait(LOOK);
    assert!(asks(&out, 0), "{out:?}");
    // None is published yet; then one is.
    assert!(b.wait(LOOK / 2).is_empty());
    b.feed(sample("camera/gen3", &exact(0)));
    // A temporarily slow server is awaited.
    let out = b.wait(LOOK);
    assert!(asks(&out, 1), "{out:?}");
    b.feed(sample("camera/gen3", &exact(1)));
    let out = b.wait(PATIENCE);
    assert!(
        matches!(out[..], [Output::SubscribeCameras { compressed: false }]),
        "{out:?}"
    );
    b.feed(sample("camera/gen3", &exact(2)));
    assert!(b.wait(LOOK).is_empty());
    let mut end = stopped_with_digests();
    end.manifest[0] = stopped(1, 1, 0).manifest[0].clone();
    end.manifest.push(clocks(1));
    assert!(report(&b.feed(ended(end))).complete);
}

fn event(sequence: u64) -> v1::Event {
    v1::Event {
        header: Some(header(1, sequence, 0)),
        ..Default::default()
    }
}

/// Requests in order: stream, first number, and whether the end is open.
fn questions(out: &[Output]) -> Vec<(&str, u64, bool)> {
    let requested = out.iter().filter_map(|output| match output {
        Output::RequestSamples { missing: m, .. } => {
            Some((m.stream.as_str(), m.first, m.last.is_none()))
        }
        _ => None,
    });
    requested.collect()
}

#[test]
fn images_lost_after_the_last_received_one_are_requested_after_a_silence() {
    let mut b = bench();
    b.feed(clock(0));
    b.feed(sample("compressed/gen3", &compressed(0)));
    assert!(b.wait(Duration::ZERO).is_empty());
    // Rejected commands appear as events.
    b.wait(latest::LOOK / 2);
    b.feed(sample("event", &event(0)));
    let out = b.wait(latest::LOOK / 2);
    assert_eq!(questions(&out), [("compressed/gen3", 1, true)]);
    // Not again before the answer.
    b.requests.clear();
    assert_eq!(questions(&b.wait(100 * latest::LOOK)), []);
    b.feed(sample("compressed/gen3", &compressed(1)));
    b.feed(sample("compressed/gen3", &compressed(2)));
    let done = b.feed(ended(stopped_with_digests()));
    assert_eq!(report(&done).frames, 3);
}

#[test]
fn in_lock_step_a_silent_camera_is_probed_in_compressed_form_first() {
    let mut b = Bench::new();
    let dir = b.dir.path().to_owned();
    b.recorder = Recorder::new(dir, WriterOptions::default()).with_compressed(true);
    let mut begun = begins("still", true);
    begun.scenario = Some(v1::Scenario {
        pacing: v1::Pacing::LockStep.into(),
        ..Default::default()
    });
    b.feed(runs(begun));
    b.feed(snapshot(1));
    b.feed(clock(0));
    assert!(b.wait(Duration::ZERO).is_empty());
    assert_eq!(
        questions(&b.wait(LONGEST)),
        [("compressed/gen3", 0, true)],
        "what is small"
    );
    let requested = std::mem::take(&mut b.requests);
    assert_eq!(
        questions(&b.wait(LONGEST)),
        [],
        "the answer may be under way"
    );
    b.requests = requested;
    assert_eq!(questions(&b.wait(LONGEST)), [("camera/gen3", 0, true)]);
}

#[test]
fn samples_that_arrive_one_by_one_after_the_end_are_awaited() {
    let mut b = bench();
    b.feed(ended(stopped_with_digests()));
    for i in 0..3 {
        b.wait(MANIFEST_PATIENCE * 9 / 10);
        let out = b.feed(sample("compressed/gen3", &compressed(i)));
        if i == 2 {
            assert!(report(&out).complete);
        }
    }
}

#[test]
fn a_server_that_compresses_late_keeps_its_subscription() {
    let mut b = bench();
    b.feed(clock(0));
    b.wait(Duration::ZERO);
    b.wait(LOOK);
    b.feed(sample("camera/gen3", &exact(0)));
    b.wait(PATIENCE / 2);
    for i in 0..3 {
        b.feed(sample("compressed/gen3", &compressed(i)));
    }
    assert!(b.wait(2 * PATIENCE).is_empty());
    let mut end = stopped_with_digests();
    end.manifest.remove(0);
    end.manifest.push(clocks(1));
    assert!(report(&b.feed(ended(end))).complete);
}

#[test]
fn exact_images_are_subscribed_of_a_server_that_does_not_compress() {
    let mut b = Bench::new();
    let dir = b.dir.path().to_owned();
    b.recorder = Recorder::new(dir, WriterOptions::default()).with_compressed(true);
    let out = b.feed(runs(begins("old", false)));
    assert!(
        matches!(
            out[..],
            [
                Output::SubscribeCameras { compressed: false },
                Output::RequestSnapshot
            ]
        ),
        "{out:?}"
    );
    b.feed(snapshot(1));
    for i in 0..3 {
        b.feed(sample("camera/gen3", &exact(i)));
    }
    let mut end = stopped_with_digests();
    end.manifest[1].compressed_digest.clear();
    assert!(report(&b.feed(ended(end))).complete);
    // Its successor does.
    let next = v1::EpisodeStarted {
        compressed_cameras: true,
        ..started(2, "new")
    };
    let out = b.feed(runs(next));
    assert!(
        matches!(
            out[..],
            [
                Output::SubscribeCameras { compressed: true },
                Output::RequestSnapshot
            ]
        ),
        "{out:?}"
    );
}

#[test]
fn forged_compressed_images_are_found_and_malformed_ones_are_missing() {
    // The true digest of the exact image with other planes.
    let forged = v1::CompressedCameraFrame {
        color: compressed(1).depth,
        ..compressed(2)
    };
    for (third, more, words) in [
        (forged.clone(), None, "digests differ"),
        (forged, Some(compressed(2)), "two contents"),
        (
            v1::CompressedCameraFrame {
                digest: Bytes::from_static(b"short"),
                ..compressed(2)
            },
            None,
            "1 of 3 samples are missing",
        ),
        (
            v1::CompressedCameraFrame {
                segmentation_format: v1::PixelFormat::IdU8.into(),
                ..compressed(2)
            },
            None,
            "1 of 3 samples are missing",
        ),
    ] {
        let mut b = bench();
        for i in 0..2 {
            b.feed(sample("compressed/gen3", &compressed(i)));
        }
        b.feed(sample("compressed/gen3", &third));
        if let Some(more) = more {
            b.feed(sample("compressed/gen3", &more));
        }
        let mut out = b.feed(ended(stopped_with_digests()));
        out.extend(b.wait(MANIFEST_PATIENCE));
        let problems = &report(&out).problems;
        assert!(problems.iter().any(|p| p.contains(words)), "{problems:?}");
    }
}
