//! Writes raw images of the home for measurements of recorders.
//!
//! `dump_frames DIR [ASSETS] [FRAMES]` writes `frames.bin`: for each frame, for
//! each of the two robot cameras, color (u8 x 3), depth (f32 little-endian,
//! metres) and ids (u16), 1280x720; 10 images per second of a synthetic drive.

mod motion;

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;

use anyhow::{Context as _, Result};
use wheelarm_server::robot::RobotModel;
use wheelarm_server::scene::Scene;
use wheelarm_server::sensors::camera::{CameraSpec, Quality, RenderScene, Renderer};

fn main() -> Result<()> {
    let mut args = std::env::args_os().skip(1);
    let out = PathBuf::from(
        args.next()
            .context("usage: dump_frames DIR [ASSETS] [FRAMES]")?,
    );
    let assets = args
        .next()
        .map_or_else(|| PathBuf::from("assets"), PathBuf::from);
    let frames: usize = match args.next() {
        Some(text) => text.to_string_lossy().parse().context("number of frames")?,
        None => 40,
    };
    let robot = RobotModel::load(&assets, "wheelarm")?;
    let scene = Scene::load(&assets, "home")?;
    let cameras = CameraSpec::all(&robot, &scene, [1280, 720])?;
    let drawn = RenderScene::new(&robot, &scene, &assets)?;
    let mut renderer = Renderer::new(&drawn, &cameras[..2], Quality::Standard, None)?;
    std::fs::create_dir_all(&out)?;
    let mut file = BufWriter::new(File::create(out.join("frames.bin"))?);
    for frame in 0..frames {
        let snapshot = motion::moving(&robot, &scene, frame as f64 * 0.1);
        for image in renderer.render(&snapshot, &[0, 1])? {
            file.write_all(&image.rgb)?;
            file.write_all(&image.depth)?;
            file.write_all(&image.ids)?;
        }
    }
    file.flush()?;
    Ok(())
}
