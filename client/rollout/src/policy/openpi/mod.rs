//! Policies with the protocol of openpi or RoboArena: a WebSocket on which the server first
//! sends its metadata and then replies to each observation, a flat msgpack map with numpy
//! arrays, with rows of actions. A text frame is an error. The protocol has no batches: each
//! running episode has its own connection.
//!
//! A [`NameMap`] defines the names; nothing here depends on a robot or a network.

mod array;
mod map;

use std::io::ErrorKind;
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use parking_lot::Mutex;
use rmpv::Value;
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, HandshakeError, Message, WebSocket};
use wheelarm_policy::STATE;
use wheelarm_proto::v1;

pub use array::{Rows, rows};
pub use map::{ImageMap, NameMap, NumbersMap, Protocol};

use crate::policy::interface::{Policy, PolicyError, checked};

/// Environment variable with the API key for openpi's servers.
pub const KEY_VARIABLE: &str = "OPENPI_API_KEY";
/// Longest wait for a connection, wall time.
const CONNECT: Duration = Duration::from_secs(10);
/// Longest reply, bytes.
const LONGEST: usize = 16 << 20;
/// Most characters of a server's error message.
const WORDS: usize = 500;

/// A policy at a WebSocket.
pub struct OpenPi {
    address: String,
    map: NameMap,
    spec: v1::PolicySpec,
    patience: Duration,
    /// Idle connections.
    idle: Mutex<Vec<Socket>>,
    /// Held during a request, if requests must not overlap.
    one_by_one: Option<Mutex<()>>,
}

type Socket = WebSocket<TcpStream>;

impl OpenPi {
    /// Connects to `ws://HOST:PORT` and receives its metadata. With `one_by_one`, requests do
    /// not overlap.
    ///
    /// # Errors
    /// [`PolicyError::Start`] when no server replies, [`PolicyError::Unfit`].
    pub fn connect(
        address: &str,
        map: NameMap,
        patience: Duration,
        one_by_one: bool,
    ) -> Result<Self, PolicyError> {
        let spec = map.spec(address);
        checked(&spec)?;
        let (socket, metadata) = open(address, patience)?;
        map.suits(&metadata)?;
        Ok(Self {
            address: address.to_owned(),
            map,
            spec,
            patience,
            idle: Mutex::new(vec![socket]),
            one_by_one: one_by_one.then(Mutex::default),
        })
    }

    /// Sends a message and receives the reply.
    fn request(&self, query: &'static str, message: &Value) -> Result<Message, PolicyError> {
        let _one = self.one_by_one.as_ref().map(Mutex::lock);
        let mut bytes = Vec::new();
        rmpv::encode::write_value(&mut bytes, message)
            .map_err(|e| PolicyError::Rejected(format!("the observation cannot be sent: {e}")))?;
        let known = self.idle.lock().pop();
        let had = known.is_some();
        let mut socket = match known {
            Some(socket) => socket,
            None => open(&self.address, self.patience)?.0,
        };
        let mut reply = exchange(&mut socket, &bytes, query, self.patience);
        // The idle connection was closed by the server.
        if had && matches!(reply, Err(PolicyError::Gone(_))) {
            socket = open(&self.address, self.patience)?.0;
            reply = exchange(&mut socket, &bytes, query, self.patience);
        }
        let reply = reply?;
        // After an error the server closes the connection.
        if matches!(reply, Message::Binary(_)) || query == "reset" {
            self.idle.lock().push(socket);
        }
        Ok(reply)
    }
}

impl Policy for OpenPi {
    fn spec(&self) -> &v1::PolicySpec {
        &self.spec
    }

    fn reset(&self, request: v1::PolicyResetRequest) -> Result<(), PolicyError> {
        if self.map.protocol == Protocol::Openpi {
            return Ok(());
        }
        match self.request("reset", &self.map.reset(&request))? {
            // RoboArena's servers confirm with text; a traceback is an error.
            Message::Text(words) if words.contains("Traceback") => Err(rejected(&words)),
            Message::Text(_) | Message::Binary(_) => Ok(()),
            other => Err(garbled("reset", format!("an unexpected frame: {other}"))),
        }
    }

    fn infer(&self, observation: v1::PolicyObservation) -> Result<v1::PolicyChunk, PolicyError> {
        let message = self.map.message(&observation)?;
        let answer = match self.request("infer", &message)? {
            Message::Binary(bytes) => bytes,
            Message::Text(words) => return Err(rejected(&words)),
            other => {
                return Err(garbled("infer", format!("an unexpected frame: {other}")));
            }
        };
        let rows = rows(&answer, &self.map.answer).map_err(|e| garbled("infer", e))?;
        let rows = self.map.chosen(rows).map_err(|e| garbled("infer", e))?;
        Ok(v1::PolicyChunk {
            episode_key: observation.episode_key,
            tick: observation.tick,
            rows: rows.count as u32,
            values: rows.values,
            problem: String::new(),
        })
    }
}

fn garbled(query: &'static str, problem: String) -> PolicyError {
    PolicyError::Garbled { query, problem }
}

/// Error text of a server: the last line of a traceback.
fn rejected(words: &str) -> PolicyError {
    let last = words
        .trim()
        .lines()
        .last()
        .unwrap_or("an error without a message");
    PolicyError::Rejected(last.chars().take(WORDS).collect())
}

/// Connects and receives the metadata.
fn open(address: &str, patience: Duration) -> Result<(Socket, Value), PolicyError> {
    let failed = |words: String| PolicyError::Start(format!("{address}: {words}"));
    let mut request = address
        .into_client_request()
        .map_err(|e| failed(format!("{e}; write it as ws://HOST:PORT")))?;
    if let Ok(key) = std::env::var(KEY_VARIABLE) {
        let value = HeaderValue::from_str(&format!("Api-Key {key}"));
        let value = value.map_err(|_| failed(format!("{KEY_VARIABLE} is not a valid key")))?;
        request.headers_mut().insert("Authorization", value);
    }
    let uri = request.uri();
    if uri.scheme_str() != Some("ws") {
        return Err(failed(
            "only ws:// is supported; forward the port of a remote server with `ssh -L`".to_owned(),
        ));
    }
    let host = uri
        .host()
        .unwrap_or_default()
        .trim_matches(['[', ']'])
        .to_owned();
    let port = uri.port_u16().unwrap_or(80);
    let found = (host.as_str(), port).to_socket_addrs();
    let found: Vec<_> = found.map_err(|e| failed(e.to_string()))?.collect();
    let mut stream = Err(failed("the name has no address".to_owned()));
    for at in found {
        stream = TcpStream::connect_timeout(&at, CONNECT)
            .map_err(|e| failed(format!("{e}; is the policy's server running?")));
        if stream.is_ok() {
            break;
        }
    }
    let stream = stream?;
    let set = stream
        .set_read_timeout(Some(patience))
        .and_then(|()| stream.set_write_timeout(Some(patience)))
        .and_then(|()| stream.set_nodelay(true));
    set.map_err(|e| failed(e.to_string()))?;
    let limits = WebSocketConfig::default()
        .max_message_size(Some(LONGEST))
        .max_frame_size(Some(LONGEST));
    let shaken = tungstenite::client::client_with_config(request, stream, Some(limits));
    let (mut socket, _) = shaken.map_err(|e| match e {
        HandshakeError::Failure(e) => failed(format!("it is not a WebSocket server: {e}")),
        HandshakeError::Interrupted(_) => failed("it does not reply".to_owned()),
    })?;
    let first = receive(&mut socket, "metadata", patience).map_err(|e| failed(e.to_string()))?;
    let Message::Binary(bytes) = first else {
        return Err(failed(format!(
            "it begins with {first:?}, expected its metadata"
        )));
    };
    let metadata = array::read(&bytes).map_err(failed)?;
    Ok((socket, metadata))
}

fn exchange(
    socket: &mut Socket,
    bytes: &[u8],
    query: &'static str,
    patience: Duration,
) -> Result<Message, PolicyError> {
    let sent = socket.send(Message::binary(bytes.to_vec()));
    sent.map_err(|e| ended(e, query, patience))?;
    receive(socket, query, patience)
}

/// The next message that is not a ping or pong.
fn receive(
    socket: &mut Socket,
    query: &'static str,
    patience: Duration,
) -> Result<Message, PolicyError> {
    let deadline = Instant::now() + patience;
    loop {
        match socket.read() {
            // The library replies to a ping with the next write.
            Ok(Message::Ping(_) | Message::Pong(_)) if Instant::now() < deadline => {
                let _ = socket.flush();
            }
            Ok(Message::Ping(_) | Message::Pong(_)) => {
                let seconds = patience.as_secs_f64();
                return Err(PolicyError::Silent { query, seconds });
            }
            Ok(Message::Close(frame)) => {
                let why = frame.map_or(String::new(), |frame| frame.to_string());
                return Err(PolicyError::Gone(format!(
                    "its connection was closed {why}"
                )));
            }
            Ok(message) => return Ok(message),
            Err(e) => return Err(ended(e, query, patience)),
        }
    }
}

fn ended(error: Error, query: &'static str, patience: Duration) -> PolicyError {
    match error {
        Error::Io(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
            PolicyError::Silent {
                query,
                seconds: patience.as_secs_f64(),
            }
        }
        Error::Capacity(e) => garbled(query, e.to_string()),
        Error::Utf8(e) => garbled(query, e),
        e => PolicyError::Gone(e.to_string()),
    }
}

/// Rows of state are [`STATE`] long.
const _: () = assert!(STATE == 27);

#[cfg(test)]
mod tests;
