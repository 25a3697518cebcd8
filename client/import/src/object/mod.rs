//! Imports meshes of objects (`wheelarm object import`): from a file to an object of a pack that
//! the robot can grasp.
//!
//! ```text
//! read (glTF, OBJ, STL, DAE, URDF, MJCF) ─► size (units, up) ─► grasps ─► revolve or convex ─► mass ─► pack
//! ```
//! Equal files and options give equal bytes on every machine. Files are foreign: sizes are
//! bounded, and no file may panic.

mod category;
mod colour;
mod convex;
mod error;
mod grasps;
mod hand;
mod hull;
mod mass;
mod mesh;
mod pack;
mod read;
mod read_dae;
mod read_gltf;
mod read_msh;
mod read_obj;
mod read_robot;
mod read_stl;
mod revolve;
mod size;
mod source;

#[cfg(test)]
mod read_tests;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use wheelarm_pack::{GraspEntry, ObjectFile, PartEntry, SourceEntry, StockEntry, UNKNOWN};
use wheelarm_proto::exact;

pub use category::{Categories, Category};
pub use error::{ObjectError, length};
pub use grasps::yaw_deg;
pub use hand::Hand;
pub use pack::{PackedObject, alone, object_of, with_object, with_table};
pub use read::parse;
pub use size::SizeOptions;
pub use source::{Source, Up};

use convex::Hulls;
use grasps::{Grasps, RIM};
use hull::{Hull, decimal, rounded};
use mesh::{Mesh, Vec3, sample};

/// Samples of the surface for the shape.
const SAMPLES: usize = 30_000;
/// Free height that a hand needs above an object, metres.
const ABOVE: f64 = 0.21;
/// Depth of a surface beside an object, metres, and the least one.
const BESIDE: f64 = 0.12;
const DEPTH: f64 = 0.20;

/// What is imported, and as what.
#[derive(Clone, Debug, Default)]
pub struct ObjectOptions {
    /// Name of the object.
    pub name: String,
    /// Category of `assets/categories.toml`.
    pub category: String,
    /// Noun in sentences; the first word of the category when absent.
    pub noun: Option<String>,
    /// Color in one word; that of the largest part when absent.
    pub colour: Option<String>,
    /// Units and axis.
    pub size: SizeOptions,
    /// kg; by category when absent.
    pub mass: Option<f64>,
    /// SPDX expression.
    pub license: Option<String>,
    /// Author.
    pub author: Option<String>,
    /// OBJ file whose groups are the convex parts.
    pub parts: Option<PathBuf>,
    /// For tests only: no training takes it.
    pub held_out: bool,
}

/// What an import found, for people.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ObjectSummary {
    /// Triangles of the file.
    pub triangles: usize,
    /// Units and axis in words.
    pub units: String,
    /// Size, metres.
    pub size: [f64; 3],
    /// kg.
    pub mass: f64,
    /// Usual range, kg.
    pub usual_mass: [f64; 2],
    /// Form of the collision shapes.
    pub form: String,
    /// Number of collision shapes.
    pub shapes: usize,
    /// Antipodal pairs with their approaches; those with a free hand; kept by name.
    pub sampled: usize,
    /// The same.
    pub free: usize,
    /// The same.
    pub kept: BTreeMap<String, usize>,
    /// Warnings, each with its fix.
    pub notes: Vec<String>,
}

/// An imported object.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportedObject {
    /// For a pack.
    pub object: PackedObject,
    /// For people.
    pub summary: ObjectSummary,
}

/// Imports a mesh file.
///
/// # Errors
/// When the file cannot be used, or an option is invalid; with the fix.
pub fn import(
    path: &Path,
    options: &ObjectOptions,
    categories: &Categories,
    hand: &Hand,
) -> Result<ImportedObject, ObjectError> {
    check(options)?;
    let category = categories.named(&options.category)?;
    let source = read::read(path)?;
    let parts = options.parts.as_ref().map(|parts| given_parts(parts));
    let file = path.file_name().unwrap_or_default().to_string_lossy();
    convert(&file, &source, parts.transpose()?, options, category, hand)
}

/// Imports the bytes of a mesh file that names no other file; `file` decides the format.
///
/// # Errors
/// As [`import`].
pub fn import_bytes(
    file: &str,
    bytes: &[u8],
    options: &ObjectOptions,
    categories: &Categories,
    hand: &Hand,
) -> Result<ImportedObject, ObjectError> {
    check(options)?;
    let category = categories.named(&options.category)?;
    let alone = |name: &str| Err(format!("{name:?} is another file; export one GLB file"));
    let source = parse(file, bytes, &alone)?;
    convert(file, &source, None, options, category, hand)
}

fn check(options: &ObjectOptions) -> Result<(), ObjectError> {
    let invalid = |option, value: String, expected: &str| {
        Err(ObjectError::Option {
            option,
            value,
            expected: expected.to_owned(),
        })
    };
    if wheelarm_proto::keys::check_name(&options.name).is_err() {
        let expected = "1 to 64 letters, digits, `-` or `_`, for example blue_mug";
        return invalid("--name", format!("{:?}", options.name), expected);
    }
    if let Some(noun) = &options.noun
        && !is_noun(noun)
    {
        let expected = "1 to 40 letters and spaces, for example \"medicine bottle\"";
        return invalid("--noun", format!("{noun:?}"), expected);
    }
    if let Some(colour) = &options.colour
        && (!is_noun(colour) || colour.contains(' '))
    {
        return invalid(
            "--color",
            format!("{colour:?}"),
            "one word, for example red",
        );
    }
    if let Some(mass) = options.mass
        && !(0.001..=100.0).contains(&mass)
    {
        return invalid(
            "--mass",
            mass.to_string(),
            "0.001 to 100 kg: 603 g is 0.603",
        );
    }
    Ok(())
}

/// Whether a text can be a noun in sentences.
fn is_noun(text: &str) -> bool {
    let is_letter = |c: char| c.is_alphabetic() || c == ' ' || c == '-';
    text.trim() == text && (1..=40).contains(&text.chars().count()) && text.chars().all(is_letter)
}

/// The groups of an OBJ file as points, in its units.
fn given_parts(path: &Path) -> Result<Vec<Vec<Vec3>>, ObjectError> {
    let bytes = source::bytes(path)?;
    let name = path.display().to_string();
    let none = |_: &str| Err("the parts need no materials".to_owned());
    let parts = read_obj::parts(&name, &bytes, &none);
    let (parts, _) = parts.map_err(|reason| ObjectError::Malformed { file: name, reason })?;
    let points = |(_, mesh): &(String, Mesh)| mesh.faces.iter().flat_map(|f| f.corners).collect();
    Ok(parts.iter().map(points).collect())
}

/// The object of a mesh.
fn convert(
    file: &str,
    source: &Source,
    parts: Option<Vec<Vec<Vec3>>>,
    options: &ObjectOptions,
    category: &Category,
    hand: &Hand,
) -> Result<ImportedObject, ObjectError> {
    let (mut mesh, sized) = size::fit(file, source, &options.size, category)?;
    if mesh.volume() < 0.0 {
        // All faces are turned inside out.
        mesh.map(true, |point| point);
    }
    let mut notes = source.notes.clone();
    notes.extend(size_note(&mesh, category));
    notes.extend(open_note(&mesh));
    let samples = sample(&mesh, SAMPLES);
    let is_round = parts.is_none() && revolve::is_round(&samples);
    let whole = Hull::of(
        &mesh
            .faces
            .iter()
            .flat_map(|f| f.corners)
            .collect::<Vec<_>>(),
    );
    let Some(whole) = whole else {
        return Err(ObjectError::Malformed {
            file: file.to_owned(),
            reason: "it is flatter than 1 mm; give it a thickness".into(),
        });
    };
    let about = mass::properties(&mesh, std::slice::from_ref(&whole), category, None);
    let mut grasps = grasps::sampled(&mesh, &about.com, hand, is_round);
    let (sin, cos) = exact::sin_cos(grasps.turn);
    let turned = |v: Vec3| Vec3::new(v.x * cos - v.y * sin, v.x * sin + v.y * cos, v.z);
    mesh.map(false, turned);
    let place = |point: &Vec3| turned(sized.placement.apply(*point));
    let parts: Option<Vec<Vec<Vec3>>> = parts.map(|parts| {
        let placed = |points: &Vec<Vec3>| points.iter().map(place).collect();
        parts.iter().map(placed).collect()
    });
    let (form, collision, hulls) =
        collision(&mesh, &samples, is_round, parts, whole).ok_or_else(|| {
            ObjectError::Malformed {
                file: file.to_owned(),
                reason: "no collision shape fits it; give convex parts with --parts FILE.obj"
                    .into(),
            }
        })?;
    // The inside of other shapes is solid.
    grasps
        .kept
        .retain(|grasp| grasp.name != RIM || form == revolve::CUP);
    let mut mass = mass::properties(&mesh, &hulls, category, options.mass);
    if is_round {
        (mass.com.x, mass.com.y) = (0.0, 0.0);
    }
    notes.extend(mass_note(mass.mass, category));
    let license = options.license.clone().unwrap_or_else(|| UNKNOWN.into());
    if options.license.is_none() {
        notes.push(format!(
            "the license of {} is not stated; give --license, or plans with pack_license = \
             \"commercial\" refuse the pack",
            options.name
        ));
    }
    let origin = format!("imported from {file}");
    let about_files = (origin.as_str(), license.as_str());
    let (parts, files) = pack::rendered(&options.name, &mesh, about_files, &mut notes);
    if grasps.kept.is_empty() {
        notes.push(scenery_note(&options.name, &grasps, hand));
    }
    let colour = options.colour.as_deref();
    let colour = colour.unwrap_or_else(|| colour::word(&mesh));
    let object = ObjectFile {
        origin: origin.clone(),
        license: license.clone(),
        category: category.name.clone(),
        colour: colour.to_owned(),
        mass: (mass.mass * 1.0e4).round().max(10.0) / 1.0e4,
        com: rounded(mass.com),
        inertia: mass.inertia.map(six_digits),
        friction: category.friction,
        material: None,
        parts,
        collision: Some(collision),
        soft: None,
        lobes: Vec::new(),
        grasps: grasps.kept.clone(),
        tip: None,
        stock: Some(stock(colour, &sized.size, &grasps, (options, category))),
    };
    let mut kept = BTreeMap::new();
    for GraspEntry { name, .. } in &grasps.kept {
        *kept.entry(name.clone()).or_default() += 1;
    }
    let summary = ObjectSummary {
        triangles: source.mesh.faces.len(),
        units: sized.words,
        size: sized.size,
        mass: object.mass,
        usual_mass: category.mass,
        form: form.to_owned(),
        shapes: object.collision.as_ref().map_or(0, Vec::len),
        sampled: grasps.sampled,
        free: grasps.free,
        kept,
        notes,
    };
    let source = SourceEntry {
        of: options.name.clone(),
        author: options.author.clone().unwrap_or_default(),
        license,
        origin,
    };
    let object = PackedObject {
        name: options.name.clone(),
        file: object,
        files,
        source,
    };
    Ok(ImportedObject { object, summary })
}

/// Form, collision shapes, and hulls for the mass.
fn collision(
    mesh: &Mesh,
    samples: &[mesh::Sample],
    is_round: bool,
    parts: Option<Vec<Vec<Vec3>>>,
    whole: Hull,
) -> Option<(&'static str, Vec<PartEntry>, Vec<Hull>)> {
    if is_round && let Some(round) = revolve::shapes(samples) {
        return Some((round.form, round.parts, vec![whole]));
    }
    let Hulls { form, hulls } = match parts {
        Some(parts) => convex::of_parts(&parts),
        None => convex::hulls(mesh)?,
    };
    let entry = |hull: &Hull| PartEntry {
        hull: Some(hull.points.iter().map(|p| rounded(*p)).collect()),
        ..PartEntry::default()
    };
    let entries: Vec<PartEntry> = hulls.iter().map(entry).collect();
    (!entries.is_empty()).then_some((form, entries, hulls))
}

/// Placement by tasks.
fn stock(
    colour: &str,
    size: &[f64; 3],
    grasps: &Grasps,
    (options, category): (&ObjectOptions, &Category),
) -> StockEntry {
    let usual = category.words.first().unwrap_or(&category.name);
    let noun = options.noun.as_ref().unwrap_or(usual);
    StockEntry {
        words: match noun == colour {
            // An orange.
            true => noun.clone(),
            false => format!("{colour} {noun}"),
        },
        headroom: decimal(((size[2] + ABOVE) * 100.0).ceil() / 100.0),
        depth: decimal((size[0].max(size[1]) + BESIDE).max(DEPTH)),
        yaw_deg: grasps.yaw_deg,
        rooms: category.rooms.clone(),
        scenery: grasps.kept.is_empty(),
        held_out: options.held_out,
        trials: None,
    }
}

/// A number with six digits.
fn six_digits(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

fn size_note(mesh: &Mesh, category: &Category) -> Option<String> {
    let [low, high] = mesh.bounds();
    (!size::is_usual(high - low, category)).then(|| {
        format!(
            "the size is not usual for a {} ({}); --size or --scale states another, --category \
             another kind",
            category.name,
            size::usual_words(category)
        )
    })
}

fn mass_note(mass: f64, category: &Category) -> Option<String> {
    let [low, high] = category.mass;
    (!(low..=high).contains(&mass)).then(|| {
        format!(
            "the mass of {mass:.3} kg is not usual for a {} ({low} to {high} kg); --mass states \
             the real one",
            category.name
        )
    })
}

/// A note on the holes of a mesh.
fn open_note(mesh: &Mesh) -> Option<String> {
    let mut edges: BTreeMap<[[i64; 3]; 2], i32> = BTreeMap::new();
    let mut at = Vec3::zeros();
    for face in &mesh.faces {
        let keys = face
            .corners
            .map(|c| c.map(|x| (x * 1.0e6).round() as i64).into());
        for k in 0..3 {
            let (a, b): ([i64; 3], [i64; 3]) = (keys[k], keys[(k + 1) % 3]);
            let (edge, sign) = if a < b { ([a, b], 1) } else { ([b, a], -1) };
            *edges.entry(edge).or_default() += sign;
        }
    }
    let mut open = 0;
    for (edge, count) in &edges {
        if *count != 0 {
            open += 1;
            at = Vec3::from(edge[0].map(|c| c as f64 * 1.0e-6));
        }
    }
    (open > 0).then(|| {
        format!(
            "the mesh has holes ({open} open edges, one near [{:.3}, {:.3}, {:.3}] m); volumes and \
             the mass may be wrong: close them, or state --mass",
            at.x, at.y, at.z
        )
    })
}

fn scenery_note(name: &str, grasps: &Grasps, hand: &Hand) -> String {
    if grasps.narrowest.is_finite() && grasps.narrowest < hand.stroke {
        return format!(
            "{name}: no side leaves room for the hand; narrowest graspable width {:.3} m; kept as \
             scenery",
            grasps.narrowest
        );
    }
    let width = match grasps.narrowest.is_finite() {
        true => format!("narrowest graspable width {:.3} m", grasps.narrowest),
        false => "no opposite sides".to_owned(),
    };
    format!(
        "{name}: {width}, the gripper opens {:.3} m; kept as scenery",
        hand.stroke
    )
}
