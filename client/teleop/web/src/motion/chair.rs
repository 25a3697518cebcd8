//! Chair motion from held input: as fast as the person chose, limited by the age of the
//! displayed image. Pure.

use wheelarm_proto::v1;

use crate::protocol::Held;
use crate::speed::{self, Speeds};

/// Distance from the middle of the axle to the farthest corner of a robot that is
/// without a description, m.
const FAR_CORNER: f64 = 1.0;

/// Property of the robot that limits the turn rate.
#[derive(Clone, Debug, PartialEq)]
pub struct Chair {
    /// Farthest corner of the footprint from the axle's middle, m.
    corner: f64,
}

impl Default for Chair {
    fn default() -> Self {
        Self { corner: FAR_CORNER }
    }
}

impl Chair {
    /// The chair of a robot.
    #[must_use]
    pub fn of(robot: &v1::RobotDescription) -> Self {
        let corner = robot.footprint.map(|f| {
            let x = f.x_min.abs().max(f.x_max.abs());
            let y = f.y_min.abs().max(f.y_max.abs());
            x.hypot(y)
        });
        Self {
            corner: corner.filter(|c| *c > 0.0).unwrap_or(FAR_CORNER),
        }
    }

    /// Chair speeds for an image of `age`, s; `None` without held chair input or without a
    /// displayed image.
    #[must_use]
    pub fn drive(&self, held: &Held, speeds: &Speeds, age: Option<f64>) -> Option<v1::BaseCommand> {
        if held.chair == [0.0; 2] {
            return None;
        }
        let linear = held.chair[0] * speeds.chair[0];
        let angular = held.chair[1] * speeds.chair[1];
        let cap = speed::cap(age?);
        // No corner of the chair turns faster than the chair may go.
        let fastest = linear.abs().max(angular.abs() * self.corner);
        let share = (cap / fastest.max(cap)).min(1.0);
        Some(v1::BaseCommand {
            linear: linear * share,
            angular: angular * share,
        })
    }
}
