//! Vertices of a user's mesh file: what validation and placement need of it.

use std::path::Path;

use super::error::{Place, SceneError};

/// Vertex positions of an OBJ, glTF or GLB file in its own units.
pub(super) fn vertices(
    place: &Place,
    assets: &Path,
    path: &str,
) -> Result<Vec<[f64; 3]>, SceneError> {
    let full = assets.join(path);
    if !full.is_file() {
        return Err(place.wrong(
            format!("{path:?}, which is not there"),
            "a mesh file below the assets folder",
            format!("put the file at {}", full.display()),
        ));
    }
    let extension = full.extension().and_then(|e| e.to_str()).unwrap_or("");
    let unreadable = |error: String| {
        place.wrong(
            format!("{path:?}, which cannot be read ({error})"),
            "an OBJ, glTF or GLB mesh",
            "export the mesh again",
        )
    };
    let vertices: Vec<[f64; 3]> = match extension.to_ascii_lowercase().as_str() {
        "obj" => {
            let (models, _) = tobj::load_obj(&full, &tobj::LoadOptions::default())
                .map_err(|e| unreadable(e.to_string()))?;
            models
                .iter()
                .flat_map(|model| model.mesh.positions.as_chunks::<3>().0)
                .map(|p| p.map(f64::from))
                .collect()
        }
        "gltf" | "glb" => gltf_vertices(&full).map_err(unreadable)?,
        other => {
            return Err(place.wrong(
                format!("{path:?} with the ending {other:?}"),
                "obj, gltf or glb",
                "convert the mesh, for example with Blender",
            ));
        }
    };
    if vertices.len() < 4 || vertices.iter().flatten().any(|v| !v.is_finite()) {
        return Err(place.wrong(
            format!("{path:?} with {} usable vertices", vertices.len()),
            "at least 4, all finite",
            "export the mesh again",
        ));
    }
    Ok(vertices)
}

fn gltf_vertices(full: &Path) -> Result<Vec<[f64; 3]>, String> {
    let gltf = gltf::Gltf::open(full).map_err(|e| e.to_string())?;
    let mut buffers = Vec::new();
    for buffer in gltf.buffers() {
        buffers.push(match buffer.source() {
            gltf::buffer::Source::Bin => gltf.blob.clone().ok_or("no binary chunk")?,
            gltf::buffer::Source::Uri(uri) if uri.starts_with("data:") => {
                return Err("buffers inside the text are not supported: save as GLB".to_owned());
            }
            gltf::buffer::Source::Uri(uri) => {
                let beside = full.parent().unwrap_or(Path::new("")).join(uri);
                std::fs::read(&beside).map_err(|e| format!("{}: {e}", beside.display()))?
            }
        });
    }
    let mut vertices = Vec::new();
    let mut open: Vec<_> = gltf
        .scenes()
        .flat_map(|scene| scene.nodes())
        .map(|node| (node, nalgebra::Matrix4::identity()))
        .collect();
    while let Some((node, parent)) = open.pop() {
        let local = nalgebra::Matrix4::from(node.transform().matrix()).cast::<f64>();
        let world: nalgebra::Matrix4<f64> = parent * local;
        for primitive in node.mesh().iter().flat_map(|mesh| mesh.primitives()) {
            let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(Vec::as_slice));
            for position in reader
                .read_positions()
                .ok_or("a primitive has no positions")?
            {
                let point = nalgebra::Point3::from(position).cast::<f64>();
                vertices.push(world.transform_point(&point).into());
            }
        }
        open.extend(node.children().map(|child| (child, world)));
    }
    Ok(vertices)
}
