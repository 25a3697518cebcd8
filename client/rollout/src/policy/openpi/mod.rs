//! Policies that speak openpi's protocol, or RoboArena's: a WebSocket on which the
//! server first says what it is, and then answers each observation, a flat map in
//! msgpack with numpy's arrays, by rows of action. A text frame is an error. There is
//! no batch: each episode at work has a connection of its own.
//!
//! What is named how is a [`NameMap`]; nothing of a robot or a network stands here.

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
pub use map::{NameMap, NumbersMap, PictureMap, Protocol};

use crate::policy::interface::{Policy, PolicyError, checked};

/// Environment variable with a key that is sent as openpi's servers want it.
pub const KEY_VARIABLE: &str = "OPENPI_API_KEY";
/// For a server to be there, wall time.
const CONNECT: Duration = Duration::from_secs(10);
/// Longest answer, bytes.
const LONGEST: usize = 16 << 20;
/// Longest words of a server that are passed on.
const WORDS: usize = 500;

/// A policy behind a WebSocket.
pub struct OpenPi {
    address: String,
    map: NameMap,
    spec: v1::PolicySpec,
    patience: Duration,
    /// Connections at which nobody waits.
    idle: Mutex<Vec<Socket>>,
    /// Held while it is asked, where only one is to be at a time.
    one_by_one: Option<Mutex<()>>,
}

type Socket = WebSocket<TcpStream>;

impl OpenPi {
    /// Connects to `ws://HOST:PORT`, and hears what it says of itself. With
    /// `one_by_one` one observation is asked about at a time.
    ///
    /// # Errors
    /// [`PolicyError::Start`] when nobody answers there, [`PolicyError::Unfit`].
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

    /// Sends a message and hears the answer.
    fn request(&self, query: &'static str, message: &Value) -> Result<Message, PolicyError> {
        let _one = self.one_by_one.as_ref().map(Mutex::lock);
        let mut bytes = Vec::new();
        rmpv::encode::write_value(&mut bytes, message)
            .map_err(|e| PolicyError::Said(format!("the observation cannot be sent: {e}")))?;
        let known = self.idle.lock().pop();
        let had = known.is_some();
        let mut socket = match known {
            Some(socket) => socket,
            None => open(&self.address, self.patience)?.0,
        };
        let mut told = exchange(&mut socket, &bytes, query, self.patience);
        // It was closed while nobody asked.
        if had && matches!(told, Err(PolicyError::Gone(_))) {
            socket = open(&self.address, self.patience)?.0;
            told = exchange(&mut socket, &bytes, query, self.patience);
        }
        let told = told?;
        // After an error the server closes the connection.
        if matches!(told, Message::Binary(_)) || query == "reset" {
            self.idle.lock().push(socket);
        }
        Ok(told)
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
            // RoboArena's servers confirm in words; a traceback is none.
            Message::Text(words) if words.contains("Traceback") => Err(said(&words)),
            Message::Text(_) | Message::Binary(_) => Ok(()),
            other => Err(garbled(
                "reset",
                format!("a frame that is no answer: {other}"),
            )),
        }
    }

    fn infer(&self, observation: v1::PolicyObservation) -> Result<v1::PolicyChunk, PolicyError> {
        let message = self.map.message(&observation)?;
        let answer = match self.request("infer", &message)? {
            Message::Binary(bytes) => bytes,
            Message::Text(words) => return Err(said(&words)),
            other => {
                return Err(garbled(
                    "infer",
                    format!("a frame that is no answer: {other}"),
                ));
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

/// What a server says in words: of a traceback the last line.
fn said(words: &str) -> PolicyError {
    let last = words
        .trim()
        .lines()
        .last()
        .unwrap_or("an error without words");
    PolicyError::Said(last.chars().take(WORDS).collect())
}

/// Connects, and hears what the server says first.
fn open(address: &str, patience: Duration) -> Result<(Socket, Value), PolicyError> {
    let failed = |words: String| PolicyError::Start(format!("{address}: {words}"));
    let mut request = address
        .into_client_request()
        .map_err(|e| failed(format!("{e}; say it as ws://HOST:PORT")))?;
    if let Ok(key) = std::env::var(KEY_VARIABLE) {
        let value = HeaderValue::from_str(&format!("Api-Key {key}"));
        let value = value.map_err(|_| failed(format!("{KEY_VARIABLE} holds no key")))?;
        request.headers_mut().insert("Authorization", value);
    }
    let uri = request.uri();
    if uri.scheme_str() != Some("ws") {
        return Err(failed(
            "only ws:// is spoken; bring a server elsewhere here through `ssh -L`".to_owned(),
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
        HandshakeError::Failure(e) => failed(format!("it speaks no WebSocket: {e}")),
        HandshakeError::Interrupted(_) => failed("it does not answer".to_owned()),
    })?;
    let first = heard(&mut socket, "metadata", patience).map_err(|e| failed(e.to_string()))?;
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
    heard(socket, query, patience)
}

/// The next message that is for us.
fn heard(
    socket: &mut Socket,
    query: &'static str,
    patience: Duration,
) -> Result<Message, PolicyError> {
    let deadline = Instant::now() + patience;
    loop {
        match socket.read() {
            // Answered by the library with the next write.
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
