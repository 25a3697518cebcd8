//! The files of an object in a pack: its table, meshes, materials and images.

use std::collections::BTreeMap;

use wheelarm_pack::{
    FORMAT, GraspEntry, Manifest, MaterialEntry, MaterialFile, MeshEntry, ObjectFile, Pack,
    PackError, PartEntry, SourceEntry, TextureEntry,
};

use super::mesh::{Face, Mesh, Surface};
use crate::{glb, simplify, texture};

/// Most rendered parts of an object; further materials become the last one.
const MOST_PARTS: usize = 32;

/// An imported object, to be added to a pack.
#[derive(Clone, Debug, PartialEq)]
pub struct PackedObject {
    /// Its name.
    pub name: String,
    /// Its table.
    pub file: ObjectFile,
    /// Meshes, materials and images, by path in the pack.
    pub files: BTreeMap<String, Vec<u8>>,
    /// Its author and license.
    pub source: SourceEntry,
}

/// The rendered parts of a mesh, and their files.
pub fn rendered(
    name: &str,
    mesh: &Mesh,
    (origin, license): (&str, &str),
    notes: &mut Vec<String>,
) -> (Vec<PartEntry>, BTreeMap<String, Vec<u8>>) {
    let mut files = BTreeMap::new();
    let mut materials = BTreeMap::new();
    let mut parts = Vec::new();
    for (surface, faces) in by_surface(mesh) {
        let number = parts.len();
        let entry = material(name, number, surface, &mut files, notes);
        let is_mapped = entry.texture.is_some();
        let corners = |face: &Face| {
            [0, 1, 2].map(|k| {
                let uv = face.uvs.filter(|_| is_mapped).map(|uvs| uvs[k]);
                (face.corners[k].into(), uv)
            })
        };
        let triangles: Vec<[glb::Corner; 3]> = faces.iter().map(|face| corners(face)).collect();
        let [low, high] = mesh.bounds();
        let simple = simplify::simplify(triangles, (high - low).max());
        if simple.is_empty() {
            continue;
        }
        let path = format!("meshes/{name}_{number}.glb");
        files.insert(path.clone(), glb::write(&simple));
        let key = format!("{name}_{number}");
        materials.insert(key.clone(), entry);
        parts.push(PartEntry {
            mesh: Some(MeshEntry {
                path,
                scale: wheelarm_pack::MeshScale::default(),
            }),
            material: Some(key),
            collide: Some(false),
            ..PartEntry::default()
        });
    }
    let table = MaterialFile {
        origin: origin.to_owned(),
        license: license.to_owned(),
        material: materials,
    };
    let text = toml::to_string(&table).unwrap_or_default();
    files.insert(format!("materials/{name}.toml"), text.into_bytes());
    (parts, files)
}

/// Faces by equal material, in the order of the materials.
fn by_surface(mesh: &Mesh) -> Vec<(&Surface, Vec<&Face>)> {
    let mut groups: Vec<(&Surface, Vec<&Face>)> = Vec::new();
    for face in &mesh.faces {
        let Some(surface) = mesh.surfaces.get(face.surface) else {
            continue;
        };
        let last = groups.len().saturating_sub(1);
        let found = groups.iter().position(|(other, _)| *other == surface);
        match found {
            None if groups.len() < MOST_PARTS => groups.push((surface, vec![face])),
            found => groups[found.unwrap_or(last)].1.push(face),
        }
    }
    groups
}

fn material(
    name: &str,
    number: usize,
    surface: &Surface,
    files: &mut BTreeMap<String, Vec<u8>>,
    notes: &mut Vec<String>,
) -> MaterialEntry {
    let [red, green, blue] = surface.colour;
    let image = surface.image.as_ref().and_then(|bytes| {
        let image = texture::decode(bytes).and_then(|image| {
            let png = texture::square_png(&image, 1);
            png.ok_or_else(|| "it cannot be written as PNG".to_owned())
        });
        image
            .map_err(|why| notes.push(format!("an image is left out: {why}")))
            .ok()
    });
    let texture = image.map(|png| {
        let pattern = format!("{name}_{number}");
        files.insert(format!("textures/{pattern}.png"), png);
        TextureEntry {
            pattern,
            // One repetition is one unit of the texture coordinates.
            metres: 1.0,
        }
    });
    let rounded = |value: f64| (value * 100.0).round() / 100.0;
    MaterialEntry {
        color: format!("#{red:02x}{green:02x}{blue:02x}"),
        roughness: rounded(surface.roughness),
        metallic: rounded(surface.metallic),
        emission: 0.0,
        texture,
        family: None,
        transmission: 0.0,
    }
}

/// A pack with an object; it replaces an object of the same name. An object that is otherwise
/// equal keeps its trials and what they decided.
///
/// # Errors
/// When the files are not a valid pack.
pub fn with_object(
    pack: Option<&Pack>,
    pack_name: &str,
    object: &PackedObject,
) -> Result<Pack, PackError> {
    let name = &object.name;
    let mut manifest = match pack {
        Some(pack) => pack.manifest().clone(),
        None => Manifest {
            format: FORMAT,
            name: pack_name.to_owned(),
            version: "1".to_owned(),
            held_out: false,
            hidden: false,
            source: Vec::new(),
        },
    };
    manifest.source.retain(|source| source.of != *name);
    manifest.source.push(object.source.clone());
    manifest.source.sort_by(|a, b| a.of.cmp(&b.of));
    let mut files = pack.map(|pack| pack.files().clone()).unwrap_or_default();
    files.retain(|path, _| !is_of_object(path, name));
    files.extend(object.files.clone());
    let former = pack.and_then(|pack| object_of(pack, name));
    let table = former.filter(|former| is_tried(former, &object.file));
    let path = format!("objects/{name}.toml");
    files.insert(
        path,
        toml::to_string(table.as_ref().unwrap_or(&object.file))
            .unwrap_or_default()
            .into_bytes(),
    );
    Pack::from_tables(&manifest, None, &BTreeMap::new(), files)
}

/// Whether `former` is `new` with the results of trials: they drop grasps, and decide on scenery.
fn is_tried(former: &ObjectFile, new: &ObjectFile) -> bool {
    let plain = |object: &ObjectFile| {
        let mut object = object.clone();
        object.grasps.clear();
        if let Some(stock) = &mut object.stock {
            (stock.trials, stock.scenery, stock.yaw_deg) = (None, false, 0.0);
        }
        object
    };
    let is_sampled = |grasp: &GraspEntry| new.grasps.contains(grasp);
    let trials = former.stock.as_ref().and_then(|stock| stock.trials);
    trials.is_some() && plain(former) == plain(new) && former.grasps.iter().all(is_sampled)
}

/// A pack with this object of another pack and nothing else.
///
/// # Errors
/// When the files are not a valid pack.
pub fn alone(pack: &Pack, name: &str) -> Result<Pack, PackError> {
    let mut manifest = pack.manifest().clone();
    manifest.source.retain(|source| source.of == name);
    let mut files = pack.files().clone();
    files.retain(|path, _| is_of_object(path, name));
    Pack::from_tables(&manifest, None, &BTreeMap::new(), files)
}

/// Whether a file was written for the object of this name.
fn is_of_object(path: &str, name: &str) -> bool {
    let numbered = |folder: &str, ending: &str| {
        let number = path
            .strip_prefix(folder)
            .and_then(|rest| rest.strip_prefix(name))
            .and_then(|rest| rest.strip_prefix('_'))
            .and_then(|rest| rest.strip_suffix(ending));
        number.is_some_and(|number| number.bytes().all(|byte| byte.is_ascii_digit()))
    };
    path == format!("objects/{name}.toml")
        || path == format!("materials/{name}.toml")
        || numbered("meshes/", ".glb")
        || numbered("textures/", ".png")
}

/// The table of an object of a pack.
#[must_use]
pub fn object_of(pack: &Pack, name: &str) -> Option<ObjectFile> {
    let bytes = pack.file(&format!("objects/{name}.toml"))?;
    toml::from_str(&String::from_utf8_lossy(bytes)).ok()
}

/// A pack whose object has another table.
///
/// # Errors
/// When the table is not valid.
pub fn with_table(pack: &Pack, name: &str, table: &ObjectFile) -> Result<Pack, PackError> {
    let mut files = pack.files().clone();
    let path = format!("objects/{name}.toml");
    files.insert(
        path,
        toml::to_string(table).unwrap_or_default().into_bytes(),
    );
    Pack::from_files(files)
}
