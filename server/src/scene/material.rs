//! Materials: every file in `assets/materials`, by name.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use wheelarm_pack::Pack;

use super::error::{Place, SceneError};
use super::file::{MaterialEntry, MaterialFile};
use super::folder;
use crate::geometry::{Material, PackedFile, Texture, texture};

/// Every material below `assets/materials`, and those of a pack, which replace materials of
/// equal names.
pub(super) fn library(
    assets: &Path,
    pack: Option<&Arc<Pack>>,
) -> Result<BTreeMap<String, Material>, SceneError> {
    let mut all = of_assets(assets)?;
    let Some(pack) = pack else {
        return Ok(all);
    };
    let textures = texture::names(assets);
    for name in pack.names("materials", "toml") {
        let path = format!("materials/{name}.toml");
        let file: MaterialFile = folder::parse_packed(pack, &path)?;
        let place = Place::file(&pack.asset_path(&path));
        for (name, entry) in file.material {
            let place = place.key("material").key(&name);
            let own = |pattern: &str| PackedFile::find(pack, &format!("textures/{pattern}.png"));
            let file = entry.texture.as_ref().and_then(|t| own(&t.pattern));
            let mut known = textures.clone();
            known.extend(pack.names("textures", "png").map(str::to_owned));
            let mut material = material(&place, &name, &entry, &known)?;
            if let (Some(texture), Some(file)) = (&mut material.texture, file) {
                let path = file.asset_path();
                texture.pattern = path.trim_end_matches(".png").to_owned();
                texture.file = Some(file);
            }
            all.insert(name, material);
        }
    }
    Ok(all)
}

/// Every material below `assets/materials`, in the order of their names.
fn of_assets(assets: &Path) -> Result<BTreeMap<String, Material>, SceneError> {
    let mut all: BTreeMap<String, (String, Material)> = BTreeMap::new();
    let textures = texture::names(assets);
    for name in folder::names(assets, "materials")? {
        let path = format!("materials/{name}.toml");
        let file: MaterialFile = folder::parse(assets, &path)?;
        let place = Place::file(&path);
        folder::provenance(&place, &file.origin, &file.license)?;
        for (name, entry) in file.material {
            let place = place.key("material").key(&name);
            let material = material(&place, &name, &entry, &textures)?;
            if let Some((other, _)) = all.insert(name.clone(), (path.clone(), material)) {
                return Err(place.wrong(
                    format!("defined again in {path}"),
                    format!("only the one of {other}"),
                    "rename or remove one of them",
                ));
            }
        }
    }
    Ok(all
        .into_iter()
        .map(|(name, (_, material))| (name, material))
        .collect())
}

fn material(
    place: &Place,
    name: &str,
    entry: &MaterialEntry,
    textures: &[String],
) -> Result<Material, SceneError> {
    let fraction = |key: &str, value: f64, high: f64| {
        place
            .key(key)
            .within(value, 0.0, high, "", "it is a fraction")
            .map(|v| v as f32)
    };
    let image = match &entry.texture {
        None => None,
        Some(entry) => {
            let place = place.key("texture");
            if !textures.contains(&entry.pattern) {
                return Err(place.key("pattern").wrong(
                    format!("{:?}", entry.pattern),
                    format!("one of {}", textures.join(", ")),
                    "put the image into assets/textures, or leave the texture out",
                ));
            }
            Some(Texture {
                pattern: entry.pattern.clone(),
                metres: place.key("metres").length(entry.metres)? as f32,
                file: None,
            })
        }
    };
    Ok(Material {
        name: name.to_owned(),
        color: color(&place.key("color"), &entry.color)?,
        roughness: fraction("roughness", entry.roughness, 1.0)?,
        metallic: fraction("metallic", entry.metallic, 1.0)?,
        emission: fraction("emission", entry.emission, 4.0)?,
        texture: image,
        family: entry.family,
        transmission: fraction("transmission", entry.transmission, 1.0)?,
    })
}

fn color(place: &Place, text: &str) -> Result<[f32; 3], SceneError> {
    let wrong = || {
        place.wrong(
            format!("{text:?}"),
            "\"#rrggbb\" in sRGB",
            "write six hexadecimal digits, for example \"#c8a27a\"",
        )
    };
    let digits = text.strip_prefix('#').ok_or_else(wrong)?;
    if digits.len() != 6 {
        return Err(wrong());
    }
    let value = u32::from_str_radix(digits, 16).map_err(|_| wrong())?;
    Ok([16, 8, 0].map(|shift| ((value >> shift) & 0xff) as f32 / 255.0))
}
