//! Asset files as messages: what a recording keeps of them.

use std::path::Path;

use wheelarm_proto::v1;

use crate::scene;
use crate::sim::Simulation;

/// The texts of all asset files of a simulation, read when it is set up: those
/// of the robot, of the task, of the scene.
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
    if !scenario.task.is_empty() {
        paths.push(format!("tasks/{}.toml", scenario.task));
    }
    paths.extend_from_slice(&sim.scene().files);
    let texts = scene::texts(sim.assets(), &paths).map_err(|e| e.to_string())?;
    let texts = texts.into_iter();
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
