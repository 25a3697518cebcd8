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
use wheelarm_planning::reached::Reached;

use crate::home_report::floor::{self, Floor};
use crate::home_report::{Home, NoHome, RobotFacts, rooms, surfaces};
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
    /// Number of surfaces that are reached from the start of the home.
    pub reached: usize,
    /// Number of further ones that are reached from a start in their room.
    pub reached_within: usize,
    /// Number of tasks that start in a room to which the chair does not get.
    pub tasks_within: usize,
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

/// Robot of the tasks.
#[derive(Clone, Copy, Debug)]
pub struct TaskRobot<'a> {
    /// With the posture in which the scripted operator drives.
    pub drives: &'a RobotFacts,
    /// With the posture in which an episode starts.
    pub starts: &'a RobotFacts,
}

/// Adds tasks for the surfaces that `robot` reaches: from the start of the home, and then from
/// starts in the rooms to which it does not get. The other files of the pack stay, except
/// `home.toml` with the objects, and the kinds of pieces whose surfaces are approached from
/// another edge.
///
/// # Errors
/// [`NoTasks`] when the pack has no home, or exceeds a limit with its tasks.
pub fn add(pack: &Pack, robot: TaskRobot<'_>) -> Result<HomeTasks, NoTasks> {
    let home = Home::from_pack(pack)?;
    let name = pack.id().name.clone();
    let mut file = pack
        .home()
        .cloned()
        .ok_or_else(|| NoHome::Missing(name.clone()))?;
    // Not the whole report: what to move takes most of its time.
    let mut floor = Floor::new(&home, robot.drives);
    let parked = floor::footprint(&home, robot.starts);
    let rooms = rooms::test(&home, &floor);
    let of_home = start::of_home(&home, &floor, rooms::start(&home, &floor, &rooms));
    let mut skipped = Vec::new();
    let mut spots: Vec<Spot> = Vec::new();
    let mut counts = [0; 2];
    for within in [false, true] {
        if within {
            floor.driven = Reached::all(floor.driven.map().clone());
        }
        let floors = start::Floors {
            driven: &floor,
            parked: &parked,
        };
        for surface in &home.surfaces {
            let piece = &home.pieces[surface.piece].name;
            let is_known = |spot: &Spot| spot.piece == *piece && spot.surface == surface.name;
            let label = format!("{piece}/{}", surface.name);
            if spots.iter().any(is_known) || skipped.iter().any(|s: &Skipped| s.surface == label) {
                continue;
            }
            let Some(strip) = surfaces::test(&home, &floor, robot.drives, surface).strip else {
                continue;
            };
            let spot = Spot::new(&home, &file, surface, &strip).and_then(|spot| {
                let near = start::near(&home, &floors, &spot);
                let start = near.or(of_home.filter(|_| !within));
                let start = start.ok_or("no free floor for a start in its room")?;
                Ok(Spot {
                    within,
                    start,
                    ..spot
                })
            });
            counts[usize::from(within)] += 1;
            match spot {
                Ok(spot) => spots.push(spot),
                Err(reason) => skipped.push(Skipped {
                    surface: label,
                    reason,
                }),
            }
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
    files.retain(|path, _| !path.starts_with("kinds/"));
    let mut tasks = Vec::new();
    let mut within = 0;
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
        within += usize::from(spot.within);
        let Texts { name, area, task } = task_texts(&name, spot, object, &mut names)?;
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
        reached: counts[0],
        reached_within: counts[1],
        tasks_within: within,
        surfaces: home.surfaces.len(),
        skipped,
    })
}
