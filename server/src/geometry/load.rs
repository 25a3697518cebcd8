//! Loads mesh files: OBJ with z up, glTF converted from y up. Only geometry is used:
//! materials, animations and skins are ignored. Other ignored content is logged.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use nalgebra::{Matrix4, Point3, Vector3};

use super::detail::drop_slivers;
use super::load_normals::{box_uvs, crease_normals};
use super::mesh::{MAX_TRIANGLES, MeshError};
use super::{PackedFile, TriMesh};

/// Reads an OBJ, glTF or GLB file: all its objects merged, metres, z up.
///
/// Missing normals are computed with edges sharp above 40 degrees, missing texture
/// coordinates by projection along the largest component of the normal.
///
/// # Errors
/// When the file cannot be read or parsed, has no triangles, too many, or a
/// position that is not finite.
pub fn load(path: &Path) -> Result<TriMesh, MeshError> {
    let extension = path
        .extension()
        .map(|e| e.to_string_lossy().to_ascii_lowercase())
        .unwrap_or_default();
    let soup = match extension.as_str() {
        "obj" => {
            let bytes = fs::read(path).map_err(|e| unreadable(path, &e))?;
            load_obj(path, &bytes)?
        }
        "gltf" | "glb" => {
            let bytes = fs::read(path).map_err(|e| unreadable(path, &e))?;
            load_gltf(path, &bytes, &|uri| read_uri(path, uri))?
        }
        _ => {
            return Err(MeshError::UnknownFormat {
                path: path.to_owned(),
                extension,
            });
        }
    };
    finish(path, soup)
}

/// The mesh of a pack's OBJ or GLB file, scaled along x, y, z with z up. It refers to no other
/// file.
///
/// # Errors
/// As [`load`].
pub(crate) fn load_packed(file: &PackedFile, scale: &[f64; 3]) -> Result<TriMesh, MeshError> {
    let named = file.asset_path();
    let path = Path::new(&named);
    let mut soup = match file.path().rsplit_once('.') {
        Some((_, "obj")) => load_obj(path, file.bytes())?,
        _ => load_gltf(path, file.bytes(), &|_| {
            let why = "refers to another file; export one GLB file with its buffers";
            Err(malformed(path, why))
        })?,
    };
    soup.scale(scale);
    finish(path, soup)
}

/// Unindexed data in file order; `normals` and `uvs` are empty or as long as
/// `positions`.
#[derive(Default)]
struct Soup {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    indices: Vec<u32>,
    lacks_normals: bool,
    lacks_uvs: bool,
}

impl Soup {
    /// Scales positions; a mirror image turns the triangles round.
    fn scale(&mut self, scale: &[f64; 3]) {
        for position in &mut self.positions {
            for (value, scale) in position.iter_mut().zip(scale) {
                *value = (f64::from(*value) * scale) as f32;
            }
        }
        for normal in &mut self.normals {
            let turned: [f64; 3] = std::array::from_fn(|k| f64::from(normal[k]) / scale[k]);
            let length = turned.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-12);
            *normal = turned.map(|x| (x / length) as f32);
        }
        if scale.iter().product::<f64>() < 0.0 {
            for triangle in self.indices.as_chunks_mut::<3>().0 {
                triangle.swap(1, 2);
            }
        }
    }

    /// Appends one object; missing data is computed for the whole file later.
    fn append(
        &mut self,
        positions: impl Iterator<Item = [f32; 3]>,
        normals: Option<Vec<[f32; 3]>>,
        uvs: Option<Vec<[f32; 2]>>,
        indices: impl Iterator<Item = u32>,
    ) {
        let first = self.positions.len();
        self.positions.extend(positions);
        let count = self.positions.len() - first;
        match normals.filter(|n| n.len() == count) {
            Some(normals) => self.normals.extend(normals),
            None => {
                self.normals.extend(std::iter::repeat_n([0.0; 3], count));
                self.lacks_normals = true;
            }
        }
        match uvs.filter(|u| u.len() == count) {
            Some(uvs) => self.uvs.extend(uvs),
            None => {
                self.uvs.extend(std::iter::repeat_n([0.0; 2], count));
                self.lacks_uvs = true;
            }
        }
        self.indices.extend(indices.map(|i| i + first as u32));
    }
}

fn unreadable(path: &Path, error: &std::io::Error) -> MeshError {
    MeshError::Unreadable {
        path: path.to_owned(),
        reason: error.to_string(),
    }
}

fn malformed(path: &Path, reason: impl Into<String>) -> MeshError {
    MeshError::Malformed {
        path: path.to_owned(),
        reason: reason.into(),
    }
}

/// Known statements of an OBJ file, including those without effect on the surface.
const OBJ_STATEMENTS: [&str; 10] = ["v", "vn", "vt", "f", "o", "g", "s", "usemtl", "mtllib", ""];

/// The text of an OBJ file for the parser: without byte order mark, continued lines
/// joined, other encodings than UTF-8 (in names and comments) replaced. Counts ignored
/// statements.
fn obj_text(path: &Path, bytes: &[u8]) -> Result<String, MeshError> {
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        return Err(malformed(
            path,
            "the text is UTF-16; save the file as UTF-8",
        ));
    }
    let text = String::from_utf8_lossy(bytes);
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let text = text.replace("\r\n", "\n").replace("\\\n", " ");
    let mut left_out: BTreeMap<&str, usize> = BTreeMap::new();
    for line in text.lines() {
        let statement = line.split_whitespace().next().unwrap_or_default();
        if !statement.starts_with('#') && !OBJ_STATEMENTS.contains(&statement) {
            *left_out.entry(statement).or_default() += 1;
        }
    }
    if !left_out.is_empty() {
        tracing::warn!(
            "mesh {}: ignored statements (statement: count): {left_out:?}",
            path.display()
        );
    }
    Ok(text)
}

fn load_obj(path: &Path, bytes: &[u8]) -> Result<Soup, MeshError> {
    let text = obj_text(path, bytes)?;
    let options = tobj::LoadOptions {
        single_index: true,
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
    };
    let no_materials = |_: &Path| Ok((Vec::new(), Default::default()));
    let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, no_materials)
        .map_err(|e| malformed(path, format!("not a valid OBJ file ({e})")))?;
    let mut soup = Soup::default();
    for model in models {
        let mesh = model.mesh;
        let (points, _) = mesh.positions.as_chunks::<3>();
        let (normals, _) = mesh.normals.as_chunks::<3>();
        let (uvs, _) = mesh.texcoords.as_chunks::<2>();
        soup.append(
            points.iter().copied(),
            Some(normals.to_vec()),
            Some(uvs.to_vec()),
            mesh.indices.iter().copied(),
        );
    }
    Ok(soup)
}

/// A binary file contains its length, including its header of 12 bytes; the parser
/// subtracts those unchecked.
pub(crate) fn check_glb_length(path: &Path, bytes: &[u8]) -> Result<(), MeshError> {
    const HEADER: u32 = 12;
    let length = bytes.get(8..12).and_then(|field| field.try_into().ok());
    match length.map(u32::from_le_bytes) {
        Some(length) if bytes.starts_with(b"glTF") && length < HEADER => Err(malformed(
            path,
            format!("not a valid glTF file (its header says {length} bytes)"),
        )),
        _ => Ok(()),
    }
}

/// Parses a glTF or GLB file; `read_buffer` reads a buffer by its URI.
fn load_gltf(
    path: &Path,
    bytes: &[u8],
    read_buffer: &dyn Fn(&str) -> Result<Vec<u8>, MeshError>,
) -> Result<Soup, MeshError> {
    check_glb_length(path, bytes)?;
    let gltf::Gltf { document, blob } = gltf::Gltf::from_slice(bytes)
        .map_err(|e| malformed(path, format!("not a valid glTF file ({e})")))?;
    let mut blob = blob;
    let buffers = document
        .buffers()
        .map(|buffer| {
            let data = match buffer.source() {
                gltf::buffer::Source::Bin => blob
                    .take()
                    .ok_or_else(|| malformed(path, "refers to a missing binary chunk"))?,
                gltf::buffer::Source::Uri(uri) => read_buffer(uri)?,
            };
            if data.len() < buffer.length() {
                return Err(malformed(
                    path,
                    format!(
                        "buffer {} has {} bytes, expected {}",
                        buffer.index(),
                        data.len(),
                        buffer.length()
                    ),
                ));
            }
            Ok(data)
        })
        .collect::<Result<Vec<_>, _>>()?;

    // glTF has y up: (x, y, z) becomes (x, -z, y).
    let z_up_from_y_up = Matrix4::new(
        1.0, 0.0, 0.0, 0.0, //
        0.0, 0.0, -1.0, 0.0, //
        0.0, 1.0, 0.0, 0.0, //
        0.0, 0.0, 0.0, 1.0,
    );
    let scene = document
        .default_scene()
        .or_else(|| document.scenes().next())
        .ok_or_else(|| MeshError::Empty {
            path: path.to_owned(),
        })?;
    let mut soup = Soup::default();
    let mut pending: Vec<_> = scene.nodes().map(|n| (n, z_up_from_y_up)).collect();
    pending.reverse();
    // A scene must be a tree: then the traversal ends and each node is visited once.
    let mut reached = BTreeSet::new();
    while let Some((node, world_from_parent)) = pending.pop() {
        if !reached.insert(node.index()) {
            let index = node.index();
            return Err(malformed(
                path,
                format!("node {index} has two parents or is its own; export a tree of nodes"),
            ));
        }
        let count = soup.indices.len() / 3;
        if count > MAX_TRIANGLES {
            return Err(MeshError::TooManyTriangles {
                path: path.to_owned(),
                count,
            });
        }
        let columns = node.transform().matrix();
        let local = Matrix4::from_fn(|row, column| columns[column][row]);
        let world_from_node = world_from_parent * local;
        if let Some(mesh) = node.mesh() {
            for primitive in mesh.primitives() {
                let left_out =
                    add_primitive(path, &mut soup, &primitive, &buffers, &world_from_node)?;
                if let Some(why) = left_out {
                    tracing::warn!(
                        "mesh {}: primitive {} of mesh {} is ignored: {why}",
                        path.display(),
                        primitive.index(),
                        mesh.name()
                            .map_or_else(|| mesh.index().to_string(), str::to_owned)
                    );
                }
            }
        }
        let children: Vec<_> = node.children().map(|c| (c, world_from_node)).collect();
        pending.extend(children.into_iter().rev());
    }
    let unused = document.nodes().filter(|node| node.mesh().is_some());
    let unused = unused
        .filter(|node| !reached.contains(&node.index()))
        .count();
    if unused > 0 {
        tracing::warn!(
            "mesh {}: {unused} nodes with a mesh are ignored: the default scene does not contain them",
            path.display()
        );
    }
    Ok(soup)
}

/// Appends a primitive; returns a description when its type is ignored.
fn add_primitive(
    path: &Path,
    soup: &mut Soup,
    primitive: &gltf::Primitive<'_>,
    buffers: &[Vec<u8>],
    world_from_node: &Matrix4<f32>,
) -> Result<Option<&'static str>, MeshError> {
    use gltf::mesh::Mode;
    match primitive.mode() {
        Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan => {}
        Mode::Points => return Ok(Some("it consists of points")),
        Mode::Lines | Mode::LineLoop | Mode::LineStrip => {
            return Ok(Some("it consists of lines"));
        }
    }
    let reader = primitive.reader(|b| buffers.get(b.index()).map(Vec::as_slice));
    let positions: Vec<[f32; 3]> = reader
        .read_positions()
        .ok_or_else(|| malformed(path, "a primitive has no positions"))?
        .map(|p| world_from_node.transform_point(&Point3::from(p)).into())
        .collect();
    let turn = world_from_node.fixed_view::<3, 3>(0, 0).into_owned();
    // A node with a zero scale makes its surface flat: the file's normals do not apply,
    // and triangles without area are dropped later.
    let normal_turn = turn.try_inverse().map(|inverse| inverse.transpose());
    let normals = reader.read_normals().zip(normal_turn);
    let normals = normals.map(|(normals, turn)| {
        normals
            .map(|n| (turn * Vector3::from(n)).normalize().into())
            .collect()
    });
    let uvs = reader
        .read_tex_coords(0)
        .map(|uvs| uvs.into_f32().collect::<Vec<_>>());
    let corners: Vec<u32> = match reader.read_indices() {
        Some(indices) => indices.into_u32().collect(),
        None => (0..positions.len() as u32).collect(),
    };
    let mut indices = triangles(primitive.mode(), corners);
    if turn.determinant() < 0.0 {
        for triangle in indices.as_chunks_mut::<3>().0 {
            triangle.swap(1, 2);
        }
    }
    soup.append(positions.into_iter(), normals, uvs, indices.into_iter());
    Ok(None)
}

/// Corners of separate triangles, all counter-clockwise as in the file.
fn triangles(mode: gltf::mesh::Mode, mut corners: Vec<u32>) -> Vec<u32> {
    match mode {
        gltf::mesh::Mode::TriangleStrip => {
            let windows = corners.windows(3).enumerate();
            let turned = windows.flat_map(|(k, w)| match k % 2 {
                0 => [w[0], w[1], w[2]],
                _ => [w[1], w[0], w[2]],
            });
            turned.collect()
        }
        gltf::mesh::Mode::TriangleFan => {
            let Some((&hub, rim)) = corners.split_first() else {
                return corners;
            };
            rim.windows(2).flat_map(|w| [hub, w[0], w[1]]).collect()
        }
        _ => {
            corners.truncate(corners.len() / 3 * 3);
            corners
        }
    }
}

/// Bytes of a buffer: a file next to this one, or embedded base64.
fn read_uri(path: &Path, uri: &str) -> Result<Vec<u8>, MeshError> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (_, text) = data
            .split_once(";base64,")
            .ok_or_else(|| malformed(path, "a data URI is not base64"))?;
        return decode_base64(text)
            .ok_or_else(|| malformed(path, "a data URI is not valid base64"));
    }
    if uri.contains("://") {
        return Err(malformed(
            path,
            format!("the buffer {uri:?} is not next to the file; export it with its buffers"),
        ));
    }
    let name = decode_percent(uri).ok_or_else(|| {
        malformed(
            path,
            format!("the URI {uri:?} is not percent-encoded UTF-8"),
        )
    })?;
    let (beside, literal) = (path.with_file_name(name), path.with_file_name(uri));
    // Some exporters do not encode names, which may contain a percent sign.
    let found = match beside.exists() {
        true => beside,
        false if literal.exists() => literal,
        false => beside,
    };
    fs::read(&found).map_err(|e| unreadable(&found, &e))
}

/// Text of a percent-encoded URI.
fn decode_percent(uri: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&byte, behind)) = rest.split_first() {
        let digits = behind.get(..2).filter(|_| byte == b'%');
        let digits = digits.and_then(|digits| std::str::from_utf8(digits).ok());
        let decoded = digits.and_then(|digits| u8::from_str_radix(digits, 16).ok());
        bytes.push(decoded.unwrap_or(byte));
        rest = match decoded {
            Some(_) => &behind[2..],
            None => behind,
        };
    }
    String::from_utf8(bytes).ok()
}

fn decode_base64(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len() * 3 / 4);
    let (mut held, mut bits) = (0u32, 0);
    for c in text
        .bytes()
        .filter(|c| !c.is_ascii_whitespace() && *c != b'=')
    {
        let value = match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            _ => return None,
        };
        held = held << 6 | u32::from(value);
        bits += 6;
        if bits >= 8 {
            bits -= 8;
            bytes.push((held >> bits) as u8);
        }
    }
    Some(bytes)
}

fn finish(path: &Path, soup: Soup) -> Result<TriMesh, MeshError> {
    let count = soup.indices.len() / 3;
    if count == 0 {
        return Err(MeshError::Empty {
            path: path.to_owned(),
        });
    }
    if count > MAX_TRIANGLES {
        return Err(MeshError::TooManyTriangles {
            path: path.to_owned(),
            count,
        });
    }
    if let Some((vertex, &position)) = soup
        .positions
        .iter()
        .enumerate()
        .find(|(_, p)| p.iter().any(|x| !x.is_finite()))
    {
        return Err(MeshError::NotFinite {
            path: path.to_owned(),
            vertex,
            position,
        });
    }
    if let Some(index) = soup
        .indices
        .iter()
        .find(|i| **i as usize >= soup.positions.len())
    {
        return Err(malformed(
            path,
            format!(
                "refers to vertex {index}, but there are only {}",
                soup.positions.len()
            ),
        ));
    }
    let bad_normal = |n: &[f32; 3]| {
        let square: f32 = n.iter().map(|x| x * x).sum();
        !(square > 0.25 && square < 4.0)
    };
    let lacks_normals = soup.lacks_normals || soup.normals.iter().any(bad_normal);
    let lacks_uvs = soup.lacks_uvs || soup.uvs.iter().flatten().any(|x| !x.is_finite());
    let mut mesh = TriMesh {
        positions: soup.positions,
        normals: soup.normals,
        uvs: soup.uvs,
        indices: soup.indices,
    };
    drop_slivers(&mut mesh);
    if mesh.indices.is_empty() {
        return Err(MeshError::Empty {
            path: path.to_owned(),
        });
    }
    if lacks_normals {
        mesh = crease_normals(&mesh);
    }
    if lacks_uvs {
        box_uvs(&mut mesh);
    }
    Ok(mesh)
}
