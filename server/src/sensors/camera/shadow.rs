//! One shadow map for all cameras. Only the region around casters that moved or changed
//! is rendered again; every texel equals that of a complete map.

use std::ops::Range;

use nalgebra::{Isometry3, Matrix4, Point3, Vector3};

use super::batch::Caster;
use super::buffers::Buffers;
use super::frame_data::FrameData;
use super::geometry::Geometry;
use super::pipelines::{DEPTH, Pipelines};
use super::scene::{Binding, RenderScene};
use super::target::{Image, depth_attachment, image};

/// The map and the state that it shows.
pub(super) struct ShadowMap {
    pub(super) image: Image,
    pub(super) sun: SunView,
    size: u32,
    /// Poses of the bodies in the map; empty before the first.
    drawn_for: Vec<Isometry3<f64>>,
    /// Texels of the casters of each body at these poses.
    covered: Vec<Vec<Rectangle>>,
    /// Bodies whose vertices have changed since.
    changed: Vec<usize>,
}

/// Texels `[left, top, right, bottom]`, the last ones excluded.
type Rectangle = [u32; 4];

/// A region of the map to render, and its draws.
pub(super) struct Outdated {
    region: Rectangle,
    draws: Range<usize>,
}

impl ShadowMap {
    pub(super) fn new(device: &wgpu::Device, sun: SunView, size: u32) -> Self {
        let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING;
        Self {
            image: image(device, [size; 2], DEPTH, 1, usage),
            sun,
            size,
            drawn_for: Vec::new(),
            covered: Vec::new(),
            changed: Vec::new(),
        }
    }

    /// Marks bodies whose vertices have changed.
    pub(super) fn changes(&mut self, bodies: &[usize]) {
        self.changed.extend(bodies);
    }

    /// Finds the region of the map that casters left or entered, and adds the draws of the
    /// casters in it to `frame`; `None` if the map is up to date.
    pub(super) fn update(
        &mut self,
        frame: &mut FrameData,
        geometry: &Geometry,
        poses: &[Isometry3<f64>],
    ) -> Option<Outdated> {
        let region = self.outdated(geometry, poses)?;
        let [left, top, right, bottom] = region;
        let first = frame.next_draw();
        let mut adjacent: Option<Range<u32>> = None;
        for (body, covered) in geometry.bodies.iter().zip(&self.covered) {
            for (caster, [l, t, r, b]) in body.casters.iter().zip(covered) {
                if *l >= right || *r <= left || *t >= bottom || *b <= top {
                    continue;
                }
                match &mut adjacent {
                    Some(range) if range.end == caster.indices.start => {
                        range.end = caster.indices.end;
                    }
                    other => {
                        if let Some(range) = other.replace(caster.indices.clone()) {
                            frame.add_draw(&range, 0);
                        }
                    }
                }
            }
        }
        if let Some(range) = adjacent {
            frame.add_draw(&range, 0);
        }
        Some(Outdated {
            region,
            draws: first..frame.next_draw(),
        })
    }

    /// Renders a region; `group` contains the bodies.
    pub(super) fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        pipelines: &Pipelines,
        group: &wgpu::BindGroup,
        geometry: &Geometry,
        (frame, reads_draws): (&FrameData, bool),
        outdated: Outdated,
    ) {
        let [left, top, right, bottom] = outdated.region;
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("shadow"),
            depth_stencil_attachment: Some(depth_attachment(
                &self.image.view,
                wgpu::LoadOp::Load,
                true,
            )),
            ..Default::default()
        });
        pass.set_scissor_rect(left, top, right - left, bottom - top);
        pass.set_bind_group(0, group, &[]);
        pass.set_pipeline(&pipelines.erase);
        pass.draw(0..3, 0..1);
        pass.set_pipeline(&pipelines.caster);
        geometry.set(&mut pass);
        frame.record(&mut pass, outdated.draws, reads_draws);
    }

    /// The region of the map that casters left or entered. Updates the casters' texels.
    fn outdated(&mut self, geometry: &Geometry, poses: &[Isometry3<f64>]) -> Option<Rectangle> {
        let all = self.drawn_for.len() != poses.len();
        let covered = |map: &Self, i: usize| -> Vec<Rectangle> {
            let casters = geometry.bodies[i].casters.iter();
            casters
                .map(|caster| map.around(caster, &poses[i]))
                .collect()
        };
        if all {
            self.covered = (0..poses.len()).map(|i| covered(self, i)).collect();
            self.drawn_for = poses.to_vec();
            self.changed.clear();
            return Some([0, 0, self.size, self.size]);
        }
        let mut part: Option<Rectangle> = None;
        let mut include = |covered: &[Rectangle]| {
            for [l, t, r, b] in covered.iter().copied() {
                let [pl, pt, pr, pb] = part.unwrap_or([l, t, r, b]);
                part = Some([l.min(pl), t.min(pt), r.max(pr), b.max(pb)]);
            }
        };
        for (i, pose) in poses.iter().enumerate() {
            if self.drawn_for[i] == *pose && !self.changed.contains(&i) {
                continue;
            }
            include(&self.covered[i]);
            self.covered[i] = covered(self, i);
            include(&self.covered[i]);
            self.drawn_for[i] = *pose;
        }
        self.changed.clear();
        part.filter(|[l, t, r, b]| l < r && t < b)
    }

    /// Texels that a caster may cover.
    fn around(&self, caster: &Caster, pose: &Isometry3<f64>) -> Rectangle {
        let centre = self.sun.clip_from_world * (pose * caster.centre).to_homogeneous();
        let half = 0.5 * f64::from(self.size);
        // The rows of the matrix are orthogonal, each with one scale.
        let reach = |row: usize| {
            let scale = self.sun.clip_from_world.fixed_view::<1, 3>(row, 0).norm();
            caster.radius * scale * half + 2.0
        };
        let texel = |x: f64| x.clamp(0.0, f64::from(self.size)) as u32;
        let (x, y) = ((1.0 + centre.x) * half, (1.0 - centre.y) * half);
        let (rx, ry) = (reach(0), reach(1));
        [
            texel((x - rx).floor()),
            texel((y - ry).floor()),
            texel((x + rx).ceil()),
            texel((y + ry).ceil()),
        ]
    }
}

/// Direction of the light: world to the map's clip space, and the size of a texel.
pub(super) struct SunView {
    pub(super) clip_from_world: Matrix4<f64>,
    /// Metres.
    pub(super) texel: f64,
}

/// Half size of the region with shadows, metres from its middle.
const REACH: f64 = 8.0;
/// Height above which no shadows fall, metres.
const CEILING: f64 = 2.3;

impl SunView {
    /// Fits the map around all static geometry.
    pub(super) fn new(scene: &RenderScene, buffers: &Buffers, size: u32) -> Self {
        let mut low = Point3::from([f64::INFINITY; 3]);
        let mut high = Point3::from([f64::NEG_INFINITY; 3]);
        for batch in &buffers.batches {
            if buffers.bodies[batch.body].binding != Binding::World {
                continue;
            }
            let all = batch.coarse.iter().flat_map(|cell| cell.indices.clone());
            for i in all.map(|at| buffers.indices[at as usize]) {
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
        high.z = high.z.max(low.z + 0.5).min(CEILING);
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
        // Casters above the box must be in front of the near plane.
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
