//! Uniform data of one image, except bodies and materials.

use nalgebra::Matrix4;

use super::scene::Surrounding;
use super::view::{View, columns};
use crate::appearance::MOST_LAMPS;
use crate::scene::Lighting;

/// `Camera` in the shaders, member by member: matrices by columns, vectors with an
/// unused fourth component.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct CameraUniform {
    clip_from_world: [f32; 16],
    shadow_from_world: [f32; 16],
    eye: [f32; 4],
    sun_direction: [f32; 4],
    sun: [f32; 4],
    sky: [f32; 4],
    ground: [f32; 4],
    /// Size of a shadow texel in the map and in the world; number of lamps.
    shadow_texel: [f32; 4],
    irradiance: [[f32; 16]; 3],
    /// Position and colour of each; unused ones are dark.
    lamps: [[[f32; 4]; 2]; MOST_LAMPS],
}

impl CameraUniform {
    /// `texel` is the size of a shadow texel in the map and in the world, metres.
    pub(super) fn new(
        view: &View,
        light: &Lighting,
        shadow_from_world: &Matrix4<f64>,
        texel: [f32; 2],
        surrounding: Option<&Surrounding>,
    ) -> Self {
        let lamp_count = surrounding.map_or(0, |s| s.lamps.len().min(MOST_LAMPS));
        let mut irradiance = [[0.0; 16]; 3];
        let mut lamps = [[[0.0; 4]; 2]; MOST_LAMPS];
        if let Some(surrounding) = surrounding {
            for (to, from) in irradiance.iter_mut().zip(&surrounding.irradiance.0) {
                to.copy_from_slice(from.as_slice());
            }
            for (to, lamp) in lamps.iter_mut().zip(&surrounding.lamps) {
                *to = [padded(lamp.at.into()), padded(lamp.color)];
            }
        }
        let eye = view.world_from_optical.translation.vector.cast::<f32>();
        Self {
            clip_from_world: columns(&view.clip_from_world),
            shadow_from_world: columns(shadow_from_world),
            eye: padded([eye.x, eye.y, eye.z]),
            sun_direction: padded(light.sun_direction),
            sun: padded(light.sun),
            sky: padded(light.sky),
            ground: padded(light.ground),
            shadow_texel: [texel[0], texel[1], lamp_count as f32, 0.0],
            irradiance,
            lamps,
        }
    }
}

fn padded([x, y, z]: [f32; 3]) -> [f32; 4] {
    [x, y, z, 0.0]
}
