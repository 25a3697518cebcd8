//! Categories of objects: `assets/categories.toml`.

use std::path::Path;

use serde::Deserialize;

use super::error::ObjectError;

/// File below the assets folder.
const FILE: &str = "categories.toml";

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct CategoryFile {
    #[serde(rename = "origin")]
    _origin: String,
    #[serde(rename = "license")]
    _license: String,
    category: Vec<Category>,
}

/// A category: usual values, and what a mass is computed from.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Category {
    /// Name.
    pub name: String,
    /// Nouns.
    pub words: Vec<String>,
    /// Usual range of the largest horizontal extent, metres.
    pub width: [f64; 2],
    /// Usual range of the height, metres.
    pub height: [f64; 2],
    /// Usual range, kg.
    pub mass: [f64; 2],
    /// Of the material, kg/m³.
    pub density: f64,
    /// Thickness of the material, metres; solid when absent.
    pub wall: Option<f64>,
    /// Both sides of the wall are part of a drawn mesh.
    #[serde(default)]
    pub open: bool,
    /// Density of what fills it, kg/m³.
    #[serde(default)]
    pub contents: f64,
    /// Coulomb coefficient.
    pub friction: f64,
    /// Kinds of rooms; every room when absent.
    pub rooms: Option<Vec<String>>,
}

/// All categories.
#[derive(Clone, Debug, PartialEq)]
pub struct Categories(Vec<Category>);

impl Categories {
    /// Reads those of the assets.
    ///
    /// # Errors
    /// When the file is missing or invalid.
    pub fn read(assets: &Path) -> Result<Self, ObjectError> {
        let path = assets.join(FILE);
        let wrong = |reason: String| ObjectError::Asset {
            path: path.display().to_string(),
            reason,
        };
        let text = std::fs::read_to_string(&path).map_err(|error| wrong(error.to_string()))?;
        Self::parse(&text).map_err(wrong)
    }

    /// Parses the text of the file.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let file: CategoryFile = toml::from_str(text).map_err(|error| error.to_string())?;
        for category in &file.category {
            let ranges = [category.width, category.height, category.mass];
            let rises = ranges.iter().all(|[low, high]| 0.0 < *low && low < high);
            let wall = category.wall.unwrap_or(0.001);
            let is_sane = rises
                && !category.words.is_empty()
                && category.density > 0.0
                && (0.0..=2.0).contains(&category.friction)
                && (0.0..0.1).contains(&wall)
                && category.contents >= 0.0;
            if !is_sane {
                return Err(format!(
                    "category {:?} has an invalid value, expected words and rising ranges",
                    category.name
                ));
            }
        }
        Ok(Self(file.category))
    }

    /// Its categories.
    #[must_use]
    pub fn all(&self) -> &[Category] {
        &self.0
    }

    /// The category of this name.
    ///
    /// # Errors
    /// When there is none, with the names that exist.
    pub fn named(&self, name: &str) -> Result<&Category, ObjectError> {
        let found = self.0.iter().find(|category| category.name == name);
        found.ok_or_else(|| {
            let names: Vec<&str> = self.0.iter().map(|c| c.name.as_str()).collect();
            ObjectError::Category {
                name: name.to_owned(),
                available: names.join(", "),
            }
        })
    }
}
