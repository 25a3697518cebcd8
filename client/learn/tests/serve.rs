//! The program `wheelarm-learn serve`, with requests over Zenoh as of a rollout.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use wheelarm_proto::keys::PolicyKeys;
use wheelarm_proto::{Message, schema, v1};
use wheelarm_sdk::policy::{NAME_VARIABLE, POLICY_VARIABLE};
use zenoh::{Config, Session, Wait};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data")
        .join(name)
}

/// A session that listens at an endpoint.
fn listening(endpoint: &str) -> Session {
    let mut config = Config::default();
    for (key, value) in [
        ("mode", "\"peer\"".to_owned()),
        ("listen/endpoints", format!("[\"{endpoint}\"]")),
        ("scouting/multicast/enabled", "false".to_owned()),
        ("scouting/gossip/enabled", "false".to_owned()),
    ] {
        config.insert_json5(key, &value).expect("a setting");
    }
    zenoh::open(config).wait().expect("a session")
}

/// A process that serves a policy; killed when dropped.
struct Served(Child);

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn query_reply<R: Message + Default>(
    session: &Session,
    key: String,
    message: &str,
    bytes: Vec<u8>,
) -> Result<R, v1::Failure> {
    let replies = session
        .get(key)
        .payload(bytes)
        .encoding(schema::encoding(message))
        .timeout(Duration::from_secs(60))
        .wait()
        .expect("a query");
    let reply = replies.recv().expect("an answer");
    match reply.result() {
        Ok(sample) => {
            schema::check(&sample.encoding().to_string()).expect("our version");
            Ok(R::decode(&*sample.payload().to_bytes()).expect("a message"))
        }
        Err(error) => Err(v1::Failure::decode(&*error.payload().to_bytes()).expect("a failure")),
    }
}

fn observation(key: &str) -> v1::PolicyObservation {
    let image = |camera: &str| v1::PolicyImage {
        camera: camera.to_owned(),
        width: 50,
        height: 41,
        color: (0..41 * 50 * 3).map(|i| (i * 7 % 251) as u8).collect(),
        ..Default::default()
    };
    v1::PolicyObservation {
        episode_key: key.to_owned(),
        seed: 5,
        first: true,
        tick: 48,
        instruction: "get me the mug".to_owned(),
        steps: vec![v1::PolicyStep {
            state_values: vec![0.1, -0.2, 0.3, 0.4, 0.5],
            images: vec![image("left"), image("right")],
        }],
    }
}

/// Serves the flow of the tests; the folder contains its socket.
fn start_policy(name: &str) -> (tempfile::TempDir, Session, Served, PolicyKeys) {
    let folder = tempfile::tempdir().expect("a folder");
    let endpoint = format!("unixsock-stream/{}/policy", folder.path().display());
    let session = listening(&endpoint);
    let child = Command::new(env!("CARGO_BIN_EXE_wheelarm-learn"))
        .arg("serve")
        .arg(data("flow.safetensors"))
        .env(POLICY_VARIABLE, &endpoint)
        .env(NAME_VARIABLE, name)
        .stdout(Stdio::null())
        .spawn();
    let served = Served(child.expect("a process"));
    let keys = PolicyKeys::new(name).expect("a name");
    let deadline = Instant::now() + Duration::from_secs(60);
    let is_found = || {
        let replies = session.liveliness().get(keys.alive()).wait();
        replies.expect("a query").into_iter().next().is_some()
    };
    while !is_found() {
        assert!(Instant::now() < deadline, "the policy is not ready");
        std::thread::sleep(Duration::from_millis(20));
    }
    (folder, session, served, keys)
}

#[test]
fn memory_does_not_grow_with_requests() {
    let (_folder, session, served, keys) = start_policy("flat");
    let resident = || {
        let path = format!("/proc/{}/statm", served.0.id());
        let pages = std::fs::read_to_string(path).expect("a process");
        let pages: usize = pages
            .split(' ')
            .nth(1)
            .and_then(|p| p.parse().ok())
            .expect("pages");
        pages * 4096
    };
    let mut before = 0;
    for step in 0..3000 {
        if step == 1000 {
            before = resident();
        }
        let request = v1::InferRequest {
            observations: vec![observation("one")],
        };
        let bytes = request.encode_to_vec();
        query_reply::<v1::InferReply>(&session, keys.infer(), "wheelarm.v1.InferRequest", bytes)
            .expect("an answer");
    }
    let grown = resident().saturating_sub(before);
    assert!(
        grown < 4 << 20,
        "{grown} bytes more after 3000 answers than after 1000"
    );
}

#[test]
fn served_policy_describes_itself_and_replies_to_single_and_batched_observations() {
    let (_folder, session, _served, keys) = start_policy("tested");
    let spec: v1::PolicySpec = query_reply(
        &session,
        keys.describe(),
        "wheelarm.v1.PolicyDescribeRequest",
        Vec::new(),
    )
    .expect("a spec");
    assert_eq!((spec.name.as_str(), spec.stochastic), ("flow", true));
    let reset = v1::PolicyResetRequest::default().encode_to_vec();
    let reset: Result<v1::PolicyResetReply, _> = query_reply(
        &session,
        keys.reset(),
        "wheelarm.v1.PolicyResetRequest",
        reset,
    );
    assert!(reset.is_ok());

    let infer = |observations| {
        let request = v1::InferRequest { observations };
        let bytes = request.encode_to_vec();
        query_reply::<v1::InferReply>(&session, keys.infer(), "wheelarm.v1.InferRequest", bytes)
    };
    let one = infer(vec![observation("one")]).expect("an answer");
    let again = infer(vec![observation("one")]).expect("an answer");
    assert_eq!(one, again, "the noise follows from seed and tick");
    let mut bad = observation("bad");
    bad.steps[0].state_values.clear();
    let all = infer(vec![bad, observation("two")]).expect("an answer");
    assert_eq!(all.chunks[0].episode_key, "bad");
    assert!(
        all.chunks[0].problem.contains("state"),
        "{:?}",
        all.chunks[0]
    );
    assert_eq!(all.chunks[1].rows, 4);

    // An unreadable request gets a failure with a reason, and the policy continues.
    let failure = query_reply::<v1::InferReply>(
        &session,
        keys.infer(),
        "wheelarm.v1.InferRequest",
        vec![0xff; 40],
    );
    let words = failure.expect_err("no answer").message;
    assert!(words.contains("cannot be read"), "{words}");
    assert_eq!(infer(vec![observation("one")]).expect("an answer"), one);
}

#[test]
fn file_that_is_not_a_policy_ends_the_program_with_a_reason() {
    let output = Command::new(env!("CARGO_BIN_EXE_wheelarm-learn"))
        .args(["serve", "--connect", "tcp/127.0.0.1:1"])
        .arg(data("flow.answers.safetensors"))
        .output()
        .expect("a process");
    assert_eq!(output.status.code(), Some(1));
    let words = String::from_utf8_lossy(&output.stderr);
    // The name of its tensor of bytes.
    assert!(words.contains("pictures"), "{words}");
}
