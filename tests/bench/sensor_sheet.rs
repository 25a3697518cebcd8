//! Compares sensor models with exact images: for each camera of the robot exact color,
//! sensor color, exact depth and sensor depth side by side, as one JPEG or PNG file; and
//! prints the computing time of each model.
//!
//! `sensor_sheet [--assets DIR] [--out FILE] [--task NAME] [--seed N]
//! [--strength S] [--width W] [--height H]`

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Parser;
use jpeg_encoder::{ColorType, Encoder};
use nalgebra::{Isometry3, Translation3};
use wheelarm_sensor_models::color::ColorModel;
use wheelarm_sensor_models::depth::DepthModel;
use wheelarm_sensor_models::{Exact, Lens, Model};
use wheelarm_server::robot::control::ControlInput;
use wheelarm_server::sensors::camera::{CameraSpec, Frame, Quality, RenderScene, Renderer};
use wheelarm_server::sensors::models::{depth_name, depth_view, surfaces};
use wheelarm_server::sim::{Scenario, Simulation};

#[derive(Parser)]
struct Options {
    /// Folder with robots, scenes, objects and materials.
    #[arg(long, default_value = "assets")]
    assets: PathBuf,
    /// The file.
    #[arg(long, default_value = "sensors.jpg")]
    out: PathBuf,
    /// Task whose sampled scene is shown, with the chair in front of its area.
    #[arg(long, default_value = "pick_glass_bottle")]
    task: String,
    /// Seed of the scene and of the noise.
    #[arg(long, default_value_t = 3)]
    seed: u64,
    /// Strength of the models, 0 to 3.
    #[arg(long, default_value_t = 1.0)]
    strength: f64,
    /// Width of the exact images, pixels.
    #[arg(long, default_value_t = 1280)]
    width: u32,
    /// Their height, pixels.
    #[arg(long, default_value_t = 720)]
    height: u32,
}

/// Size of an image on the sheet, pixels.
const TILE: [usize; 2] = [480, 270];

/// Cameras, and the model that is on each.
const PAIRS: [(&str, &str); 2] = [("gen3", "kinova_vision"), ("wheelchair", "chair_stereo")];

/// Images before the shown one, in which exposure and encoder settle.
const BEFORE: u64 = 20;

fn main() -> Result<()> {
    let options = Options::parse();
    let sim = before_area(&options)?;
    let size = [options.width, options.height];
    let mut cameras = CameraSpec::all(sim.model(), sim.scene(), size)?;
    cameras.retain(|camera| PAIRS.iter().any(|(name, _)| *name == camera.name));
    let mut models = Vec::new();
    for (camera, model) in PAIRS {
        let file = format!("sensors/{model}.toml");
        let text = std::fs::read_to_string(options.assets.join(&file))?;
        let model = Model::read(&file, &text)?;
        let spec = cameras.iter().find(|spec| spec.name == camera);
        let spec = spec.with_context(|| format!("no camera {camera}"))?;
        let depth = model.depth.as_ref().context("no depth")?;
        cameras.push(depth_view(spec, depth));
        models.push(model);
    }
    let drawn = RenderScene::new(sim.model(), sim.scene(), &options.assets)?;
    let surfaces = surfaces(&options.assets, &drawn)?;
    let mut renderer = Renderer::new(&drawn, &cameras, Quality::Standard, None)?;
    let all: Vec<usize> = (0..cameras.len()).collect();
    let began = Instant::now();
    let frames = renderer.render(sim.snapshot(), &all)?;
    println!("drawing: {:.1} ms", began.elapsed().as_secs_f64() * 1e3);

    let mut sheet = vec![255; 3 * 4 * TILE[0] * PAIRS.len() * TILE[1]];
    for (row, ((camera, _), model)) in PAIRS.into_iter().zip(models).enumerate() {
        let frame_of = |name: &str| {
            let index = cameras.iter().position(|c| c.name == name);
            let frame = frames.iter().find(|frame| Some(frame.camera) == index);
            frame.with_context(|| format!("no image of {name}"))
        };
        let (frame, depth_frame) = (frame_of(camera)?, frame_of(&depth_name(camera))?);
        let mut color = ColorModel::new(
            model.color.context("no colour")?,
            options.seed,
            options.strength,
        );
        let depth = DepthModel::new(
            model.depth.context("no depth")?,
            options.seed,
            options.strength,
        );
        let lens = depth.parameters().lens;
        let (mut sensed, mut measured) = (Vec::new(), Vec::new());
        let mut took = [0.0; 2];
        for tick in 0..=BEFORE {
            let exact = exact(frame, tick);
            let began = Instant::now();
            sensed = color.image(&exact);
            took[0] += began.elapsed().as_secs_f64() * 1e3 / (BEFORE + 1) as f64;
            let began = Instant::now();
            measured = depth.image(&self::exact(depth_frame, tick), &surfaces);
            took[1] += began.elapsed().as_secs_f64() * 1e3 / (BEFORE + 1) as f64;
        }
        let returns = measured.chunks_exact(2).filter(|p| p != &[0, 0]).count();
        println!(
            "{camera}: colour {:.1} ms, depth {:.1} ms, returns at {:.0} % of its pixels",
            took[0],
            took[1],
            100.0 * returns as f64 / (lens.width * lens.height) as f64
        );
        let whole = [frame.intrinsics.width, frame.intrinsics.height].map(|v| v as usize);
        let exact_depth = frame.depth.chunks_exact(4).flat_map(|b| {
            let z = f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
            depth_color(z)
        });
        let sensed_depth = measured.chunks_exact(2).flat_map(|b| {
            let mm = u16::from_le_bytes([b[0], b[1]]);
            depth_color(if mm == 0 {
                f32::INFINITY
            } else {
                f32::from(mm) * 1e-3
            })
        });
        let tiles = [
            (frame.rgb.to_vec(), whole),
            (sensed, whole),
            (exact_depth.collect(), whole),
            (sensed_depth.collect(), [lens.width, lens.height]),
        ];
        for (column, (image, size)) in tiles.iter().enumerate() {
            put(&mut sheet, [column, row], image, *size);
        }
    }
    let [width, height] = [4 * TILE[0], PAIRS.len() * TILE[1]];
    if options.out.extension().is_some_and(|e| e == "png") {
        let file = std::io::BufWriter::new(std::fs::File::create(&options.out)?);
        let mut encoder = png::Encoder::new(file, width as u32, height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.write_header()?.write_image_data(&sheet)?;
    } else {
        Encoder::new_file(&options.out, 82)?.encode(
            &sheet,
            width as u16,
            height as u16,
            ColorType::Rgb,
        )?;
    }
    println!("{}", options.out.display());
    Ok(())
}

/// The sampled scene of a task with the chair in front of its area, one second after
/// the start.
fn before_area(options: &Options) -> Result<Simulation> {
    let scenario = Scenario {
        task: options.task.clone(),
        seed: options.seed,
        cameras: Vec::new(),
        ..Scenario::default()
    };
    let sim = Simulation::new(&options.assets, scenario.clone())?;
    let area = sim.task().map(|t| t.area.name.clone()).unwrap_or_default();
    let mut surfaces = sim.scene().surfaces.iter();
    let surface = surfaces
        .find(|s| sim.scene().furniture[s.furniture].area == area)
        .context("the area has no surface")?;
    let chair = surface.edge * Isometry3::translation(-0.90, -0.36, 0.0);
    let at = chair.translation;
    let start = Isometry3::from_parts(Translation3::new(at.x, at.y, 0.0), chair.rotation);
    let start = Some(start);
    let mut sim = Simulation::new(&options.assets, Scenario { start, ..scenario })?;
    for _ in 0..60 {
        sim.step(&ControlInput::default());
    }
    Ok(sim)
}

fn exact(frame: &Frame, tick: u64) -> Exact<'_> {
    let i = &frame.intrinsics;
    Exact {
        lens: Lens {
            width: i.width as usize,
            height: i.height as usize,
            focal: [i.fx, i.fy],
            principal: [i.cx, i.cy],
        },
        tick,
        rgb: &frame.rgb,
        depth: &frame.depth,
        ids: &frame.ids,
    }
}

/// Red near, blue far, black where nothing is.
fn depth_color(z: f32) -> [u8; 3] {
    if !z.is_finite() {
        return [0; 3];
    }
    let t = 1.0 / (1.0 + z / 1.5);
    let byte = |x: f32| (x.clamp(0.0, 1.0) * 255.0) as u8;
    [
        byte(1.6 * t - 0.1),
        byte(1.3 * t),
        byte(0.75 - 0.9 * (t - 0.35).abs() * 1.6),
    ]
}

/// Copies an image to its place on the sheet, scaled by nearest pixel.
fn put(sheet: &mut [u8], [column, row]: [usize; 2], image: &[u8], [w, h]: [usize; 2]) {
    let width = 4 * TILE[0];
    for y in 0..TILE[1] - 4 {
        for x in 0..TILE[0] - 4 {
            let from = 3 * ((y * h / TILE[1]) * w + x * w / TILE[0]);
            let to = 3 * ((row * TILE[1] + y) * width + column * TILE[0] + x);
            sheet[to..to + 3].copy_from_slice(&image[from..from + 3]);
        }
    }
}
