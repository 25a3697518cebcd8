//! A home from its asset files, for clients that have only these texts, such as a
//! recording, and for tests.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::scene::{Area, Role, Scene, kind_of};

/// Asset texts that do not describe a home.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
#[error("{file}: {problem}")]
pub struct HomeError {
    /// File below the assets folder.
    pub file: String,
    /// What is wrong with it.
    pub problem: String,
}

/// The parts of a home's files that matter to language.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Home {
    /// Areas, in the order of the scene file.
    pub areas: Vec<HomeArea>,
    /// Category and colour by kind of object.
    pub kinds: BTreeMap<String, [String; 2]>,
    /// Furniture on joints.
    pub slides: Vec<HomeSlide>,
    /// Other furniture with a surface that belongs to an area, for example a mat: name,
    /// area, middle of the surface in `house`, and whether it is optional.
    pub goals: Vec<(String, String, Area, bool)>,
}

/// Furniture on a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct HomeSlide {
    /// Its name.
    pub name: String,
    /// Its area.
    pub area: String,
    /// Category; may be empty.
    pub category: String,
    /// Origin at joint position 0 in `house`, m.
    pub origin: [f64; 3],
    /// Where it is grasped at joint position 0, in `house`, m: the origin of what slides.
    pub handle: [f64; 3],
    /// It turns about the axis through its origin; positions are radians.
    pub turns: bool,
    /// Axis of the joint, unit vector in `house`.
    pub axis: [f64; 3],
}

/// An area of a home.
pub type HomeArea = Area;

#[derive(Deserialize)]
struct SceneFile {
    furniture: Vec<Furniture>,
    #[serde(default)]
    place: Vec<Place>,
}

#[derive(Clone, Deserialize)]
struct Place {
    on: String,
    surface: String,
    kind: Option<String>,
    #[serde(default)]
    room: String,
}

#[derive(Clone, Deserialize)]
struct Furniture {
    name: String,
    area: Option<String>,
    category: Option<String>,
    like: Option<String>,
    at: [f64; 3],
    #[serde(default)]
    yaw_deg: f64,
    #[serde(default)]
    optional: bool,
    #[serde(default)]
    surfaces: Vec<Surface>,
    slide: Option<Slide>,
    hinge: Option<Slide>,
    #[serde(default)]
    grasps: Vec<Grasp>,
}

#[derive(Clone, Deserialize)]
struct Grasp {
    point: [f64; 3],
}

#[derive(Clone, Deserialize)]
struct Surface {
    #[serde(default)]
    name: String,
    edge: [f64; 3],
    #[serde(default)]
    inwards_deg: f64,
    depth: f64,
    width: f64,
}

#[derive(Clone, Deserialize)]
struct Slide {
    axis: [f64; 3],
}

#[derive(Deserialize)]
struct ObjectFile {
    #[serde(default)]
    category: String,
    #[serde(default)]
    colour: String,
}

impl Home {
    /// Parses a home from asset texts by their paths below the assets folder:
    /// `scenes/NAME.toml` and `objects/*.toml`.
    ///
    /// # Errors
    /// When a text cannot be parsed, or the scene is missing.
    pub fn read<'a>(texts: impl Iterator<Item = (&'a str, &'a str)>) -> Result<Self, HomeError> {
        let mut home = Self::default();
        let mut has_scene = false;
        for (path, text) in texts {
            let wrong = |e: toml::de::Error| HomeError {
                file: path.to_owned(),
                problem: e.to_string(),
            };
            let stem = path
                .rsplit('/')
                .next()
                .and_then(|name| name.strip_suffix(".toml"));
            let Some(stem) = stem else { continue };
            if path.starts_with("objects/") {
                let file: ObjectFile = toml::from_str(text).map_err(wrong)?;
                home.kinds
                    .insert(stem.to_owned(), [file.category, file.colour]);
            } else if path.starts_with("scenes/") {
                has_scene = true;
                home.furniture(toml::from_str(text).map_err(wrong)?);
            }
        }
        match has_scene {
            true => Ok(home),
            false => Err(HomeError {
                file: "scenes".to_owned(),
                problem: "the texts contain no scene".to_owned(),
            }),
        }
    }

    fn furniture(&mut self, file: SceneFile) {
        for own in &file.furniture {
            let model = own
                .like
                .as_ref()
                .and_then(|like| file.furniture.iter().find(|f| f.name == *like));
            let area = own.area.clone().or(model.and_then(|m| m.area.clone()));
            let turn = own.yaw_deg.to_radians();
            let is_area = area.as_deref() == Some(&own.name);
            let places = file
                .place
                .iter()
                .filter(|place| place.on == own.name && !is_area);
            for place in places {
                self.areas.extend(reached(own, turn, place));
            }
            let Some(area) = area else { continue };
            let slide = own.slide.as_ref().or(model.and_then(|m| m.slide.as_ref()));
            let hinge = own.hinge.as_ref().or(model.and_then(|m| m.hinge.as_ref()));
            if let Some(joint) = slide.or(hinge) {
                let category = own
                    .category
                    .clone()
                    .or(model.and_then(|m| m.category.clone()));
                let turns = slide.is_none();
                let mut grasps = own
                    .grasps
                    .iter()
                    .chain(model.into_iter().flat_map(|m| &m.grasps));
                let handle = match grasps.next().filter(|_| turns) {
                    None => own.at,
                    Some(grasp) => {
                        let point = turned(grasp.point, turn);
                        [0, 1, 2].map(|i| own.at[i] + point[i])
                    }
                };
                self.slides.push(HomeSlide {
                    name: own.name.clone(),
                    area,
                    category: category.unwrap_or_default(),
                    origin: own.at,
                    handle,
                    turns,
                    axis: turned(joint.axis, turn),
                });
                continue;
            }
            let Some(surface) = own.surfaces.first() else {
                continue;
            };
            let edge = turned(surface.edge, turn);
            let made = Area {
                name: own.name.clone(),
                edge: [0, 1, 2].map(|i| own.at[i] + edge[i]),
                inwards: turn + surface.inwards_deg.to_radians(),
                depth: surface.depth,
                width: surface.width,
                ..Area::default()
            };
            if own.name == area {
                self.areas.push(made);
            } else {
                self.goals
                    .push((own.name.clone(), area, made, own.optional));
            }
        }
    }

    /// The areas, the closed sliding furniture, and the goals for which `is_there`
    /// holds: a scene without objects.
    #[must_use]
    pub fn scene(&self, is_there: &dyn Fn(&str) -> bool) -> Scene {
        let mut scene = Scene {
            areas: self.areas.clone(),
            entities: Vec::new(),
        };
        for slide in &self.slides {
            let words = [slide.category.as_str(), ""];
            scene.add(
                &slide.name,
                words,
                Role::Slide,
                slide.origin,
                Some(&slide.area),
            );
        }
        for (name, area, surface, optional) in &self.goals {
            if !optional || is_there(name) {
                let (sin, cos) = wheelarm_proto::exact::sin_cos(surface.inwards);
                let [x, y, z] = surface.edge;
                let middle = [
                    x + cos * surface.depth / 2.0,
                    y + sin * surface.depth / 2.0,
                    z,
                ];
                scene.add(name, ["", ""], Role::Goal, middle, Some(area));
            }
        }
        scene
    }

    /// Category and colour of an object; empty for an unknown kind.
    #[must_use]
    pub fn words_of(&self, object: &str) -> [&str; 2] {
        let words = self.kinds.get(kind_of(object));
        words.map_or(["", ""], |[category, colour]| [category, colour])
    }
}

/// The area of a place on furniture that is not an area itself.
fn reached(own: &Furniture, turn: f64, place: &Place) -> Option<Area> {
    let surface = own.surfaces.iter().find(|s| s.name == place.surface)?;
    let edge = turned(surface.edge, turn);
    let category = own.category.clone().unwrap_or_default();
    Some(Area {
        name: format!("{}/{}", place.on, place.surface),
        edge: [0, 1, 2].map(|i| own.at[i] + edge[i]),
        inwards: turn + surface.inwards_deg.to_radians(),
        depth: surface.depth,
        width: surface.width,
        kind: place.kind.clone().unwrap_or(category),
        room: place.room.clone(),
        furniture: own.name.clone(),
        has_leaves: false,
    })
}

fn turned([x, y, z]: [f64; 3], by: f64) -> [f64; 3] {
    let (sin, cos) = wheelarm_proto::exact::sin_cos(by);
    [cos * x - sin * y, sin * x + cos * y, z]
}
