//! A client of a gateway that behaves like the page.

use std::collections::BTreeMap;
use std::net::{Shutdown, TcpStream};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread::JoinHandle;
use std::time::Duration;

use parking_lot::Mutex;
use serde_json::{Value, json};
use tungstenite::{Error, Message};
use wheelarm_tests::wait_until;

use super::gateway::{Gateway, Socket};

/// Time between two checks for messages to send.
const LOOK: Duration = Duration::from_millis(5);
/// Time between two messages of a held key.
const HOLD: Duration = Duration::from_millis(33);

/// Held input.
#[derive(Clone, Copy, Debug, Default)]
pub struct Held {
    chair: [f64; 2],
}

impl Held {
    /// Chair forward.
    pub fn forward() -> Self {
        Self { chair: [1.0, 0.0] }
    }

    /// Chair back.
    pub fn back() -> Self {
        Self { chair: [-1.0, 0.0] }
    }
}

#[derive(Default)]
struct Known {
    seq: u32,
    epoch: u32,
    held: Option<Held>,
    frozen: bool,
    painted: BTreeMap<u8, u64>,
    situation: Value,
    answers: BTreeMap<u64, Value>,
    received: Vec<Value>,
    requests: u64,
}

impl Known {
    fn message(&mut self, kind: &str, mode: &str, more: &Value) -> String {
        self.seq += 1;
        let mut message = json!({
            "t": kind, "seq": self.seq, "epoch": self.epoch,
            "shown": self.painted.values().min(), "ms": 0.0,
            "device": "keyboard", "mode": mode, "speed": 2,
        });
        if let (Value::Object(message), Value::Object(more)) = (&mut message, more) {
            message.extend(more.clone());
        }
        message.to_string()
    }
}

/// A page with its sockets.
pub struct Page {
    known: Arc<Mutex<Known>>,
    state: Sender<String>,
    lanes: Vec<Sender<String>>,
    streams: Vec<TcpStream>,
    ended: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Page {
    /// Opens all sockets that the role may open, and requests every camera.
    pub fn open(gateway: &Gateway, page: &str, operator: bool) -> Self {
        let known = Arc::new(Mutex::new(Known::default()));
        let ended = Arc::new(AtomicBool::new(false));
        let (mut streams, mut threads) = (Vec::new(), Vec::new());
        let mut open = |path: &str, lane: u8, handler: Handler| {
            let ticket = gateway.ticket(operator);
            let hello = json!({"t":"hello","protocol":1,"ticket":ticket,"page":page,"lane":lane});
            let socket = gateway.enter(path, operator, &hello).expect("a socket");
            streams.push(socket.get_ref().try_clone().expect("a stream"));
            let (sender, to_send) = mpsc::channel();
            let (known, ended) = (Arc::clone(&known), Arc::clone(&ended));
            threads.push(std::thread::spawn(move || {
                serve(socket, &to_send, &known, &ended, handler);
            }));
            sender
        };
        let state = open("/ws/state", 0, state);
        let video = open("/ws/video", 0, video);
        let lanes: Vec<_> = (0..2)
            .filter(|_| operator)
            .map(|lane| open("/ws/control", lane, |_, _| None))
            .collect();
        let opened = Self {
            known,
            state,
            lanes,
            streams,
            ended,
            threads,
        };
        wait_until("a situation", || opened.tick() > 0);
        let cameras = opened.situation()["cameras"].as_array().map_or(0, Vec::len);
        let wanted: Vec<_> = (0..cameras)
            .map(|camera| json!({"camera": camera, "width": 640}))
            .collect();
        let want = json!({"t":"want","codecs":["jpeg"],"cameras":wanted});
        video.send(want.to_string()).expect("the video socket");
        wait_until("every camera is shown", || {
            opened.known.lock().painted.len() == cameras
        });
        opened.keep_holding()
    }

    /// Sends the held input, or a sign of life.
    fn keep_holding(mut self) -> Self {
        let (known, ended) = (Arc::clone(&self.known), Arc::clone(&self.ended));
        let lanes = self.lanes.clone();
        self.threads.push(std::thread::spawn(move || {
            let mut rounds = 0_u64;
            while !ended.load(Ordering::Acquire) {
                rounds += 1;
                let message = {
                    let mut known = known.lock();
                    match known.held {
                        Some(held) => {
                            let held = json!({"chair": held.chair, "hand": [0, 0, 0],
                                "turn": [0, 0, 0], "grip": 0});
                            Some(known.message("drive", "hold", &held))
                        }
                        None if rounds.is_multiple_of(7) => {
                            Some(known.message("alive", "hold", &json!({})))
                        }
                        None => None,
                    }
                };
                if let Some(message) = message {
                    for lane in &lanes {
                        let _ = lane.send(message.clone());
                    }
                }
                std::thread::sleep(HOLD);
            }
        }));
        self
    }

    /// The newest situation.
    pub fn situation(&self) -> Value {
        self.known.lock().situation.clone()
    }

    /// Tick of the newest situation.
    pub fn tick(&self) -> u64 {
        self.situation()["tick"].as_u64().unwrap_or(0)
    }

    /// Sends a request, and waits for the answer.
    pub fn request(&mut self, what: &str, more: Value) -> Value {
        let id = {
            let mut known = self.known.lock();
            known.requests += 1;
            known.requests
        };
        let mut request = json!({"t": "ask", "id": id, "ask": what});
        if let (Value::Object(request), Value::Object(more)) = (&mut request, more) {
            request.extend(more);
        }
        self.state
            .send(request.to_string())
            .expect("the state socket");
        let mut answer = Value::Null;
        wait_until("an answer", || {
            let found = self.known.lock().answers.remove(&id);
            answer = found.unwrap_or_default();
            !answer.is_null()
        });
        answer
    }

    /// A fresh press, held from now on.
    pub fn press(&mut self, held: Held) {
        let mut known = self.known.lock();
        known.epoch += 1;
        known.held = Some(held);
    }

    /// Keeps holding, without a fresh press.
    pub fn hold_on(&mut self) {
        assert!(self.known.lock().held.is_some(), "nothing is held");
    }

    /// Holds without a fresh press.
    pub fn hold(&mut self, held: Held) {
        self.known.lock().held = Some(held);
    }

    /// Releases.
    pub fn release(&mut self) {
        for _ in 0..3 {
            let message = {
                let mut known = self.known.lock();
                known.held = None;
                known.message("drive", "hold", &json!({}))
            };
            self.say(&message);
        }
    }

    /// Presses stop.
    pub fn stop(&mut self) {
        for _ in 0..3 {
            let why = json!({"why": "person"});
            let message = self.known.lock().message("stop", "hold", &why);
            self.say(&message);
        }
    }

    /// One step.
    pub fn step(&mut self, part: &str, axis: usize, sign: i32) {
        let message = {
            let mut known = self.known.lock();
            known.epoch += 1;
            let step = json!({"part": part, "axis": axis, "sign": sign});
            known.message("step", "step", &step)
        };
        self.say(&message);
    }

    fn say(&self, message: &str) {
        for lane in &self.lanes {
            let _ = lane.send(message.to_owned());
        }
    }

    /// Number of the newest press, and of the newest message.
    pub fn epoch(&self) -> (u32, u32) {
        let known = self.known.lock();
        (known.epoch, known.seq)
    }

    /// Continues as the same page with other sockets.
    pub fn goes_on_from(&mut self, (epoch, seq): (u32, u32)) {
        let mut known = self.known.lock();
        known.epoch = epoch;
        known.seq += seq;
    }

    /// Stops painting, or starts again.
    pub fn freeze(&mut self, frozen: bool) {
        self.known.lock().frozen = frozen;
    }

    /// Cuts the connection: all messages are dropped, without a close. The sockets stay open
    /// until the page is dropped.
    pub fn cut(&self) {
        self.ended.store(true, Ordering::Release);
    }

    /// Whether an image was painted.
    pub fn has_painted(&self) -> bool {
        !self.known.lock().painted.is_empty()
    }

    /// Whether a message of this kind arrived.
    pub fn has_received(&self, kind: &str) -> bool {
        self.known
            .lock()
            .received
            .iter()
            .any(|message| message["t"] == kind)
    }

    /// Clears the received messages.
    pub fn forget_received(&mut self) {
        self.known.lock().received.clear();
    }

    /// Whether a note with these words arrived.
    pub fn was_noted(&self, words: &str) -> bool {
        let known = self.known.lock();
        let mut notes = known
            .received
            .iter()
            .filter_map(|message| message["text"].as_str());
        notes.any(|note| note.contains(words))
    }

    /// The code with which a viewer's socket is closed.
    pub fn refused_socket(&self, gateway: &Gateway, path: &str) -> Option<u16> {
        let ticket = gateway.ticket(false);
        let hello = json!({"t":"hello","protocol":1,"ticket":ticket,"page":"v1","lane":0});
        gateway.enter(path, false, &hello).err()
    }

    /// A candidate that can be taken, in the image of any camera.
    pub fn points_at_anything(&mut self) -> Option<Value> {
        let cameras: Vec<u8> = self.known.lock().painted.keys().copied().collect();
        for camera in cameras {
            for cell in 0..48 {
                let tick = self.known.lock().painted[&camera];
                let u = (f64::from(cell % 8) + 0.5) / 8.0;
                let v = (f64::from(cell / 8) + 0.5) / 6.0;
                let request = json!({"camera": camera, "tick": tick, "u": u, "v": v});
                let answer = self.request("pick", request);
                assert_eq!(answer["ok"], true, "{answer}");
                let found = &answer["candidates"][0];
                if !found.is_null() {
                    assert_eq!(found["outline"].as_array().map(Vec::len), Some(4));
                    return Some(found.clone());
                }
            }
        }
        None
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        self.cut();
        for stream in &self.streams {
            let _ = stream.shutdown(Shutdown::Both);
        }
        for thread in self.threads.drain(..) {
            // What it found wrong is wrong, unless something else failed before.
            assert!(
                thread.join().is_ok() || std::thread::panicking(),
                "a socket's thread failed"
            );
        }
    }
}

/// Handles a message; returns the answer.
type Handler = fn(&mut Known, Message) -> Option<String>;

/// Sends the queued messages and handles the received ones, until the end.
fn serve(
    mut socket: Socket,
    to_send: &Receiver<String>,
    known: &Mutex<Known>,
    ended: &AtomicBool,
    handler: Handler,
) {
    let stream = socket.get_ref();
    stream.set_read_timeout(Some(LOOK)).expect("a patience");
    while !ended.load(Ordering::Acquire) {
        for text in to_send.try_iter() {
            if socket.send(Message::Text(text.into())).is_err() {
                return;
            }
        }
        match socket.read() {
            Ok(Message::Close(_)) => return,
            Ok(message) => {
                let answer = handler(&mut known.lock(), message);
                if let Some(answer) = answer
                    && socket.send(Message::Text(answer.into())).is_err()
                {
                    return;
                }
            }
            Err(Error::Io(e))
                if matches!(
                    e.kind(),
                    std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut
                ) => {}
            Err(_) => return,
        }
    }
}

fn state(known: &mut Known, message: Message) -> Option<String> {
    let Message::Text(text) = message else {
        return None;
    };
    let message: Value = serde_json::from_str(&text).expect("JSON");
    match message["t"].as_str().unwrap_or_default() {
        "situation" => known.situation = message,
        "answer" => {
            let id = message["id"].as_u64().expect("a number");
            known.answers.insert(id, message);
        }
        _ => known.received.push(message),
    }
    None
}

fn video(known: &mut Known, message: Message) -> Option<String> {
    let Message::Binary(bytes) = message else {
        return None;
    };
    assert_eq!((bytes[0], bytes[1], bytes[2]), (1, 0, 1), "a JPEG");
    assert!(bytes[40..].starts_with(&[0xff, 0xd8, 0xff]), "no JPEG");
    let camera = bytes[3];
    let seq = u32::from_le_bytes(bytes[8..12].try_into().expect("four bytes"));
    let tick = u64::from_le_bytes(bytes[16..24].try_into().expect("eight bytes"));
    let painted = !known.frozen;
    if painted {
        known.painted.insert(camera, tick);
    }
    let ack = json!({"t": "ack", "camera": camera, "seq": seq, "painted": painted});
    Some(ack.to_string())
}

/// A recorded command.
#[derive(Debug)]
pub struct Recorded {
    /// Input device.
    pub device: String,
    /// Input mode.
    pub mode: String,
    /// Age of the state that it answers, ticks.
    pub loop_age_ticks: u64,
}

/// The commands of a file.
pub fn recorded_commands(file: &Path) -> Vec<Recorded> {
    let file = hdf5::File::open(file).expect("an episode");
    let texts = |name: &str| -> Vec<String> {
        let column = file
            .dataset(&format!("streams/command/{name}"))
            .expect(name);
        let texts: Vec<hdf5::types::VarLenUnicode> = column.read_raw().expect("texts");
        texts.iter().map(|text| text.as_str().to_owned()).collect()
    };
    let ages = file.dataset("streams/command/loop_age").expect("ages");
    let ages: Vec<f64> = ages.read_raw().expect("numbers");
    texts("device")
        .into_iter()
        .zip(texts("mode"))
        .zip(ages)
        .map(|((device, mode), age)| Recorded {
            device,
            mode,
            loop_age_ticks: if age.is_finite() { age as u64 } else { 0 },
        })
        .collect()
}
