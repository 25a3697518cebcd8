//! Checks of the server: open port, reply, version, round trip, clock offset and load.

use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use wheelarm_proto::v1;

use super::finding::{Finding, Level};
use wheelarm_sdk::{Client, Connect};

/// Longest wait for a TCP connection.
const PORT_PATIENCE: Duration = Duration::from_secs(2);
/// Requests from which the round trip is measured.
const REQUESTS: usize = 10;
/// Round trip above which driving becomes hard, s.
const SLOW_ROUND_TRIP: f64 = 0.25;
/// Clock offset above which a warning is printed, s.
const CLOCK_OFFSET: f64 = 1.0;

pub fn inspect(connect: &Connect, required: bool, report: &mut dyn FnMut(Finding)) {
    let open = port(&connect.endpoint, required);
    let reachable = open.level == Level::Ok && open.found.contains("open");
    report(open);
    if !reachable {
        return;
    }
    let client = match Client::open(connect) {
        Ok(client) => client,
        Err(error) => {
            report(Finding::fail(
                "server",
                error.to_string(),
                match &connect.identity {
                    Some(_) => {
                        "the host after tls/ must be one that `wheelarm keys init --host` named, and the keys must be of this server and not expired"
                    }
                    None => {
                        "another program may hold the port: start the server with --listen tcp/127.0.0.1:PORT and name it with --connect"
                    }
                },
            ));
            return;
        }
    };
    let mut trips = Vec::new();
    let mut offset = None;
    let mut last = None;
    for _ in 0..REQUESTS {
        let sent = Instant::now();
        match client.request(&v1::StatusRequest {}) {
            Ok(status) => {
                let trip = sent.elapsed().as_secs_f64();
                // The fastest request bounds the clock offset best.
                if trips.iter().all(|t| trip <= *t) {
                    offset = clock_offset(&status, trip);
                }
                trips.push(trip);
                last = Some(status);
            }
            Err(error) => {
                report(Finding::fail(
                    "server",
                    error.to_string(),
                    "read the server's log; restart it",
                ));
                return;
            }
        }
    }
    let Some(status) = last else { return };
    report(version(&client, &status));
    report(round_trip(trips));
    if let Some(offset) = offset {
        report(clocks(offset));
    }
    report(load(&status));
    super::rights::inspect(connect, &client, &status, report);
}

/// Host and port of an endpoint that is reached over TCP.
fn host_and_port(endpoint: &str) -> Option<&str> {
    let rest = endpoint
        .strip_prefix("tcp/")
        .or_else(|| endpoint.strip_prefix("tls/"))?;
    Some(rest.split(['#', '?']).next().unwrap_or(rest))
}

fn port(endpoint: &str, required: bool) -> Finding {
    let what = "port";
    let Some(address) = host_and_port(endpoint) else {
        return Finding::ok(what, format!("{endpoint} is assumed open"));
    };
    let addresses: Vec<_> = match address.to_socket_addrs() {
        Ok(addresses) => addresses.collect(),
        Err(error) => {
            return Finding::fail(
                what,
                format!("{address}: {error}"),
                "check the name after --connect; its form is tcp/HOST:PORT or tls/HOST:PORT",
            );
        }
    };
    let mut problem = "the name has no address".to_owned();
    for address in &addresses {
        match TcpStream::connect_timeout(address, PORT_PATIENCE) {
            Ok(_) => return Finding::ok(what, format!("{address} is open")),
            Err(error) => problem = error.to_string(),
        }
    }
    let found = format!("{address}: {problem}");
    let here = addresses.iter().all(|a| a.ip().is_loopback());
    if here && !required {
        return Finding::ok(what, format!("{address} is free: no server runs here"));
    }
    let cure = if endpoint.starts_with("tls/") {
        "start it there with `wheelarm-server --keys DIR`, or check the firewall"
    } else if here {
        "start wheelarm-server here, or forward the port of a remote one: ssh -N -L 7447:127.0.0.1:7447 HOST"
    } else {
        "the server listens on 127.0.0.1 of its host: use an SSH tunnel (ssh -N -L 7447:127.0.0.1:7447 HOST), or check the firewall"
    };
    Finding::fail(what, found, cure)
}

fn version(client: &Client, status: &v1::Status) -> Finding {
    let ours = env!("CARGO_PKG_VERSION");
    let found = format!(
        "{:?} replies, version {}, renders with {}",
        client.keys().sim(),
        status.version,
        if status.adapter.is_empty() {
            "nothing (no cameras)"
        } else {
            &status.adapter
        }
    );
    if status.version == ours {
        Finding::ok("server", found)
    } else {
        Finding::fail(
            "server",
            format!("{found}; this program is {ours}"),
            "run the same version at both ends",
        )
    }
}

fn round_trip(mut trips: Vec<f64>) -> Finding {
    trips.sort_by(f64::total_cmp);
    let at = |share: f64| trips[((trips.len() - 1) as f64 * share).round() as usize];
    let (least, middle, greatest) = (at(0.0), at(0.5), at(1.0));
    let found = format!(
        "{:.1} ms (least {:.1}, greatest {:.1})",
        middle * 1e3,
        least * 1e3,
        greatest * 1e3
    );
    if middle <= SLOW_ROUND_TRIP {
        Finding::ok("round trip", found)
    } else {
        Finding::warn(
            "round trip",
            found,
            "drive slowly, with small steps; a wired link or a nearer host helps",
        )
    }
}

/// Server clock minus local clock, s; `None` when the server does not send its clock.
fn clock_offset(status: &v1::Status, trip: f64) -> Option<f64> {
    if status.unix_nanos == 0 {
        return None;
    }
    let here = SystemTime::now().duration_since(UNIX_EPOCH).ok()?;
    let sent = here.as_secs_f64() - trip / 2.0;
    Some(status.unix_nanos as f64 * 1e-9 - sent)
}

fn clocks(offset: f64) -> Finding {
    let found = format!("the server's is {:+.3} s from this one", offset);
    if offset.abs() <= CLOCK_OFFSET {
        Finding::ok("clocks", found)
    } else {
        Finding::warn(
            "clocks",
            found,
            "recordings use simulation time and stay correct; synchronize the clocks (chrony, timedatectl) so that dates of files and logs agree",
        )
    }
}

fn load(status: &v1::Status) -> Finding {
    let factor = status.real_time_factor;
    let paced = status
        .scenario
        .as_ref()
        .is_some_and(|s| s.pacing() == v1::Pacing::RealTime);
    let found = format!("{factor:.2} simulated s per s");
    if paced && !status.paused && status.waiting_for.is_empty() && factor < 0.9 {
        Finding::warn(
            "speed",
            found,
            "slower than real time: use smaller or fewer images (--camera), --quality fast, or more cores",
        )
    } else {
        Finding::ok("speed", found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn host_and_port_are_parsed_from_an_endpoint() {
        assert_eq!(host_and_port("tcp/127.0.0.1:7447"), Some("127.0.0.1:7447"));
        assert_eq!(host_and_port("tcp/[::1]:7447#iface=lo"), Some("[::1]:7447"));
        assert_eq!(host_and_port("unixsock-stream/x"), None);
    }

    #[test]
    fn free_port_is_ok_unless_a_server_is_required() {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let endpoint = format!("tcp/{}", listener.local_addr().unwrap());
        assert!(port(&endpoint, true).found.contains("open"));
        drop(listener);
        assert_eq!(port(&endpoint, false).level, Level::Ok);
        let finding = port(&endpoint, true);
        assert!(finding.level == Level::Fail && finding.cure.contains("wheelarm-server"));
    }

    #[test]
    fn round_trip_is_the_median() {
        assert!(
            round_trip(vec![0.9, 0.001, 0.002])
                .found
                .starts_with("2.0 ms")
        );
        assert_eq!(round_trip(vec![0.4; 3]).level, Level::Warn);
    }
}
