//! What homes of world packs cost beside the built-in home, in alternation: time to load,
//! microseconds of processor time per physics tick with objects at rest and with three of
//! them awake, and milliseconds per image of the chair camera. Ratios are to the built-in home
//! with its own objects.
//!
//! `home_bench --packs DIR --scene NAME[,NAME] [--objects N] [--rounds N] [--images N]
//! [--width W] [--height H] [--quality NAME] [--adapter NAME]`
//!
//! Objects of the built-in home are copied onto free floor around the start. `--images 0`
//! renders nothing.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context as _, Result, ensure};
use clap::Parser;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use wheelarm_pack::Store;
use wheelarm_proto::settings::Named;
use wheelarm_server::robot::RobotModel;
use wheelarm_server::scene::{Body, Bounds, Placement, Scene};
use wheelarm_server::sensors::camera::{CameraSpec, Graphics, Quality, RenderScene, Renderer};
use wheelarm_server::snapshot::BodyRef;
use wheelarm_server::world::World;
use wheelarm_tests::cpu::thread_seconds;

#[derive(Parser)]
struct Options {
    /// Folder with robots, scenes, objects and materials.
    #[arg(long, default_value = "assets")]
    assets: PathBuf,
    /// Folder of world packs.
    #[arg(long)]
    packs: PathBuf,
    /// Homes of the packs.
    #[arg(long, value_delimiter = ',', required = true)]
    scene: Vec<String>,
    /// Objects in each home of a pack.
    #[arg(long, default_value_t = 40)]
    objects: usize,
    /// Rounds over all homes.
    #[arg(long, default_value_t = 3)]
    rounds: usize,
    /// Images of each home in a round.
    #[arg(long, default_value_t = 24)]
    images: usize,
    /// Pixels.
    #[arg(long, default_value_t = 640)]
    width: u32,
    /// Pixels.
    #[arg(long, default_value_t = 360)]
    height: u32,
    /// fast, draft, standard or high.
    #[arg(long, default_value = "standard", value_parser = |name: &str| Quality::from_name(name).map_err(|e| e.to_string()))]
    quality: Quality,
    /// Part of an adapter's name.
    #[arg(long)]
    adapter: Option<String>,
}

/// Name of the built-in home.
const OWN: &str = "home";
/// Ticks until objects that were placed sleep, and ticks of each measurement.
const SETTLE: usize = 240 * 4;
const MEASURED: usize = 240 * 3;
/// Objects that are kept awake.
const AWAKE: usize = 3;
/// Force on one of them in turn, newtons.
const PUSH: f64 = 1.0;
/// Spacing of objects on the floor, and their distance from the chair, metres.
const SPACING: f64 = 0.25;
const FROM_CHAIR: f64 = 1.0;

/// Figures of one home in one round.
struct Round {
    load_ms: f64,
    asleep_us: f64,
    awake_us: f64,
    image_ms: Option<f64>,
}

fn main() -> Result<()> {
    let options = Options::parse();
    let robot = RobotModel::load(&options.assets, "wheelarm")?;
    let own = Scene::load(&options.assets, OWN)?;
    let homes: Vec<&str> = std::iter::once(OWN)
        .chain(options.scene.iter().map(String::as_str))
        .collect();
    let mut figures: Vec<Vec<Round>> = homes.iter().map(|_| Vec::new()).collect();
    for _ in 0..options.rounds {
        for (home, figures) in homes.iter().zip(&mut figures) {
            figures.push(measure(&options, &robot, &own, home)?);
        }
    }
    println!(
        "| home | load ms | asleep us | ratio | {AWAKE} awake us | ratio | image ms | ratio |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let reference = &figures[0];
    let base = [
        median(reference.iter().map(|round| round.asleep_us)),
        median(reference.iter().map(|round| round.awake_us)),
        median(reference.iter().filter_map(|round| round.image_ms)),
    ];
    for (home, rounds) in homes.iter().zip(&figures) {
        let load = median(rounds.iter().map(|round| round.load_ms));
        let now = [
            median(rounds.iter().map(|round| round.asleep_us)),
            median(rounds.iter().map(|round| round.awake_us)),
            median(rounds.iter().filter_map(|round| round.image_ms)),
        ];
        let cells: Vec<String> = now
            .iter()
            .zip(base)
            .map(|(value, base)| format!("{value:.1} | {:.2}", value / base))
            .collect();
        println!("| {home} | {load:.0} | {} |", cells.join(" | "));
    }
    Ok(())
}

fn measure(options: &Options, robot: &RobotModel, own: &Scene, home: &str) -> Result<Round> {
    let begin = Instant::now();
    let mut scene = match home {
        OWN => Scene::load(&options.assets, OWN)?,
        home => {
            let pack = Store::new(vec![options.packs.clone()])
                .open(home)?
                .with_context(|| format!("no pack {home} in {}", options.packs.display()))?;
            Scene::from_pack(&options.assets, &pack.into())?
        }
    };
    let load_ms = begin.elapsed().as_secs_f64() * 1e3;
    match home {
        OWN => scene.objects.retain(|object| !object.optional),
        _ => scene.objects = copies(own, &scene, options.objects)?,
    }
    let placements: Vec<Placement> = scene.objects.iter().map(Placement::from_body).collect();
    let posture = robot.settings.home;
    let mut world = World::new(robot, &scene, &placements, &scene.start, &posture)?;
    (0..SETTLE).for_each(|_| world.step());
    let asleep_us = ticks(&mut world, |_, _| ());
    let rigid: Vec<usize> = (0..scene.objects.len())
        .filter(|object| scene.objects[*object].soft.is_none())
        .take(AWAKE)
        .collect();
    let awake_us = ticks(&mut world, |world, tick| {
        let object = rigid[tick % rigid.len()];
        let sign = if (tick / rigid.len()).is_multiple_of(2) {
            1.0
        } else {
            -1.0
        };
        world.push(Some((BodyRef::Object(object), Vector3::x() * PUSH * sign)));
    });
    world.push(None);
    let image_ms = match options.images {
        0 => None,
        images => Some(chair_image(options, robot, &scene, &world, images)?),
    };
    Ok(Round {
        load_ms,
        asleep_us,
        awake_us,
        image_ms,
    })
}

/// Rigid objects of the built-in home on free floor around the start.
fn copies(own: &Scene, scene: &Scene, count: usize) -> Result<Vec<Body>> {
    let kinds: Vec<&Body> = own
        .objects
        .iter()
        .filter(|object| object.soft.is_none())
        .collect();
    let furniture: Vec<Bounds> = scene
        .furniture
        .iter()
        .skip(1)
        .flat_map(|body| {
            body.collision_boxes().filter_map(|(pose, half)| {
                let corner = |k: usize| {
                    let sign = |bit: usize| if k >> bit & 1 == 0 { -1.0 } else { 1.0 };
                    let at = Vector3::new(sign(0), sign(1), sign(2)).component_mul(&half);
                    body.pose * pose * Point3::from(at)
                };
                Bounds::of_points((0..8).map(corner))
            })
        })
        .collect();
    let start = scene.start.translation.vector;
    let mut places: Vec<[i32; 2]> = (-16..=16)
        .flat_map(|x| (-16..=16).map(move |y| [x, y]))
        .collect();
    places.sort_by_key(|[x, y]| (x * x + y * y, *x, *y));
    let mut objects = Vec::new();
    for [x, y] in places {
        let away = Vector3::new(f64::from(x), f64::from(y), 0.0) * SPACING;
        let pose = Isometry3::from(Translation3::from(
            Vector3::new(start.x, start.y, 0.001) + away,
        ));
        let kind = kinds[objects.len() % kinds.len()];
        let Some(bounds) = kind.collision_bounds(&pose) else {
            continue;
        };
        if away.norm() < FROM_CHAIR || furniture.iter().any(|other| other.overlaps(&bounds, 0.0)) {
            continue;
        }
        objects.push(Body {
            name: format!("{}_{}", kind.name, objects.len()),
            pose,
            optional: false,
            ..kind.clone()
        });
        if objects.len() == count {
            return Ok(objects);
        }
    }
    ensure!(
        !objects.is_empty(),
        "no free floor around the start of {}",
        scene.name
    );
    Ok(objects)
}

/// Processor time per tick, microseconds.
fn ticks(world: &mut World, mut before: impl FnMut(&mut World, usize)) -> f64 {
    let begin = thread_seconds();
    for tick in 0..MEASURED {
        before(world, tick);
        world.step();
    }
    (thread_seconds() - begin) / MEASURED as f64 * 1e6
}

/// Median time of an image of the chair camera while the chair turns once on the spot,
/// milliseconds.
fn chair_image(
    options: &Options,
    robot: &RobotModel,
    scene: &Scene,
    world: &World,
    images: usize,
) -> Result<f64> {
    let render_scene = RenderScene::new(robot, scene, &options.assets)?;
    let cameras = CameraSpec::all(robot, scene, [options.width, options.height])?;
    let graphics = Graphics::for_adapter(options.adapter.as_deref());
    let mut renderer = Renderer::over(&graphics, &render_scene, &cameras[1..2], options.quality)?;
    let at = scene.start.translation;
    let mut times = Vec::with_capacity(images);
    for image in 0..images + 3 {
        let turn = std::f64::consts::TAU * image as f64 / images as f64;
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
        let moved = Isometry3::from(at) * turn * Isometry3::from(at).inverse();
        let mut snapshot = world.snapshot();
        for link in &mut snapshot.links {
            link.pose = moved * link.pose;
        }
        let begin = Instant::now();
        renderer.render(&snapshot, &[0])?;
        if image >= 3 {
            times.push(begin.elapsed().as_secs_f64() * 1e3);
        }
    }
    Ok(median(times.into_iter()))
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
