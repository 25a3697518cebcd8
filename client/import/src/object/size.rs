//! Units and upright axis: stated, or guessed from the usual size of the category. Afterwards
//! the base of the object is at the origin, in metres.

use super::category::Category;
use super::error::{ObjectError, length};
use super::mesh::{Mesh, Vec3, bounds};
use super::source::{Source, Up};

/// Units that a file may have: name, metres.
const UNITS: [(&str, f64); 5] = [
    ("metres", 1.0),
    ("millimetres", 0.001),
    ("centimetres", 0.01),
    ("inches", 0.0254),
    ("decimetres", 0.1),
];
/// A usual size may be exceeded by this factor.
const TOLERANCE: f64 = 1.25;
/// Range of the longest extent of an object, metres.
const EXTENT: [f64; 2] = [0.004, 2.0];

/// What the user states about the size.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SizeOptions {
    /// Size along x, y, z with z up, metres.
    pub size: Option<[f64; 3]>,
    /// Metres per unit of the file.
    pub scale: Option<f64>,
    /// The upright axis of the file.
    pub up: Option<Up>,
}

/// How a mesh was scaled, in words.
#[derive(Clone, Debug, PartialEq)]
pub struct Sized {
    /// Its size, metres.
    pub size: [f64; 3],
    /// One line about units and axis.
    pub words: String,
    /// How points of the file become points of the object.
    pub placement: Placement,
}

/// How points of a file become points of the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Upright axis of the file.
    pub up: Up,
    /// Metres per unit along x, y, z with z up.
    pub factors: Vec3,
    /// The point that becomes the origin, metres.
    pub origin: Vec3,
}

impl Placement {
    /// A point of the object.
    pub fn apply(&self, point: Vec3) -> Vec3 {
        self.up.upright(point.into()).component_mul(&self.factors) - self.origin
    }
}

/// Scales and turns the mesh of a source to metres with z up, standing on the origin.
pub fn fit(
    file: &str,
    source: &Source,
    options: &SizeOptions,
    category: &Category,
) -> Result<(Mesh, Sized), ObjectError> {
    check(options)?;
    let [low, high] = source.mesh.bounds();
    let extents = |up: Up| up.upright((high - low).into()).abs();
    let ups = match options.up {
        Some(up) => vec![up],
        None if source.up_is_defined => vec![source.up],
        None => match source.up {
            Up::Y => vec![Up::Y, Up::Z],
            Up::Z => vec![Up::Z, Up::Y],
        },
    };
    let (up, factors, words) = if let Some(size) = options.size {
        let up = ups[0];
        let own = extents(up);
        if own.iter().any(|extent| *extent <= 0.0) {
            return Err(ObjectError::Malformed {
                file: file.to_owned(),
                reason: "it is flat, so that it has no size to scale; give it a thickness".into(),
            });
        }
        let factors = Vec3::from(size).component_div(&own);
        let words = format!(
            "size as given; {} is up{}",
            up.name(),
            how(options.up, source)
        );
        (up, factors, words)
    } else if let Some(metres) = options.scale.or(source.metres) {
        let fits = |up: &&Up| is_usual(extents(**up) * metres, category);
        let up = ups.iter().find(fits).copied().unwrap_or(ups[0]);
        let longest = extents(up).max() * metres;
        let is_extreme = !(EXTENT[0]..=EXTENT[1]).contains(&longest);
        if is_extreme || (options.scale.is_none() && !is_usual(extents(up) * metres, category)) {
            unusual(file, extents(up), metres, category, is_extreme)?;
        }
        let words = match options.scale {
            Some(_) => format!(
                "{metres} m per unit as given; {} is up{}",
                up.name(),
                how(options.up, source)
            ),
            None => format!("metres and {} up, as the format defines", up.name()),
        };
        (up, Vec3::repeat(metres), words)
    } else {
        let candidates = UNITS
            .iter()
            .flat_map(|(name, metres)| ups.iter().map(move |up| (*name, *metres, *up)));
        let mut usual =
            candidates.filter(|(_, metres, up)| is_usual(extents(*up) * *metres, category));
        let Some((name, metres, up)) = usual.next() else {
            let found = extents(ups[0]);
            return Err(ObjectError::Size {
                file: file.to_owned(),
                found: format!("{:.4} units", found.max()),
                fix: format!(
                    "no unit makes it a {} ({}); state its size with --size X,Y,Z or its unit \
                     with --scale, for example --scale 0.001 for millimetres",
                    category.name,
                    usual_words(category)
                ),
            });
        };
        let words = format!(
            "{name} and {} up, guessed from the usual size of a {}",
            up.name(),
            category.name
        );
        (up, Vec3::repeat(metres), words)
    };
    let mut placement = Placement {
        up,
        factors,
        origin: Vec3::zeros(),
    };
    let points = source.mesh.faces.iter().flat_map(|face| face.corners);
    let placed: Vec<Vec3> = points.map(|point| placement.apply(point)).collect();
    let [low, high] = bounds(placed.iter());
    let middle = (low + high) / 2.0;
    placement.origin = Vec3::new(middle.x, middle.y, low.z);
    let mut mesh = source.mesh.clone();
    mesh.map(false, |point| placement.apply(point));
    let sized = Sized {
        size: (high - low).into(),
        words,
        placement,
    };
    Ok((mesh, sized))
}

fn how(up: Option<Up>, source: &Source) -> &'static str {
    match up {
        Some(_) => " as given",
        None if source.up_is_defined => " as the format defines",
        None => " as usual for the format; --up states another axis",
    }
}

/// Rejects values that no object has.
fn check(options: &SizeOptions) -> Result<(), ObjectError> {
    let invalid = |option, value: String, expected: &str| {
        Err(ObjectError::Option {
            option,
            value,
            expected: expected.to_owned(),
        })
    };
    if let Some(size) = options.size
        && !size.iter().all(|side| (0.001..=EXTENT[1]).contains(side))
    {
        let expected = "three lengths from 0.001 to 2 m, for example 0.08,0.12,0.11";
        return invalid("--size", format!("{size:?}"), expected);
    }
    if let Some(scale) = options.scale
        && !(1e-6..=1e3).contains(&scale)
    {
        let expected = "metres per unit, for example 0.001 for millimetres";
        return invalid("--scale", scale.to_string(), expected);
    }
    Ok(())
}

/// Whether extents are usual for a category.
pub fn is_usual(extents: Vec3, category: &Category) -> bool {
    let within =
        |value: f64, [low, high]: [f64; 2]| value >= low / TOLERANCE && value <= high * TOLERANCE;
    within(extents.x.max(extents.y), category.width) && within(extents.z, category.height)
}

/// The usual size of a category in words.
pub fn usual_words(category: &Category) -> String {
    let range = |[low, high]: [f64; 2]| format!("{} to {}", length(low), length(high));
    format!(
        "{} wide, {} high",
        range(category.width),
        range(category.height)
    )
}

/// The error for a size that another unit makes usual, or that no object has.
fn unusual(
    file: &str,
    extents: Vec3,
    metres: f64,
    category: &Category,
    is_extreme: bool,
) -> Result<(), ObjectError> {
    let mut others = UNITS.iter().map(|(_, unit)| unit);
    let better = others.find(|unit| is_usual(extents * **unit, category));
    let found = extents.max() * metres;
    let fix = match better {
        Some(unit) => format!("--scale {unit} makes it {}", length(extents.max() * unit)),
        None if is_extreme => format!(
            "objects are {} to {} wide; state --scale in metres per unit, or --size X,Y,Z",
            length(EXTENT[0]),
            length(EXTENT[1])
        ),
        // Unusual, but possible: the summary has a note.
        None => return Ok(()),
    };
    Err(ObjectError::Size {
        file: file.to_owned(),
        found: length(found),
        fix,
    })
}
