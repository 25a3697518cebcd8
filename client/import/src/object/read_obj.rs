//! OBJ files with their MTL files and images. They state no units; y is usually up.

use std::collections::BTreeMap;

use super::mesh::{Face, Mesh, Surface, Vec3};
use super::source::{Beside, Source, Up};
use crate::model::{self, ModelMaterial};

/// Parses a file.
pub(super) fn parse(name: &str, bytes: &[u8], beside: Beside<'_>) -> Result<Source, String> {
    let (mut mesh, notes) = parts(name, bytes, beside)?;
    let faces = mesh.iter_mut().flat_map(|(_, mesh)| mesh.faces.drain(..));
    let faces: Vec<Face> = faces.collect();
    let surfaces = mesh.into_iter().next().map(|(_, mesh)| mesh.surfaces);
    Ok(Source {
        mesh: Mesh {
            faces,
            surfaces: surfaces.unwrap_or_default(),
        },
        metres: None,
        up: Up::Y,
        up_is_defined: false,
        notes,
    })
}

/// Groups by name.
type Groups = Vec<(String, Mesh)>;

/// The groups of a file, each with all materials of the file.
pub(super) fn parts(
    name: &str,
    bytes: &[u8],
    beside: Beside<'_>,
) -> Result<(Groups, Vec<String>), String> {
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        return Err("the text is UTF-16; save the file as UTF-8".into());
    }
    let text = String::from_utf8_lossy(bytes);
    let text = text.trim_start_matches('\u{feff}');
    let text = text.replace("\r\n", "\n").replace("\\\n", " ");
    let mut notes = Vec::new();
    let mut defined: BTreeMap<String, ModelMaterial> = BTreeMap::new();
    for library in model::statements(&text, "mtllib") {
        match beside(library) {
            Ok(bytes) => {
                let text = String::from_utf8_lossy(&bytes).into_owned();
                let materials = model::materials(&text, library);
                defined.extend(materials.into_iter().map(|m| (m.name.clone(), m)));
            }
            Err(error) => notes.push(format!("materials are grey: {error}")),
        }
    }
    let model = model::parse(&text, &defined).map_err(|reason| format!("{reason} ({name})"))?;
    let surfaces: Vec<Surface> = model
        .materials
        .iter()
        .map(|material| surface(material, beside, &mut notes))
        .collect();
    let mut parts: Vec<(String, Mesh)> = model
        .groups
        .iter()
        .map(|group| {
            let surfaces = surfaces.clone();
            let mesh = Mesh {
                faces: Vec::new(),
                surfaces,
            };
            (group.clone(), mesh)
        })
        .collect();
    for triangle in &model.triangles {
        let corners = triangle.corners.map(|k| model.positions.get(k as usize));
        let [Some(a), Some(b), Some(c)] = corners else {
            return Err("a face names a vertex that does not exist; export it again".into());
        };
        if let Some((_, mesh)) = parts.get_mut(triangle.group as usize) {
            mesh.faces.push(Face {
                corners: [*a, *b, *c].map(Vec3::from),
                uvs: triangle.uvs,
                surface: triangle.material as usize,
            });
        }
    }
    Ok((parts, notes))
}

fn surface(material: &ModelMaterial, beside: Beside<'_>, notes: &mut Vec<String>) -> Surface {
    let image = material.image.as_ref().and_then(|name| match beside(name) {
        Ok(bytes) => Some(bytes),
        Err(error) => {
            notes.push(format!("an image is left out: {error}"));
            None
        }
    });
    Surface {
        colour: material.colour,
        roughness: (0.65 - 0.4 * material.shininess).max(0.1),
        metallic: 0.0,
        image,
    }
}
