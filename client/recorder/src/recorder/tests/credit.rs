//! The credit of a recorder for a lock-step server.

use super::super::super::episode::SILENCE;
use super::*;

/// The newest credit in the outputs: frames and tick.
fn credit(out: &[Output]) -> Option<(u64, u64)> {
    out.iter().rev().find_map(|o| match o {
        Output::Status(s) => Some((s.credit_frames?, s.credit_tick?)),
        _ => None,
    })
}

#[test]
fn credit_is_published_without_images_too() {
    let mut b = Bench::new();
    b.open(1, "dark");
    let published: Vec<_> = (0..150)
        .filter_map(|n| credit(&b.feed(hash(1, n))))
        .collect();
    assert_eq!(published, [(0, 48), (0, 96), (0, 144)]);
}

#[test]
fn credit_does_not_advance_while_a_missing_sample_may_arrive() {
    let mut b = Bench::new();
    b.open(1, "held");
    b.feed(hash(1, 0));
    assert_eq!(credit(&b.feed(image(1, 0))), Some((1, 0)));
    b.feed(hash(1, 2));
    assert_eq!(credit(&b.feed(image(1, 1))), Some((1, 0)));
    assert_eq!(credit(&b.feed(hash(1, 200))), None);
    b.feed(hash(1, 1));
    assert_eq!(b.recorder.status().credit_tick, Some(0));
    for n in 3..199 {
        b.feed(hash(1, n));
    }
    assert_eq!(credit(&b.feed(hash(1, 199))), Some((2, 200)), "all is here");
    // A missing image is given up and no longer holds the credit.
    assert_eq!(credit(&b.feed(image(1, 3))), Some((2, 200)));
    b.feed(hash(1, 201));
    let mut published = Vec::new();
    for _ in 0..20 {
        published.extend(credit(&b.wait(Duration::from_secs(1))));
    }
    assert_eq!(published, [(4, 201)]);
    assert_eq!(b.recorder.status().missed, 1);
    b.feed(ended(stopped(1, 202, 4)));
    b.wait(MANIFEST_PATIENCE);
    let published = b.recorder.status();
    assert_eq!(
        (published.credit_frames, published.credit_tick),
        (Some(4), Some(201))
    );
}

fn state_sample(stream: &str, message: impl Message) -> Input {
    Input::Sample {
        stream: stream.into(),
        payload: message.encode_to_vec().into(),
    }
}

fn clock(tick: u64) -> Input {
    let message = v1::Clock {
        header: Some(header(1, tick, tick)),
        ..Default::default()
    };
    state_sample("clock", message)
}

fn imu(tick: u64) -> Input {
    let message = v1::Imu {
        header: Some(header(1, tick, tick)),
        ..Default::default()
    };
    state_sample("imu", message)
}

#[test]
fn a_stream_that_is_held_back_holds_the_credit_and_one_that_ended_does_not() {
    let mut b = Bench::new();
    b.open(1, "behind");
    b.wait(Duration::ZERO);
    for n in 0..=100 {
        b.feed(imu(n));
        b.feed(clock(n));
    }
    b.wait(Duration::ZERO);
    assert_eq!(b.recorder.status().credit_tick, Some(96));
    for n in 101..=400 {
        assert_eq!(credit(&b.feed(clock(n))), None);
    }
    assert_eq!(credit(&b.wait(SILENCE / 2)), None);
    assert_eq!(credit(&b.wait(2 * SILENCE)), Some((0, 400)));
    // It advances.
    b.feed(clock(401));
    for n in 101..=500 {
        b.feed(imu(n));
    }
    assert_eq!(b.recorder.status().credit_tick, Some(400));
}

#[test]
fn credit_waits_for_the_answer_to_the_last_request() {
    let mut b = Bench::new();
    b.open(1, "late");
    for n in [0, 100] {
        b.feed(hash(1, n));
    }
    let mut requested = 0;
    while requested < 5 {
        let out = b.wait(Duration::from_millis(500));
        assert_eq!(credit(&out), None);
        let questions = out
            .iter()
            .filter(|o| matches!(o, Output::RequestSamples { .. }));
        requested += questions.count();
    }
    for n in 1..99 {
        b.feed(hash(1, n));
    }
    assert_eq!(credit(&b.feed(hash(1, 99))), Some((0, 100)));
    assert_eq!(b.recorder.status().missed, 0);
}

#[test]
fn without_states_images_show_the_time() {
    let mut b = Bench::new();
    b.open(1, "images");
    assert_eq!(credit(&b.feed(image(1, 0))), Some((1, 0)));
    let tick = credit(&b.feed(image(1, 1))).expect("a credit").1;
    assert!(tick > 0 && credit(&b.feed(image(1, 2))) == Some((3, 2 * tick)));
    // With states, the states do.
    b.feed(clock(1));
    assert_eq!(credit(&b.feed(image(1, 3))), Some((4, 1)));
}
