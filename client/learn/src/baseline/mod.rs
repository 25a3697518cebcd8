//! The baseline of WheelArm-Sim's paper (arXiv 2601.21129): next poses of hand, chair
//! and gripper from pictures, words and columns of state, by an LSTM. Its published
//! program cannot run, and its loss has no pose in it; here it is trained as the paper
//! says it ("as printed"), and so that it can learn ("corrected"), beside two rules
//! that know nothing.

pub mod columns;
mod depth;
pub mod errors;
mod features;
mod lesson;
mod network;
mod run;
mod table;

pub use depth::{DepthNetwork, Depths};
pub use features::{Features, features};
pub use lesson::{Kind, Lesson, LessonOptions};
pub use network::{Baseline, Sizes};
pub use run::{RunOptions, of, run};
pub use table::{Ahead, Report, figure};
