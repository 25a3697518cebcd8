//! Messages of a page, as `PROTOCOL.md` specifies: parsed with limits, never trusted.
//! Unknown fields and kinds are ignored, so that a page may be newer.

use std::sync::LazyLock;

use serde::Deserialize;
use wheelarm_proto::{check, v1};

/// Version of the protocol.
pub const PROTOCOL: u32 = 1;
/// Longest message of a page, bytes.
pub const MOST_BYTES: usize = 4096;

/// The first message of every socket.
#[derive(Clone, Debug, Deserialize)]
pub struct Hello {
    /// `hello`.
    pub t: String,
    /// Version of the page's protocol.
    pub protocol: u32,
    /// Single-use ticket.
    pub ticket: String,
    /// Random identifier that the page generated when it was loaded.
    pub page: String,
    /// Which of the two control sockets, 0 or 1.
    #[serde(default)]
    pub lane: u8,
}

/// Part of the robot that a step moves.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// The chair: forward, left turn.
    Chair,
    /// The hand's position: forward, left, up.
    Hand,
    /// The hand's turn about its own axes.
    Turn,
    /// The fingers.
    Grip,
}

/// Motion of the person's controller since the clutch was engaged, in axes of the chair.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
pub struct Clutch {
    /// Forward, left, up, m.
    #[serde(rename = "move")]
    pub moved: [f64; 3],
    /// Quaternion x, y, z, w.
    pub turn: [f64; 4],
}

/// Action of the person.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// What is held, -1 to 1 each.
    Drive(Held),
    /// One step.
    Step {
        /// Part that moves.
        part: Part,
        /// Index of the axis.
        axis: usize,
        /// 1 or -1.
        sign: f64,
    },
    /// Everything stops.
    Stop,
    /// No action; shows that the page is alive.
    Alive,
}

impl Action {
    /// Whether it moves the robot.
    #[must_use]
    pub fn moves(&self) -> bool {
        match self {
            Self::Drive(held) => !held.is_rest(),
            Self::Step { .. } => true,
            Self::Stop | Self::Alive => false,
        }
    }
}

/// Held inputs, -1 to 1 each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Held {
    /// Forward, left turn.
    pub chair: [f64; 2],
    /// Forward, left, up.
    pub hand: [f64; 3],
    /// Roll, pitch, yaw about the tool's own axes.
    pub turn: [f64; 3],
    /// 1 opens, -1 closes.
    pub grip: f64,
    /// A tracked controller.
    pub clutch: Option<Clutch>,
}

impl Held {
    /// Whether no input is held.
    #[must_use]
    pub fn is_rest(&self) -> bool {
        *self == Self::default()
    }
}

/// A message on a control socket.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intent {
    /// Counts up over both lanes.
    pub seq: u32,
    /// Counts up at every fresh press.
    pub epoch: u32,
    /// Tick of the newest painted image.
    pub shown: Option<u64>,
    /// The page's own clock, ms.
    pub ms: f64,
    /// Input device.
    pub device: v1::Device,
    /// How the input becomes motion.
    pub mode: v1::InputMode,
    /// The person's speed, 1 to 5.
    pub speed: u8,
    /// Requested action.
    pub action: Action,
}

#[derive(Deserialize)]
struct RawIntent {
    t: String,
    seq: u32,
    epoch: u32,
    shown: Option<u64>,
    #[serde(default)]
    ms: f64,
    #[serde(default)]
    device: String,
    #[serde(default)]
    mode: String,
    #[serde(default = "middle")]
    speed: u8,
    #[serde(default)]
    chair: [f64; 2],
    #[serde(default)]
    hand: [f64; 3],
    #[serde(default)]
    turn: [f64; 3],
    #[serde(default)]
    grip: f64,
    clutch: Option<Clutch>,
    part: Option<Part>,
    #[serde(default)]
    axis: usize,
    #[serde(default)]
    sign: f64,
}

/// Default number of recorders: an episode started by a person is recorded.
fn one() -> u32 {
    1
}

fn middle() -> u8 {
    3
}

/// Reason for rejecting a message; sent to the page.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Unreadable(pub String);

impl Intent {
    /// Parses a message of a control socket; `None` for an unknown kind.
    ///
    /// # Errors
    /// [`Unreadable`] when the message violates the protocol.
    pub fn read(text: &str) -> Result<Option<Self>, Unreadable> {
        let raw: RawIntent = read(text)?;
        let finite = |values: &[f64]| values.iter().all(|v| v.is_finite() && v.abs() <= 1.0);
        let action = match raw.t.as_str() {
            "drive" => {
                let single = [raw.grip];
                let held: [&[f64]; 4] = [&raw.chair, &raw.hand, &raw.turn, &single];
                if !held.iter().all(|values| finite(values)) {
                    return Err(Unreadable("held inputs must be -1 to 1".to_owned()));
                }
                if let Some(clutch) = &raw.clutch {
                    let far = clutch
                        .moved
                        .iter()
                        .any(|m| !(0.0..=10.0).contains(&m.abs()));
                    let norm: f64 = clutch.turn.iter().map(|q| q * q).sum();
                    if far || !(0.25..4.0).contains(&norm) {
                        let words =
                            "clutch.move must be within 10 m and clutch.turn a unit quaternion";
                        return Err(Unreadable(words.to_owned()));
                    }
                }
                Action::Drive(Held {
                    chair: raw.chair,
                    hand: raw.hand,
                    turn: raw.turn,
                    grip: raw.grip,
                    clutch: raw.clutch,
                })
            }
            "step" => {
                let part = raw.part.ok_or_else(|| {
                    Unreadable("a step needs its part: chair, hand, turn or grip".to_owned())
                })?;
                let axes = match part {
                    Part::Chair => 2,
                    Part::Hand | Part::Turn => 3,
                    Part::Grip => 1,
                };
                if raw.axis >= axes || raw.sign.abs() != 1.0 {
                    let words = format!("a step needs an axis below {axes} and a sign of 1 or -1");
                    return Err(Unreadable(words));
                }
                Action::Step {
                    part,
                    axis: raw.axis,
                    sign: raw.sign,
                }
            }
            "stop" => Action::Stop,
            "alive" => Action::Alive,
            _ => return Ok(None),
        };
        // A stop or a release is accepted with any device name.
        if action.moves() {
            check_named("device", &DEVICES, device_word, &raw.device)?;
            check_named("mode", &MODES, mode_word, &raw.mode)?;
        }
        Ok(Some(Self {
            seq: raw.seq,
            epoch: raw.epoch,
            shown: raw.shown,
            ms: if raw.ms.is_finite() { raw.ms } else { 0.0 },
            device: named(&DEVICES, device_word, &raw.device),
            mode: named(&MODES, mode_word, &raw.mode),
            speed: raw.speed.clamp(1, 5),
            action,
        }))
    }
}

/// Parses any message of a page.
///
/// # Errors
/// [`Unreadable`] with the reason.
pub fn read<'a, T: Deserialize<'a>>(text: &'a str) -> Result<T, Unreadable> {
    serde_json::from_str(text).map_err(|e| Unreadable(format!("the message cannot be read: {e}")))
}

/// Values of an enum of the contract that `accepts` names, in the order of their numbers.
fn values<T: TryFrom<i32> + Copy>(accepts: fn(T) -> bool) -> Vec<T> {
    let all = (0..1024).filter_map(|number| T::try_from(number).ok());
    all.filter(|value| accepts(*value)).collect()
}

/// Devices with which a person drives the page; [`word`] gives their names.
static DEVICES: LazyLock<Vec<v1::Device>> = LazyLock::new(|| values(is_on_the_page));

/// Names every device: a new one does not compile until it is decided whether the page has it.
fn is_on_the_page(device: v1::Device) -> bool {
    use v1::Device;
    match device {
        Device::Keyboard
        | Device::Mouse
        | Device::Touch
        | Device::Gamepad
        | Device::Switch
        | Device::Dwell
        | Device::Voice
        | Device::Vr => true,
        Device::Unspecified
        | Device::Script
        | Device::Policy
        | Device::Replay
        | Device::Program => false,
    }
}

/// Modes of the page.
static MODES: LazyLock<Vec<v1::InputMode>> = LazyLock::new(|| values(is_a_mode_of_the_page));

/// Names every mode, as [`is_on_the_page`] every device.
fn is_a_mode_of_the_page(mode: v1::InputMode) -> bool {
    use v1::InputMode;
    match mode {
        InputMode::Hold | InputMode::Latch | InputMode::Step | InputMode::Stream => true,
        InputMode::Unspecified | InputMode::Goal => false,
    }
}

/// The word of an enum value in the page's messages: its name in the contract without the
/// prefix of the enum, in lower case.
fn word(prefix: &str, name: &'static str) -> String {
    name.trim_start_matches(prefix).to_ascii_lowercase()
}

fn device_word(device: v1::Device) -> String {
    word("DEVICE_", device.as_str_name())
}

fn mode_word(mode: v1::InputMode) -> String {
    word("INPUT_MODE_", mode.as_str_name())
}

/// The value of a word, the default when it is unknown.
fn named<T: Copy + Default>(known: &[T], word_of: fn(T) -> String, word: &str) -> T {
    let found = known.iter().find(|value| word_of(**value) == word);
    found.copied().unwrap_or_default()
}

/// Rejects an unknown word in a message that moves the robot.
fn check_named<T: Copy>(
    what: &str,
    known: &[T],
    word_of: fn(T) -> String,
    word: &str,
) -> Result<(), Unreadable> {
    let names: Vec<String> = known.iter().map(|value| word_of(*value)).collect();
    if names.iter().any(|name| name == word) {
        return Ok(());
    }
    let words = format!(
        "unknown {what} {:?}: use {}",
        check::beginning(word),
        names.join(", ")
    );
    Err(Unreadable(words))
}

/// A camera that a page shows.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
pub struct WantedCamera {
    /// Index among the cameras.
    pub camera: usize,
    /// Width that the page can show, pixels.
    pub width: u32,
}

/// A message on the video socket.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(tag = "t", rename_all = "snake_case")]
pub enum Viewing {
    /// Cameras to send from now on.
    Want {
        /// Codecs in order of preference.
        #[serde(default)]
        codecs: Vec<String>,
        /// Cameras.
        cameras: Vec<WantedCamera>,
    },
    /// Acknowledges the images of a camera up to `seq`.
    Ack {
        /// Index of the camera.
        camera: usize,
        /// Newest sequence number.
        seq: u32,
        /// Whether it was painted.
        #[serde(default)]
        painted: bool,
    },
    /// Requests a key frame.
    Key {
        /// Index of the camera.
        camera: usize,
    },
    /// An unknown kind.
    #[serde(other)]
    Unknown,
}

/// A request on the state socket, with its number.
#[derive(Clone, Debug, Deserialize, PartialEq)]
pub struct Request {
    /// Repeated in the answer.
    pub id: u64,
    /// The request.
    #[serde(flatten)]
    pub kind: RequestKind,
}

/// Requests of a page.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(tag = "ask")]
pub enum RequestKind {
    /// Requests control, if it is free.
    #[serde(rename = "lease.ask")]
    LeaseRequest,
    /// Takes control from its holder.
    #[serde(rename = "lease.take")]
    LeaseTake,
    /// Gives up control.
    #[serde(rename = "lease.give")]
    LeaseGive {
        /// User to whom it is offered.
        to: Option<String>,
    },
    /// Lists the tasks.
    #[serde(rename = "tasks")]
    Tasks,
    /// Sets up a scenario.
    #[serde(rename = "scene.reset")]
    Reset {
        /// Task.
        task: String,
        /// Seed.
        #[serde(default)]
        seed: u64,
    },
    /// Starts an episode.
    #[serde(rename = "episode.start")]
    Start {
        /// File label; the scenario's when empty.
        #[serde(default)]
        label: String,
        /// Instruction; the scenario's when empty.
        #[serde(default)]
        instruction: String,
        /// Recorders that must be ready; 0 is practice.
        #[serde(default = "one")]
        recorders: u32,
    },
    /// Ends and keeps the episode.
    #[serde(rename = "episode.finish")]
    Finish,
    /// Discards the episode.
    #[serde(rename = "episode.discard")]
    Discard,
    /// Discards the episode and starts it again.
    #[serde(rename = "episode.redo")]
    Redo,
    /// Pauses the simulation.
    #[serde(rename = "time.pause")]
    Pause,
    /// Resumes the simulation.
    #[serde(rename = "time.resume")]
    Resume,
    /// Finds the object at a pixel.
    #[serde(rename = "pick")]
    Pick {
        /// Index of the camera.
        camera: usize,
        /// Tick of the image.
        tick: u64,
        /// From the left edge, 0 to 1.
        u: f64,
        /// From the upper edge, 0 to 1.
        v: f64,
    },
    /// Starts a skill.
    #[serde(rename = "goal.start")]
    GoalStart {
        /// Candidate of a pick.
        candidate: String,
        /// `near`, `take`, `put`, or `turn` for the candidate `task`.
        action: String,
    },
    /// Ends the skill.
    #[serde(rename = "goal.cancel")]
    GoalCancel,
    /// An unknown request.
    #[serde(other)]
    Unknown,
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRIVE: &str = r#"{"t":"drive","seq":41,"epoch":7,"shown":5012,"ms":81234.5,
        "device":"keyboard","mode":"hold","speed":3,"chair":[1,0],"hand":[0,0,0],"turn":[0,0,0],"grip":0}"#;

    #[test]
    fn the_examples_of_the_protocol_are_parsed() {
        let intent = Intent::read(DRIVE).unwrap().unwrap();
        assert_eq!(
            (intent.seq, intent.epoch, intent.shown),
            (41, 7, Some(5012))
        );
        assert_eq!(intent.device, v1::Device::Keyboard);
        let Action::Drive(held) = intent.action else {
            panic!("{intent:?}");
        };
        assert_eq!(held.chair, [1.0, 0.0]);
        let step = r#"{"t":"step","seq":42,"epoch":8,"shown":null,"ms":1,"device":"switch",
            "mode":"step","speed":3,"part":"hand","axis":2,"sign":1}"#;
        let step = Intent::read(step).unwrap().unwrap();
        let expected = Action::Step {
            part: Part::Hand,
            axis: 2,
            sign: 1.0,
        };
        assert_eq!((step.action, step.shown), (expected, None));
        let vr = r#"{"t":"drive","seq":43,"epoch":9,"shown":5016,"device":"vr","mode":"stream",
            "speed":3,"chair":[0,0],"grip":-1,"clutch":{"move":[0.012,0,0.004],"turn":[0,0,0,1]}}"#;
        assert!(matches!(
            Intent::read(vr).unwrap().unwrap().action,
            Action::Drive(Held {
                clutch: Some(_),
                ..
            })
        ));
        let ask = r#"{"t":"ask","id":9,"ask":"pick","camera":0,"tick":5012,"u":0.52,"v":0.31}"#;
        let ask: Request = read(ask).unwrap();
        assert!(
            matches!(ask.kind, RequestKind::Pick { tick: 5012, .. }),
            "{ask:?}"
        );
        let newer: Request = read(r#"{"t":"ask","id":1,"ask":"sing","song":2}"#).unwrap();
        assert_eq!(newer.kind, RequestKind::Unknown);
        let want = r#"{"t":"want","codecs":["h264","jpeg"],"cameras":[{"camera":0,"width":1280}]}"#;
        assert!(matches!(read(want).unwrap(), Viewing::Want { .. }));
        assert_eq!(
            read::<Viewing>(r#"{"t":"zoom"}"#).unwrap(),
            Viewing::Unknown
        );
        assert_eq!(Intent::read(r#"{"t":"wave","seq":1,"epoch":1}"#), Ok(None));
    }

    #[test]
    fn the_protocol_lists_every_device_and_mode() {
        let text = include_str!("../PROTOCOL.md");
        let devices: Vec<String> = DEVICES.iter().map(|d| device_word(*d)).collect();
        let modes: Vec<String> = MODES.iter().map(|m| mode_word(*m)).collect();
        for words in [devices.join(" "), modes.join(" ")] {
            assert!(
                text.contains(&format!("`{words}`")),
                "PROTOCOL.md lacks `{words}`"
            );
        }
    }

    #[test]
    fn the_page_names_every_device_in_its_scripts() {
        let page = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("page");
        let mut scripts = std::fs::read_to_string(page.join("page.js")).unwrap();
        for folder in ["logic", "parts", "xr"] {
            for entry in std::fs::read_dir(page.join(folder)).unwrap() {
                scripts += &std::fs::read_to_string(entry.unwrap().path()).unwrap();
            }
        }
        for device in DEVICES.iter() {
            let word = device_word(*device);
            assert!(
                scripts.contains(&format!("\"{word}\"")),
                "no script in client/teleop/web/page sends the device {word:?}"
            );
        }
    }

    #[test]
    fn an_unknown_device_or_mode_moves_nothing_and_may_stop() {
        let message = |kind: &str, chair: i32, device: &str, mode: &str| {
            let text = format!(
                r#"{{"t":"{kind}","seq":1,"epoch":1,"chair":[{chair},0],"part":"chair","sign":1,
                    "device":"{device}","mode":"{mode}"}}"#
            );
            Intent::read(&text)
        };
        for (device, mode) in [("mind", "hold"), ("", "hold"), ("keyboard", "fly")] {
            for (kind, chair) in [("drive", 1), ("step", 0)] {
                let error = message(kind, chair, device, mode).unwrap_err().to_string();
                assert!(error.contains("unknown"), "{error}");
            }
            for kind in ["stop", "alive", "drive"] {
                assert!(
                    message(kind, 0, device, mode).is_ok(),
                    "{kind} {device} {mode}"
                );
            }
        }
        assert!(message("drive", 1, "keyboard", "hold").is_ok());
        let without = r#"{"t":"drive","seq":1,"epoch":1,"chair":[1,0]}"#;
        assert!(Intent::read(without).is_err());
    }

    #[test]
    fn values_out_of_range_are_rejected() {
        for bad in [
            "",
            "{}",
            "[]",
            r#"{"t":"drive","seq":-1,"epoch":1}"#,
            r#"{"t":"drive","seq":1,"epoch":1,"chair":[2,0]}"#,
            r#"{"t":"drive","seq":1,"epoch":1,"chair":[1e999,0]}"#,
            r#"{"t":"drive","seq":1,"epoch":1,"chair":[1]}"#,
            r#"{"t":"step","seq":1,"epoch":1,"part":"hand","axis":3,"sign":1}"#,
            r#"{"t":"step","seq":1,"epoch":1,"part":"hand","axis":0,"sign":0.5}"#,
            r#"{"t":"step","seq":1,"epoch":1}"#,
            r#"{"t":"drive","seq":1,"epoch":1,"clutch":{"move":[1e9,0,0],"turn":[0,0,0,1]}}"#,
            r#"{"t":"drive","seq":1,"epoch":1,"clutch":{"move":[0,0,0],"turn":[0,0,0,0]}}"#,
        ] {
            assert!(Intent::read(bad).is_err(), "{bad}");
        }
    }
}
