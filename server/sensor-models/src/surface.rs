//! Response of a surface to an infrared stereo camera: a class per material, and per
//! instance of a scene the class with the largest visible area.

use std::collections::BTreeMap;

use crate::error::{BadParameter, Bounds};
use crate::parameters::Reader;

/// Classes of surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Surface {
    /// Scatters light: most surfaces.
    #[default]
    Matte,
    /// Transmits light.
    Glass,
    /// Reflects its environment.
    Mirror,
    /// Curved and shiny metal.
    Chrome,
    /// Absorbs light.
    Black,
}

impl Surface {
    /// Every class.
    pub const ALL: [Self; 5] = [
        Self::Matte,
        Self::Glass,
        Self::Mirror,
        Self::Chrome,
        Self::Black,
    ];

    /// Its name in parameter files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Matte => "matte",
            Self::Glass => "glass",
            Self::Mirror => "mirror",
            Self::Chrome => "chrome",
            Self::Black => "black",
        }
    }
}

/// Path of the table of materials, below the assets folder.
pub const FILE: &str = "sensors/surfaces.toml";

/// The table of materials: the class of each that is not matte.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Surfaces(BTreeMap<String, Surface>);

impl Surfaces {
    /// Parses `sensors/surfaces.toml`: tables `glass`, `mirror`, `chrome` and `black`,
    /// with materials and their share of the class, 0 or 1.
    ///
    /// # Errors
    /// [`BadParameter`] with file, line and key.
    pub fn read(text: &str) -> Result<Self, BadParameter> {
        let mut reader = Reader::new(FILE, text)?;
        let mut all = BTreeMap::new();
        for class in &Surface::ALL[1..] {
            let Some(mut section) = reader.section(class.name())? else {
                continue;
            };
            for name in section.keys() {
                if section.number(&name, "1", Bounds(0.0, 1.0))? > 0.0 {
                    all.insert(name, *class);
                }
            }
            section.end()?;
        }
        reader.end("a table glass, mirror, chrome or black")?;
        Ok(Self(all))
    }

    /// The class of a material.
    #[must_use]
    pub fn class_of(&self, material: &str) -> Surface {
        self.0.get(material).copied().unwrap_or_default()
    }

    /// Materials in the table.
    pub fn materials(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }

    /// The class of an instance, given its materials and their areas: that of the
    /// largest area.
    #[must_use]
    pub fn of_instance<'a>(&self, shown: impl IntoIterator<Item = (&'a str, f64)>) -> Surface {
        let mut areas = [0.0; Surface::ALL.len()];
        for (material, area) in shown {
            areas[self.class_of(material) as usize] += area;
        }
        let mut best = Surface::Matte;
        for class in Surface::ALL {
            if areas[class as usize] > areas[best as usize] {
                best = class;
            }
        }
        best
    }
}
