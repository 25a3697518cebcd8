//! The head of a person: vertices that head and jaw move are written anew for every
//! picture; all else of the person rides on the chair as it was posed.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Point3;

use super::buffers::{Buffers, Vertex, octahedral};
use super::geometry::Geometry;
use super::scene::RenderScene;
use crate::people::Person;
use crate::snapshot::Snapshot;

/// The moving part of a person on the adapter.
pub(super) struct PersonMesh {
    person: Arc<Person>,
    /// Stretches of the vertex buffer.
    runs: Vec<Run>,
}

/// Neighbouring vertices.
struct Run {
    /// First in the buffer.
    first: usize,
    /// As they were uploaded, with the vertex of the mesh that each is.
    vertices: Vec<(Vertex, usize)>,
}

impl PersonMesh {
    /// Finds the vertices that move.
    pub(super) fn find(scene: &RenderScene, buffers: &Buffers) -> Option<Self> {
        let rendered = scene.person.as_ref()?;
        let person = Arc::clone(&rendered.person);
        let (mesh, skeleton) = (&person.mesh, &person.skeleton);
        let mut runs: Vec<Run> = Vec::new();
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
            for (place, vertex) in buffers.vertices.iter().enumerate() {
                if (vertex.packed & 0xfff) as usize != body.0 {
                    continue;
                }
                let Some(&of) = known.get(&vertex.position.map(f32::to_bits)) else {
                    continue;
                };
                match runs.last_mut() {
                    Some(run) if run.first + run.vertices.len() == place => {
                        run.vertices.push((*vertex, of));
                    }
                    _ => runs.push(Run {
                        first: place,
                        vertices: vec![(*vertex, of)],
                    }),
                }
            }
        }
        Some(Self { person, runs })
    }

    /// Gives the adapter the head of a snapshot. A snapshot without a person leaves
    /// it as it was.
    pub(super) fn write(&self, queue: &wgpu::Queue, geometry: &Geometry, snapshot: &Snapshot) {
        let Some(state) = &snapshot.person else {
            return;
        };
        let (mesh, skeleton) = (&self.person.mesh, &self.person.skeleton);
        for run in &self.runs {
            let vertices = run.vertices.iter().map(|(_, vertex)| *vertex);
            let posed = mesh.posed(vertices, skeleton, &state.head);
            let moved: Vec<Vertex> = run
                .vertices
                .iter()
                .zip(posed)
                .map(|((vertex, _), (at, normal))| {
                    let at: Point3<f32> = at;
                    Vertex {
                        position: at.into(),
                        normal: octahedral(normal.into()),
                        ..*vertex
                    }
                })
                .collect();
            geometry.write_vertices(queue, run.first, &moved);
        }
    }
}
