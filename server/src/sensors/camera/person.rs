//! The moving head of a person: vertices that head and jaw move are uploaded again when
//! these have moved. The rest of the person is fixed to the chair.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::batch::{Vertex, octahedral};
use super::buffers::Buffers;
use super::geometry::Geometry;
use super::scene::RenderScene;
use crate::people::{HeadPose, Person};
use crate::snapshot::Snapshot;

/// The moving part of a person on the GPU.
pub(super) struct PersonMesh {
    person: Arc<Person>,
    /// Vertices of the mesh that move.
    moving: Vec<usize>,
    /// Ranges of the vertex buffer.
    runs: Vec<Run>,
    /// Bodies of these vertices.
    bodies: Vec<usize>,
    /// Pose of the uploaded vertices; `None` before the first image.
    written: Option<HeadPose>,
}

/// Consecutive vertices.
struct Run {
    /// First in the buffer.
    first: usize,
    /// As uploaded, with the index in `moving` of those that move.
    vertices: Vec<(Vertex, Option<usize>)>,
}

/// Fixed vertices between two moving ones that are uploaded with them: one upload costs
/// as much as many vertices.
const BETWEEN: usize = 128;

impl PersonMesh {
    /// Finds the vertices that move.
    pub(super) fn find(scene: &RenderScene, buffers: &Buffers) -> Option<Self> {
        let rendered = scene.person.as_ref()?;
        let person = Arc::clone(&rendered.person);
        let (mesh, skeleton) = (&person.mesh, &person.skeleton);
        let mut moving = Vec::new();
        let mut places: BTreeMap<usize, usize> = BTreeMap::new();
        let mut runs: Vec<Run> = Vec::new();
        let mut moved = Vec::new();
        for &(instance, part) in &rendered.parts {
            let mut known: BTreeMap<[u32; 3], usize> = BTreeMap::new();
            for surface in mesh.surfaces.iter().filter(|s| s.part == part) {
                let (posed, vertices) = mesh.part(surface, skeleton);
                for (at, vertex) in posed.positions.iter().zip(vertices) {
                    if mesh.moves(vertex, skeleton) {
                        known.entry(at.map(f32::to_bits)).or_insert(vertex);
                    }
                }
            }
            let bodies = buffers.bodies.iter();
            let Some(body) = bodies.enumerate().find(|(_, b)| b.instance == instance) else {
                continue;
            };
            moved.push(body.0);
            for (place, vertex) in buffers.vertices.iter().enumerate() {
                if (vertex.packed & 0xfff) as usize != body.0 {
                    continue;
                }
                let Some(&of) = known.get(&vertex.position.map(f32::to_bits)) else {
                    continue;
                };
                let of = *places.entry(of).or_insert_with(|| {
                    moving.push(of);
                    moving.len() - 1
                });
                match runs.last_mut() {
                    Some(run) if (run.end()..=run.end() + BETWEEN).contains(&place) => {
                        let between = &buffers.vertices[run.end()..place];
                        run.vertices.extend(between.iter().map(|v| (*v, None)));
                        run.vertices.push((*vertex, Some(of)));
                    }
                    _ => runs.push(Run {
                        first: place,
                        vertices: vec![(*vertex, Some(of))],
                    }),
                }
            }
        }
        Some(Self {
            person,
            moving,
            runs,
            bodies: moved,
            written: None,
        })
    }

    /// Uploads the head of a snapshot and returns whether it changed. A snapshot
    /// without a person changes nothing.
    pub(super) fn write(
        &mut self,
        queue: &wgpu::Queue,
        geometry: &Geometry,
        snapshot: &Snapshot,
    ) -> bool {
        let head = snapshot.person.as_ref().map(|state| state.head);
        let Some(head) = head.filter(|head| self.written != Some(*head)) else {
            return false;
        };
        let (mesh, skeleton) = (&self.person.mesh, &self.person.skeleton);
        let posed = mesh.posed(self.moving.iter().copied(), skeleton, &head);
        let posed: Vec<([f32; 3], [i16; 2])> = posed
            .map(|(at, normal)| (at.into(), octahedral(normal.into())))
            .collect();
        for run in &self.runs {
            let moved = run.vertices.iter().map(|(vertex, of)| match *of {
                None => *vertex,
                Some(of) => Vertex {
                    position: posed[of].0,
                    normal: posed[of].1,
                    ..*vertex
                },
            });
            let moved: Vec<Vertex> = moved.collect();
            geometry.write_vertices(queue, run.first, &moved);
        }
        self.written = Some(head);
        true
    }

    /// The bodies whose vertices move, by index.
    pub(super) fn bodies(&self) -> &[usize] {
        &self.bodies
    }
}

impl Run {
    /// One past its last vertex.
    fn end(&self) -> usize {
        self.first + self.vertices.len()
    }
}
