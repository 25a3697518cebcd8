//! The mesh of a person: skinned vertices, and triangles by body part and material.

use std::path::Path;

use nalgebra::{Isometry3, Point3, Vector3};

use super::motion::HeadPose;
use super::part::BodyPart;
use super::skeleton::Skeleton;
use crate::geometry::{Material, TriMesh, box_uvs};

/// Vertices with their joints, and the surfaces to render.
#[derive(Clone, Debug)]
pub struct SkinnedMesh {
    /// Rest positions, metres.
    points: Vec<Point3<f64>>,
    normals: Vec<Vector3<f64>>,
    /// Joints and weights of each vertex; weights sum to 1.
    weights: Vec<[(usize, f64); 4]>,
    /// Triangles of one part and one material each.
    pub surfaces: Vec<Surface>,
}

/// Triangles of one part and one material.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Part of the body.
    pub part: BodyPart,
    /// Material.
    pub material: Material,
    /// Three vertices each.
    pub triangles: Vec<[usize; 3]>,
}

/// Contents of a mesh file.
pub(super) struct MeshFile {
    pub points: Vec<Point3<f64>>,
    pub normals: Vec<Vector3<f64>>,
    pub weights: Vec<[(usize, f64); 4]>,
    /// Triangles with the name of their material.
    pub primitives: Vec<(String, Vec<[usize; 3]>)>,
    /// Names of the joints.
    pub joints: Vec<String>,
    pub parents: Vec<Option<usize>>,
    /// Rest positions.
    pub rest: Vec<Point3<f64>>,
}

/// Converts from glTF's axes (x left, y up, z forward) to ours.
fn ours(v: [f32; 3]) -> Vector3<f64> {
    Vector3::new(v[2], v[0], v[1]).cast()
}

impl MeshFile {
    /// Reads a binary glTF with one skinned mesh.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub(super) fn read(path: &Path) -> Result<Self, String> {
        let bytes = std::fs::read(path).map_err(|e| e.to_string())?;
        crate::geometry::check_glb_length(path, &bytes).map_err(|e| e.to_string())?;
        let gltf::Gltf { document, blob } =
            gltf::Gltf::from_slice(&bytes).map_err(|e| format!("not a valid glTF file ({e})"))?;
        let blob = blob.ok_or("it has no binary chunk")?;
        let short = |buffer: gltf::Buffer<'_>| buffer.length() > blob.len();
        if document.buffers().count() != 1 || document.buffers().any(short) {
            return Err("its binary chunk is incomplete".to_owned());
        }
        let skin = document.skins().next().ok_or("it has no skin")?;
        let nodes: Vec<gltf::Node<'_>> = skin.joints().collect();
        let number = |index: usize| nodes.iter().position(|node| node.index() == index);
        let mut parents = vec![None; nodes.len()];
        for (joint, node) in nodes.iter().enumerate() {
            for child in node.children() {
                if let Some(child) = number(child.index()) {
                    parents[child] = Some(joint);
                }
            }
        }
        let mut rest: Vec<Point3<f64>> = Vec::with_capacity(nodes.len());
        for (joint, node) in nodes.iter().enumerate() {
            let own = ours(node.transform().decomposed().0);
            let at = match parents[joint] {
                None => Point3::from(own),
                Some(parent) if parent < joint => rest[parent] + own,
                Some(_) => return Err("a joint comes before its parent".to_owned()),
            };
            rest.push(at);
        }
        let mesh = document.meshes().next().ok_or("it has no mesh")?;
        let mut primitives: Vec<(String, Vec<[usize; 3]>)> = Vec::new();
        let mut vertices: Option<(Option<usize>, Vec<_>, Vec<_>, Vec<_>)> = None;
        for primitive in mesh.primitives() {
            let reader = primitive.reader(|_| Some(&blob));
            let positions = primitive.get(&gltf::Semantic::Positions).map(|a| a.index());
            match &vertices {
                None => {
                    let read = || {
                        let points = reader.read_positions()?.map(|p| Point3::from(ours(p)));
                        let normals = reader.read_normals()?.map(ours);
                        let joints = reader.read_joints(0)?.into_u16();
                        let weights = reader.read_weights(0)?.into_f32();
                        let weights = joints.zip(weights).map(|(j, w)| {
                            std::array::from_fn(|k| (usize::from(j[k]), f64::from(w[k])))
                        });
                        let points: Vec<_> = points.collect();
                        let normals: Vec<_> = normals.collect();
                        let weights: Vec<[(usize, f64); 4]> = weights.collect();
                        Some((positions, points, normals, weights))
                    };
                    vertices = Some(read().ok_or("its mesh lacks positions, normals or weights")?);
                }
                Some((first, ..)) if *first != positions => {
                    return Err("its primitives do not share their vertices".to_owned());
                }
                Some(_) => {}
            }
            let indices = reader.read_indices().ok_or("a primitive has no indices")?;
            let indices: Vec<usize> = indices.into_u32().map(|i| i as usize).collect();
            let name = primitive.material().name().unwrap_or_default().to_owned();
            primitives.push((name, indices.as_chunks::<3>().0.to_vec()));
        }
        let (_, points, normals, weights) = vertices.ok_or("its mesh is empty")?;
        let count = points.len();
        let finite = points.iter().all(|p| p.iter().all(|x| x.is_finite()))
            && normals.iter().all(|n| n.norm() > 0.5 && n.norm() < 2.0);
        let outside = primitives.iter().flat_map(|(_, t)| t.iter().flatten());
        let sums = |w: &[(usize, f64); 4]| {
            let sum: f64 = w.iter().map(|(_, w)| w).sum();
            (sum - 1.0).abs() < 0.02 && w.iter().all(|(joint, _)| *joint < nodes.len())
        };
        if !finite || normals.len() != count || weights.len() != count {
            return Err("a vertex is not finite, or lacks a normal or weights".to_owned());
        }
        if outside.into_iter().any(|&vertex| vertex >= count) || !weights.iter().all(sums) {
            return Err("a triangle or a weight has an invalid index".to_owned());
        }
        Ok(Self {
            points,
            normals,
            weights,
            primitives,
            joints: nodes
                .iter()
                .map(|n| n.name().unwrap_or_default().to_owned())
                .collect(),
            parents,
            rest,
        })
    }
}

impl SkinnedMesh {
    /// The mesh with the materials that `material` returns by name; the face is in
    /// front of `face_from`, in the frame of the joint `head`.
    pub(super) fn new(
        raw: MeshFile,
        head: usize,
        face_from: f64,
        material: impl Fn(&str) -> Option<Material>,
    ) -> Result<Self, String> {
        let main = |vertex: usize| {
            let weights = &raw.weights[vertex];
            let most = weights
                .iter()
                .fold((0, -1.0), |most, w| if w.1 > most.1 { *w } else { most });
            most.0
        };
        let mut surfaces: Vec<Surface> = Vec::new();
        for (name, triangles) in &raw.primitives {
            let appearance =
                material(name).ok_or_else(|| format!("looks.toml has no material {name:?}"))?;
            for triangle in triangles {
                let joint = main(triangle[0]);
                let of = BodyPart::from_name(&raw.joints[joint]);
                let middle: f64 = triangle.iter().map(|&v| raw.points[v].x).sum::<f64>() / 3.0;
                let part = match (name.as_str(), of) {
                    ("lips" | "mouth", _) => BodyPart::Mouth,
                    ("hair", _) => BodyPart::Head,
                    (_, Some(BodyPart::Head)) if middle - raw.rest[head].x > face_from => {
                        BodyPart::Face
                    }
                    (_, Some(part)) => part,
                    (_, None) => {
                        return Err(format!(
                            "the joint {:?} belongs to no part",
                            raw.joints[joint]
                        ));
                    }
                };
                let same = |s: &&mut Surface| s.part == part && s.material == appearance;
                match surfaces.iter_mut().find(same) {
                    Some(surface) => surface.triangles.push(*triangle),
                    None => surfaces.push(Surface {
                        part,
                        material: appearance.clone(),
                        triangles: vec![*triangle],
                    }),
                }
            }
        }
        surfaces.sort_by_key(|surface| surface.part);
        Ok(Self {
            points: raw.points,
            normals: raw.normals,
            weights: raw.weights,
            surfaces,
        })
    }

    /// Number of vertices.
    #[must_use]
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether the mesh is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Whether head or jaw move a vertex.
    #[must_use]
    pub fn moves(&self, vertex: usize, skeleton: &Skeleton) -> bool {
        let weights = self.weights[vertex].iter();
        weights
            .into_iter()
            .any(|(joint, w)| *w > 0.0 && skeleton.moves(*joint))
    }

    /// Positions and normals of vertices in the frame of the chair.
    pub fn posed<'a>(
        &'a self,
        vertices: impl Iterator<Item = usize> + 'a,
        skeleton: &'a Skeleton,
        head: &HeadPose,
    ) -> impl Iterator<Item = (Point3<f32>, Vector3<f64>)> + 'a {
        let joints: Vec<Isometry3<f64>> = skeleton.joints(head);
        vertices.map(move |vertex| {
            let (mut at, mut normal) = (Vector3::zeros(), Vector3::zeros());
            for &(joint, weight) in self.weights[vertex].iter().filter(|(_, w)| *w > 0.0) {
                let pose = &joints[joint];
                let local = self.points[vertex] - skeleton.rest(joint);
                at += (pose.rotation * local + pose.translation.vector) * weight;
                normal += pose.rotation * self.normals[vertex] * weight;
            }
            let up = normal.try_normalize(1e-9).unwrap_or(Vector3::z());
            (Point3::from(at.cast::<f32>()), up)
        })
    }

    /// A surface as triangles with a straight head, and the index of each of its
    /// vertices.
    #[must_use]
    pub fn part(&self, surface: &Surface, skeleton: &Skeleton) -> (TriMesh, Vec<usize>) {
        let mut known = std::collections::BTreeMap::new();
        let mut used = Vec::new();
        let mut mesh = TriMesh::default();
        for &vertex in surface.triangles.iter().flatten() {
            let index = *known.entry(vertex).or_insert_with(|| {
                used.push(vertex);
                used.len() as u32 - 1
            });
            mesh.indices.push(index);
        }
        let all = self.posed(used.iter().copied(), skeleton, &HeadPose::default());
        for (at, normal) in all {
            mesh.positions.push(at.into());
            mesh.normals.push(normal.cast::<f32>().into());
        }
        mesh.uvs = vec![[0.0; 2]; mesh.positions.len()];
        box_uvs(&mut mesh);
        (mesh, used)
    }
}
