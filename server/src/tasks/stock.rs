//! What may be on the places of a home: `assets/stocks.toml`, and the objects of packs with a
//! table `[stock]`.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use wheelarm_proto::settings::ObjectSplit;

use super::area::{PlaceSpec, Range, RestShares};
use crate::scene::{
    Body, Place, ReachedPlace, Scene, SceneError, names, parse, parse_packed, provenance,
};
use wheelarm_pack::{ObjectFile, Pack, StockEntry};

/// File below the assets folder.
pub(super) const FILE: &str = "stocks.toml";

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct StockFile {
    origin: String,
    license: String,
    stock: Vec<Stock>,
}

/// An object that may be on furniture.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(super) struct Stock {
    /// File below assets/objects.
    pub object: String,
    /// Its name in sentences.
    pub words: String,
    /// Free height that it needs, metres.
    headroom: f64,
    /// Depth of a surface that it needs, metres.
    depth: f64,
    /// Largest rotation from the direction inwards.
    yaw_deg: f64,
    /// Kinds of rooms; every room when absent.
    rooms: Option<Vec<String>>,
    /// kg; the object's own when absent.
    mass: Option<[f64; 2]>,
    /// Coulomb coefficient; the object's own when absent.
    friction: Option<[f64; 2]>,
    /// It is placed beside other objects, and no task requests it.
    #[serde(default)]
    scenery: bool,
    /// For tests only.
    #[serde(default)]
    held_out: bool,
}

/// Reads the stock of a scene: that of the assets, and the objects of its packs.
pub(super) fn read(assets: &Path, scene: &Scene) -> Result<Vec<Stock>, SceneError> {
    let file: StockFile = parse(assets, FILE)?;
    let place = Place::file(FILE);
    provenance(&place, &file.origin, &file.license)?;
    for stock in &file.stock {
        stock.check(&place.entry("stock", &stock.object))?;
    }
    let mut all = file.stock;
    let mut packs = scene.stocked_packs().peekable();
    if packs.peek().is_none() {
        return Ok(split(all, scene.object_split));
    }
    let mut taken: BTreeMap<String, String> = names(assets, "objects")?
        .into_iter()
        .map(|name| (name, "the assets".to_owned()))
        .collect();
    for pack in packs {
        let owner = format!("the pack {:?}", pack.id().name);
        for (name, entry) in of_pack(pack)? {
            let place = Place::file(&pack.asset_path(&format!("objects/{name}.toml")));
            if let Some(other) = taken.insert(name.clone(), owner.clone()) {
                return Err(place.key("stock").wrong(
                    format!("{name:?}, which {other} has too"),
                    "a name that no other object has",
                    "rename one of the two files, or leave out one of the packs",
                ));
            }
            let stock = Stock::of_object(name, entry);
            stock.check(&place.key("stock"))?;
            all.push(stock);
        }
    }
    Ok(split(all, scene.object_split))
}

/// The objects of a split. Of the held-out ones the targets are held out, and the others are
/// beside them.
fn split(mut all: Vec<Stock>, split: ObjectSplit) -> Vec<Stock> {
    match split {
        ObjectSplit::Any => {}
        ObjectSplit::Train => all.retain(|stock| !stock.held_out),
        ObjectSplit::HeldOut => {
            for stock in &mut all {
                stock.scenery |= !stock.held_out;
            }
        }
    }
    all
}

/// The objects of a pack that have a table `[stock]`.
fn of_pack(pack: &Pack) -> Result<Vec<(String, StockEntry)>, SceneError> {
    let mut found = Vec::new();
    for name in pack.names("objects", "toml") {
        let file: ObjectFile = parse_packed(pack, &format!("objects/{name}.toml"))?;
        found.extend(file.stock.map(|stock| (name.to_owned(), stock)));
    }
    Ok(found)
}

impl Stock {
    /// An object of a pack.
    fn of_object(object: String, entry: StockEntry) -> Self {
        Self {
            object,
            words: entry.words,
            headroom: entry.headroom,
            depth: entry.depth,
            yaw_deg: entry.yaw_deg,
            rooms: entry.rooms,
            mass: None,
            friction: None,
            scenery: entry.scenery,
            held_out: entry.held_out,
        }
    }

    fn check(&self, place: &Place) -> Result<(), SceneError> {
        let metres = "lengths are metres";
        place
            .key("headroom")
            .within(self.headroom, 0.0, 2.0, "m", metres)?;
        place
            .key("depth")
            .within(self.depth, 0.0, 2.0, "m", metres)?;
        let degrees = "angles are degrees";
        place
            .key("yaw_deg")
            .within(self.yaw_deg, 0.0, 180.0, "degrees", degrees)?;
        for (key, range, most) in [("mass", self.mass, 100.0), ("friction", self.friction, 2.0)] {
            let [min, max] = range.unwrap_or_default();
            let place = place.key(key);
            place.within(max, 0.0, most, "", "give [least, greatest] within these")?;
            place.within(min, 0.0, max, "", "give [least, greatest]")?;
        }
        Ok(())
    }

    /// Its body in a scene.
    pub(super) fn body<'a>(&self, scene: &'a Scene) -> Option<&'a Body> {
        Some(&scene.objects[scene.object_named(&self.object)?])
    }

    /// Its body in a scene, if tasks may request it.
    pub(super) fn target<'a>(&self, scene: &'a Scene) -> Option<&'a Body> {
        let body = self.body(scene)?;
        (!self.scenery && !body.grasps.is_empty()).then_some(body)
    }

    /// Whether it belongs into the room of a place.
    pub(super) fn is_of_room(&self, place: &ReachedPlace, known: &[Self]) -> bool {
        let lists = |stock: &Self| {
            let rooms = stock.rooms.as_ref();
            rooms.is_some_and(|rooms| rooms.contains(&place.room))
        };
        self.rooms.is_none() || lists(self) || !known.iter().any(lists)
    }

    /// Whether the surface of a place has room for it, and for the hand above it.
    pub(super) fn fits(&self, place: &ReachedPlace, scene: &Scene) -> bool {
        let surface = scene.surface_named(&place.furniture, Some(&place.surface));
        let depth = surface.map_or(0.0, |surface| surface.depth);
        self.headroom <= place.headroom + 1e-9 && self.depth <= depth + 1e-9
    }

    /// Its ranges on a place.
    pub(super) fn at(&self, place: &ReachedPlace, chance: f64) -> PlaceSpec {
        let range = |[min, max]: [f64; 2]| Range { min, max };
        let turn = self.yaw_deg.to_radians();
        PlaceSpec {
            object: self.object.clone(),
            on: place.furniture.clone(),
            surface: Some(place.surface.clone()),
            inwards: range(place.inwards),
            along: range(place.along),
            yaw: range([-turn, turn]),
            mass: self.mass.map(range),
            friction: self.friction.map(range),
            chance,
            rest: RestShares::default(),
        }
    }
}

/// Ranges of every object of the scene on a place, none of which exists: the home of a query
/// has no other objects than those that it samples.
pub(super) fn every_object(scene: &Scene, stock: &[Stock], place: &ReachedPlace) -> Vec<PlaceSpec> {
    let absent = |object: &str| match stock.iter().find(|stock| stock.object == object) {
        Some(stock) => stock.at(place, 0.0),
        None => PlaceSpec {
            object: object.to_owned(),
            on: place.furniture.clone(),
            surface: Some(place.surface.clone()),
            inwards: Range { min: 0.0, max: 0.0 },
            along: Range { min: 0.0, max: 0.0 },
            yaw: Range { min: 0.0, max: 0.0 },
            mass: None,
            friction: None,
            chance: 0.0,
            rest: RestShares::default(),
        },
    };
    scene
        .objects
        .iter()
        .map(|body| absent(&body.name))
        .collect()
}
