//! Reads mesh files: glTF and GLB, OBJ with MTL, STL, MSH, COLLADA, URDF and MJCF. Files are foreign:
//! their size, triangles and nodes are bounded, and every number is checked.

use std::path::Path;

use super::error::ObjectError;
use super::mesh::{Mesh, Surface};
use super::source::{Beside, Source, bytes, too_many};
use super::{read_dae, read_gltf, read_msh, read_obj, read_robot, read_stl};
use crate::model::MOST_TRIANGLES;

/// Largest absolute coordinate.
const LARGEST: f64 = 1.0e7;

/// Reads a mesh file.
///
/// # Errors
/// When it cannot be read, is damaged, exceeds a limit, or has another format.
pub fn read(path: &Path) -> Result<Source, ObjectError> {
    let bytes = bytes(path)?;
    let name = path.file_name().map_or_else(
        || path.display().to_string(),
        |name| name.to_string_lossy().into_owned(),
    );
    let folder = path.parent().unwrap_or(Path::new(""));
    let beside = |name: &str| {
        let is_plain = Path::new(name)
            .components()
            .all(|part| matches!(part, std::path::Component::Normal(_)));
        if !is_plain {
            return Err(format!("{name:?} is not beside the file; move it there"));
        }
        super::source::bytes(&folder.join(name)).map_err(|error| error.to_string())
    };
    parse(&name, &bytes, &beside)
}

/// Parses the bytes of a mesh file. `name` decides the format; `beside` reads files that it
/// names.
///
/// # Errors
/// When they are damaged, exceed a limit, or have another format.
pub fn parse(name: &str, bytes: &[u8], beside: Beside<'_>) -> Result<Source, ObjectError> {
    let ending = name.rsplit_once('.').map_or("", |(_, ending)| ending);
    let read = match ending.to_ascii_lowercase().as_str() {
        "glb" | "gltf" => read_gltf::parse(bytes, beside),
        "obj" => read_obj::parse(name, bytes, beside),
        "stl" => read_stl::parse(bytes),
        "msh" => read_msh::parse(bytes),
        "dae" => read_dae::parse(bytes, beside),
        "urdf" | "xml" => read_robot::parse(bytes, &|name: &str| {
            let inner = beside(name)?;
            let folder = name.rsplit_once('/').map_or("", |(folder, _)| folder);
            let there = |file: &str| match folder {
                "" => beside(file),
                folder => beside(&format!("{folder}/{file}")),
            };
            let found = parse(name, &inner, &there);
            found.map_err(|error| error.to_string())
        }),
        other => {
            return Err(ObjectError::Format {
                file: name.to_owned(),
                format: match other {
                    "" => "without an ending".to_owned(),
                    "3ds" => "3DS".to_owned(),
                    "fbx" => "FBX".to_owned(),
                    "blend" => "a Blender file".to_owned(),
                    "ply" => "PLY".to_owned(),
                    other => format!("of the unknown format {other:?}"),
                },
            });
        }
    };
    let malformed = |reason: String| ObjectError::Malformed {
        file: name.to_owned(),
        reason,
    };
    let mut source = read.map_err(malformed)?;
    check(&mut source.mesh).map_err(malformed)?;
    Ok(source)
}

/// Checks all numbers, and drops triangles without area.
fn check(mesh: &mut Mesh) -> Result<(), String> {
    if mesh.faces.len() > MOST_TRIANGLES {
        return Err(too_many());
    }
    for face in &mesh.faces {
        for corner in &face.corners {
            if !corner.iter().all(|c| c.abs() <= LARGEST) {
                return Err(format!(
                    "a vertex at {:?}, expected finite numbers; export it again",
                    corner.as_slice()
                ));
            }
        }
    }
    for face in &mut mesh.faces {
        face.uvs = face
            .uvs
            .filter(|uvs| uvs.iter().flatten().all(|c| c.is_finite()));
        face.surface = face.surface.min(mesh.surfaces.len());
    }
    mesh.faces.retain(|face| face.cross().norm() > 0.0);
    if mesh.faces.iter().any(|f| f.surface == mesh.surfaces.len()) {
        mesh.surfaces.push(Surface::default());
    }
    if mesh.faces.is_empty() {
        return Err("it has no triangles; export the object as a mesh".into());
    }
    Ok(())
}
