//! Who asks for more of what the transport's caches keep than a slow link carries.

use std::time::{Duration, Instant};

use wheelarm_link::{Link, Streams};
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{StreamId, TopicId, v1};
use wheelarm_tests::{PATIENCE, Proxy, Server};
use zenoh::Wait;
use zenoh::query::{ConsolidationMode, QueryTarget, ReplyKeyExpr};

/// Pictures of which a few fill the sockets of a connection.
const CAMERA: [&str; 4] = ["--camera", "gen3=1280x720@10", "--quality", "fast"];

/// A slow link: all that is asked for takes minutes on it.
const BITS_PER_SECOND: f64 = 2e7;

/// Ticks that have to pass meanwhile.
const TICKS: u64 = 240;

/// Reads `streams` until `pictures` came and the clock shows `tick`; tells the newest tick.
fn read(streams: &Streams, pictures: u32, tick: u64) -> u64 {
    let (mut came, mut newest) = (0, 0);
    let begun = Instant::now();
    while came < pictures || newest < tick {
        assert!(
            begun.elapsed() < PATIENCE,
            "{came} of {pictures} pictures, tick {newest} of {tick}"
        );
        match streams.next(Duration::from_secs(1)).expect("no error") {
            Some(Sample::Clock(clock)) => newest = clock.header.unwrap_or_default().tick,
            Some(Sample::Camera(_)) => came += 1,
            _ => {}
        }
    }
    newest
}

#[test]
fn who_asks_for_what_is_kept_over_a_slow_link_holds_up_nobody() {
    let server = Server::start("slow", &CAMERA).expect("a server");
    let link = server.link();
    let streams = link
        .streams(&[TopicId::Clock, TopicId::Camera])
        .expect("the streams");
    let request = v1::EpisodeStartRequest {
        label: "slow".into(),
        ..Default::default()
    };
    let _: v1::EpisodeStarted = link.ask(&request).expect("an episode");
    // The cache is full.
    read(&streams, 8, 0);

    let proxy = Proxy::start(&server.endpoint, Duration::ZERO, BITS_PER_SECOND).expect("a proxy");
    let far = Link::open(&server.connect_through(&proxy.endpoint())).expect("a link");
    let keys = far.keys();
    let mut asked = Vec::new();
    for key in [keys.stream(&StreamId::camera("gen3")), keys.streams()] {
        for _ in 0..8 {
            let question = far.session().get(format!("{key}/@adv/**?_sn=0.."));
            let question = question
                .accept_replies(ReplyKeyExpr::Any)
                .consolidation(ConsolidationMode::None)
                .target(QueryTarget::All);
            asked.push(question.wait().expect("a question"));
        }
    }
    let begun = read(&streams, 1, 0);
    read(&streams, 4, begun + TICKS);
}
