//! Syntax of endpoints, checked before connecting or listening.

/// Text that is not an endpoint.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
#[error(
    "{0:?} is not an endpoint: an endpoint is tcp/HOST:PORT, for example tcp/127.0.0.1:7447, \
     tls/HOST:PORT with keys, or unixsock-stream/PATH"
)]
pub struct BadEndpoint(pub String);

/// Checks the syntax of an endpoint: `tcp/HOST:PORT`, `tls/HOST:PORT` or
/// `unixsock-stream/PATH`, optionally with transport settings after `#` or `?`. Does
/// not connect.
///
/// # Errors
/// [`BadEndpoint`].
pub fn check_endpoint(text: &str) -> Result<(), BadEndpoint> {
    let bare = text.split(['#', '?']).next().unwrap_or_default();
    let fits = match bare.split_once('/') {
        Some(("tcp" | "tls", address)) => address.rsplit_once(':').is_some_and(|(host, port)| {
            let digits = port.bytes().all(|b| b.is_ascii_digit());
            let bracketed = host.starts_with('[') && host.ends_with(']');
            let named = !host.is_empty() && !host.contains(['/', ' ']);
            named && (bracketed || !host.contains(':')) && digits && port.parse::<u16>().is_ok()
        }),
        Some(("unixsock-stream", path)) => !path.is_empty(),
        _ => false,
    };
    match fits {
        true => Ok(()),
        false => Err(BadEndpoint(text.to_owned())),
    }
}

/// Whether an endpoint requires keys: its connections use TLS.
#[must_use]
pub fn is_guarded(endpoint: &str) -> bool {
    parts(endpoint).0 == "tls"
}

/// Transport of a valid endpoint, and its host or path.
#[must_use]
pub fn parts(endpoint: &str) -> (&str, &str) {
    let bare = endpoint.split(['#', '?']).next().unwrap_or_default();
    let (transport, rest) = bare.split_once('/').unwrap_or((bare, ""));
    match transport {
        "tcp" | "tls" => (
            transport,
            rest.rsplit_once(':').map_or(rest, |(host, _)| host),
        ),
        _ => (transport, rest),
    }
}

/// Whether an endpoint can only be reached from this host: a socket in the file system,
/// or an address of the loopback interface. A name other than `localhost` may be
/// remote.
#[must_use]
pub fn is_local(endpoint: &str) -> bool {
    match parts(endpoint) {
        ("unixsock-stream", _) => true,
        (_, "localhost") => true,
        (_, host) => {
            let bare = host.strip_prefix('[').and_then(|h| h.strip_suffix(']'));
            let address = bare.unwrap_or(host).parse::<std::net::IpAddr>();
            address.is_ok_and(|address| address.to_canonical().is_loopback())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn local_endpoints_are_distinguished_from_remote_ones() {
        for local in [
            "tcp/127.0.0.1:7447",
            "tls/127.9.9.9:0",
            "tcp/localhost:7447#iface=lo",
            "tls/[::1]:7447",
            "tcp/[::ffff:127.0.0.1]:7447",
            "unixsock-stream/wheelarm.socket",
        ] {
            assert!(is_local(local), "{local}");
        }
        for far in [
            "tcp/0.0.0.0:7447",
            "tls/[::]:7447",
            "tcp/192.0.2.1:7447",
            "tcp/localhost.example:7447",
            "tcp/127.0.0.1.example:7447",
        ] {
            assert!(!is_local(far), "{far}");
        }
    }

    #[test]
    fn endpoints_have_a_transport_an_address_and_a_port() {
        for good in [
            "tcp/127.0.0.1:7447",
            "tcp/localhost:0",
            "tls/sim-host:7447",
            "tcp/[::1]:7447",
            "tcp/host.example:7447#iface=eth0",
            "unixsock-stream/wheelarm.socket",
        ] {
            assert_eq!(check_endpoint(good), Ok(()));
        }
        for bad in [
            "",
            "nonsense",
            "127.0.0.1:7447",
            "tcp/127.0.0.1",
            "tcp/127.0.0.1:99999",
            "tcp/127.0.0.1:+80",
            "tcp/:7447",
            "tcp/::1:7447",
            "tls/sim-host",
            "udp/127.0.0.1:7447",
            "unixsock-stream/",
        ] {
            let message = check_endpoint(bad).unwrap_err().to_string();
            assert!(message.contains("tcp/HOST:PORT"), "{message}");
        }
    }
}
