//! Asset files as messages: the texts stored with recordings, and the list of tasks.

use std::path::Path;

use wheelarm_proto::v1;

use super::convert;
use crate::people;
use crate::robot::CorridorSettings;
use crate::scene::{self, Scene};
use crate::sensors::models;
use crate::sim::Simulation;
use crate::tasks::{self, ConditionSpec};

/// Every usable task below the assets folder and of the pack of `scene`, by name, for a robot
/// with this hand. Needs no simulation.
///
/// # Errors
/// When the folder cannot be read.
pub fn tasks(
    assets: &Path,
    scene: Option<&Scene>,
    hand: &CorridorSettings,
) -> Result<Vec<v1::TaskInfo>, String> {
    let tasks = tasks::usable(assets, scene, hand).map_err(|e| e.to_string())?;
    Ok(tasks
        .into_iter()
        .map(|t| v1::TaskInfo {
            predicates: t.conditions.iter().map(ConditionSpec::label).collect(),
            variants: t.variants().map(|v| v.name.clone()).collect(),
            goal: convert::goal_kind(&t.goal).into(),
            area: match t.is_query() {
                true => String::new(),
                false => t.area.name,
            },
            name: t.name,
            activity: t.activity,
            instructions: t.instructions,
            targets: t.targets,
        })
        .collect())
}

/// Texts of all asset files of a simulation: robot, task, scene and sensor models. Read
/// when the simulation is set up.
///
/// # Errors
/// When a file cannot be read.
pub(super) fn texts(sim: &Simulation) -> Result<Vec<v1::AssetText>, String> {
    let scenario = sim.scenario();
    let robot = format!("robots/{}", scenario.robot);
    let mut paths: Vec<_> = robot_files(&sim.assets().join(&robot))
        .into_iter()
        .map(|file| format!("{robot}/{file}"))
        .collect();
    if let Some(task) = sim.task() {
        paths.extend_from_slice(&task.files);
        paths.push(format!("templates/{}.toml", task.template));
    }
    paths.extend_from_slice(&sim.scene().files);
    paths.extend(models::files(&scenario.sensors));
    if let Some(person) = sim.person() {
        paths.extend(people::files(&person.drawn));
    }
    // A pack is stored whole; texts about it are listed for readers of texts.
    let pack = sim.scene().pack.as_deref();
    let (packed, paths): (Vec<_>, Vec<_>) = paths
        .into_iter()
        .partition(|path| pack.is_some_and(|pack| pack.file(path).is_some()));
    let packed = packed.into_iter().map(|path| scene::AssetText {
        text: pack
            .and_then(|pack| pack.file(&path))
            .map(|bytes| String::from_utf8_lossy(bytes).into_owned())
            .unwrap_or_default(),
        path,
    });
    let texts = scene::texts(sim.assets(), &paths).map_err(|e| e.to_string())?;
    let scene_texts = sim.scene().packed_texts();
    let texts = texts.into_iter().chain(packed).chain(scene_texts);
    Ok(texts
        .map(|a| v1::AssetText {
            path: a.path,
            text: a.text,
        })
        .collect())
}

/// The URDF and TOML files of a robot folder, by name.
fn robot_files(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.filter_map(|e| e.file_name().into_string().ok());
    let mut names: Vec<_> = names
        .filter(|n| n.ends_with(".urdf") || n.ends_with(".toml"))
        .collect();
    names.sort();
    names
}
