//! Routers of a test, between servers and recorders as on a large network.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};

use crate::program;

/// A router process; killed when dropped.
#[derive(Debug)]
pub struct Router {
    child: Child,
    /// Endpoint to connect to.
    pub endpoint: String,
}

impl Router {
    /// Starts a router on a free loopback port with all rights for every client.
    ///
    /// # Panics
    /// When it cannot be started.
    #[must_use]
    pub fn start() -> Self {
        let router = program("wheelarm-test-router").expect("the router");
        Self::of(&mut Command::new(router)).expect("a router that serves")
    }

    /// Starts `wheelarm router` with a folder of keys on a free loopback port.
    ///
    /// # Panics
    /// When it cannot be started.
    #[must_use]
    pub fn start_with_keys(keys: &str) -> Self {
        // Another process may take the port between its choice and its use.
        let started = (0..10).find_map(|_| {
            let free = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
            let endpoint = format!("tls/{}", free.local_addr().expect("an address"));
            drop(free);
            let clients = program("wheelarm").expect("the clients");
            let args = ["router", "--keys", keys, "--listen", &endpoint];
            Self::of(Command::new(clients).args(args))
        });
        started.expect("a router that serves")
    }

    /// The router process of `program`; `None` when it ends before it prints its endpoint.
    fn of(program: &mut Command) -> Option<Self> {
        let mut child = program
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("a router");
        let mut first = String::new();
        BufReader::new(child.stdout.as_mut().expect("a pipe"))
            .read_line(&mut first)
            .expect("a line");
        let endpoint = first.trim().strip_prefix("ready ").unwrap_or_default();
        let router = Self {
            endpoint: endpoint.to_owned(),
            child,
        };
        (!router.endpoint.is_empty()).then_some(router)
    }
}

impl Drop for Router {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
