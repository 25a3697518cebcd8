//! `assets/stocks.toml`: what may be on the places of a home.

use std::path::Path;

use serde::Deserialize;

use super::area::{PlaceSpec, Range, RestShares};
use crate::scene::{Body, Place, ReachedPlace, Scene, SceneError, parse, provenance};

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
}

/// Reads the stock.
pub(super) fn read(assets: &Path) -> Result<Vec<Stock>, SceneError> {
    let file: StockFile = parse(assets, FILE)?;
    let place = Place::file(FILE);
    provenance(&place, &file.origin, &file.license)?;
    for stock in &file.stock {
        let place = place.entry("stock", &stock.object);
        let metres = "lengths are metres";
        place
            .key("headroom")
            .within(stock.headroom, 0.0, 2.0, "m", metres)?;
        place
            .key("depth")
            .within(stock.depth, 0.0, 2.0, "m", metres)?;
        let degrees = "angles are degrees";
        place
            .key("yaw_deg")
            .within(stock.yaw_deg, 0.0, 180.0, "degrees", degrees)?;
        for (key, range, most) in [
            ("mass", stock.mass, 100.0),
            ("friction", stock.friction, 2.0),
        ] {
            let [min, max] = range.unwrap_or_default();
            let place = place.key(key);
            place.within(max, 0.0, most, "", "give [least, greatest] within these")?;
            place.within(min, 0.0, max, "", "give [least, greatest]")?;
        }
    }
    Ok(file.stock)
}

impl Stock {
    /// Its body in a scene, if it can be grasped.
    pub(super) fn body<'a>(&self, scene: &'a Scene) -> Option<&'a Body> {
        let body = &scene.objects[scene.object_named(&self.object)?];
        (!body.grasps.is_empty()).then_some(body)
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
