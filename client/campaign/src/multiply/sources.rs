//! The sources: recordings of successful episodes, and the demonstrations that are cut out
//! of them.
//!
//! A recording does not contain the region of the goal, the rest pose of a slide or the
//! bounding boxes of objects: a server with the recorded scenario provides them.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};
use wheelarm_dataset::read::Episode;
use wheelarm_expert::demonstration::Demonstration;
use wheelarm_expert::demonstration::cut::{Course, cut};
use wheelarm_expert::goal::Goal;
use wheelarm_expert::observation::{Collector, Observation};
use wheelarm_expert::scene::SceneModel;
use wheelarm_proto::topic::Sample;
use wheelarm_proto::v1;
use wheelarm_rollout::launcher::{Server, ServerOptions};
use wheelarm_sdk::Client;

use super::args::MultiplyArgs;
use crate::replay::packs::RecordedPacks;
use crate::worlds;

/// Recordings to multiply.
pub struct Sources {
    /// The demonstrations.
    pub list: Vec<Demonstration>,
    /// Files of the task that cannot be used, with reasons.
    pub left_out: Vec<(String, String)>,
    /// Tasks of the other files.
    pub other_tasks: BTreeSet<String>,
    /// Scene and robot of all of them.
    pub scene: String,
    pub robot: String,
    /// World packs of the scene.
    pub refs: Vec<v1::PackRef>,
    /// Files of the world packs.
    pub packs: RecordedPacks,
}

impl Sources {
    /// Reads every episode of the task.
    ///
    /// # Errors
    /// When the folder cannot be read or no server starts.
    pub fn read(args: &MultiplyArgs) -> anyhow::Result<Self> {
        let mut sources = Self {
            list: Vec::new(),
            left_out: Vec::new(),
            other_tasks: BTreeSet::new(),
            scene: String::new(),
            refs: Vec::new(),
            packs: RecordedPacks::default(),
            robot: String::new(),
        };
        let sides = worlds::shipped()?;
        let mut server: Option<(Server, Client)> = None;
        let most = args.sources.map_or(usize::MAX, |most| most.get());
        for path in files(&args.dir)? {
            if sources.list.len() >= most {
                break;
            }
            let name = path.file_stem().unwrap_or_default();
            let name = name.to_string_lossy().into_owned();
            let recording = match open(&path, &args.task) {
                Ok(Found::Source(recording)) => *recording,
                Ok(Found::Other(task)) => {
                    sources.other_tasks.insert(task);
                    continue;
                }
                Err(why) => {
                    sources.left_out.push((name, format!("{why:#}")));
                    continue;
                }
            };
            let scenario = recording.scenario()?;
            if let Some(part) = sides.held_out_part(&scenario) {
                let why = format!(
                    "{part} is kept for tests, and multiplied episodes are training data; use a demonstration without it"
                );
                sources.left_out.push((name, why));
                continue;
            }
            if sources.list.is_empty() {
                sources.scene.clone_from(&scenario.scene);
                sources.refs.clone_from(&scenario.packs);
                sources.packs = RecordedPacks::unpack(&recording)?;
                sources.robot.clone_from(&scenario.robot);
            }
            let own = (&sources.scene, &sources.refs, &sources.robot);
            if own != (&scenario.scene, &scenario.packs, &scenario.robot) {
                let why = "it is of another scene or robot than those before".to_owned();
                sources.left_out.push((name, why));
                continue;
            }
            let (_, client) = match &mut server {
                Some(server) => server,
                none => none.insert(start(args, &sources.packs, &scenario)?),
            };
            match demonstration(&recording, &name, scenario, client) {
                Ok(one) => sources.list.push(one),
                Err(why) => sources.left_out.push((name, format!("{why:#}"))),
            }
        }
        if let Some((server, client)) = server {
            server.stop(client)?;
        }
        Ok(sources)
    }

    /// The demonstrations as text.
    ///
    /// # Errors
    /// When they cannot be serialized.
    pub fn text(&self) -> anyhow::Result<String> {
        Ok(serde_json::to_string(&self.list)?)
    }

    /// Writes the demonstrations for the workers, and returns their path.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, folder: &Path) -> anyhow::Result<PathBuf> {
        let path = folder.join("demonstrations.json");
        std::fs::write(&path, self.text()?)
            .with_context(|| format!("writing {}", path.display()))?;
        let whole = std::path::absolute(&path);
        whole.with_context(|| format!("finding {}", path.display()))
    }
}

/// Recordings of a folder, or of the folder of episodes of a dataset.
fn files(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let episodes = folder.join("episodes");
    let folder = match episodes.is_dir() {
        true => episodes,
        false => folder.to_owned(),
    };
    let context = || format!("reading the folder {}", folder.display());
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(&folder).with_context(context)? {
        let path = entry.with_context(context)?.path();
        if path.extension().is_some_and(|extension| extension == "h5") {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}

/// A recording that could be opened.
enum Found {
    Source(Box<Episode>),
    /// Of another task.
    Other(String),
}

/// The recording, if it is of the task; an error if it is of the task and cannot be used.
fn open(path: &Path, task: &str) -> anyhow::Result<Found> {
    let recording = Episode::open(path)?;
    let summary = recording.summary()?;
    if summary.task[0] != task {
        return Ok(Found::Other(summary.task[0].to_string()));
    }
    if !summary.success {
        bail!("the task did not succeed in it");
    }
    Ok(Found::Source(Box::new(recording)))
}

/// Starts a server with a recorded scenario.
fn start(
    args: &MultiplyArgs,
    packs: &RecordedPacks,
    scenario: &v1::Scenario,
) -> anyhow::Result<(Server, Client)> {
    let server = Server::start(&ServerOptions {
        scenario: v1::Scenario {
            scene: scenario.scene.clone(),
            packs: scenario.packs.clone(),
            robot: scenario.robot.clone(),
            task: Some(scenario.task().to_owned()),
            seed: Some(scenario.seed()),
            pacing: v1::Pacing::LockStep.into(),
            ..v1::Scenario::default()
        },
        assets: args.assets.clone(),
        packs: packs.before(&args.packs.packs),
        ..ServerOptions::default()
    })?;
    let client = server.client()?;
    Ok((server, client))
}

/// The demonstration in a recording.
fn demonstration(
    recording: &Episode,
    name: &str,
    mut scenario: v1::Scenario,
    client: &Client,
) -> anyhow::Result<Demonstration> {
    scenario.cameras.clear();
    scenario.sensors.clear();
    scenario.pacing = v1::Pacing::LockStep.into();
    client.reset(scenario, false)?;
    let reply = client.request(&v1::SceneRequest {})?;
    let scene = SceneModel::read(&reply)?;
    let goal = Goal::read(&reply, &scene)?.ok_or_else(|| anyhow!("its task has no goal"))?;
    let mut grasps = scene.grasps.iter();
    if grasps.any(|grasp| grasp.item == goal.item() && grasp.force.is_some()) {
        bail!("deformable objects are not supported");
    }
    let (observed, applied) = observations(recording)?;
    let robot = recording.robot()?;
    let commanded: Vec<Option<f64>> = applied
        .iter()
        .map(|applied| {
            use v1::gripper_command::Target;
            match applied.as_ref()?.gripper.as_ref()?.target.as_ref()? {
                Target::Opening(opening) => Some(*opening),
                Target::Knuckle(knuckle) => robot.opening(*knuckle),
            }
        })
        .collect();
    let opening = observed
        .iter()
        .map(|observed| robot.opening(observed.knuckle));
    let opening: Option<Vec<f64>> = opening.collect();
    let course = Course {
        source: name,
        scene: &scene,
        goal: &goal,
        observations: &observed,
        commanded: &commanded,
        opening: &opening.ok_or_else(|| anyhow!("its robot has no gripper"))?,
    };
    cut(&course).map_err(|why| anyhow!(why))
}

/// The observation at each joint sample, and the newest applied command since the previous
/// one.
fn observations(
    recording: &Episode,
) -> anyhow::Result<(Vec<Observation>, Vec<Option<v1::Applied>>)> {
    let (_, roles) = recording.roles()?;
    let mut collector = Collector::new(roles);
    let joints = recording.messages_of::<v1::JointState>()?;
    let mut others: Vec<(u64, Sample)> = Vec::new();
    let poses = recording.messages_of::<v1::PoseSet>()?.into_iter();
    others.extend(poses.map(|(tick, m)| (tick, Sample::Pose(m))));
    let objects = recording.messages_of::<v1::ObjectPoses>()?.into_iter();
    others.extend(objects.map(|(tick, m)| (tick, Sample::ObjectPose(m))));
    let contacts = recording.messages_of::<v1::Contacts>()?.into_iter();
    others.extend(contacts.map(|(tick, m)| (tick, Sample::Contact(m))));
    let applied = recording.messages_of::<v1::Applied>()?.into_iter();
    others.extend(applied.map(|(tick, m)| (tick, Sample::Applied(m))));
    if recording.has("furniture_joint") {
        let slides = recording.messages_of::<v1::FurnitureJoints>()?.into_iter();
        others.extend(slides.map(|(tick, m)| (tick, Sample::FurnitureJoint(m))));
    }
    others.sort_by_key(|(tick, _)| *tick);
    let mut others = others.into_iter().peekable();
    let (mut observed, mut commanded) = (Vec::new(), Vec::new());
    for (tick, state) in joints {
        let stamp = state.header.as_ref().map_or(0, |h| h.stamp_nanos);
        collector.take(Sample::JointState(state));
        let mut newest: Option<v1::Applied> = None;
        while let Some((_, sample)) = others.next_if(|(at, _)| *at <= tick) {
            if let Sample::Applied(applied) = &sample
                && (applied.gripper.is_some() || newest.is_none())
            {
                newest = Some(applied.clone());
            }
            collector.take(sample);
        }
        if let Some(observation) = collector.observe(stamp)? {
            observed.push(observation);
            commanded.push(newest);
        }
    }
    Ok((observed, commanded))
}
