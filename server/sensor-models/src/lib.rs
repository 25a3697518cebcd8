//! Sensor models: functions from true values (an image, joint positions, wheel angles,
//! the motion of the chair) to the measurements of a real sensor. Their parameters are
//! in `assets/sensors`, their noise follows from a seed.
//!
//! Pure: no clock, no file, no network, no renderer, independent of the server. The
//! same input, parameters and seed give the same bits on any machine: noise follows from
//! integers and tables, and per-pixel computations only add, multiply and divide.

mod block;
pub mod color;
pub mod delay;
pub mod depth;
pub mod encoders;
mod error;
pub mod exact_image;
pub mod imu;
pub mod model;
pub mod noise;
pub mod odometry;
mod parameters;
pub mod scanner;
pub mod surface;
mod transform;

pub use error::{BadParameter, Bounds};
pub use exact_image::{Exact, Lens};
pub use model::Model;
pub use surface::{Surface, Surfaces};
