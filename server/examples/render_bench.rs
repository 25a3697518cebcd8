//! Milliseconds per pair of robot cameras with the whole home, pictures read
//! back into memory. The arm, the chair and an object move in every pair.
//!
//! `render_bench [--assets DIR] [--pairs N] [--width W] [--height H]
//! [--quality fast|standard|high] [--adapter NAME]`
//!
//! With `--look SEED` the same under a look of that seed, one pair by turns with
//! none: as ratios of the rate without.

#![expect(clippy::disallowed_methods, reason = "it measures wall time")]

mod motion;

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Result, bail};
use clap::Parser;
use wheelarm_server::look::{Drawn, Look};
use wheelarm_server::robot::RobotModel;
use wheelarm_server::scene::Scene;
use wheelarm_server::sensors::camera::{CameraSpec, Quality, RenderScene, Renderer};

#[derive(Parser)]
struct Options {
    /// Folder with robots, scenes, objects and materials.
    #[arg(long, default_value = "assets")]
    assets: PathBuf,
    /// Pairs that count; five more warm up.
    #[arg(long, default_value_t = 60)]
    pairs: usize,
    /// Pixels.
    #[arg(long, default_value_t = 1280)]
    width: u32,
    /// Pixels.
    #[arg(long, default_value_t = 720)]
    height: u32,
    /// fast, standard or high.
    #[arg(long, default_value = "standard")]
    quality: String,
    /// Part of an adapter's name.
    #[arg(long)]
    adapter: Option<String>,
    /// Seed of a look to compare with none.
    #[arg(long)]
    look: Option<u64>,
    /// Strength of its axes, 1 to 3.
    #[arg(long, default_value_t = 2)]
    strength: u8,
}

fn main() -> Result<()> {
    let options = Options::parse();
    let quality = match options.quality.as_str() {
        "fast" => Quality::Fast,
        "standard" => Quality::Standard,
        "high" => Quality::High,
        other => bail!("quality is '{other}', expected fast, standard or high"),
    };
    let robot = RobotModel::load(&options.assets, "wheelarm")?;
    let scene = Scene::load(&options.assets, "home")?;
    if let Some(seed) = options.look {
        return compare(&options, quality, &robot, &scene, seed);
    }
    let started = Instant::now();
    let render_scene = RenderScene::new(&robot, &scene, &options.assets)?;
    let cameras = CameraSpec::all(&robot, &scene, [options.width, options.height])?;
    let mut renderer = Renderer::new(
        &render_scene,
        &cameras[..2],
        quality,
        options.adapter.as_deref(),
    )?;
    let triangles: usize = render_scene
        .items
        .iter()
        .map(|i| i.mesh.indices.len() / 3)
        .sum();
    println!(
        "{}\n{triangles} triangles, {} meshes, {} bodies, ready after {:.2} s",
        renderer.adapter(),
        render_scene.items.len(),
        render_scene.instances.len(),
        started.elapsed().as_secs_f64()
    );

    let mut times = Vec::with_capacity(options.pairs);
    let mut bytes = 0;
    let mut processor = Vec::with_capacity(options.pairs);
    for pair in 0..options.pairs + 5 {
        let snapshot = motion::moving(&robot, &scene, pair as f64 * 0.1);
        let cpu = cpu_seconds();
        let before = Instant::now();
        let frames = renderer.render(&snapshot, &[0, 1])?;
        let taken = before.elapsed().as_secs_f64() * 1e3;
        bytes = frames
            .iter()
            .map(|f| f.rgb.len() + f.depth.len() + f.ids.len())
            .sum();
        if pair >= 5 {
            times.push(taken);
            processor.push((cpu_seconds() - cpu) * 1e3);
        }
    }
    processor.sort_by(f64::total_cmp);
    let (least_cpu, cpu) = (processor[0], processor[processor.len() / 2]);
    times.sort_by(f64::total_cmp);
    let (least, median) = (times[0], times[times.len() / 2]);
    println!(
        "two cameras {}x{}, {} quality, {:.1} MB per pair: min {least:.1} ms ({:.1} pairs/s), \
         median {median:.1} ms ({:.1} pairs/s), processor time {cpu:.1} ms (least {least_cpu:.1})",
        options.width,
        options.height,
        options.quality,
        bytes as f64 * 1e-6,
        1e3 / least,
        1e3 / median
    );

    // As the server draws when it is behind: the next pair is begun before this
    // one is read.
    let snapshots: Vec<_> = (0..=options.pairs)
        .map(|pair| motion::moving(&robot, &scene, pair as f64 * 0.1))
        .collect();
    renderer.submit(&snapshots[0], &[0, 1])?;
    let before = Instant::now();
    for snapshot in &snapshots[1..] {
        renderer.submit(snapshot, &[0, 1])?;
        renderer.collect()?;
    }
    let rate = options.pairs as f64 / before.elapsed().as_secs_f64();
    renderer.collect()?;
    println!("one pair ahead: {rate:.1} pairs/s");
    Ok(())
}

/// Pairs without a look, with one, and with one whose glass and metal are drawn
/// as without, by turns.
fn compare(
    options: &Options,
    quality: Quality,
    robot: &RobotModel,
    scene: &Scene,
    seed: u64,
) -> Result<()> {
    let s = options.strength;
    let look = Look {
        seed,
        light: s,
        background: s,
        materials: s,
        exposure: s,
        decoration: s,
        ..Look::default()
    };
    let look = Drawn::new(look, scene, &options.assets)?;
    let plain = RenderScene::new(robot, scene, &options.assets)?;
    let seen = RenderScene::with_look(robot, scene, &options.assets, Some(&look))?;
    let mut dull = seen.clone();
    for item in &mut dull.items {
        item.material.transmission = 0.0;
        item.material.metallic = item.material.metallic.min(0.45);
    }
    let cameras = CameraSpec::all(robot, scene, [options.width, options.height])?;
    let kinds = [
        ("no look", plain),
        ("look", seen),
        ("look, no glass or mirror", dull),
    ];
    let mut renderers = Vec::new();
    for (name, scene) in &kinds {
        let adapter = options.adapter.as_deref();
        let started = Instant::now();
        let renderer = Renderer::new(scene, &cameras[..2], quality, adapter)?;
        println!(
            "{name}: ready after {:.2} s",
            started.elapsed().as_secs_f64()
        );
        renderers.push((renderer, Vec::new()));
    }
    for pair in 0..options.pairs + 5 {
        let snapshot = motion::moving(robot, scene, pair as f64 * 0.1);
        for (renderer, times) in &mut renderers {
            let before = Instant::now();
            renderer.render(&snapshot, &[0, 1])?;
            if pair >= 5 {
                times.push(before.elapsed().as_secs_f64() * 1e3);
            }
        }
    }
    let of = |times: &[f64]| {
        let mut sorted = times.to_vec();
        sorted.sort_by(f64::total_cmp);
        [sorted[0], sorted[sorted.len() / 2]]
    };
    let [least, median] = of(&renderers[0].1);
    for ((name, _), (_, times)) in kinds.iter().zip(&renderers) {
        let [own_least, own_median] = of(times);
        println!(
            "{name}: min {own_least:.1} ms, median {own_median:.1} ms; rate {:.3} (min), {:.3} \
             (median) of that without a look",
            least / own_least,
            median / own_median
        );
    }
    Ok(())
}

/// Processor time of this process, all threads, in seconds; 0 where the system
/// does not say.
fn cpu_seconds() -> f64 {
    let Ok(threads) = std::fs::read_dir("/proc/self/task") else {
        return 0.0;
    };
    let nanos: f64 = threads
        .flatten()
        .filter_map(|thread| std::fs::read_to_string(thread.path().join("schedstat")).ok())
        .filter_map(|stat| stat.split_whitespace().next()?.parse::<f64>().ok())
        .sum();
    nanos * 1e-9
}
