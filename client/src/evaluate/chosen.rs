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
            _ => match (rest("replay:"), rest("act:"), rest("exec:"), rest("zenoh:")) {
                (Some(folder), ..) => Self::Replay(folder.into()),
                (_, Some(file), ..) => Self::Act(file.into()),
                (_, _, Some(line), _) => Self::Exec(line.to_owned()),
                (.., Some(name)) => Self::Zenoh(name.to_owned()),
                _ => {
                    return Err(format!(
                        "{text:?} is no policy; there are operator, hold, repeat, replay:DIR, act:FILE, exec:COMMAND and zenoh:NAME"
                    ));
                }
            },
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
        for bad in ["", "act:", "openvla", "zenoh:"] {
            let told = Choice::read(bad).unwrap_err();
            assert!(told.contains("exec:COMMAND"), "{told}");
        }
    }
}
