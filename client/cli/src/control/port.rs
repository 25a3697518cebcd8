//! Detects a closed port on the loopback interface at once: the transport would retry until
//! its timeout.

use std::net::{SocketAddr, TcpStream, ToSocketAddrs};
use std::time::Duration;

use wheelarm_sdk::ClientError;

/// Longest wait; the loopback interface answers within microseconds.
const PATIENCE: Duration = Duration::from_millis(500);

/// Rejects a loopback endpoint `tcp/HOST:PORT` without a listener. Other endpoints are
/// left to the transport.
///
/// # Errors
/// [`ClientError::NoServer`] with the fix.
pub fn refuse_closed(endpoint: &str) -> Result<(), ClientError> {
    let Some(addresses) = loopback(endpoint) else {
        return Ok(());
    };
    let mut cause = None;
    for address in addresses {
        match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(_) => return Ok(()),
            Err(error) => cause = Some(error.to_string()),
        }
    }
    match cause {
        None => Ok(()),
        Some(cause) => Err(ClientError::NoServer {
            endpoint: endpoint.to_owned(),
            seconds: 0.0,
            cause,
        }),
    }
}

/// Addresses of an endpoint, if all belong to the loopback interface.
fn loopback(endpoint: &str) -> Option<Vec<SocketAddr>> {
    let rest = endpoint.strip_prefix("tcp/")?;
    let address = rest.split(['#', '?']).next().unwrap_or(rest);
    let addresses: Vec<_> = address.to_socket_addrs().ok()?.collect();
    let here = addresses.iter().all(|a| a.ip().is_loopback());
    here.then_some(addresses)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closed_loopback_port_is_an_error_with_its_fix() {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let endpoint = format!("tcp/{}", listener.local_addr().unwrap());
        assert!(refuse_closed(&endpoint).is_ok());
        drop(listener);
        let error = refuse_closed(&endpoint).unwrap_err().to_string();
        assert!(
            error.contains("start one with `wheelarm-server`"),
            "{error}"
        );
        // Other hosts and transports are not probed.
        assert_eq!(loopback("tcp/192.0.2.1:7447"), None);
        assert_eq!(loopback("unixsock-stream/socket"), None);
    }
}
