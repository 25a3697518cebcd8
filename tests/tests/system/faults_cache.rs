//! Who asks for more of what the caches keep than a slow link carries.

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

/// Pictures of which a few fill the sockets of a connection.
const CAMERA: [&str; 4] = ["--camera", "gen3=1280x720@10", "--quality", "fast"];

/// A slow link: all that is asked for takes minutes on it.
const BITS_PER_SECOND: f64 = 2e7;

/// Links that ask: more than there are threads that answer.
const ASKERS: usize = 10;

/// Pictures that are in the cache, and that have to come while everybody asks.
const PICTURES: u32 = 8;

/// Speed that the chair has to reach meanwhile, m/s.
const SPEED: f64 = 0.2;

/// Reads `streams` until so many pictures came and the chair has this speed, while the
/// commander drives it.
fn drive(streams: &Streams, commander: &mut Commander, pictures: u32, speed: f64) {
    let (mut came, mut fastest) = (0, 0.0_f64);
    let begun = Instant::now();
    while came < pictures || fastest < speed {
        assert!(
            begun.elapsed() < PATIENCE,
            "{came} of {pictures} pictures, {fastest} of {speed} m/s"
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
            Some(Sample::Camera(_)) => came += 1,
            _ => {}
        }
    }
}

#[test]
fn who_asks_over_a_slow_link_for_what_is_kept_holds_up_nobody() {
    let server = Server::start("slow", &CAMERA).expect("a server");
    let link = server.link();
    let streams = link
        .streams(&[TopicId::Clock, TopicId::Odometry, TopicId::Camera])
        .expect("the streams");
    let mut commander = link.commander("near", false).expect("control");
    let request = v1::EpisodeStartRequest {
        label: "slow".into(),
        ..Default::default()
    };
    let _: v1::EpisodeStarted = link.request(&request).expect("an episode");
    drive(&streams, &mut commander, PICTURES, 0.0);

    let answers = Arc::new(AtomicU64::new(0));
    let mut held = Vec::new();
    for _ in 0..ASKERS {
        let proxy = Proxy::start(&server.endpoint, Duration::ZERO, BITS_PER_SECOND);
        let proxy = proxy.expect("a proxy");
        let far = Client::open(&server.connect_through(&proxy.endpoint())).expect("a link");
        // Streams come in the line of the priority that the questions ask for.
        let hears = far.streams(&[TopicId::Clock]).expect("the clock");
        let keys = far.keys();
        for key in [keys.stream(&StreamId::camera("gen3")), keys.streams()] {
            for _ in 0..8 {
                let count = Arc::clone(&answers);
                let question = far
                    .session()
                    .get(format!("{key}/@adv/**?_sn=0.."))
                    .callback(move |answer| {
                        count.fetch_add(u64::from(answer.result().is_ok()), Ordering::Relaxed);
                    });
                let question = question
                    .priority(Priority::InteractiveHigh)
                    .accept_replies(ReplyKeyExpr::Any)
                    .consolidation(ConsolidationMode::None)
                    .target(QueryTarget::All);
                question.wait().expect("a question");
            }
        }
        held.push((far, hears, proxy));
    }
    drive(&streams, &mut commander, PICTURES, SPEED);
    wait_until("somebody is answered", || {
        answers.load(Ordering::Relaxed) > 0
    });
}
