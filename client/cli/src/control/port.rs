//! Whether anything listens on this host, asked of the kernel: a closed port of
//! the loopback interface is told at once, where the transport would go on
//! trying.

use std::net::{SocketAddr, TcpStream, ToSocketAddrs};
use std::time::Duration;

use wheelarm_sdk::ClientError;

/// Longest wait; the loopback interface answers within microseconds.
const PATIENCE: Duration = Duration::from_millis(500);

/// Refuses an endpoint `tcp/HOST:PORT` of this host on which nothing listens.
/// Other endpoints are the transport's matter.
///
/// # Errors
/// [`ClientError::NoServer`] with the cure.
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

/// The addresses of an endpoint, if all of them are of the loopback interface.
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
    fn a_closed_port_of_this_host_is_told_with_the_cure_and_an_open_one_is_not() {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let endpoint = format!("tcp/{}", listener.local_addr().unwrap());
        assert!(refuse_closed(&endpoint).is_ok());
        drop(listener);
        let told = refuse_closed(&endpoint).unwrap_err().to_string();
        assert!(told.contains("start one with `wheelarm-server`"), "{told}");
        // Nobody is asked on another host or through another transport.
        assert_eq!(loopback("tcp/192.0.2.1:7447"), None);
        assert_eq!(loopback("unixsock-stream/socket"), None);
    }
}
