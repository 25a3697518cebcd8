//! A hostile peer publishes under the server's keys, with its own session ID or a copy of the
//! server's. Its samples enter no recording and end none. Most tests use a router that forwards
//! everything; the server itself rejects such samples.

use std::path::Path;

use wheelarm_dataset::read::{Episode, Values};
use wheelarm_proto::Query;
use wheelarm_proto::{Message, TopicId, v1};
use wheelarm_sdk::Client;
use wheelarm_tests::{PATIENCE, Recorder, Router, Server, wait_until};
use zenoh::Wait;
use zenoh::sample::SourceInfo;
use zenoh::session::EntityGlobalId;

/// Angular velocity that no real measurement has, rad/s.
const FORGED: f64 = 1234.5;

fn status(client: &Client) -> v1::Status {
    client.request(&v1::StatusRequest {}).expect("a status")
}

fn start(client: &Client, label: &str) -> v1::EpisodeStarted {
    wait_until("the recorder is connected", || {
        !status(client).recorders.is_empty()
    });
    let request = v1::EpisodeStartRequest {
        label: label.into(),
        require_recorders: 1,
        ..Default::default()
    };
    let started = client.request(&request).expect("an episode");
    wait_until("the episode runs", || status(client).waiting_for.is_empty());
    started
}

fn stop(client: &Client) -> v1::EpisodeStopped {
    let request = v1::EpisodeStopRequest::default();
    client.request(&request).expect("its end")
}

/// Waits for `seconds` of simulation time.
fn pass(client: &Client, seconds: f64) {
    let tick = || status(client).header.unwrap_or_default().tick;
    let until = tick() + (seconds * 240.0) as u64;
    wait_until("simulated time passes", || tick() >= until);
}

/// A server behind a router, with a client and a hostile peer.
struct Scene {
    server: Server,
    client: Client,
    stranger: Stranger,
    router: Router,
    folder: tempfile::TempDir,
}

impl Scene {
    fn new(sim: &str) -> Self {
        let router = Router::start();
        let args = ["--no-cameras", "--connect", &router.endpoint];
        let server = Server::start(sim, &args).expect("a server");
        let open = || Client::open(&server.connect_through(&router.endpoint)).expect("a client");
        Self {
            client: open(),
            stranger: Stranger { client: open() },
            folder: tempfile::tempdir().expect("a folder"),
            router,
            server,
        }
    }

    fn recorder(&self, episodes: &str) -> Recorder {
        let (endpoint, out) = (&self.router.endpoint, self.folder.path());
        Recorder::start_through(endpoint, &self.server, out, &["--episodes", episodes])
    }
}

/// A peer that is connected without a role in the episode.
struct Stranger {
    client: Client,
}

impl Stranger {
    /// Receives a sample of a stream; with the publisher's ID and the source sequence number.
    fn listen<M: Message + Default>(&self, key: &str) -> (M, EntityGlobalId, u32) {
        let subscriber = self.client.session().declare_subscriber(key).wait();
        let subscriber = subscriber.expect("a subscription");
        loop {
            let sample = subscriber.recv_timeout(PATIENCE).expect("a session");
            let sample = sample.expect("a sample");
            let message = M::decode(&*sample.payload().to_bytes()).expect("a message");
            if let Some(source) = sample.source_info() {
                return (message, *source.source_id(), source.source_sn());
            }
        }
    }

    /// Publishes under the server's key, with a copied ID and source sequence number if any.
    fn put(&self, key: &str, message: &impl Message, source: Option<SourceInfo>) {
        let put = self.client.session().put(key, message.encode_to_vec());
        put.source_info(source).wait().expect("a put");
    }

    /// Publishes `count` forged measurements with future stamps; with `copied` they have the ID
    /// of the real publisher.
    fn forge_measurements(&self, count: u64, copied: bool) {
        let key = self.client.keys().topic(TopicId::Imu);
        let (real, id, number): (v1::Imu, _, _) = self.listen(&key);
        let header = real.header.clone().unwrap_or_default();
        for i in 0..count {
            let ahead = 60 + i;
            let forged = v1::Imu {
                header: Some(v1::Header {
                    sequence: header.sequence + ahead,
                    tick: header.tick + ahead,
                    stamp_nanos: wheelarm_proto::stamp_nanos(header.tick + ahead),
                    ..header.clone()
                }),
                angular_velocity: Some(v1::Vector3 {
                    x: FORGED,
                    y: 0.0,
                    z: 0.0,
                }),
                ..real.clone()
            };
            let source = copied.then(|| SourceInfo::new(id, number + ahead as u32));
            self.put(&key, &forged, source);
        }
    }
}

fn forged_rows(file: &Path) -> usize {
    let episode = Episode::open(file).expect("a file");
    let columns = episode.columns("imu").expect("its columns");
    let gyroscope = columns
        .iter()
        .find(|c| c.name.ends_with("angular_velocity"));
    let Values::F64(all) = episode
        .values(gyroscope.expect("a column"))
        .expect("values")
    else {
        panic!("not a column of numbers");
    };
    all.chunks(3).filter(|v| v[0] == FORGED).count()
}

#[test]
fn forged_samples_never_enter_a_recording() {
    let scene = Scene::new("strange");
    let (client, stranger, folder) = (&scene.client, &scene.stranger, &scene.folder);
    let recorder = scene.recorder("1");
    let started = start(client, "true");
    pass(client, 0.3);
    stranger.forge_measurements(100, false);
    let event = v1::Event {
        header: Some(v1::Header {
            sequence: 0,
            ..started.header.clone().unwrap_or_default()
        }),
        kind: v1::EventKind::Control.into(),
        text: "forged".into(),
        ..v1::Event::default()
    };
    stranger.put(&client.keys().topic(TopicId::Event), &event, None);
    pass(client, 1.0);
    stop(client);
    let text = recorder.finish();
    let file = folder.path().join("true.h5");
    println!("{text}\n{} forged rows", forged_rows(&file));
    assert!(text.contains("true.h5: complete"), "{text}");
    assert_eq!(forged_rows(&file), 0);
}

#[test]
fn forged_samples_with_a_copied_id_are_detected_and_reported() {
    let scene = Scene::new("copied");
    let (client, stranger, folder) = (&scene.client, &scene.stranger, &scene.folder);
    let mut recorder = scene.recorder("1");
    start(client, "copied");
    pass(client, 0.3);
    stranger.forge_measurements(100, true);
    pass(client, 1.5);
    stop(client);
    let (status, text) = recorder.end();
    let rows = forged_rows(&folder.path().join("copied.h5"));
    println!("{text}\n{rows} forged rows");
    assert!(rows > 0, "the attack does not work any more");
    assert_eq!(status.code(), Some(3), "{text}");
    assert!(text.contains("copied.h5: PARTIAL"), "{text}");
    let named = text
        .lines()
        .any(|l| l.contains("imu: ") && l.contains("another publisher"));
    assert!(named, "{text}");
}

#[test]
fn forged_starts_and_stops_neither_block_nor_end_nor_discard_a_recording() {
    let scene = Scene::new("protocol");
    let (client, stranger, folder) = (&scene.client, &scene.stranger, &scene.folder);
    let (starts, stops) = (
        client.keys().topic(TopicId::EpisodeStart),
        client.keys().topic(TopicId::EpisodeStop),
    );
    let recorder = scene.recorder("2");
    // The server's ID is public.
    let (_, id, _): (v1::Clock, _, _) = stranger.listen(&client.keys().topic(TopicId::Clock));
    // The peer also replies to the recorder's queries, as a complete queryable.
    let forged_reply = v1::EpisodeStopped::default().encode_to_vec();
    let _queries = stranger
        .client
        .session()
        .declare_queryable(format!("wheelarm/{}/query/*", scene.server.sim))
        .complete(true)
        .callback(move |query| {
            let reply = query.reply(query.key_expr().clone(), forged_reply.clone());
            let _ = reply.wait();
        })
        .wait()
        .expect("a queryable");

    let mut number = 0;
    for (label, copied) in [("first", false), ("second", true)] {
        let started = start(client, label);
        pass(client, 0.3);
        let mut source = || {
            number += 1;
            // Sequence numbers that the transport has not received from this ID.
            copied.then(|| SourceInfo::new(id, 100 + number))
        };
        let header = started.header.clone().unwrap_or_default();
        let end = |discard, success| v1::EpisodeStopped {
            header: Some(header.clone()),
            discard,
            evaluation: Some(v1::Evaluation {
                success,
                ..Default::default()
            }),
            ..Default::default()
        };
        let far = v1::EpisodeStarted {
            header: Some(v1::Header {
                episode: 1_000_000,
                ..header.clone()
            }),
            label: "far".into(),
            ..started.clone()
        };
        stranger.put(&starts, &far, source());
        stranger.put(&stops, &end(false, true), source());
        stranger.put(&stops, &end(true, false), source());
        pass(client, 0.7);
        let stopped = stop(client);
        let samples: u64 = stopped.manifest.iter().map(|c| c.count).sum();
        let file = folder.path().join(format!("{label}.h5"));
        let summary = || Episode::open(&file).and_then(|e| e.summary());
        wait_until("the file is complete", || summary().is_ok());
        let summary = summary().expect("a summary");
        assert!(summary.complete, "{:?}", summary.problems);
        assert!(!summary.success, "a forged success was recorded");
        let got: u64 = summary.streams.iter().map(|s| s.received).sum();
        assert_eq!(got, samples, "{label}");
    }
    let text = recorder.finish();
    assert_eq!(text.matches(": complete").count(), 2, "{text}");
}

#[test]
fn server_drops_samples_and_replies_of_others_under_its_keys() {
    let server = Server::start("closed", &["--no-cameras"]).expect("a server");
    let (client, stranger) = (server.client(), server.client());
    let keys = client.keys();
    // All samples that an honest client receives, from any sender.
    let samples = client
        .session()
        .declare_subscriber(format!("wheelarm/{}/**", server.sim))
        .with(zenoh::handlers::FifoChannel::new(1 << 16))
        .wait()
        .expect("a subscription");
    // A peer with a forged server token does not confuse clients that connect to the server.
    let token = stranger.session().liveliness();
    let _token = token
        .declare_token(keys.alive("666"))
        .wait()
        .expect("a token");
    let late = server.client();
    wait_until("both tokens are received", || {
        late.server().tokens().len() == 2
    });
    assert_eq!(status(&late).version, status(&client).version);
    let queryable = stranger
        .session()
        .declare_queryable(keys.query(Query::Status))
        .callback(|query| {
            let _ = query.reply(query.key_expr().clone(), b"forged").wait();
        });
    let _queryable = queryable.wait().expect("a queryable");
    for key in keys.own() {
        let key = key.replace("**", "forged");
        let put = stranger.session().put(&key, b"forged".as_slice());
        put.wait().expect("a put");
    }
    // The last sample has an allowed key: it arrives after all forbidden ones.
    let last = keys.recorder("stranger");
    let put = stranger.session().put(&last, b"forged".as_slice());
    put.wait().expect("a put");
    let mut forged = Vec::new();
    while forged.last() != Some(&last) {
        let sample = samples.recv_timeout(PATIENCE).expect("a session");
        let sample = sample.expect("a sample");
        if &*sample.payload().to_bytes() == b"forged" {
            forged.push(sample.key_expr().as_str().to_owned());
        }
    }
    assert_eq!(forged, [last]);
    let answers = client.session().get(keys.query(Query::Status));
    let answers = answers.target(zenoh::query::QueryTarget::All);
    let answers = answers.consolidation(zenoh::query::ConsolidationMode::None);
    let answers: Vec<_> = answers.wait().expect("a query").into_iter().collect();
    assert_eq!(answers.len(), 1, "{answers:?}");
}
