//! Values of `--policy`.

use std::path::PathBuf;

/// A value of `--policy`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// The scripted operator.
    #[default]
    Operator,
    /// Keeps the robot at rest.
    Hold,
    /// Repeats the last action.
    Repeat,
    /// Plays the most similar recording of a folder.
    Replay(PathBuf),
    /// A network in a file, run by `wheelarm-learn serve`.
    Act(PathBuf),
    /// A program of the user's.
    Exec(String),
    /// A policy on a Zenoh network.
    Zenoh(String),
    /// A policy at a WebSocket, with the protocol of openpi or RoboArena.
    Openpi(String),
    /// A LeRobot checkpoint, in a child Python process.
    Lerobot(PathBuf),
}

impl Choice {
    /// Reads a value of `--policy`.
    ///
    /// # Errors
    /// Lists the allowed forms.
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
                        "{text:?} is not a policy; use operator, hold, repeat, replay:DIR, act:FILE, exec:COMMAND, zenoh:NAME, openpi:ws://HOST:PORT or lerobot:DIR"
                    ));
                }
            }
        })
    }

    /// The word before the colon.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Operator => "operator",
            Self::Hold => "hold",
            Self::Repeat => "repeat",
            Self::Replay(_) => "replay",
            Self::Act(_) => "act",
            Self::Exec(_) => "exec",
            Self::Zenoh(_) => "zenoh",
            Self::Openpi(_) => "openpi",
            Self::Lerobot(_) => "lerobot",
        }
    }

    /// Whether its answers are the same on every machine: it computes them in this process,
    /// without images, which differ between GPUs.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        !self.has_cameras()
    }

    /// Whether the policy may need images.
    #[must_use]
    pub fn has_cameras(&self) -> bool {
        !matches!(self, Self::Operator | Self::Hold | Self::Repeat)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_policy_lists_the_allowed_forms() {
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
            let error = Choice::read(bad).unwrap_err();
            assert!(error.contains("exec:COMMAND"), "{error}");
        }
    }
}
