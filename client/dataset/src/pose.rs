//! Rigid poses, x y z in metres and the unit quaternion qx qy qz qw: pure
//! functions only.

use wheelarm_proto::v1;

/// A frame in another one: x y z, qx qy qz qw.
pub type Pose = [f64; 7];

/// The identity.
pub const IDENTITY: Pose = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];

/// The pose in a row of a recording; NaN where the row is too short.
#[must_use]
pub fn from_row(row: &[f64]) -> Pose {
    std::array::from_fn(|k| row.get(k).copied().unwrap_or(f64::NAN))
}

/// The pose of a message; NaN where it lacks a part.
#[must_use]
pub fn of_message(pose: Option<&v1::Pose>) -> Pose {
    let position = pose.and_then(|p| p.position);
    let orientation = pose.and_then(|p| p.orientation);
    let [x, y, z] = position.map_or([f64::NAN; 3], |v| [v.x, v.y, v.z]);
    let [qx, qy, qz, qw] = orientation.map_or([f64::NAN; 4], |q| [q.x, q.y, q.z, q.w]);
    [x, y, z, qx, qy, qz, qw]
}

/// `a_from_c` out of `a_from_b` and `b_from_c`.
#[must_use]
pub fn compose(a: &Pose, b: &Pose) -> Pose {
    let moved = turned(orientation(a), [b[0], b[1], b[2]]);
    let [x, y, z, w] = product(orientation(a), orientation(b));
    [
        a[0] + moved[0],
        a[1] + moved[1],
        a[2] + moved[2],
        x,
        y,
        z,
        w,
    ]
}

/// `b_from_a` out of `a_from_b`.
#[must_use]
pub fn inverse(pose: &Pose) -> Pose {
    let [x, y, z, w] = orientation(pose);
    let turn = [-x, -y, -z, w];
    let [px, py, pz] = turned(turn, [-pose[0], -pose[1], -pose[2]]);
    [px, py, pz, -x, -y, -z, w]
}

/// The quaternion of a pose.
#[must_use]
pub fn orientation(pose: &Pose) -> [f64; 4] {
    [pose[3], pose[4], pose[5], pose[6]]
}

/// A vector turned by a unit quaternion.
#[must_use]
pub fn turned([x, y, z, w]: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    };
    let t = cross([x, y, z], v).map(|c| 2.0 * c);
    let u = cross([x, y, z], t);
    std::array::from_fn(|k| v[k] + w * t[k] + u[k])
}

/// Pixel of a point of the frame in which the camera's pose is given, by intrinsics
/// width, height, fx, fy, cx, cy; `None` behind the camera.
#[must_use]
pub fn project(lens: &[f64; 6], camera: &Pose, point: [f64; 3]) -> Option<[f64; 2]> {
    let [x, y, z, w] = orientation(camera);
    let from = [0, 1, 2].map(|k| point[k] - camera[k]);
    let [right, down, ahead] = turned([-x, -y, -z, w], from);
    let [_, _, fx, fy, cx, cy] = *lens;
    (ahead > 0.01).then(|| [cx + fx * right / ahead, cy + fy * down / ahead])
}

/// A point of a frame, in the frame in which its pose is given.
#[must_use]
pub fn point(frame: &Pose, at: [f64; 3]) -> [f64; 3] {
    let turned = turned(orientation(frame), at);
    [0, 1, 2].map(|k| frame[k] + turned[k])
}

/// The turn `b`, then the turn `a`.
#[must_use]
pub fn product(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    let [ax, ay, az, aw] = a;
    let [bx, by, bz, bw] = b;
    [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]
}

/// The turn by `angle` radians about a unit vector.
#[must_use]
pub fn about([x, y, z]: [f64; 3], angle: f64) -> [f64; 4] {
    let (s, c) = (0.5 * angle).sin_cos();
    [x * s, y * s, z * s, c]
}

/// A URDF origin: metres, and turns about the fixed x, y, z axes, radians.
#[must_use]
pub fn from_rpy([x, y, z]: [f64; 3], [roll, pitch, yaw]: [f64; 3]) -> Pose {
    let turn = product(
        about([0.0, 0.0, 1.0], yaw),
        product(about([0.0, 1.0, 0.0], pitch), about([1.0, 0.0, 0.0], roll)),
    );
    [x, y, z, turn[0], turn[1], turn[2], turn[3]]
}

/// Yaw of a quaternion, radians in (-π, π].
#[must_use]
pub fn yaw([x, y, z, w]: [f64; 4]) -> f64 {
    (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z))
}

/// The homogeneous matrix of a pose, 4x4, row by row.
#[must_use]
pub fn matrix(&[px, py, pz, x, y, z, w]: &Pose) -> [f64; 16] {
    [
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - z * w),
        2.0 * (x * z + y * w),
        px,
        2.0 * (x * y + z * w),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - x * w),
        py,
        2.0 * (x * z - y * w),
        2.0 * (y * z + x * w),
        1.0 - 2.0 * (x * x + y * y),
        pz,
        0.0,
        0.0,
        0.0,
        1.0,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn near(a: &[f64], b: &[f64]) {
        let off = a.iter().zip(b).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f64::max) < 1e-12, "{a:?}, expected {b:?}");
    }

    #[test]
    fn quarter_turn_about_z_maps_x_to_y() {
        let pose = from_rpy([1.0, 2.0, 3.0], [0.0, 0.0, FRAC_PI_2]);
        near(
            &turned(orientation(&pose), [1.0, 0.0, 0.0]),
            &[0.0, 1.0, 0.0],
        );
        let m = matrix(&pose);
        near(&[m[0], m[4], m[3], m[7], m[11]], &[0.0, 1.0, 1.0, 2.0, 3.0]);
        assert!((yaw(orientation(&pose)) - FRAC_PI_2).abs() < 1e-12);
    }

    #[test]
    fn poses_compose_as_their_matrices_do() {
        let a = from_rpy([0.1, -2.0, 0.7], [0.4, -1.1, 2.9]);
        let b = from_rpy([3.0, 0.2, -0.5], [-2.0, 0.3, 0.8]);
        let (ma, mb) = (matrix(&a), matrix(&b));
        let product: Vec<f64> = (0..16)
            .map(|i| {
                (0..4)
                    .map(|k| ma[4 * (i / 4) + k] * mb[4 * k + i % 4])
                    .sum()
            })
            .collect();
        near(&matrix(&compose(&a, &b)), &product);
        near(&compose(&a, &IDENTITY), &a);
        near(&compose(&inverse(&a), &a), &IDENTITY);
        near(&compose(&inverse(&a), &compose(&a, &b)), &b);
    }

    #[test]
    fn roll_is_applied_before_pitch_and_yaw() {
        // The chair camera of the robot: optical z points forward and down.
        let pose = from_rpy([0.0; 3], [-2.094_395_102_393_195_7, 0.0, -FRAC_PI_2]);
        let forward = turned(orientation(&pose), [0.0, 0.0, 1.0]);
        near(&forward, &[3.0_f64.sqrt() / 2.0, 0.0, -0.5]);
    }

    #[test]
    fn inverse_maps_a_point_back() {
        let frame = from_rpy([1.0, 2.0, 3.0], [0.4, -1.1, 2.9]);
        let there = point(&frame, [0.5, -0.2, 0.25]);
        near(&point(&inverse(&frame), there), &[0.5, -0.2, 0.25]);
    }

    #[test]
    fn a_point_ahead_is_projected_by_the_lens_and_none_behind() {
        let lens = [640.0, 360.0, 500.0, 400.0, 320.0, 180.0];
        let camera = from_rpy([0.0, 0.0, 1.0], [0.0, 0.0, FRAC_PI_2]);
        // The camera looks along z, its x is along the frame's y.
        let pixel = project(&lens, &camera, [0.0, 0.5, 3.0]);
        near(&pixel.expect("ahead"), &[320.0 + 125.0, 180.0]);
        assert_eq!(project(&lens, &camera, [0.0, 0.5, 0.5]), None);
    }
}
