//! Control of the robot beside hostile clients that know every name on the network.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use wheelarm_proto::topic::Sample;
use wheelarm_proto::{Message, TopicId, v1};
use wheelarm_sdk::{Client, ClientError};
use wheelarm_tests::{PATIENCE, Server, printed, program, wait_until};
use zenoh::Wait;

fn status(client: &Client) -> v1::Status {
    client.request(&v1::StatusRequest {}).expect("a status")
}

fn tick(client: &Client) -> u64 {
    status(client).header.expect("a header").tick
}

#[test]
fn other_clients_cannot_drive_release_or_block_in_the_name_of_the_holder() {
    let server = Server::start("named", &["--no-cameras"]).expect("a server");
    let (client, hostile) = (server.client(), server.client());
    let streams = client
        .streams(&[TopicId::Clock, TopicId::Refusal, TopicId::Odometry])
        .expect("streams");
    let mut anna = client.commander("anna", false).expect("control");
    let forged = |sequence, linear| {
        let command = v1::Command {
            header: Some(v1::Header {
                run_id: anna.run_id().into(),
                sequence,
                ..Default::default()
            }),
            commander: "anna".into(),
            answers_tick: Some(tick(&hostile)),
            base: Some(v1::BaseCommand {
                linear,
                angular: 0.0,
            }),
            ..Default::default()
        };
        let key = hostile.keys().command("anna");
        hostile
            .session()
            .put(key, command.encode_to_vec())
            .encoding(wheelarm_proto::schema::encoding("wheelarm.v1.Command"))
            .wait()
            .expect("a put");
    };
    // Her name and her run ID are public; the secret of her lease is not.
    forged(0, 0.5);
    forged(u64::MAX, 0.5);
    let reasons: Vec<_> = std::iter::from_fn(|| streams.next(PATIENCE).expect("no error"))
        .take(1000)
        .filter_map(|sample| match sample {
            Sample::Refusal(refusal) => Some(refusal.reason),
            _ => None,
        })
        .take(2)
        .collect();
    assert_eq!(reasons.len(), 2, "forged commands were accepted");
    for reason in &reasons {
        assert!(reason.contains("no seal"), "{reason}");
    }
    let request = v1::LeaseRequest {
        header: Some(v1::Header {
            run_id: anna.run_id().into(),
            ..Default::default()
        }),
        commander: "anna".into(),
        release: true,
        ..Default::default()
    };
    let error = hostile.request(&request);
    let error = error.expect_err("a refusal");
    let secret = matches!(
        error,
        ClientError::Refused {
            code: v1::FailureCode::Secret,
            ..
        }
    );
    assert!(secret && error.to_string().contains("secret"), "{error}");
    let take = v1::LeaseRequest {
        release: false,
        take: true,
        ..request
    };
    let reply: v1::LeaseReply = hostile.request(&take).expect("an answer");
    assert_eq!((reply.holder.as_str(), reply.secret.as_str()), ("anna", ""));
    // She continues to drive, and releases control herself.
    let mut speed = 0.0_f64;
    while speed < 0.2 {
        match streams.next(PATIENCE).expect("no error") {
            Some(Sample::Clock(clock)) => {
                let drive = v1::Command {
                    base: Some(v1::BaseCommand {
                        linear: 0.3,
                        angular: 0.0,
                    }),
                    ..Default::default()
                };
                let header = clock.header.expect("a header");
                anna.answer(&header, drive).expect("a command");
            }
            Some(Sample::Odometry(sample)) => {
                speed = sample.twist.and_then(|t| t.linear).map_or(0.0, |l| l.x);
            }
            // A command may be late on a busy machine.
            Some(Sample::Refusal(refusal)) if refusal.code() == v1::RefusalCode::TooOld => {}
            Some(Sample::Refusal(refusal)) => panic!("refused: {}", refusal.reason),
            _ => panic!("no sample arrived"),
        }
    }
    drop(anna);
    assert_eq!(status(&client).holder, "");
}

#[test]
fn many_tokens_do_not_keep_a_commander_out() {
    let server = Server::start("crowded", &["--no-cameras"]).expect("a server");
    let (client, hostile) = (server.client(), server.client());
    let tokens: Vec<_> = (0..400)
        .map(|number| {
            let key = hostile
                .keys()
                .commander_alive(&format!("ghost-{number}"), "0");
            let token = hostile.session().liveliness().declare_token(key);
            token.wait().expect("a token")
        })
        .collect();
    // The server has received the last token: it replies to a later query of that session.
    let _ = status(&hostile);
    let anna = client.commander("anna", false).expect("control");
    assert_eq!(status(&client).holder, "anna");
    drop(anna);
    // A token alone gives no control, nor does a name without one.
    let request = v1::LeaseRequest {
        header: Some(v1::Header {
            run_id: "0".into(),
            ..Default::default()
        }),
        commander: "unknown".into(),
        ..Default::default()
    };
    let reply: v1::LeaseReply = hostile.request(&request).expect("an answer");
    assert_eq!(reply.holder, "");
    drop(tokens);
}

#[test]
fn silence_rule_cannot_be_disabled_in_real_time() {
    let server = Server::start("ruled", &["--no-cameras"]).expect("a server");
    let client = server.client();
    let request = v1::EpisodeStartRequest {
        label: "x".into(),
        replay: true,
        ..Default::default()
    };
    let error = client.request(&request);
    let error = error.expect_err("a refusal").to_string();
    assert!(error.contains("--pacing lock-step"), "{error}");
    assert!(status(&client).episode.is_none());
}

#[test]
fn irreversible_requests_are_refused_while_another_client_is_in_control() {
    let server = Server::start("guarded", &["--no-cameras"]).expect("a server");
    let client = server.client();
    let anna = client.commander("anna", false).expect("control");
    let run = |args: &[&str]| {
        let output = server.run_client(args).expect("a client");
        (output.status.success(), printed(&output))
    };
    let refused = |args: &[&str]| {
        let (done, text) = run(args);
        assert!(
            !done && text.contains("anna") && text.contains("--force"),
            "{text}"
        );
    };
    let done = |args: &[&str]| {
        let (done, text) = run(args);
        assert!(done, "{text}");
    };
    refused(&["reset", "--seed", "7"]);
    refused(&["shutdown"]);
    // An episode that is kept may be ended by any client.
    done(&["episode", "start", "--label", "kept"]);
    done(&["episode", "stop"]);
    done(&["episode", "start", "--label", "lost"]);
    refused(&["episode", "stop", "--discard"]);
    assert!(status(&client).episode.is_some());
    done(&["episode", "stop", "--discard", "--force"]);
    // The holder needs no `--force`, and no client does while control is free.
    let seed = |client: &Client| status(client).scenario.map(|s| s.seed);
    let scenario = v1::Scenario {
        seed: Some(8),
        ..v1::Scenario::default()
    };
    client.reset(scenario, false).expect("a reset");
    assert_eq!(seed(&client), Some(Some(8)));
    done(&["reset", "--seed", "9", "--force"]);
    drop(anna);
    done(&["reset", "--seed", "10"]);
    assert_eq!(seed(&client), Some(Some(10)));
    done(&["shutdown"]);
}

/// `wheelarm lease hold`, ended with the test.
struct Hand(Child);

impl Hand {
    fn say(&mut self, line: &str) {
        let stdin = self.0.stdin.as_mut().expect("its input");
        writeln!(stdin, "{line}").expect("a line");
    }
}

impl Drop for Hand {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn lease_hold_drives_an_episode_in_lock_step() {
    let args = ["--no-cameras", "--pacing", "lock-step"];
    let server = Server::start("by-hand", &args).expect("a server");
    let client = server.client();
    let run = |args: &[&str]| {
        let output = server.run_client(args).expect("a client");
        (output.status.success(), printed(&output))
    };
    let start = ["episode", "start", "--label", "by-hand"];
    let (started, text) = run(&start);
    assert!(!started && text.contains("wheelarm lease hold"), "{text}");
    let child = Command::new(program("wheelarm").expect("the client"))
        .args(["--connect", &server.endpoint, "--sim", &server.sim])
        .args(["lease", "hold", "--name", "anna"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("a process");
    let mut hand = Hand(child);
    let mut lines = BufReader::new(hand.0.stdout.take().expect("its output")).lines();
    let first = lines.next().expect("a line").expect("a line");
    assert!(first.contains("anna is in control"), "{first}");
    assert_eq!(tick(&client), 0, "time is paused between episodes");
    let odometry = client.streams(&[TopicId::Odometry]).expect("odometry");
    let (started, text) = run(&start);
    assert!(started, "{text}");
    wait_until("a second has passed", || tick(&client) >= 240);
    hand.say("drive 0.3 0.0");
    let mut speed = 0.0;
    while speed < 0.25 {
        if let Some(Sample::Odometry(sample)) = odometry.next(PATIENCE).expect("no error") {
            speed = sample.twist.and_then(|t| t.linear).map_or(0.0, |l| l.x);
        }
    }
    hand.say("stop");
    while speed > 0.005 {
        if let Some(Sample::Odometry(sample)) = odometry.next(PATIENCE).expect("no error") {
            speed = sample.twist.and_then(|t| t.linear).map_or(0.0, |l| l.x);
        }
    }
    let (stopped, text) = run(&["episode", "stop"]);
    assert!(stopped, "{text}");
    let still = tick(&client);
    std::thread::sleep(Duration::from_millis(200));
    assert_eq!(tick(&client), still, "time is paused again");
    hand.say("quit");
    assert!(hand.0.wait().expect("its end").success());
    assert_eq!(status(&client).holder, "");
}
