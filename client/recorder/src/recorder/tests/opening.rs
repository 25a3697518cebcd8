//! Pictures that were lost before the first that came.

use super::super::super::question::{PAUSE, TRIES};
use super::compressed::{compressed, sample};
use super::*;

/// An episode that begins at tick 2410; its camera of 10 Hz draws number 101 first.
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

fn begun(started: v1::EpisodeStarted, hears_compressed: bool) -> Bench {
    let mut b = Bench::new();
    let recorder = Recorder::new(b.dir.path().to_owned(), WriterOptions::default());
    b.recorder = recorder.with_compressed(hears_compressed);
    b.feed(runs(started));
    b.feed(snapshot(3));
    b
}

fn asked(b: &mut Bench) -> Vec<(String, u64, u64)> {
    let out = b.wait(4 * PAUSE).into_iter();
    out.filter_map(|output| match output {
        Output::AskSamples { missing: m, .. } => m.last.map(|last| (m.stream, m.first, last)),
        _ => None,
    })
    .collect()
}

fn pictures(first: u64, last: u64) -> Vec<(String, u64, u64)> {
    vec![("camera/gen3".to_owned(), first, last)]
}

fn credit_frames(b: &Bench) -> u64 {
    b.recorder.status().credit_frames.unwrap()
}

#[test]
fn pictures_before_the_first_that_came_are_asked_for_at_once_and_hold_the_credit() {
    let mut b = begun(at_tick_2410(), false);
    b.feed(picture(3, 103));
    assert_eq!((credit_frames(&b), b.recorder.status().missed), (0, 2));
    assert_eq!(asked(&mut b), pictures(101, 102));
    b.feed(picture(3, 102));
    assert_eq!(asked(&mut b), pictures(101, 101));
    b.feed(picture(3, 101));
    assert_eq!((credit_frames(&b), b.recorder.status().missed), (3, 0));
    assert_eq!(asked(&mut b), []);
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
fn what_does_not_come_is_given_up_and_holds_nobody_up() {
    let mut b = begun(at_tick_2410(), false);
    b.feed(picture(3, 102));
    for _ in 0..TRIES {
        assert_eq!(credit_frames(&b), 0);
        assert_eq!(asked(&mut b), pictures(101, 101));
    }
    assert_eq!(asked(&mut b), []);
    assert_eq!((credit_frames(&b), b.recorder.status().missed), (2, 1));
}

#[test]
fn compressed_ones_are_asked_for_so() {
    let mut b = begun(at_tick_2410(), true);
    let picture = |sequence| {
        let mut frame = compressed(sequence);
        frame.header = Some(header(3, sequence, 24 * sequence));
        sample("compressed/gen3", &frame)
    };
    b.feed(picture(102));
    assert_eq!(asked(&mut b), [("compressed/gen3".to_owned(), 101, 101)]);
    b.feed(picture(101));
    assert_eq!((asked(&mut b), credit_frames(&b)), (vec![], 2));
}

#[test]
fn pictures_of_before_the_episode_are_not_asked_for_again() {
    let mut b = begun(at_tick_2410(), false);
    b.feed(picture(3, 103));
    assert_eq!(asked(&mut b), pictures(101, 102));
    b.feed(picture(0, 101));
    assert_eq!(asked(&mut b), pictures(102, 102));
    b.feed(picture(2, 102));
    assert_eq!((asked(&mut b), credit_frames(&b)), (vec![], 1));
    assert_eq!(b.recorder.status().missed, 0);
}

#[test]
fn nothing_is_asked_for_by_who_saw_the_beginning_came_late_or_is_shown_a_recording() {
    let shown = v1::EpisodeStarted {
        as_recorded: true,
        ..at_tick_2410()
    };
    for (started, first) in [(at_tick_2410(), 101), (at_tick_2410(), 107), (shown, 102)] {
        let mut b = begun(started, false);
        b.feed(picture(3, first));
        assert_eq!((asked(&mut b), credit_frames(&b)), (vec![], 1), "{first}");
    }
}
