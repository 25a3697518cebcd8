//! The client against a peer that listens, as a server does.

use super::*;
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{Query, TopicId};
use zenoh::sample::SourceInfo;
use zenoh::session::EntityGlobalId;

/// A free loopback endpoint.
fn free_endpoint() -> String {
    let port = std::net::TcpListener::bind("127.0.0.1:0")
        .and_then(|listener| listener.local_addr())
        .map(|address| address.port())
        .unwrap();
    format!("tcp/127.0.0.1:{port}")
}

fn args(endpoint: &str, sim: &str) -> Connect {
    Connect {
        endpoint: endpoint.to_owned(),
        sim: sim.to_owned(),
        timeout_secs: 2.0,
        identity: None,
    }
}

/// A peer that listens, as a server does.
fn listen(endpoint: &str) -> Session {
    let mut config = Config::default();
    for (key, value) in [
        ("mode", "\"peer\"".to_owned()),
        ("listen/endpoints", format!("[\"{endpoint}\"]")),
        ("scouting/multicast/enabled", "false".to_owned()),
    ] {
        config.insert_json5(key, &value).unwrap();
    }
    zenoh::open(config).wait().unwrap()
}

#[test]
fn endpoint_with_keys_is_not_connected_to_without_keys() {
    let error = Client::open(&args("tls/127.0.0.1:1", "sim")).err().unwrap();
    assert!(matches!(error, ClientError::NoKeys(_)), "{error}");
    assert!(error.to_string().contains("--keys DIR"), "{error}");
}

#[test]
fn error_without_a_server_names_the_fix() {
    let mut args = args(&free_endpoint(), "sim");
    args.timeout_secs = 0.3;
    let error = Client::open(&args).err().unwrap().to_string();
    assert!(error.contains("wheelarm-server"), "{error}");
    assert!(error.contains(&args.endpoint), "{error}");
}

#[test]
fn query_without_a_reply_reports_how_it_ended() {
    let endpoint = free_endpoint();
    let server = listen(&endpoint);
    let keys = Keys::new("a").unwrap();
    let token = server
        .liveliness()
        .declare_token(keys.alive(&server.zid().to_string()))
        .wait()
        .unwrap();
    // The scene query is kept without a reply; the others end at once.
    let kept = Mutex::new(Vec::new());
    let kept_key = keys.query(Query::Scene);
    let _queries = server
        .declare_queryable(format!("{}/a/query/*", keys::PREFIX))
        .callback(move |query| {
            if query.key_expr().as_str() == kept_key {
                kept.lock().push(query);
            }
        })
        .wait()
        .unwrap();
    let client = Client::open(&args(&endpoint, "a")).unwrap();
    let short = Duration::from_millis(300);
    let kept = client.request_within(&v1::SceneRequest {}, short);
    let kept = kept.unwrap_err();
    assert!(matches!(kept, ClientError::Silent { .. }), "{kept}");
    assert!(kept.to_string().contains("within 0.3 s"), "{kept}");
    let ended = client.request(&v1::StatusRequest {}).unwrap_err();
    assert!(matches!(ended, ClientError::Unanswered { .. }), "{ended}");
    assert!(ended.to_string().contains("try again"), "{ended}");
    drop(token);
    let gone = client.request(&v1::StatusRequest {}).unwrap_err();
    assert!(matches!(gone, ClientError::Gone { .. }), "{gone}");
}

#[test]
fn query_waits_for_a_server_that_reconnects() {
    let endpoint = free_endpoint();
    let server = listen(&endpoint);
    let keys = Keys::new("a").unwrap();
    let serve = || {
        let token = server
            .liveliness()
            .declare_token(keys.alive(&server.zid().to_string()));
        let queries = server
            .declare_queryable(format!("{}/a/query/*", keys::PREFIX))
            .callback(|query| {
                query
                    .reply(
                        query.key_expr().clone(),
                        v1::Status::default().encode_to_vec(),
                    )
                    .encoding(encoding_of("Status"))
                    .wait()
                    .unwrap();
            });
        (queries.wait().unwrap(), token.wait().unwrap())
    };
    let before = serve();
    let client = Client::open(&args(&endpoint, "a")).unwrap();
    drop(before);
    let since = Instant::now();
    while client.server().is_there() {
        assert!(since.elapsed() < Duration::from_secs(60), "its token stays");
        std::thread::sleep(Duration::from_millis(1));
    }
    std::thread::scope(|scope| {
        let again = scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(50));
            serve()
        });
        let status = client.request(&v1::StatusRequest {});
        assert!(status.is_ok(), "{status:?}");
        drop(again.join().unwrap());
    });
}

#[test]
fn replies_failures_names_and_sample_order_arrive() {
    let endpoint = free_endpoint();
    let server = listen(&endpoint);
    let keys = Keys::new("a").unwrap();
    let _token = server
        .liveliness()
        .declare_token(keys.alive(&server.zid().to_string()))
        .wait()
        .unwrap();
    let pause_key = keys.query(Query::Pause);
    let _queries = server
        .declare_queryable(format!("{}/a/query/**", keys::PREFIX))
        .callback(move |query| {
            if query.key_expr().as_str() == pause_key {
                let failure = v1::Failure {
                    header: None,
                    message: "no episode runs".to_owned(),
                    code: v1::FailureCode::NoEpisode.into(),
                };
                let failure = query.reply_err(failure.encode_to_vec());
                failure.encoding(encoding_of("Failure")).wait().unwrap();
            } else if Keys::query_of(query.key_expr().as_str()) == Some(Query::Lease) {
                let payload = query.payload().unwrap();
                let request: v1::LeaseRequest = decode(payload, "lease").unwrap();
                let reply = v1::LeaseReply {
                    holder: request.commander,
                    ..Default::default()
                };
                query
                    .reply(query.key_expr().clone(), reply.encode_to_vec())
                    .encoding(encoding_of("LeaseReply"))
                    .wait()
                    .unwrap();
            } else {
                let status = v1::Status {
                    version: "7".to_owned(),
                    ..Default::default()
                };
                query
                    .reply(query.key_expr().clone(), status.encode_to_vec())
                    .encoding(encoding_of("Status"))
                    .wait()
                    .unwrap();
            }
        })
        .wait()
        .unwrap();

    // The server sends one joint state and a clock for each command, in this order.
    let answer = server.clone();
    let source = SourceInfo::new(EntityGlobalId::new(server.zid(), 1), 0);
    let tick_of = |header: Option<v1::Header>| {
        let clock = v1::Clock {
            header,
            ..Default::default()
        };
        clock.encode_to_vec()
    };
    let (joints, clock) = (keys.topic(TopicId::JointState), keys.topic(TopicId::Clock));
    let _commands = server
        .declare_subscriber(keys.command("*"))
        .callback(move |sample| {
            let command: v1::Command = decode(sample.payload(), "command").unwrap();
            let header = command.header;
            let state = v1::JointState {
                header: header.clone(),
                ..Default::default()
            };
            // A forged clock, which the client must drop.
            answer.put(&clock, tick_of(None)).wait().unwrap();
            let put = answer.put(&joints, state.encode_to_vec());
            put.source_info(source.clone()).wait().unwrap();
            let put = answer.put(&clock, tick_of(header));
            put.source_info(source.clone()).wait().unwrap();
        })
        .wait()
        .unwrap();

    let other = Client::open(&args(&endpoint, "b"))
        .err()
        .unwrap()
        .to_string();
    assert!(other.contains("found: a"), "{other}");

    let client = Client::open(&args(&endpoint, "a")).unwrap();
    let status: v1::Status = client.request(&v1::StatusRequest {}).unwrap();
    assert_eq!(status.version, "7");
    let refused = client
        .request(&v1::PauseRequest {})
        .err()
        .unwrap()
        .to_string();
    assert!(refused.contains("no episode runs"), "{refused}");

    // A foreign session that replies at once and claims to be complete.
    let foreign = open_session(&args(&endpoint, "a"), Silence::Gone).unwrap();
    let _forged = foreign
        .declare_queryable(keys.query(Query::Status))
        .complete(true)
        .callback(|query| {
            let forged = v1::Status {
                version: "forged".to_owned(),
                ..Default::default()
            };
            let answer = query
                .reply(query.key_expr().clone(), forged.encode_to_vec())
                .encoding(encoding_of("Status"));
            answer.wait().unwrap();
        })
        .wait()
        .unwrap();
    for _ in 0..20 {
        let status: v1::Status = client.request(&v1::StatusRequest {}).unwrap();
        assert_eq!(status.version, "7");
    }

    let streams = client
        .streams(&[TopicId::JointState, TopicId::Clock])
        .unwrap();
    let mut commander = client.commander("test", false).unwrap();
    for sequence in 0..50 {
        commander
            .answer(&v1::Header::default(), v1::Command::default())
            .unwrap();
        for _ in 0..2 {
            let got = streams.next(Duration::from_secs(5)).unwrap();
            assert!(got.is_some(), "no sample for command {sequence}");
        }
    }
    commander
        .answer(&v1::Header::default(), v1::Command::default())
        .unwrap();
    let first = streams.next(Duration::from_secs(5)).unwrap();
    let second = streams.next(Duration::from_secs(5)).unwrap();
    let Some(Sample::JointState(state)) = first else {
        panic!("expected the joint state first, got {first:?}");
    };
    assert_eq!(state.header.unwrap().sequence, 50);
    assert!(matches!(second, Some(Sample::Clock(_))), "{second:?}");
}

/// Encoding of a message of this version.
fn encoding_of(message: &str) -> String {
    wheelarm_proto::schema::encoding(&format!("wheelarm.v1.{message}"))
}

#[test]
fn server_of_another_version_is_rejected_at_connection_with_the_fix() {
    for (encoding, version) in [
        // Version 1 sends no version.
        ("zenoh/bytes", "version 1"),
        ("application/protobuf;wheelarm.v1.Status@99", "version 99"),
    ] {
        let endpoint = free_endpoint();
        let server = listen(&endpoint);
        let keys = Keys::new("old").unwrap();
        let _token = server
            .liveliness()
            .declare_token(keys.alive(&server.zid().to_string()))
            .wait()
            .unwrap();
        let status = keys.query(Query::Status);
        let _queries = server
            .declare_queryable(&status)
            .callback(move |query| {
                let reply = v1::Status::default().encode_to_vec();
                let reply = query.reply(query.key_expr().clone(), reply);
                reply.encoding(encoding).wait().unwrap();
            })
            .wait()
            .unwrap();
        let args = Connect {
            endpoint,
            sim: "old".to_owned(),
            timeout_secs: 10.0,
            identity: None,
        };
        let error = Client::open(&args).err().unwrap();
        assert!(matches!(error, ClientError::Version(_)), "{error}");
        let words = error.to_string();
        assert!(
            words.contains(version) && words.contains("one build"),
            "{words}"
        );
    }
}
