//! The hand with closed fingers as balls, for clearance.

use nalgebra::{Isometry3, Point3, Vector3};

use super::obb::Obb;

/// A ball of the hand, in the end effector's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Middle, metres.
    pub centre: Vector3<f64>,
    /// Radius, metres.
    pub radius: f64,
}

/// The hand with closed fingers.
#[derive(Clone, Debug, PartialEq)]
pub struct ClosedHand {
    /// The foremost point of the fingers from the end effector along z, metres.
    pub tip: f64,
    /// Balls around it.
    pub balls: Vec<Ball>,
    /// Nothing of it is further from the end effector, metres.
    reach: f64,
}

impl ClosedHand {
    /// A hand of these balls.
    #[must_use]
    pub fn new(balls: Vec<Ball>) -> Self {
        let tips = balls.iter().map(|ball| ball.centre.z + ball.radius);
        let reaches = balls.iter().map(|ball| ball.centre.norm() + ball.radius);
        Self {
            tip: tips.fold(0.0, f64::max),
            reach: reaches.fold(0.0, f64::max),
            balls,
        }
    }

    /// A palm of these balls, with closed fingers of `radius` up to `tip` metres.
    #[must_use]
    pub fn with_fingers(mut palm: Vec<Ball>, radius: f64, tip: f64) -> Self {
        let tips = palm.iter().map(|ball| ball.centre.z);
        let begin = tips.fold(0.0, f64::max);
        let steps = ((tip - radius - begin) / radius).ceil().max(1.0) as u32;
        for step in 1..=steps {
            let share = f64::from(step) / f64::from(steps);
            palm.push(Ball {
                centre: Vector3::z() * (begin + (tip - radius - begin) * share),
                radius,
            });
        }
        Self::new(palm)
    }

    /// Least distance of the hand at `tool` from a box, metres; negative inside.
    pub(super) fn distance(&self, tool: &Isometry3<f64>, obb: &Obb) -> f64 {
        let balls = self.balls.iter().map(|ball| {
            let middle = tool * Point3::from(ball.centre);
            obb.distance(&middle) - ball.radius
        });
        balls.fold(f64::INFINITY, f64::min)
    }

    /// Whether the hand at `tool` keeps `margin` metres from all boxes.
    pub(super) fn is_free<'a>(
        &self,
        tool: &Isometry3<f64>,
        margin: f64,
        mut boxes: impl Iterator<Item = &'a Obb>,
    ) -> bool {
        let middle = Point3::from(tool.translation.vector);
        boxes.all(|obb| {
            obb.distance(&middle) > self.reach + margin || self.distance(tool, obb) > margin
        })
    }
}
