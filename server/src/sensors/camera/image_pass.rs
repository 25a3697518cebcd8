//! The passes of one image: surfaces, and the instance ids of outlines.

use super::batch::Shine;
use super::contact;
use super::frame_data::FrameData;
use super::geometry::{Geometry, VisibleRange};
use super::pipelines::{Ambient, Pipelines};
use super::target::{Image, Target, depth_attachment};
use crate::scene::Lighting;

/// Reversed depth where nothing is hit.
const FARTHEST: wgpu::LoadOp<f32> = wgpu::LoadOp::Clear(0.0);

/// The geometry in view of a camera.
pub(super) struct Shown {
    pub visible: Vec<VisibleRange>,
    /// Index of its first draw in the frame.
    pub first_draw: usize,
    /// Index of its first list of capsules in the frame.
    pub first_list: usize,
    /// Shader variant of each list.
    pub variants: Vec<usize>,
}

/// What the passes of one image read.
pub(super) struct ImagePass<'a> {
    pub target: &'a Target,
    pub pipelines: &'a Pipelines,
    pub geometry: &'a Geometry,
    pub frame: &'a FrameData,
    pub scene_group: &'a wgpu::BindGroup,
    pub shadow_group: &'a wgpu::BindGroup,
    /// Contacts of one draw, for a CPU adapter, and of all draws.
    pub contact_groups: Option<&'a [wgpu::BindGroup; 2]>,
    /// Color where nothing is hit.
    pub sky: wgpu::Color,
    /// Where nothing is hit, packing writes the background.
    pub packs_background: bool,
    pub is_on_gpu: bool,
    /// The image is discarded: only one of its pixels is rendered.
    pub is_warming_up: bool,
}

impl ImagePass<'_> {
    /// Records the passes of one image.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, shown: &Shown) {
        self.record_surfaces(encoder, shown);
        self.record_outline(encoder, shown);
    }

    fn record_surfaces(&self, encoder: &mut wgpu::CommandEncoder, shown: &Shown) {
        let (visible, target, on_gpu) = (&shown.visible, self.target, self.is_on_gpu);
        let (view, resolve, depth) = match &target.samples {
            None => (&target.color.view, None, &target.depth.view),
            Some([color, depth]) => (color, Some(&target.color.view), depth),
        };
        // A clear takes a GPU an eighth of the time of an image. Glass is blended with
        // the background.
        let glass = visible.iter().any(|s| s.finish.shine == Shine::Glass);
        let clears = glass || !self.packs_background;
        let color = wgpu::RenderPassColorAttachment {
            view,
            depth_slice: None,
            resolve_target: resolve,
            ops: wgpu::Operations {
                load: match clears {
                    true => wgpu::LoadOp::Clear(self.sky),
                    false => wgpu::LoadOp::Load,
                },
                store: if resolve.is_some() {
                    wgpu::StoreOp::Discard
                } else {
                    wgpu::StoreOp::Store
                },
            },
        };
        let ids = target.ids.as_ref().filter(|_| !target.is_averaged());
        let attachments = [Some(color)]
            .into_iter()
            .chain(ids.map(|ids| Some(identified(ids))));
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(&target.spec.name),
            color_attachments: &attachments.collect::<Vec<_>>(),
            depth_stencil_attachment: Some(depth_attachment(depth, FARTHEST, resolve.is_none())),
            ..Default::default()
        });
        self.limit(&mut pass);
        pass.set_bind_group(0, self.scene_group, &[]);
        pass.set_bind_group(1, self.shadow_group, &[]);
        self.geometry.set(&mut pass);
        if let Some([one, all]) = self.contact_groups {
            match on_gpu {
                true => pass.set_bind_group(2, all, &[]),
                false => pass.set_bind_group(2, one, &[0]),
            }
        }
        // A GPU has one pipeline per finish, a CPU adapter one per source of ambient light.
        let variant = |s: &VisibleRange| match on_gpu {
            true => 0,
            false => s.ambient.variant(&shown.variants),
        };
        let list = |s: &VisibleRange| match s.ambient {
            Ambient::Contacts { list, .. } if !on_gpu => Some(list),
            _ => None,
        };
        let same = |a: &VisibleRange, b: &VisibleRange| {
            let key = |s: &VisibleRange| (variant(s), list(s));
            a.finish == b.finish && a.finish.shine != Shine::Glass && key(a) == key(b)
        };
        let mut next_draw = shown.first_draw;
        let mut current = None;
        let mut bound = None;
        for run in visible.chunk_by(same) {
            let draws = next_draw..next_draw + run.len();
            next_draw = draws.end;
            let s = &run[0];
            let pipelines = match on_gpu {
                true => self.pipelines.drawn(s.finish),
                false => self.pipelines.surface(s.finish, variant(s)),
            };
            if current != Some((s.finish, variant(s))) {
                current = Some((s.finish, variant(s)));
                pass.set_pipeline(pipelines.0);
            }
            if let (Some(list), Some([contacts, _])) = (list(s), self.contact_groups)
                && bound != Some(list)
            {
                bound = Some(list);
                let offset = (shown.first_list + list) as u64 * contact::STRIDE;
                pass.set_bind_group(2, contacts, &[offset as u32]);
            }
            self.frame.record(&mut pass, draws.clone(), on_gpu);
            if let Some(second) = pipelines.1 {
                pass.set_pipeline(second);
                self.frame.record(&mut pass, draws, on_gpu);
                current = None;
            }
        }
    }

    /// The instance ids of outlines, of targets with several samples.
    fn record_outline(&self, encoder: &mut wgpu::CommandEncoder, shown: &Shown) {
        let target = self.target;
        if let (Some(ids), Some(pipeline)) = (&target.ids, &self.pipelines.outline) {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("ids"),
                color_attachments: &[Some(identified(ids))],
                depth_stencil_attachment: Some(depth_attachment(
                    &target.depth.view,
                    FARTHEST,
                    true,
                )),
                ..Default::default()
            });
            self.limit(&mut pass);
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, self.scene_group, &[]);
            self.geometry.set(&mut pass);
            let draws = shown.first_draw..shown.first_draw + shown.visible.len();
            self.frame.record(&mut pass, draws, self.is_on_gpu);
        }
    }

    /// Limits a pass to one pixel while an image is discarded.
    fn limit(&self, pass: &mut wgpu::RenderPass<'_>) {
        if self.is_warming_up {
            pass.set_scissor_rect(0, 0, 1, 1);
        }
    }
}

/// The texture of the IDs as a target: 0 where nothing is hit.
fn identified(ids: &Image) -> wgpu::RenderPassColorAttachment<'_> {
    wgpu::RenderPassColorAttachment {
        view: &ids.view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations {
            load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
            store: wgpu::StoreOp::Store,
        },
    }
}

/// Colour of the sky where nothing is hit, as the shader computes it; ID 0.
pub(super) fn background(light: &Lighting) -> wgpu::Color {
    let show = |c: f32| f64::from((c * (6.2 * c + 0.5)) / (c * (6.2 * c + 1.7) + 0.06));
    let [r, g, b] = light.sky.map(|c| show(c * 1.5));
    wgpu::Color { r, g, b, a: 0.0 }
}
