//! Queries never stop physics: unread answers, floods, large requests, absurd
//! scenarios, and acts that take long.

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

/// Sends a query and returns at once; `told` hears what became of it: the
/// answer, the refusal's words, or nothing when there was none.
fn send(
    link: &Client,
    query: Query,
    payload: Vec<u8>,
    told: impl Fn(Result<Vec<u8>, String>) + Send + Sync + 'static,
) {
    link.session()
        .get(link.keys().query(query).replace('*', "asker"))
        .payload(payload)
        .encoding(wheelarm_proto::schema::encoding(query.messages()[0]))
        .source_info(SourceInfo::new(link.session().id(), 0))
        .timeout(PATIENCE)
        .callback(move |reply| {
            told(match reply.result() {
                Ok(sample) => Ok(sample.payload().to_bytes().into_owned()),
                Err(error) => Err(v1::Failure::decode(&*error.payload().to_bytes())
                    .map(|failure| failure.message)
                    .unwrap_or_default()),
            });
        })
        .wait()
        .expect("a query");
}

/// What a query was answered, in words where it was refused.
fn query_reply(link: &Client, query: Query, payload: Vec<u8>) -> Result<Vec<u8>, String> {
    let (told, answer) = mpsc::channel();
    send(link, query, payload, move |reply| {
        let _ = told.send(reply);
    });
    answer.recv_timeout(PATIENCE).expect("an answer")
}

fn start(link: &Client, label: &str) -> v1::EpisodeStarted {
    let request = v1::EpisodeStartRequest {
        label: label.into(),
        ..Default::default()
    };
    link.request(&request).expect("an episode")
}

#[test]
fn answers_that_one_peer_asks_for_under_many_names_do_not_stop_time() {
    unread("names", |deaf, i| {
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
fn answers_that_nobody_reads_do_not_stop_time() {
    unread("unread", |deaf, _| {
        send(deaf, Query::Snapshot, Vec::new(), |_| {});
    });
}

/// Time goes on at a server while a peer asks two hundred times by `ask` and
/// does not read.
fn unread(name: &str, request: impl Fn(&Client, u32)) {
    let server = Server::start(name, &["--no-cameras"]).expect("a server");
    let beside =
        Server::start(&format!("{name}-beside"), &["--no-cameras"]).expect("another server");
    let (link, other) = (server.link(), beside.link());
    start(&link, "unread");
    let proxy = Proxy::start(&server.endpoint, Duration::ZERO, 8e9).expect("a proxy");
    let deaf = Client::open(&server.connect_through(&proxy.endpoint())).expect("a link");
    let mut time = [Ticks::new(&link), Ticks::new(&other)];
    for time in &mut time {
        wait_until("time passes", || time.newest() > 0);
    }
    proxy.set(Line::Deaf);
    (0..200).for_each(|i| request(&deaf, i));
    let begun = time.each_mut().map(Ticks::newest);
    // Eight seconds of a server that nobody attacks, on the same host: the peer is
    // given up after five, and others must go on hearing the clock.
    wait_until("time has passed beside", || {
        time[1].newest() >= begun[1] + 1920
    });
    let [passed, beside] = [0, 1].map(|i| time[i].newest() - begun[i]);
    println!("{passed} ticks while 200 snapshots waited to be read, {beside} beside");
    assert!(4 * passed > 3 * beside, "{passed} ticks, {beside} beside");
}

#[test]
fn who_does_not_read_its_answers_delays_nobody_else() {
    let server = Server::start("deaf", &["--no-cameras"]).expect("a server");
    let (link, watcher) = (server.link(), server.link());
    start(&link, "deaf");
    let proxy = Proxy::start(&server.endpoint, Duration::ZERO, 8e9).expect("a proxy");
    let deaf = Client::open(&server.connect_through(&proxy.endpoint())).expect("a link");
    let life = deaf.session().liveliness();
    let _token = life.declare_token("test/deaf").wait().expect("a token");
    let (told, ends) = mpsc::channel();
    let _life = watcher
        .session()
        .liveliness()
        .declare_subscriber("test/deaf")
        .history(true)
        .callback(move |sample| {
            let _ = told.send(sample.kind());
        })
        .wait()
        .expect("a subscriber");
    let next = || ends.recv_timeout(PATIENCE).expect("word of the token");
    assert_eq!(next(), SampleKind::Put);
    let status = || link.request(&v1::StatusRequest {}).expect("an answer");
    let tick = |status: v1::Status| status.header.expect("a header").tick;
    proxy.set(Line::Deaf);
    for _ in 0..200 {
        send(&deaf, Query::Snapshot, Vec::new(), |_| {});
    }
    // A quarter of a second later the server is at those answers, and would be
    // until the transport gives the peer up.
    let mut time = Ticks::new(&watcher);
    wait_until("time is told", || time.newest() > 0);
    let asked = time.newest();
    wait_until("the answers are stalled", || time.newest() > asked + 60);
    let begun = tick(status());
    (0..20).for_each(|_| drop(status()));
    let passed = tick(status()) - begun;
    assert_eq!(next(), SampleKind::Delete, "it was not stalled");
    let rest = tick(status()) - begun - passed;
    println!("20 answers within {passed} ticks; the deaf peer was given up {rest} later");
    assert!(passed < rest, "{passed} ticks, and {rest} to the end");
}

/// The newest tick of a server.
struct Ticks {
    clocks: Streams,
    newest: u64,
}

impl Ticks {
    fn new(link: &Client) -> Self {
        Self {
            clocks: link.streams(&[TopicId::Clock]).expect("the clock"),
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
fn every_query_of_a_flood_is_answered_or_refused_while_time_goes_on() {
    let server = Server::start("curious", &["--no-cameras"]).expect("a server");
    let (link, crowd) = (server.link(), server.link());
    const FLOOD: usize = 3000;
    let (told, answers) = mpsc::channel();
    for _ in 0..FLOOD {
        let told = told.clone();
        send(&crowd, Query::Status, Vec::new(), move |reply| {
            let _ = told.send(reply.map(|_| ()));
        });
    }
    drop(told);
    // Somebody else comes in between, told to ask again at most.
    wait_until("somebody else is answered", || {
        link.request(&v1::StatusRequest {}).is_ok()
    });
    let (mut answered, mut refused) = (0, 0);
    // The channel ends with the last of the queries, answered or not.
    while let Ok(reply) = answers.recv_timeout(PATIENCE) {
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
    assert_eq!(
        answered + refused,
        FLOOD,
        "some were dropped without a word"
    );
}

#[test]
fn the_list_of_tasks_is_read_once() {
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
    let link = server.link();
    let list = || link.request(&v1::TasksRequest {}).expect("the tasks");
    let first = list().tasks;
    assert!(first.len() >= 13, "{} tasks", first.len());
    std::fs::remove_dir_all(assets.path().join("scenes")).expect("the scenes go");
    assert_eq!(list().tasks, first);
}

#[test]
fn requests_that_are_too_large_are_refused_by_their_length() {
    let mut server = Server::start("large", &["--no-cameras"]).expect("a server");
    let link = server.link();
    for query in Query::ALL {
        let bytes = if query == Query::Reset {
            8 << 20
        } else {
            2 << 20
        };
        let told = query_reply(&link, query, vec![0x0a; bytes]).expect_err("a refusal");
        assert!(told.contains(&format!("{bytes} bytes, at most")), "{told}");
    }
    assert!(server.alive());
}

#[test]
fn whoever_ends_its_own_episode_never_ends_another() {
    let server = Server::start("own", &["--no-cameras"]).expect("a server");
    let link = server.link();
    let first = start(&link, "first");
    link.stop_episode_of(&first, false).expect("its end");
    let over = |told: Result<v1::EpisodeStopped, wheelarm_sdk::ClientError>| {
        let told = told.expect_err("it is over").to_string();
        assert!(told.contains("is over"), "{told}");
        told
    };
    let told = over(link.stop_episode_of(&first, false));
    assert!(told.contains("no episode is running"), "{told}");
    let second = start(&link, "second");
    let told = over(link.stop_episode_of(&first, true));
    assert!(told.contains("is running"), "{told}");
    link.stop_episode_of(&second, false).expect("its own end");
}

/// State of the simulation, byte by byte, while time is paused.
fn state(link: &Client) -> Vec<u8> {
    start(link, "look");
    let reply: v1::SnapshotReply = link.request(&v1::SnapshotRequest {}).expect("a snapshot");
    let request = v1::EpisodeStopRequest {
        discard: true,
        secret: link.secret(),
        ..Default::default()
    };
    let _: v1::EpisodeStopped = link.request(&request).expect("its end");
    reply.snapshot.to_vec()
}

#[test]
fn a_refused_reset_names_the_cure_and_leaves_the_world_as_it_was() {
    let args = [
        "--no-cameras",
        "--pacing",
        "lock-step",
        "--task",
        "place_teddy_bear",
    ];
    let mut server = Server::start("refusing", &args).expect("a server");
    let link = server.link();
    let _still = link.commander("still", false).expect("control");
    let before = state(&link);
    let status = || link.request(&v1::StatusRequest {}).expect("a status");
    let scenario = status().scenario.expect("a scenario");
    let at = |x: f64, z: f64| v1::Pose {
        position: Some(v1::Vector3 { x, y: 0.0, z }),
        orientation: Some(v1::Quaternion {
            w: 1.0,
            ..Default::default()
        }),
    };
    let given = |change: &dyn Fn(&mut v1::Scenario)| {
        let mut asked = scenario.clone();
        change(&mut asked);
        asked
    };
    let bear = scenario
        .objects
        .iter()
        .position(|o| o.name.contains("teddy"));
    let bear = bear.expect("a bear");
    let absurd: [(v1::Scenario, &str); 14] = [
        (
            given(&|s| s.start = Some(at(1e30, 0.0))),
            "start is 1e30, expected -50 to 50",
        ),
        (given(&|s| s.start = Some(at(1e39, 0.0))), "start is 1e39"),
        (
            given(&|s| s.start = Some(at(0.0, -3.0))),
            "expected -1 to 5",
        ),
        (
            given(&|s| s.objects[0].pose = Some(at(1e300, 0.0))),
            "pose is 1e300",
        ),
        (
            given(&|s| s.objects[bear].mass = Some(1e-4)),
            "which is soft",
        ),
        (
            given(&|s| s.objects[bear].mass = Some(3.0)),
            "expected 0.05 to 2",
        ),
        (
            given(&|s| s.objects[0].mass = Some(1e-300)),
            "mass is 1e-300",
        ),
        (given(&|s| s.objects[0].mass = None), "mass is missing"),
        (
            given(&|s| s.instruction = Some("x".repeat(100_000))),
            "instruction",
        ),
        (given(&|s| s.instruction = Some("a\0b".into())), "NUL"),
        (given(&|s| s.target = Some("x".repeat(100_000))), "target"),
        (given(&|s| s.task = Some("x".repeat(100_000))), "task name"),
        (
            given(&|s| s.objects = vec![s.objects[0].clone(); 1000]),
            "objects: got 1000, at most",
        ),
        (given(&|s| s.state_rate_hz = Some(1e-300)), "1e-300 Hz"),
    ];
    for (scenario, word) in absurd {
        let request = v1::ResetRequest {
            scenario: Some(scenario),
            secret: link.secret(),
            ..Default::default()
        };
        let told =
            query_reply(&link, Query::Reset, request.encode_to_vec()).expect_err("a refusal");
        assert!(told.contains(word), "{told:?} lacks {word:?}");
        assert!(told.len() < 600, "{} bytes of words", told.len());
    }
    assert!(server.alive());
    assert!(state(&link) == before, "a refused reset changed the state");
    assert_eq!(status().scenario, Some(scenario));
}

/// Which of two queries is answered first, the second sent right behind the
/// first on the same connection.
fn first_answer(link: &Client, first: (Query, Vec<u8>), second: Query) -> Vec<Query> {
    let (told, order) = mpsc::channel();
    for (query, payload) in [first, (second, Vec::new())] {
        let told = told.clone();
        send(link, query, payload, move |reply| {
            reply.expect("an answer");
            let _ = told.send(query);
        });
    }
    (0..2)
        .map(|_| order.recv_timeout(PATIENCE).expect("an answer"))
        .collect()
}

#[test]
fn a_status_does_not_wait_for_a_reset_or_for_the_cameras() {
    // Far more pictures than can be drawn: some always wait.
    let args = ["--camera", "gen3=1024x1024@240", "--quality", "fast"];
    let server = Server::start("patient", &args).expect("a server");
    let link = server.link();
    start(&link, "drawn");
    let tick = || {
        let status: v1::Status = link.request(&v1::StatusRequest {}).expect("a status");
        status.header.expect("a header").tick
    };
    let begun = tick();
    wait_until("pictures wait to be drawn", || tick() >= begun + 12);
    let stop = v1::EpisodeStopRequest::default().encode_to_vec();
    let order = first_answer(&link, (Query::EpisodeStop, stop), Query::Status);
    assert_eq!(order, [Query::Status, Query::EpisodeStop]);
    let reset = v1::ResetRequest {
        scenario: Some(v1::Scenario {
            seed: Some(5),
            ..Default::default()
        }),
        ..Default::default()
    };
    let order = first_answer(&link, (Query::Reset, reset.encode_to_vec()), Query::Status);
    assert_eq!(order, [Query::Status, Query::Reset]);
}

/// Numbers of the signals that a process hears.
fn heard(pid: u32) -> u64 {
    let text = std::fs::read_to_string(format!("/proc/{pid}/status")).expect("/proc");
    let line = text.lines().find_map(|l| l.strip_prefix("SigCgt:"));
    u64::from_str_radix(line.expect("a mask").trim(), 16).expect("a mask")
}

#[test]
fn signals_are_heard_before_the_server_says_that_it_is_ready() {
    // Its line does not fit into a pipe that is full: it stands where it says it.
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
    // It answers: all that is left is to say so.
    let link = Client::open(&connect).expect("a link");
    let _: v1::Status = link.request(&v1::StatusRequest {}).expect("a status");
    let mask = heard(server.id());
    let (interrupt, terminate) = (1 << (2 - 1), 1 << (15 - 1));
    let hears = mask & interrupt != 0 && mask & terminate != 0;
    let ended = Command::new("kill")
        .args(["-TERM", &server.id().to_string()])
        .status()
        .expect("kill");
    assert!(ended.success());
    let mut said = Vec::new();
    reader.read_to_end(&mut said).expect("what it said");
    let status = server.wait().expect("its end");
    assert!(hears, "signals {mask:#x}");
    assert!(status.success(), "{status}");
    let said = String::from_utf8_lossy(&said[size..]).into_owned();
    assert!(said.starts_with("ready "), "{said:?}");
}

#[test]
fn reach_tells_a_code_beside_its_words() {
    let server = Server::start("reach-code", &["--no-cameras"]).expect("a server");
    let link = server.link();
    let scene = link.request(&v1::SceneRequest {}).expect("a scene");
    let roles = Roles::find(&scene.robot.expect("a robot")).expect("roles");
    let poses = link.samples::<v1::PoseSet>().expect("poses");
    let told = poses.next(PATIENCE).expect("a link").expect("a sample");
    let pose = told.frames[roles.end_effector].pose;
    let request = |pose| {
        let request = v1::ReachRequest {
            pose,
            ..Default::default()
        };
        link.request(&request).expect("an answer")
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

    // A path: as far as it goes, and why no further.
    let mut higher = pose.expect("a pose");
    if let Some(at) = &mut higher.position {
        at.z += 0.02;
    }
    let follow = |next_poses: Vec<v1::Pose>, max_joint_change| {
        link.request(&v1::ReachRequest {
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
        let told = follow(path, most).expect_err("a refusal").to_string();
        assert!(told.contains(cure), "{told}");
    }
}
