//! Renders the home to PNG files: color, depth and ids of both robot cameras at the
//! start and at the coffee table, the room camera and free views. With `--task`, the
//! sampled scene of a seed, with the chair parked in front of its area.
//!
//! `render_scene [--assets DIR] [--out DIR] [--width W] [--height H]
//! [--quality fast|draft|standard|high] [--adapter NAME] [--task NAME] [--seed N]`

use std::fs;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Parser;
use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use wheelarm_proto::settings::Named;
use wheelarm_server::robot::RobotModel;
use wheelarm_server::robot::control::ControlInput;
use wheelarm_server::scene::Scene;
use wheelarm_server::sensors::camera::{
    Binding, CameraSpec, Frame, Intrinsics, Quality, RenderScene, Renderer,
};
use wheelarm_server::sim::{Scenario, Simulation};
use wheelarm_server::snapshot::{BodyState, JointState, Snapshot};

#[derive(Parser)]
struct Options {
    /// Folder with robots, scenes, objects and materials.
    #[arg(long, default_value = "assets")]
    assets: PathBuf,
    /// Scene below assets/scenes.
    #[arg(long, default_value = "home")]
    scene: String,
    /// Folder for the images.
    #[arg(long, default_value = "images")]
    out: PathBuf,
    /// Pixels.
    #[arg(long, default_value_t = 1280)]
    width: u32,
    /// Pixels.
    #[arg(long, default_value_t = 720)]
    height: u32,
    /// fast, draft, standard or high.
    #[arg(long, default_value = "standard")]
    quality: String,
    /// Part of an adapter's name.
    #[arg(long)]
    adapter: Option<String>,
    /// Task whose sampled scene is rendered.
    #[arg(long)]
    task: Option<String>,
    /// Seed of the scene.
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

fn main() -> Result<()> {
    let options = Options::parse();
    let quality = Quality::from_name(&options.quality)?;
    let robot = RobotModel::load(&options.assets, "wheelarm")?;
    let scene = Scene::load(&options.assets, &options.scene)?;
    if let Some(task) = &options.task {
        return draw_task(&options, quality, task);
    }
    let size = [options.width, options.height];
    let mut cameras = CameraSpec::all(&robot, &scene, size)?;
    for (name, eye, target) in FREE_VIEWS {
        cameras.push(CameraSpec {
            name: name.into(),
            binding: Binding::World,
            mount: looking(eye, target),
            intrinsics: Intrinsics::centred(size, 1.2),
            range: [0.05, 100.0],
        });
    }
    let started = Instant::now();
    let render_scene = RenderScene::new(&robot, &scene, &options.assets)?;
    let triangles: usize = render_scene
        .items
        .iter()
        .map(|i| i.mesh.indices.len() / 3)
        .sum();
    let mut renderer = Renderer::new(&render_scene, &cameras, quality, options.adapter.as_deref())?;
    println!(
        "{}\n{} meshes, {triangles} triangles, {} ids, ready after {:.2} s",
        renderer.adapter(),
        render_scene.items.len(),
        render_scene.instances.len(),
        started.elapsed().as_secs_f64(),
    );
    fs::create_dir_all(&options.out)?;

    let home = robot.settings.home;
    let at_start = snapshot(&robot, &scene, &scene.start, &home);
    let table = Isometry3::from_parts(
        Translation3::new(-7.85, 1.95, 0.0),
        UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::PI),
    );
    let at_table = snapshot(&robot, &scene, &table, &home);
    let all: Vec<usize> = (0..cameras.len()).collect();
    for (place, snapshot, chosen) in [
        ("start", &at_start, &all[..2]),
        ("table", &at_table, &all[..]),
    ] {
        for frame in renderer.render(snapshot, chosen)? {
            let name = format!("{place}_{}", cameras[frame.camera].name);
            save(&options.out, &name, &frame)?;
        }
    }
    println!("images are in {}", options.out.display());
    Ok(())
}

/// Draws a task's start with the chair before its area, a second after it.
fn draw_task(options: &Options, quality: Quality, task: &str) -> Result<()> {
    let scenario = Scenario {
        task: task.to_owned(),
        seed: options.seed,
        cameras: Vec::new(),
        ..Scenario::default()
    };
    let sim = Simulation::new(&options.assets, scenario.clone())?;
    let area = sim.task().map(|t| t.area.name.clone()).unwrap_or_default();
    let surface = sim
        .scene()
        .surfaces
        .iter()
        .find(|s| sim.scene().furniture[s.furniture].area == area)
        .context("the area has no surface")?;
    let chair = surface.edge * Isometry3::translation(-0.90, -0.36, 0.0);
    let start = Isometry3::from_parts(
        Translation3::new(chair.translation.x, chair.translation.y, 0.0),
        chair.rotation,
    );
    let eye = surface.edge * Point3::new(-0.55, 0.5, 0.55);
    let target = surface.edge * Point3::new(0.25, 0.0, 0.0);
    let mut sim = Simulation::new(
        &options.assets,
        Scenario {
            start: Some(start),
            ..scenario
        },
    )?;
    for _ in 0..60 {
        sim.step(&ControlInput::default());
    }
    let size = [options.width, options.height];
    let mut cameras = CameraSpec::all(sim.model(), sim.scene(), size)?;
    cameras.push(CameraSpec {
        name: "close".into(),
        binding: Binding::World,
        mount: looking(eye.into(), target.into()),
        intrinsics: Intrinsics::centred(size, 1.2),
        range: [0.05, 100.0],
    });
    let drawn = RenderScene::new(sim.model(), sim.scene(), &options.assets)?;
    let mut renderer = Renderer::new(&drawn, &cameras, quality, options.adapter.as_deref())?;
    fs::create_dir_all(&options.out)?;
    let all: Vec<usize> = (0..cameras.len()).collect();
    for frame in renderer.render(sim.snapshot(), &all)? {
        let name = format!("{task}_{}", cameras[frame.camera].name);
        save(&options.out, &name, &frame)?;
    }
    println!("{}", sim.scenario().instruction);
    Ok(())
}

/// Name, eye, target.
const FREE_VIEWS: [(&str, [f64; 3], [f64; 3]); 5] = [
    ("behind", [-5.6, 2.9, 1.9], [-8.6, 1.7, 0.7]),
    ("table", [-8.15, 3.05, 1.45], [-8.95, 1.8, 0.80]),
    ("kitchen", [-5.2, 2.2, 1.6], [-7.5, 6.2, 0.9]),
    ("sofa", [-6.5, 5.0, 1.6], [-11.0, 1.5, 0.6]),
    ("dining", [-6.2, 2.6, 1.6], [-3.9, 4.4, 0.75]),
];

fn looking(eye: [f64; 3], target: [f64; 3]) -> Isometry3<f64> {
    let (eye, target) = (Point3::from(eye), Point3::from(target));
    let z = (target - eye).normalize();
    let x = z.cross(&Vector3::z()).normalize();
    let y = z.cross(&x);
    let turn = Rotation3::from_basis_unchecked(&[x, y, z]);
    Isometry3::from_parts(
        eye.coords.into(),
        UnitQuaternion::from_rotation_matrix(&turn),
    )
}

/// Everything at rest, the chair at `root`, the arm at `arm`.
fn snapshot(robot: &RobotModel, scene: &Scene, root: &Isometry3<f64>, arm: &[f64; 6]) -> Snapshot {
    let mut positions = vec![0.0; robot.joints.len()];
    for (i, joint) in robot.joints.iter().enumerate() {
        let number = joint
            .name
            .strip_prefix("joint_")
            .and_then(|n| n.parse::<usize>().ok());
        if let Some(angle) = number.and_then(|n| arm.get(n - 1)) {
            positions[i] = *angle;
        }
    }
    let body = |pose| BodyState {
        pose,
        linear: Vector3::zeros(),
        angular: Vector3::zeros(),
    };
    Snapshot {
        tick: 0,
        joints: vec![JointState::default(); robot.joints.len()],
        links: robot
            .link_poses(&positions)
            .iter()
            .map(|p| body(root * p))
            .collect(),
        objects: scene.objects.iter().map(|o| body(o.pose)).collect(),
        skins: Vec::new(),
        furniture_joints: Vec::new(),
        sliding: scene
            .joints
            .iter()
            .map(|joint| BodyState::resting(scene.furniture[joint.furniture].pose))
            .collect(),
        contacts: Vec::new(),
        anomalies: Vec::new(),
        person: None,
    }
}

fn save(folder: &Path, name: &str, frame: &Frame) -> Result<()> {
    let size = [frame.intrinsics.width, frame.intrinsics.height];
    write_png(&folder.join(format!("{name}_rgb.png")), size, &frame.rgb)?;
    let depth: Vec<u8> = frame
        .depth
        .chunks_exact(4)
        .flat_map(|b| depth_color(f32::from_le_bytes([b[0], b[1], b[2], b[3]])))
        .collect();
    write_png(&folder.join(format!("{name}_depth.png")), size, &depth)?;
    let ids: Vec<u8> = frame.ids().iter().flat_map(|&id| id_color(id)).collect();
    write_png(&folder.join(format!("{name}_ids.png")), size, &ids)
}

/// Yellow near, blue far, black where nothing is.
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

fn id_color(id: u16) -> [u8; 3] {
    if id == 0 {
        return [0; 3];
    }
    let hash = u32::from(id).wrapping_mul(0x9E37_79B1);
    [
        (hash >> 24) as u8 | 32,
        (hash >> 16) as u8 | 32,
        (hash >> 8) as u8 | 32,
    ]
}

fn write_png(path: &Path, [width, height]: [u32; 2], rgb: &[u8]) -> Result<()> {
    let file = fs::File::create(path).with_context(|| path.display().to_string())?;
    let mut encoder = png::Encoder::new(BufWriter::new(file), width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::Fast);
    encoder.write_header()?.write_image_data(rgb)?;
    Ok(())
}
