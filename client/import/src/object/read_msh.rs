//! MSH files, the binary meshes of MuJoCo: four counts, then vertices, normals, texture
//! coordinates and faces, little-endian. They state no units; in MJCF they are metres.

use super::mesh::{Mesh, Surface};
use super::source::{Source, Up, face, too_many};
use crate::model::MOST_TRIANGLES;

/// Bytes of the counts.
const HEAD: usize = 16;

/// Parses a file.
pub(super) fn parse(bytes: &[u8]) -> Result<Source, String> {
    let (words, rest) = bytes.as_chunks::<4>();
    let wrong = || {
        format!(
            "{} bytes do not match its counts of vertices, normals, texture coordinates and faces; \
             export it again, for example as OBJ",
            bytes.len()
        )
    };
    let counts: Vec<usize> = words
        .iter()
        .take(HEAD / 4)
        .filter_map(|word| usize::try_from(i32::from_le_bytes(*word)).ok())
        .collect();
    let [vertices, normals, coordinates, faces] = counts[..] else {
        return Err(wrong());
    };
    if faces > MOST_TRIANGLES {
        return Err(too_many());
    }
    let sizes = [(vertices, 3), (normals, 3), (coordinates, 2), (faces, 3)];
    let total = sizes.iter().try_fold(HEAD / 4, |sum, (count, each)| {
        count
            .checked_mul(*each)
            .and_then(|size| size.checked_add(sum))
    });
    if total != Some(words.len()) || !rest.is_empty() {
        return Err(wrong());
    }
    let float = |index: usize| words.get(index).map(|word| f32::from_le_bytes(*word));
    let first = HEAD / 4;
    let first_coordinate = first + 3 * (vertices + normals);
    let first_face = first_coordinate + 2 * coordinates;
    let corner = |index: usize| -> Option<[f64; 3]> {
        let at = first + 3 * index;
        let [x, y, z] = [float(at)?, float(at + 1)?, float(at + 2)?];
        Some([x, y, z].map(f64::from))
    };
    let uv = |index: usize| -> Option<[f32; 2]> {
        let at = first_coordinate + 2 * index;
        // v downwards.
        Some([float(at)?, 1.0 - float(at + 1)?])
    };
    let mut mesh = Mesh {
        faces: Vec::with_capacity(faces),
        surfaces: vec![Surface::default()],
    };
    for triangle in words[first_face..].as_chunks::<3>().0 {
        let indices = triangle.map(|word| usize::try_from(i32::from_le_bytes(word)).ok());
        let [Some(a), Some(b), Some(c)] = indices.map(|i| i.filter(|i| *i < vertices)) else {
            return Err("a face names a vertex that does not exist; export it again".into());
        };
        let corners = [corner(a), corner(b), corner(c)];
        let [Some(p), Some(q), Some(r)] = corners else {
            return Err(wrong());
        };
        let uvs = match coordinates == vertices {
            true => uv(a).zip(uv(b)).zip(uv(c)).map(|((a, b), c)| [a, b, c]),
            false => None,
        };
        mesh.faces.push(face([p, q, r], uvs, 0));
    }
    Ok(Source {
        mesh,
        metres: None,
        up: Up::Z,
        up_is_defined: false,
        notes: Vec::new(),
    })
}
