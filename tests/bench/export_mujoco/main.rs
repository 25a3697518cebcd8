//! Writes the home and the robot for MuJoCo, as the reference of the benchmarks.
//!
//! `export_mujoco DIR [ASSETS] [PAIRS]` writes
//! - `render.xml`, its meshes and textures: everything that the cameras render,
//!   each body a mocap body, and the two robot cameras; `poses.f64`: for each of
//!   PAIRS images each mocap body's position and quaternion (w x y z);
//! - `step.xml`: robot, furniture and objects to be simulated; `targets.f64`:
//!   the controls of each tick of 1/240 s that our own control gave.

#[path = "../course/mod.rs"]
mod course;
#[path = "../motion/mod.rs"]
mod motion;
mod render;
mod step;

use std::fmt::Display;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use nalgebra::Isometry3;

fn main() -> Result<()> {
    let mut args = std::env::args_os().skip(1);
    let out = PathBuf::from(
        args.next()
            .context("usage: export_mujoco DIR [ASSETS] [PAIRS]")?,
    );
    let assets = args
        .next()
        .map_or_else(|| PathBuf::from("assets"), PathBuf::from);
    let pairs: usize = match args.next() {
        Some(text) => text.to_string_lossy().parse().context("number of pairs")?,
        None => 60,
    };
    std::fs::create_dir_all(&out)?;
    render::export(&out, &assets, pairs)?;
    step::export(&out, &assets)
}

/// Position and quaternion as MJCF attributes.
fn place(pose: &Isometry3<f64>) -> String {
    let q = pose.rotation;
    format!(
        "pos=\"{}\" quat=\"{}\"",
        numbers(pose.translation.vector.iter()),
        numbers([q.w, q.i, q.j, q.k])
    )
}

fn numbers(values: impl IntoIterator<Item = impl Display>) -> String {
    let texts: Vec<String> = values.into_iter().map(|v| v.to_string()).collect();
    texts.join(" ")
}

fn write_numbers(path: &Path, values: &[f64]) -> Result<()> {
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    std::fs::write(path, bytes).with_context(|| path.display().to_string())
}
