//! Hostile clients that send a hundred thousand messages per second. The gate rejects and
//! counts them and publishes summed refusals; simulation and operator continue.

use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use wheelarm_proto::topic::Sample;
use wheelarm_proto::{Message, TopicId, v1};
use wheelarm_sdk::{Client, Connect};
use wheelarm_tests::{Server, wait_until};
use zenoh::Wait;
use zenoh::qos::CongestionControl;

/// Least messages of a flood; a slow host needs longer for them.
const LEAST_MESSAGES: u64 = 50_000;

/// A hostile message: garbage, a foreign command, half a command, or a forged name.
fn hostile_message(sequence: u64) -> Vec<u8> {
    let good = v1::Command {
        header: Some(v1::Header {
            run_id: "stranger".into(),
            sequence,
            ..Default::default()
        }),
        commander: "stranger".into(),
        base: Some(v1::BaseCommand {
            linear: -0.5,
            angular: 2.0,
        }),
        ..Default::default()
    };
    match sequence % 4 {
        0 => vec![0xff; 40],
        1 => good.encode_to_vec(),
        2 => {
            let mut bytes = good.encode_to_vec();
            bytes.truncate(bytes.len() / 2);
            bytes
        }
        _ => v1::Command {
            // The holder's name without the holder's secret.
            commander: "anna".into(),
            ..good
        }
        .encode_to_vec(),
    }
}

#[test]
fn flood_is_refused_and_counted_while_the_operator_drives() {
    let mut server = Server::start("flooded", &["--no-cameras"]).expect("a server");
    let client = server.client();
    let streams = client
        .streams(&[TopicId::Clock, TopicId::Odometry, TopicId::Refusal])
        .expect("the streams");
    let mut anna = client.commander("anna", false).expect("control");
    let hostile = server.client();
    let (sent, ended) = (AtomicU64::new(0), AtomicBool::new(false));
    let flood = Duration::from_secs(3);
    let (mut speed, mut refusals, mut refused_messages, mut ticks) = (0.0_f64, 0, 0, 0);
    let begun = Instant::now();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let publisher = hostile
                .session()
                .declare_publisher(hostile.keys().command("stranger"))
                .encoding(wheelarm_proto::schema::encoding("wheelarm.v1.Command"))
                .congestion_control(CongestionControl::Block)
                .wait()
                .expect("a publisher");
            // Made before, so that the thread only sends.
            let messages: Vec<_> = (0..1000).map(hostile_message).collect();
            for i in 0.. {
                // 100 000 per second, in bursts of a millisecond.
                if i % 100 == 0 {
                    let due = Duration::from_micros(i * 10);
                    std::thread::sleep(due.saturating_sub(begun.elapsed()));
                    if begun.elapsed() > flood && i >= LEAST_MESSAGES {
                        break;
                    }
                }
                let message = messages[i as usize % messages.len()].clone();
                publisher.put(message).wait().expect("a put");
                sent.fetch_add(1, Ordering::Relaxed);
            }
            ended.store(true, Ordering::Release);
        });
        while !ended.load(Ordering::Acquire) {
            match streams.next(Duration::from_millis(100)).expect("no error") {
                Some(Sample::Clock(clock)) => {
                    ticks += 1;
                    let drive = v1::Command {
                        base: Some(v1::BaseCommand {
                            linear: 0.3,
                            angular: 0.0,
                        }),
                        ..Default::default()
                    };
                    anna.answer(&clock.header.unwrap_or_default(), drive)
                        .expect("a command");
                }
                Some(Sample::Odometry(sample)) => {
                    let twist = sample.twist.unwrap_or_default();
                    speed = speed.max(twist.linear.unwrap_or_default().x);
                }
                Some(Sample::Refusal(refusal)) => {
                    refusals += 1;
                    refused_messages += refusal.count;
                }
                _ => {}
            }
        }
    });
    let sent = sent.into_inner();
    let per_second = sent as f64 / begun.elapsed().as_secs_f64();
    println!(
        "{per_second:.0} hostile messages/s, {ticks} control ticks, {refusals} refusals for {refused_messages}"
    );
    assert!(speed > 0.2, "the operator's chair reached {speed} m/s");
    assert!(refusals < 200, "{refusals} refusals amplify the flood");
    // Every message is counted.
    let refused = || {
        client
            .request(&v1::StatusRequest {})
            .expect("a status")
            .refused
    };
    wait_until("all are refused", || refused() >= sent);
    let late = refused() - sent;
    assert!(late < 200, "{late} of the operator's own were refused");
    assert!(server.alive());
}

#[test]
fn silent_connections_keep_no_client_out() {
    let server = Server::start("silence", &["--no-cameras"]).expect("a server");
    let address = server.endpoint.strip_prefix("tcp/").expect("TCP");
    let silent: Vec<_> = (0..200)
        .map(|_| TcpStream::connect(address).expect("a connection"))
        .collect();
    // The server closes them after five seconds; the client connects before that.
    let patient = Connect {
        timeout_secs: 4.0,
        ..server.connect()
    };
    let client = Client::open(&patient).expect("a client beside the silent connections");
    let _: v1::Status = client.request(&v1::StatusRequest {}).expect("a status");
    drop(silent);
}
