//! Conversions between double precision and the engine's single precision. No other
//! module converts.

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use rapier3d::math::{Matrix, Pose, Rotation, Vector};
use rapier3d::prelude::MassProperties;

use super::mass::Mass;

/// To the engine.
pub(super) fn real(x: f64) -> f32 {
    x as f32
}

/// To the engine.
pub(super) fn vector(v: &Vector3<f64>) -> Vector {
    Vector::new(real(v.x), real(v.y), real(v.z))
}

/// To the engine.
pub(super) fn point(p: &Point3<f64>) -> Vector {
    vector(&p.coords)
}

/// To the engine.
pub(super) fn rotation(q: &UnitQuaternion<f64>) -> Rotation {
    Rotation::from_xyzw(real(q.i), real(q.j), real(q.k), real(q.w)).normalize()
}

/// To the engine.
pub(super) fn pose(p: &Isometry3<f64>) -> Pose {
    Pose::from_parts(vector(&p.translation.vector), rotation(&p.rotation))
}

/// To the engine: mass, centre of mass and inertia of one body.
pub(super) fn mass_properties(mass: &Mass) -> MassProperties {
    let i = &mass.inertia;
    let column = |c: usize| Vector::new(real(i[(0, c)]), real(i[(1, c)]), real(i[(2, c)]));
    MassProperties::with_inertia_matrix(
        point(&mass.com),
        real(mass.mass),
        Matrix::from_cols(column(0), column(1), column(2)),
    )
}

/// From the engine.
pub(super) fn from_vector(v: Vector) -> Vector3<f64> {
    Vector3::new(f64::from(v.x), f64::from(v.y), f64::from(v.z))
}

/// From the engine. The rotation is normalised in double precision.
pub(super) fn from_pose(p: &Pose) -> Isometry3<f64> {
    let q = p.rotation;
    let q = Quaternion::new(
        f64::from(q.w),
        f64::from(q.x),
        f64::from(q.y),
        f64::from(q.z),
    );
    Isometry3::from_parts(
        Translation3::from(from_vector(p.translation)),
        UnitQuaternion::new_normalize(q),
    )
}
