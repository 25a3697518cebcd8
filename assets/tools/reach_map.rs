//! Writes the reach map of every robot, `assets/robots/NAME/reach.bin`.
//!
//! `reach_map [ASSETS] [NAME...]`

use std::path::PathBuf;

use anyhow::{Context, Result};
use wheelarm_server::robot::RobotModel;

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let assets = PathBuf::from(arguments.next().unwrap_or_else(|| "assets".to_owned()));
    let mut names: Vec<String> = arguments.collect();
    if names.is_empty() {
        let folders = std::fs::read_dir(assets.join("robots")).context("cannot list the robots")?;
        let folders = folders.flatten().map(|entry| entry.path());
        let robots = folders.filter(|folder| folder.join("robot.toml").is_file());
        let name = |folder: PathBuf| Some(folder.file_name()?.to_string_lossy().into_owned());
        names = robots.filter_map(name).collect();
        names.sort();
    }
    for name in names {
        let map = RobotModel::load(&assets, &name)?.reach_map()?;
        let path = assets.join("robots").join(&name).join("reach.bin");
        let bytes = map.to_bytes();
        std::fs::write(&path, &bytes).with_context(|| path.display().to_string())?;
        println!(
            "{}: {} reached, {} bytes",
            path.display(),
            map.len(),
            bytes.len()
        );
    }
    Ok(())
}
