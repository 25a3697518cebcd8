//! Authors and licenses.

use std::collections::{BTreeMap, BTreeSet};

use wheelarm_pack::{CommercialUse, FORMAT, Manifest, SourceEntry, UNKNOWN};

use crate::build::{Options, Summary};
use crate::sh3d::Home;
use crate::words;

/// The license of the home, as an identifier or `unknown`.
pub(super) fn license(home: &Home, options: &Options, summary: &mut Summary) -> String {
    let stated = home.license.as_deref();
    if let Some(given) = &options.license {
        if CommercialUse::of(given) == CommercialUse::Unknown {
            summary.notes.push(format!(
                "license {given:?} is not a known SPDX identifier; write for example --license CC-BY-4.0, or plans with pack_license = \"commercial\" refuse the pack"
            ));
        }
        return given.clone();
    }
    match stated.and_then(words::spdx) {
        Some(known) => known.to_owned(),
        None => {
            let what = stated.map_or("not stated".into(), |text| format!("{text:?}"));
            summary.notes.push(format!(
                "license of the home is {what}; give --license or the pack is refused by plans with pack_license = \"commercial\""
            ));
            UNKNOWN.to_owned()
        }
    }
}

pub(super) fn origin(file: &str, home: &Home) -> String {
    let author = home.author.as_deref().unwrap_or("author not stated");
    format!("Sweet Home 3D: {file}, {author}")
}

pub(super) fn manifest(
    options: &Options,
    home: &Home,
    origin: &str,
    license: &str,
    sources: &BTreeMap<String, (String, Option<String>)>,
    summary: &mut Summary,
) -> Manifest {
    let mut all = vec![SourceEntry {
        of: "home".into(),
        author: home.author.clone().unwrap_or_default(),
        license: license.to_owned(),
        origin: origin.to_owned(),
    }];
    let mut unknown: BTreeSet<&str> = BTreeSet::new();
    for (kind, (creator, stated)) in sources {
        let own = stated
            .as_deref()
            .map(|text| words::spdx(text).unwrap_or(UNKNOWN));
        // Models in a home with a license are part of it, unless they state their own.
        let license = own.unwrap_or(license);
        if license == UNKNOWN {
            unknown.insert(kind);
        }
        all.push(SourceEntry {
            of: kind.clone(),
            author: creator.clone(),
            license: license.to_owned(),
            origin: "model in the home".into(),
        });
    }
    // Without a license of the home, its own note says the same of all pieces.
    let stated = license != UNKNOWN;
    if stated && !unknown.is_empty() {
        let some: Vec<&str> = unknown.iter().copied().take(5).collect();
        summary.notes.push(format!(
            "license of {} is not known; plans with pack_license = \"commercial\" refuse the pack: leave the pieces out (--without), or correct `license` of these sources in pack.toml",
            some.join(", ")
        ));
    }
    Manifest {
        format: FORMAT,
        name: options.name.clone(),
        version: "1".into(),
        held_out: false,
        hidden: false,
        source: all,
    }
}
