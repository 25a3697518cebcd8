//! Labels as text and numbers from a recording's exact state: subtasks with their
//! objects, questions with their answers, boxes in the images, the chosen
//! grasp, contacts, the way of the hand.
//!
//! All labels are computed from the file, without a learned model;
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

/// Computes the labels of an episode with these phases.
///
/// # Errors
/// When the file lacks an input; the error names it.
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
