//! Skins of deformables: their vertices are uploaded again for every image, in the
//! frame of their object, so that other code treats them as rigid.

use std::collections::BTreeMap;

use bytemuck::Zeroable;
use nalgebra::{Isometry3, Point3};

use super::batch::{Vertex, octahedral};
use super::buffers::Buffers;
use super::geometry::Geometry;
use super::scene::{Binding, RenderScene};
use crate::geometry::plush::Skin;
use crate::snapshot::Snapshot;

/// The deformables on the GPU.
pub(super) struct SoftMeshes(Vec<SoftMesh>);

/// One deformable.
struct SoftMesh {
    object: usize,
    skin: Skin,
    /// First of its vertices in the buffer.
    first: usize,
    /// Its vertices, each with its vertex of the skin.
    vertices: Vec<(Vertex, Option<usize>)>,
}

impl SoftMeshes {
    /// Finds the vertices of the deformables by their bodies.
    pub(super) fn find(scene: &RenderScene, buffers: &Buffers) -> Self {
        let mesh = |(object, skin): &(usize, Skin)| {
            let binding = Binding::Object(*object);
            let body = buffers.bodies.iter().position(|b| b.binding == binding)?;
            let own = |v: &Vertex| (v.packed & 0xfff) as usize == body;
            let first = buffers.vertices.iter().position(own)?;
            let bits = |p: [f32; 3]| p.map(f32::to_bits);
            let known: BTreeMap<[u32; 3], usize> = skin
                .positions
                .iter()
                .enumerate()
                .map(|(i, p)| (bits(p.coords.cast::<f32>().into()), i))
                .collect();
            // The vertices of a body are consecutive.
            let vertices = buffers.vertices[first..].iter().take_while(|v| own(v));
            Some(SoftMesh {
                object: *object,
                skin: skin.clone(),
                first,
                vertices: vertices
                    .map(|v| (*v, known.get(&bits(v.position)).copied()))
                    .collect(),
            })
        };
        Self(scene.skins.iter().filter_map(mesh).collect())
    }

    /// Uploads the shapes of a snapshot. A snapshot without them changes nothing.
    pub(super) fn write(&self, queue: &wgpu::Queue, geometry: &Geometry, snapshot: &Snapshot) {
        for mesh in &self.0 {
            let now = snapshot.skins.iter().find(|s| s.object == mesh.object);
            if let Some(now) = now
                && now.vertices.len() == mesh.skin.positions.len()
            {
                let pose = snapshot.objects[mesh.object].pose;
                let moved = mesh.moved(&pose, &now.vertices);
                geometry.write_vertices(queue, mesh.first, &moved);
            }
        }
    }
}

impl SoftMesh {
    fn moved(&self, house_from_object: &Isometry3<f64>, house: &[Point3<f32>]) -> Vec<Vertex> {
        let local: Vec<Point3<f64>> = house
            .iter()
            .map(|p| house_from_object.inverse_transform_point(&p.cast()))
            .collect();
        let normals = self.skin.normals(&local);
        let mut moved = vec![Vertex::zeroed(); self.vertices.len()];
        for (out, (rest, skin)) in moved.iter_mut().zip(&self.vertices) {
            *out = *rest;
            if let Some(i) = *skin {
                out.position = local[i].coords.cast::<f32>().into();
                out.normal = octahedral(normals[i].into());
            }
        }
        moved
    }
}
