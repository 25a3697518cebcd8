//! Labels in words and numbers that a recording's exact state gives: what is done
//! with what, questions with their answers, boxes in the images, the chosen
//! grasp, contacts, the way of the hand.
//!
//! Everything is made from what the file holds and nothing is guessed by a model;
//! `tests/python/check_answers.py` answers the questions again from the same file.

mod boxes;
mod contacts;
mod grasps;
mod labels;
mod questions;
mod shapes;
mod sight;
mod state;
mod subtasks;
mod table;
mod trace;
mod write;

pub use boxes::{CameraBoxes, boxes};
pub use contacts::Interval;
pub use grasps::ChosenGrasp;
pub use labels::Annotations;
pub use questions::{KINDS, Question};
pub use shapes::middle;
pub use sight::Sight;
pub use state::State;
pub use subtasks::Subtask;
pub use table::{write_questions, write_subtasks};
pub use trace::{STEPS, Trace};
pub use write::write;

use crate::label::Segment;
use crate::read::{Episode, ReadError};

/// Makes the labels of an episode whose phases are these.
///
/// # Errors
/// When the file lacks what they are made of; the error names it.
pub fn annotate(
    episode: &Episode,
    state: &State,
    phases: &[Segment],
) -> Result<Annotations, ReadError> {
    let grasps = grasps::grasps(state);
    let sight = questions::sight(episode, state)?;
    let subtasks = subtasks::subtasks(state, phases, &grasps);
    Ok(Annotations {
        plan: subtasks::plan(&subtasks),
        subtasks,
        questions: questions::questions(state, &sight),
        contacts: contacts::intervals(episode)?,
        grasps,
        traces: trace::traces(episode, state)?,
    })
}
