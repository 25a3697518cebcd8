//! Cubics through two samples with their recorded velocities: pure functions.
//!
//! The error of a cubic falls with the fourth power of the distance of the
//! samples where motion is smooth; where something knocks between two samples,
//! no curve knows of it.

use super::interpolate::unit;

/// The axes in which an angular velocity is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axes {
    /// Those of the frame in which the orientation is given.
    Parent,
    /// Those of the body that turns.
    Body,
}

/// Shares of the way and, times the span in seconds, of the two velocities.
fn weights(share: f64) -> [f64; 3] {
    let s = share;
    let way = s * s * (3.0 - 2.0 * s);
    [way, s * (1.0 - s) * (1.0 - s), s * s * (s - 1.0)]
}

/// The cubic from `a` to `b` with speeds `va` and `vb` per second, `span`
/// seconds long.
#[must_use]
pub fn cubic([a, b]: [f64; 2], [va, vb]: [f64; 2], span: f64, share: f64) -> f64 {
    let [way, first, last] = weights(share);
    a + way * (b - a) + span * (first * va + last * vb)
}

/// The orientation between `a` and `b`, unit quaternions x y z w, with angular
/// velocities `wa` and `wb`, rad/s, in `axes`: the rotation vector from `a`
/// runs along a cubic whose derivatives are those velocities.
#[must_use]
pub fn turn(
    [a, b]: [[f64; 4]; 2],
    [wa, wb]: [[f64; 3]; 2],
    axes: Axes,
    span: f64,
    share: f64,
) -> [f64; 4] {
    let difference = match axes {
        Axes::Parent => product(b, conjugate(a)),
        Axes::Body => product(conjugate(a), b),
    };
    let whole = rotation_vector(difference);
    // The derivative of the rotation vector at its end: the inverse of the
    // left or right Jacobian of SO(3), to second order of the angle.
    let once = cross(whole, wb);
    let twice = cross(whole, once);
    let sign = match axes {
        Axes::Parent => -0.5,
        Axes::Body => 0.5,
    };
    let end: [f64; 3] = std::array::from_fn(|k| wb[k] + sign * once[k] + twice[k] / 12.0);
    let [way, first, last] = weights(share);
    let part = quaternion(std::array::from_fn(|k| {
        way * whole[k] + span * (first * wa[k] + last * end[k])
    }));
    unit(match axes {
        Axes::Parent => product(part, a),
        Axes::Body => product(a, part),
    })
}

fn conjugate([x, y, z, w]: [f64; 4]) -> [f64; 4] {
    [-x, -y, -z, w]
}

fn product([ax, ay, az, aw]: [f64; 4], [bx, by, bz, bw]: [f64; 4]) -> [f64; 4] {
    [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        a[i] * b[j] - a[j] * b[i]
    })
}

/// The shorter of the two turns that a unit quaternion represents, radians.
fn rotation_vector(q: [f64; 4]) -> [f64; 3] {
    let [x, y, z, w] = if q[3] < 0.0 { q.map(|v| -v) } else { q };
    let sine = (x * x + y * y + z * z).sqrt();
    let factor = if sine < 1e-12 {
        2.0
    } else {
        2.0 * sine.atan2(w) / sine
    };
    [x, y, z].map(|v| v * factor)
}

fn quaternion(turn: [f64; 3]) -> [f64; 4] {
    let angle = turn.iter().map(|v| v * v).sum::<f64>().sqrt();
    let factor = if angle < 1e-12 {
        0.5
    } else {
        (angle / 2.0).sin() / angle
    };
    let [x, y, z] = turn.map(|v| v * factor);
    [x, y, z, (angle / 2.0).cos()]
}

#[cfg(test)]
mod tests {
    use super::super::interpolate::{angle_between, slerp};
    use super::*;

    #[test]
    fn a_cubic_is_found_exactly() {
        let at = |t: f64| 2.0 - t + 3.0 * t * t - 0.5 * t * t * t;
        let speed = |t: f64| -1.0 + 6.0 * t - 1.5 * t * t;
        for share in [0.0, 0.2, 0.7, 1.0] {
            let found = cubic([at(1.0), at(1.4)], [speed(1.0), speed(1.4)], 0.4, share);
            assert!((found - at(1.0 + 0.4 * share)).abs() < 1e-12);
        }
    }

    /// A body that wobbles: its orientation, and its angular velocity as the
    /// difference quotient in either axes.
    fn wobble(t: f64) -> [f64; 4] {
        let roll = quaternion([0.7 * (3.0 * t).sin(), 0.0, 0.0]);
        let yaw = quaternion([0.0, 0.0, 1.5 * t + 0.4 * (5.0 * t).cos()]);
        product(yaw, roll)
    }

    fn speed(t: f64, axes: Axes) -> [f64; 3] {
        let (a, b) = (wobble(t - 1e-5), wobble(t + 1e-5));
        rotation_vector(match axes {
            Axes::Parent => product(b, conjugate(a)),
            Axes::Body => product(conjugate(a), b),
        })
        .map(|v| v / 2e-5)
    }

    #[test]
    fn a_turn_with_its_velocities_is_much_nearer_than_the_great_arc() {
        let span = 1.0 / 30.0;
        for axes in [Axes::Parent, Axes::Body] {
            let (mut worst, mut arc) = (0.0_f64, 0.0_f64);
            for i in 0..120 {
                let t = f64::from(i) * span;
                let ends = [wobble(t), wobble(t + span)];
                let speeds = [speed(t, axes), speed(t + span, axes)];
                for share in [0.25, 0.5, 0.75] {
                    let truth = wobble(t + share * span);
                    let found = turn(ends, speeds, axes, span, share);
                    worst = worst.max(angle_between(found, truth));
                    arc = arc.max(angle_between(slerp(ends[0], ends[1], share), truth));
                }
                let end = turn(ends, speeds, axes, span, 1.0);
                assert!(angle_between(end, ends[1]) < 1e-9);
            }
            assert!(50.0 * worst < arc, "{axes:?}: {worst} against {arc}");
        }
    }

    #[test]
    fn the_sign_of_a_quaternion_does_not_matter() {
        let ends = [wobble(0.3), wobble(0.35)];
        let speeds = [speed(0.3, Axes::Body), speed(0.35, Axes::Body)];
        let one = turn(ends, speeds, Axes::Body, 0.05, 0.4);
        let other = turn(
            [ends[0], ends[1].map(|v| -v)],
            speeds,
            Axes::Body,
            0.05,
            0.4,
        );
        assert!(angle_between(one, other) < 1e-9);
    }
}
