//! A TCP proxy on loopback that simulates a bad network: delay, bandwidth, and a line that
//! can be frozen or cut.

use std::collections::VecDeque;
use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use parking_lot::{Condvar, Mutex};

/// State of the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line {
    /// Bytes pass.
    Open,
    /// Bytes stop without an error.
    Frozen,
    /// Bytes of the client arrive; bytes to the client stop.
    Deaf,
    /// Connections are closed and refused.
    Cut,
}

/// Most bytes in flight in one direction; then the sender waits, as for a TCP window.
const IN_FLIGHT: usize = 256 << 10;
/// States that stop the bytes to the server, and to the client.
const FROZEN: [&[Line]; 2] = [&[Line::Frozen], &[Line::Frozen, Line::Deaf]];
/// Time between two checks of the line by a waiting thread.
const POLL: Duration = Duration::from_millis(5);

struct Shared {
    line: Mutex<Line>,
    bits_per_second: f64,
    delay: Duration,
    open: Mutex<Vec<TcpStream>>,
    ended: AtomicBool,
}

/// A proxy; ends when dropped.
pub struct Proxy {
    shared: Arc<Shared>,
    port: u16,
}

impl Proxy {
    /// A proxy in front of `endpoint` (`tcp/HOST:PORT`) with a delay in each
    /// direction.
    ///
    /// # Errors
    /// When no port is free.
    pub fn start(endpoint: &str, delay: Duration, bits_per_second: f64) -> anyhow::Result<Self> {
        let target = endpoint.trim_start_matches("tcp/").to_owned();
        let listener = TcpListener::bind("127.0.0.1:0")?;
        let port = listener.local_addr()?.port();
        let shared = Arc::new(Shared {
            line: Mutex::new(Line::Open),
            bits_per_second,
            delay,
            open: Mutex::default(),
            ended: AtomicBool::new(false),
        });
        let accepting = Arc::clone(&shared);
        std::thread::spawn(move || {
            for client in listener.incoming().map_while(Result::ok) {
                if accepting.ended.load(Ordering::Acquire) {
                    return;
                }
                if accepting.line() == Line::Cut {
                    continue;
                }
                if let Ok(server) = TcpStream::connect(&target) {
                    accepting.carry(client, server);
                }
            }
        });
        Ok(Self { shared, port })
    }

    /// Endpoint to connect to.
    #[must_use]
    pub fn endpoint(&self) -> String {
        format!("tcp/127.0.0.1:{}", self.port)
    }

    /// Changes the state of the line.
    pub fn set(&self, line: Line) {
        *self.shared.line.lock() = line;
        if line == Line::Cut {
            self.shared.tear_down();
        }
    }
}

impl Drop for Proxy {
    fn drop(&mut self) {
        self.shared.ended.store(true, Ordering::Release);
        self.shared.tear_down();
        // Wakes the thread that accepts.
        let _ = TcpStream::connect(("127.0.0.1", self.port));
    }
}

/// One direction: pieces with the time at which they arrive.
#[derive(Default)]
struct Pipe {
    state: Mutex<PipeState>,
    changed: Condvar,
}

#[derive(Default)]
struct PipeState {
    pieces: VecDeque<(Instant, Vec<u8>)>,
    bytes: usize,
    closed: bool,
}

impl Shared {
    fn line(&self) -> Line {
        *self.line.lock()
    }

    fn tear_down(&self) {
        for stream in self.open.lock().drain(..) {
            let _ = stream.shutdown(Shutdown::Both);
        }
    }

    fn carry(self: &Arc<Self>, client: TcpStream, server: TcpStream) {
        for stream in [&client, &server] {
            let _ = stream.set_nodelay(true);
            if let Ok(copy) = stream.try_clone() {
                self.open.lock().push(copy);
            }
        }
        let pairs = [
            (client.try_clone(), server.try_clone()),
            (Ok(server), Ok(client)),
        ];
        for ((from, to), frozen) in pairs.into_iter().zip(FROZEN) {
            let (Ok(from), Ok(to)) = (from, to) else {
                continue;
            };
            let pipe = Arc::new(Pipe::default());
            let (shared, end) = (Arc::clone(self), Arc::clone(&pipe));
            std::thread::spawn(move || shared.read(from, &end));
            let shared = Arc::clone(self);
            std::thread::spawn(move || shared.write(to, &pipe, frozen));
        }
    }

    fn read(&self, mut from: TcpStream, pipe: &Pipe) {
        let mut piece = [0; 8192];
        let mut free = Instant::now();
        while let Ok(length @ 1..) = from.read(&mut piece) {
            let takes = Duration::from_secs_f64(length as f64 * 8.0 / self.bits_per_second);
            free = free.max(Instant::now()) + takes;
            let mut state = pipe.state.lock();
            while state.bytes > IN_FLIGHT && !state.closed {
                pipe.changed.wait(&mut state);
            }
            if state.closed {
                break;
            }
            state.bytes += length;
            state
                .pieces
                .push_back((free + self.delay, piece[..length].to_vec()));
            pipe.changed.notify_all();
        }
        pipe.state.lock().closed = true;
        pipe.changed.notify_all();
    }

    fn write(&self, mut to: TcpStream, pipe: &Pipe, frozen: &[Line]) {
        loop {
            let (due, piece) = {
                let mut state = pipe.state.lock();
                let is_idle = |s: &mut PipeState| s.pieces.is_empty() && !s.closed;
                pipe.changed.wait_while(&mut state, is_idle);
                let Some(next) = state.pieces.pop_front() else {
                    break;
                };
                state.bytes -= next.1.len();
                pipe.changed.notify_all();
                next
            };
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
            while frozen.contains(&self.line()) && !self.ended.load(Ordering::Acquire) {
                std::thread::sleep(POLL);
            }
            if self.line() == Line::Cut || to.write_all(&piece).is_err() {
                break;
            }
        }
        pipe.state.lock().closed = true;
        pipe.changed.notify_all();
        let _ = to.shutdown(Shutdown::Both);
    }
}
