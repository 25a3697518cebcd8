//! Pictures that were lost before the first that came.

use super::super::super::question::PAUSE;
use super::*;

/// An episode that begins at tick 2400, with a camera of 10 Hz.
fn at_tick_2400(episode: u64) -> v1::EpisodeStarted {
    let camera = v1::CameraSetting {
        name: "gen3".into(),
        rate_hz: Some(10.0),
        ..Default::default()
    };
    v1::EpisodeStarted {
        header: Some(header(episode, 0, 2400)),
        scenario: Some(v1::Scenario {
            cameras: vec![camera],
            ..Default::default()
        }),
        ..started(episode, "late")
    }
}

fn begun() -> Bench {
    let mut b = Bench::new();
    b.feed(runs(at_tick_2400(3)));
    b.feed(snapshot(3));
    b
}

fn asked(b: &mut Bench) -> Vec<(u64, u64)> {
    let out = b.wait(4 * PAUSE).into_iter();
    out.filter_map(|output| match output {
        Output::AskSamples { missing: m, .. } if m.stream == "camera/gen3" => {
            m.last.map(|last| (m.first, last))
        }
        _ => None,
    })
    .collect()
}

#[test]
fn pictures_before_the_first_that_came_are_asked_for_at_once() {
    let mut b = begun();
    // Two are lost: tick 2400 is that of number 100.
    b.feed(picture(3, 102));
    assert_eq!(asked(&mut b), [(100, 101)]);
    b.feed(picture(3, 101));
    assert_eq!(asked(&mut b), [(100, 100)]);
    b.feed(picture(3, 100));
    assert_eq!(asked(&mut b), []);
    let count = v1::StreamCount {
        stream: "camera/gen3".into(),
        first: 100,
        last: 102,
        count: 3,
        ..Default::default()
    };
    let out = b.feed(ended(v1::EpisodeStopped {
        header: Some(header(3, 0, 2448)),
        manifest: vec![count],
        ..Default::default()
    }));
    assert_eq!((report(&out).frames, report(&out).missed), (3, 0));
}

#[test]
fn what_was_not_drawn_in_the_episode_is_not_asked_for_twice() {
    let mut b = begun();
    b.feed(picture(3, 102));
    assert_eq!(asked(&mut b), [(100, 101)]);
    // Nobody watched, and nothing was drawn: these numbers are of before.
    b.feed(picture(0, 100));
    assert_eq!(asked(&mut b), [(101, 101)]);
    b.feed(picture(2, 101));
    assert_eq!(asked(&mut b), []);
    assert_eq!(b.recorder.status().missed, 0);
}

#[test]
fn who_is_there_from_the_first_picture_on_asks_for_nothing() {
    let mut b = begun();
    b.feed(picture(3, 100));
    b.feed(picture(3, 101));
    assert_eq!(asked(&mut b), []);
}
