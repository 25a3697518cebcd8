//! Parts of scenes that stay the same from one scene to the next: the buffers of bodies and
//! the cells of a home. Keys are hashes of everything that determines a part. Those of the
//! home are also stored on disk for the next process, which reads them in a tenth of the
//! time of computing them.

use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock};

use parking_lot::Mutex;
use wheelarm_proto::cache::{self, Key, Store};

use super::ambient_map::ChartPoint;
use super::ambient_occlusion::{AmbientOcclusion, HomeLight};
use super::batch::{MATERIAL, Vertex};
use super::parts::{Part, Share, is_lit_by_rays};
use super::scene::{Binding, RenderScene};
use super::surroundings::Surroundings;
use crate::geometry::TriMesh;
use wheelarm_proto::parallel;

/// Sources of the computation of the entries: entries of other sources have other keys.
const SOURCES: [&str; 8] = [
    include_str!("ambient_map.rs"),
    include_str!("ambient_occlusion.rs"),
    include_str!("batch.rs"),
    include_str!("contact.rs"),
    include_str!("culling_clusters.rs"),
    include_str!("part_cache.rs"),
    include_str!("parts.rs"),
    include_str!("surroundings.rs"),
];
static FORM: LazyLock<Key> = LazyLock::new(|| cache::key("sources", &SOURCES.map(str::as_bytes)));
/// Kinds of the entries on disk.
const PARTS: &str = "parts of a home";
const CELLS: &str = "cells of a home";
/// Largest size of parts that the current scene does not use, bytes.
const MOST_UNUSED: usize = 24 << 20;
/// Number of homes whose cells are kept.
const HOMES: usize = 4;

/// The static bodies of a scene, and the meshes of all.
pub(super) struct Home {
    /// Hash of all surfaces that block ambient light.
    key: Key,
    /// Hashes of the meshes, by their addresses.
    meshes: BTreeMap<usize, Key>,
}

impl Home {
    pub(super) fn new(scene: &RenderScene) -> Self {
        let items = || scene.items.iter();
        let meshes: BTreeMap<usize, &TriMesh> = items()
            .flat_map(|item| [&item.mesh, &item.coarse])
            .map(|mesh| (address(mesh), &**mesh))
            .collect();
        let meshes = parallel::map(meshes.into_iter().collect(), |(address, mesh)| {
            (address, mesh_key(mesh))
        });
        let meshes: BTreeMap<usize, Key> = meshes.into_iter().collect();
        let mut inputs = Vec::new();
        for item in items().filter(|item| is_lit_by_rays(item)) {
            inputs.extend(meshes[&address(&item.coarse)]);
            inputs.extend(pose_bytes(&item.body_from_mesh));
        }
        Self {
            key: cache::key(CELLS, &[&*FORM, &inputs]),
            meshes,
        }
    }
}

fn address(mesh: &Arc<TriMesh>) -> usize {
    Arc::as_ptr(mesh) as usize
}

fn mesh_key(mesh: &TriMesh) -> Key {
    let parts: [&[u8]; 4] = [
        bytemuck::cast_slice(&mesh.positions),
        bytemuck::cast_slice(&mesh.normals),
        bytemuck::cast_slice(&mesh.uvs),
        bytemuck::cast_slice(&mesh.indices),
    ];
    cache::key("mesh", &parts)
}

fn pose_bytes(pose: &nalgebra::Isometry3<f64>) -> [u8; 56] {
    let [x, y, z] = pose.translation.vector.into();
    let [i, j, k, w] = pose.rotation.coords.into();
    bytemuck::cast([x, y, z, i, j, k, w].map(f64::to_le_bytes))
}

impl Share<'_> {
    /// Hash of everything that determines the part.
    fn key(&self, home: &Home) -> Key {
        let mut inputs = Vec::new();
        match self.binding {
            Binding::World => {
                inputs.push(1);
                inputs.extend(home.key);
                inputs.extend(self.sun.iter().flat_map(|x| x.to_le_bytes()));
            }
            Binding::Object(_) => inputs.push(2),
            Binding::Link(_) | Binding::Sliding(_) => inputs.push(3),
        }
        inputs.push(u8::from(self.ambient_per_pixel));
        inputs.extend(self.reach.to_le_bytes());
        for (finish, chosen) in &self.finished {
            inputs.extend([
                u8::from(finish.textured),
                finish.shine as u8,
                u8::from(finish.sunny),
            ]);
            inputs.extend((chosen.len() as u64).to_le_bytes());
            for (item, material) in chosen {
                inputs.extend(material.to_le_bytes());
                inputs.extend(home.meshes[&address(&item.mesh)]);
                inputs.extend(home.meshes[&address(&item.coarse)]);
                inputs.extend(pose_bytes(&item.body_from_mesh));
                inputs.extend([u8::from(item.casts_shadow), u8::from(is_lit_by_rays(item))]);
            }
        }
        cache::key("part", &[&inputs])
    }
}

/// The parts of recent scenes.
pub(super) struct PartCache {
    store: Store,
    kept: Mutex<Kept>,
}

#[derive(Default)]
struct Kept {
    /// Number of scenes so far.
    scenes: u64,
    /// Parts with the last scene that used them.
    parts: BTreeMap<Key, (Arc<Part>, u64)>,
    /// Cells of homes, the latest last.
    homes: Vec<(Key, Arc<Surroundings>)>,
}

impl PartCache {
    /// A cache that also uses entries on disk.
    pub(super) fn over(store: Store) -> Self {
        Self {
            store,
            kept: Mutex::default(),
        }
    }

    /// The entries on disk.
    pub(super) fn store(&self) -> &Store {
        &self.store
    }

    /// The cells of a home.
    pub(super) fn surroundings(&self, home: &Home, scene: &RenderScene) -> Arc<Surroundings> {
        let known = |kept: &mut Kept| {
            let at = kept.homes.iter().position(|(key, _)| *key == home.key)?;
            let known = kept.homes.remove(at);
            kept.homes.push(known.clone());
            Some(known.1)
        };
        if let Some(known) = known(&mut self.kept.lock()) {
            return known;
        }
        let plain = scene.surrounding.is_none();
        let stored = plain.then(|| self.store.get(&home.key)).flatten();
        let stored = stored.and_then(|bytes| Surroundings::from_bytes(&bytes));
        let cells = Arc::new(stored.unwrap_or_else(|| {
            let cells = Surroundings::new(scene);
            if plain {
                self.put(&home.key, &cells.to_bytes());
            }
            cells
        }));
        let mut kept = self.kept.lock();
        if kept.homes.len() >= HOMES {
            kept.homes.remove(0);
        }
        kept.homes.push((home.key, Arc::clone(&cells)));
        cells
    }

    /// The parts of all bodies. An appearance has its own sun and decoration: its parts are
    /// not stored on disk.
    pub(super) fn parts(
        &self,
        shares: &[Share<'_>],
        home: &Home,
        light: &mut HomeLight<'_>,
        with_appearance: bool,
    ) -> Vec<Arc<Part>> {
        let keys = parallel::map(shares.iter().collect(), |share: &Share<'_>| share.key(home));
        let mut found: Vec<Option<Arc<Part>>> = {
            let kept = self.kept.lock();
            let known = |key| kept.parts.get(key).map(|(part, _)| Arc::clone(part));
            keys.iter().map(known).collect()
        };
        let is_fixed = |i: &usize| shares[*i].binding == Binding::World;
        let fixed: Vec<usize> = (0..shares.len()).filter(is_fixed).collect();
        let fixed_keys: Vec<u8> = fixed.iter().flat_map(|i| keys[*i]).collect();
        let entry = cache::key(PARTS, &[&*FORM, &fixed_keys]);
        let mut is_stored = with_appearance || fixed.iter().all(|i| found[*i].is_some());
        if !is_stored
            && let Some(parts) = self.store.get(&entry).and_then(|bytes| decode(&bytes))
            && parts.len() == fixed.len()
            && fixed.iter().zip(&parts).all(|(i, part)| {
                let materials = shares[*i].materials.len();
                let known = |v: &Vertex| ((v.packed >> MATERIAL) as usize) < materials;
                part.vertices.iter().all(known)
            })
        {
            for (i, part) in fixed.iter().zip(parts) {
                found[*i].get_or_insert_with(|| Arc::new(part));
            }
            is_stored = true;
        }
        let number = |i: usize| fixed.binary_search(&i).ok();
        let missing = (0..shares.len()).filter(|i| found[*i].is_none());
        let missing: Vec<(usize, AmbientOcclusion<'_>)> = missing
            // Moving bodies have no light of their own.
            .map(|i| (i, light.of_body(number(i).unwrap_or(usize::MAX))))
            .collect();
        let computed = parallel::map(missing, |(i, light)| (i, shares[i].worked_out(light)));
        for (i, (part, known)) in computed {
            found[i] = Some(Arc::new(part));
            if let Some(number) = number(i) {
                light.put_back(number, known);
            }
        }
        let found: Vec<Arc<Part>> = found.into_iter().flatten().collect();
        if !is_stored {
            let parts = fixed.iter().map(|i| &*found[*i]);
            if let Some(bytes) = encode(parts) {
                self.put(&entry, &bytes);
            }
        }
        self.kept.lock().keep(keys.into_iter().zip(&found));
        found
    }

    fn put(&self, key: &Key, bytes: &[u8]) {
        if let Err(problem) = self.store.put(key, bytes) {
            tracing::warn!("{problem}");
        }
    }
}

impl Kept {
    /// Keeps the parts of a scene, and of earlier ones as many as fit.
    fn keep<'a>(&mut self, parts: impl Iterator<Item = (Key, &'a Arc<Part>)>) {
        self.scenes += 1;
        let scene = self.scenes;
        for (key, part) in parts {
            let kept = self.parts.entry(key);
            let kept = kept.or_insert_with(|| (Arc::clone(part), scene));
            kept.1 = scene;
        }
        let mut unused: Vec<(u64, Key, usize)> = self
            .parts
            .iter()
            .filter(|(_, (_, used))| *used < scene)
            .map(|(key, (part, used))| (*used, *key, part.size()))
            .collect();
        unused.sort_unstable_by_key(|(used, ..)| std::cmp::Reverse(*used));
        let mut size = 0;
        for (_, key, own) in unused {
            size += own;
            if size > MOST_UNUSED {
                self.parts.remove(&key);
            }
        }
    }
}

impl Part {
    /// Approximate size, bytes.
    fn size(&self) -> usize {
        size_of::<Self>()
            + size_of_val(&self.vertices[..])
            + size_of_val(&self.indices[..])
            + size_of_val(&self.points[..])
    }

    /// Whether all indices are within their lists.
    fn is_consistent(&self) -> bool {
        let vertices = self.vertices.len();
        let is_inside = |range: &std::ops::Range<u32>| {
            range.start <= range.end && range.end as usize <= self.indices.len()
        };
        let batches = &self.batches;
        let mut clusters = batches.iter().flat_map(|b| b.full.iter().chain(&b.coarse));
        let points = self.points.iter().flatten();
        self.indices.iter().all(|i| (*i as usize) < vertices)
            && (self.points.is_empty() || self.points.len() == vertices)
            && points
                .copied()
                .all(|p| (p.chart as usize) < self.charts.len())
            && self.charts.iter().all(|chart| chart.is_complete())
            && self.casters.iter().all(|caster| is_inside(&caster.indices))
            && clusters.all(|cluster| {
                let mut pieces = cluster.pieces.iter();
                is_inside(&cluster.indices)
                    && pieces.all(|p| is_inside(&p.indices) && p.chart < self.charts.len())
            })
    }
}

/// Parts as bytes: for each the length of its fields, the fields, and its lists behind
/// their lengths.
fn encode<'a>(parts: impl Iterator<Item = &'a Part>) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut append = |part: &[u8]| {
        bytes.extend((part.len() as u64).to_le_bytes());
        bytes.extend(part);
    };
    for part in parts {
        append(&postcard::to_stdvec(part).ok()?);
        append(bytemuck::cast_slice(&part.vertices));
        append(bytemuck::cast_slice(&part.indices));
        let points = part.points.iter().flat_map(|point| match point {
            Some(ChartPoint {
                chart,
                local: [x, y],
            }) => [*chart, u32::from(*x) | u32::from(*y) << 16],
            None => [u32::MAX; 2],
        });
        append(bytemuck::cast_slice(&points.collect::<Vec<u32>>()));
    }
    Some(bytes)
}

/// The inverse of [`encode`]; `None` for other bytes.
fn decode(mut bytes: &[u8]) -> Option<Vec<Part>> {
    fn take<'a>(bytes: &mut &'a [u8]) -> Option<&'a [u8]> {
        let (length, rest) = bytes.split_first_chunk::<8>()?;
        let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
        let (own, rest) = rest.split_at_checked(length)?;
        *bytes = rest;
        Some(own)
    }
    let mut slices = Vec::new();
    while !bytes.is_empty() {
        let mut next = || take(&mut bytes);
        slices.push([next()?, next()?, next()?, next()?]);
    }
    let part = |[fields, vertices, indices, points]: [&[u8]; 4]| {
        let mut part: Part = postcard::from_bytes(fields).ok()?;
        if vertices.len() % size_of::<Vertex>() != 0 || (indices.len() | points.len()) % 4 != 0 {
            return None;
        }
        part.vertices = bytemuck::pod_collect_to_vec(vertices);
        part.indices = bytemuck::pod_collect_to_vec(indices);
        let words: Vec<u32> = bytemuck::pod_collect_to_vec(points);
        let point = |[chart, at]: &[u32; 2]| {
            let local = [*at as u16, (*at >> 16) as u16];
            (*chart != u32::MAX).then_some(ChartPoint {
                chart: *chart,
                local,
            })
        };
        part.points = words.as_chunks::<2>().0.iter().map(point).collect();
        part.is_consistent().then_some(part)
    };
    parallel::map(slices, part).into_iter().collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::buffers::Buffers;
    use super::super::tests::floor_and_box;
    use super::super::tier::Tier;
    use super::super::{Graphics, Quality};
    use super::*;
    use crate::robot::RobotModel;
    use crate::scene::Scene;

    /// Everything that is uploaded, as bytes.
    fn uploaded(buffers: &Buffers) -> Vec<u8> {
        let text = format!(
            "{:?} {:?} {:?} {:?} {:?}",
            buffers.batches,
            buffers.bodies,
            buffers.patterns,
            buffers.occluders,
            buffers.ambient_map.size
        );
        let parts: [&[u8]; 5] = [
            bytemuck::cast_slice(&buffers.vertices),
            bytemuck::cast_slice(&buffers.indices),
            bytemuck::cast_slice(&buffers.materials),
            &buffers.ambient_map.texels,
            text.as_bytes(),
        ];
        parts.concat()
    }

    fn buffers(scene: &RenderScene, cache: &PartCache) -> Buffers {
        let home = Home::new(scene);
        let surroundings = cache.surroundings(&home, scene);
        let graphics = Graphics::default();
        let mut light = graphics.last_home().take(&surroundings);
        let tier = Tier::for_scene(Quality::Standard, scene);
        Buffers::new(scene, (&home, &mut light), tier, cache)
    }

    fn off() -> PartCache {
        PartCache::over(Store::at(None, 0))
    }

    /// A store in an empty folder.
    fn store(name: &str) -> (std::path::PathBuf, Store) {
        let name = format!("parts_{name}_{}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        let _ = std::fs::remove_dir_all(&folder);
        (folder.clone(), Store::at(Some(folder), cache::LIMIT))
    }

    #[test]
    fn parts_of_an_earlier_scene_or_process_give_the_same_buffers() {
        let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
        let robot = RobotModel::load(&assets, "wheelarm").unwrap();
        let home = Scene::load(&assets, "home").unwrap();
        let scene = RenderScene::new(&robot, &home, &assets).unwrap();
        let mut other = scene.clone();
        // Another order of materials and bodies, and a wall less.
        other.items.reverse();
        other.items.pop();
        let wanted = [&scene, &other].map(|scene| uploaded(&buffers(scene, &off())));
        assert_ne!(wanted[0], wanted[1]);
        let (folder, first) = store("home");
        let first = PartCache::over(first);
        for (scene, wanted) in [
            (&scene, &wanted[0]),
            (&other, &wanted[1]),
            (&scene, &wanted[0]),
        ] {
            assert!(uploaded(&buffers(scene, &first)) == *wanted);
        }
        // Cells and parts of two homes.
        assert_eq!(first.store().usage().unwrap().entries, 4);
        let next = PartCache::over(Store::at(Some(folder.clone()), cache::LIMIT));
        assert!(uploaded(&buffers(&scene, &next)) == wanted[0]);
        assert_eq!(next.store().usage().unwrap().entries, 4);
        std::fs::remove_dir_all(folder).unwrap();
    }

    /// The key of the only entry that is not the cells of `home`.
    fn key_of_parts(folder: &Path, home: &Home) -> Key {
        let files = std::fs::read_dir(folder).unwrap();
        let keys = files.map(|file| {
            let path = file.unwrap().path();
            let name = path.file_stem().unwrap().to_string_lossy().into_owned();
            let byte = |k: usize| u8::from_str_radix(&name[2 * k..2 * k + 2], 16).unwrap();
            std::array::from_fn(byte)
        });
        let others: Vec<Key> = keys.filter(|key| *key != home.key).collect();
        assert_eq!(others.len(), 1);
        others[0]
    }

    #[test]
    fn entries_that_are_not_parts_are_computed_again() {
        let scene = floor_and_box();
        let wanted = uploaded(&buffers(&scene, &off()));
        let (folder, plain) = store("damaged");
        let first = PartCache::over(plain);
        assert!(uploaded(&buffers(&scene, &first)) == wanted);
        let home = Home::new(&scene);
        let cells = first.store().get(&home.key).unwrap();
        let kept: Vec<Arc<Part>> = first
            .kept
            .lock()
            .parts
            .values()
            .map(|p| p.0.clone())
            .collect();
        let good = encode(kept.iter().map(|part| &**part)).unwrap();
        assert_eq!(decode(&good).map(|parts| parts.len()), Some(kept.len()));
        // Valid entries with other content: as of a program with another form.
        for length in 0..good.len().min(400) {
            assert!(decode(&good[..length]).is_none_or(|parts| parts.is_empty()));
        }
        for bytes in [&[][..], b"x", &cells[..47], &cells[..cells.len() - 1]] {
            assert!(Surroundings::from_bytes(bytes).is_none());
            first.store().put(&home.key, bytes).unwrap();
            let next = PartCache::over(Store::at(Some(folder.clone()), cache::LIMIT));
            assert!(uploaded(&buffers(&scene, &next)) == wanted);
        }
        let mut wrong = decode(&good).unwrap();
        for part in &mut wrong {
            part.indices.fill(u32::MAX);
        }
        assert!(decode(&encode(wrong.iter()).unwrap()).is_none());
        // Right in itself, with a material that the scene does not have.
        let key = key_of_parts(&folder, &home);
        let mut wrong = decode(&first.store().get(&key).unwrap()).unwrap();
        for vertex in wrong.iter_mut().flat_map(|part| &mut part.vertices) {
            vertex.packed |= 0xfff << MATERIAL;
        }
        let wrong = encode(wrong.iter()).unwrap();
        assert!(decode(&wrong).is_some());
        first.store().put(&key, &wrong).unwrap();
        let next = PartCache::over(Store::at(Some(folder.clone()), cache::LIMIT));
        assert!(uploaded(&buffers(&scene, &next)) == wanted);
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn unused_parts_are_dropped_beyond_their_limit() {
        let mut kept = Kept::default();
        let part = || {
            Arc::new(Part {
                indices: vec![0; MOST_UNUSED / 16],
                ..Part::default()
            })
        };
        for scene in 0..8u8 {
            kept.keep([([scene; 32], &part())].into_iter());
        }
        // The current one, and three of a quarter of the limit each.
        let left: Vec<u8> = kept.parts.keys().map(|key| key[0]).collect();
        assert_eq!(left, [4, 5, 6, 7]);
    }
}
