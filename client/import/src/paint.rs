//! Materials of a pack: colors with a family, and images.

use std::collections::BTreeMap;

use wheelarm_pack::{Family, MaterialEntry, TextureEntry};

use crate::archive::Archive;
use crate::error::ImportError;
use crate::sh3d::{Cover, Rgb, Texture};
use crate::texture;

/// Families by parts of the names of materials.
const FAMILIES: [(Family, &[&str]); 7] = [
    (
        Family::Wood,
        &[
            "wood", "bois", "flblonde", "pine", "oak", "parquet", "chene", "holz",
        ],
    ),
    (
        Family::Metal,
        &[
            "silver", "chrome", "metal", "acier", "inox", "alu", "steel", "brass",
        ],
    ),
    (
        Family::Fabric,
        &[
            "iris", "tissu", "fabric", "cloth", "coussin", "cushion", "matelas", "drap", "stoff",
        ],
    ),
    (
        Family::Plant,
        &["leaf", "leaves", "feuille", "blatt", "yellow_green"],
    ),
    (
        Family::Ceramic,
        &["ceramic", "porcelain", "porzellan", "email"],
    ),
    (
        Family::Stone,
        &["marble", "stone", "granit", "marbre", "stein"],
    ),
    (Family::Plastic, &["plastic", "kunststoff"]),
];

/// The view through a window.
const PANE: &str = "pane";
/// Glass of furniture.
const GLASS: &str = "glass_pale";
/// A mirror.
const MIRROR: &str = "mirror_silver";

/// The materials that a pack uses so far.
#[derive(Default)]
pub struct Paints {
    /// Materials by name.
    pub materials: BTreeMap<String, MaterialEntry>,
    /// PNG files by name.
    pub textures: BTreeMap<String, Vec<u8>>,
    /// Name and shown height by path and number of repetitions; `None` for a damaged image.
    known: BTreeMap<(String, usize), Option<String>>,
    /// What could not be read.
    pub notes: Vec<String>,
}

impl Paints {
    /// A color.
    pub fn colour(&mut self, colour: Rgb, family: Option<Family>, roughness: f64) -> String {
        let word = family.map_or("plain", Family::name);
        let hex = hex(colour);
        let rough = (roughness * 20.0).round() / 20.0;
        let name = format!("{word}_{hex}_{:.0}", rough * 100.0);
        let metallic = if family == Some(Family::Metal) {
            0.6
        } else {
            0.0
        };
        self.materials.entry(name.clone()).or_insert(MaterialEntry {
            color: format!("#{hex}"),
            roughness: rough,
            metallic,
            emission: 0.0,
            texture: None,
            family,
            transmission: 0.0,
        });
        name
    }

    /// A color with a pattern of the assets.
    pub fn patterned(
        &mut self,
        colour: Rgb,
        family: Family,
        roughness: f64,
        pattern: &str,
        metres: f64,
    ) -> String {
        let name = format!("{}_{}_{pattern}", family.name(), hex(colour));
        self.materials.entry(name.clone()).or_insert(MaterialEntry {
            color: format!("#{}", hex(colour)),
            roughness,
            metallic: 0.0,
            emission: 0.0,
            texture: Some(TextureEntry {
                pattern: pattern.to_owned(),
                metres,
            }),
            family: Some(family),
            transmission: 0.0,
        });
        name
    }

    /// A light shade of this color.
    pub fn shade(&mut self, colour: Rgb) -> String {
        let name = format!("lamp_{}", hex(colour));
        self.materials.entry(name.clone()).or_insert(MaterialEntry {
            color: format!("#{}", hex(colour)),
            roughness: 0.9,
            metallic: 0.0,
            emission: 0.35,
            texture: None,
            family: Some(Family::Lamp),
            transmission: 0.0,
        });
        name
    }

    /// The pane of a window, bright like the sky behind it.
    pub fn pane(&mut self) -> String {
        self.special(PANE, "#cfe3f5", 1.0, 0.0, 1.0, Some(Family::Outdoors), 0.0)
    }

    /// Glass of furniture.
    pub fn glass(&mut self) -> String {
        self.special(GLASS, "#c9dbd8", 0.08, 0.0, 0.0, None, 0.9)
    }

    /// A mirror.
    pub fn mirror(&mut self) -> String {
        self.special(MIRROR, "#c8ced2", 0.05, 1.0, 0.0, None, 0.0)
    }

    #[expect(clippy::too_many_arguments, reason = "the values of one material")]
    fn special(
        &mut self,
        name: &str,
        color: &str,
        roughness: f64,
        metallic: f64,
        emission: f64,
        family: Option<Family>,
        transmission: f64,
    ) -> String {
        self.materials
            .entry(name.to_owned())
            .or_insert(MaterialEntry {
                color: color.to_owned(),
                roughness,
                metallic,
                emission,
                texture: None,
                family,
                transmission,
            });
        name.to_owned()
    }

    /// An image that repeats, or the color when it cannot be read.
    ///
    /// # Errors
    /// When the archive is damaged.
    pub fn cover(
        &mut self,
        archive: &mut Archive,
        cover: &Cover,
        default: Rgb,
        family: Family,
        roughness: f64,
    ) -> Result<String, ImportError> {
        let roughness = (roughness - 0.5 * cover.shininess).max(0.1);
        let Some(texture) = &cover.texture else {
            return Ok(self.colour(cover.colour.unwrap_or(default), Some(family), roughness));
        };
        let image = self.image(archive, texture, Some(family), roughness, None)?;
        Ok(match image {
            Some(name) => name,
            None => self.colour(cover.colour.unwrap_or(default), Some(family), roughness),
        })
    }

    /// The material of an image; `None` when it cannot be read. With `metres` the texture
    /// coordinates of the mesh count, otherwise the size of the texture.
    ///
    /// # Errors
    /// When the archive is damaged.
    pub fn image(
        &mut self,
        archive: &mut Archive,
        texture: &Texture,
        family: Option<Family>,
        roughness: f64,
        metres: Option<f64>,
    ) -> Result<Option<String>, ImportError> {
        // A square shows as many repetitions from top to bottom as come next to the ratio.
        let ratio = texture.width.max(0.1) / texture.height.max(0.1);
        let times = match metres {
            Some(_) => 1,
            None => (ratio.round() as usize).clamp(1, 16),
        };
        let key = (texture.image.clone(), times);
        let pattern = match self.known.get(&key) {
            Some(known) => known.clone(),
            None => {
                let read = self.read(archive, &texture.image, times)?;
                self.known.insert(key, read.clone());
                read
            }
        };
        let Some(pattern) = pattern else {
            return Ok(None);
        };
        let metres = metres.unwrap_or(texture.width.max(1.0) * crate::fit::METRES);
        let word = family.map_or("plain", Family::name);
        let name = format!("{word}_{pattern}_{:.0}", metres * 1000.0);
        self.materials.entry(name.clone()).or_insert(MaterialEntry {
            color: "#ffffff".into(),
            roughness,
            metallic: 0.0,
            emission: 0.0,
            texture: Some(TextureEntry { pattern, metres }),
            family,
            transmission: 0.0,
        });
        Ok(Some(name))
    }

    /// Reads an image and gives it a name by its content.
    fn read(
        &mut self,
        archive: &mut Archive,
        path: &str,
        times: usize,
    ) -> Result<Option<String>, ImportError> {
        let Some(bytes) = archive.read(path)? else {
            self.notes.push(format!(
                "image {path} is missing; its color is used. Open and save the home with Sweet Home 3D"
            ));
            return Ok(None);
        };
        let square = texture::decode(&bytes).and_then(|image| {
            texture::square_png(&image, times).ok_or("it cannot be encoded".into())
        });
        match square {
            Ok(png) => {
                let name = format!("image_{}", &blake3::hash(&png).to_hex()[..12]);
                self.textures.insert(name.clone(), png);
                Ok(Some(name))
            }
            Err(reason) => {
                self.notes
                    .push(format!("image {path} is not used: {reason}"));
                Ok(None)
            }
        }
    }
}

/// The family of a material of a model by its name.
#[must_use]
pub fn family_of(name: &str) -> Option<Family> {
    let name = name.to_lowercase();
    let found = FAMILIES
        .iter()
        .find(|(_, words)| words.iter().any(|word| name.contains(word)));
    found.map(|(family, _)| *family)
}

fn hex(colour: Rgb) -> String {
    let [red, green, blue] = colour;
    format!("{red:02x}{green:02x}{blue:02x}")
}
