//! The form of an endpoint, checked before anything connects or listens.

/// What is no endpoint.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
#[error(
    "{0:?} is no endpoint: an endpoint is tcp/HOST:PORT, for example tcp/127.0.0.1:7447, \
     or unixsock-stream/PATH"
)]
pub struct BadEndpoint(pub String);

/// Checks the form of an endpoint: `tcp/HOST:PORT` or `unixsock-stream/PATH`, with
/// the transport's settings behind `#` or `?` if there are any. Whether somebody
/// listens there is not asked.
///
/// # Errors
/// [`BadEndpoint`].
pub fn check_endpoint(text: &str) -> Result<(), BadEndpoint> {
    let bare = text.split(['#', '?']).next().unwrap_or_default();
    let fits = match bare.split_once('/') {
        Some(("tcp", address)) => address.rsplit_once(':').is_some_and(|(host, port)| {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endpoints_have_a_transport_an_address_and_a_port() {
        for good in [
            "tcp/127.0.0.1:7447",
            "tcp/localhost:0",
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
            "udp/127.0.0.1:7447",
            "unixsock-stream/",
        ] {
            let told = check_endpoint(bad).unwrap_err().to_string();
            assert!(told.contains("tcp/HOST:PORT"), "{told}");
        }
    }
}
