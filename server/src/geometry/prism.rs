//! Triangles of a prism: a polygon with a thickness.

use super::TriMesh;

/// A prism from z = 0 to z = `height`. The outline does not cross itself and may run in either
/// direction; texture coordinates are metres.
pub(super) fn prism(outline: &[[f64; 2]], height: f64) -> TriMesh {
    let mut corners = outline.to_vec();
    if wheelarm_pack::area(&corners) < 0.0 {
        corners.reverse();
    }
    let mut mesh = TriMesh::default();
    let faces = triangles(&corners);
    for (z, up) in [(0.0, -1.0), (height, 1.0)] {
        let first = mesh.positions.len() as u32;
        for [x, y] in &corners {
            mesh.positions.push([*x as f32, *y as f32, z as f32]);
            mesh.normals.push([0.0, 0.0, up]);
            mesh.uvs.push([*x as f32, *y as f32]);
        }
        for [a, b, c] in &faces {
            let [b, c] = if up > 0.0 { [b, c] } else { [c, b] };
            mesh.indices
                .extend([a, b, c].map(|corner| first + *corner as u32));
        }
    }
    let mut along = 0.0;
    for (i, from) in corners.iter().enumerate() {
        let to = corners[(i + 1) % corners.len()];
        let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
        let length = (dx * dx + dy * dy).sqrt();
        let normal = [(dy / length) as f32, (-dx / length) as f32, 0.0];
        let first = mesh.positions.len() as u32;
        for (at, u) in [(*from, along), (to, along + length)] {
            for z in [0.0, height] {
                mesh.positions.push([at[0] as f32, at[1] as f32, z as f32]);
                mesh.normals.push(normal);
                mesh.uvs.push([u as f32, z as f32]);
            }
        }
        mesh.indices
            .extend([0, 2, 1, 1, 2, 3].map(|corner| first + corner));
        along += length;
    }
    mesh
}

/// Triangles of a polygon that runs counter-clockwise, as indices of its corners: an ear is cut
/// off until three corners remain.
fn triangles(corners: &[[f64; 2]]) -> Vec<[usize; 3]> {
    let cross = |a: usize, b: usize, c: usize| {
        let [a, b, c] = [a, b, c].map(|i| corners[i]);
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let mut left: Vec<usize> = (0..corners.len()).collect();
    let mut found = Vec::new();
    while left.len() > 3 {
        let count = left.len();
        let ear = (0..count).find(|i| {
            let [a, b, c] = [
                left[(i + count - 1) % count],
                left[*i],
                left[(i + 1) % count],
            ];
            let inside = |p: &usize| {
                ![a, b, c].contains(p)
                    && cross(a, b, *p) >= 0.0
                    && cross(b, c, *p) >= 0.0
                    && cross(c, a, *p) >= 0.0
            };
            cross(a, b, c) > 0.0 && !left.iter().any(inside)
        });
        // Rounding can hide the last ears, which are flat; any corner will do.
        let ear = ear.unwrap_or(0);
        let [a, c] = [left[(ear + count - 1) % count], left[(ear + 1) % count]];
        if cross(a, left[ear], c) > 0.0 {
            found.push([a, left[ear], c]);
        }
        left.remove(ear);
    }
    if let [a, b, c] = left[..]
        && cross(a, b, c) > 0.0
    {
        found.push([a, b, c]);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Area of the triangles that face upwards, and volume inside the surface.
    fn measures(mesh: &TriMesh) -> (f64, f64) {
        let (mut top, mut volume) = (0.0, 0.0);
        for triangle in mesh.indices.as_chunks::<3>().0 {
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].map(f64::from));
            let u = nalgebra::Vector3::from(b) - nalgebra::Vector3::from(a);
            let v = nalgebra::Vector3::from(c) - nalgebra::Vector3::from(a);
            let normal = u.cross(&v) / 2.0;
            top += normal.z.max(0.0);
            volume += nalgebra::Vector3::from(a).dot(&normal) / 3.0;
            let given = nalgebra::Vector3::from(mesh.normals[triangle[0] as usize]).cast::<f64>();
            assert!(given.dot(&normal) > 0.0);
        }
        (top, volume)
    }

    #[test]
    fn concave_outlines_are_closed_solids_in_both_directions() {
        let outline = [
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 3.0],
            [3.0, 3.0],
            [3.0, 1.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [0.0, 3.0],
        ];
        let mut back = outline;
        back.reverse();
        for outline in [outline, back] {
            let mesh = prism(&outline, 0.5);
            let (top, volume) = measures(&mesh);
            assert!((top - 8.0).abs() < 1e-5, "{top}");
            assert!((volume - 4.0).abs() < 1e-5, "{volume}");
        }
    }
}
