//! Queries of tasks without an area for places of a home, by room and kind of furniture, and
//! the error that says which places a home has instead.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::scene::ReachedPlace;

/// Properties of a place that must all match.
#[derive(Clone, Debug, Default, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(super) struct PlaceQuery {
    /// Furniture.
    pub name: Option<String>,
    /// Kind of furniture: `table` is a coffee table too.
    pub kind: Option<String>,
    /// Kind of room, or its name.
    pub room: Option<String>,
}

impl PlaceQuery {
    /// Whether a place matches.
    pub(super) fn fits(&self, place: &ReachedPlace) -> bool {
        self.fits_kind(place)
            && self.fits_room(place)
            && is(&self.name, |name| place.furniture == name)
    }

    fn fits_kind(&self, place: &ReachedPlace) -> bool {
        let kind = place.kind_words();
        is(&self.kind, |wanted| {
            let wanted = plain(wanted);
            kind == wanted || kind.ends_with(&format!(" {wanted}"))
        })
    }

    fn fits_room(&self, place: &ReachedPlace) -> bool {
        let room = plain(&place.room_words());
        is(&self.room, |wanted| room == plain(wanted))
    }

    /// What a home has instead: the places of this kind by room, and those of this room by
    /// kind.
    pub(super) fn alternatives(&self, places: &[ReachedPlace]) -> String {
        if places.is_empty() {
            return "it lists no place that the robot reaches; import the home again".to_owned();
        }
        let rooms = |place: &ReachedPlace| match place.room.is_empty() {
            true => "outside of rooms".to_owned(),
            false => place.room_words(),
        };
        let mut lists = Vec::new();
        if let Some(kind) = &self.kind {
            let of_kind = places.iter().filter(|place| self.fits_kind(place));
            lists.push(format!("{}: {}", plural(kind), counted(of_kind.map(rooms))));
        }
        if let Some(room) = &self.room {
            let of_room = places.iter().filter(|place| self.fits_room(place));
            let kinds = of_room.map(ReachedPlace::kind_words);
            lists.push(format!("{}: {}", plural(room), counted(kinds)));
        }
        if lists.is_empty() || self.name.is_some() {
            let names = places.iter().map(|place| place.furniture.clone());
            lists.push(format!("places: {}", counted(names)));
        }
        lists.join("; ")
    }
}

impl std::fmt::Display for PlaceQuery {
    /// For example `table in a kitchen`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match (&self.name, &self.kind) {
            (Some(name), _) => write!(f, "{name}")?,
            (None, Some(kind)) => f.write_str(&plain(kind))?,
            (None, None) => f.write_str("place")?,
        }
        match &self.room {
            Some(room) => write!(f, " in a {}", plain(room)),
            None => Ok(()),
        }
    }
}

fn is(wanted: &Option<String>, fits: impl FnOnce(&str) -> bool) -> bool {
    wanted.as_deref().is_none_or(fits)
}

/// Lower case, with blanks between words.
pub(super) fn plain(text: &str) -> String {
    text.to_lowercase().replace(['_', '-'], " ")
}

/// The plural of a kind of furniture or room.
fn plural(kind: &str) -> String {
    let kind = plain(kind);
    match kind.strip_suffix('f') {
        Some(shel) => format!("{shel}ves"),
        None => format!("{kind}s"),
    }
}

/// For example `hall, living room (2)`, or `none`.
pub(super) fn counted(words: impl Iterator<Item = String>) -> String {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for word in words {
        *counts.entry(word).or_default() += 1;
    }
    let entries = counts.into_iter().map(|(word, count)| match count {
        1 => word,
        count => format!("{word} ({count})"),
    });
    let entries: Vec<String> = entries.collect();
    match entries.is_empty() {
        true => "none".to_owned(),
        false => entries.join(", "),
    }
}
