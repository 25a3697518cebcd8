//! Clients that request more cached samples than their slow link carries.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use wheelarm_proto::topic::Sample;
use wheelarm_proto::{StreamId, TopicId, v1};
use wheelarm_sdk::{Client, Commander, Streams};
use wheelarm_tests::{PATIENCE, Proxy, Server, wait_until};
use zenoh::Wait;
use zenoh::qos::Priority;
use zenoh::query::{ConsolidationMode, QueryTarget, ReplyKeyExpr};

/// A few of these images fill the sockets of a connection.
const CAMERA: [&str; 4] = ["--camera", "gen3=1280x720@10", "--quality", "fast"];

/// A slow link: the requested samples take minutes on it.
const BITS_PER_SECOND: f64 = 2e7;

/// Number of requesting clients: more than there are reply threads.
const CLIENTS: usize = 10;

/// Images in the cache, and images that must arrive during the requests.
const IMAGES: u32 = 8;

/// Speed that the chair must reach during the requests, m/s.
const SPEED: f64 = 0.2;

/// Drives and reads `streams` until so many images arrived and the chair reached this speed,
/// m/s.
fn drive(streams: &Streams, commander: &mut Commander, images: u32, speed: f64) {
    let (mut received, mut fastest) = (0, 0.0_f64);
    let begun = Instant::now();
    while received < images || fastest < speed {
        assert!(
            begun.elapsed() < PATIENCE,
            "{received} of {images} images, {fastest} of {speed} m/s"
        );
        match streams.next(Duration::from_secs(1)).expect("no error") {
            Some(Sample::Clock(clock)) => {
                let command = v1::Command {
                    base: Some(v1::BaseCommand {
                        linear: if speed > 0.0 { 0.3 } else { 0.0 },
                        angular: 0.0,
                    }),
                    ..v1::Command::default()
                };
                let header = clock.header.unwrap_or_default();
                commander.answer(&header, command).expect("a command");
            }
            Some(Sample::Odometry(odometry)) => {
                let twist = odometry.twist.unwrap_or_default();
                fastest = fastest.max(twist.linear.unwrap_or_default().x);
            }
            Some(Sample::Camera(_)) => received += 1,
            _ => {}
        }
    }
}

#[test]
fn cache_requests_over_slow_links_do_not_delay_other_clients() {
    let server = Server::start("slow", &CAMERA).expect("a server");
    let client = server.client();
    let streams = client
        .streams(&[TopicId::Clock, TopicId::Odometry, TopicId::Camera])
        .expect("the streams");
    let mut commander = client.commander("near", false).expect("control");
    let request = v1::EpisodeStartRequest {
        label: "slow".into(),
        ..Default::default()
    };
    let _: v1::EpisodeStarted = client.request(&request).expect("an episode");
    drive(&streams, &mut commander, IMAGES, 0.0);

    let answers = Arc::new(AtomicU64::new(0));
    let mut held = Vec::new();
    for _ in 0..CLIENTS {
        let proxy = Proxy::start(&server.endpoint, Duration::ZERO, BITS_PER_SECOND);
        let proxy = proxy.expect("a proxy");
        let far = Client::open(&server.connect_through(&proxy.endpoint())).expect("a client");
        // The clock uses the priority queue that the requests use.
        let streams = far.streams(&[TopicId::Clock]).expect("the clock");
        let keys = far.keys();
        for key in [keys.stream(&StreamId::camera("gen3")), keys.streams()] {
            for _ in 0..8 {
                let count = Arc::clone(&answers);
                let request = far
                    .session()
                    .get(format!("{key}/@adv/**?_sn=0.."))
                    .callback(move |answer| {
                        count.fetch_add(u64::from(answer.result().is_ok()), Ordering::Relaxed);
                    });
                let request = request
                    .priority(Priority::InteractiveHigh)
                    .accept_replies(ReplyKeyExpr::Any)
                    .consolidation(ConsolidationMode::None)
                    .target(QueryTarget::All);
                request.wait().expect("a request");
            }
        }
        held.push((far, streams, proxy));
    }
    drive(&streams, &mut commander, IMAGES, SPEED);
    wait_until("a reply arrives", || answers.load(Ordering::Relaxed) > 0);
}
