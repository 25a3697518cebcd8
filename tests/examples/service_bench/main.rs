//! Measures the service with real processes on loopback: start-up and memory,
//! latency of commands, cost of recorders and of sensor models, a flood of hostile
//! messages.
//! Prints one line per figure; `tests/bench/compare.py` puts them in its table.
//!
//! `service_bench start|latency|recorders [COUNT]|sensors|flood`

mod latency;

use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TopicId, v1};
use wheelarm_sdk::Client;
use wheelarm_tests::{IdleCommander, Recorder, Server, wait_until};
use zenoh::Wait;

/// Cameras of the measurements that are not about images.
const CAMERAS: [&str; 6] = [
    "--camera",
    "gen3=160x90@30",
    "--camera",
    "wheelchair=160x90@30",
    "--quality",
    "fast",
];

fn main() -> anyhow::Result<()> {
    let what = std::env::args().nth(1).unwrap_or_default();
    match what.as_str() {
        "start" => start(),
        "latency" => latency::measure(),
        "recorders" => recorders(),
        "sensors" => sensors(),
        "flood" => flood(),
        other => bail!("{other:?} is not start, latency, recorders, sensors or flood"),
    }
}

/// A field of `/proc/PID/status`, MB.
fn memory(server: &Server, field: &str) -> anyhow::Result<f64> {
    let text = std::fs::read_to_string(format!("/proc/{}/status", server.pid()))?;
    let line = text.lines().find_map(|line| line.strip_prefix(field));
    let kilobytes = line
        .and_then(|l| l.split_whitespace().nth(1))
        .context("a field")?;
    Ok(kilobytes.parse::<f64>()? * 1.024e-3)
}

/// Processor time of the server, s.
fn processor(server: &Server) -> anyhow::Result<f64> {
    let text = std::fs::read_to_string(format!("/proc/{}/stat", server.pid()))?;
    let rest = text.rsplit(')').next().context("a line")?;
    let field = |i: usize| {
        rest.split_whitespace()
            .nth(i)
            .and_then(|f| f.parse::<f64>().ok())
    };
    let ticks = field(11).context("utime")? + field(12).context("stime")?;
    // USER_HZ is 100 on every Linux that Rust runs on.
    Ok(ticks / 100.0)
}

fn tick(client: &Client) -> anyhow::Result<u64> {
    let status: v1::Status = client.request(&v1::StatusRequest {})?;
    Ok(status.header.unwrap_or_default().tick)
}

/// From the start of the process to the first image of 1280x720.
fn start() -> anyhow::Result<()> {
    let begun = Instant::now();
    let server = Server::start("start", &[])?;
    let ready = begun.elapsed().as_secs_f64();
    let client = server.client();
    let images = client
        .session()
        .declare_subscriber(client.keys().camera("gen3"));
    let images = images.wait().map_err(|e| anyhow::anyhow!("{e}"))?;
    let first = images.recv_timeout(Duration::from_secs(60));
    if !matches!(first, Ok(Some(_))) {
        bail!("no image arrived");
    }
    let first_image = begun.elapsed().as_secs_f64();
    std::thread::sleep(Duration::from_secs(2));
    println!("ready after {ready:.3} s");
    println!("first image after {first_image:.3} s");
    println!("memory at most {:.0} MB", memory(&server, "VmHWM")?);
    Ok(())
}

/// Time per recorder in lock-step (1, 2 and 4 recorders, or COUNT) relative to runs
/// without any recorder right before and after: medians of the rounds. Every sample
/// must be recorded.
fn recorders() -> anyhow::Result<()> {
    const ROUNDS: usize = 5;
    let counts = match std::env::args().nth(2) {
        Some(count) => vec![count.parse().context("COUNT")?],
        None => vec![1, 2, 4],
    };
    let mut costs = vec![Vec::new(); counts.len()];
    let mut alone = Vec::new();
    for _ in 0..ROUNDS {
        let mut before = cost_with(0)?;
        for (count, costs) in counts.iter().zip(&mut costs) {
            let with = cost_with(*count)?;
            let after = cost_with(0)?;
            let none = (before[0] + after[0]) / 2.0;
            costs.push([with[0] / none, with[0], with[1]]);
            alone.push(after);
            before = after;
        }
    }
    alone.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let [wall, cpu] = alone[alone.len() / 2];
    println!("recorders 0: wall {wall:.3} s per simulated s, server {cpu:.3} s of processor time");
    for (count, mut costs) in counts.into_iter().zip(costs) {
        costs.sort_by(|a: &[f64; 3], b| a[0].total_cmp(&b[0]));
        let [ratio, wall, cpu] = costs[ROUNDS / 2];
        println!(
            "recorders {count}: {ratio:.3} of none ({:.3} to {:.3}), wall {wall:.3} s per simulated s, server {cpu:.3} s of processor time",
            costs[0][0],
            costs[ROUNDS - 1][0]
        );
    }
    Ok(())
}

/// Wall time and the server's processor time for a simulated second with `count`
/// recorders, s.
fn cost_with(count: usize) -> anyhow::Result<[f64; 2]> {
    const SECONDS: u64 = 8;
    let args = [&CAMERAS[..], &["--pacing", "lock-step"]].concat();
    let server = Server::start("cost", &args)?;
    let client = server.client();
    let folder = tempfile::tempdir()?;
    let recorders: Vec<_> = (0..count)
        .map(|i| {
            let name = format!("r{i}");
            let out = folder.path().join(&name);
            Recorder::start(&server, &name, &out, &["--episodes", "1"])
        })
        .collect();
    wait_until("the recorders are there", || {
        let status = client.request(&v1::StatusRequest {});
        status.is_ok_and(|s| s.recorders.len() == count)
    });
    let idle = IdleCommander::start(&server.client());
    let request = v1::EpisodeStartRequest {
        label: "cost".into(),
        require_recorders: u32::try_from(count)?,
        ..Default::default()
    };
    let _: v1::EpisodeStarted = client.request(&request)?;
    let from = tick(&client)?;
    wait_until("time passes", || tick(&client).is_ok_and(|t| t > from + 60));
    let (from, begun, cpu) = (tick(&client)?, Instant::now(), processor(&server)?);
    wait_until("time passes", || {
        tick(&client).is_ok_and(|t| t > from + SECONDS * 240)
    });
    let simulated = (tick(&client)? - from) as f64 / 240.0;
    let wall = begun.elapsed().as_secs_f64() / simulated;
    let cpu = (processor(&server)? - cpu) / simulated;
    let request = v1::EpisodeStopRequest::default();
    let _: v1::EpisodeStopped = client.request(&request)?;
    drop(idle);
    for recorder in recorders {
        let text = recorder.finish();
        if !text.contains("complete") {
            bail!("a recording is not complete: {text}");
        }
    }
    Ok([wall, cpu])
}

/// Rate of recording both cameras with the models of both robot sensors, over that
/// without, in turns; the median of the pairs.
fn sensors() -> anyhow::Result<()> {
    const PAIRS: usize = 5;
    const PLAIN: [&str; 6] = [
        "--camera",
        "gen3=640x360@10",
        "--camera",
        "wheelchair=640x360@10",
        "--pacing",
        "lock-step",
    ];
    const MODELS: [&str; 4] = [
        "--sensor",
        "kinova_vision@gen3",
        "--sensor",
        "chair_stereo@wheelchair",
    ];
    let mut pairs: Vec<[f64; 3]> = Vec::new();
    for _ in 0..PAIRS {
        let without = recorded_rate(&PLAIN)?;
        let with = recorded_rate(&[&PLAIN[..], &MODELS].concat())?;
        pairs.push([with / without, with, without]);
    }
    pairs.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let [share, with, without] = pairs[PAIRS / 2];
    println!(
        "sensors: {with:.3} simulated s per s with, {without:.3} without, {share:.3} of it ({:.3} to {:.3})",
        pairs[0][0],
        pairs[PAIRS - 1][0]
    );
    Ok(())
}

/// Simulated seconds per second of a recorded episode in lock-step.
fn recorded_rate(args: &[&str]) -> anyhow::Result<f64> {
    const SECONDS: u64 = 8;
    let server = Server::start("sensors", args)?;
    let client = server.client();
    let folder = tempfile::tempdir()?;
    let recorder = Recorder::start(&server, "r", folder.path(), &["--episodes", "1"]);
    let idle = IdleCommander::start(&server.client());
    let request = v1::EpisodeStartRequest {
        label: "sensors".into(),
        require_recorders: 1,
        ..Default::default()
    };
    let _: v1::EpisodeStarted = client.request(&request)?;
    let from = tick(&client)?;
    wait_until("time passes", || tick(&client).is_ok_and(|t| t > from + 60));
    let (from, begun) = (tick(&client)?, Instant::now());
    wait_until("time passes", || {
        tick(&client).is_ok_and(|t| t > from + SECONDS * 240)
    });
    let simulated = (tick(&client)? - from) as f64 / 240.0;
    let rate = simulated / begun.elapsed().as_secs_f64();
    let _: v1::EpisodeStopped = client.request(&v1::EpisodeStopRequest::default())?;
    drop(idle);
    let text = recorder.finish();
    if !text.contains("complete") {
        bail!("a recording is not complete: {text}");
    }
    Ok(rate)
}

/// Control ticks per second with and without 100 000 hostile messages a second.
fn flood() -> anyhow::Result<()> {
    const SECONDS: f64 = 4.0;
    let server = Server::start("flood", &["--no-cameras"])?;
    let (client, hostile) = (server.client(), server.client());
    let rate = |seconds: f64| -> anyhow::Result<f64> {
        let clock = client.streams(&[TopicId::Clock])?;
        let begun = Instant::now();
        let mut count = 0;
        while begun.elapsed().as_secs_f64() < seconds {
            if let Some(Sample::Clock(_)) = clock.next(Duration::from_millis(50))? {
                count += 1;
            }
        }
        Ok(f64::from(count) / begun.elapsed().as_secs_f64())
    };
    let quiet = rate(SECONDS)?;
    let sending = std::thread::spawn(move || {
        let publisher = hostile
            .session()
            .declare_publisher(hostile.keys().command("hostile"))
            .encoding(wheelarm_proto::schema::encoding("wheelarm.v1.Command"));
        let Ok(publisher) = publisher.wait() else {
            return 0.0;
        };
        let begun = Instant::now();
        let mut sent = 0_u64;
        while begun.elapsed().as_secs_f64() < SECONDS + 0.5 {
            for _ in 0..100 {
                let _ = publisher.put(vec![0xff_u8; 40]).wait();
                sent += 1;
            }
            let due = Duration::from_micros(sent * 10);
            std::thread::sleep(due.saturating_sub(begun.elapsed()));
        }
        sent as f64 / begun.elapsed().as_secs_f64()
    });
    let flooded = rate(SECONDS)?;
    let sent = sending.join().unwrap_or_default();
    println!("hostile messages {sent:.0} per s");
    println!("control ticks {quiet:.2} per s alone, {flooded:.2} flooded");
    Ok(())
}
