//! The gripper takes the bear from the coffee table by its waist, lifts it,
//! carries it through two turns with a waving arm, puts it back and releases it.
//! Prints computing time and contact forces; with --out also renders it. The images and
//! figures of docs/drive-and-record/deformable.md are made with it.
//!
//! `plush_bench [--assets DIR] [--out DIR] [--grip N] [--knuckle RAD]`

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use clap::Parser;
use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use wheelarm_server::robot::RobotModel;
use wheelarm_server::robot::control::{
    ArmIntent, BaseIntent, ControlInput, GripperIntent, IntentFrame, RobotControl,
};
use wheelarm_server::scene::{Placement, Scene, object};
use wheelarm_server::sensors::camera::{
    Binding, CameraSpec, Intrinsics, Quality, RenderScene, Renderer,
};
use wheelarm_server::snapshot::{BodyRef, Snapshot};
use wheelarm_server::world::{GRAVITY, World};
use wheelarm_tests::cpu::thread_seconds;

#[derive(Parser)]
struct Options {
    /// Folder with robots, scenes, objects and materials.
    #[arg(long, default_value = "assets")]
    assets: PathBuf,
    /// Folder for images and the table of the grasp.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Cap of the force at each pad, N.
    #[arg(long, default_value_t = 4.0)]
    grip: f64,
    /// Final knuckle angle of the gripper, rad.
    #[arg(long, default_value_t = 0.6)]
    knuckle: f64,
}

/// The bear in the frame of the standing chair, metres: ahead and to the left.
const AHEAD: [f64; 2] = [1.14, 0.36];
/// Control ticks, 60 per second.
const TICKS: u64 = 1350;
/// Control ticks at which an image is rendered.
const IMAGES: [(u64, &str); 6] = [
    (230, "rest"),
    (440, "squeeze"),
    (505, "carry"),
    (600, "turn"),
    (985, "put_down"),
    (1345, "release"),
];
const SIZE: [u32; 2] = [640, 480];

fn main() -> Result<()> {
    let options = Options::parse();
    let model = RobotModel::load(&options.assets, "wheelarm")?;
    let mut scene = Scene::load(&options.assets, "home")?;
    let table = scene
        .surface_named("coffee_table", None)
        .context("a coffee table")?;
    let edge = table.edge;
    // Its right arm points to the edge, it looks along it.
    let mut bear = object(&options.assets, "teddy_bear")?;
    bear.pose = table.standing(0.22, 0.0, 0.0);
    let inwards = edge.rotation * Vector3::x();
    let chair =
        bear.pose.translation.vector - inwards * AHEAD[0] - Vector3::z().cross(&inwards) * AHEAD[1];
    let start = Isometry3::from_parts(
        Translation3::new(chair.x, chair.y, 0.0),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), inwards.y.atan2(inwards.x)),
    );
    let flip = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
    let hand = bear
        .grasps
        .iter()
        .flat_map(|g| [bear.pose * g.pose, bear.pose * g.pose * flip])
        .find(|pose| {
            (pose.rotation * Vector3::z()).dot(&inwards) > 0.9
                && (pose.rotation * Vector3::y()).z > 0.9
        })
        .context("a grasp from the edge")?
        * Translation3::new(0.0, 0.0, -model.settings.tool_length);
    let weight = bear.mass.map_or(0.0, |m| m.mass) * GRAVITY;
    let placements = [Placement {
        pose: bear.pose,
        mass: weight / GRAVITY,
        friction: bear.friction,
    }];
    let place = bear.pose;
    scene.objects = vec![bear];
    let mut world = World::new(&model, &scene, &placements, &start, &model.settings.home)?;
    let mut control = RobotControl::new(&model);
    let mut camera = Camera::new(&options, &model, &scene, &place)?;

    let mut table = String::from("time_s,gap_mm,left_n,right_n,elastic_j,kinetic_j,height_mm\n");
    let (mut spent, mut whole) = (0.0, 0.0);
    let hand_link = model.link(&model.settings.end_effector_link).unwrap_or(0);
    for tick in 0..TICKS {
        let snapshot = world.snapshot();
        let input = input(tick, &hand, &options);
        for targets in &control.update(&input, &snapshot) {
            world.apply(targets);
            let begin = thread_seconds();
            world.step();
            spent += thread_seconds() - begin;
        }
        let snapshot = world.snapshot();
        let height = snapshot.objects[0].pose.translation.z - place.translation.z;
        let [left, right] = pads(&snapshot, &model);
        let gap = gap(&snapshot, &model);
        let soft = &snapshot.skins[0];
        if tick % 6 == 0 {
            table += &format!(
                "{:.3},{:.2},{left:.3},{right:.3},{:.5},{:.5},{:.2}\n",
                tick as f64 / 60.0,
                gap * 1e3,
                soft.elastic_energy,
                soft.kinetic_energy,
                height * 1e3,
            );
        }
        if tick % 60 == 59 {
            let own = snapshot.contacts.iter();
            let other: Vec<String> = own
                .filter(|c| matches!(c.first, BodyRef::Object(0)))
                .map(|c| format!("{:?} {:.2}", c.second, -c.force.z))
                .collect();
            let in_hand = snapshot.links[hand_link].pose.inverse() * snapshot.objects[0].pose;
            let at = in_hand.translation.vector * 1e3;
            println!(
                "t {:4.1} s  gap {:5.1} mm  pads {left:5.2} {right:5.2} N  height {:6.1} mm  in hand {:6.1} {:6.1} {:6.1} mm  elastic {:.4} J  {spent:.2} s per s  {} {:?}",
                (tick + 1) as f64 / 60.0,
                gap * 1e3,
                height * 1e3,
                at.x,
                at.y,
                at.z,
                soft.elastic_energy,
                other.join(", "),
                snapshot.anomalies,
            );
            whole += spent;
            spent = 0.0;
        }
        camera.render(tick, &snapshot)?;
    }
    println!(
        "weight {weight:.2} N; {:.3} s of processor per simulated second, robot included",
        whole / (TICKS as f64 / 60.0)
    );
    if let Some(out) = &options.out {
        std::fs::write(out.join("bear_grasp.csv"), table)?;
    }
    Ok(())
}

/// Control input of a control tick.
fn input(tick: u64, hand: &Isometry3<f64>, options: &Options) -> ControlInput {
    let mut input = ControlInput::default();
    let pose = |pose| {
        Some(ArmIntent::Pose {
            frame: IntentFrame::House,
            pose,
        })
    };
    let drive = |linear, angular| Some(BaseIntent { linear, angular });
    let grip = |knuckle| {
        Some(GripperIntent {
            knuckle,
            max_force: Some(options.grip),
        })
    };
    let up = Translation3::new(0.0, 0.0, 0.12);
    let back = Translation3::new(0.0, 0.0, -0.14);
    match tick {
        0 => input.arm = pose(hand * back),
        240 => input.arm = pose(*hand),
        330 => input.gripper = grip(options.knuckle),
        450 => input.arm = pose(up * hand),
        510 => input.base = drive(-0.5, 0.0),
        560 => input.base = drive(0.0, 0.8),
        640 => input.base = drive(0.0, -0.8),
        720 => input.base = drive(0.5, 0.0),
        770 => input.base = drive(0.0, 0.0),
        800 => input.arm = pose(up * hand),
        900 => input.arm = pose(Translation3::new(0.0, 0.0, 0.008) * hand),
        1020 => input.gripper = grip(0.0),
        1150 => input.arm = pose(hand * back),
        _ => {}
    }
    if (510..770).contains(&tick) {
        let phase = 4.0 * (tick - 510) as f64 / 60.0;
        input.arm = Some(ArmIntent::Twist {
            frame: IntentFrame::ArmBase,
            linear: Vector3::new(0.0, 0.1 * phase.cos(), 0.1 * (1.5 * phase).cos()),
            angular: Vector3::new(0.0, 0.0, 0.3 * phase.cos()),
        });
    }
    input
}

const TIPS: [&str; 2] = [
    "robotiq_85_left_finger_tip_link",
    "robotiq_85_right_finger_tip_link",
];

/// Force of each finger tip on the bear, N.
fn pads(snapshot: &Snapshot, model: &RobotModel) -> [f64; 2] {
    TIPS.map(|tip| {
        let tip = model.link(tip).map(BodyRef::Link);
        let own = snapshot.contacts.iter();
        own.filter(|c| Some(c.first) == tip)
            .map(|c| c.force.norm())
            .sum()
    })
}

/// Distance of the finger tips' frames, metres.
fn gap(snapshot: &Snapshot, model: &RobotModel) -> f64 {
    let [a, b] = TIPS.map(|tip| {
        let link = model.link(tip).unwrap_or(0);
        snapshot.links[link].pose.translation.vector
    });
    (a - b).norm()
}

/// Renders the images with --out.
struct Camera {
    renderer: Option<(Renderer, PathBuf)>,
}

impl Camera {
    fn new(
        options: &Options,
        model: &RobotModel,
        scene: &Scene,
        place: &Isometry3<f64>,
    ) -> Result<Self> {
        let Some(out) = &options.out else {
            return Ok(Self { renderer: None });
        };
        std::fs::create_dir_all(out)?;
        let render_scene = RenderScene::new(model, scene, &options.assets)?;
        let view = |name: &str, eye: [f64; 3]| CameraSpec {
            name: name.into(),
            binding: Binding::World,
            mount: looking(
                place * Point3::from(eye),
                place * Point3::new(-0.03, 0.0, 0.15),
            ),
            intrinsics: Intrinsics::centred(SIZE, 0.9),
            range: [0.05, 100.0],
        };
        let cameras = [
            view("front", [-0.32, -0.50, 0.34]),
            view("close", [0.10, -0.42, 0.20]),
        ];
        let renderer = Renderer::new(&render_scene, &cameras, Quality::High, None)?;
        Ok(Self {
            renderer: Some((renderer, out.clone())),
        })
    }

    fn render(&mut self, tick: u64, snapshot: &Snapshot) -> Result<()> {
        let (Some((renderer, out)), Some((_, name))) =
            (&mut self.renderer, IMAGES.iter().find(|p| p.0 == tick))
        else {
            return Ok(());
        };
        for (frame, view) in renderer
            .render(snapshot, &[0, 1])?
            .iter()
            .zip(["", "_close"])
        {
            save(&out.join(format!("bear_{name}{view}.png")), &frame.rgb)?;
        }
        Ok(())
    }
}

fn looking(eye: Point3<f64>, target: Point3<f64>) -> Isometry3<f64> {
    let z = (target - eye).normalize();
    let x = z.cross(&Vector3::z()).normalize();
    let turn = Rotation3::from_basis_unchecked(&[x, z.cross(&x), z]);
    Isometry3::from_parts(
        eye.coords.into(),
        UnitQuaternion::from_rotation_matrix(&turn),
    )
}

fn save(path: &Path, rgb: &[u8]) -> Result<()> {
    let file = std::io::BufWriter::new(std::fs::File::create(path)?);
    let mut encoder = png::Encoder::new(file, SIZE[0], SIZE[1]);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header()?.write_image_data(rgb)?;
    Ok(())
}
