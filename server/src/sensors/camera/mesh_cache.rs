//! Meshes with texture coordinates in repetitions, one per shape and texture. Scenes of one
//! process share them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parking_lot::{Mutex, MutexGuard};
use wheelarm_proto::cache::{self, Key};

use crate::geometry::mesh::{Detail, MeshError, build_detail};
use crate::geometry::{Material, Shape, TriMesh};

/// Number of scenes after which an unused mesh is dropped.
const SCENES: u64 = 16;

/// The meshes of recent scenes.
#[derive(Debug, Default)]
pub struct MeshCache(Mutex<Meshes>);

#[derive(Debug, Default)]
struct Meshes {
    /// Number of scenes so far.
    scenes: u64,
    /// By shape, texture, detail and file, with the last scene that used them.
    known: BTreeMap<String, (Arc<TriMesh>, u64)>,
}

impl MeshCache {
    /// The meshes of the next scene.
    pub(super) fn for_scene<'a>(&'a self, assets: &'a Path) -> SceneMeshes<'a> {
        let mut all = self.0.lock();
        all.scenes += 1;
        let scene = all.scenes;
        all.known.retain(|_, (_, used)| *used + SCENES > scene);
        SceneMeshes {
            assets,
            all,
            files: BTreeMap::new(),
        }
    }
}

/// The meshes of one scene. Another scene of the same graphics waits.
pub(super) struct SceneMeshes<'a> {
    assets: &'a Path,
    all: MutexGuard<'a, Meshes>,
    /// Hashes of the mesh files.
    files: BTreeMap<PathBuf, Option<Key>>,
}

impl SceneMeshes<'_> {
    /// The mesh of a shape; mesh files are used as they are.
    pub(super) fn get(
        &mut self,
        shape: &Shape,
        material: &Material,
        detail: Detail,
    ) -> Result<Arc<TriMesh>, MeshError> {
        let (detail, file) = match shape {
            Shape::Mesh { path, .. } => {
                let path = self.assets.join(path);
                if path.extension().is_some_and(|ending| ending == "gltf") {
                    // Its data may be in other files.
                    return build(shape, self.assets, material, Detail::Full);
                }
                let read = || {
                    let bytes = std::fs::read(&path).ok()?;
                    Some(cache::key("mesh file", &[&bytes]))
                };
                let known = self.files.entry(path.clone()).or_insert_with(read);
                (Detail::Full, *known)
            }
            Shape::PackedMesh { .. } => (Detail::Full, None),
            _ => (detail, None),
        };
        let key = format!("{shape:?} {:?} {detail:?} {file:?}", material.texture);
        let scene = self.all.scenes;
        if let Some((mesh, used)) = self.all.known.get_mut(&key) {
            *used = scene;
            return Ok(Arc::clone(mesh));
        }
        let mesh = build(shape, self.assets, material, detail)?;
        self.all.known.insert(key, (Arc::clone(&mesh), scene));
        Ok(mesh)
    }
}

fn build(
    shape: &Shape,
    assets: &Path,
    material: &Material,
    detail: Detail,
) -> Result<Arc<TriMesh>, MeshError> {
    let mut mesh = build_detail(shape, assets, detail)?;
    if let Some(t) = &material.texture {
        super::mapping::fit(&mut mesh, shape, t);
    }
    Ok(Arc::new(mesh))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_shapes_share_a_mesh_until_their_file_changes() {
        let folder = std::env::temp_dir().join(format!("meshes{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let triangle = |x: f64| format!("v 0 0 0\nv {x} 0 0\nv 0 1 0\nf 1 2 3\n");
        let write = |x: f64| std::fs::write(folder.join("a.obj"), triangle(x)).unwrap();
        let material = super::super::tests::item(
            &Shape::Sphere { radius: 1.0 },
            [0.5; 3],
            super::super::Binding::World,
            [0.0; 3],
            1,
        )
        .material;
        let cache = MeshCache::default();
        let shape = Shape::Mesh {
            path: "a.obj".to_owned(),
            scale: 1.0,
        };
        let get = |shape: &Shape, detail| {
            let mut meshes = cache.for_scene(&folder);
            meshes.get(shape, &material, detail).unwrap()
        };
        write(1.0);
        let first = get(&shape, Detail::Full);
        assert!(Arc::ptr_eq(&first, &get(&shape, Detail::Coarse)));
        write(2.0);
        let second = get(&shape, Detail::Full);
        assert_ne!(first, second);
        // Details of other shapes differ, and an unused mesh is dropped.
        let ball = Shape::Sphere { radius: 0.1 };
        let [full, coarse] = [Detail::Full, Detail::Coarse].map(|detail| get(&ball, detail));
        assert!(full.indices.len() > coarse.indices.len());
        for _ in 0..SCENES {
            get(&ball, Detail::Full);
        }
        assert_eq!(cache.0.lock().known.len(), 1);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
