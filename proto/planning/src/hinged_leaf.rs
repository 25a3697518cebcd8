//! A door of furniture that turns about a hinge.

use nalgebra::{Isometry3, Quaternion, Unit, UnitQuaternion, Vector3};
use wheelarm_proto::exact;

use super::footprint_check::Rectangle;
use super::obb::Obb;

/// Angle between two poses at which the door is checked, radians.
const SWING_STEP: f64 = 0.03;

/// A door of furniture on a hinge, in `house`.
#[derive(Clone, Debug, PartialEq)]
pub struct HingedLeaf {
    /// Its pose at position 0; the hinge's axis goes through its origin.
    pub rest: Isometry3<f64>,
    /// The axis about which it opens.
    pub axis: Unit<Vector3<f64>>,
    /// Boxes around it in its own frame.
    pub boxes: Vec<Obb>,
}

impl HingedLeaf {
    /// Its pose at an angle.
    #[must_use]
    pub fn pose(&self, angle: f64) -> Isometry3<f64> {
        let (sin, cos) = exact::sin_cos(angle / 2.0);
        let turn = Quaternion::from_parts(cos, self.axis.into_inner() * sin);
        let turn = UnitQuaternion::new_normalize(turn);
        Isometry3::from_parts(self.rest.translation, turn * self.rest.rotation)
    }

    /// Its boxes at an angle.
    #[must_use]
    pub fn boxes_at(&self, angle: f64) -> Vec<Obb> {
        let pose = self.pose(angle);
        self.boxes.iter().map(|obb| obb.at(&pose)).collect()
    }

    /// Whether the door turns up to an angle without meeting boxes of `around` that it does not
    /// meet when it is closed. `around` has neither the door nor what carries it.
    #[must_use]
    pub fn swings_free(&self, angle: f64, around: &[Obb]) -> bool {
        let around = around.iter().map(|obb| (obb.rectangle(), obb.heights()));
        self.swings_free_of(angle, around)
    }

    /// [`Self::swings_free`] of outlines on the floor plan with their lower and upper ends.
    #[must_use]
    pub fn swings_free_of(
        &self,
        angle: f64,
        around: impl Iterator<Item = (Rectangle, [f64; 2])>,
    ) -> bool {
        let meets = |own: &[Obb], (outline, [from, to]): &(Rectangle, [f64; 2])| {
            own.iter().any(|obb| {
                let [low, high] = obb.heights();
                high > *from && low < *to && obb.rectangle().overlaps(outline)
            })
        };
        let closed = self.boxes_at(0.0);
        let others: Vec<_> = around.filter(|other| !meets(&closed, other)).collect();
        let steps = (angle.abs() / SWING_STEP).ceil() as u32;
        (1..=steps).all(|step| {
            let own = self.boxes_at(angle * f64::from(step) / f64::from(steps));
            !others.iter().any(|other| meets(&own, other))
        })
    }
}
