//! Renders one instant under many appearances into one image: the start of a task, with
//! the chair in front of its area, from a camera in the room.
//!
//! `appearances_sheet OUT.jpg|OUT.png [--assets DIR] [--task NAME] [--view table|room|close]
//! [--strength 1|2|3] [--first-look N] [--columns N] [--rows N] [--width W]
//! [--quality fast|draft|standard|high]`

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Parser;
use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use wheelarm_proto::settings::{Named, Quality};
use wheelarm_server::appearance::{Appearance, SampledAppearance};
use wheelarm_server::robot::control::ControlInput;
use wheelarm_server::sensors::camera::{Binding, CameraSpec, Intrinsics, RenderScene, Renderer};
use wheelarm_server::sim::{Scenario, Simulation};

#[derive(Parser)]
struct Options {
    /// JPEG or PNG file.
    out: PathBuf,
    /// Folder with robots, scenes, objects and materials.
    #[arg(long, default_value = "assets")]
    assets: PathBuf,
    /// Task whose start is rendered.
    #[arg(long, default_value = "pick_mustard")]
    task: String,
    /// `table`: the task's area; `close`: its target; `room`.
    #[arg(long, default_value = "table")]
    view: String,
    /// Strength of every axis except the cameras'; 0 for the plain appearance.
    #[arg(long, default_value_t = 2)]
    strength: u8,
    /// Seed of the first appearance.
    #[arg(long, default_value_t = 1)]
    first_look: u64,
    /// Columns of images.
    #[arg(long, default_value_t = 4)]
    columns: u32,
    /// Rows of images.
    #[arg(long, default_value_t = 4)]
    rows: u32,
    /// Width of one image, pixels.
    #[arg(long, default_value_t = 400)]
    width: u32,
    /// fast, draft, standard or high.
    #[arg(long, default_value = "high")]
    quality: String,
}

fn main() -> Result<()> {
    let options = Options::parse();
    let quality = Quality::from_name(&options.quality)?;
    let (sim, area) = parked(&options)?;
    let size = [options.width, options.width * 9 / 16];
    let free = |eye: Point3<f64>, target: Point3<f64>| CameraSpec {
        name: "sheet".into(),
        binding: Binding::World,
        mount: looking(eye, target),
        intrinsics: Intrinsics::centred(size, 1.1),
        range: [0.05, 100.0],
    };
    let camera = match options.view.as_str() {
        "room" => CameraSpec::room(sim.scene(), size),
        "table" => free(
            area * Point3::new(-0.75, 0.9, 0.75),
            area * Point3::new(0.35, -0.15, -0.1),
        ),
        "close" => {
            // Half a metre before what the task is about, from the side of the chair.
            let aim = sim.scene().object_named(&sim.scenario().target);
            let aim = aim.context("the task is about no object")?;
            let at = sim.snapshot().objects[aim].pose.translation.vector;
            let target = Point3::from(at + Vector3::z() * 0.1);
            free(
                target + area.rotation * Vector3::new(-0.42, 0.22, 0.16),
                target,
            )
        }
        other => bail!("view is {other:?}, expected table, close or room"),
    };
    let [w, h] = size.map(|side| side as usize);
    let row = w * options.columns as usize;
    let mut sheet = vec![0; row * h * options.rows as usize * 3];
    for i in 0..options.columns * options.rows {
        let appearance = Appearance {
            seed: options.first_look + u64::from(i),
            light: options.strength,
            background: options.strength,
            materials: options.strength,
            exposure: options.strength,
            decoration: options.strength,
            ..Appearance::default()
        };
        let appearance = (!appearance.is_plain())
            .then(|| SampledAppearance::new(appearance, sim.scene(), &options.assets))
            .transpose()?;
        let scene = RenderScene::with_appearance(
            sim.model(),
            sim.scene(),
            &options.assets,
            appearance.as_ref(),
        )?;
        let mut renderer = Renderer::new(&scene, std::slice::from_ref(&camera), quality, None)?;
        let frames = renderer.render(sim.snapshot(), &[0])?;
        let frame = frames.first().context("an image")?;
        let (x, y) = (
            (i % options.columns) as usize,
            (i / options.columns) as usize,
        );
        for (line, pixels) in frame.rgb.chunks_exact(w * 3).enumerate() {
            let at = ((y * h + line) * row + x * w) * 3;
            sheet[at..at + w * 3].copy_from_slice(pixels);
        }
        let clipped = frame.rgb.iter().filter(|c| **c >= 254).count();
        let black = frame.rgb.iter().filter(|c| **c <= 1).count();
        let share = |n: usize| 100.0 * n as f64 / frame.rgb.len() as f64;
        println!(
            "look {}: {:.3} % of the values are white, {:.3} % black",
            options.first_look + u64::from(i),
            share(clipped),
            share(black)
        );
    }
    let height = h * options.rows as usize;
    save(&options.out, [row, height], &sheet)?;
    println!("{}", options.out.display());
    Ok(())
}

/// As JPEG, or as PNG where the name ends so.
fn save(path: &Path, [width, height]: [usize; 2], rgb: &[u8]) -> Result<()> {
    let [width, height] = [u16::try_from(width)?, u16::try_from(height)?];
    if path.extension().is_some_and(|ending| ending == "png") {
        let file = std::io::BufWriter::new(std::fs::File::create(path)?);
        let mut encoder = png::Encoder::new(file, width.into(), height.into());
        encoder.set_color(png::ColorType::Rgb);
        encoder.write_header()?.write_image_data(rgb)?;
        return Ok(());
    }
    let encoder = jpeg_encoder::Encoder::new_file(path, 84)?;
    encoder.encode(rgb, width, height, jpeg_encoder::ColorType::Rgb)?;
    Ok(())
}

/// The task's start with the chair before its area, a second after it, and where
/// the area is: at the edge that is approached, x inwards.
fn parked(options: &Options) -> Result<(Simulation, Isometry3<f64>)> {
    let scenario = Scenario {
        task: options.task.clone(),
        cameras: Vec::new(),
        ..Scenario::default()
    };
    let sim = Simulation::new(&options.assets, scenario.clone())?;
    let area = sim.task().map(|t| t.area.name.clone()).unwrap_or_default();
    let mut surfaces = sim.scene().surfaces.iter();
    let surface = surfaces
        .find(|s| sim.scene().furniture[s.furniture].area == area)
        .context("the area has no surface")?
        .edge;
    let chair = surface * Isometry3::translation(-0.90, -0.36, 0.0);
    let at = Translation3::new(chair.translation.x, chair.translation.y, 0.0);
    let mut sim = Simulation::new(
        &options.assets,
        Scenario {
            start: Some(Isometry3::from_parts(at, chair.rotation)),
            ..scenario
        },
    )?;
    for _ in 0..60 {
        sim.step(&ControlInput::default());
    }
    Ok((sim, surface))
}

fn looking(eye: Point3<f64>, target: Point3<f64>) -> Isometry3<f64> {
    let z = (target - eye).normalize();
    let x = z.cross(&Vector3::z()).normalize();
    let turn = Rotation3::from_basis_unchecked(&[x, z.cross(&x), z]);
    let turn = UnitQuaternion::from_rotation_matrix(&turn);
    Isometry3::from_parts(eye.coords.into(), turn)
}
