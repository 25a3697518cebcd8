//! Places of a scene: strips of surfaces that the robot reaches. Tasks without an area sample
//! from them.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::Path;
use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use wheelarm_pack::{Pack, StartRangesEntry};

use super::error::{Place, SceneError};
use super::file::PlaceEntry;
use super::folder::names;
use super::part::Reader;
use super::{Body, Scene, Surface, material, object};

/// Longest name of a place: two of them fit into a name of the contract.
pub(super) const LONGEST: usize = 28;
/// Space around the middle of an object, metres.
const AROUND: f64 = 0.08;
/// Largest number of places of a scene.
pub(super) const MOST: usize = 4096;

/// A strip of a surface that the robot reaches, with starts of the chair near it.
#[derive(Clone, Debug, PartialEq)]
pub struct ReachedPlace {
    /// Unique name: that of the furniture, and of the surface where there are several.
    pub name: String,
    /// Furniture that has the surface.
    pub furniture: String,
    /// Name of the surface.
    pub surface: String,
    /// Kind of the furniture, for example `kitchen_cabinet`; may be empty.
    pub kind: String,
    /// Kind of the room, or its name where the kind is unknown; empty outside of rooms.
    pub room: String,
    /// Range from the approach edge inwards, metres.
    pub inwards: [f64; 2],
    /// Range along the edge from its middle, metres.
    pub along: [f64; 2],
    /// Free height above the surface, metres.
    pub headroom: f64,
    /// The chair does not get there from the start of the home.
    pub apart: bool,
    /// Start of the chair: ranges of x and y, metres, and of the yaw, radians.
    pub start: [[f64; 2]; 3],
}

impl ReachedPlace {
    /// The kind of its furniture, or the name of the furniture where it has none.
    #[must_use]
    pub fn kind_name(&self) -> String {
        kind_name(&self.kind, &self.furniture)
    }

    /// The same in words.
    #[must_use]
    pub fn kind_words(&self) -> String {
        in_words(&self.kind_name())
    }

    /// The room in words; empty outside of rooms.
    #[must_use]
    pub fn room_words(&self) -> String {
        in_words(&self.room)
    }

    /// For example `the table in the kitchen`.
    #[must_use]
    pub fn words(&self) -> String {
        match self.room.is_empty() {
            true => format!("the {}", self.kind_words()),
            false => format!("the {} in the {}", self.kind_words(), self.room_words()),
        }
    }
}

/// The kind of furniture, or its name without its number where it has none.
pub(crate) fn kind_name(kind: &str, furniture: &str) -> String {
    match kind {
        "" | "furniture" => in_words(furniture).replace(' ', "_"),
        kind => kind.to_owned(),
    }
}

/// A name as words, without its number.
fn in_words(name: &str) -> String {
    let is_number = |word: &&str| word.bytes().all(|byte| byte.is_ascii_digit());
    let words: Vec<&str> = name
        .split(['_', '-', ' '])
        .filter(|w| !is_number(w))
        .collect();
    words.join(" ")
}

impl Scene {
    /// The place with this name.
    #[must_use]
    pub fn place_named(&self, name: &str) -> Option<&ReachedPlace> {
        self.places.iter().find(|place| place.name == name)
    }

    /// The place on a surface.
    #[must_use]
    pub fn place_on(&self, surface: &Surface) -> Option<&ReachedPlace> {
        let on = &self.furniture.get(surface.furniture)?.name;
        let mut places = self.places.iter();
        places.find(|place| place.furniture == *on && place.surface == surface.name)
    }

    /// The part of a surface that the robot reaches, or all of it where the scene lists no
    /// place on it: its middle, x inwards, and its half extents, metres.
    #[must_use]
    pub fn reached_part(&self, surface: &Surface) -> (Isometry3<f64>, Vector3<f64>) {
        let Some(place) = self.place_on(surface) else {
            let half = Vector3::new(surface.depth / 2.0, surface.width / 2.0, 0.0);
            return (surface.centre(), half);
        };
        let half = surface.width / 2.0;
        // Ranges are those of the middle of an object.
        let [near, far] = [place.inwards[0] - AROUND, place.inwards[1] + AROUND];
        let [right, left] = [place.along[0] - AROUND, place.along[1] + AROUND];
        let (near, far) = (near.max(0.0), far.min(surface.depth));
        let (right, left) = (right.max(-half), left.min(half));
        let middle = surface.standing((near + far) / 2.0, (right + left) / 2.0, 0.0);
        let half = Vector3::new((far - near) / 2.0, (left - right) / 2.0, 0.0);
        (middle, half)
    }

    /// Packs whose objects may be part of the stock: that of the scene, and the object packs.
    pub(crate) fn stocked_packs(&self) -> impl Iterator<Item = &Arc<Pack>> {
        self.pack.iter().chain(&self.object_packs)
    }

    /// Reads the places of the scene's file.
    pub(super) fn add_places(
        &mut self,
        file: &Place,
        entries: &[PlaceEntry],
    ) -> Result<(), SceneError> {
        if entries.len() > MOST {
            return Err(file.key("place").wrong(
                entries.len(),
                format!("at most {MOST} places"),
                "leave some out",
            ));
        }
        for entry in entries {
            let place = file.entry("place", &entry.on);
            let surface = self.surface(&place, &entry.on, Some(&entry.surface))?;
            let (depth, half) = (surface.depth, surface.width / 2.0);
            let category = &self.furniture[surface.furniture].category;
            let kind = entry.kind.as_ref().unwrap_or(category).clone();
            let several = entries.iter().filter(|other| other.on == entry.on).count() > 1;
            let read = ReachedPlace {
                name: self.free_name(&entry.on, several.then_some(&entry.surface)),
                furniture: entry.on.clone(),
                surface: entry.surface.clone(),
                kind,
                room: entry.room.clone().unwrap_or_default(),
                inwards: range(&place.key("inwards"), entry.inwards, [0.0, depth])?,
                along: range(&place.key("along"), entry.along, [-half, half])?,
                headroom: place.key("headroom").within(
                    entry.headroom,
                    0.0,
                    20.0,
                    "m",
                    "lengths are metres",
                )?,
                apart: entry.apart,
                start: start(&place, &entry.start)?,
            };
            self.places.push(read);
        }
        Ok(())
    }

    /// A name that no place has, short enough for names of the contract.
    fn free_name(&self, on: &str, surface: Option<&String>) -> String {
        let full = match surface {
            Some(surface) => format!("{on}-{surface}"),
            None => on.to_owned(),
        };
        let mut number = 1;
        loop {
            let ending = match number {
                1 if full.chars().count() <= LONGEST => String::new(),
                _ => format!("-{number}"),
            };
            let kept = full.chars().take(LONGEST - ending.len());
            let name = kept.collect::<String>() + &ending;
            if self.place_named(&name).is_none() {
                return name;
            }
            number += 1;
        }
    }

    /// Adds objects of the assets and of packs by their kinds, each optional and named like its
    /// kind. Objects that the scene has already stay.
    ///
    /// # Errors
    /// When a file is missing or a value is invalid.
    pub(crate) fn add_optional_objects<'a>(
        &mut self,
        assets: &Path,
        kinds: impl Iterator<Item = &'a str>,
    ) -> Result<(), SceneError> {
        let packs: Vec<Arc<Pack>> = self.stocked_packs().cloned().collect();
        let known = names(assets, "objects")?;
        let of_scene = material::library(assets, self.pack.as_ref())?;
        let mut libraries = BTreeMap::new();
        for kind in kinds {
            let is_taken =
                self.object_named(kind).is_some() || self.furniture_named(kind).is_some();
            if is_taken {
                continue;
            }
            let path = format!("objects/{kind}.toml");
            let is_of_assets = known.iter().any(|known| known == kind);
            // Only the pack of the scene replaces an object of the assets.
            let owner = packs.iter().position(|pack| {
                let is_own = self.pack.as_ref() == Some(pack);
                pack.file(&path).is_some() && (is_own || !is_of_assets)
            });
            let (pack, materials) = match owner {
                Some(index) => {
                    if let Entry::Vacant(vacant) = libraries.entry(index) {
                        vacant.insert(material::library(assets, Some(&packs[index]))?);
                    }
                    (Some(&packs[index]), &libraries[&index])
                }
                None if is_of_assets => (self.pack.as_ref(), &of_scene),
                None => continue,
            };
            let reader = Reader {
                assets,
                pack,
                materials,
            };
            let body = object::read(&reader, kind)?;
            self.objects.push(Body {
                optional: true,
                ..body
            });
            if owner.is_none() {
                self.files.push(path);
            }
        }
        self.files.sort();
        self.files.dedup();
        Ok(())
    }
}

/// Ranges of a start of the chair: x and y, metres, and the yaw, radians.
pub(super) fn start(place: &Place, entry: &StartRangesEntry) -> Result<[[f64; 2]; 3], SceneError> {
    let yaw = range(&place.key("start.yaw_deg"), entry.yaw_deg, [-360.0, 360.0])?;
    Ok([
        range(&place.key("start.x"), entry.x, [-50.0, 50.0])?,
        range(&place.key("start.y"), entry.y, [-50.0, 50.0])?,
        yaw.map(f64::to_radians),
    ])
}

/// A range of numbers within limits.
fn range(
    place: &Place,
    [min, max]: [f64; 2],
    [low, high]: [f64; 2],
) -> Result<[f64; 2], SceneError> {
    for value in [min, max] {
        place.within(value, low, high, "", "give [least, greatest] within these")?;
    }
    if min > max {
        return Err(place.wrong(
            format!("[{min}, {max}]"),
            "[least, greatest]",
            "swap the two",
        ));
    }
    Ok([min, max])
}
