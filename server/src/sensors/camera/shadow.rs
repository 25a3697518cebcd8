//! One shadow map for all cameras, redrawn only when a caster moved.

use nalgebra::{Matrix4, Point3, Vector3};

use super::buffers::Buffers;
use super::scene::{Binding, RenderScene};

/// Where the light looks: world to the map's clip space, and the size of a texel.
pub(super) struct SunView {
    pub(super) clip_from_world: Matrix4<f64>,
    /// Metres.
    pub(super) texel: f64,
}

/// Greatest part of the world with shadows, metres from its middle.
const REACH: f64 = 8.0;
/// Shadows fall on nothing higher, metres.
const CEILING: f64 = 2.3;

impl SunView {
    /// Fits the map around everything that never moves.
    pub(super) fn new(scene: &RenderScene, buffers: &Buffers, size: u32) -> Self {
        let mut low = Point3::from([f64::INFINITY; 3]);
        let mut high = Point3::from([f64::NEG_INFINITY; 3]);
        for batch in &buffers.batches {
            if buffers.bodies[batch.body].binding != Binding::World {
                continue;
            }
            for &i in &buffers.indices[batch.coarse.start as usize..batch.coarse.end as usize] {
                let p = Point3::from(buffers.vertices[i as usize].position.map(f64::from));
                low = low.inf(&p);
                high = high.sup(&p);
            }
        }
        if !(low.x < high.x && low.y < high.y) {
            low = Point3::new(-2.0, -2.0, 0.0);
            high = Point3::new(2.0, 2.0, 2.0);
        }
        low.z = low.z.max(-0.1);
        high.z = high.z.clamp(low.z + 0.5, CEILING);
        let middle = nalgebra::center(&low, &high);
        for k in 0..2 {
            low[k] = low[k].max(middle[k] - REACH);
            high[k] = high[k].min(middle[k] + REACH);
        }

        let towards = Vector3::from(scene.lighting.sun_direction.map(f64::from));
        let towards = towards.try_normalize(1e-6).unwrap_or(Vector3::z());
        let helper = if towards.z.abs() > 0.99 {
            Vector3::y()
        } else {
            Vector3::z()
        };
        let right = helper.cross(&towards).normalize();
        let up = towards.cross(&right);
        let axes = [right, up, -towards];
        let corners = (0..8).map(|i| {
            let pick = |k: usize| if i >> k & 1 == 0 { low[k] } else { high[k] };
            Vector3::new(pick(0), pick(1), pick(2))
        });
        let mut least = [f64::INFINITY; 3];
        let mut most = [f64::NEG_INFINITY; 3];
        for corner in corners {
            for k in 0..3 {
                let along = axes[k].dot(&corner);
                least[k] = least[k].min(along);
                most[k] = most[k].max(along);
            }
        }
        // Casters that reach above the box still lie before the near plane.
        least[2] -= 2.0;
        most[2] += 0.5;
        let extent: [f64; 3] = std::array::from_fn(|k| most[k] - least[k]);
        let row = |k: usize, scale: f64, offset: f64| {
            let a = axes[k] * (scale / extent[k]);
            [a.x, a.y, a.z, offset - scale * least[k] / extent[k]]
        };
        let (x, y, z) = (row(0, 2.0, -1.0), row(1, 2.0, -1.0), row(2, 1.0, 0.0));
        #[rustfmt::skip]
        let clip_from_world = Matrix4::new(
            x[0], x[1], x[2], x[3],
            y[0], y[1], y[2], y[3],
            z[0], z[1], z[2], z[3],
            0.0, 0.0, 0.0, 1.0,
        );
        Self {
            clip_from_world,
            texel: extent[0].max(extent[1]) / f64::from(size),
        }
    }
}
