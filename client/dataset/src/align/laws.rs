//! Laws of interpolation that hold for every input.

use proptest::prelude::*;

use super::interpolate::{Place, angle_between, linear, nearest, place, slerp, unit, unwrap};

fn stamps() -> impl Strategy<Value = Vec<u64>> {
    prop::collection::btree_set(0_u64..100_000, 1..60).prop_map(|s| s.into_iter().collect())
}

fn orientation() -> impl Strategy<Value = [f64; 4]> {
    prop::array::uniform4(-1.0_f64..1.0)
        .prop_filter("too short to point anywhere", |q| {
            q.iter().map(|v| v * v).sum::<f64>() > 0.01
        })
        .prop_map(unit)
}

proptest! {
    #[test]
    fn a_position_is_inside_exactly_when_the_samples_enclose_it(stamps in stamps(), time in 0_u64..110_000) {
        let inside = stamps[0] <= time && time <= stamps[stamps.len() - 1];
        match place(&stamps, time) {
            Place::Outside => prop_assert!(!inside),
            Place::At(i) => prop_assert_eq!(stamps[i], time),
            Place::Between(i, share) => {
                prop_assert!(stamps[i] < time && time < stamps[i + 1]);
                let found = linear(stamps[i] as f64, stamps[i + 1] as f64, share);
                prop_assert!((found - time as f64).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn no_sample_is_nearer_than_the_nearest_and_none_is_older_than_the_limit(
        stamps in stamps(), time in 0_u64..110_000, limit in 0_u64..5_000,
    ) {
        let least = stamps.iter().map(|s| s.abs_diff(time)).min().unwrap_or(u64::MAX);
        match nearest(&stamps, time, limit) {
            Some(i) => prop_assert_eq!(stamps[i].abs_diff(time), least),
            None => prop_assert!(least > limit),
        }
    }

    #[test]
    fn straight_motion_is_found_exactly(a in -10.0_f64..10.0, speed in -3.0_f64..3.0, share in 0.0_f64..1.0) {
        prop_assert!((linear(a, a + speed, share) - (a + share * speed)).abs() < 1e-12);
    }

    #[test]
    fn slerp_keeps_the_norm_divides_the_angle_and_ends_at_the_samples(
        a in orientation(), b in orientation(), share in 0.0_f64..1.0,
    ) {
        let whole = angle_between(a, b);
        prop_assume!(whole < 3.1);
        let q = slerp(a, b, share);
        prop_assert!((q.iter().map(|v| v * v).sum::<f64>() - 1.0).abs() < 1e-12);
        prop_assert!((angle_between(a, q) - share * whole).abs() < 1e-9);
        prop_assert!((angle_between(q, b) - (1.0 - share) * whole).abs() < 1e-9);
        prop_assert!(angle_between(slerp(a, b, 0.0), a) < 1e-12);
        prop_assert!(angle_between(slerp(a, b, 1.0), b) < 1e-9);
    }

    #[test]
    fn the_sign_of_a_quaternion_does_not_matter(
        a in orientation(), b in orientation(), share in 0.0_f64..1.0,
    ) {
        prop_assume!(angle_between(a, b) < 3.1);
        let other = slerp(a, b.map(|v| -v), share);
        prop_assert!(angle_between(slerp(a, b, share), other) < 1e-9);
    }

    #[test]
    fn wrapped_angles_are_unwound_into_the_motion_they_came_from(
        start in -3.0_f64..3.0, steps in prop::collection::vec(-3.0_f64..3.0, 1..80),
    ) {
        let mut truth = vec![start];
        for step in steps {
            truth.push(truth[truth.len() - 1] + step);
        }
        let mut wrapped: Vec<f64> = truth.iter().map(|a| a.sin().atan2(a.cos())).collect();
        unwrap(&mut wrapped, 1);
        for (found, expected) in wrapped.iter().zip(&truth) {
            prop_assert!((found - expected).abs() < 1e-9);
        }
    }
}
