//! Licenses of the parts of a pack, and whether they permit commercial use.
//!
//! A license is an SPDX expression such as `CC-BY-4.0` or `MIT OR GPL-2.0-only`. The list
//! of identifiers has what homes, models and textures use; every other text counts as
//! unknown.

use std::collections::BTreeMap;
use std::fmt;

use crate::pack::parse;
use crate::{MaterialFile, ObjectFile, Pack, SourceEntry, UNKNOWN};

/// Longest license text that is read, bytes; longer ones are unknown.
const MOST_BYTES: usize = 256;
/// Parts that an error names.
const NAMED: usize = 8;

/// Beginnings of identifiers, in lower case, whose licenses permit commercial use.
const PERMITTED: [&str; 22] = [
    "afl-",
    "agpl-",
    "apache-",
    "artistic-",
    "blueoak-",
    "bsd-",
    "bsl-1.0",
    "cc-by-",
    "cc-pddc",
    "cc0-",
    "cdla-",
    "epl-",
    "eupl-",
    "gpl-",
    "lal-",
    "lgpl-",
    "mpl-",
    "odbl-",
    "odc-by-",
    "ofl-",
    "pddl-",
    "python-",
];
/// Whole identifiers of the same kind.
const PERMITTED_WHOLE: [&str; 9] = [
    "0bsd",
    "isc",
    "libpng",
    "mit",
    "mit-0",
    "ncsa",
    "unlicense",
    "wtfpl",
    "zlib",
];

/// Whether a license permits commercial use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum CommercialUse {
    /// It forbids it.
    Forbidden,
    /// The license is unknown, or is not an SPDX expression.
    Unknown,
    /// It permits it.
    Permitted,
}

impl CommercialUse {
    /// Of a license text.
    #[must_use]
    pub fn of(license: &str) -> Self {
        if license.len() > MOST_BYTES {
            return Self::Unknown;
        }
        let spaced = license.replace('(', " ( ").replace(')', " ) ");
        let mut words = spaced.split_whitespace().peekable();
        match either(&mut words) {
            Some(found) if words.next().is_none() => found,
            _ => Self::Unknown,
        }
    }

    fn of_identifier(identifier: &str) -> Self {
        let id = identifier.trim_end_matches('+').to_ascii_lowercase();
        let is_noncommercial = id.contains("-nc-") || id.ends_with("-nc");
        if is_noncommercial || id.contains("noncommercial") {
            Self::Forbidden
        } else if PERMITTED_WHOLE.contains(&id.as_str())
            || PERMITTED.iter().any(|begin| id.starts_with(begin))
        {
            Self::Permitted
        } else {
            Self::Unknown
        }
    }
}

type Words<'a> = std::iter::Peekable<std::str::SplitWhitespace<'a>>;

fn is(word: Option<&&str>, wanted: &str) -> bool {
    word.is_some_and(|word| word.eq_ignore_ascii_case(wanted))
}

/// Alternatives joined by OR: the user may choose the best one.
fn either(words: &mut Words<'_>) -> Option<CommercialUse> {
    let mut found = all(words)?;
    while is(words.peek(), "or") {
        words.next();
        found = found.max(all(words)?);
    }
    Some(found)
}

/// Licenses joined by AND: all of them apply.
fn all(words: &mut Words<'_>) -> Option<CommercialUse> {
    let mut found = one(words)?;
    while is(words.peek(), "and") {
        words.next();
        found = found.min(one(words)?);
    }
    Some(found)
}

fn one(words: &mut Words<'_>) -> Option<CommercialUse> {
    let word = words.next()?;
    if word == "(" {
        let found = either(words)?;
        return (words.next()? == ")").then_some(found);
    }
    if [")", "or", "and", "with"]
        .iter()
        .any(|w| word.eq_ignore_ascii_case(w))
    {
        return None;
    }
    if is(words.peek(), "with") {
        // An exception only adds permissions.
        words.next();
        words.next()?;
    }
    Some(CommercialUse::of_identifier(word))
}

/// Parts of a pack that may not be used commercially, or whose license is unknown.
#[derive(Clone, Debug, PartialEq)]
pub struct NotCommercial {
    /// Name of the pack.
    pub pack: String,
    /// The parts.
    pub parts: Vec<SourceEntry>,
}

impl fmt::Display for NotCommercial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let named = self.parts.iter().take(NAMED);
        let named: Vec<String> = named.map(in_words).collect();
        write!(
            f,
            "pack {:?} has parts without a commercial license: {}",
            self.pack,
            named.join(", ")
        )?;
        if self.parts.len() > NAMED {
            write!(f, " and {} more", self.parts.len() - NAMED)?;
        }
        write!(
            f,
            "; remove or replace them, or state the SPDX identifier that their authors gave as \
             `license` in the pack (`home import --license` for a home without one)"
        )
    }
}

impl std::error::Error for NotCommercial {}

fn in_words(part: &SourceEntry) -> String {
    match part.license.as_str() {
        UNKNOWN => format!("{} (unknown)", part.of),
        license => format!("{} ({license})", part.of),
    }
}

impl Pack {
    /// Author and license of every part: the sources of `pack.toml`, and what it does not
    /// list. A kind without a source has author and license of the home.
    #[must_use]
    pub fn credits(&self) -> Vec<SourceEntry> {
        let mut all = self.manifest().source.clone();
        let listed = |all: &[SourceEntry], of: &str| all.iter().any(|source| source.of == of);
        let add = |all: &mut Vec<SourceEntry>, of: &str, license: &str, origin: &str| {
            let known = all.iter().any(|s| s.of == of && s.license == license);
            if !known {
                all.push(SourceEntry {
                    of: of.to_owned(),
                    author: String::new(),
                    license: license.to_owned(),
                    origin: origin.to_owned(),
                });
            }
        };
        if let Some(home) = self.home() {
            add(&mut all, "home", &home.license, &home.origin);
        }
        let of_home = all.iter().find(|source| source.of == "home").cloned();
        let kinds = self.kinds().keys();
        for kind in kinds.filter(|kind| !listed(&self.manifest().source, kind)) {
            let own = match &of_home {
                Some(home) => SourceEntry {
                    of: kind.clone(),
                    ..home.clone()
                },
                None => SourceEntry {
                    of: kind.clone(),
                    author: String::new(),
                    license: UNKNOWN.to_owned(),
                    origin: String::new(),
                },
            };
            all.push(own);
        }
        // Both files were read when the pack was checked.
        for name in self.names("objects", "toml") {
            if let Some(file) = self.table::<ObjectFile>(&format!("objects/{name}.toml")) {
                add(&mut all, name, &file.license, &file.origin);
            }
        }
        for name in self.names("materials", "toml") {
            let path = format!("materials/{name}.toml");
            if let Some(file) = self.table::<MaterialFile>(&path) {
                add(&mut all, &path, &file.license, &file.origin);
            }
        }
        all
    }

    /// Checks that every part permits commercial use.
    ///
    /// # Errors
    /// [`NotCommercial`] with the parts that do not.
    pub fn check_commercial(&self) -> Result<(), NotCommercial> {
        let mut parts = self.credits();
        parts.retain(|part| CommercialUse::of(&part.license) != CommercialUse::Permitted);
        match parts.is_empty() {
            true => Ok(()),
            false => Err(NotCommercial {
                pack: self.id().name.clone(),
                parts,
            }),
        }
    }

    fn table<T: serde::de::DeserializeOwned>(&self, path: &str) -> Option<T> {
        parse(path, self.file(path)?).ok()
    }
}

/// Credits in groups of equal author and license, as lines `LICENSE, by AUTHOR: PARTS`.
#[must_use]
pub fn credit_lines(credits: &[SourceEntry]) -> Vec<String> {
    let mut groups: BTreeMap<(&str, &str), Vec<&str>> = BTreeMap::new();
    for part in credits {
        let author = match part.author.as_str() {
            "" => "author not stated",
            author => author,
        };
        groups
            .entry((&part.license, author))
            .or_default()
            .push(&part.of);
    }
    let line = |((license, author), parts): ((&str, &str), Vec<&str>)| {
        let license = match license {
            UNKNOWN => "license unknown",
            license => license,
        };
        let author = match author {
            "author not stated" => author.to_owned(),
            author => format!("by {author}"),
        };
        format!("{license}, {author}: {}", parts.join(", "))
    };
    groups.into_iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn expressions_of_spdx_are_judged() {
        use CommercialUse::{Forbidden, Permitted, Unknown};
        for (license, wanted) in [
            ("CC0-1.0", Permitted),
            ("cc-by-3.0", Permitted),
            ("CC-BY-SA-4.0", Permitted),
            ("GPL-2.0-or-later", Permitted),
            ("GPL-2.0+", Permitted),
            ("MIT", Permitted),
            ("CC-BY-NC-4.0", Forbidden),
            ("CC-BY-NC-SA-3.0", Forbidden),
            ("PolyForm-Noncommercial-1.0.0", Forbidden),
            ("CC-BY-NC-4.0 OR MIT", Permitted),
            ("CC-BY-NC-4.0 AND MIT", Forbidden),
            ("MIT AND (CC-BY-4.0 OR LicenseRef-Shop)", Permitted),
            ("MIT AND LicenseRef-Shop", Unknown),
            ("GPL-3.0-only WITH Classpath-exception-2.0", Permitted),
            ("unknown", Unknown),
            ("", Unknown),
            ("MIT OR", Unknown),
            ("(MIT", Unknown),
            ("MIT)", Unknown),
            ("MIT Apache-2.0", Unknown),
            ("all rights reserved", Unknown),
            ("mitigated", Unknown),
        ] {
            assert_eq!(CommercialUse::of(license), wanted, "{license:?}");
        }
        assert_eq!(CommercialUse::of(&"(".repeat(1 << 20)), Unknown);
    }

    #[test]
    fn credits_are_grouped_by_license_and_author() {
        let part = |of: &str, author: &str, license: &str| SourceEntry {
            of: of.into(),
            author: author.into(),
            license: license.into(),
            origin: String::new(),
        };
        let credits = [
            part("sofa", "eTeks", "CC-BY-3.0"),
            part("lamp", "", UNKNOWN),
            part("chair", "eTeks", "CC-BY-3.0"),
        ];
        assert_eq!(
            credit_lines(&credits),
            [
                "CC-BY-3.0, by eTeks: sofa, chair",
                "license unknown, author not stated: lamp"
            ]
        );
    }
}
