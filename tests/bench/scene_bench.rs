//! Milliseconds of each step from the samples of an episode to its first image, for the
//! episodes of a campaign in one process, and a checksum of the images.
//!
//! `scene_bench [--assets DIR] [--task NAME]... [--episodes N] [--width W] [--height H]
//! [--quality fast|draft|standard|high] [--appearance STRENGTH] [--person] [--cache DIR] [--adapter NAME]`
//!
//! Equal checksums of two builds mean equal bytes of color, depth and ids.

use std::hash::{DefaultHasher, Hasher};
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Parser;
use wheelarm_proto::cache::{self, Store};
use wheelarm_proto::settings::Named;
use wheelarm_server::appearance::{Appearance, SampledAppearance};
use wheelarm_server::people::PersonSetting;
use wheelarm_server::sensors::camera::{CameraSpec, Graphics, Quality, RenderScene, Renderer};
use wheelarm_server::sim::{Scenario, Simulation};

#[derive(Parser)]
struct Options {
    /// Folder with robots, scenes, objects and materials.
    #[arg(long, default_value = "assets")]
    assets: PathBuf,
    /// Tasks of the episodes, one after the other.
    #[arg(long, default_value = "pick_mustard")]
    task: Vec<String>,
    /// Episodes, with the seeds from 0 on.
    #[arg(long, default_value_t = 8)]
    episodes: u64,
    /// Pixels.
    #[arg(long, default_value_t = 224)]
    width: u32,
    /// Pixels.
    #[arg(long, default_value_t = 126)]
    height: u32,
    /// fast, draft, standard or high.
    #[arg(long, default_value = "standard", value_parser = quality)]
    quality: Quality,
    /// Strength of the axes of an appearance that the seed samples; 0 for none.
    #[arg(long, default_value_t = 0)]
    appearance: u8,
    /// A person in the chair, sampled by the seed.
    #[arg(long)]
    person: bool,
    /// Folder of the cache on disk; none when absent.
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
    /// Part of an adapter's name.
    #[arg(long)]
    adapter: Option<String>,
}

fn quality(name: &str) -> Result<Quality, String> {
    Quality::from_name(name).map_err(|error| error.to_string())
}

const STEPS: [&str; 5] = ["simulation", "appearance", "scene", "renderer", "images"];

fn main() -> Result<()> {
    let options = Options::parse();
    let store = Store::at(options.cache.clone(), cache::LIMIT);
    let graphics = Graphics::for_adapter(options.adapter.as_deref()).caching(store);
    println!("episode {} checksum", STEPS.join(" "));
    let mut later: Vec<[f64; STEPS.len()]> = Vec::new();
    for seed in 0..options.episodes {
        let (times, checksum) = episode(&options, &graphics, seed)?;
        let text = times.map(|ms| format!("{ms:.1}")).join(" ");
        println!("{seed} {text} {checksum:016x}");
        if seed > 0 {
            later.push(times);
        }
    }
    let median = |values: &mut dyn Iterator<Item = f64>| {
        let mut values: Vec<f64> = values.collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
    };
    for (k, step) in STEPS.iter().enumerate() {
        let ms = median(&mut later.iter().map(|times| times[k]));
        println!("later episodes: {step} {ms:.1} ms (median)");
    }
    let all = median(&mut later.iter().map(|times| times[1..].iter().sum()));
    println!("later episodes: appearance to images {all:.1} ms (median)");
    Ok(())
}

/// Milliseconds of each step, and the checksum of the images.
fn episode(options: &Options, graphics: &Graphics, seed: u64) -> Result<([f64; STEPS.len()], u64)> {
    let index = usize::try_from(seed)? % options.task.len();
    let strength = options.appearance;
    let appearance = (strength > 0).then_some(Appearance {
        seed,
        light: strength,
        background: strength,
        materials: strength,
        exposure: strength,
        decoration: strength,
        ..Appearance::default()
    });
    let scenario = Scenario {
        task: options.task[index].clone(),
        seed,
        cameras: Vec::new(),
        appearance,
        person: options.person.then(PersonSetting::default),
        ..Scenario::default()
    };
    let mut times = [0.0; STEPS.len()];
    let mut begun = Instant::now();
    let mut step = 0;
    let mut took = || {
        times[step] = begun.elapsed().as_secs_f64() * 1e3;
        step += 1;
        begun = Instant::now();
    };
    let sim = Simulation::new(&options.assets, scenario)?;
    took();
    let appearance = appearance
        .map(|appearance| SampledAppearance::new(appearance, sim.scene(), &options.assets))
        .transpose()?;
    took();
    let scene = RenderScene::with_meshes(
        sim.model(),
        sim.scene(),
        &options.assets,
        (appearance.as_ref(), sim.person()),
        graphics.meshes(),
    )?;
    took();
    let cameras = CameraSpec::all(sim.model(), sim.scene(), [options.width, options.height])?;
    let mut renderer = Renderer::over(graphics, &scene, &cameras[..2], options.quality)?;
    took();
    let frames = renderer.render(sim.snapshot(), &[0, 1])?;
    took();
    let mut hash = DefaultHasher::new();
    for frame in &frames {
        hash.write(&frame.rgb);
        hash.write(&frame.depth);
        hash.write(&frame.ids);
    }
    frames.first().context("no image")?;
    Ok((times, hash.finish()))
}
