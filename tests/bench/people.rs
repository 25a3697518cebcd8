//! People in the chair: their computing time, and images of them.
//!
//! `people --bench`: simulation and image rate with a person as a ratio of that
//! without, stretch by stretch in turns, in one run.
//! `people --sheet FILE.png [--camera NAME=WIDTHxHEIGHT]`: the people of `--person`,
//! each as one camera sees them, side by side.

use std::fs;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Parser;
use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use wheelarm_proto::settings::Named;
use wheelarm_proto::v1;
use wheelarm_server::people::PersonSetting;
use wheelarm_server::robot::control::{BaseIntent, ControlInput};
use wheelarm_server::sensors::camera::{
    Binding, CameraSpec, Intrinsics, Quality, RenderScene, Renderer,
};
use wheelarm_server::sim::{Scenario, Simulation};

#[derive(Parser)]
struct Options {
    /// Assets folder.
    #[arg(long, default_value = "assets")]
    assets: PathBuf,
    /// Measures.
    #[arg(long)]
    bench: bool,
    /// Rounds of the measurement.
    #[arg(long, default_value_t = 12)]
    rounds: usize,
    /// Renders into this file.
    #[arg(long)]
    sheet: Option<PathBuf>,
    /// Person, as the server's --person; may be repeated.
    #[arg(long, value_parser = v1::Person::from_text)]
    person: Vec<v1::Person>,
    /// `front`, or a camera of the robot.
    #[arg(long, default_value = "front")]
    camera: String,
    /// Pixels of one image.
    #[arg(long, default_value_t = 480)]
    width: u32,
    /// Pixels of one image.
    #[arg(long, default_value_t = 480)]
    height: u32,
    /// Columns of images.
    #[arg(long, default_value_t = 5)]
    columns: usize,
    /// Seed of the scene and of the sampled values of the person.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// fast, draft, standard or high.
    #[arg(long, default_value = "standard")]
    quality: String,
    /// Graphics adapter by a part of its name.
    #[arg(long)]
    adapter: Option<String>,
}

fn simulation(options: &Options, seed: u64, person: Option<&v1::Person>) -> Result<Simulation> {
    let setting = person.map(|p| PersonSetting {
        body: p.body.clone(),
        posture: p.posture.clone(),
        seed: p.seed,
        motion: p.motion,
        mouth_open: p.mouth_open,
        ..PersonSetting::default()
    });
    let scenario = Scenario {
        seed,
        cameras: Vec::new(),
        person: setting,
        ..Scenario::default()
    };
    Ok(Simulation::new(&options.assets, scenario)?)
}

fn renderer(options: &Options, sim: &Simulation, cameras: &[CameraSpec]) -> Result<Renderer> {
    let (model, scene) = (sim.model(), sim.scene());
    let render_scene = RenderScene::with_person(model, scene, &options.assets, None, sim.person())?;
    Ok(Renderer::new(
        &render_scene,
        cameras,
        Quality::from_name(&options.quality)?,
        options.adapter.as_deref(),
    )?)
}

/// world_from_optical of a camera at `eye` that looks at `at`.
fn looking(eye: Point3<f64>, at: Point3<f64>) -> Isometry3<f64> {
    let z = (at - eye).normalize();
    let x = z.cross(&Vector3::z()).normalize();
    let turn = Rotation3::from_basis_unchecked(&[x, z.cross(&x), z]);
    Isometry3::from_parts(
        Translation3::from(eye.coords),
        UnitQuaternion::from_rotation_matrix(&turn),
    )
}

fn bench(options: &Options) -> Result<()> {
    let any = v1::Person {
        body: "man_p50".to_owned(),
        posture: "hands_in_lap".to_owned(),
        ..v1::Person::default()
    };
    let mut sims = [
        simulation(options, options.seed, None)?,
        simulation(options, options.seed, Some(&any))?,
    ];
    let cameras = |sim: &Simulation| -> Result<Vec<CameraSpec>> {
        let mounts = sim
            .model()
            .settings
            .cameras
            .iter()
            .filter(|c| !c.on_request);
        let size = [options.width, options.height];
        let specs = mounts.map(|mount| CameraSpec::on_robot(sim.model(), mount, size));
        Ok(specs.collect::<Result<_, _>>()?)
    };
    let mut renderers = Vec::new();
    for sim in &sims {
        renderers.push(renderer(options, sim, &cameras(sim)?)?);
    }
    let (mut steps, mut images) = ([Vec::new(), Vec::new()], [Vec::new(), Vec::new()]);
    for round in 0..=options.rounds {
        // Alternate which one is first; the first round is a warm-up.
        for k in 0..2 {
            let which = (round + k) % 2;
            let sim = &mut sims[which];
            let input = ControlInput {
                base: Some(BaseIntent {
                    linear: 0.1,
                    angular: if round % 2 == 0 { 0.3 } else { -0.3 },
                }),
                ..ControlInput::default()
            };
            let begun = Instant::now();
            for _ in 0..120 {
                sim.step(&input);
            }
            let stepped = begun.elapsed().as_secs_f64();
            let begun = Instant::now();
            for _ in 0..4 {
                renderers[which].render(sim.snapshot(), &[0, 1])?;
            }
            if round > 0 {
                steps[which].push(stepped / 120.0);
                images[which].push(begun.elapsed().as_secs_f64() / 4.0);
            }
        }
    }
    let median = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    for (what, times) in [
        ("control step", &mut steps),
        ("pair of images", &mut images),
    ] {
        let [without, with] = times;
        let (without, with) = (median(without), median(with));
        println!(
            "{what}: {:.2} ms without, {:.2} ms with a person: rate {:.2} of that without",
            without * 1e3,
            with * 1e3,
            without / with
        );
    }
    Ok(())
}

fn sheet(options: &Options, file: &Path) -> Result<()> {
    let size = [options.width, options.height];
    let mut tiles = Vec::new();
    for person in &options.person {
        let sim = simulation(options, options.seed, Some(person))?;
        let (model, chair) = (sim.model(), sim.snapshot().links[0].pose);
        let camera = match options.camera.as_str() {
            "front" => CameraSpec {
                name: "front".to_owned(),
                binding: Binding::World,
                mount: looking(
                    chair * Point3::new(2.1, -0.9, 1.55),
                    chair * Point3::new(0.2, 0.05, 0.85),
                ),
                intrinsics: Intrinsics::centred(size, 0.72),
                range: [0.05, 20.0],
            },
            name => {
                let mut mounts = model.settings.cameras.iter();
                let mount = mounts.find(|c| c.name == name).context("no such camera")?;
                CameraSpec::on_robot(model, mount, size)?
            }
        };
        let mut renderer = renderer(options, &sim, &[camera])?;
        tiles.push(
            renderer
                .render(sim.snapshot(), &[0])?
                .remove(0)
                .rgb
                .to_vec(),
        );
    }
    let columns = options.columns.min(tiles.len()).max(1);
    let rows = tiles.len().div_ceil(columns);
    let [w, h] = size.map(|s| s as usize);
    let mut all = vec![255; columns * w * rows * h * 3];
    for (i, tile) in tiles.iter().enumerate() {
        let (left, top) = ((i % columns) * w, (i / columns) * h);
        for row in 0..h {
            let at = ((top + row) * columns * w + left) * 3;
            all[at..at + w * 3].copy_from_slice(&tile[row * w * 3..(row + 1) * w * 3]);
        }
    }
    write_png(file, [columns * w, rows * h].map(|s| s as u32), &all)
}

fn main() -> Result<()> {
    let options = Options::parse();
    if options.bench {
        bench(&options)?;
    }
    match &options.sheet {
        Some(file) => sheet(&options, file),
        None => Ok(()),
    }
}

fn write_png(path: &Path, [width, height]: [u32; 2], rgb: &[u8]) -> Result<()> {
    let file = fs::File::create(path).with_context(|| path.display().to_string())?;
    let mut encoder = png::Encoder::new(BufWriter::new(file), width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::Fast);
    encoder.write_header()?.write_image_data(rgb)?;
    Ok(())
}
