//! The server: is its port reachable, does it speak, is it of this version,
//! how far away is it, and do the clocks agree.

use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use wheelarm_proto::v1;

use super::finding::{Finding, Level};
use wheelarm_sdk::{Client, Connect};

/// Longest wait for a port to answer.
const PORT: Duration = Duration::from_secs(2);
/// Questions from which the round trip is taken.
const QUESTIONS: usize = 10;
/// A round trip from which operating becomes hard, s.
const FAR: f64 = 0.25;
/// Clocks that differ by more are worth a word, s.
const CLOCKS: f64 = 1.0;

pub fn appearance(connect: &Connect, wanted: bool, tell: &mut dyn FnMut(Finding)) {
    let open = port(&connect.endpoint, wanted);
    let reachable = open.level == Level::Ok && open.found.contains("open");
    tell(open);
    if !reachable {
        return;
    }
    let link = match Client::open(connect) {
        Ok(link) => link,
        Err(error) => {
            tell(Finding::fail(
                "server",
                error.to_string(),
                match &connect.identity {
                    Some(_) => {
                        "the host behind tls/ must be one that `wheelarm keys init --host` was told, and the keys those of this server and not over"
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
    for _ in 0..QUESTIONS {
        let asked = Instant::now();
        match link.request(&v1::StatusRequest {}) {
            Ok(status) => {
                let trip = asked.elapsed().as_secs_f64();
                // The quickest question tells the clocks' difference best.
                if trips.iter().all(|t| trip <= *t) {
                    offset = clock_offset(&status, trip);
                }
                trips.push(trip);
                last = Some(status);
            }
            Err(error) => {
                tell(Finding::fail(
                    "server",
                    error.to_string(),
                    "look at the server's own messages; restart it",
                ));
                return;
            }
        }
    }
    let Some(status) = last else { return };
    tell(version(&link, &status));
    tell(round_trip(trips));
    if let Some(offset) = offset {
        tell(clocks(offset));
    }
    tell(load(&status));
    super::rights::appearance(connect, &link, &status, tell);
}

/// Host and port of an endpoint that is reached over TCP.
fn host_and_port(endpoint: &str) -> Option<&str> {
    let rest = endpoint
        .strip_prefix("tcp/")
        .or_else(|| endpoint.strip_prefix("tls/"))?;
    Some(rest.split(['#', '?']).next().unwrap_or(rest))
}

fn port(endpoint: &str, wanted: bool) -> Finding {
    let what = "port";
    let Some(address) = host_and_port(endpoint) else {
        return Finding::ok(what, format!("{endpoint} taken as open"));
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
    let mut problem = "no address".to_owned();
    for address in &addresses {
        match TcpStream::connect_timeout(address, PORT) {
            Ok(_) => return Finding::ok(what, format!("{address} is open")),
            Err(error) => problem = error.to_string(),
        }
    }
    let found = format!("{address}: {problem}");
    let here = addresses.iter().all(|a| a.ip().is_loopback());
    if here && !wanted {
        return Finding::ok(what, format!("{address} is free: no server runs here"));
    }
    let cure = if endpoint.starts_with("tls/") {
        "start it there with `wheelarm-server --keys DIR`, or check the firewall"
    } else if here {
        "start wheelarm-server here, or bring a remote one near: ssh -N -L 7447:127.0.0.1:7447 HOST"
    } else {
        "the server listens on 127.0.0.1 of its host: use an SSH tunnel (ssh -N -L 7447:127.0.0.1:7447 HOST), or check the firewall"
    };
    Finding::fail(what, found, cure)
}

fn version(link: &Client, status: &v1::Status) -> Finding {
    let ours = env!("CARGO_PKG_VERSION");
    let found = format!(
        "{:?} answers, version {}, draws with {}",
        link.keys().sim(),
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
    if middle <= FAR {
        Finding::ok("round trip", found)
    } else {
        Finding::warn(
            "round trip",
            found,
            "drive slowly, with small steps; a wired link or a nearer host helps",
        )
    }
}

/// The server's clock less this one's, s; `None` when it does not tell.
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
    if offset.abs() <= CLOCKS {
        Finding::ok("clocks", found)
    } else {
        Finding::warn(
            "clocks",
            found,
            "recordings are stamped in simulation time and stay right; set the clocks (chrony, timedatectl) so that dates of files and logs agree",
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
            "slower than real time: smaller or fewer pictures (--camera), --quality fast, or more cores",
        )
    } else {
        Finding::ok("speed", found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endpoints_are_taken_apart() {
        assert_eq!(host_and_port("tcp/127.0.0.1:7447"), Some("127.0.0.1:7447"));
        assert_eq!(host_and_port("tcp/[::1]:7447#iface=lo"), Some("[::1]:7447"));
        assert_eq!(host_and_port("unixsock-stream/x"), None);
    }

    #[test]
    fn a_free_port_is_well_unless_a_server_is_wanted() {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let endpoint = format!("tcp/{}", listener.local_addr().unwrap());
        assert!(port(&endpoint, true).found.contains("open"));
        drop(listener);
        assert_eq!(port(&endpoint, false).level, Level::Ok);
        let finding = port(&endpoint, true);
        assert!(finding.level == Level::Fail && finding.cure.contains("wheelarm-server"));
    }

    #[test]
    fn the_round_trip_is_the_middle_one() {
        assert!(
            round_trip(vec![0.9, 0.001, 0.002])
                .found
                .starts_with("2.0 ms")
        );
        assert_eq!(round_trip(vec![0.4; 3]).level, Level::Warn);
    }
}
