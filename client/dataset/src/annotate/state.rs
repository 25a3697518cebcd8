//! State of a recording for the labels, sample by sample of `object_pose`.

use serde::Deserialize;
use wheelarm_language::{Home, Role, Scene, kind_of};
use wheelarm_proto::v1::{self, JointRole};

use crate::pose::{self, Pose};
use crate::read::{Episode, ReadError};

/// An object is held when each finger tip presses it with this force at least, N.
pub const HELD: f64 = 0.5;
/// Furniture that slides is open from this position on, metres.
pub const OPEN: f64 = 0.02;
/// Furniture that turns is open from this position on, radians.
pub const OPEN_TURN: f64 = 0.1;

/// The state of an episode.
#[derive(Clone, Debug)]
pub struct State {
    /// The home by its recorded files.
    pub home: Home,
    /// Text of the recorded asset files by path.
    pub assets: Vec<(String, String)>,
    /// Names of the objects.
    pub objects: Vec<String>,
    /// Stamps of the samples, nanoseconds, and their ticks.
    pub stamps: Vec<u64>,
    /// Ticks of the samples.
    pub ticks: Vec<u64>,
    /// Poses of the objects in `house`: sample by object.
    pub poses: Vec<Vec<Pose>>,
    /// Positions of furniture on joints, metres or radians: sample by slide of the home.
    pub slides: Vec<Vec<f64>>,
    /// The arm's base in `house`.
    pub base: Vec<Pose>,
    /// The end effector in `house`.
    pub hand: Vec<Pose>,
    /// Links of the finger tips.
    pub tips: Vec<String>,
    /// Index of the held object.
    pub held: Vec<Option<usize>>,
    /// Verb of the task: `lift`, `put`, `open`, `close`; empty without one.
    pub verb: String,
    /// Target of the task.
    pub target: String,
    /// Goal of the task; empty without one.
    pub goal: String,
    /// Middle of the shell that the arm reaches, in its base's frame, and its outer
    /// radius, metres.
    pub reach: ([f64; 3], f64),
}

#[derive(Deserialize)]
struct TaskFile {
    template: Option<String>,
    place: Option<PlaceQuery>,
}

#[derive(Deserialize)]
struct PlaceQuery {
    name: Option<String>,
}

impl State {
    /// Whether furniture on a joint, by its index among the slides, is open in a sample.
    #[must_use]
    pub fn is_open(&self, sample: usize, slide: usize) -> bool {
        let least = match self.home.slides[slide].turns {
            true => OPEN_TURN,
            false => OPEN,
        };
        self.slides[sample][slide] >= least
    }

    /// Reads it.
    ///
    /// # Errors
    /// When the file lacks objects, poses or the files of its home.
    pub fn read(episode: &Episode) -> Result<Self, ReadError> {
        let wrong = |what: &str, reason: String| ReadError::Content {
            path: episode.path().to_owned(),
            what: what.to_owned(),
            reason,
        };
        let assets = episode.snapshot()?.assets.into_iter();
        let assets: Vec<(String, String)> = assets.map(|a| (a.path, a.text)).collect();
        let texts = assets
            .iter()
            .map(|(path, text)| (path.as_str(), text.as_str()));
        let home = Home::read(texts).map_err(|e| wrong("initial_state/assets", e.to_string()))?;
        let scenario = episode.scenario()?;
        let (robot, roles) = episode.roles()?;
        let objects = episode.names("object_pose", "pose")?;
        let stamps = episode.stamps("object_pose")?;
        let ticks = episode.u64s("object_pose", "tick")?;
        let raw = episode
            .f64s("object_pose", "pose")?
            .into_raw_vec_and_offset()
            .0;
        let poses: Vec<Vec<Pose>> = raw
            .chunks_exact((7 * objects.len()).max(1))
            .map(|row| row.chunks_exact(7).map(pose::from_row).collect())
            .collect();
        if ticks.len() != stamps.len() || poses.len() != stamps.len() {
            let found = format!(
                "{} stamps, {} ticks and {} rows of {} poses",
                stamps.len(),
                ticks.len(),
                poses.len(),
                objects.len()
            );
            return Err(wrong("object_pose", found));
        }
        let row_of = |stream: &str| -> Result<Vec<usize>, ReadError> {
            let own = episode.u64s(stream, "tick")?;
            let at = |tick: &u64| own.partition_point(|t| t <= tick).saturating_sub(1);
            Ok(ticks.iter().map(at).collect())
        };
        let frames = robot.frames.len();
        let raw = episode.f64s("pose", "pose")?.into_raw_vec_and_offset().0;
        let frame = |row: usize, frame: usize| {
            let at = 7 * (row * frames + frame);
            raw.get(at..at + 7).map_or([f64::NAN; 7], pose::from_row)
        };
        let rows = row_of("pose")?;
        let mount = pose::of_message(robot.arm_mount.as_ref());
        let base: Vec<Pose> = rows
            .iter()
            .map(|&r| pose::compose(&frame(r, roles.chair), &mount))
            .collect();
        let hand = rows.iter().zip(&base);
        let hand = hand.map(|(&r, base)| pose::compose(base, &frame(r, roles.end_effector)));
        let hand = hand.collect();
        let slides = slides(episode, &home, &ticks)?;
        let tips = tips(&robot, &assets);
        let held = held(episode, &tips, &objects, &row_of("contact")?)?;
        let (verb, goal) = goal(&assets, scenario.task());
        let shell = robot.reach.unwrap_or_default();
        let centre = shell.centre.unwrap_or_default();
        Ok(Self {
            home,
            assets,
            objects,
            stamps,
            ticks,
            poses,
            slides,
            base,
            hand,
            tips,
            held,
            verb,
            target: scenario.target().to_owned(),
            goal,
            reach: ([centre.x, centre.y, centre.z], shell.outer_radius),
        })
    }

    /// The scene of a sample: objects by name, including a held one.
    #[must_use]
    pub fn scene(&self, row: usize) -> Scene {
        let is_there = |name: &str| name == self.goal;
        let mut scene = self.home.scene(&is_there);
        for (name, pose) in self.objects.iter().zip(&self.poses[row]) {
            scene.add(
                name,
                self.home.words_of(name),
                Role::Object,
                [pose[0], pose[1], pose[2]],
                None,
            );
        }
        scene
    }

    /// The name of an object in text: its kind, with its number from the left or from the
    /// top where there are several at the first sample.
    #[must_use]
    pub fn called(&self, name: &str) -> String {
        let words = |name: &str| name.replace('_', " ");
        let kind = kind_of(name);
        let mut like: Vec<(&str, f64)> = Vec::new();
        let mut end = "left";
        if let Some(first) = self.poses.first() {
            let scene = self.scene(0);
            for (other, _) in self
                .objects
                .iter()
                .zip(first)
                .filter(|(o, _)| kind_of(o) == kind)
            {
                let entity = scene.named(other).map(|i| &scene.entities[i]);
                like.push((other, entity.map_or(0.0, |t| -t.at[1])));
            }
        }
        if like.is_empty() {
            end = "top";
            let slides = self.home.slides.iter();
            for slide in slides.filter(|slide| kind_of(&slide.name) == kind) {
                like.push((&slide.name, -slide.origin[2]));
            }
        }
        if like.len() < 2 {
            return format!("the {}", words(kind));
        }
        like.sort_by(|a, b| a.1.total_cmp(&b.1));
        let place = like
            .iter()
            .position(|(other, _)| *other == name)
            .unwrap_or(0);
        if end == "top" && place == 0 {
            return format!("the top {}", words(kind));
        }
        if end == "top" && place + 1 == like.len() {
            return format!("the bottom {}", words(kind));
        }
        let nth = ["first", "second", "third", "fourth", "fifth", "sixth"];
        let nth = nth.get(place).copied().unwrap_or("next");
        format!("the {nth} {} from the {end}", words(kind))
    }
}

/// Positions of slides at the ticks, in the order of the home.
fn slides(episode: &Episode, home: &Home, ticks: &[u64]) -> Result<Vec<Vec<f64>>, ReadError> {
    if !episode.has("furniture_joint") {
        return Ok(vec![vec![0.0; home.slides.len()]; ticks.len()]);
    }
    let joints = episode.names("furniture_joint", "position")?;
    let own = episode.u64s("furniture_joint", "tick")?;
    let all = episode
        .f64s("furniture_joint", "position")?
        .into_raw_vec_and_offset()
        .0;
    let of = |name: &str| {
        joints
            .iter()
            .position(|j| j.strip_suffix("_joint") == Some(name))
    };
    let columns: Vec<Option<usize>> = home.slides.iter().map(|slide| of(&slide.name)).collect();
    let row = |tick: &u64| {
        let row = own.partition_point(|t| t <= tick).saturating_sub(1);
        let value = |c: &Option<usize>| c.and_then(|c| all.get(row * joints.len() + c).copied());
        columns.iter().map(|c| value(c).unwrap_or(0.0)).collect()
    };
    Ok(ticks.iter().map(row).collect())
}

/// Links of the two finger tips: children of the joints of that role.
fn tips(robot: &v1::RobotDescription, assets: &[(String, String)]) -> Vec<String> {
    let roles = [JointRole::FingerTipLeft, JointRole::FingerTipRight];
    let joints = robot
        .joints
        .iter()
        .filter(|joint| roles.contains(&joint.role()));
    let names: Vec<&str> = joints.map(|joint| joint.name.as_str()).collect();
    let urdf = assets.iter().find(|(path, _)| path.ends_with(".urdf"));
    let urdf = urdf.and_then(|(_, text)| urdf_rs::read_from_string(text).ok());
    let Some(urdf) = urdf else { return Vec::new() };
    let children = urdf
        .joints
        .into_iter()
        .filter(|j| names.contains(&j.name.as_str()));
    children.map(|joint| joint.child.link).collect()
}

/// The held object at each sample: one that both tips press.
fn held(
    episode: &Episode,
    tips: &[String],
    objects: &[String],
    rows: &[usize],
) -> Result<Vec<Option<usize>>, ReadError> {
    let pairs = episode.texts("contact", "pairs")?;
    let force = episode.f64s("contact", "force")?;
    let most = force.shape().get(1).copied().unwrap_or(0);
    let force = force.into_raw_vec_and_offset().0;
    let of_row = |row: usize| -> Option<usize> {
        let listed: Vec<(String, String)> = serde_json::from_str(pairs.get(row)?).ok()?;
        objects.iter().position(|object| {
            !tips.is_empty()
                && tips.iter().all(|tip| {
                    let mut pressed = 0.0;
                    for (k, (a, b)) in listed.iter().enumerate() {
                        if (a == tip && b == object) || (b == tip && a == object) {
                            let at = 3 * (row * most + k);
                            let f = force.get(at..at + 3).unwrap_or_default();
                            pressed += f.iter().map(|x| x * x).sum::<f64>().sqrt();
                        }
                    }
                    pressed >= HELD
                })
        })
    };
    let each: Vec<Option<usize>> = (0..pairs.len()).map(of_row).collect();
    Ok(rows
        .iter()
        .map(|&row| each.get(row).copied().flatten())
        .collect())
}

/// Verb and goal of the task by its recorded file.
fn goal(assets: &[(String, String)], task: &str) -> (String, String) {
    // Also home_tasks/NAME.toml.
    let path = format!("tasks/{task}.toml");
    let text = assets
        .iter()
        .find(|(p, _)| p.ends_with(&path))
        .map(|(_, text)| text);
    let file: Option<TaskFile> = text.and_then(|text| toml::from_str(text).ok());
    let Some(file) = file else {
        return (String::new(), String::new());
    };
    // Files before templates: a picked object is lifted.
    let verb = file.template.unwrap_or_else(|| "lift".to_owned());
    let place = file.place.and_then(|place| place.name);
    (verb, place.unwrap_or_default())
}
