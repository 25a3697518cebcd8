//! A door of furniture that turns about a hinge.

use nalgebra::{Isometry3, Quaternion, Unit, UnitQuaternion, Vector3};
use wheelarm_proto::exact;

use super::footprint_check::Rectangle;
use super::obb::Obb;

/// A door has to be free to open this far beyond the angle of a task, radians.
pub const BEYOND: f64 = 0.02;
/// Angle between two poses at which the door is checked, radians.
const SWING_STEP: f64 = 0.03;

/// A closed door may overlap its neighbours by this much without colliding with them, metres:
/// outlines are boxes around shapes.
const TOUCH: f64 = 0.012;
/// Least half extent of an outline of a door that is smaller by [`TOUCH`], metres.
const LEAST_HALF: f64 = 0.001;

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

    /// Whether the door turns up to an angle without meeting boxes of `around`, which has neither
    /// the door nor what carries it. What it touches when it is closed may overlap it by
    /// 12 mm.
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
        let meets = |own: &[Obb], (outline, [from, to]): &(Rectangle, [f64; 2]), overlap: f64| {
            own.iter().any(|obb| {
                let [low, high] = obb.heights();
                let mut door = obb.rectangle();
                door.half = door
                    .half
                    .map(|half| (half - overlap).max(half.min(LEAST_HALF)));
                high > *from && low < *to && door.overlaps(outline)
            })
        };
        let closed = self.boxes_at(0.0);
        let others = around.filter_map(|other| {
            let touches = |overlap: &f64| !meets(&closed, &other, *overlap);
            let overlap = [0.0, TOUCH].into_iter().find(touches)?;
            Some((other, overlap))
        });
        let others: Vec<_> = others.collect();
        let steps = (angle.abs() / SWING_STEP).ceil() as u32;
        (1..=steps).all(|step| {
            let own = self.boxes_at(angle * f64::from(step) / f64::from(steps));
            !others
                .iter()
                .any(|(other, overlap)| meets(&own, other, *overlap))
        })
    }
}
