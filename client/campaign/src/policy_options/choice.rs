//! The words of `--policy`.

use std::path::PathBuf;

/// Words of `--policy`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// The scripted operator.
    #[default]
    Operator,
    /// Stands still.
    Hold,
    /// Goes on as before.
    Repeat,
    /// Plays the nearest recording of a folder.
    Replay(PathBuf),
    /// A network in a file, answered for by `wheelarm-learn serve`.
    Act(PathBuf),
    /// A program of the user's.
    Exec(String),
    /// One that runs elsewhere.
    Zenoh(String),
    /// One behind a WebSocket, by openpi's protocol or RoboArena's.
    Openpi(String),
    /// A checkpoint of LeRobot, in a Python process of ours.
    Lerobot(PathBuf),
}

impl Choice {
    /// Reads the words of `--policy`.
    ///
    /// # Errors
    /// With what there is.
    pub fn read(text: &str) -> Result<Self, String> {
        let rest = |word: &str| text.strip_prefix(word).filter(|rest| !rest.is_empty());
        Ok(match text {
            "operator" => Self::Operator,
            "hold" => Self::Hold,
            "repeat" => Self::Repeat,
            _ => {
                if let Some(folder) = rest("replay:") {
                    Self::Replay(folder.into())
                } else if let Some(file) = rest("act:") {
                    Self::Act(file.into())
                } else if let Some(line) = rest("exec:") {
                    Self::Exec(line.to_owned())
                } else if let Some(name) = rest("zenoh:") {
                    Self::Zenoh(name.to_owned())
                } else if let Some(address) = rest("openpi:") {
                    Self::Openpi(address.to_owned())
                } else if let Some(folder) = rest("lerobot:") {
                    Self::Lerobot(folder.into())
                } else {
                    return Err(format!(
                        "{text:?} is no policy; there are operator, hold, repeat, replay:DIR, act:FILE, exec:COMMAND, zenoh:NAME, openpi:ws://HOST:PORT and lerobot:DIR"
                    ));
                }
            }
        })
    }

    /// Whether it may want pictures.
    #[must_use]
    pub fn has_cameras(&self) -> bool {
        !matches!(self, Self::Operator | Self::Hold | Self::Repeat)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_policy_is_read_from_words_and_what_is_none_is_told_what_there_is() {
        assert_eq!(Choice::read("hold"), Ok(Choice::Hold));
        let file = Choice::read("act:a/b.safetensors");
        assert_eq!(file, Ok(Choice::Act("a/b.safetensors".into())));
        let line = Choice::read("exec:python3 p.py --x a:b");
        assert_eq!(line, Ok(Choice::Exec("python3 p.py --x a:b".to_owned())));
        let address = Choice::read("openpi:ws://localhost:8000");
        assert_eq!(
            address,
            Ok(Choice::Openpi("ws://localhost:8000".to_owned()))
        );
        assert_eq!(
            Choice::read("lerobot:a/b"),
            Ok(Choice::Lerobot("a/b".into()))
        );
        for bad in ["", "act:", "openvla", "zenoh:", "lerobot:"] {
            let told = Choice::read(bad).unwrap_err();
            assert!(told.contains("exec:COMMAND"), "{told}");
        }
    }
}
