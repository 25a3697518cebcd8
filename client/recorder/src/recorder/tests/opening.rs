//! Images that were lost before the first received one.

use super::super::super::cache_request::{PAUSE, TRIES};
use super::compressed::{compressed, sample};
use super::*;

/// An episode that begins at tick 2410; its camera of 10 Hz renders number 101 first.
fn at_tick_2410() -> v1::EpisodeStarted {
    let camera = v1::CameraSetting {
        name: "gen3".into(),
        rate_hz: Some(10.0),
        ..Default::default()
    };
    v1::EpisodeStarted {
        header: Some(header(3, 0, 2410)),
        scenario: Some(v1::Scenario {
            cameras: vec![camera],
            ..Default::default()
        }),
        compressed_cameras: true,
        ..started(3, "late")
    }
}

fn begun(started: v1::EpisodeStarted, receives_compressed: bool) -> Bench {
    let mut b = Bench::new();
    let recorder = Recorder::new(b.dir.path().to_owned(), WriterOptions::default());
    b.recorder = recorder.with_compressed(receives_compressed);
    b.feed(runs(started));
    b.feed(snapshot(3));
    b
}

fn requests(b: &mut Bench) -> Vec<(String, u64, u64)> {
    let out = b.wait(4 * PAUSE).into_iter();
    out.filter_map(|output| match output {
        Output::RequestSamples { missing: m, .. } => m.last.map(|last| (m.stream, m.first, last)),
        _ => None,
    })
    .collect()
}

fn images(first: u64, last: u64) -> Vec<(String, u64, u64)> {
    vec![("camera/gen3".to_owned(), first, last)]
}

fn credit_frames(b: &Bench) -> u64 {
    b.recorder.status().credit_frames.unwrap()
}

#[test]
fn images_before_the_first_received_one_are_requested_at_once_and_hold_the_credit() {
    let mut b = begun(at_tick_2410(), false);
    b.feed(image(3, 103));
    assert_eq!((credit_frames(&b), b.recorder.status().missed), (0, 2));
    assert_eq!(requests(&mut b), images(101, 102));
    b.feed(image(3, 102));
    assert_eq!(requests(&mut b), images(101, 101));
    b.feed(image(3, 101));
    assert_eq!((credit_frames(&b), b.recorder.status().missed), (3, 0));
    assert_eq!(requests(&mut b), []);
    let count = v1::StreamCount {
        stream: "camera/gen3".into(),
        first: 101,
        last: 103,
        count: 3,
        ..Default::default()
    };
    let out = b.feed(ended(v1::EpisodeStopped {
        header: Some(header(3, 0, 2472)),
        manifest: vec![count],
        ..Default::default()
    }));
    assert_eq!((report(&out).frames, report(&out).missed), (3, 0));
}

#[test]
fn given_up_images_do_not_hold_the_credit() {
    let mut b = begun(at_tick_2410(), false);
    b.feed(image(3, 102));
    for _ in 0..TRIES {
        assert_eq!(credit_frames(&b), 0);
        assert_eq!(requests(&mut b), images(101, 101));
    }
    assert_eq!(requests(&mut b), []);
    assert_eq!((credit_frames(&b), b.recorder.status().missed), (2, 1));
}

#[test]
fn compressed_images_are_requested_in_compressed_form() {
    let mut b = begun(at_tick_2410(), true);
    let image = |sequence| {
        let mut frame = compressed(sequence);
        frame.header = Some(header(3, sequence, 24 * sequence));
        sample("compressed/gen3", &frame)
    };
    b.feed(image(102));
    assert_eq!(requests(&mut b), [("compressed/gen3".to_owned(), 101, 101)]);
    b.feed(image(101));
    assert_eq!((requests(&mut b), credit_frames(&b)), (vec![], 2));
}

#[test]
fn images_from_before_the_episode_are_not_requested_again() {
    let mut b = begun(at_tick_2410(), false);
    b.feed(image(3, 103));
    assert_eq!(requests(&mut b), images(101, 102));
    b.feed(image(0, 101));
    assert_eq!(requests(&mut b), images(102, 102));
    b.feed(image(2, 102));
    assert_eq!((requests(&mut b), credit_frames(&b)), (vec![], 1));
    assert_eq!(b.recorder.status().missed, 0);
}

#[test]
fn no_image_is_requested_after_a_full_start_a_late_join_or_in_a_playback() {
    let shown = v1::EpisodeStarted {
        as_recorded: true,
        ..at_tick_2410()
    };
    for (started, first) in [(at_tick_2410(), 101), (at_tick_2410(), 107), (shown, 102)] {
        let mut b = begun(started, false);
        b.feed(image(3, first));
        assert_eq!(
            (requests(&mut b), credit_frames(&b)),
            (vec![], 1),
            "{first}"
        );
    }
}
