//! glTF and GLB files: metres, y up, base color and its image. Skins and animations are ignored.

use std::collections::BTreeSet;

use base64::Engine;
use nalgebra::{Matrix4, Point3};

use super::mesh::{Face, Mesh, Surface, Vec3};
use super::source::{Beside, Source, Up, too_many};
use crate::model::MOST_TRIANGLES;

/// Largest number of materials.
const MOST_MATERIALS: usize = 256;
/// Largest total size of buffers, bytes.
const MOST_BUFFERS: usize = 256 << 20;
/// Length of the header of a binary file.
const HEADER: u32 = 12;

/// Parses a file.
pub(super) fn parse(bytes: &[u8], beside: Beside<'_>) -> Result<Source, String> {
    // The parser subtracts the header from the stated length unchecked.
    let length = bytes.get(8..12).and_then(|field| field.try_into().ok());
    let length = length.map_or(HEADER, u32::from_le_bytes);
    if bytes.starts_with(b"glTF") && length < HEADER {
        return Err(format!("its header states {length} bytes; export it again"));
    }
    let gltf = gltf::Gltf::from_slice(bytes);
    let gltf::Gltf { document, blob } =
        gltf.map_err(|error| format!("not a valid glTF file ({error}); export it again as GLB"))?;
    let buffers = buffers(&document, blob, beside)?;
    let mut source = Source {
        mesh: Mesh::default(),
        metres: Some(1.0),
        up: Up::Y,
        up_is_defined: true,
        notes: Vec::new(),
    };
    if document.materials().count() > MOST_MATERIALS {
        return Err(format!(
            "more than {MOST_MATERIALS} materials; join some of them"
        ));
    }
    for material in document.materials() {
        let surface = surface(&material, &buffers, beside, &mut source.notes);
        source.mesh.surfaces.push(surface);
    }
    let scene = document
        .default_scene()
        .or_else(|| document.scenes().next());
    let scene = scene.ok_or("it has no scene; export it again")?;
    let mut pending: Vec<_> = scene.nodes().map(|n| (n, Matrix4::identity())).collect();
    // A scene is a tree: the walk ends, and visits each node once.
    let mut reached = BTreeSet::new();
    while let Some((node, parent)) = pending.pop() {
        if !reached.insert(node.index()) {
            return Err(format!(
                "node {} has two parents or is its own; export a tree of nodes",
                node.index()
            ));
        }
        let columns = node.transform().matrix();
        let own = Matrix4::from_fn(|row, column| f64::from(columns[column][row]));
        let world = parent * own;
        for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
            if let Some(note) = add(&mut source.mesh, &primitive, &buffers, &world)? {
                source.notes.push(note.to_owned());
            }
        }
        pending.extend(node.children().map(|child| (child, world)));
    }
    Ok(source)
}

fn buffers(
    document: &gltf::Document,
    mut blob: Option<Vec<u8>>,
    beside: Beside<'_>,
) -> Result<Vec<Vec<u8>>, String> {
    let mut all = Vec::new();
    let mut total = 0_usize;
    for buffer in document.buffers() {
        let data = match buffer.source() {
            gltf::buffer::Source::Bin => blob
                .take()
                .ok_or("its binary chunk is missing; export it again")?,
            gltf::buffer::Source::Uri(uri) => read_uri(uri, beside)?,
        };
        if data.len() < buffer.length() {
            return Err(format!(
                "buffer {} has {} bytes, expected {}; export it as one GLB file",
                buffer.index(),
                data.len(),
                buffer.length()
            ));
        }
        total = total.saturating_add(data.len());
        if total > MOST_BUFFERS {
            return Err(format!(
                "its buffers have more than {} MiB; simplify the mesh",
                MOST_BUFFERS >> 20
            ));
        }
        all.push(data);
    }
    Ok(all)
}

/// The bytes of a URI: embedded, or those of a file beside this one.
fn read_uri(uri: &str, beside: Beside<'_>) -> Result<Vec<u8>, String> {
    let Some(data) = uri.strip_prefix("data:") else {
        return beside(&decoded(uri)).map_err(|why| format!("{why}; export one GLB file"));
    };
    let text = data.split_once(";base64,").map(|(_, text)| text);
    let bytes = text.and_then(|text| base64::engine::general_purpose::STANDARD.decode(text).ok());
    bytes.ok_or_else(|| "a data URI is not base64; export it as one GLB file".into())
}

/// A URI without its percent signs.
fn decoded(uri: &str) -> String {
    let mut bytes = Vec::new();
    let mut rest = uri.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        let digit = |at: usize| {
            let digit = char::from(*after.get(at)?).to_digit(16)?;
            u8::try_from(digit).ok()
        };
        match (first, digit(0), digit(1)) {
            (b'%', Some(high), Some(low)) => {
                bytes.push(16 * high + low);
                rest = &after[2..];
            }
            _ => {
                bytes.push(first);
                rest = after;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

fn surface(
    material: &gltf::Material<'_>,
    buffers: &[Vec<u8>],
    beside: Beside<'_>,
    notes: &mut Vec<String>,
) -> Surface {
    let about = material.pbr_metallic_roughness();
    let [red, green, blue, _] = about.base_color_factor();
    let image = about.base_color_texture().and_then(|texture| {
        let bytes = match texture.texture().source().source() {
            gltf::image::Source::View { view, .. } => {
                let buffer = buffers.get(view.buffer().index());
                let end = view.offset().checked_add(view.length());
                let bytes = buffer
                    .zip(end)
                    .and_then(|(b, end)| b.get(view.offset()..end));
                bytes
                    .map(<[u8]>::to_vec)
                    .ok_or_else(|| "it is cut off".to_owned())
            }
            gltf::image::Source::Uri { uri, .. } => read_uri(uri, beside),
        };
        bytes
            .map_err(|why| notes.push(format!("an image is left out: {why}")))
            .ok()
    });
    Surface {
        // The factors are linear.
        colour: [red, green, blue].map(encoded),
        roughness: f64::from(about.roughness_factor().clamp(0.05, 1.0)),
        metallic: f64::from(about.metallic_factor().clamp(0.0, 1.0)),
        image,
    }
}

/// A linear value as 8 bits of sRGB.
fn encoded(linear: f32) -> u8 {
    let linear = f64::from(linear).clamp(0.0, 1.0);
    let encoded = match linear {
        x if x <= 0.003_130_8 => 12.92 * x,
        x => 1.055 * wheelarm_proto::exact::powf(x, 1.0 / 2.4) - 0.055,
    };
    (encoded * 255.0).round() as u8
}

/// Adds a primitive; returns a note when its type is ignored.
fn add(
    mesh: &mut Mesh,
    primitive: &gltf::Primitive<'_>,
    buffers: &[Vec<u8>],
    world: &Matrix4<f64>,
) -> Result<Option<&'static str>, String> {
    use gltf::mesh::Mode;
    if !matches!(
        primitive.mode(),
        Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
    ) {
        return Ok(Some("points and lines are ignored"));
    }
    let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(Vec::as_slice));
    let positions = reader.read_positions();
    let positions = positions.ok_or("a primitive has no positions; export it again")?;
    if positions.len() > 3 * MOST_TRIANGLES {
        return Err(too_many());
    }
    let points: Vec<Vec3> = positions
        .map(|point| {
            world
                .transform_point(&Point3::from(point.map(f64::from)))
                .coords
        })
        .collect();
    let uvs: Option<Vec<[f32; 2]>> = reader
        .read_tex_coords(0)
        .map(|uvs| uvs.into_f32().take(points.len()).collect());
    let corners: Vec<u32> = match reader.read_indices() {
        Some(indices) => indices.into_u32().take(3 * MOST_TRIANGLES + 1).collect(),
        None => (0..points.len() as u32).collect(),
    };
    let mirrors = world.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
    let surface = primitive.material().index().unwrap_or(usize::MAX);
    for mut triangle in triangles(primitive.mode(), &corners) {
        if mesh.faces.len() >= MOST_TRIANGLES {
            return Err(too_many());
        }
        if mirrors {
            triangle.swap(1, 2);
        }
        let at = |k: u32| points.get(k as usize).copied();
        let [Some(a), Some(b), Some(c)] = triangle.map(at) else {
            return Err("a face names a vertex that does not exist; export it again".into());
        };
        let of = triangle.map(|k| Some(*uvs.as_ref()?.get(k as usize)?));
        mesh.faces.push(Face {
            corners: [a, b, c],
            // glTF has v downwards.
            uvs: match of {
                [Some(a), Some(b), Some(c)] => Some([a, b, c].map(|[u, v]| [u, 1.0 - v])),
                _ => None,
            },
            surface,
        });
    }
    Ok(None)
}

/// Separate triangles, all counter-clockwise as in the file.
fn triangles(mode: gltf::mesh::Mode, corners: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        gltf::mesh::Mode::TriangleStrip => corners
            .windows(3)
            .enumerate()
            .map(|(k, w)| match k % 2 {
                0 => [w[0], w[1], w[2]],
                _ => [w[1], w[0], w[2]],
            })
            .collect(),
        gltf::mesh::Mode::TriangleFan => match corners.split_first() {
            Some((&hub, rim)) => rim.windows(2).map(|w| [hub, w[0], w[1]]).collect(),
            None => Vec::new(),
        },
        _ => corners.as_chunks::<3>().0.to_vec(),
    }
}
