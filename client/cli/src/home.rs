//! `wheelarm home`: imports homes of Sweet Home 3D as packs, makes own ones, lists the homes of
//! packs, reports what a robot reaches in them.

use std::fmt::Write;
use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, Subcommand, ValueEnum};
use wheelarm_homes::home_places::{self, PlaceRobot};
use wheelarm_homes::home_report::{Posture, RobotFacts};
use wheelarm_import::{Joints, Options, Summary, import_file, slug, write};
use wheelarm_options::packs::PackArgs;
use wheelarm_pack::{Pack, Store};
use wheelarm_proto::installed::{self, ASSETS_VARIABLE};

use crate::home_make::{self, MakeArgs};
use crate::home_report::{self, DRIVING_POSTURE, ReportArgs, store};

/// Names of pieces that are printed for one reason.
const MOST_NAMES: usize = 12;

/// Commands of `wheelarm home`.
#[derive(Subcommand, Debug)]
pub enum HomeCommand {
    /// Imports a home that was drawn with Sweet Home 3D, as a pack.
    ///
    /// Prints what is in the pack and every piece that is not, with the reason. A pack of
    /// the same name is replaced.
    Import(ImportArgs),
    /// Lists the homes of the packs.
    List(ListArgs),
    /// Makes a furnished home from a plan, a style and a seed, as a pack.
    ///
    /// A layout is written only when it is ready: the chair enters every room, and the arm
    /// reaches nine of ten surfaces. `--list` prints the plans and styles.
    Make(MakeArgs),
    /// Reports what a robot reaches in a home, why not the rest, and what to move.
    ///
    /// Rooms that the chair enters, clear widths of doors, surfaces within the arm's reach,
    /// places to turn, beside DIN 18040-2. A home that the chair cannot enter has a report too.
    Report(ReportArgs),
}

/// Arguments of `wheelarm home import`.
#[derive(Args, Debug)]
pub struct ImportArgs {
    /// File of Sweet Home 3D 5.3 or newer, .sh3d.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Name of the pack and of its scene; by default from the name of the file.
    #[arg(long)]
    name: Option<String>,
    /// Level of the home: its name, or its number from the lowest, the first being 1.
    ///
    /// By default the level that was shown when the file was saved.
    #[arg(long)]
    level: Option<String>,
    /// Kinds of furniture that are left out, for example chairs,rugs.
    #[arg(long, value_name = "KINDS", value_delimiter = ',')]
    without: Vec<String>,
    /// Doors and drawers of furniture that move.
    #[arg(long, value_enum, default_value_t = JointsOption::All)]
    joints: JointsOption,
    /// Places of tasks: one on each surface that the robot reaches.
    #[arg(long, value_enum, default_value_t = PlacesOption::All)]
    places: PlacesOption,
    /// Robot of the places, a folder in assets/robots.
    #[arg(long, default_value = "wheelarm")]
    robot: String,
    /// Posture of the arm in which the scripted operator drives: travel or home.
    #[arg(long, default_value = DRIVING_POSTURE)]
    posture: Posture,
    /// License of the home when the file states none, for example CC-BY-4.0.
    #[arg(long, alias = "licence", value_name = "TEXT")]
    license: Option<String>,
    /// Folder of packs that receives the new one [default: the first of the folders below].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Folders of packs.
    #[command(flatten)]
    packs: PackArgs,
    /// Assets folder; by default the installed one.
    #[arg(long, env = ASSETS_VARIABLE, value_name = "DIR")]
    assets: Option<PathBuf>,
}

/// Values of --places.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PlacesOption {
    /// One for each reached surface.
    All,
    /// None.
    None,
}

/// Values of --joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum JointsOption {
    /// All that the models describe.
    All,
    /// None: furniture stays closed.
    None,
}

/// Arguments of `wheelarm home list`.
#[derive(Args, Debug)]
pub struct ListArgs {
    /// Folders of packs.
    #[command(flatten)]
    packs: PackArgs,
}

/// Runs a command and returns its output.
///
/// # Errors
/// When the file is not a home that can be imported, or the pack cannot be written.
pub fn run(command: &HomeCommand) -> anyhow::Result<String> {
    match command {
        HomeCommand::Import(args) => import(args),
        HomeCommand::List(args) => list(&store(&args.packs)),
        HomeCommand::Make(args) => home_make::run(args),
        HomeCommand::Report(args) => home_report::run(args),
    }
}

fn import(args: &ImportArgs) -> anyhow::Result<String> {
    let stem = args.file.file_stem().map(|stem| stem.to_string_lossy());
    let name = args.name.clone().unwrap_or_else(|| match stem {
        Some(stem) => slug(&stem, 64),
        None => String::new(),
    });
    let options = Options {
        name: if name.is_empty() { "home".into() } else { name },
        level: args.level.clone(),
        without: args.without.clone(),
        joints: match args.joints {
            JointsOption::All => Joints::All,
            JointsOption::None => Joints::None,
        },
        license: args.license.clone(),
    };
    let imported = import_file(&args.file, &options)?;
    let folders = store(&args.packs);
    let folder = match &args.out {
        Some(out) => out,
        None => folders
            .folders()
            .first()
            .context("no folder of packs is known; name one with --out")?,
    };
    let mut text = describe(&options.name, &imported.summary)?;
    let (pack, places) = with_places(args, imported.pack)?;
    text.push_str(&places);
    let path = write(&pack, folder)?;
    writeln!(text, "digests: {}", pack.id())?;
    writeln!(text, "written: {}", path.display())?;
    let packs = match &args.out {
        Some(out) => format!(" --packs {}", out.display()),
        None => String::new(),
    };
    let name = &options.name;
    writeln!(text, "next: wheelarm-server{packs} --scene {name}")?;
    writeln!(
        text,
        "tasks: wheelarm-server{packs} --scene {name} --list-tasks"
    )?;
    Ok(text)
}

/// The pack with its places, and what was added, as text. Without the assets of the robot the
/// home has no places.
fn with_places(args: &ImportArgs, pack: Pack) -> anyhow::Result<(Pack, String)> {
    if args.places == PlacesOption::None {
        return Ok((pack, String::new()));
    }
    let Some(assets) = args.assets.clone().or_else(installed::assets) else {
        let note = format!(
            "note: no places: no assets folder found; name it: export {ASSETS_VARIABLE}=…/assets\n"
        );
        return Ok((pack, note));
    };
    let read = |posture| RobotFacts::read(&assets, &args.robot, posture);
    let found = match (read(args.posture), read(Posture::Home)) {
        (Ok(drives), Ok(starts)) => {
            let (drives, starts) = (&drives, &starts);
            home_places::add(&pack, PlaceRobot { drives, starts })?
        }
        (Err(error), _) | (_, Err(error)) => {
            return Ok((pack, format!("note: no places: {error}\n")));
        }
    };
    let places = found.pack.home().map_or(&[][..], |home| &home.place);
    let mut text = format!(
        "{} of {} surfaces reached, {} more from a start in their room; {} places for tasks\n",
        found.reached,
        found.surfaces,
        found.reached_within,
        places.len()
    );
    for place in places {
        let room = place.room.as_deref().unwrap_or("no room");
        writeln!(text, "place: {}/{} in {room}", place.on, place.surface)?;
    }
    let handles = found.pack.home().map_or(&[][..], |home| &home.handle);
    if found.leaves > 0 {
        writeln!(
            text,
            "{} of {} doors and drawers of furniture open, {} of them from a start in their room",
            handles.len(),
            found.leaves,
            handles.iter().filter(|handle| handle.apart).count()
        )?;
    }
    for skipped in &found.skipped {
        writeln!(text, "no place: {}: {}", skipped.surface, skipped.reason)?;
    }
    Ok((found.pack, text))
}

/// What an import did, as text.
fn describe(name: &str, summary: &Summary) -> anyhow::Result<String> {
    let mut text = String::new();
    write!(text, "{name}: ")?;
    if !summary.level.is_empty() {
        write!(text, "level {:?}, ", summary.level)?;
    }
    writeln!(
        text,
        "{} rooms, {} outside, {} walls, {} open passages, {} closed doors and windows",
        summary.rooms, summary.outside, summary.walls, summary.passages, summary.closed
    )?;
    writeln!(
        text,
        "{} of {} pieces, {} doors and {} drawers on joints, {} surfaces",
        summary.placed, summary.found, summary.hinges, summary.rails, summary.surfaces
    )?;
    writeln!(
        text,
        "{} triangles, {} collision shapes",
        summary.triangles, summary.shapes
    )?;
    if !summary.other_levels.is_empty() {
        let levels = summary.other_levels.join(", ");
        writeln!(text, "other levels: {levels}; --level imports one of them")?;
    }
    for (reason, names) in summary.left_out_by_reason() {
        let all: usize = names.values().sum();
        let mut shown: Vec<String> = names
            .iter()
            .take(MOST_NAMES)
            .map(|(name, count)| match count {
                1 => (*name).to_owned(),
                count => format!("{name} ({count})"),
            })
            .collect();
        if names.len() > MOST_NAMES {
            shown.push(format!("{} other names", names.len() - MOST_NAMES));
        }
        writeln!(text, "left out, {all}: {}: {reason}", shown.join(", "))?;
    }
    for note in &summary.notes {
        writeln!(text, "note: {note}")?;
    }
    Ok(text)
}

fn list(store: &Store) -> anyhow::Result<String> {
    let mut text = String::new();
    for (name, path) in store.candidates() {
        match Pack::open(&path) {
            Ok(pack) if pack.manifest().hidden => {}
            Ok(pack) => {
                let Some(home) = pack.home() else {
                    continue;
                };
                let surfaces: usize = home
                    .piece
                    .iter()
                    .filter_map(|piece| pack.kinds().get(&piece.kind))
                    .map(|kind| kind.surfaces.len())
                    .sum();
                writeln!(
                    text,
                    "{name}  {} rooms, {} pieces, {surfaces} surfaces, license {}{}  {}",
                    home.room.len(),
                    home.piece.len(),
                    home.license,
                    if pack.manifest().held_out {
                        ", held out"
                    } else {
                        ""
                    },
                    path.display()
                )?;
            }
            Err(error) => writeln!(text, "{name}  not usable: {error}")?,
        }
    }
    if text.is_empty() {
        let folders: Vec<String> = store
            .folders()
            .iter()
            .map(|folder| folder.display().to_string())
            .collect();
        writeln!(
            text,
            "no homes in {}; import one with `wheelarm home import FILE.sh3d`, or name a folder with --packs",
            folders.join(", ")
        )?;
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn summary_names_every_piece_that_is_left_out() {
        let left = |name: &str| wheelarm_import::LeftOut {
            name: name.into(),
            reason: "--without chairs".into(),
        };
        let summary = Summary {
            found: 3,
            placed: 1,
            left_out: vec![left("Chair"), left("Chair")],
            other_levels: vec!["Roof".into()],
            notes: vec!["license of the home is not stated".into()],
            ..Summary::default()
        };
        let text = describe("flat", &summary).unwrap();
        for part in [
            "1 of 3 pieces",
            "left out, 2: Chair (2): --without chairs",
            "other levels: Roof",
            "note: license",
        ] {
            assert!(text.contains(part), "{part:?} in {text}");
        }
    }

    #[test]
    fn folder_without_homes_names_the_next_step() {
        let folder = tempfile::tempdir().unwrap();
        let text = list(&Store::new(vec![folder.path().into()])).unwrap();
        assert!(text.contains("wheelarm home import"), "{text}");
    }
}
