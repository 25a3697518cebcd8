//! Milliseconds per pair of robot cameras with the whole home, with images
//! read back into memory. The arm, the chair and an object move in every pair.
//!
//! `render_bench [--assets DIR] [--pairs N] [--width W] [--height H]
//! [--quality fast|draft|standard|high] [--adapter NAME] [--packing adapter|processor]`
//!
//! With `--appearance SEED` the same under an appearance of that seed, one pair at a time in turn with
//! none: as ratios of the rate without.
//!
//! `--packing` chooses where images are packed; the default is that of the server. With
//! `--compare-packing` both run, in alternation, and must return the same bytes, except
//! for single pixels of coincident surfaces.
//!
//! With `--compare-quality QUALITY` also that quality, in alternation: as ratios of the
//! rate and of the processor time, under the appearance of `--appearance` where that is given.
//!
//! With `--parts` also prints the adapter's time for each part of a pair; with
//! `--renderers N` N threads render on one device at the same time.
//!
//! With `--deflate [f32|u16|none]`, the stored format of depth, a second run compresses
//! the images on the adapter, and their size is printed too.

mod motion;

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Result, bail};
use clap::Parser;
use wheelarm_proto::settings::{Depth, Named};
use wheelarm_server::appearance::{Appearance, SampledAppearance};
use wheelarm_server::robot::RobotModel;
use wheelarm_server::scene::Scene;
use wheelarm_server::sensors::camera::{
    CameraSpec, Graphics, Packing, Quality, RenderScene, Renderer,
};
use wheelarm_server::snapshot::Snapshot;

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
    /// fast, draft, standard or high.
    #[arg(long, default_value = "standard", value_parser = quality)]
    quality: Quality,
    /// The quality to compare with.
    #[arg(long, value_parser = quality)]
    compare_quality: Option<Quality>,
    /// Part of an adapter's name.
    #[arg(long)]
    adapter: Option<String>,
    /// Seed of an appearance to compare with none.
    #[arg(long)]
    appearance: Option<u64>,
    /// Strength of its axes, 1 to 3.
    #[arg(long, default_value_t = 2)]
    strength: u8,
    /// Where images are packed: adapter or processor.
    #[arg(long)]
    packing: Option<String>,
    /// Both, in alternation.
    #[arg(long)]
    compare_packing: bool,
    /// Time of each part on the adapter, if it supports timestamps; then no pair is
    /// rendered ahead.
    #[arg(long)]
    parts: bool,
    /// Threads that render pairs ahead on one device.
    #[arg(long, default_value_t = 1)]
    renderers: usize,
    /// Also compressed by the adapter, depth kept as f32, u16 or none.
    #[arg(long, value_name = "DEPTH", num_args = 0..=1, default_missing_value = "f32",
          value_parser = |name: &str| Depth::from_name(name).map_err(|e| e.to_string()))]
    deflate: Option<Depth>,
}

fn quality(name: &str) -> Result<Quality, String> {
    Quality::from_name(name).map_err(|error| error.to_string())
}

impl Options {
    fn packing(&self) -> Result<Option<Packing>> {
        Ok(match self.packing.as_deref() {
            None => None,
            Some("adapter") => Some(Packing::Adapter),
            Some("processor") => Some(Packing::Processor),
            Some(other) => bail!("packing is '{other}', expected adapter or processor"),
        })
    }

    fn graphics(&self, packing: Option<Packing>) -> Graphics {
        let mut graphics = Graphics::for_adapter(self.adapter.as_deref());
        if let Some(packing) = packing {
            graphics = graphics.packing(packing);
        }
        match self.parts {
            true => graphics.timed(),
            false => graphics,
        }
    }

    /// A renderer of the first two cameras.
    fn renderer(
        &self,
        scene: &RenderScene,
        cameras: &[CameraSpec],
        quality: Quality,
        packing: Option<Packing>,
    ) -> Result<Renderer> {
        let graphics = self.graphics(packing);
        Ok(Renderer::over(&graphics, scene, &cameras[..2], quality)?)
    }
}

fn main() -> Result<()> {
    let options = Options::parse();
    let quality = options.quality;
    let robot = RobotModel::load(&options.assets, "wheelarm")?;
    let scene = Scene::load(&options.assets, "home")?;
    if let Some(other) = options.compare_quality {
        return compare_quality(&options, [other, quality], &robot, &scene);
    }
    if options.compare_packing {
        return compare_packing(&options, quality, &robot, &scene);
    }
    if options.renderers > 1 {
        return many(&options, quality, &robot, &scene);
    }
    if let Some(seed) = options.appearance {
        return compare(&options, quality, &robot, &scene, seed);
    }
    let started = Instant::now();
    let render_scene = RenderScene::new(&robot, &scene, &options.assets)?;
    let cameras = CameraSpec::all(&robot, &scene, [options.width, options.height])?;
    let mut renderer = options.renderer(&render_scene, &cameras, quality, options.packing()?)?;
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
        options.quality.name(),
        bytes as f64 * 1e-6,
        1e3 / least,
        1e3 / median
    );

    ahead(&mut renderer, &robot, &scene, options.pairs, None)?;
    if options.deflate.is_some() {
        renderer.deflate(0, options.deflate);
        renderer.deflate(1, options.deflate);
        ahead(
            &mut renderer,
            &robot,
            &scene,
            options.pairs,
            options.deflate,
        )?;
    }
    Ok(())
}

/// Images per second of several renderers on one device.
fn many(options: &Options, quality: Quality, robot: &RobotModel, scene: &Scene) -> Result<()> {
    let render_scene = RenderScene::new(robot, scene, &options.assets)?;
    let cameras = CameraSpec::all(robot, scene, [options.width, options.height])?;
    let graphics = options.graphics(options.packing()?);
    let mut renderers = Vec::new();
    for _ in 0..options.renderers {
        let mut renderer = Renderer::over(&graphics, &render_scene, &cameras[..2], quality)?;
        renderer.deflate(0, options.deflate);
        renderer.deflate(1, options.deflate);
        renderers.push(renderer);
    }
    let before = Instant::now();
    std::thread::scope(|threads| -> Result<()> {
        let mut drawing = Vec::new();
        for renderer in &mut renderers {
            let pairs = options.pairs;
            let draw = move || ahead(renderer, robot, scene, pairs, options.deflate);
            drawing.push(threads.spawn(draw));
        }
        for thread in drawing {
            thread
                .join()
                .map_err(|_| anyhow::anyhow!("a thread ended"))??;
        }
        Ok(())
    })?;
    println!(
        "{} renderers on one device: {:.1} images/s",
        options.renderers,
        (2 * options.pairs * options.renderers) as f64 / before.elapsed().as_secs_f64()
    );
    Ok(())
}

/// Renders like a server that is behind: the next pair begins before this one is read.
/// Prints the rate, and the time of this thread by step; `depth` is the format in which
/// the adapter compresses it, if it does.
fn ahead(
    renderer: &mut Renderer,
    robot: &RobotModel,
    scene: &Scene,
    pairs: usize,
    depth: Option<Depth>,
) -> Result<()> {
    let snapshots: Vec<Snapshot> = (0..=pairs)
        .map(|pair| motion::moving(robot, scene, pair as f64 * 0.1))
        .collect();
    renderer.spent();
    renderer.submit(&snapshots[0], &[0, 1])?;
    let before = Instant::now();
    let mut submitting = 0.0;
    let (mut exact, mut deflated, mut left) = ([0; 3], [0; 3], 0);
    // Of four bytes of depth.
    let kept = match depth {
        Some(Depth::Millimetres) => 2,
        Some(Depth::Nothing) => 0,
        Some(Depth::Metres) | None => 4,
    };
    for snapshot in &snapshots[1..] {
        let start = Instant::now();
        renderer.submit(snapshot, &[0, 1])?;
        submitting += start.elapsed().as_secs_f64();
        for frame in renderer.collect()? {
            let planes = [&frame.rgb, &frame.depth, &frame.ids];
            for (i, plane) in planes.into_iter().enumerate() {
                match &frame.deflated[i] {
                    Some(stream) => {
                        exact[i] += plane.len() / 4 * if i == 1 { kept } else { 4 };
                        deflated[i] += stream.len();
                    }
                    None => left += u32::from(i != 1 || kept > 0),
                }
            }
        }
    }
    let seconds = before.elapsed().as_secs_f64();
    renderer.collect()?;
    // The last rendered pair does not count.
    let each = 1e3 / pairs as f64;
    println!(
        "one pair ahead: {:.1} pairs/s, {:.1} images/s; a pair takes {:.3} ms to submit and \
         {:.3} ms to wait for and read",
        pairs as f64 / seconds,
        2.0 * pairs as f64 / seconds,
        submitting * each,
        (seconds - submitting) * each
    );
    for (part, taken) in renderer.spent() {
        println!("  {part:<14}{:.3} ms", taken.as_secs_f64() * each);
    }
    if exact[0] > 0 {
        let share = |i: usize| deflated[i] as f64 / exact[i].max(1) as f64;
        println!(
            "compressed by the adapter: colour to {:.4}, depth to {:.4}, ids to {:.4}; {left} \
             planes are left to the processor",
            share(0),
            share(1),
            share(2)
        );
    }
    Ok(())
}

/// The scene under the appearance of the options, if they name one.
fn render_scene(options: &Options, robot: &RobotModel, scene: &Scene) -> Result<RenderScene> {
    Ok(match options.appearance {
        Some(seed) => {
            let appearance =
                SampledAppearance::new(appearance(options, seed), scene, &options.assets)?;
            RenderScene::with_appearance(robot, scene, &options.assets, Some(&appearance))?
        }
        None => RenderScene::new(robot, scene, &options.assets)?,
    })
}

/// Pairs of two qualities in alternation.
fn compare_quality(
    options: &Options,
    qualities: [Quality; 2],
    robot: &RobotModel,
    scene: &Scene,
) -> Result<()> {
    let rendered = render_scene(options, robot, scene)?;
    let cameras = CameraSpec::all(robot, scene, [options.width, options.height])?;
    let mut renderers = Vec::new();
    for quality in qualities {
        let started = Instant::now();
        let renderer = options.renderer(&rendered, &cameras, quality, options.packing()?)?;
        let seconds = started.elapsed().as_secs_f64();
        println!("{}: ready after {seconds:.2} s", quality.name());
        renderers.push((quality, renderer, Vec::new(), Vec::new()));
    }
    for pair in 0..options.pairs + 5 {
        let snapshot = motion::moving(robot, scene, pair as f64 * 0.1);
        for (_, renderer, times, processor) in &mut renderers {
            let (before, cpu) = (Instant::now(), cpu_seconds());
            renderer.render(&snapshot, &[0, 1])?;
            if pair >= 5 {
                times.push(before.elapsed().as_secs_f64() * 1e3);
                processor.push((cpu_seconds() - cpu) * 1e3);
            }
        }
    }
    let ([least, median], [least_cpu, cpu]) = (middle(&renderers[0].2), middle(&renderers[0].3));
    for (quality, renderer, times, processor) in &mut renderers {
        let ([own_least, own_median], [own_least_cpu, own_cpu]) =
            (middle(times), middle(processor));
        println!(
            "{}: min {own_least:.2} ms, median {own_median:.2} ms, processor {own_cpu:.2} ms; \
             rate {:.3} (min), {:.3} (median), by processor time {:.3} (min), {:.3} (median)",
            quality.name(),
            least / own_least,
            median / own_median,
            least_cpu / own_least_cpu,
            cpu / own_cpu
        );
        ahead(renderer, robot, scene, options.pairs, None)?;
    }
    Ok(())
}

/// Pairs that the processor packs and pairs that the adapter packs, in alternation.
fn compare_packing(
    options: &Options,
    quality: Quality,
    robot: &RobotModel,
    scene: &Scene,
) -> Result<()> {
    let drawn = render_scene(options, robot, scene)?;
    let cameras = CameraSpec::all(robot, scene, [options.width, options.height])?;
    let mut renderers = Vec::new();
    for packing in [Packing::Processor, Packing::Adapter] {
        let renderer = options.renderer(&drawn, &cameras, quality, Some(packing))?;
        renderers.push((packing, renderer, Vec::new()));
    }
    let (mut differ, mut all) = (0, 0);
    for pair in 0..options.pairs + 5 {
        let snapshot = motion::moving(robot, scene, pair as f64 * 0.1);
        let mut frames = Vec::new();
        for (_, renderer, times) in &mut renderers {
            let before = Instant::now();
            frames.push(renderer.render(&snapshot, &[0, 1])?);
            if pair >= 5 {
                times.push(before.elapsed().as_secs_f64() * 1e3);
            }
        }
        for (one, two) in frames[0].iter().zip(&frames[1]) {
            for (a, b) in [
                (&one.rgb, &two.rgb),
                (&one.depth, &two.depth),
                (&one.ids, &two.ids),
            ] {
                all += a.len();
                differ += a.iter().zip(b).filter(|(a, b)| a != b).count();
            }
        }
    }
    let [least, median] = middle(&renderers[0].2);
    for (packing, renderer, times) in &mut renderers {
        let [own_least, own_median] = middle(times);
        println!(
            "{packing:?}: min {own_least:.2} ms, median {own_median:.2} ms; rate {:.3} (min), \
             {:.3} (median) of the processor's",
            least / own_least,
            median / own_median
        );
        ahead(renderer, robot, scene, options.pairs, None)?;
    }
    println!("{differ} of {all} bytes differ");
    // Coincident surfaces are rendered in another order.
    if differ as f64 > 1e-6 * all as f64 {
        bail!("more bytes differ than coincident surfaces explain");
    }
    Ok(())
}

/// The sampled appearance.
fn appearance(options: &Options, seed: u64) -> Appearance {
    let s = options.strength;
    Appearance {
        seed,
        light: s,
        background: s,
        materials: s,
        exposure: s,
        decoration: s,
        ..Appearance::default()
    }
}

/// Least and median.
fn middle(times: &[f64]) -> [f64; 2] {
    let mut sorted = times.to_vec();
    sorted.sort_by(f64::total_cmp);
    [sorted[0], sorted[sorted.len() / 2]]
}

/// Alternates pairs without an appearance, with one, and with one whose glass and metal
/// are rendered without it.
fn compare(
    options: &Options,
    quality: Quality,
    robot: &RobotModel,
    scene: &Scene,
    seed: u64,
) -> Result<()> {
    let appearance = SampledAppearance::new(appearance(options, seed), scene, &options.assets)?;
    let plain = RenderScene::new(robot, scene, &options.assets)?;
    let render_scene =
        RenderScene::with_appearance(robot, scene, &options.assets, Some(&appearance))?;
    let mut dull = render_scene.clone();
    for item in &mut dull.items {
        item.material.transmission = 0.0;
        item.material.metallic = item.material.metallic.min(0.45);
    }
    let cameras = CameraSpec::all(robot, scene, [options.width, options.height])?;
    let kinds = [
        ("no look", plain),
        ("look", render_scene),
        ("look, no glass or mirror", dull),
    ];
    let mut renderers = Vec::new();
    for (name, scene) in &kinds {
        let started = Instant::now();
        let renderer = options.renderer(scene, &cameras, quality, options.packing()?)?;
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
    let [least, median] = middle(&renderers[0].1);
    for ((name, _), (renderer, times)) in kinds.iter().zip(&mut renderers) {
        let [own_least, own_median] = middle(times);
        println!(
            "{name}: min {own_least:.1} ms, median {own_median:.1} ms; rate {:.3} (min), {:.3} \
             (median) of that without a look",
            least / own_least,
            median / own_median
        );
        ahead(renderer, robot, scene, options.pairs, None)?;
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
