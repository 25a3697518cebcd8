//! The labels of an episode, all together.

use super::contacts::Interval;
use super::grasps::ChosenGrasp;
use super::questions::Question;
use super::subtasks::Subtask;
use super::trace::Trace;

/// Labels of one episode.
#[derive(Clone, Debug, Default)]
pub struct Annotations {
    /// The subtasks, phase by phase.
    pub subtasks: Vec<Subtask>,
    /// The plan: texts of the subtasks in order.
    pub plan: Vec<String>,
    /// Questions with their answers, by time.
    pub questions: Vec<Question>,
    /// Touching pairs from when to when.
    pub contacts: Vec<Interval>,
    /// Grasps that closed on something.
    pub grasps: Vec<ChosenGrasp>,
    /// The path of the hand in the images of each camera.
    pub traces: Vec<Trace>,
}
