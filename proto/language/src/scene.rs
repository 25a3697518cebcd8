//! A scene for language: named entities at positions of areas.

use wheelarm_proto::exact;

/// Role of an entity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// It can be lifted and put somewhere.
    Object,
    /// It slides: it can be opened and closed.
    Slide,
    /// Objects can be put on it.
    Goal,
}

/// A level part of furniture with an approach side.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Area {
    /// Name, for example `coffee_table`.
    pub name: String,
    /// Middle of the approach edge, in `house`, metres.
    pub edge: [f64; 3],
    /// Rotation of the inward direction about the vertical, radians; 0 is along x.
    pub inwards: f64,
    /// Extent inwards from the edge, metres.
    pub depth: f64,
    /// Extent along the edge, metres.
    pub width: f64,
    /// Kind of its furniture, for a home without words of its own for the area; else empty.
    pub kind: String,
    /// Kind or name of its room; may be empty.
    pub room: String,
    /// Furniture with its surface; empty when it has no name of its own.
    pub furniture: String,
    /// It contains doors and drawers of furniture, and no objects.
    pub has_leaves: bool,
}

impl Area {
    /// A point of `house` relative to a viewer who faces the area: inwards from the
    /// edge, to the left from its middle, above it; metres.
    #[must_use]
    pub fn from_viewer(&self, at: [f64; 3]) -> [f64; 3] {
        let (sin, cos) = exact::sin_cos(self.inwards);
        let [x, y, z] = [0, 1, 2].map(|i| at[i] - self.edge[i]);
        [cos * x + sin * y, cos * y - sin * x, z]
    }

    /// Whether a point is on the area: at most 0.3 m above its surface.
    #[must_use]
    pub fn carries(&self, at: [f64; 3]) -> bool {
        let [inwards, left, above] = self.from_viewer(at);
        !self.has_leaves
            && (0.0..=self.depth).contains(&inwards)
            && left.abs() <= self.width / 2.0
            && (-0.02..=0.3).contains(&above)
    }
}

/// An entity of a scene: an object, sliding furniture or a goal.
#[derive(Clone, Debug, PartialEq)]
pub struct Entity {
    /// Name in the scene.
    pub name: String,
    /// Its name without its number.
    pub kind: String,
    /// Category in one word; may be empty.
    pub category: String,
    /// Its colour in one word; may be empty.
    pub colour: String,
    /// Its own noun, of a kind without words in the grammar; may be empty.
    pub noun: String,
    /// Its largest extent, metres; 0 when it is not known.
    pub size: f64,
    /// Role.
    pub role: Role,
    /// Index of its area; `None` for none.
    pub area: Option<usize>,
    /// Its frame's origin relative to a viewer of the area ([`Area::from_viewer`]), or
    /// in `house` without an area; metres.
    pub at: [f64; 3],
}

/// A scene for language.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// Areas of the home.
    pub areas: Vec<Area>,
    /// Entities.
    pub entities: Vec<Entity>,
}

impl Scene {
    /// Adds an entity with its frame's origin at `at` in `house`; without `area` it
    /// belongs to the area that carries it.
    pub fn add(
        &mut self,
        name: &str,
        words: [&str; 2],
        role: Role,
        at: [f64; 3],
        area: Option<&str>,
    ) {
        let area = match area {
            Some(name) => self.areas.iter().position(|area| area.name == name),
            None => self.areas.iter().position(|area| area.carries(at)),
        };
        let relative = area.map_or(at, |i| self.areas[i].from_viewer(at));
        let [category, colour] = words.map(str::to_owned);
        self.entities.push(Entity {
            name: name.to_owned(),
            kind: kind_of(name).to_owned(),
            category,
            colour,
            noun: String::new(),
            size: 0.0,
            role,
            area,
            at: relative,
        });
    }

    /// Adds its own noun and its largest extent, metres, to the newest entity.
    pub fn describe(&mut self, noun: &str, size: f64) {
        if let Some(entity) = self.entities.last_mut() {
            noun.clone_into(&mut entity.noun);
            entity.size = size;
        }
    }

    /// Index of the entity with this name.
    #[must_use]
    pub fn named(&self, name: &str) -> Option<usize> {
        self.entities.iter().position(|entity| entity.name == name)
    }
}

/// The kind of an entity: its name without `_` and a number at the end.
#[must_use]
pub fn kind_of(name: &str) -> &str {
    match name.rsplit_once('_') {
        Some((kind, number))
            if number.bytes().all(|b| b.is_ascii_digit()) && !number.is_empty() =>
        {
            kind
        }
        _ => name,
    }
}
