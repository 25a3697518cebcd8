//! Forms: label and instruction of an episode, task and seed of a reset, and
//! confirmations before something is lost. Pure.

use wheelarm_proto::{check, v1};

use crate::keys::Key;

/// Longest text in a field, characters.
const LONGEST: usize = 10_000;

/// One line of text with a cursor.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Field {
    characters: Vec<char>,
    cursor: usize,
}

impl Field {
    /// A field that holds `text`, with the cursor at its end.
    #[must_use]
    pub fn new(text: &str) -> Self {
        let characters: Vec<char> = text.chars().collect();
        let cursor = characters.len();
        Self { characters, cursor }
    }

    /// The text.
    #[must_use]
    pub fn text(&self) -> String {
        self.characters.iter().collect()
    }

    /// The text before the cursor and after it.
    #[must_use]
    pub fn halves(&self) -> (String, String) {
        let (before, after) = self.characters.split_at(self.cursor);
        (before.iter().collect(), after.iter().collect())
    }

    fn insert(&mut self, text: &str) {
        for character in text.chars() {
            // A line break would end the line; it becomes a space.
            let character = if character.is_control() {
                ' '
            } else {
                character
            };
            if self.characters.len() < LONGEST {
                self.characters.insert(self.cursor, character);
                self.cursor += 1;
            }
        }
    }

    /// Handles a key; returns whether it belongs to a field.
    pub fn key(&mut self, key: &Key) -> bool {
        match key {
            Key::Char(character) => self.insert(&character.to_string()),
            Key::Paste(text) => self.insert(text.trim_end_matches(['\r', '\n'])),
            Key::Backspace if self.cursor > 0 => {
                self.cursor -= 1;
                self.characters.remove(self.cursor);
            }
            Key::Delete if self.cursor < self.characters.len() => {
                self.characters.remove(self.cursor);
            }
            Key::Backspace | Key::Delete => {}
            Key::Left => self.cursor = self.cursor.saturating_sub(1),
            Key::Right => self.cursor = (self.cursor + 1).min(self.characters.len()),
            Key::Home | Key::Ctrl('a') => self.cursor = 0,
            Key::End | Key::Ctrl('e') => self.cursor = self.characters.len(),
            Key::Ctrl('u') => {
                self.characters.clear();
                self.cursor = 0;
            }
            _ => return false,
        }
        true
    }
}

/// Form that covers the controls.
#[derive(Clone, Debug, PartialEq)]
pub enum Form {
    /// Start of an episode: label, instruction, recorders.
    Start {
        /// The fields in this order.
        fields: [Field; 3],
        /// Field with the focus.
        focus: usize,
        /// Problem of the fields.
        problem: String,
    },
    /// Set-up of a scenario: one of the tasks, seed.
    Reset {
        /// Tasks of the server.
        tasks: Vec<v1::TaskInfo>,
        /// The chosen one.
        chosen: usize,
        /// Seed.
        seed: Field,
        /// Problem of the seed.
        problem: String,
    },
    /// Take control from its holder?
    Take {
        /// The holder.
        holder: String,
    },
    /// Leave while an episode runs?
    Leave,
}

/// Result of a key.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// The form stays.
    Stay,
    /// The form closes without an action.
    Close,
    /// Start an episode.
    Start {
        /// Label.
        label: String,
        /// Instruction.
        instruction: String,
        /// Recorders that must be ready.
        recorders: u32,
    },
    /// Set up a scenario.
    Reset {
        /// Task.
        task: String,
        /// Seed.
        seed: u64,
    },
    /// Take control.
    Take,
    /// Leave: keep the episode by stopping it, discard it, or let it run.
    Leave(Leaving),
}

/// What happens to a running episode when its operator leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Leaving {
    /// It is ended and kept.
    Keep,
    /// It is discarded.
    Discard,
    /// It continues.
    Run,
}

/// Names of the fields of [`Form::Start`].
pub const START_FIELDS: [&str; 3] = ["label", "instruction", "recorders"];

impl Form {
    /// The form for starting an episode.
    #[must_use]
    pub fn start(label: &str, instruction: &str, recorders: u32) -> Self {
        Self::Start {
            fields: [
                Field::new(label),
                Field::new(instruction),
                Field::new(&recorders.to_string()),
            ],
            focus: 1,
            problem: String::new(),
        }
    }

    /// The form for setting up a scenario; `task` and `seed` are the current ones.
    #[must_use]
    pub fn reset(tasks: Vec<v1::TaskInfo>, task: &str, seed: u64) -> Self {
        Self::Reset {
            chosen: tasks.iter().position(|t| t.name == task).unwrap_or(0),
            tasks,
            seed: Field::new(&seed.to_string()),
            problem: String::new(),
        }
    }

    /// Handles a key.
    pub fn key(&mut self, key: &Key) -> Answer {
        match (key, &self) {
            // A second Ctrl-C leaves without an answer.
            (Key::Ctrl('c'), Self::Leave) => return Answer::Leave(Leaving::Run),
            (Key::Escape | Key::Ctrl('c'), _) => return Answer::Close,
            _ => {}
        }
        match self {
            Self::Start {
                fields,
                focus,
                problem,
            } => match key {
                Key::Tab | Key::Down => *focus = (*focus + 1) % fields.len(),
                Key::BackTab | Key::Up => *focus = (*focus + fields.len() - 1) % fields.len(),
                Key::Enter => match read_start(fields) {
                    Ok(answer) => return answer,
                    Err((field, text)) => {
                        *focus = field;
                        *problem = text;
                    }
                },
                _ => {
                    problem.clear();
                    fields[*focus].key(key);
                }
            },
            Self::Reset {
                tasks,
                chosen,
                seed,
                problem,
            } => match key {
                Key::Down | Key::Tab if !tasks.is_empty() => *chosen = (*chosen + 1) % tasks.len(),
                Key::Up | Key::BackTab if !tasks.is_empty() => {
                    *chosen = (*chosen + tasks.len() - 1) % tasks.len();
                }
                Key::Enter => match seed.text().trim().parse() {
                    Ok(seed) => {
                        let task = tasks.get(*chosen).map(|t| t.name.clone());
                        let task = task.unwrap_or_default();
                        return Answer::Reset { task, seed };
                    }
                    Err(_) => *problem = "the seed is a whole number from 0".to_owned(),
                },
                _ => {
                    problem.clear();
                    seed.key(key);
                }
            },
            Self::Take { .. } => match key {
                Key::Char('y') => return Answer::Take,
                Key::Char('n') => return Answer::Close,
                _ => {}
            },
            Self::Leave => match key {
                Key::Char('s') => return Answer::Leave(Leaving::Keep),
                Key::Char('d') => return Answer::Leave(Leaving::Discard),
                Key::Char('r') => return Answer::Leave(Leaving::Run),
                _ => {}
            },
        }
        Answer::Stay
    }
}

fn read_start(fields: &[Field; 3]) -> Result<Answer, (usize, String)> {
    let label = fields[0].text().trim().to_owned();
    check::label(&label).map_err(|e| (0, e.to_string()))?;
    let recorders = fields[2].text().trim().parse::<u32>().ok();
    let recorders = recorders
        .filter(|n| *n <= 64)
        .ok_or((2, "recorders: a whole number from 0 to 64".to_owned()))?;
    Ok(Answer::Start {
        label,
        instruction: fields[1].text().trim().to_owned(),
        recorders,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn typed(form: &mut Form, text: &str) {
        for character in text.chars() {
            assert_eq!(form.key(&Key::Char(character)), Answer::Stay);
        }
    }

    #[test]
    fn an_instruction_is_kept_as_typed_and_pasted() {
        let mut form = Form::start("try-1", "", 1);
        typed(&mut form, "bring mir die große ");
        form.key(&Key::Paste("Tasse 茶\n".to_owned()));
        let answer = form.key(&Key::Enter);
        let Answer::Start { instruction, .. } = &answer else {
            panic!("{answer:?}")
        };
        assert_eq!(instruction, "bring mir die große Tasse 茶");
    }

    #[test]
    fn a_bad_label_is_refused_at_its_field() {
        let mut form = Form::start("", "x", 0);
        form.key(&Key::BackTab);
        typed(&mut form, "../evil");
        assert_eq!(form.key(&Key::Enter), Answer::Stay);
        let Form::Start { focus, problem, .. } = &form else {
            panic!("{form:?}")
        };
        assert!(*focus == 0 && problem.contains("label"), "{problem}");
    }

    #[test]
    fn the_cursor_edits_inside_the_text() {
        let mut field = Field::new("ac");
        for key in [Key::Left, Key::Char('b'), Key::End, Key::Backspace] {
            assert!(field.key(&key));
        }
        assert_eq!(field.text(), "ab");
        assert!(field.key(&Key::Ctrl('u')) && field.text().is_empty());
        assert!(!field.key(&Key::Enter));
    }

    #[test]
    fn a_task_is_chosen_by_arrows_and_the_seed_typed() {
        let task = |name: &str| v1::TaskInfo {
            name: name.to_owned(),
            ..Default::default()
        };
        let mut form = Form::reset(vec![task("a"), task("b")], "a", 3);
        form.key(&Key::Up);
        form.key(&Key::Backspace);
        typed(&mut form, "17");
        let answer = form.key(&Key::Enter);
        let (task, seed) = ("b".to_owned(), 17);
        assert_eq!(answer, Answer::Reset { task, seed });
    }
}
