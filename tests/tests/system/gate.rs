//! Invalid messages of clients cannot harm a server: it refuses them with a reason, counts
//! them, and the simulation continues.

use std::time::Duration;

use wheelarm_proto::Query;
use wheelarm_proto::keys::Keys;
use wheelarm_proto::schema;
use wheelarm_proto::v1::RefusalCode;
use wheelarm_proto::{Message, TopicId, v1};
use wheelarm_tests::{Server, printed};
use zenoh::{Session, Wait};

const WAIT: Duration = Duration::from_secs(20);

fn session(server: &Server) -> Session {
    let mut config = zenoh::Config::default();
    for (key, value) in [
        ("mode", "\"client\"".to_owned()),
        ("scouting/multicast/enabled", "false".to_owned()),
        ("connect/endpoints", format!("[\"{}\"]", server.endpoint)),
    ] {
        config.insert_json5(key, &value).expect("a valid setting");
    }
    zenoh::open(config)
        .wait()
        .expect("a session with the server")
}

fn query_reply<R: Message + Default>(
    session: &Session,
    keys: &Keys,
    query: Query,
    payload: Vec<u8>,
) -> Result<R, String> {
    // The key of a lease request names the commander.
    let key = keys.query(query).replace('*', "tester");
    let replies = session
        .get(key)
        .payload(payload)
        .encoding(schema::encoding(query.messages()[0]))
        .timeout(WAIT)
        .wait()
        .expect("a query");
    let reply = replies.recv().expect("an answer");
    match reply.result() {
        Ok(sample) => Ok(R::decode(&*sample.payload().to_bytes()).expect("a readable answer")),
        Err(error) => {
            let failure = v1::Failure::decode(&*error.payload().to_bytes());
            Err(failure.expect("a Failure").message)
        }
    }
}

/// Publishes a command with the schema of this version.
fn put(session: &Session, key: &str, bytes: Vec<u8>) {
    let put = session.put(key, bytes);
    let put = put.encoding(schema::encoding("wheelarm.v1.Command"));
    put.wait().expect("a put");
}

/// Puts `tester` in control; control lasts as long as the token.
fn take_control(session: &Session, keys: &Keys) -> zenoh::liveliness::LivelinessToken {
    let token = session
        .liveliness()
        .declare_token(keys.commander_alive("tester", "test"))
        .wait()
        .expect("a token");
    let request = v1::LeaseRequest {
        header: drive(0, 0.0, 0).header,
        commander: "tester".into(),
        ..Default::default()
    };
    for _ in 0..200 {
        let reply: v1::LeaseReply =
            query_reply(session, keys, Query::Lease, request.encode_to_vec()).expect("control");
        if reply.holder == "tester" {
            return token;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    panic!("the server did not receive the commander's token");
}

/// A command that answers the state of `tick`.
fn drive(sequence: u64, linear: f64, tick: u64) -> v1::Command {
    v1::Command {
        header: Some(v1::Header {
            sequence,
            run_id: "test".into(),
            ..Default::default()
        }),
        commander: "tester".into(),
        answers_tick: Some(tick),
        base: Some(v1::BaseCommand {
            linear,
            angular: 0.0,
        }),
        ..Default::default()
    }
}

#[test]
fn hostile_messages_are_refused_and_counted() {
    let mut server = Server::start("gate", &["--no-cameras"]).expect("a server");
    let session = session(&server);
    let keys = Keys::new("gate").expect("a name");
    let refusals = session
        .declare_subscriber(keys.topic(TopicId::Refusal))
        .wait()
        .expect("a subscriber");
    let _control = take_control(&session, &keys);
    let send = |bytes: Vec<u8>| put(&session, &keys.command("tester"), bytes);
    let status =
        || query_reply::<v1::Status>(&session, &keys, Query::Status, vec![]).expect("a status");
    let newest = || status().header.expect("a header").tick;
    // Far enough from the start that tick 0 is too old.
    while newest() < 60 {
        std::thread::sleep(Duration::from_millis(20));
    }
    send(drive(1, 0.2, newest()).encode_to_vec());
    let tick = newest();
    let hostile = [
        (
            vec![0xff; 64],
            "not a wheelarm.v1.Command",
            RefusalCode::Invalid,
        ),
        (vec![0; 1 << 20], "at most", RefusalCode::TooLong),
        (
            v1::Command {
                answers_tick: None,
                ..drive(2, 0.2, 0)
            }
            .encode_to_vec(),
            "answers_tick is missing",
            RefusalCode::NoTick,
        ),
        (
            drive(2, f64::NAN, tick).encode_to_vec(),
            "finite",
            RefusalCode::Invalid,
        ),
        (
            drive(2, f64::INFINITY, tick).encode_to_vec(),
            "finite",
            RefusalCode::Invalid,
        ),
        (
            drive(2, 1e300, tick).encode_to_vec(),
            "expected",
            RefusalCode::Invalid,
        ),
        (
            drive(1, 0.2, tick).encode_to_vec(),
            "sequence",
            RefusalCode::Sequence,
        ),
        (
            {
                let mut wrong = drive(9, 0.2, tick);
                wrong.header.as_mut().expect("a header").episode = 77;
                wrong.encode_to_vec()
            },
            "episode",
            RefusalCode::Episode,
        ),
    ];
    for (bytes, reason, code) in &hostile {
        send(bytes.clone());
        let sample = refusals
            .recv_timeout(WAIT)
            .expect("no error")
            .expect("a refusal");
        let refusal = v1::Refusal::decode(&*sample.payload().to_bytes()).expect("a Refusal");
        assert!(
            refusal.reason.contains(reason),
            "{:?} lacks {reason:?}",
            refusal.reason
        );
        assert_eq!(refusal.code(), *code, "{}", refusal.reason);
    }
    assert_eq!(status().refused, hostile.len() as u64);
    // Under the key of another commander, and from a program of another version.
    let honest = drive(20, 0.2, newest()).encode_to_vec();
    let refusal_of = |key: &str, encoding: &str| {
        let put = session.put(key, honest.clone()).encoding(encoding);
        put.wait().expect("a put");
        let sample = refusals.recv_timeout(WAIT).expect("no error");
        let bytes = sample.expect("a refusal").payload().to_bytes().into_owned();
        v1::Refusal::decode(bytes.as_slice()).expect("a Refusal")
    };
    let own = schema::encoding("wheelarm.v1.Command");
    let foreign = refusal_of(&keys.command("other"), &own);
    assert_eq!(foreign.code(), RefusalCode::Foreign, "{}", foreign.reason);
    let old = refusal_of(&keys.command("tester"), "zenoh/bytes");
    assert_eq!(old.code(), RefusalCode::Version, "{}", old.reason);
    assert!(old.reason.contains("one build"), "{}", old.reason);
    assert!(server.alive());
}

#[test]
fn requests_of_another_version_or_commander_are_refused_with_a_fix() {
    let server = Server::start("versions", &["--no-cameras"]).expect("a server");
    let session = session(&server);
    let keys = Keys::new("versions").expect("a name");
    let send = |key: String, payload: Vec<u8>, encoding: &str| {
        let get = session.get(key).payload(payload).encoding(encoding);
        let replies = get.timeout(WAIT).wait().expect("a query");
        let reply = replies.recv().expect("an answer");
        let error = reply.result().expect_err("a refusal");
        v1::Failure::decode(&*error.payload().to_bytes()).expect("a Failure")
    };
    let old = send(keys.query(Query::Status), Vec::new(), "zenoh/bytes");
    assert_eq!(old.code(), v1::FailureCode::Version, "{}", old.message);
    assert!(old.message.contains("one build"), "{}", old.message);
    let newer = "application/protobuf;wheelarm.v1.StatusRequest@99";
    let newer = send(keys.query(Query::Status), Vec::new(), newer);
    assert!(newer.message.contains("version 99"), "{}", newer.message);
    let request = v1::LeaseRequest {
        commander: "anna".into(),
        ..Default::default()
    };
    let key = keys.query(Query::Lease).replace('*', "ben");
    let own = schema::encoding("wheelarm.v1.LeaseRequest");
    let foreign = send(key, request.encode_to_vec(), &own);
    assert_eq!(
        foreign.code(),
        v1::FailureCode::Foreign,
        "{}",
        foreign.message
    );
}

/// Whether the request of a query has fields. Names every query: a new one does not compile
/// until this test knows it.
fn reads_a_request(query: Query) -> bool {
    match query {
        Query::Lease
        | Query::Reach
        | Query::Map
        | Query::Pick
        | Query::Reset
        | Query::Playback
        | Query::EpisodeStart
        | Query::EpisodeStop
        | Query::Episode
        | Query::PackPut
        | Query::Shutdown => true,
        Query::Status
        | Query::Scene
        | Query::Tasks
        | Query::Pause
        | Query::Resume
        | Query::Snapshot
        | Query::Packs
        | Query::Sensors => false,
    }
}

#[test]
fn undecodable_and_invalid_queries_are_rejected_with_a_reason() {
    let mut server = Server::start("rubbish", &["--no-cameras"]).expect("a server");
    let session = session(&server);
    let keys = Keys::new("rubbish").expect("a name");
    let rubbish = vec![0xff; 32];
    for query in Query::ALL
        .into_iter()
        .filter(|query| reads_a_request(*query))
    {
        let answer: Result<v1::Ack, String> = query_reply(&session, &keys, query, rubbish.clone());
        assert!(answer.expect_err("a failure").contains("cannot decode"));
    }
    let reset = |scenario: v1::Scenario| {
        let request = v1::ResetRequest {
            scenario: Some(scenario),
            ..Default::default()
        };
        let answer: Result<v1::ResetReply, String> =
            query_reply(&session, &keys, Query::Reset, request.encode_to_vec());
        answer
    };
    let unknown = reset(v1::Scenario {
        task: Some("fly_to_mars".into()),
        ..Default::default()
    });
    let text = unknown.expect_err("a failure");
    assert!(
        text.contains("fly_to_mars") && text.contains("pick_mustard"),
        "{text}"
    );
    let outside = reset(v1::Scenario {
        scene: "../../etc".into(),
        ..Default::default()
    });
    assert!(outside.expect_err("a failure").contains("scene"));
    let damaged = v1::ResetRequest {
        snapshot: vec![7; 100].into(),
        ..Default::default()
    };
    let answer: Result<v1::ResetReply, String> =
        query_reply(&session, &keys, Query::Reset, damaged.encode_to_vec());
    assert!(answer.expect_err("a failure").contains("stored state"));
    assert!(server.alive());
    let start = v1::EpisodeStartRequest {
        label: "../x".into(),
        ..Default::default()
    };
    let answer: Result<v1::EpisodeStarted, String> =
        query_reply(&session, &keys, Query::EpisodeStart, start.encode_to_vec());
    assert!(answer.expect_err("a failure").contains("label"));
}

#[test]
fn chair_of_a_silent_operator_brakes_to_rest() {
    let server = Server::start("silent", &["--no-cameras"]).expect("a server");
    let session = session(&server);
    let keys = Keys::new("silent").expect("a name");
    let _control = take_control(&session, &keys);
    let odometry = session
        .declare_subscriber(keys.topic(TopicId::Odometry))
        .wait()
        .expect("a stream");
    let put = |command: v1::Command| {
        let key = keys.command("tester");
        self::put(&session, &key, command.encode_to_vec());
    };
    let speed = || {
        let sample = odometry
            .recv_timeout(WAIT)
            .expect("no error")
            .expect("odometry");
        let sample = v1::Odometry::decode(&*sample.payload().to_bytes()).expect("Odometry");
        let header = sample.header.expect("a header");
        (
            header,
            sample.twist.expect("a twist").linear.expect("linear").x,
        )
    };
    let mut sequence = 0;
    let mut fastest = 0.0_f64;
    while fastest < 0.25 {
        sequence += 1;
        assert!(sequence < 2000, "the chair does not drive: {fastest} m/s");
        let (header, now) = speed();
        fastest = now;
        put(drive(sequence, 0.3, header.tick));
    }
    let last_command = speed().0.stamp_nanos;
    let mut at_rest = None;
    for _ in 0..600 {
        let (header, speed) = speed();
        if speed.abs() < 0.005 && at_rest.is_none() {
            at_rest = Some(header.stamp_nanos);
        }
    }
    let at_rest = at_rest.expect("the chair comes to rest");
    // Simulation time passes no faster than wall time, so this bound holds on any machine: 0.7 s
    // and some control ticks.
    let seconds = (at_rest - last_command) as f64 * 1e-9;
    assert!(
        seconds <= 0.8,
        "at rest {seconds:.3} s after the last command"
    );
}

#[test]
fn second_server_with_the_same_name_is_rejected() {
    let server = Server::start("twin", &["--no-cameras"]).expect("a server");
    let error = Server::start("twin", &["--no-cameras", "--connect", &server.endpoint])
        .expect_err("a refusal");
    assert!(error.to_string().contains("already"), "{error}");
    let status = server.run_client(&["status"]).expect("a client");
    assert!(status.status.success(), "{}", printed(&status));
}

#[test]
fn server_without_a_vulkan_driver_names_the_fix() {
    let program = wheelarm_tests::program("wheelarm-server").expect("the server");
    let output = std::process::Command::new(program)
        .args(["--listen", "tcp/127.0.0.1:0", "--sim", "nodriver"])
        .arg("--assets")
        .arg(wheelarm_tests::root().join("assets"))
        .env("VK_DRIVER_FILES", "nowhere.json")
        .env("VK_ICD_FILENAMES", "nowhere.json")
        .output()
        .expect("a process");
    let text = printed(&output);
    assert!(!output.status.success());
    assert!(
        text.contains("mesa-vulkan-drivers") && text.contains("--no-cameras"),
        "{text}"
    );
}
