//! Visibility of the person in the chair camera, counted by instance IDs.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::people::{BodyPart, HeadPose, Person, PersonSetting};
use crate::robot::RobotModel;
use crate::scene::Scene;
use crate::sensors::camera::{CameraSpec, Graphics, Quality, RenderScene, Renderer};
use crate::sim::{Scenario, Simulation};
use crate::snapshot::{PersonState, Snapshot};

/// Pixels.
const SIZE: [u32; 2] = [160, 90];
/// Largest share of an image for the head, and smallest share of images with visible
/// knees or hands, which cover at least [`SEEN`] of the pixels.
const HEAD: f64 = 0.05;
const KNEES_OR_HANDS: f64 = 0.90;
const VISIBLE: f64 = 0.005;

fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets")
}

/// An empty home, and the robot in it at home.
struct Stage {
    model: RobotModel,
    scene: Scene,
    snapshot: Snapshot,
}

impl Stage {
    fn new() -> Self {
        let scenario = Scenario {
            task: String::new(),
            cameras: Vec::new(),
            ..Scenario::default()
        };
        let sim = Simulation::new(&assets(), scenario).expect("a simulation");
        let mut scene = sim.scene().clone();
        let mut snapshot = (**sim.snapshot()).clone();
        scene.furniture.clear();
        scene.objects.clear();
        scene.joints.clear();
        snapshot.objects.clear();
        snapshot.sliding.clear();
        snapshot.skins.clear();
        Self {
            model: sim.model().clone(),
            scene,
            snapshot,
        }
    }

    /// The stage with a sampled person in the chair, and the chair's camera; `None`
    /// without a graphics adapter.
    fn seat(
        &self,
        setting: &PersonSetting,
        seed: u64,
        quality: Quality,
    ) -> Option<(RenderScene, Renderer)> {
        let drawn = setting.sample(&assets(), seed).expect("a person");
        let person = Arc::new(Person::load(&assets(), drawn).expect("a person"));
        let (model, scene) = (&self.model, &self.scene);
        let scene_with_person =
            RenderScene::with_person(model, scene, &assets(), None, Some(&person));
        let scene_with_person = scene_with_person.expect("a scene");
        let mut mounts = model.settings.cameras.iter();
        let mount = mounts.find(|c| c.name == "wheelchair").expect("a camera");
        let camera = CameraSpec::on_robot(model, mount, SIZE).expect("a camera");
        let graphics = Graphics::for_test();
        match Renderer::over(&graphics, &scene_with_person, &[camera], quality) {
            Ok(renderer) => Some((scene_with_person, renderer)),
            Err(e) => {
                eprintln!("cannot render here: {e}");
                None
            }
        }
    }

    /// IDs of the chair camera's image at a pose of the head.
    fn ids(&self, renderer: &mut Renderer, head: HeadPose) -> Vec<u16> {
        let mut snapshot = self.snapshot.clone();
        snapshot.person = Some(PersonState {
            head,
            ..PersonState::default()
        });
        let mut frames = renderer.render(&snapshot, &[0]).expect("an image");
        frames.remove(0).ids().to_vec()
    }

    /// Share of the chair camera's image for each part of the body; `None` without a
    /// graphics adapter.
    fn shares(&self, body: &str, posture: &str) -> Option<BTreeMap<BodyPart, f64>> {
        let setting = PersonSetting {
            body: body.into(),
            posture: posture.into(),
            ..PersonSetting::default()
        };
        let (rendered, mut renderer) = self.seat(&setting, 1, Quality::Fast)?;
        let ids = self.ids(&mut renderer, HeadPose::default());
        let parts = rendered.person.as_ref().expect("a person").parts.iter();
        let share = |id: u16| ids.iter().filter(|i| **i == id).count() as f64 / ids.len() as f64;
        Some(parts.map(|&(id, part)| (part, share(id))).collect())
    }
}

/// The vertices of the head follow it there and back, whether uploaded again or not.
#[test]
fn a_turned_head_is_rendered_at_its_pose() {
    let stage = Stage::new();
    let setting = PersonSetting {
        body: "man_p95".into(),
        ..PersonSetting::default()
    };
    let Some((_, mut renderer)) = stage.seat(&setting, 4, Quality::Standard) else {
        return;
    };
    let mut image = |yaw: f64| {
        let head = HeadPose {
            yaw,
            pitch: yaw,
            ..HeadPose::default()
        };
        stage.ids(&mut renderer, head)
    };
    let [ahead, again, turned, back] = [0.0, 0.0, 0.4, 0.0].map(&mut image);
    let others = |a: &[u16], b: &[u16]| a.iter().zip(b).filter(|(a, b)| a != b).count();
    assert_eq!((others(&ahead, &again), others(&ahead, &back)), (0, 0));
    assert!(others(&ahead, &turned) > 20, "{}", others(&ahead, &turned));
}

fn names() -> (Vec<String>, Vec<String>) {
    let folders = std::fs::read_dir(assets().join("people"))
        .expect("people")
        .flatten();
    let folders = folders.map(|e| e.path()).filter(|p| p.is_dir());
    let name = |p: PathBuf| {
        p.file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned()
    };
    let mut bodies: Vec<String> = folders.map(name).collect();
    bodies.sort();
    let text = std::fs::read_to_string(assets().join("people/postures.toml")).expect("postures");
    let table: toml::Table = text.parse().expect("postures");
    let postures = table.iter().filter(|(_, v)| v.is_table());
    (bodies, postures.map(|(k, _)| k.clone()).collect())
}

fn check(pairs: impl Iterator<Item = (String, String)>) {
    let stage = Stage::new();
    let (mut count, mut visible, mut wrong, mut most) = (0, 0, Vec::new(), 0.0_f64);
    for (body, posture) in pairs {
        let Some(shares) = stage.shares(&body, &posture) else {
            return;
        };
        let of = |parts: &[BodyPart]| parts.iter().filter_map(|p| shares.get(p)).sum::<f64>();
        let head = of(&[BodyPart::Head, BodyPart::Face, BodyPart::Mouth]);
        let shown = of(&[BodyPart::Lap, BodyPart::Hands]);
        count += 1;
        visible += usize::from(shown >= VISIBLE);
        most = most.max(head);
        println!(
            "{body:12} {posture:18} head {:5.1} %, knees and hands {:5.1} %",
            head * 100.0,
            shown * 100.0
        );
        if head > HEAD {
            wrong.push(format!("{body}, {posture}: head {:.1} %", head * 100.0));
        }
    }
    let part = f64::from(visible as u32) / f64::from(count);
    println!(
        "{count} images: head at most {:.1} %, knees or hands in {:.1} %",
        most * 100.0,
        part * 100.0
    );
    assert!(
        part >= KNEES_OR_HANDS,
        "knees or hands in {visible} of {count}"
    );
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Every body once, each in another posture.
#[test]
fn the_chair_camera_sees_knees_and_hands_and_little_of_the_head() {
    let (bodies, postures) = names();
    let posture = |i: usize| postures[(5 * i) % postures.len()].clone();
    check(
        bodies
            .into_iter()
            .enumerate()
            .map(|(i, body)| (body, posture(i))),
    );
}

/// Every body in every posture: `make test-people`.
#[test]
#[ignore = "takes minutes: make test-people"]
fn the_chair_camera_sees_knees_and_hands_of_everybody_in_every_posture() {
    let (bodies, postures) = names();
    let pairs = bodies
        .iter()
        .flat_map(|b| postures.iter().map(move |p| (b.clone(), p.clone())));
    check(pairs);
}
