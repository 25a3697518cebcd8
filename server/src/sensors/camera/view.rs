//! Projection of a camera and visibility of bodies, in double precision.

use nalgebra::{Isometry3, Matrix3, Matrix4, Point3, Vector3};

use super::culling_clusters::Cluster;
use super::spec::CameraSpec;

/// A camera at its pose.
pub(super) struct View {
    /// Camera to world.
    pub(super) world_from_optical: Isometry3<f64>,
    /// World to clip space, depth reversed: near / z.
    pub(super) clip_from_world: Matrix4<f64>,
    optical_from_world: Isometry3<f64>,
    /// Inward normals of the four side planes, optical frame.
    sides: [Vector3<f64>; 4],
    near: f64,
    /// Pixels that one metre covers at one metre.
    pub(super) focal: f64,
}

impl View {
    pub(super) fn new(spec: &CameraSpec, world_from_body: &Isometry3<f64>) -> Self {
        let world_from_optical = world_from_body * spec.mount;
        let optical_from_world = world_from_optical.inverse();
        let lens = &spec.intrinsics;
        let (w, h) = (f64::from(lens.width), f64::from(lens.height));
        let near = spec.range[0];
        #[rustfmt::skip]
        let clip_from_optical = Matrix4::new(
            2.0 * lens.fx / w, 0.0, 2.0 * lens.cx / w - 1.0, 0.0,
            0.0, -2.0 * lens.fy / h, 1.0 - 2.0 * lens.cy / h, 0.0,
            0.0, 0.0, 0.0, near,
            0.0, 0.0, 1.0, 0.0,
        );
        let (left, right) = (-lens.cx / lens.fx, (w - lens.cx) / lens.fx);
        let (top, bottom) = (-lens.cy / lens.fy, (h - lens.cy) / lens.fy);
        Self {
            world_from_optical,
            clip_from_world: clip_from_optical * optical_from_world.to_homogeneous(),
            optical_from_world,
            sides: [
                Vector3::new(1.0, 0.0, -left).normalize(),
                Vector3::new(-1.0, 0.0, right).normalize(),
                Vector3::new(0.0, 1.0, -top).normalize(),
                Vector3::new(0.0, -1.0, bottom).normalize(),
            ],
            near,
            focal: lens.fx.max(lens.fy),
        }
    }

    /// Distance from the camera to the nearest point of a sphere, `None` when it is out
    /// of view.
    pub(super) fn distance(&self, centre: &Point3<f64>, radius: f64) -> Option<f64> {
        let c = self.optical_from_world * centre;
        let visible =
            c.z + radius > self.near && self.sides.iter().all(|n| n.dot(&c.coords) > -radius);
        visible.then(|| c.coords.norm() - radius)
    }

    /// The frame of a body in camera coordinates.
    pub(super) fn placed(&self, world_from_body: &Isometry3<f64>) -> Placed {
        let optical_from_body = self.optical_from_world * world_from_body;
        let rotation = optical_from_body.rotation.to_rotation_matrix().into_inner();
        Placed {
            sides: self.sides.map(|normal| rotation.tr_mul(&normal).abs()),
            forward: rotation.row(2).transpose().abs(),
            rotation,
            translation: optical_from_body.translation.vector,
        }
    }

    /// Whether the box of a cluster may be in view.
    pub(super) fn shows(&self, placed: &Placed, cluster: &Cluster) -> bool {
        let centre = placed.rotation * cluster.centre.coords + placed.translation;
        let inside = |(normal, in_body): (&Vector3<f64>, &Vector3<f64>)| {
            normal.dot(&centre) > -in_body.dot(&cluster.half)
        };
        let depth = placed.forward.dot(&cluster.half);
        centre.z + depth > self.near && self.sides.iter().zip(&placed.sides).all(inside)
    }
}

/// Pose of a body in the camera frame.
pub(super) struct Placed {
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
    /// Absolute components of the side normals and of the viewing direction in the frame
    /// of the body.
    sides: [Vector3<f64>; 4],
    forward: Vector3<f64>,
}

/// Columns of a matrix in the shader's layout.
pub(super) fn columns(matrix: &Matrix4<f64>) -> [f32; 16] {
    std::array::from_fn(|i| matrix[(i % 4, i / 4)] as f32)
}
