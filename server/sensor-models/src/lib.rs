//! Sensor models: functions from what is true (a picture, joint positions, wheel
//! angles, the motion of the chair) to what a real sensor would tell of it, with
//! the parameters of `assets/sensors` and noise that follows from a seed.
//!
//! Pure: no clock, no file, no network, no renderer, nothing of the server. The
//! same truth, parameters and seed give the same bits on any machine: noise comes
//! from integers and tables, and what is computed per pixel is adding,
//! multiplying and dividing.

mod block;
pub mod color;
pub mod delay;
pub mod depth;
pub mod encoders;
mod error;
pub mod imu;
pub mod model;
pub mod noise;
pub mod odometry;
mod parameters;
pub mod picture;
pub mod surface;
mod transform;

pub use error::{BadParameter, Bounds};
pub use model::Model;
pub use picture::{Exact, Lens};
pub use surface::{Surface, Surfaces};
