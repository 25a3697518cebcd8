//! Values of attributes: numbers within bounds, colors, flags.

use super::Rgb;
use crate::error::ImportError;
use crate::xml::Element;

/// Largest coordinate or length, centimetres: 1 km.
const LARGEST: f64 = 100_000.0;
/// Largest angle, radians; cameras and pieces turn through several circles.
const LARGEST_ANGLE: f64 = 1_000.0;

/// Reads attributes of one element; errors name the element.
pub(super) struct Reader<'a> {
    pub file: &'a str,
    pub element: &'a Element,
}

impl Reader<'_> {
    fn wrong(&self, attribute: &str, value: &str, expected: impl Into<String>) -> ImportError {
        let name = self.element.attribute("name").unwrap_or_default();
        let element = match name {
            "" => self.element.name.clone(),
            name => format!("{} {name:?}", self.element.name),
        };
        ImportError::Value {
            file: self.file.to_owned(),
            element,
            attribute: attribute.to_owned(),
            value: value.to_owned(),
            expected: expected.into(),
        }
    }

    fn bounded(&self, name: &str, low: f64, high: f64) -> Result<Option<f64>, ImportError> {
        let Some(text) = self.element.attribute(name) else {
            return Ok(None);
        };
        match text.trim().parse::<f64>() {
            Ok(value) if value >= low && value <= high => Ok(Some(value)),
            _ => Err(self.wrong(name, text, format!("a number from {low} to {high}"))),
        }
    }

    /// A coordinate.
    pub fn place(&self, name: &str) -> Result<f64, ImportError> {
        self.bounded(name, -LARGEST, LARGEST)?
            .ok_or_else(|| self.wrong(name, "", "a number; the attribute is missing"))
    }

    /// A coordinate with a default of 0.
    pub fn place_or_zero(&self, name: &str) -> Result<f64, ImportError> {
        Ok(self.bounded(name, -LARGEST, LARGEST)?.unwrap_or(0.0))
    }

    /// A length that may be absent.
    pub fn length(&self, name: &str) -> Result<Option<f64>, ImportError> {
        self.bounded(name, 0.0, LARGEST)
    }

    /// A length that must be present.
    pub fn size(&self, name: &str) -> Result<f64, ImportError> {
        self.length(name)?
            .ok_or_else(|| self.wrong(name, "", "a length; the attribute is missing"))
    }

    /// An angle, radians; 0 when absent.
    pub fn angle(&self, name: &str) -> Result<f64, ImportError> {
        let angle = self.bounded(name, -LARGEST_ANGLE, LARGEST_ANGLE)?;
        Ok(angle.unwrap_or(0.0))
    }

    /// A fraction that may be absent.
    pub fn fraction(&self, name: &str) -> Result<Option<f64>, ImportError> {
        self.bounded(name, 0.0, 1.0)
    }

    /// A number of the reader's own bounds.
    pub fn number(&self, name: &str) -> Result<Option<f64>, ImportError> {
        self.bounded(name, -LARGEST, LARGEST)
    }

    /// Nine numbers, a matrix row by row.
    pub fn matrix(&self, name: &str) -> Result<Option<[f64; 9]>, ImportError> {
        let Some(text) = self.element.attribute(name) else {
            return Ok(None);
        };
        let numbers = text.split_whitespace().map(str::parse::<f64>);
        let numbers: Option<Vec<f64>> = numbers
            .map(|number| number.ok().filter(|n| n.abs() <= 1.0e3))
            .collect();
        let matrix = numbers.and_then(|numbers| <[f64; 9]>::try_from(numbers).ok());
        match matrix {
            Some(matrix) => Ok(Some(matrix)),
            None => Err(self.wrong(name, text, "nine numbers of a rotation")),
        }
    }

    /// A color: six or eight hexadecimal digits, the first two of eight being opacity.
    pub fn colour(&self, name: &str) -> Result<Option<Rgb>, ImportError> {
        let Some(text) = self.element.attribute(name) else {
            return Ok(None);
        };
        let digits = text.trim_start_matches('#');
        let number = u32::from_str_radix(digits, 16)
            .ok()
            .filter(|_| digits.len() <= 8);
        match number {
            Some(number) => {
                let [_, red, green, blue] = number.to_be_bytes();
                Ok(Some([red, green, blue]))
            }
            None => Err(self.wrong(name, text, "a color of eight hexadecimal digits")),
        }
    }

    /// A flag with its default.
    pub fn flag(&self, name: &str, default: bool) -> bool {
        match self.element.attribute(name) {
            Some(text) => text == "true",
            None => default,
        }
    }

    /// A text; `None` when absent or empty.
    pub fn text(&self, name: &str) -> Option<String> {
        let text = self.element.attribute(name)?.trim();
        (!text.is_empty()).then(|| text.to_owned())
    }
}
