//! Orientations in six numbers: the first two columns of the rotation matrix.
//! Continuous, unlike quaternions, so that a network can learn them. Zhou et
//! al. 2019, "On the Continuity of Rotation Representations in Neural Networks".

/// The first two columns of the rotation matrix of a quaternion x y z w.
#[must_use]
pub fn to_six(quaternion: [f64; 4]) -> [f64; 6] {
    let norm = quaternion.iter().map(|v| v * v).sum::<f64>().sqrt();
    let [x, y, z, w] = quaternion.map(|v| v / norm);
    [
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y + z * w),
        2.0 * (x * z - y * w),
        2.0 * (x * y - z * w),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z + x * w),
    ]
}

/// The unit quaternion x y z w, w not negative, whose matrix is nearest in the
/// first column and then in the second (Gram-Schmidt); `None` where the two
/// span no plane.
#[must_use]
pub fn from_six(six: &[f64; 6]) -> Option<[f64; 4]> {
    let [ax, ay, az, bx, by, bz] = *six;
    let a = unit([ax, ay, az])?;
    let along = a[0] * bx + a[1] * by + a[2] * bz;
    let b = unit([bx - along * a[0], by - along * a[1], bz - along * a[2]])?;
    let c = [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ];
    // Of the four formulas for the quaternion, the one with the largest divisor.
    let [m00, m10, m20] = a;
    let [m01, m11, m21] = b;
    let [m02, m12, m22] = c;
    let q = [
        [1.0 + m00 - m11 - m22, m01 + m10, m02 + m20, m21 - m12],
        [m01 + m10, 1.0 - m00 + m11 - m22, m12 + m21, m02 - m20],
        [m02 + m20, m12 + m21, 1.0 - m00 - m11 + m22, m10 - m01],
        [m21 - m12, m02 - m20, m10 - m01, 1.0 + m00 + m11 + m22],
    ];
    let largest = (0..4).max_by(|&i, &j| q[i][i].total_cmp(&q[j][j]))?;
    let norm = q[largest].iter().map(|v| v * v).sum::<f64>().sqrt();
    let sign = if q[largest][3] < 0.0 { -1.0 } else { 1.0 };
    Some(q[largest].map(|v| sign * v / norm))
}

fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    let norm = v.iter().map(|v| v * v).sum::<f64>().sqrt();
    (norm > 1e-6 && norm.is_finite()).then(|| v.map(|v| v / norm))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn six_numbers_hold_every_rotation(
            x in -1.0..1.0_f64, y in -1.0..1.0_f64, z in -1.0..1.0_f64, w in -1.0..1.0_f64,
        ) {
            let norm = (x * x + y * y + z * z + w * w).sqrt();
            prop_assume!(norm > 0.1);
            let six = to_six([x, y, z, w]);
            let back = from_six(&six).unwrap();
            let dot: f64 = back.iter().zip([x, y, z, w]).map(|(a, b)| a * b / norm).sum();
            prop_assert!((dot.abs() - 1.0).abs() < 1e-12, "{back:?}");
            prop_assert!(back[3] >= 0.0);
            // The output of a network has neither unit columns nor right angles.
            let rough = [six[0] * 3.0, six[1] * 3.0, six[2] * 3.0, six[3] + 0.2 * six[0],
                six[4] + 0.2 * six[1], six[5] + 0.2 * six[2]];
            let same = from_six(&rough).unwrap();
            let dot: f64 = same.iter().zip(back).map(|(a, b)| a * b).sum();
            prop_assert!((dot.abs() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn columns_are_the_axes_and_parallel_ones_are_rejected() {
        let quarter = 0.5_f64.sqrt();
        let six = to_six([0.0, 0.0, quarter, quarter]);
        let wanted = [0.0, 1.0, 0.0, -1.0, 0.0, 0.0];
        assert!(six.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12));
        for bad in [
            [0.0; 6],
            [1.0, 0.0, 0.0, 2.0, 0.0, 0.0],
            [f64::NAN, 0.0, 0.0, 0.0, 1.0, 0.0],
        ] {
            assert_eq!(from_six(&bad), None, "{bad:?}");
        }
    }
}
