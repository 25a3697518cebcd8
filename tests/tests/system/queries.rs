//! Queries never stop the physics: unread replies, floods, large requests, absurd scenarios and
//! long operations.

use std::io::{Read, Write};
use std::process::{Command, Stdio};
use std::sync::mpsc;
use std::time::Duration;

use wheelarm_proto::Query;
use wheelarm_proto::robot::Roles;
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{Message, TopicId, v1};
use wheelarm_sdk::{Client, Streams};
use wheelarm_tests::{Line, PATIENCE, Proxy, Server, program, root, wait_until};
use zenoh::Wait;
use zenoh::sample::{SampleKind, SourceInfo};
use zenoh::session::EntityGlobalId;

/// Sends a query and returns at once. `on_reply` receives each reply: the payload, or the
/// message of a failure.
fn send(
    client: &Client,
    query: Query,
    payload: Vec<u8>,
    on_reply: impl Fn(Result<Vec<u8>, String>) + Send + Sync + 'static,
) {
    client
        .session()
        .get(client.keys().query(query).replace('*', "querier"))
        .payload(payload)
        .encoding(wheelarm_proto::schema::encoding(query.messages()[0]))
        .source_info(SourceInfo::new(client.session().id(), 0))
        .timeout(PATIENCE)
        .callback(move |reply| {
            on_reply(match reply.result() {
                Ok(sample) => Ok(sample.payload().to_bytes().into_owned()),
                Err(error) => Err(v1::Failure::decode(&*error.payload().to_bytes())
                    .map(|failure| failure.message)
                    .unwrap_or_default()),
            });
        })
        .wait()
        .expect("a query");
}

/// The reply to a query: its payload, or the message of a failure.
fn query_reply(client: &Client, query: Query, payload: Vec<u8>) -> Result<Vec<u8>, String> {
    let (sender, reply) = mpsc::channel();
    send(client, query, payload, move |reply| {
        let _ = sender.send(reply);
    });
    reply.recv_timeout(PATIENCE).expect("a reply")
}

fn start(client: &Client, label: &str) -> v1::EpisodeStarted {
    let request = v1::EpisodeStartRequest {
        label: label.into(),
        ..Default::default()
    };
    client.request(&request).expect("an episode")
}

#[test]
fn unread_replies_to_one_peer_with_many_names_do_not_stop_time() {
    check_unread_replies("names", |deaf, i| {
        let id = format!("{:x}", 0xabc + i).parse().expect("an id");
        let source = SourceInfo::new(EntityGlobalId::new(id, 1), 0);
        deaf.session()
            .get(deaf.keys().query(Query::Snapshot))
            .encoding(wheelarm_proto::schema::encoding(
                Query::Snapshot.messages()[0],
            ))
            .source_info(source)
            .timeout(PATIENCE)
            .callback(|_| {})
            .wait()
            .expect("a query");
    });
}

#[test]
fn unread_replies_do_not_stop_time() {
    check_unread_replies("unread", |deaf, _| {
        send(deaf, Query::Snapshot, Vec::new(), |_| {});
    });
}

/// A server's simulation continues while a peer sends two hundred requests and reads no reply.
fn check_unread_replies(name: &str, request: impl Fn(&Client, u32)) {
    let server = Server::start(name, &["--no-cameras"]).expect("a server");
    let beside =
        Server::start(&format!("{name}-beside"), &["--no-cameras"]).expect("another server");
    let (client, other) = (server.client(), beside.client());
    start(&client, "unread");
    let proxy = Proxy::start(&server.endpoint, Duration::ZERO, 8e9).expect("a proxy");
    let deaf = Client::open(&server.connect_through(&proxy.endpoint())).expect("a client");
    let mut time = [Ticks::new(&client), Ticks::new(&other)];
    for time in &mut time {
        wait_until("time passes", || time.newest() > 0);
    }
    proxy.set(Line::Deaf);
    (0..200).for_each(|i| request(&deaf, i));
    let begun = time.each_mut().map(Ticks::newest);
    // Eight seconds of a second server on the same host, without an attack. The attacked server
    // drops the peer after five; other clients must continue to receive the clock.
    wait_until("time passes at the second server", || {
        time[1].newest() >= begun[1] + 1920
    });
    let [passed, beside] = [0, 1].map(|i| time[i].newest() - begun[i]);
    println!("{passed} ticks while 200 snapshots waited to be read, {beside} beside");
    assert!(4 * passed > 3 * beside, "{passed} ticks, {beside} beside");
}

#[test]
fn client_that_reads_no_replies_delays_only_itself() {
    let server = Server::start("deaf", &["--no-cameras"]).expect("a server");
    let (client, watcher) = (server.client(), server.client());
    start(&client, "deaf");
    let proxy = Proxy::start(&server.endpoint, Duration::ZERO, 8e9).expect("a proxy");
    let deaf = Client::open(&server.connect_through(&proxy.endpoint())).expect("a client");
    let life = deaf.session().liveliness();
    let _token = life.declare_token("test/deaf").wait().expect("a token");
    let (sender, changes) = mpsc::channel();
    let _life = watcher
        .session()
        .liveliness()
        .declare_subscriber("test/deaf")
        .history(true)
        .callback(move |sample| {
            let _ = sender.send(sample.kind());
        })
        .wait()
        .expect("a subscriber");
    let next = || {
        changes
            .recv_timeout(PATIENCE)
            .expect("a change of the token")
    };
    assert_eq!(next(), SampleKind::Put);
    let status = || client.request(&v1::StatusRequest {}).expect("an answer");
    let tick = |status: v1::Status| status.header.expect("a header").tick;
    proxy.set(Line::Deaf);
    for _ in 0..200 {
        send(&deaf, Query::Snapshot, Vec::new(), |_| {});
    }
    // A quarter of a second later the server sends these replies, until the transport drops the
    // peer.
    let mut time = Ticks::new(&watcher);
    wait_until("the clock arrives", || time.newest() > 0);
    let before = time.newest();
    wait_until("the replies are stalled", || time.newest() > before + 60);
    let begun = tick(status());
    (0..20).for_each(|_| drop(status()));
    let passed = tick(status()) - begun;
    assert_eq!(next(), SampleKind::Delete, "the replies were not stalled");
    let rest = tick(status()) - begun - passed;
    println!("20 replies within {passed} ticks; the deaf peer was dropped {rest} later");
    assert!(passed < rest, "{passed} ticks, and {rest} to the end");
}

/// The newest tick of a server.
struct Ticks {
    clocks: Streams,
    newest: u64,
}

impl Ticks {
    fn new(client: &Client) -> Self {
        Self {
            clocks: client.streams(&[TopicId::Clock]).expect("the clock"),
            newest: 0,
        }
    }

    fn newest(&mut self) -> u64 {
        while let Some(sample) = self.clocks.next(Duration::ZERO).expect("no error") {
            if let Sample::Clock(clock) = sample {
                self.newest = clock.header.expect("a header").tick;
            }
        }
        self.newest
    }
}

#[test]
fn every_query_of_a_flood_gets_a_reply_or_a_refusal() {
    let server = Server::start("curious", &["--no-cameras"]).expect("a server");
    let (client, crowd) = (server.client(), server.client());
    const FLOOD: usize = 3000;
    let (sender, replies) = mpsc::channel();
    for _ in 0..FLOOD {
        let sender = sender.clone();
        send(&crowd, Query::Status, Vec::new(), move |reply| {
            let _ = sender.send(reply.map(|_| ()));
        });
    }
    drop(sender);
    // Another client gets a reply too, after a retry at most.
    wait_until("another client gets a reply", || {
        client.request(&v1::StatusRequest {}).is_ok()
    });
    let (mut answered, mut refused) = (0, 0);
    // The channel closes after the last query, with or without a reply.
    while let Ok(reply) = replies.recv_timeout(PATIENCE) {
        match reply {
            Ok(()) => answered += 1,
            Err(why) => {
                assert!(why.contains("try again"), "{why}");
                refused += 1;
            }
        }
    }
    println!("{answered} answered, {refused} refused of {FLOOD}");
    assert!(answered > 0);
    assert_eq!(answered + refused, FLOOD, "some queries got no reply");
}

#[test]
fn task_list_is_read_once() {
    let assets = tempfile::tempdir().expect("a folder");
    let copied = Command::new("cp")
        .arg("-r")
        .arg(root().join("assets/."))
        .arg(assets.path())
        .status()
        .expect("cp");
    assert!(copied.success());
    let listen = "tcp/127.0.0.1:0";
    let server = Server::start_with(assets.path(), listen, "listed", &["--no-cameras"]);
    let server = server.expect("a server");
    let client = server.client();
    let list = || client.request(&v1::TasksRequest {}).expect("the tasks");
    let first = list().tasks;
    assert!(first.len() >= 13, "{} tasks", first.len());
    std::fs::remove_dir_all(assets.path().join("scenes")).expect("the scenes are removed");
    assert_eq!(list().tasks, first);
}

#[test]
fn oversized_requests_are_rejected_with_their_length() {
    let mut server = Server::start("large", &["--no-cameras"]).expect("a server");
    let client = server.client();
    for query in Query::ALL {
        let bytes = if query == Query::Reset {
            8 << 20
        } else {
            2 << 20
        };
        let error = query_reply(&client, query, vec![0x0a; bytes]).expect_err("a refusal");
        assert!(
            error.contains(&format!("{bytes} bytes, at most")),
            "{error}"
        );
    }
    assert!(server.alive());
}

#[test]
fn stop_of_an_ended_episode_never_ends_another() {
    let server = Server::start("own", &["--no-cameras"]).expect("a server");
    let client = server.client();
    let first = start(&client, "first");
    client.stop_episode_of(&first, false).expect("its end");
    let rejection = |reply: Result<v1::EpisodeStopped, wheelarm_sdk::ClientError>| {
        let error = reply.expect_err("a refusal").to_string();
        assert!(error.contains("is over"), "{error}");
        error
    };
    let error = rejection(client.stop_episode_of(&first, false));
    assert!(error.contains("no episode is running"), "{error}");
    let second = start(&client, "second");
    let error = rejection(client.stop_episode_of(&first, true));
    assert!(error.contains("is running"), "{error}");
    client.stop_episode_of(&second, false).expect("its own end");
}

/// The saved state of a paused simulation.
fn state(client: &Client) -> Vec<u8> {
    start(client, "look");
    let reply: v1::SnapshotReply = client.request(&v1::SnapshotRequest {}).expect("a snapshot");
    let request = v1::EpisodeStopRequest {
        discard: true,
        secret: client.secret(),
        ..Default::default()
    };
    let _: v1::EpisodeStopped = client.request(&request).expect("its end");
    reply.snapshot.to_vec()
}

#[test]
fn rejected_reset_names_the_fix_and_changes_no_state() {
    let args = [
        "--no-cameras",
        "--pacing",
        "lock-step",
        "--task",
        "place_teddy_bear",
    ];
    let mut server = Server::start("refusing", &args).expect("a server");
    let client = server.client();
    let _still = client.commander("still", false).expect("control");
    let before = state(&client);
    let status = || client.request(&v1::StatusRequest {}).expect("a status");
    let scenario = status().scenario.expect("a scenario");
    let at = |x: f64, z: f64| v1::Pose {
        position: Some(v1::Vector3 { x, y: 0.0, z }),
        orientation: Some(v1::Quaternion {
            w: 1.0,
            ..Default::default()
        }),
    };
    let changed = |change: &dyn Fn(&mut v1::Scenario)| {
        let mut changed = scenario.clone();
        change(&mut changed);
        changed
    };
    let bear = scenario
        .objects
        .iter()
        .position(|o| o.name.contains("teddy"));
    let bear = bear.expect("a bear");
    let absurd: [(v1::Scenario, &str); 14] = [
        (
            changed(&|s| s.start = Some(at(1e30, 0.0))),
            "start is 1e30, expected -50 to 50",
        ),
        (changed(&|s| s.start = Some(at(1e39, 0.0))), "start is 1e39"),
        (
            changed(&|s| s.start = Some(at(0.0, -3.0))),
            "expected -1 to 5",
        ),
        (
            changed(&|s| s.objects[0].pose = Some(at(1e300, 0.0))),
            "pose is 1e300",
        ),
        (
            changed(&|s| s.objects[bear].mass = Some(1e-4)),
            "which is soft",
        ),
        (
            changed(&|s| s.objects[bear].mass = Some(3.0)),
            "expected 0.05 to 2",
        ),
        (
            changed(&|s| s.objects[0].mass = Some(1e-300)),
            "mass is 1e-300",
        ),
        (changed(&|s| s.objects[0].mass = None), "mass is missing"),
        (
            changed(&|s| s.instruction = Some("x".repeat(100_000))),
            "instruction",
        ),
        (changed(&|s| s.instruction = Some("a\0b".into())), "NUL"),
        (changed(&|s| s.target = Some("x".repeat(100_000))), "target"),
        (
            changed(&|s| s.task = Some("x".repeat(100_000))),
            "task name",
        ),
        (
            changed(&|s| s.objects = vec![s.objects[0].clone(); 1000]),
            "objects: got 1000, at most",
        ),
        (changed(&|s| s.state_rate_hz = Some(1e-300)), "1e-300 Hz"),
    ];
    for (scenario, word) in absurd {
        let request = v1::ResetRequest {
            scenario: Some(scenario),
            secret: client.secret(),
            ..Default::default()
        };
        let error =
            query_reply(&client, Query::Reset, request.encode_to_vec()).expect_err("a refusal");
        assert!(error.contains(word), "{error:?} lacks {word:?}");
        assert!(error.len() < 600, "{} bytes of text", error.len());
    }
    assert!(server.alive());
    assert!(
        state(&client) == before,
        "a rejected reset changed the state"
    );
    assert_eq!(status().scenario, Some(scenario));
}

/// Order of the replies to two queries that are sent one directly after the other on one
/// connection.
fn reply_order(client: &Client, first: (Query, Vec<u8>), second: Query) -> Vec<Query> {
    let (sender, order) = mpsc::channel();
    for (query, payload) in [first, (second, Vec::new())] {
        let sender = sender.clone();
        send(client, query, payload, move |reply| {
            reply.expect("a reply");
            let _ = sender.send(query);
        });
    }
    (0..2)
        .map(|_| order.recv_timeout(PATIENCE).expect("a reply"))
        .collect()
}

#[test]
fn status_waits_neither_for_a_reset_nor_for_the_cameras() {
    // Far more images than the server can render: some always wait.
    let args = ["--camera", "gen3=1024x1024@240", "--quality", "fast"];
    let server = Server::start("patient", &args).expect("a server");
    let client = server.client();
    start(&client, "rendered");
    let tick = || {
        let status: v1::Status = client.request(&v1::StatusRequest {}).expect("a status");
        status.header.expect("a header").tick
    };
    let begun = tick();
    wait_until("images wait to be rendered", || tick() >= begun + 12);
    let stop = v1::EpisodeStopRequest::default().encode_to_vec();
    let order = reply_order(&client, (Query::EpisodeStop, stop), Query::Status);
    assert_eq!(order, [Query::Status, Query::EpisodeStop]);
    let reset = v1::ResetRequest {
        scenario: Some(v1::Scenario {
            seed: Some(5),
            ..Default::default()
        }),
        ..Default::default()
    };
    let order = reply_order(
        &client,
        (Query::Reset, reset.encode_to_vec()),
        Query::Status,
    );
    assert_eq!(order, [Query::Status, Query::Reset]);
}

/// Bit mask of the signals that a process handles.
fn handled_signals(pid: u32) -> u64 {
    let text = std::fs::read_to_string(format!("/proc/{pid}/status")).expect("/proc");
    let line = text.lines().find_map(|l| l.strip_prefix("SigCgt:"));
    u64::from_str_radix(line.expect("a mask").trim(), 16).expect("a mask")
}

#[test]
fn server_handles_signals_before_it_prints_ready() {
    // Its output is a full pipe: it blocks when it prints `ready`.
    let (mut reader, mut writer) = std::io::pipe().expect("a pipe");
    let size = 64 << 10;
    writer.write_all(&vec![b'\n'; size]).expect("a full pipe");
    let port = std::net::TcpListener::bind("127.0.0.1:0")
        .and_then(|listener| listener.local_addr())
        .expect("a free port")
        .port();
    let endpoint = format!("tcp/127.0.0.1:{port}");
    let mut server = Command::new(program("wheelarm-server").expect("the server"))
        .args(["--no-cameras", "--sim", "early", "--listen", &endpoint])
        .arg("--assets")
        .arg(root().join("assets"))
        .stdout(writer)
        .stderr(Stdio::null())
        .spawn()
        .expect("a process");
    let connect = wheelarm_sdk::Connect {
        endpoint,
        sim: "early".into(),
        timeout_secs: PATIENCE.as_secs_f64(),
        identity: None,
    };
    // It replies: only the `ready` line is left.
    let client = Client::open(&connect).expect("a client");
    let _: v1::Status = client.request(&v1::StatusRequest {}).expect("a status");
    let mask = handled_signals(server.id());
    let (interrupt, terminate) = (1 << (2 - 1), 1 << (15 - 1));
    let handles = mask & interrupt != 0 && mask & terminate != 0;
    let ended = Command::new("kill")
        .args(["-TERM", &server.id().to_string()])
        .status()
        .expect("kill");
    assert!(ended.success());
    let mut output = Vec::new();
    reader.read_to_end(&mut output).expect("its output");
    let status = server.wait().expect("its end");
    assert!(handles, "signals {mask:#x}");
    assert!(status.success(), "{status}");
    let output = String::from_utf8_lossy(&output[size..]).into_owned();
    assert!(output.starts_with("ready "), "{output:?}");
}

#[test]
fn reach_returns_a_code_and_a_reason() {
    let server = Server::start("reach-code", &["--no-cameras"]).expect("a server");
    let client = server.client();
    let scene = client.request(&v1::SceneRequest {}).expect("a scene");
    let roles = Roles::find(&scene.robot.expect("a robot")).expect("roles");
    let poses = client.samples::<v1::PoseSet>().expect("poses");
    let poses = poses.next(PATIENCE).expect("no error").expect("a sample");
    let pose = poses.frames[roles.end_effector].pose;
    let request = |pose| {
        let request = v1::ReachRequest {
            pose,
            ..Default::default()
        };
        client.request(&request).expect("an answer")
    };
    let here = request(pose);
    assert!(here.reachable && here.reason.is_empty(), "{here:?}");
    assert_eq!(here.problem(), v1::ReachProblem::Unspecified);
    let mut away = pose.expect("a pose");
    away.position = Some(v1::Vector3 {
        x: 3.0,
        ..Default::default()
    });
    let far = request(Some(away));
    assert!(!far.reachable && far.reason.contains("shoulder"), "{far:?}");
    assert_eq!(far.problem(), v1::ReachProblem::TooFar);
    assert_eq!(far.reached_count, 0);

    // A path: the number of reached poses, and the reason at the first other one.
    let mut higher = pose.expect("a pose");
    if let Some(at) = &mut higher.position {
        at.z += 0.02;
    }
    let follow = |next_poses: Vec<v1::Pose>, max_joint_change| {
        client.request(&v1::ReachRequest {
            pose,
            next_poses,
            max_joint_change,
            ..Default::default()
        })
    };
    let path = follow(vec![higher, pose.expect("a pose")], Some(1.0)).expect("an answer");
    assert!(path.reachable && path.joints.len() == 6, "{path:?}");
    assert_eq!(path.reached_count, 3);
    let cut = follow(vec![higher, away, higher], None).expect("an answer");
    assert!(!cut.reachable && cut.joints.is_empty(), "{cut:?}");
    assert_eq!(cut.reached_count, 2);
    let jump = follow(vec![higher], Some(1e-6)).expect("an answer");
    assert_eq!(jump.problem(), v1::ReachProblem::Jump, "{jump:?}");
    for (path, most, cure) in [
        (vec![higher; 257], None, "split the path"),
        (vec![higher], Some(-1.0), "more than 0"),
        (vec![v1::Pose::default()], None, "next_poses"),
    ] {
        let error = follow(path, most).expect_err("a refusal").to_string();
        assert!(error.contains(cure), "{error}");
    }
}
