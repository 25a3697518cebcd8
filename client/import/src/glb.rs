//! Writes binary glTF files: one mesh with positions and, for images, texture coordinates.

use std::collections::BTreeMap;

use crate::raster::Point3;

/// Corners of triangles with their texture coordinates, v upwards.
pub type Corner = (Point3, Option<[f32; 2]>);

/// The bytes of a GLB file. Positions have z up, as in the pack, and are rounded to 0.1 mm.
#[must_use]
pub fn write(triangles: &[[Corner; 3]]) -> Vec<u8> {
    let has_uvs = triangles.iter().flatten().all(|(_, uv)| uv.is_some());
    let mut index_of: BTreeMap<([i64; 3], [u32; 2]), u32> = BTreeMap::new();
    let mut positions: Vec<[f32; 3]> = Vec::new();
    let mut uvs: Vec<[f32; 2]> = Vec::new();
    let mut indices: Vec<u32> = Vec::new();
    for triangle in triangles {
        let corners = triangle.map(|(point, uv)| {
            let tenths = point.map(|c| (c * 1.0e4).round() as i64);
            let uv = uv.filter(|_| has_uvs).unwrap_or_default();
            let key = (tenths, uv.map(f32::to_bits));
            *index_of.entry(key).or_insert_with(|| {
                let [x, y, z] = tenths.map(|c| (c as f64 * 1.0e-4) as f32);
                // glTF has y up, and v downwards.
                positions.push([x, z, -y]);
                uvs.push([uv[0], 1.0 - uv[1]]);
                positions.len() as u32 - 1
            })
        });
        let [a, b, c] = corners;
        if a != b && b != c && c != a {
            indices.extend(corners);
        }
    }
    let short = positions.len() <= usize::from(u16::MAX);
    let mut body: Vec<u8> = Vec::new();
    body.extend(positions.iter().flatten().flat_map(|c| c.to_le_bytes()));
    let positions_end = body.len();
    if has_uvs {
        body.extend(uvs.iter().flatten().flat_map(|c| c.to_le_bytes()));
    }
    let uvs_end = body.len();
    for index in &indices {
        if short {
            body.extend((*index as u16).to_le_bytes());
        } else {
            body.extend(index.to_le_bytes());
        }
    }
    let indices_end = body.len();
    pad(&mut body, 0);
    let mut low = [f32::INFINITY; 3];
    let mut high = [f32::NEG_INFINITY; 3];
    for position in &positions {
        for axis in 0..3 {
            low[axis] = low[axis].min(position[axis]);
            high[axis] = high[axis].max(position[axis]);
        }
    }
    let list = |numbers: [f32; 3]| numbers.map(|n| n.to_string()).join(",");
    let count = positions.len();
    let kind = if short { 5123 } else { 5125 };
    let (uv_attribute, uv_accessor, uv_view) = if has_uvs {
        (
            r#","TEXCOORD_0":2"#,
            format!(r#",{{"bufferView":2,"componentType":5126,"count":{count},"type":"VEC2"}}"#),
            format!(
                r#",{{"buffer":0,"byteOffset":{positions_end},"byteLength":{}}}"#,
                uvs_end - positions_end
            ),
        )
    } else {
        ("", String::new(), String::new())
    };
    let mut json = format!(
        concat!(
            r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],"#,
            r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":0{}}},"indices":1}}]}}],"#,
            r#""accessors":[{{"bufferView":0,"componentType":5126,"count":{},"type":"VEC3","min":[{}],"max":[{}]}},"#,
            r#"{{"bufferView":1,"componentType":{},"count":{},"type":"SCALAR"}}{}],"#,
            r#""bufferViews":[{{"buffer":0,"byteOffset":0,"byteLength":{}}},"#,
            r#"{{"buffer":0,"byteOffset":{},"byteLength":{}}}{}],"#,
            r#""buffers":[{{"byteLength":{}}}]}}"#
        ),
        uv_attribute,
        count,
        list(low),
        list(high),
        kind,
        indices.len(),
        uv_accessor,
        positions_end,
        uvs_end,
        indices_end - uvs_end,
        uv_view,
        body.len(),
    )
    .into_bytes();
    pad(&mut json, b' ');
    let total = 12 + 8 + json.len() + 8 + body.len();
    let mut file = Vec::with_capacity(total);
    file.extend(b"glTF");
    file.extend(2u32.to_le_bytes());
    file.extend((total as u32).to_le_bytes());
    file.extend((json.len() as u32).to_le_bytes());
    file.extend(b"JSON");
    file.extend(json);
    file.extend((body.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(body);
    file
}

fn pad(bytes: &mut Vec<u8>, with: u8) {
    while !bytes.len().is_multiple_of(4) {
        bytes.push(with);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_is_valid_and_shares_corners() {
        let uv = |u: f32, v: f32| Some([u, v]);
        let a: [Corner; 3] = [
            ([0.0, 0.0, 0.0], uv(0.0, 0.0)),
            ([1.0, 0.0, 0.0], uv(1.0, 0.0)),
            ([1.0, 1.0, 0.5], uv(1.0, 1.0)),
        ];
        let b: [Corner; 3] = [a[0], a[2], ([0.0, 1.0, 0.0], uv(0.0, 1.0))];
        let bytes = write(&[a, b]);
        let gltf = gltf::Gltf::from_slice(&bytes).unwrap();
        let blob = gltf.blob.as_deref().unwrap();
        let mesh = gltf.meshes().next().unwrap();
        let primitive = mesh.primitives().next().unwrap();
        let reader = primitive.reader(|_| Some(blob));
        let positions: Vec<_> = reader.read_positions().unwrap().collect();
        assert_eq!(positions.len(), 4);
        assert_eq!(positions[2], [1.0, 0.5, -1.0], "y up");
        assert_eq!(reader.read_indices().unwrap().into_u32().count(), 6);
        let uvs: Vec<_> = reader.read_tex_coords(0).unwrap().into_f32().collect();
        assert_eq!(uvs[2], [1.0, 0.0]);
        let plain = write(&[a.map(|(point, _)| (point, None))]);
        let gltf = gltf::Gltf::from_slice(&plain).unwrap();
        assert_eq!(gltf.accessors().count(), 2);
    }
}
