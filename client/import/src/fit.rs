//! A model in the size and posture of its piece. Frame of a kind: metres, front along x, left
//! along y (the model's right side, seen from its front), z up from the foot.

use wheelarm_proto::exact;

use crate::model::Model;
use crate::sh3d::Piece;

/// Metres per centimetre.
pub const METRES: f64 = 0.01;

/// A model in the frame of its kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// Corners, metres.
    pub points: Vec<[f64; 3]>,
    /// Smallest coordinates; z is 0.
    pub low: [f64; 3],
    /// Largest coordinates.
    pub high: [f64; 3],
}

/// Places a model in the frame of the kind: rotated, scaled to the size of the piece,
/// mirrored, tilted, centred on its foot.
#[must_use]
pub fn fit(model: &Model, piece: &Piece) -> Fitted {
    let mut points = model.positions.clone();
    if let Some(m) = piece.rotation {
        for p in &mut points {
            *p = [0, 3, 6].map(|row| m[row] * p[0] + m[row + 1] * p[1] + m[row + 2] * p[2]);
        }
    }
    let (low, high) = bounds(&points);
    let [width, depth, height] = piece.size;
    let size = [width, height, depth].map(|length| length * METRES);
    for p in &mut points {
        for axis in 0..3 {
            let extent = (high[axis] - low[axis]).max(1.0e-9);
            let middle = 0.5 * (low[axis] + high[axis]);
            p[axis] = (p[axis] - middle) / extent * size[axis];
        }
        if piece.mirrored {
            p[0] = -p[0];
        }
    }
    // Either of both, as the program draws it.
    if piece.pitch != 0.0 {
        let (sin, cos) = exact::sin_cos(-piece.pitch);
        for p in &mut points {
            *p = [p[0], cos * p[1] - sin * p[2], sin * p[1] + cos * p[2]];
        }
    } else if piece.roll != 0.0 {
        let (sin, cos) = exact::sin_cos(-piece.roll);
        for p in &mut points {
            *p = [cos * p[0] - sin * p[1], sin * p[0] + cos * p[1], p[2]];
        }
    }
    let (low, high) = bounds(&points);
    for p in &mut points {
        let x = p[0] - 0.5 * (low[0] + high[0]);
        let y = p[1] - low[1];
        let z = p[2] - 0.5 * (low[2] + high[2]);
        *p = [z, x, y];
    }
    let (low, high) = bounds(&points);
    Fitted { points, low, high }
}

/// Smallest and largest coordinates.
#[must_use]
pub fn bounds(points: &[[f64; 3]]) -> ([f64; 3], [f64; 3]) {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for point in points {
        for axis in 0..3 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    if points.is_empty() {
        return ([0.0; 3], [0.0; 3]);
    }
    (low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box 1 x 2 x 3 whose corner right, top, front is alone there.
    fn wedge() -> Model {
        Model {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 2.0, 3.0]],
            ..Model::default()
        }
    }

    fn piece() -> Piece {
        Piece {
            size: [100.0, 60.0, 40.0],
            ..Piece::default()
        }
    }

    #[test]
    fn model_has_the_size_of_its_piece_with_the_front_along_x() {
        let fitted = fit(&wedge(), &piece());
        assert_eq!(fitted.low, [-0.3, -0.5, 0.0]);
        assert_eq!(fitted.high, [0.3, 0.5, 0.4]);
        assert_eq!(fitted.points[2], [0.3, 0.5, 0.4], "right, top, front");
    }

    #[test]
    fn mirrored_piece_changes_sides() {
        let mirrored = Piece {
            mirrored: true,
            ..piece()
        };
        assert_eq!(fit(&wedge(), &mirrored).points[2], [0.3, -0.5, 0.4]);
    }

    #[test]
    fn tilted_piece_keeps_its_foot_on_the_floor() {
        let tilted = Piece {
            pitch: std::f64::consts::FRAC_PI_2,
            ..piece()
        };
        let fitted = fit(&wedge(), &tilted);
        assert!(fitted.low[2].abs() < 1e-12);
        assert!((fitted.high[2] - 0.6).abs() < 1e-9, "its depth is upright");
    }
}
