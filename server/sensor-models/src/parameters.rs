//! Parses a parameter file: tables of parameters, each `{ value, unit, source }`. A
//! parameter without a source is rejected: it may be "guess".

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::error::{BadParameter, Bounds};

/// Smallest length of a source: that of "guess".
const SOURCE: usize = 5;

/// A parameter file that is being parsed.
pub(crate) struct Reader<'a> {
    place: Place<'a>,
    tables: DeTable<'a>,
}

/// One table of the file.
pub(crate) struct Section<'a> {
    place: Place<'a>,
    name: String,
    at: Range<usize>,
    entries: DeTable<'a>,
}

#[derive(Clone, Copy)]
struct Place<'a> {
    file: &'a str,
    text: &'a str,
}

impl Place<'_> {
    fn bad(&self, key: &str, at: &Range<usize>, found: String, allowed: &str) -> BadParameter {
        let before = self.text.bytes().take(at.start);
        BadParameter {
            file: self.file.to_owned(),
            line: before.filter(|b| *b == b'\n').count() + 1,
            key: key.to_owned(),
            found,
            allowed: allowed.to_owned(),
        }
    }
}

impl<'a> Reader<'a> {
    /// Parses a file; `file` is its path below the assets folder.
    pub fn new(file: &'a str, text: &'a str) -> Result<Self, BadParameter> {
        let place = Place { file, text };
        let mut tables = DeTable::parse(text)
            .map_err(|e| {
                let at = e.span().unwrap_or(0..0);
                let found = format!("invalid TOML: {}", e.message());
                place.bad("(file)", &at, found, "TOML")
            })?
            .into_inner();
        for key in ["origin", "license"] {
            let entry = tables.remove(key);
            let at = entry.as_ref().map_or(0..0, Spanned::span);
            let entry = entry.as_ref().and_then(|v| v.as_ref().as_str());
            if entry.unwrap_or_default().trim().is_empty() {
                let allowed = "the origin of the parameters, and their licence";
                return Err(place.bad(key, &at, "absent or empty".to_owned(), allowed));
            }
        }
        Ok(Self { place, tables })
    }

    /// Takes a table, if the file has it.
    pub fn section(&mut self, name: &str) -> Result<Option<Section<'a>>, BadParameter> {
        let Some(value) = self.tables.remove(name) else {
            return Ok(None);
        };
        let at = value.span();
        match value.into_inner() {
            DeValue::Table(entries) => Ok(Some(Section {
                place: self.place,
                name: name.to_owned(),
                at,
                entries,
            })),
            other => {
                let found = other.type_str().to_owned();
                Err(self.place.bad(name, &at, found, "a table of parameters"))
            }
        }
    }

    /// Rejects unused tables.
    pub fn end(self, known: &str) -> Result<(), BadParameter> {
        match self.tables.keys().next() {
            None => Ok(()),
            Some(key) => {
                let found = "a key that no sensor model has".to_owned();
                Err(self.place.bad(key.as_ref(), &key.span(), found, known))
            }
        }
    }
}

impl<'a> Section<'a> {
    fn bad(&self, key: &str, at: &Range<usize>, found: String, allowed: &str) -> BadParameter {
        let key = format!("{}.{key}", self.name);
        self.place.bad(&key, at, found, allowed)
    }

    /// Names of the parameters that are not used yet.
    pub fn keys(&self) -> Vec<String> {
        let keys = self.entries.keys();
        keys.map(|key| key.as_ref().to_string()).collect()
    }

    /// The value of a parameter with the unit `unit`, and its place.
    fn take(&mut self, key: &str, unit: &str) -> Result<(DeValue<'a>, Range<usize>), BadParameter> {
        const FORM: &str = "{ value = …, unit = \"…\", source = \"…\" }";
        let Some(entry) = self.entries.remove(key) else {
            let allowed = format!("{key} = {FORM}, in {unit:?}");
            return Err(self.bad(key, &self.at, "absent".to_owned(), &allowed));
        };
        let at = entry.span();
        let mut entry = match entry.into_inner() {
            DeValue::Table(entry) => entry,
            other => {
                let found = format!("a bare {}", other.type_str());
                return Err(self.bad(key, &at, found, FORM));
            }
        };
        let text = |value: Option<Spanned<DeValue<'a>>>| {
            let value = value.map(Spanned::into_inner);
            value.and_then(|v| v.as_str().map(str::to_owned))
        };
        let (value, source) = (entry.remove("value"), text(entry.remove("source")));
        let given_unit = text(entry.remove("unit"));
        if let Some(other) = entry.keys().next() {
            let found = format!("with a key `{}`", other.as_ref());
            return Err(self.bad(key, &other.span(), found, FORM));
        }
        let source = source.unwrap_or_default();
        if source.trim().len() < SOURCE {
            let found = format!("with the source {source:?}");
            let allowed = "a source, or \"guess\" and why";
            return Err(self.bad(key, &at, found, allowed));
        }
        if given_unit.as_deref() != Some(unit) {
            let found = format!("in {:?}", given_unit.unwrap_or_default());
            return Err(self.bad(key, &at, found, &format!("in {unit:?}")));
        }
        match value {
            Some(value) => {
                let at = value.span();
                Ok((value.into_inner(), at))
            }
            None => Err(self.bad(key, &at, "without a value".to_owned(), FORM)),
        }
    }

    /// A number within bounds.
    pub fn number(&mut self, key: &str, unit: &str, bounds: Bounds) -> Result<f64, BadParameter> {
        let (value, at) = self.take(key, unit)?;
        within(&value, bounds)
            .ok_or_else(|| self.bad(key, &at, words(&value), &format!("{bounds} ({unit})")))
    }

    /// `N` numbers within bounds.
    pub fn numbers<const N: usize>(
        &mut self,
        key: &str,
        unit: &str,
        bounds: Bounds,
    ) -> Result<[f64; N], BadParameter> {
        let (value, at) = self.take(key, unit)?;
        let all = value.as_array().map(|list| {
            let each = list.iter().filter_map(|v| within(v.as_ref(), bounds));
            let taken: Vec<f64> = each.collect();
            if taken.len() == list.len() {
                taken
            } else {
                Vec::new()
            }
        });
        let all = all.and_then(|all| <[f64; N]>::try_from(all.as_slice()).ok());
        let allowed = format!("a list of {N} numbers, each {bounds} ({unit})");
        all.ok_or_else(|| self.bad(key, &at, words(&value), &allowed))
    }

    /// Rejects unused parameters.
    pub fn end(self) -> Result<(), BadParameter> {
        match self.entries.keys().next() {
            None => Ok(()),
            Some(key) => Err(self.bad(
                key.as_ref(),
                &key.span(),
                "a parameter that this model does not have".to_owned(),
                "none of this name: correct it, or leave it out",
            )),
        }
    }
}

fn within(value: &DeValue<'_>, bounds: Bounds) -> Option<f64> {
    let number = match value {
        DeValue::Integer(v) => v.to_string().parse().ok(),
        DeValue::Float(v) => v.to_string().parse().ok(),
        _ => None,
    };
    number.filter(|v: &f64| (bounds.0..=bounds.1).contains(v))
}

fn words(value: &DeValue<'_>) -> String {
    match value {
        DeValue::Integer(v) => v.to_string(),
        DeValue::Float(v) => v.to_string(),
        DeValue::Array(all) => {
            let all: Vec<_> = all.iter().map(|v| words(v.as_ref())).collect();
            format!("[{}]", all.join(", "))
        }
        other => format!("a {}", other.type_str()),
    }
}
