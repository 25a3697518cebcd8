//! Deformables: converts lobes and elasticity of an object file to a plush toy.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::error::{Place, SceneError};
use super::file::{LobeEntry, ObjectFile};
use super::part::Reader;
use crate::geometry::plush::{Lobe, Plush};

/// A deformable.
#[derive(Clone, Debug, PartialEq)]
pub struct Soft {
    /// Its rest shape, in the object's frame.
    pub plush: Plush,
    /// Pa.
    pub young_modulus: f64,
    /// Below 0.5.
    pub poisson_ratio: f64,
    /// Stress per strain rate over stress per strain, seconds.
    pub damping: f64,
    /// Edge of the cubes, divided into five tetrahedra each, metres.
    pub tet_pitch: f64,
    /// Width of the skin's triangles, metres.
    pub skin_pitch: f64,
}

/// The deformable part of an object file, if any.
pub(super) fn read(
    reader: &Reader<'_>,
    place: &Place,
    file: &ObjectFile,
) -> Result<Option<Soft>, SceneError> {
    let Some(entry) = &file.soft else {
        return if file.lobes.is_empty() {
            Ok(None)
        } else {
            Err(place.key("lobes").wrong(
                format!("{} lobes", file.lobes.len()),
                "none without [soft]",
                "say how soft the lobes are under [soft]",
            ))
        };
    };
    let within = |key: &str, value, low, high, unit, cure| {
        place
            .key("soft")
            .key(key)
            .within(value, low, high, unit, cure)
    };
    let mut lobes = Vec::new();
    for (i, lobe) in file.lobes.iter().enumerate() {
        add(reader, &place.entry("lobes", i), lobe, &mut lobes)?;
    }
    if lobes.is_empty() {
        return Err(place.key("lobes").wrong(
            "empty",
            "at least one lobe",
            "list the ellipsoids that the toy is made of",
        ));
    }
    Ok(Some(Soft {
        plush: Plush { lobes },
        young_modulus: within(
            "young_modulus",
            entry.young_modulus,
            500.0,
            1e5,
            "Pa",
            "upholstery foam has 1000 to 50000 Pa",
        )?,
        poisson_ratio: within(
            "poisson_ratio",
            entry.poisson_ratio,
            0.0,
            0.45,
            "",
            "linear tetrahedra lock beyond",
        )?,
        damping: within(
            "damping",
            entry.damping,
            0.0042,
            0.1,
            "s",
            "an implicit tick of 1/240 s damps as much by itself",
        )?,
        tet_pitch: within(
            "tet_pitch",
            entry.tet_pitch,
            0.01,
            0.1,
            "m",
            "finer tetrahedra cost time, coarser loses the limbs",
        )?,
        skin_pitch: within(
            "skin_pitch",
            entry.skin_pitch,
            0.003,
            0.02,
            "m",
            "fingers must not fit between the vertices",
        )?,
    }))
}

fn add(
    reader: &Reader<'_>,
    place: &Place,
    entry: &LobeEntry,
    lobes: &mut Vec<Lobe>,
) -> Result<(), SceneError> {
    for radius in entry.radii {
        place
            .key("radii")
            .within(radius, 0.002, 0.5, "m", "semi-axes are metres")?;
    }
    let blend = place
        .key("blend")
        .within(entry.blend, 1e-4, 0.2, "m", "blending is a length")?;
    let at = Vector3::from(place.key("at").position(entry.at)?);
    let [roll, pitch, yaw] = entry.rpy_deg.map(f64::to_radians);
    let turn = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    let material = reader.named(&place.key("material"), &entry.material)?;
    let mut lobe = Lobe {
        pose: Isometry3::from_parts(Translation3::from(at), turn),
        radii: entry.radii,
        blend,
        material,
    };
    lobes.push(lobe.clone());
    if entry.mirrored {
        // Mirrored about the plane x = 0; an ellipsoid is its own mirror image.
        let q = turn.quaternion();
        let mirrored = nalgebra::Quaternion::new(q.w, q.i, -q.j, -q.k);
        lobe.pose = Isometry3::from_parts(
            Translation3::new(-at.x, at.y, at.z),
            UnitQuaternion::new_normalize(mirrored),
        );
        lobes.push(lobe);
    }
    Ok(())
}

impl Soft {
    /// The skin in its rest shape, in the object's frame.
    #[must_use]
    pub fn skin(&self) -> crate::geometry::plush::Skin {
        self.plush.skin(self.skin_pitch)
    }

    /// Corners of its bounding box at rest, metres.
    #[must_use]
    pub fn bounds(&self) -> (Point3<f64>, Point3<f64>) {
        self.plush.bounds()
    }
}
