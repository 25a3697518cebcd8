//! Scale and mirror image of a kind.

use super::pieces::check_hull;
use crate::error::{PackError, Place};
use crate::{
    GraspEntry, JointEntry, MeshEntry, MeshScale, PartEntry, PieceEntry, PrismEntry, SurfaceEntry,
};

/// Scale along x, y, z, and whether y is reversed before.
pub(super) struct Scaling {
    scale: [f64; 3],
    mirror: bool,
}

impl Scaling {
    pub(super) fn new(place: &Place, piece: &PieceEntry) -> Result<Self, PackError> {
        let scale = piece.scale.unwrap_or([1.0; 3]);
        for value in scale {
            place
                .key("scale")
                .within(value, 0.01, 100.0, "", "it is a factor for each axis")?;
        }
        Ok(Self {
            scale,
            mirror: piece.mirror,
        })
    }

    fn is_even(&self) -> bool {
        let [x, y, z] = self.scale;
        x == y && y == z
    }

    fn is_identity(&self) -> bool {
        self.scale == [1.0; 3] && !self.mirror
    }

    /// A vector with its y reversed when mirrored.
    fn mirrored(&self, v: [f64; 3]) -> [f64; 3] {
        match self.mirror {
            true => [v[0], 0.0 - v[1], v[2]],
            false => v,
        }
    }

    fn point(&self, p: [f64; 3]) -> [f64; 3] {
        let p = self.mirrored(p);
        [0, 1, 2].map(|i| p[i] * self.scale[i])
    }

    pub(super) fn part(&self, place: &Place, part: &PartEntry) -> Result<PartEntry, PackError> {
        if let Some(hull) = &part.hull {
            check_hull(place, hull)?;
        }
        if self.is_identity() {
            return Ok(part.clone());
        }
        let turned = part.rpy_deg.is_some_and(|rpy| rpy != [0.0; 3]);
        let [x, y, z] = self.scale;
        let uneven = |what: &str| {
            place.wrong(
                format!("{what} in a piece with scale {:?}", self.scale),
                "equal factors for it",
                "scale the piece evenly, or describe the shape as hull or mesh without rpy_deg",
            )
        };
        if turned && !self.is_even() {
            return Err(uneven("a turned shape"));
        }
        let round = part.cylinder.is_some()
            || part.frustum.is_some()
            || part.cup.is_some()
            || part.lathe.is_some();
        if (round && x != y)
            || ((part.sphere.is_some() || part.capsule.is_some()) && !self.is_even())
        {
            return Err(uneven("a round shape"));
        }
        let mut scaled = part.clone();
        if let Some(size) = &mut scaled.cuboid {
            *size = [size[0] * x, size[1] * y, size[2] * z];
        }
        if let Some(rounded) = &mut scaled.rounded_box {
            rounded.size = [
                rounded.size[0] * x,
                rounded.size[1] * y,
                rounded.size[2] * z,
            ];
            rounded.radius *= x.min(y).min(z);
        }
        for round in [&mut scaled.cylinder, &mut scaled.capsule]
            .into_iter()
            .flatten()
        {
            round.radius *= x;
            round.height *= z;
        }
        if let Some(sphere) = &mut scaled.sphere {
            sphere.radius *= x;
        }
        if let Some(frustum) = &mut scaled.frustum {
            frustum.bottom_radius *= x;
            frustum.top_radius *= x;
            frustum.height *= z;
        }
        if let Some(cup) = &mut scaled.cup {
            cup.bottom_radius *= x;
            cup.top_radius *= x;
            cup.height *= z;
            cup.wall *= x.min(z);
        }
        for point in scaled.lathe.iter_mut().flatten() {
            *point = [point[0] * x, point[1] * z];
        }
        if let Some(PrismEntry { outline, height }) = &mut scaled.prism {
            for point in outline {
                let [px, py, _] = self.point([point[0], point[1], 0.0]);
                *point = [px, py];
            }
            *height *= z;
        }
        for point in scaled.hull.iter_mut().flatten() {
            *point = self.point(*point);
        }
        if let Some(MeshEntry { scale, .. }) = &mut scaled.mesh {
            *scale = MeshScale::Axes(self.point(scale.axes()));
        }
        scaled.at = scaled.at.map(|at| self.point(at));
        for place in scaled.places.iter_mut().flatten() {
            *place = self.point(*place);
        }
        // A mirror image about y = 0 reverses the rotations about x and z.
        if self.mirror {
            scaled.rpy_deg = scaled.rpy_deg.map(|[r, p, y]| [0.0 - r, p, 0.0 - y]);
        }
        Ok(scaled)
    }

    pub(super) fn surface(
        &self,
        place: &Place,
        surface: &SurfaceEntry,
    ) -> Result<SurfaceEntry, PackError> {
        let quarter = surface.inwards_deg / 90.0;
        if !self.is_even() && quarter != quarter.round() {
            return Err(place.key("inwards_deg").wrong(
                format!(
                    "{} in a piece with scale {:?}",
                    surface.inwards_deg, self.scale
                ),
                "a multiple of 90 degrees",
                "turn the surface or scale the piece evenly",
            ));
        }
        let [x, y, _] = self.scale;
        let along_x = quarter.round() % 2.0 == 0.0;
        let (depth, width) = if along_x { (x, y) } else { (y, x) };
        Ok(SurfaceEntry {
            name: surface.name.clone(),
            edge: self.point(surface.edge),
            inwards_deg: match self.mirror {
                true => 0.0 - surface.inwards_deg,
                false => surface.inwards_deg,
            },
            depth: surface.depth * depth,
            width: surface.width * width,
        })
    }

    pub(super) fn grasp(&self, grasp: &GraspEntry) -> GraspEntry {
        let stretched = [0, 1, 2].map(|i| grasp.closing[i] * self.scale[i]);
        GraspEntry {
            point: self.point(grasp.point),
            approach: self.mirrored(grasp.approach),
            closing: self.mirrored(grasp.closing),
            width: if self.scale == [1.0; 3] {
                grasp.width
            } else {
                grasp.width * norm(stretched) / norm(grasp.closing).max(1e-9)
            },
            ..grasp.clone()
        }
    }

    /// The joint; its mass grows with the volume.
    pub(super) fn joint(&self, place: &Place, joint: &JointEntry) -> Result<JointEntry, PackError> {
        let (key, needed, other) = match joint.turns {
            true => ("travel_deg", joint.travel_deg, joint.travel),
            false => ("travel", joint.travel, joint.travel_deg),
        };
        if needed.is_none() || other.is_some() {
            return Err(place.wrong(
                "given without its travel, or with that of the other kind",
                format!("`{key}`"),
                "a sliding joint has `travel` in metres, a turning one (turns = true) `travel_deg`",
            ));
        }
        if self.is_identity() {
            return Ok(joint.clone());
        }
        let [x, y, z] = self.scale;
        let volume = x * y * z;
        // Second moments along each axis scale with the square of its factor.
        let [xx, yy, zz] = joint.inertia;
        let along = [
            (yy + zz - xx) / 2.0 * x * x * volume,
            (zz + xx - yy) / 2.0 * y * y * volume,
            (xx + yy - zz) / 2.0 * z * z * volume,
        ];
        let mirrored = self.mirrored(joint.axis);
        let stretched = [0, 1, 2].map(|i| joint.axis[i] * self.scale[i]);
        Ok(JointEntry {
            // The mirror image of a rotation turns the other way.
            axis: match joint.turns && self.mirror {
                true => mirrored.map(|c| 0.0 - c),
                false => mirrored,
            },
            travel: joint
                .travel
                .map(|travel| travel * norm(stretched) / norm(joint.axis).max(1e-9)),
            mass: joint.mass * volume,
            com: self.point(joint.com),
            inertia: [
                along[1] + along[2],
                along[2] + along[0],
                along[0] + along[1],
            ],
            ..joint.clone()
        })
    }
}

fn norm(v: [f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}
