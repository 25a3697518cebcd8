//! A scene as a person sees it: things with words for them, at places of areas.

use wheelarm_proto::exact;

/// What can be asked of a thing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// It can be lifted and put somewhere.
    Object,
    /// It slides: it can be opened and closed.
    Slide,
    /// Something is put on it.
    Goal,
}

/// A level part of furniture that is approached from one side.
#[derive(Clone, Debug, PartialEq)]
pub struct Area {
    /// Name, for example `coffee_table`.
    pub name: String,
    /// Middle of the edge from which it is approached, in `house`, metres.
    pub edge: [f64; 3],
    /// Turn of the direction inwards about the vertical, radians; 0 is along x.
    pub inwards: f64,
    /// Extent inwards from the edge, metres.
    pub depth: f64,
    /// Extent along the edge, metres.
    pub width: f64,
}

impl Area {
    /// A point of `house` as who looks at the area sees it: inwards from the edge,
    /// to the left from its middle, above it; metres.
    #[must_use]
    pub fn seen(&self, at: [f64; 3]) -> [f64; 3] {
        let (sin, cos) = exact::sin_cos(self.inwards);
        let [x, y, z] = [0, 1, 2].map(|i| at[i] - self.edge[i]);
        [cos * x + sin * y, cos * y - sin * x, z]
    }

    /// Whether a point stands on the area: above its surface, at most 0.3 m.
    #[must_use]
    pub fn carries(&self, at: [f64; 3]) -> bool {
        let [inwards, left, above] = self.seen(at);
        (0.0..=self.depth).contains(&inwards)
            && left.abs() <= self.width / 2.0
            && (-0.02..=0.3).contains(&above)
    }
}

/// A thing of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Thing {
    /// Name in the scene.
    pub name: String,
    /// Its name without its number.
    pub kind: String,
    /// What it is in one word; may be empty.
    pub category: String,
    /// Its colour in one word; may be empty.
    pub colour: String,
    /// What can be asked of it.
    pub role: Role,
    /// Index of the area on which it stands; `None` on none.
    pub area: Option<usize>,
    /// Its frame's origin as who looks at the area sees it ([`Area::seen`]);
    /// in `house` where it stands on none; metres.
    pub at: [f64; 3],
}

/// Everything that a sentence may be about.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// Areas of the home.
    pub areas: Vec<Area>,
    /// Things.
    pub things: Vec<Thing>,
}

impl Scene {
    /// Adds a thing whose frame's origin is `at` in `house`; with `area` it belongs
    /// there, else to the area that carries it.
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
        let seen = area.map_or(at, |i| self.areas[i].seen(at));
        let [category, colour] = words.map(str::to_owned);
        self.things.push(Thing {
            name: name.to_owned(),
            kind: kind_of(name).to_owned(),
            category,
            colour,
            role,
            area,
            at: seen,
        });
    }

    /// Index of the thing of this name.
    #[must_use]
    pub fn named(&self, name: &str) -> Option<usize> {
        self.things.iter().position(|thing| thing.name == name)
    }
}

/// The kind of a thing: its name without `_` and a number at the end.
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
