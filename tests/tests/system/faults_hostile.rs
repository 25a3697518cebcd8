//! Strangers who send a hundred thousand messages per second: refused, counted
//! and answered in sum, while the simulation and the operator go on.

use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use wheelarm_proto::topic::Sample;
use wheelarm_proto::{Message, TopicId, v1};
use wheelarm_sdk::{Client, Connect};
use wheelarm_tests::{Server, wait_until};
use zenoh::Wait;
use zenoh::qos::CongestionControl;

/// Messages of a flood, at least; a slow host needs longer for them.
const ENOUGH: u64 = 50_000;

fn stranger(sequence: u64) -> Vec<u8> {
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
            // The name of who is in control does not help without its life.
            commander: "anna".into(),
            ..good
        }
        .encode_to_vec(),
    }
}

#[test]
fn a_flood_is_refused_and_counted_while_the_operator_drives_on() {
    let mut server = Server::start("flooded", &["--no-cameras"]).expect("a server");
    let link = server.link();
    let streams = link
        .streams(&[TopicId::Clock, TopicId::Odometry, TopicId::Refusal])
        .expect("the streams");
    let mut anna = link.commander("anna", false).expect("control");
    let hostile = server.link();
    let (sent, ended) = (AtomicU64::new(0), AtomicBool::new(false));
    let flood = Duration::from_secs(3);
    let (mut speed, mut answers, mut told, mut ticks) = (0.0_f64, 0, 0, 0);
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
            // The messages are made before, so that sending is all that it does.
            let messages: Vec<_> = (0..1000).map(stranger).collect();
            for i in 0.. {
                // 100 000 per second, in bursts of a millisecond.
                if i % 100 == 0 {
                    let due = Duration::from_micros(i * 10);
                    std::thread::sleep(due.saturating_sub(begun.elapsed()));
                    if begun.elapsed() > flood && i >= ENOUGH {
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
                    answers += 1;
                    told += refusal.count;
                }
                _ => {}
            }
        }
    });
    let sent = sent.into_inner();
    let per_second = sent as f64 / begun.elapsed().as_secs_f64();
    println!(
        "{per_second:.0} hostile messages/s, {ticks} control ticks, {answers} refusals for {told}"
    );
    assert!(speed > 0.2, "the operator's chair reached {speed} m/s");
    assert!(answers < 200, "{answers} answers amplify the flood");
    // Every single one is counted.
    let refused = || {
        link.request(&v1::StatusRequest {})
            .expect("a status")
            .refused
    };
    wait_until("all are refused", || refused() >= sent);
    let late = refused() - sent;
    assert!(late < 200, "{late} of the operator's own were refused");
    assert!(server.alive());
}

#[test]
fn connections_that_never_say_a_word_keep_nobody_out() {
    let server = Server::start("silence", &["--no-cameras"]).expect("a server");
    let address = server.endpoint.strip_prefix("tcp/").expect("TCP");
    let silent: Vec<_> = (0..200)
        .map(|_| TcpStream::connect(address).expect("a connection"))
        .collect();
    // They are put out after five seconds; nobody waits for that.
    let patient = Connect {
        timeout_secs: 4.0,
        ..server.connect()
    };
    let link = Client::open(&patient).expect("a link beside the silent ones");
    let _: v1::Status = link.request(&v1::StatusRequest {}).expect("a status");
    drop(silent);
}
