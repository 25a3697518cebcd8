//! Normals and texture coordinates for meshes without them.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::TriMesh;

/// Cosine of the angle above which an edge stays sharp (40 degrees).
const SHARP_COSINE: f32 = 0.766;

/// The mesh with normals averaged over faces that bend by less than 40 degrees.
pub(super) fn crease_normals(mesh: &TriMesh) -> TriMesh {
    let point = |i: u32| Vector3::from(mesh.positions[i as usize]);
    let (triangles, _) = mesh.indices.as_chunks::<3>();
    // Not normalised: larger faces have more weight in the average.
    let faces: Vec<Vector3<f32>> = triangles
        .iter()
        .map(|&[a, b, c]| (point(b) - point(a)).cross(&(point(c) - point(a))))
        .collect();
    let mut around: BTreeMap<[u32; 3], Vec<usize>> = BTreeMap::new();
    let key = |i: u32| mesh.positions[i as usize].map(|x| (x + 0.0).to_bits());
    for (face, triangle) in triangles.iter().enumerate() {
        for &corner in triangle {
            around.entry(key(corner)).or_default().push(face);
        }
    }
    let mut out = TriMesh::default();
    let mut known: BTreeMap<(u32, [u32; 3]), u32> = BTreeMap::new();
    for (face, triangle) in triangles.iter().enumerate() {
        let own = faces[face].normalize();
        for &corner in triangle {
            let sum: Vector3<f32> = around[&key(corner)]
                .iter()
                .map(|&other| faces[other])
                .filter(|n| n.normalize().dot(&own) > SHARP_COSINE)
                .sum();
            let normal: [f32; 3] = sum.normalize().into();
            let index = *known
                .entry((corner, normal.map(f32::to_bits)))
                .or_insert_with(|| {
                    out.positions.push(mesh.positions[corner as usize]);
                    out.normals.push(normal);
                    out.uvs.push(mesh.uvs[corner as usize]);
                    out.positions.len() as u32 - 1
                });
            out.indices.push(index);
        }
    }
    out
}

/// Texture coordinates in metres, projected along the largest part of the normal.
pub(crate) fn box_uvs(mesh: &mut TriMesh) {
    for ((uv, p), n) in mesh.uvs.iter_mut().zip(&mesh.positions).zip(&mesh.normals) {
        let [x, y, z] = n.map(f32::abs);
        *uv = if z >= x && z >= y {
            [p[0], p[1]]
        } else if x >= y {
            [p[1] * n[0].signum(), p[2]]
        } else {
            [-p[0] * n[1].signum(), p[2]]
        };
    }
}
