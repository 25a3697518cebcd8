//! Shader variants and the layouts that they share.

use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

use super::batch::{Finish, Shine};
use super::contact;
use super::tier::Tier;

/// The shader applies the display's gamma to linear values.
pub(super) const COLOR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
/// Depth of images (reversed) and of the shadow map.
pub(super) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// IDs that are not stored in the alpha byte.
pub(super) const IDS: wgpu::TextureFormat = wgpu::TextureFormat::R16Uint;

const STRIDE: u64 = std::mem::size_of::<super::batch::Vertex>() as u64;

/// Source of the ambient occlusion of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ambient {
    /// Vertices and body.
    Vertices,
    /// The ambient map.
    Map,
    /// A list of capsules, and vertices or the ambient map.
    Contacts { list: usize, mapped: bool },
}

impl Ambient {
    /// The source as the first instance of a draw; `first` is the index of the first list
    /// in the buffer.
    pub(super) fn instance(self, first: usize) -> u32 {
        match self {
            Self::Vertices => 0,
            Self::Map => 1,
            Self::Contacts { list, mapped } => ((first + list) as u32) << 1 | u32::from(mapped),
        }
    }

    /// Index of the shader variant; `lists` are the variants of the lists.
    pub(super) fn variant(self, lists: &[usize]) -> usize {
        let of_list = |list: usize| lists.get(list).copied().unwrap_or_default();
        match self {
            Self::Vertices => 0,
            Self::Map => 1,
            Self::Contacts { list, mapped: true } => 2 + of_list(list),
            Self::Contacts { list, .. } => 2 + contact::VARIANTS.len() + of_list(list),
        }
    }
}

/// Shader variants of one finish: the ambient map alone, and contacts with and without it.
const MAPPED: usize = 1 + 2 * contact::VARIANTS.len();

/// All pipelines of a renderer.
pub(super) struct Pipelines {
    /// Group 0: camera, bodies, materials, images, reflection.
    pub(super) scene_layout: wgpu::BindGroupLayout,
    /// Group 1: shadow map.
    pub(super) shadow_layout: wgpu::BindGroupLayout,
    /// Group 2 on a CPU adapter: the occluders of one draw, at a dynamic offset.
    pub(super) contact_layout: wgpu::BindGroupLayout,
    /// Group 2 on a GPU: the occluders of all draws.
    pub(super) all_contacts_layout: wgpu::BindGroupLayout,
    /// In the order of [`Finish::ALL`]; glass absorbs light first and adds its own in a
    /// second pass.
    surfaces: Vec<(wgpu::RenderPipeline, Option<wgpu::RenderPipeline>)>,
    /// By [`Ambient::variant`] without the first. Created at first use, because few of them
    /// are needed.
    mapped: Vec<[OnceLock<wgpu::RenderPipeline>; MAPPED]>,
    /// On a GPU: one pipeline per finish for all sources of the ambient light, each created
    /// at first use. Separate pipelines cost 50 changes per image.
    drawn: Vec<OnceLock<wgpu::RenderPipeline>>,
    factory: PipelineFactory,
    /// Renders shadow casters.
    pub(super) caster: wgpu::RenderPipeline,
    /// Clears a part of the shadow map.
    pub(super) erase: wgpu::RenderPipeline,
    /// Depth and ids only.
    pub(super) outline: Option<wgpu::RenderPipeline>,
    /// The pipelines have been used: the driver has compiled most of them.
    pub(super) drew: AtomicBool,
}

impl Pipelines {
    /// The pipelines of a finish and a variant of [`Ambient`], in order.
    pub(super) fn surface(
        &self,
        finish: Finish,
        variant: usize,
    ) -> (&wgpu::RenderPipeline, Option<&wgpu::RenderPipeline>) {
        let at = finish.index();
        if finish.shine != Shine::Glass
            && let Some(variant) = variant.checked_sub(1)
            && let Some(mapped) = self.mapped.get(at)
        {
            let make = || self.factory.mapped(finish, variant);
            return (mapped[variant].get_or_init(make), None);
        }
        let (first, second) = &self.surfaces[at];
        (first, second.as_ref())
    }

    /// As [`Self::surface`] on a GPU, for all variants: the first instance of a draw is the
    /// source of its ambient light.
    pub(super) fn drawn(
        &self,
        finish: Finish,
    ) -> (&wgpu::RenderPipeline, Option<&wgpu::RenderPipeline>) {
        match self.drawn.get(finish.index()) {
            Some(drawn) if finish.shine != Shine::Glass => {
                (drawn.get_or_init(|| self.factory.drawn(finish)), None)
            }
            _ => self.surface(finish, 0),
        }
    }

    pub(super) fn new(device: &wgpu::Device, tier: Tier) -> Self {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("shader.wgsl"),
            source: wgpu::ShaderSource::Wgsl(match tier.ids_beside_colors() {
                true => with_ids(include_str!("shader.wgsl")).into(),
                false => include_str!("shader.wgsl").into(),
            }),
        });
        let scene_layout = scene_layout(device);
        let shadow_layout = shadow_layout(device);
        let contact_layout = contact_layout(device);
        let all_contacts_layout = all_contacts_layout(device);
        let layout = |groups: &[Option<&wgpu::BindGroupLayout>]| {
            device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: None,
                bind_group_layouts: groups,
                immediate_size: 0,
            })
        };
        let full = layout(&[Some(&scene_layout), Some(&shadow_layout)]);
        let near = layout(&[
            Some(&scene_layout),
            Some(&shadow_layout),
            Some(&contact_layout),
        ]);
        let per_draw = layout(&[
            Some(&scene_layout),
            Some(&shadow_layout),
            Some(&all_contacts_layout),
        ]);
        let short = layout(&[Some(&scene_layout)]);
        let factory = PipelineFactory {
            device: device.clone(),
            module,
            full,
            near,
            per_draw,
            tier,
        };
        let drawn = |finish, vertex, fragment, mix| {
            factory.shaded(finish, vertex, fragment, mix, Light::Vertices)
        };
        let surface = |finish: &Finish| {
            let one = |vertex, fragment| (drawn(*finish, vertex, fragment, Mix::Replace), None);
            match (finish.shine, tier.lit) {
                (Shine::Matte, _) => one("matte_surface", "matte_shade"),
                (Shine::Glass, _) => (
                    drawn(*finish, "lit_surface", "glass_tint", Mix::Filter),
                    Some(drawn(*finish, "lit_surface", "glass_gloss", Mix::Cover)),
                ),
                (_, true) => one("lit_surface", "lit_shade"),
                (_, false) => one("surface", "shade"),
            }
        };
        let place = |vertex, attributes, fragment, depth| {
            let stage = Stage {
                layout: &short,
                vertex,
                attributes,
                fragment,
                constants: &[],
                samples: 1,
                depth,
                mix: Mix::Replace,
                ids: false,
            };
            pipeline(device, &factory.module, &stage)
        };
        Self {
            surfaces: finishes(tier).iter().map(surface).collect(),
            mapped: match tier.ambient_per_pixel {
                true => finishes(tier).iter().map(|_| Default::default()).collect(),
                false => Vec::new(),
            },
            drawn: match tier.ambient_per_pixel {
                true => finishes(tier).iter().map(|_| OnceLock::new()).collect(),
                false => Vec::new(),
            },
            caster: place("caster", &PLACE, None, DepthUse::Shadow),
            erase: place("erase", &[], None, DepthUse::Erase),
            outline: (tier.separate_ids() && !tier.ids_beside_colors()).then(|| {
                let fragment = Some(("identify", IDS));
                place("outline", &PLACE, fragment, DepthUse::Reversed)
            }),
            scene_layout,
            shadow_layout,
            contact_layout,
            all_contacts_layout,
            drew: AtomicBool::new(false),
            factory,
        }
    }
}

/// Creates the pipelines of surfaces.
struct PipelineFactory {
    device: wgpu::Device,
    module: wgpu::ShaderModule,
    /// Layout without contacts.
    full: wgpu::PipelineLayout,
    /// Layout with the contacts of one draw.
    near: wgpu::PipelineLayout,
    /// Layout with the contacts of all draws.
    per_draw: wgpu::PipelineLayout,
    tier: Tier,
}

/// Ambient light of a pipeline.
#[derive(Clone, Copy)]
enum Light {
    /// Per vertex, without capsules.
    Vertices,
    /// Number of capsules that darken a pixel, and whether it samples the ambient map.
    Fixed { near: usize, mapped: bool },
    /// By the first instance of the draw.
    PerDraw,
}

impl PipelineFactory {
    /// The pipeline of a finish other than glass, by the index of its variant.
    fn mapped(&self, finish: Finish, variant: usize) -> wgpu::RenderPipeline {
        let (vertex, fragment) = match (finish.shine, self.tier.lit) {
            (Shine::Matte, _) => ("mapped_matte_surface", "mapped_matte_shade"),
            (_, true) => ("mapped_surface", "mapped_lit_shade"),
            (_, false) => ("mapped_surface", "mapped_shade"),
        };
        let count = contact::VARIANTS.len();
        let near = variant.checked_sub(1);
        let light = Light::Fixed {
            near: near.map_or(0, |i| contact::VARIANTS[i % count]),
            mapped: variant <= count,
        };
        self.shaded(finish, vertex, fragment, Mix::Replace, light)
    }

    /// The pipeline of a finish other than glass for all sources of the ambient light.
    fn drawn(&self, finish: Finish) -> wgpu::RenderPipeline {
        let (vertex, fragment) = match (finish.shine, self.tier.lit) {
            (Shine::Matte, _) => ("drawn_matte_surface", "drawn_matte_shade"),
            (_, true) => ("drawn_surface", "drawn_lit_shade"),
            (_, false) => ("drawn_surface", "drawn_shade"),
        };
        self.shaded(finish, vertex, fragment, Mix::Replace, Light::PerDraw)
    }

    fn shaded(
        &self,
        finish: Finish,
        vertex: &str,
        fragment: &str,
        mix: Mix,
        light: Light,
    ) -> wgpu::RenderPipeline {
        let tier = self.tier;
        let mut constants = vec![
            ("TEXTURED", f64::from(u8::from(finish.textured))),
            ("SUNNY", f64::from(u8::from(finish.sunny))),
            ("SHADOW_TAPS", f64::from(tier.shadow_taps)),
            ("ID_IN_ALPHA", f64::from(u8::from(!tier.separate_ids()))),
            ("LIT", f64::from(u8::from(tier.lit))),
            (
                "MIRRORS",
                f64::from(u8::from(finish.shine == Shine::Mirror)),
            ),
        ];
        if let Light::Fixed { near, mapped } = light {
            constants.push(("NEAR", near as f64));
            constants.push(("MAPPED", f64::from(u8::from(mapped))));
        }
        let stage = Stage {
            layout: match light {
                Light::Vertices => &self.full,
                Light::Fixed { .. } => &self.near,
                Light::PerDraw => &self.per_draw,
            },
            vertex,
            attributes: &SURFACE,
            fragment: Some((fragment, COLOR)),
            constants: &constants,
            samples: tier.samples,
            depth: DepthUse::Reversed,
            mix,
            ids: tier.ids_beside_colors(),
        };
        pipeline(&self.device, &self.module, &stage)
    }
}

/// Finishes of a tier.
fn finishes(tier: Tier) -> &'static [Finish] {
    match tier.lit {
        true => &Finish::ALL,
        false => &Finish::ALL[..Finish::PLAIN],
    }
}

const fn attribute(
    format: wgpu::VertexFormat,
    offset: u64,
    shader_location: u32,
) -> wgpu::VertexAttribute {
    wgpu::VertexAttribute {
        format,
        offset,
        shader_location,
    }
}

const SURFACE: [wgpu::VertexAttribute; 5] = [
    attribute(wgpu::VertexFormat::Float32x3, 0, 0),
    attribute(wgpu::VertexFormat::Snorm16x2, 12, 1),
    attribute(wgpu::VertexFormat::Float32x2, 16, 2),
    attribute(wgpu::VertexFormat::Uint32, 24, 3),
    attribute(wgpu::VertexFormat::Unorm16x2, 28, 4),
];

const PLACE: [wgpu::VertexAttribute; 2] = [
    attribute(wgpu::VertexFormat::Float32x3, 0, 0),
    attribute(wgpu::VertexFormat::Uint32, 24, 3),
];

struct Stage<'a> {
    layout: &'a wgpu::PipelineLayout,
    vertex: &'a str,
    attributes: &'a [wgpu::VertexAttribute],
    fragment: Option<(&'a str, wgpu::TextureFormat)>,
    constants: &'a [(&'a str, f64)],
    samples: u32,
    depth: DepthUse,
    mix: Mix,
    /// It has IDs as a second target.
    ids: bool,
}

/// The fragment shaders of surfaces with the ID of their body as a second output. The first
/// becomes a function of its own, since shaders are not called.
fn with_ids(shader: &str) -> String {
    const HEAD: &str = "@fragment fn ";
    const RESULT: &str = "-> @location(0) vec4<f32> {";
    let mut whole = String::with_capacity(shader.len() + 4096);
    let mut entries =
        String::from("struct WithId { @location(0) color: vec4<f32>, @location(1) id: u32 }\n");
    for line in shader.lines() {
        let head = line.strip_prefix(HEAD).and_then(|l| l.strip_suffix(RESULT));
        let Some((name, arguments)) = head.and_then(|head| head.split_once('(')) else {
            whole.push_str(line);
            whole.push('\n');
            continue;
        };
        whole.push_str(&format!("fn {name}_color({arguments}-> vec4<f32> {{\n"));
        let id = match name.contains("matte") {
            true => "v.color.a",
            false => "v.more.w",
        };
        entries.push_str(&format!(
            "{HEAD}{name}({arguments}-> WithId {{ return WithId({name}_color(v), u32({id} + 0.5)); }}\n"
        ));
    }
    whole + &entries
}

/// Blending with the existing pixel.
#[derive(Clone, Copy, PartialEq)]
enum Mix {
    Replace,
    /// Its colour is multiplied, its ID is kept.
    Filter,
    /// Light is added to its colour, its ID is replaced.
    Cover,
}

impl Mix {
    fn blend(self) -> Option<wgpu::BlendState> {
        use wgpu::BlendFactor::{Dst, One, OneMinusSrc, Zero};
        let component = |src_factor, dst_factor| wgpu::BlendComponent {
            src_factor,
            dst_factor,
            operation: wgpu::BlendOperation::Add,
        };
        let color = match self {
            Self::Replace => return None,
            Self::Filter => component(Dst, Zero),
            Self::Cover => component(One, OneMinusSrc),
        };
        Some(wgpu::BlendState {
            color,
            alpha: component(One, Zero),
        })
    }
}

#[derive(Clone, Copy)]
enum DepthUse {
    /// Near is 1, infinity is 0.
    Reversed,
    /// Increases away from the sun.
    Shadow,
    /// Overwrites the shadow map.
    Erase,
}

fn pipeline(
    device: &wgpu::Device,
    module: &wgpu::ShaderModule,
    stage: &Stage<'_>,
) -> wgpu::RenderPipeline {
    let options = wgpu::PipelineCompilationOptions {
        constants: stage.constants,
        ..Default::default()
    };
    let targets = stage.fragment.map(|(_, format)| {
        let color = wgpu::ColorTargetState {
            format,
            blend: stage.mix.blend(),
            write_mask: match stage.mix {
                Mix::Filter => wgpu::ColorWrites::COLOR,
                _ => wgpu::ColorWrites::ALL,
            },
        };
        let ids = stage.ids.then_some(wgpu::ColorTargetState {
            format: IDS,
            blend: None,
            write_mask: match stage.mix {
                Mix::Filter => wgpu::ColorWrites::empty(),
                _ => wgpu::ColorWrites::ALL,
            },
        });
        let targets = [Some(color)].into_iter().chain(ids.map(Some));
        targets.collect::<Vec<_>>()
    });
    let (compare, bias) = match stage.depth {
        DepthUse::Reversed => (wgpu::CompareFunction::GreaterEqual, Default::default()),
        DepthUse::Erase => (wgpu::CompareFunction::Always, Default::default()),
        DepthUse::Shadow => {
            let bias = wgpu::DepthBiasState {
                constant: 2,
                slope_scale: 1.5,
                clamp: 0.0,
            };
            (wgpu::CompareFunction::Less, bias)
        }
    };
    let layouts = [Some(wgpu::VertexBufferLayout {
        array_stride: STRIDE,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: stage.attributes,
    })];
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(stage.vertex),
        layout: Some(stage.layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(stage.vertex),
            compilation_options: options.clone(),
            buffers: if stage.attributes.is_empty() {
                &[]
            } else {
                &layouts
            },
        },
        primitive: wgpu::PrimitiveState {
            cull_mode: Some(wgpu::Face::Back),
            ..Default::default()
        },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(compare),
            stencil: Default::default(),
            bias,
        }),
        multisample: wgpu::MultisampleState {
            count: stage.samples,
            ..Default::default()
        },
        fragment: stage
            .fragment
            .zip(targets.as_ref())
            .map(|((entry, _), targets)| wgpu::FragmentState {
                module,
                entry_point: Some(entry),
                compilation_options: options.clone(),
                targets,
            }),
        multiview_mask: None,
        cache: None,
    })
}

fn scene_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let buffer = |ty| wgpu::BindingType::Buffer {
        ty,
        has_dynamic_offset: false,
        min_binding_size: None,
    };
    let storage = buffer(wgpu::BufferBindingType::Storage { read_only: true });
    let types = [
        buffer(wgpu::BufferBindingType::Uniform),
        storage,
        storage,
        wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: true },
            view_dimension: wgpu::TextureViewDimension::D2Array,
            multisampled: false,
        },
        wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
        wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: true },
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        },
        wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
        wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: true },
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        },
        wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
    ];
    group_layout(device, &types)
}

fn contact_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let types = [wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Uniform,
        has_dynamic_offset: true,
        min_binding_size: std::num::NonZero::new(contact::LIST),
    }];
    group_layout(device, &types)
}

fn all_contacts_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let types = [wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Storage { read_only: true },
        has_dynamic_offset: false,
        min_binding_size: std::num::NonZero::new(contact::STRIDE),
    }];
    group_layout(device, &types)
}

fn shadow_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let types = [
        wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Depth,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        },
        wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Comparison),
    ];
    group_layout(device, &types)
}

fn group_layout(device: &wgpu::Device, types: &[wgpu::BindingType]) -> wgpu::BindGroupLayout {
    let entries: Vec<_> = types
        .iter()
        .enumerate()
        .map(|(i, &ty)| wgpu::BindGroupLayoutEntry {
            binding: i as u32,
            visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
            ty,
            count: None,
        })
        .collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: None,
        entries: &entries,
    })
}
