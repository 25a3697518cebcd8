//! Authors and licenses of the world packs of recordings, for data cards and exports.

use std::fmt::Write;

use serde_json::{Value, json};
use wheelarm_pack::{Pack, SourceEntry, UNKNOWN, credit_lines};
use wheelarm_proto::v1;

use crate::read::{Episode, ReadError};

/// Author and license of every part of a world pack.
#[derive(Clone, Debug, PartialEq)]
pub struct PackCredits {
    /// Name, version and digests.
    pub pack: v1::PackRef,
    /// Its parts; one of unknown license when the pack cannot be read.
    pub parts: Vec<SourceEntry>,
}

impl PackCredits {
    /// Those of all packs of a recording; none for a scene of the assets.
    ///
    /// # Errors
    /// When the packs of the file cannot be read.
    pub fn of_episode(episode: &Episode) -> Result<Vec<Self>, ReadError> {
        let of_pack = |file: v1::PackFile| {
            let parts = match Pack::from_zip(&file.zip) {
                Ok(pack) => pack.credits(),
                Err(problem) => vec![SourceEntry {
                    of: "pack".into(),
                    author: String::new(),
                    license: UNKNOWN.into(),
                    origin: format!("the pack cannot be read: {problem}"),
                }],
            };
            Self {
                pack: file.pack.unwrap_or_default(),
                parts,
            }
        };
        Ok(episode.packs()?.into_iter().map(of_pack).collect())
    }

    /// As JSON: name, version, digests, and the parts with author, license and origin.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({
            "name": self.pack.name,
            "version": self.pack.version,
            "physics_digest": self.pack.physics_digest,
            "rendering_digest": self.pack.rendering_digest,
            "parts": self.parts,
        })
    }
}

/// A section of a data card; empty without packs.
#[must_use]
pub fn card_section(all: &[PackCredits]) -> String {
    if all.is_empty() {
        return String::new();
    }
    let mut text =
        "## World packs\n\nHomes, furniture and objects of these packs have authors and \
                    licenses of their own. Name the authors when you publish the data.\n\n"
            .to_owned();
    for one in all {
        // Writing into a string cannot fail.
        let _ = writeln!(text, "### {} {}\n", one.pack.name, one.pack.version);
        for line in credit_lines(&one.parts) {
            let _ = writeln!(text, "- {line}");
        }
        text.push('\n');
    }
    text
}
