//! `wheelarm watch`: measures every stream of a server. It never commands.

mod meter;
mod report;

use std::collections::BTreeMap;
use std::io::{IsTerminal, Write};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::Context;
use clap::Args;
use wheelarm_proto::{Message, TopicId, v1};

pub use meter::{Figures, Meter};
pub use report::{Recorder, Report};
use wheelarm_sdk::{Client, ClientError};

/// Options of `wheelarm watch`.
#[derive(Args, Clone, Debug)]
pub struct WatchArgs {
    /// Measures once and exits: code 0, or 3 when samples were missed.
    #[arg(long)]
    pub once: bool,
    /// Prints one JSON object per report instead of a table.
    #[arg(long)]
    pub json: bool,
    /// Time between two reports, seconds.
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS", value_parser = seconds)]
    pub interval: f64,
    /// Ends after this many seconds; with --once, duration of the measurement.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub duration: Option<f64>,
    /// Also measures the full camera streams: several MB per image.
    #[arg(long)]
    pub cameras: bool,
    /// Measures only streams whose name contains this text.
    #[arg(long, value_name = "TEXT")]
    pub only: Option<String>,
}

fn seconds(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|s: &f64| (0.1..=1e6).contains(s))
        .ok_or_else(|| format!("{text:?} is not a number of seconds from 0.1 to 1000000"))
}

/// Field 1, common to all published messages.
#[derive(Clone, PartialEq, prost::Message)]
struct Stamped {
    /// Stamp of the sample.
    #[prost(message, optional, tag = "1")]
    header: Option<v1::Header>,
}

/// One received message.
struct Arrival {
    stream: String,
    at: Instant,
    bytes: usize,
    stamped: Option<Stamped>,
}

/// Runs `wheelarm watch`.
///
/// # Errors
/// When the server does not reply at the end, or the output is closed.
pub fn run(client: &Client, args: &WatchArgs) -> anyhow::Result<ExitCode> {
    let (sender, receiver) = crossbeam_channel::unbounded::<Arrival>();
    let mut key_expressions = vec![client.keys().streams()];
    if args.cameras {
        key_expressions.push(client.keys().topic(TopicId::Camera));
    }
    let mut subscribers = Vec::new();
    for key_expression in key_expressions {
        let (sender, keys) = (sender.clone(), client.keys().clone());
        let subscriber = client.subscribe(&key_expression, move |sample| {
            let Some(stream) = keys.stream_of(sample.key_expr().as_str()) else {
                return;
            };
            let payload = sample.payload();
            let stamped = Stamped::decode(&*payload.to_bytes()).ok();
            // A closed queue means that the program ends.
            let _ = sender.send(Arrival {
                stream: stream.to_string(),
                at: Instant::now(),
                bytes: payload.len(),
                stamped,
            });
        })?;
        subscribers.push(subscriber);
    }
    let began = Instant::now();
    let length = match (args.once, args.duration) {
        (true, None) => Some(2.0),
        (_, length) => length,
    };
    let mut meters: BTreeMap<String, Meter> = BTreeMap::new();
    let interval = if args.once {
        length.unwrap_or(args.interval)
    } else {
        args.interval
    };
    let (mut next, mut lost) = (interval, false);
    loop {
        let left = next - began.elapsed().as_secs_f64();
        if left > 0.0 {
            if let Ok(arrival) = receiver.recv_timeout(Duration::from_secs_f64(left)) {
                measure(&mut meters, &arrival, began, args.only.as_deref());
            }
            continue;
        }
        for arrival in receiver.try_iter() {
            measure(&mut meters, &arrival, began, args.only.as_deref());
        }
        next += interval;
        let now = began.elapsed().as_secs_f64();
        let sent = Instant::now();
        let status = match client.request(&v1::StatusRequest {}) {
            Ok(status) => status,
            // A restarted server is found again, and its reply shows whether it has the
            // same version.
            Err(error @ (ClientError::Gone { .. } | ClientError::Silent { .. }))
                if !args.once && length.is_none_or(|length| now < length) =>
            {
                if !lost {
                    eprintln!("{error}; waiting for the server");
                }
                lost = true;
                next = began.elapsed().as_secs_f64() + interval;
                continue;
            }
            Err(error) => return Err(error.into()),
        };
        if std::mem::take(&mut lost) {
            eprintln!("the server replies again");
        }
        let report = Report::new(
            client.keys().sim(),
            &status,
            sent.elapsed().as_secs_f64(),
            &meters,
            now,
        );
        let over = args.once || length.is_some_and(|length| now >= length);
        print(&report, args, over)?;
        if over {
            let loss = meters.values().any(|m| m.figures(now, 1.0).missed > 0);
            return Ok(ExitCode::from(if loss { 3 } else { 0 }));
        }
    }
}

fn measure(
    meters: &mut BTreeMap<String, Meter>,
    arrival: &Arrival,
    began: Instant,
    only: Option<&str>,
) {
    if only.is_some_and(|text| !arrival.stream.contains(text)) {
        return;
    }
    let meter = meters.entry(arrival.stream.clone()).or_default();
    match arrival.stamped.as_ref().and_then(|s| s.header.as_ref()) {
        Some(header) => {
            let at = arrival.at.saturating_duration_since(began).as_secs_f64();
            meter.add(header, arrival.bytes, at);
        }
        None => meter.count_unreadable(),
    }
}

fn print(report: &Report, args: &WatchArgs, last: bool) -> anyhow::Result<()> {
    let out = std::io::stdout();
    let repaint = out.is_terminal() && !args.once && !args.json;
    let mut out = out.lock();
    let text = if args.json {
        format!("{}\n", serde_json::to_string(report)?)
    } else {
        report.to_string()
    };
    if repaint {
        // Each line clears its own remainder, which avoids flicker.
        let body = text.replace('\n', "\x1b[K\n");
        write!(out, "\x1b[H{body}\x1b[J")
    } else if args.once || args.json || last {
        write!(out, "{text}")
    } else {
        writeln!(out, "{text}")
    }
    .and_then(|()| out.flush())
    .context("writing the report")
}
