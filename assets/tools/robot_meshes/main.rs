//! Writes the meshes of the robot: all of them computed here, none taken from
//! a maker's file. Run it again after a change and commit what it writes.
//!
//! `cargo run --release -p wheelarm-tests --example robot_meshes -- assets/robots/wheelarm/meshes`

mod arm;
mod chair;
mod gripper;
mod solid;

use std::path::PathBuf;

use anyhow::{Context as _, ensure};

fn main() -> anyhow::Result<()> {
    let folder = std::env::args()
        .nth(1)
        .map(PathBuf::from)
        .context("the folder for the meshes is missing")?;
    std::fs::create_dir_all(&folder)?;
    let meshes = arm::meshes()
        .into_iter()
        .chain(gripper::meshes())
        .chain(chair::meshes());
    let mut total = 0;
    for (name, material, solid) in meshes {
        ensure!(solid.volume() > 0.0, "{name} is inside out");
        let path = folder.join(format!("{name}.obj"));
        solid
            .write(&path)
            .with_context(|| format!("writing {}", path.display()))?;
        println!("{name:16} {material:14} {:5} triangles", solid.triangles());
        total += solid.triangles();
    }
    println!("{total} triangles");
    Ok(())
}
