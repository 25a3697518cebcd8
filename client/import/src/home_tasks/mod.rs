//! Tasks in a home: an area and a lift for each surface that a robot reaches.
//!
//! [`add`] uses the report on the home ([`crate::home_report`]), which must be computed with
//! the posture in which the scripted operator drives. Objects start where the report has
//! tested points. The surface of a piece gets the edge from which the robot reaches it, for
//! areas and failures are measured from that edge. Equal packs and robots give equal bytes.

mod approach;
mod choose;
mod files;
mod spot;
mod start;

use std::collections::BTreeMap;

use wheelarm_pack::{ObjectEntry, Pack, PackError};

use crate::home_report::floor::Floor;
use crate::home_report::{Home, NoHome, RobotFacts, SurfaceReport, rooms, surfaces};
use files::{Texts, task_texts};
use spot::Spot;

/// Most tasks of a home.
pub const MOST: usize = 24;

/// A reached surface without a task.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Skipped {
    /// `piece/surface`.
    pub surface: String,
    /// Why.
    pub reason: &'static str,
}

/// A pack with tasks.
#[derive(Debug)]
pub struct HomeTasks {
    /// The pack.
    pub pack: Pack,
    /// Names of the new tasks, sorted.
    pub tasks: Vec<String>,
    /// Number of reached surfaces, and of all.
    pub reached: usize,
    /// All surfaces.
    pub surfaces: usize,
    /// Reached surfaces without a task.
    pub skipped: Vec<Skipped>,
}

/// Why a pack gets no tasks.
#[derive(Debug, thiserror::Error)]
pub enum NoTasks {
    /// It has no home.
    #[error(transparent)]
    Home(#[from] NoHome),
    /// The pack with tasks exceeds a limit of packs.
    #[error(transparent)]
    Pack(#[from] PackError),
    /// A table cannot be written.
    #[error("cannot write {path}: {source}")]
    Table {
        /// File in the pack.
        path: String,
        /// Cause.
        source: toml::ser::Error,
    },
}

/// Adds tasks for the surfaces that `robot` reaches. The other files of the pack stay, except
/// `home.toml` with the objects, and the kinds of pieces whose surfaces are approached from
/// another edge.
///
/// # Errors
/// [`NoTasks`] when the pack has no home, or exceeds a limit with its tasks.
pub fn add(pack: &Pack, robot: &RobotFacts) -> Result<HomeTasks, NoTasks> {
    let home = Home::from_pack(pack)?;
    let name = pack.id().name.clone();
    let mut file = pack
        .home()
        .cloned()
        .ok_or_else(|| NoHome::Missing(name.clone()))?;
    // Not the whole report: what to move takes most of its time.
    let floor = Floor::new(&home, robot);
    let reports: Vec<SurfaceReport> = home
        .surfaces
        .iter()
        .map(|surface| surfaces::test(&home, &floor, robot, surface))
        .collect();
    let own_start = start::fallback(
        &home,
        &floor,
        rooms::start(&home, &floor, &rooms::test(&home, &floor)),
    );
    let mut skipped = Vec::new();
    let mut spots: Vec<Spot> = Vec::new();
    for (surface, report) in home.surfaces.iter().zip(&reports) {
        let Some(strip) = &report.strip else {
            continue;
        };
        match Spot::new(&home, &file, surface, strip) {
            Ok(spot) => spots.push(spot),
            Err(reason) => skipped.push(Skipped {
                surface: format!("{}/{}", report.piece, surface.name),
                reason,
            }),
        }
    }
    let (chosen, rest) = choose::choose(spots, MOST);
    skipped.extend(rest.into_iter().map(|spot| Skipped {
        surface: format!("{}/{}", spot.piece, spot.surface),
        reason: "the home has enough tasks",
    }));

    let mut kinds = pack.kinds().clone();
    let mut manifest = pack.manifest().clone();
    approach::turn(&mut file, &mut kinds, &mut manifest, &chosen);
    let is_named = |object: &str| {
        let pieces = file.piece.iter().map(|piece| piece.name.as_str());
        let objects = file.object.iter().map(|object| object.name.as_str());
        pieces.chain(objects).any(|name| name == object)
    };
    let stock: Vec<&choose::Stock> = choose::STOCK.iter().filter(|s| !is_named(s.name)).collect();
    let mut new: BTreeMap<&str, ObjectEntry> = BTreeMap::new();
    let mut names = files::TaskNames::default();
    let mut files = pack.files().clone();
    files.retain(|path, _| path.contains('/') && !path.starts_with("kinds/"));
    let mut tasks = Vec::new();
    for (index, spot) in chosen.iter().enumerate() {
        let Some(object) = choose::object(&stock, spot, index) else {
            skipped.push(Skipped {
                surface: format!("{}/{}", spot.piece, spot.surface),
                reason: "no object of the assets fits",
            });
            continue;
        };
        new.entry(object.name).or_insert_with(|| ObjectEntry {
            name: object.name.to_owned(),
            kind: None,
            on: spot.piece.clone(),
            surface: Some(spot.surface.clone()),
            at: [
                f64::midpoint(spot.inwards[0], spot.inwards[1]),
                f64::midpoint(spot.along[0], spot.along[1]),
            ],
            yaw_deg: 0.0,
            optional: true,
        });
        let start = start::near(&home, &floor, spot, own_start);
        let Texts { name, area, task } = task_texts(&name, spot, object, &start, &mut names)?;
        files.insert(format!("areas/{name}.toml"), area.into_bytes());
        files.insert(format!("tasks/{name}.toml"), task.into_bytes());
        tasks.push(name);
    }
    tasks.sort();
    skipped.sort_by(|a, b| a.surface.cmp(&b.surface));
    file.object.extend(new.into_values());
    Ok(HomeTasks {
        pack: Pack::from_tables(&manifest, Some(&file), &kinds, files)?,
        tasks,
        reached: reports.iter().filter(|r| r.strip.is_some()).count(),
        surfaces: reports.len(),
        skipped,
    })
}
