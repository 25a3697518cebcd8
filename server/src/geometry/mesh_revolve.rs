//! Surfaces of revolution about z from a profile in the half plane.

use wheelarm_proto::exact;

use super::TriMesh;
use super::detail::{Detail, drop_slivers};

/// Points `[radius, z]` in metres along the surface, with the solid on the left.
pub(super) struct Profile {
    points: Vec<[f64; 2]>,
    /// Normals at the points are smooth at any angle.
    smooth: bool,
}

/// Edges with a larger angle stay sharp, radians (40 degrees).
const SHARP: f64 = 0.7;

impl Profile {
    /// A profile whose edges are smooth below 40 degrees. Open ends are closed by
    /// discs; the direction is corrected so that normals point outwards.
    pub(super) fn closed(mut points: Vec<[f64; 2]>) -> Self {
        points.dedup();
        let ring = points.len() > 3 && points.first() == points.last();
        if !ring {
            if let Some(&[_, z]) = points.first().filter(|p| p[0] > 0.0) {
                points.insert(0, [0.0, z]);
            }
            if let Some(&[_, z]) = points.last().filter(|p| p[0] > 0.0) {
                points.push([0.0, z]);
            }
        }
        // Twice the volume divided by pi: positive when the solid is on the left.
        let volume: f64 = points
            .windows(2)
            .map(|w| (w[0][0] + w[1][0]).powi(2) * (w[1][1] - w[0][1]))
            .sum();
        if volume < 0.0 {
            points.reverse();
        }
        Self {
            points,
            smooth: false,
        }
    }

    /// A round profile from pole to pole.
    pub(super) fn smooth(points: Vec<[f64; 2]>) -> Self {
        Self {
            points,
            smooth: true,
        }
    }
}

/// Rotates the profile about z. `u` is the arc length at the largest radius and `v` the
/// length along the profile; discs use `x` and `y`.
pub(super) fn revolve(profile: &Profile, detail: Detail) -> TriMesh {
    let points = &profile.points;
    let widest = points.iter().map(|p| p[0]).fold(0.0, f64::max);
    let chords = detail.chords(widest);
    let normals: Vec<[f64; 2]> = points
        .windows(2)
        .map(|w| {
            let (dr, dz) = (w[1][0] - w[0][0], w[1][1] - w[0][1]);
            let length = exact::hypot(dr, dz).max(1e-12);
            [dz / length, -dr / length]
        })
        .collect();
    let together = |a: [f64; 2], b: [f64; 2]| {
        let flat = |n: [f64; 2]| n[1].abs() > 0.95;
        let bend = exact::acos((a[0] * b[0] + a[1] * b[1]).clamp(-1.0, 1.0));
        profile.smooth || (bend < SHARP && flat(a) == flat(b))
    };
    let mean = |a: [f64; 2], b: [f64; 2]| {
        let sum = [a[0] + b[0], a[1] + b[1]];
        let length = exact::hypot(sum[0], sum[1]).max(1e-12);
        [sum[0] / length, sum[1] / length]
    };
    let ring = points.first() == points.last();

    let mut mesh = TriMesh::default();
    let mut travelled = 0.0;
    let mut shared: Option<u32> = None;
    for (i, w) in points.windows(2).enumerate() {
        let n = normals[i];
        let before = if i > 0 {
            Some(normals[i - 1])
        } else if ring {
            normals.last().copied()
        } else {
            // At the axis the profile is mirrored.
            Some([-n[0], n[1]])
        };
        let after = if i + 1 < normals.len() {
            Some(normals[i + 1])
        } else if ring {
            normals.first().copied()
        } else {
            Some([-n[0], n[1]])
        };
        let at = |other: Option<[f64; 2]>| match other {
            Some(o) if together(n, o) => mean(n, o),
            _ => n,
        };
        let disc = n[1].abs() > 0.95 && !profile.smooth;
        let low = shared.take().unwrap_or_else(|| {
            push_ring(&mut mesh, w[0], at(before), travelled, widest, chords, disc)
        });
        travelled += exact::hypot(w[1][0] - w[0][0], w[1][1] - w[0][1]);
        let high = push_ring(&mut mesh, w[1], at(after), travelled, widest, chords, disc);
        for k in 0..chords as u32 {
            let (a, b) = (low + k, high + k);
            mesh.indices.extend([a, a + 1, b, a + 1, b + 1, b]);
        }
        if i + 1 < normals.len() && together(n, normals[i + 1]) {
            shared = Some(high);
        }
    }
    drop_slivers(&mut mesh);
    mesh
}

fn push_ring(
    mesh: &mut TriMesh,
    [r, z]: [f64; 2],
    normal: [f64; 2],
    travelled: f64,
    widest: f64,
    chords: usize,
    disc: bool,
) -> u32 {
    let first = mesh.positions.len() as u32;
    for k in 0..=chords {
        let angle = k as f64 / chords as f64 * std::f64::consts::TAU;
        // The last column closes on the first exactly.
        let (sin, cos) = if k == chords {
            (0.0, 1.0)
        } else {
            exact::sin_cos(angle)
        };
        mesh.positions
            .push([(r * cos) as f32, (r * sin) as f32, z as f32]);
        mesh.normals.push([
            (normal[0] * cos) as f32,
            (normal[0] * sin) as f32,
            normal[1] as f32,
        ]);
        mesh.uvs.push(if disc {
            [(r * cos) as f32, (r * sin) as f32]
        } else {
            [(angle * widest) as f32, travelled as f32]
        });
    }
    first
}
