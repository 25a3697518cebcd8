//! Places of a home: the strip of each surface that a robot reaches, and where the chair starts
//! near it; and handles of doors and drawers. Tasks without an area sample from them.
//!
//! [`add`] uses the report on the home ([`crate::home_report`]), which must be computed with
//! the posture in which the scripted operator drives. Objects start where the report has
//! tested points. The surface of a piece gets the edge from which the robot reaches it, for
//! places and failures are measured from that edge. Equal packs and robots give equal bytes.

mod approach;
mod handles;
mod spot;
mod start;

use wheelarm_pack::{Pack, PackError, PlaceEntry};
use wheelarm_proto::parallel;

use crate::home_report::floor::{self, Floor};
use crate::home_report::home::Surface;
use crate::home_report::{Home, NoHome, RobotFacts, rooms, surfaces};
use spot::Spot;

/// A reached surface without a place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Skipped {
    /// `piece/surface`.
    pub surface: String,
    /// Why.
    pub reason: &'static str,
}

/// A pack with places.
#[derive(Debug)]
pub struct HomePlaces {
    /// The pack.
    pub pack: Pack,
    /// Number of surfaces that are reached from the start of the home.
    pub reached: usize,
    /// Number of further ones that are reached from a start in their room.
    pub reached_within: usize,
    /// All surfaces.
    pub surfaces: usize,
    /// Reached surfaces without a place.
    pub skipped: Vec<Skipped>,
    /// Number of doors and drawers of furniture, of which the pack lists those that open.
    pub leaves: usize,
}

/// Why a pack gets no places.
#[derive(Debug, thiserror::Error)]
pub enum NoPlaces {
    /// It has no home.
    #[error(transparent)]
    Home(#[from] NoHome),
    /// The pack with places exceeds a limit of packs.
    #[error(transparent)]
    Pack(#[from] PackError),
}

/// Robot of the places.
#[derive(Clone, Copy, Debug)]
pub struct PlaceRobot<'a> {
    /// With the posture in which the scripted operator drives.
    pub drives: &'a RobotFacts,
    /// With the posture in which an episode starts.
    pub starts: &'a RobotFacts,
}

/// Adds a place for each surface that `robot` reaches and a handle for each door and drawer of
/// furniture that it opens: from the start of the home, and then from starts in the rooms to
/// which it does not get. They replace those of the pack. The other
/// files of the pack stay, except the kinds of pieces whose surfaces are approached from another
/// edge.
///
/// # Errors
/// [`NoPlaces`] when the pack has no home, or exceeds a limit with its places.
pub fn add(pack: &Pack, robot: PlaceRobot<'_>) -> Result<HomePlaces, NoPlaces> {
    let home = Home::from_pack(pack)?;
    let missing = || NoHome::Missing(pack.id().name.clone());
    let mut file = pack.home().cloned().ok_or_else(missing)?;
    // Not the whole report: what to move takes most of its time.
    let mut floor = Floor::new(&home, robot.drives);
    let parked = floor::footprint(&home, robot.starts);
    let rooms = rooms::test(&home, &floor);
    let of_home = start::of_home(&home, &floor, rooms::start(&home, &floor, &rooms));
    let mut skipped = Vec::new();
    let mut spots: Vec<Spot> = Vec::new();
    let mut handles = Vec::new();
    let mut counts = [0; 2];
    for within in [false, true] {
        if within {
            floor = floor.from_anywhere();
        }
        let floors = start::Floors {
            driven: &floor,
            parked: &parked,
        };
        let spot = |surface: &Surface| {
            let strip = surfaces::test(&home, &floor, robot.drives, surface).strip?;
            let spot = Spot::new(&home, &file, surface, &strip).and_then(|spot| {
                let near = start::near(&home, &floors, &spot);
                let of_home = of_home.filter(|_| !within);
                let start = near.or_else(|| {
                    of_home.filter(|start| start::has_path(&floor, start, &spot.stops))
                });
                let start = start.ok_or("no path of the chair from a start in its room")?;
                Ok(Spot {
                    start,
                    apart: within,
                    ..spot
                })
            });
            Some(spot)
        };
        let label = |surface: &Surface| {
            let piece = &home.pieces[surface.piece].name;
            format!("{piece}/{}", surface.name)
        };
        let mut others: Vec<&Surface> = home.surfaces.iter().collect();
        others.retain(|surface| {
            let piece = &home.pieces[surface.piece].name;
            let is_known = |spot: &Spot| spot.piece == *piece && spot.surface == surface.name;
            let label = label(surface);
            !spots.iter().any(is_known) && !skipped.iter().any(|s: &Skipped| s.surface == label)
        });
        let found = parallel::map(others.clone(), spot);
        for (surface, found) in others.into_iter().zip(found) {
            let Some(found) = found else {
                continue;
            };
            counts[usize::from(within)] += 1;
            match found {
                Ok(spot) => spots.push(spot),
                Err(reason) => skipped.push(Skipped {
                    surface: label(surface),
                    reason,
                }),
            }
        }
        handles::add(
            &home,
            &floors,
            robot.drives,
            (within, of_home),
            &mut handles,
        );
    }
    let mut kinds = pack.kinds().clone();
    let mut manifest = pack.manifest().clone();
    approach::turn(&mut file, &mut kinds, &mut manifest, &spots);
    file.place = spots.iter().map(entry).collect();
    file.handle = handles;
    skipped.sort_by(|a, b| a.surface.cmp(&b.surface));
    let mut files = pack.files().clone();
    files.retain(|path, _| !path.starts_with("kinds/"));
    Ok(HomePlaces {
        pack: Pack::from_tables(&manifest, Some(&file), &kinds, files)?,
        reached: counts[0],
        reached_within: counts[1],
        surfaces: home.surfaces.len(),
        skipped,
        leaves: home.leaves.len(),
    })
}

fn entry(spot: &Spot) -> PlaceEntry {
    PlaceEntry {
        on: spot.piece.clone(),
        surface: spot.surface.clone(),
        kind: None,
        room: spot.room.clone(),
        inwards: spot.inwards,
        along: spot.along,
        headroom: spot::rounded(spot.headroom),
        apart: spot.apart,
        start: spot.start.entry(),
    }
}
