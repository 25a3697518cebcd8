//! Materials by family, and decoration.

use super::file::{AppearanceFile, Color, Kind, Palette, Pattern, Spot};
use super::random::{Random, Row};
use super::setting::{Appearance, share_of};
use crate::geometry::{Family, Material, Texture};
use wheelarm_proto::random::fnv1a_32;

/// A rendered object without collision.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoration {
    /// Kind.
    pub kind: Kind,
    /// Middle of its back (wall images) or of its foot, in `house`, metres.
    pub at: [f64; 3],
    /// Direction that it faces, radians from east.
    pub along: f64,
    /// Width and height, metres; rugs are flat on the floor.
    pub size: [f64; 2],
    /// Its materials: frame or pot or shade, image or leaves or border.
    pub materials: [Material; 2],
}

/// The material that replaces a member of a family in an appearance, the same for all uses of
/// that material.
pub(super) fn swapped(
    appearance: &Appearance,
    file: &AppearanceFile,
    material: &Material,
) -> Material {
    let Some(family) = material.family else {
        return material.clone();
    };
    let strength = match family {
        Family::Wall | Family::Floor | Family::Ceiling => appearance.background,
        Family::Lamp | Family::Outdoors => 0,
        _ => appearance.materials,
    };
    let mut random = Random::new(appearance.seed, Row::Material, fnv1a_32(&material.name));
    let changes = random.share() < share_of(strength);
    let (Some(palette), true) = (file.family.get(&family), changes) else {
        return material.clone();
    };
    let texture = random.share();
    let mut new = drawn(palette, &mut random, material);
    // At the smallest strength only colours change.
    if strength < 2 {
        new.texture = material.texture.clone();
    } else if texture < f64::from(palette.plain) && !palette.textures.is_empty() {
        new.texture = None;
    }
    new
}

/// A sampled material of a palette; properties that the palette lacks are unchanged.
fn drawn(palette: &Palette, random: &mut Random, material: &Material) -> Material {
    let color = random.one_of(&palette.colors).map(|Color(color)| *color);
    let texture = random
        .one_of(&palette.textures)
        .map(|Pattern { pattern, metres }| Texture {
            pattern: pattern.clone(),
            metres: *metres as f32,
            file: None,
        });
    Material {
        color: color.unwrap_or(material.color),
        roughness: random.range(palette.roughness) as f32,
        texture: texture.or_else(|| material.texture.clone()),
        ..material.clone()
    }
}

/// The decoration at the places of the file.
pub(super) fn decoration(appearance: &Appearance, file: &AppearanceFile) -> Vec<Decoration> {
    if appearance.decoration == 0 {
        return Vec::new();
    }
    let spots = file.decoration.iter().enumerate();
    spots
        .filter_map(|(i, spot)| {
            let mut random = Random::new(appearance.seed, Row::Decoration, i as u32);
            let there = random.share() < share_of(appearance.decoration);
            let size = spot.size.map(|s| s * random.range([0.75, 1.0]));
            let materials = materials(spot, file, &mut random);
            there.then(|| Decoration {
                kind: spot.kind,
                at: spot.at,
                along: spot.along_deg.to_radians(),
                size,
                materials,
            })
        })
        .collect()
}

fn materials(spot: &Spot, file: &AppearanceFile, random: &mut Random) -> [Material; 2] {
    let families = match spot.kind {
        Kind::WallImage => [Family::Wood, Family::Art],
        Kind::Rug => [Family::Fabric, Family::Fabric],
        Kind::Plant => [Family::Ceramic, Family::Plant],
        Kind::Lamp => [Family::Fabric, Family::Metal],
    };
    families.map(|family| {
        let bare = Material {
            name: format!("look_{}", family.name()),
            color: [0.66, 0.74, 0.55],
            roughness: 0.85,
            metallic: if family == Family::Metal { 0.9 } else { 0.0 },
            emission: 0.0,
            texture: None,
            family: None,
            transmission: 0.0,
        };
        match file.family.get(&family) {
            Some(palette) => drawn(palette, random, &bare),
            None => bare,
        }
    })
}
