//! A Zenoh router of a test: what stands between servers and recorders on a
//! large network, and lets everybody publish everything.

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
    /// Starts a router on a free loopback port.
    ///
    /// # Panics
    /// When it cannot be started.
    #[must_use]
    pub fn start() -> Self {
        let mut child = Command::new(program("wheelarm-test-router").expect("the router"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("a router");
        let mut first = String::new();
        BufReader::new(child.stdout.as_mut().expect("a pipe"))
            .read_line(&mut first)
            .expect("a line");
        let endpoint = first.trim().strip_prefix("ready ").expect("an endpoint");
        Self {
            endpoint: endpoint.to_owned(),
            child,
        }
    }
}

impl Drop for Router {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
