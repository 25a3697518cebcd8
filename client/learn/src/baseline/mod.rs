//! The baseline of WheelArm-Sim's paper (arXiv 2601.21129): an LSTM predicts the next poses of hand,
//! chair and gripper from images, words and columns of state. Its published program cannot run,
//! and its loss contains no pose. Here it is trained as the paper describes it ("as printed") and
//! so that it can learn ("corrected"), beside two naive predictors.

pub mod columns;
mod depth;
pub mod errors;
mod features;
mod network;
mod run;
mod table;
mod training_task;

pub use depth::{DepthNetwork, Depths};
pub use features::{Features, features};
pub use network::{Baseline, Sizes};
pub use run::{RunOptions, of, run};
pub use table::{Ahead, Report, figure};
pub use training_task::{BaselineTask, Kind, TaskOptions};
