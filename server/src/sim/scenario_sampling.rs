//! Samples the open values of a scenario when a simulation is set up, and rejects
//! values that do not fit the scene or the robot.

use std::path::Path;
use std::sync::Arc;

use nalgebra::Isometry3;
use wheelarm_proto::settings::{LanguageSplit, Named};

use super::error::SimError;
use super::scenario::{SOFT_MASS, Scenario, ScenarioError};
use crate::people::{Motion, Person};
use crate::robot::{ARM_JOINTS, RobotModel};
use crate::scene::{Body, Placement, Scene};
use crate::tasks::{self, Floor, SamplingRules, SceneSample, TaskSample, TaskSpec, Variant};

/// The variant of a task's area: the named one, else the one whose objects the scenario
/// places, else a sampled one.
fn variant<'a>(task: &'a TaskSpec, scenario: &Scenario) -> Result<&'a Variant, SimError> {
    let offering = || task.variants();
    let given = match &scenario.variant {
        Some(name) => offering().find(|variant| variant.name == *name),
        None if scenario.objects.is_empty() => {
            tasks::variant_of(task, scenario.seed, scenario.variant_share)
        }
        // A recording without a variant lists the objects that existed.
        None => {
            let placed = |variant: &&Variant| {
                let certain = variant.places.iter().filter(|place| place.is_certain());
                let there = certain.filter(|place| {
                    scenario
                        .objects
                        .iter()
                        .any(|(name, _)| *name == place.object)
                });
                there.count()
            };
            // Among equal candidates the first has the fewest missing objects.
            offering().rev().max_by_key(placed)
        }
    };
    given.ok_or_else(|| {
        let known: Vec<_> = offering().map(|v| format!("{:?}", v.name)).collect();
        SimError::Variant {
            name: scenario.variant.clone().unwrap_or_default(),
            task: task.name.clone(),
            known: known.join(", "),
        }
    })
}

/// The task with the variant that the scenario names or samples; a query over the places of a
/// home becomes the task at one of them.
pub(super) fn settled(
    task: &TaskSpec,
    scenario: &Scenario,
    scene: &Scene,
) -> Result<(TaskSpec, Variant), SimError> {
    let variant = variant(task, scenario)?;
    Ok(task.settled(variant, scene, scenario.seed, &scenario.target)?)
}

/// Samples a settled task. A query is settled again where the scenario leaves place or object
/// open.
pub(super) fn sampled(
    task: &TaskSpec,
    settled: (TaskSpec, Variant),
    (scenario, is_variant_open): (&Scenario, bool),
    scene: &Scene,
    floor: Option<&Floor>,
) -> ((TaskSpec, Variant), TaskSample) {
    let is_open = |variant: &str, target: &str| {
        let is_target = scenario.target.is_empty() || scenario.target == target;
        let is_variant = is_variant_open || scenario.variant.as_deref() == Some(variant);
        scenario.objects.is_empty() && is_target && is_variant
    };
    tasks::sample_reached(task, settled, &is_open, scene, scenario.seed, floor)
}

/// The rules of sampling, which the scenario then states.
pub(super) fn sampling_rules(scenario: &mut Scenario, scene: &Scene) -> SamplingRules {
    let open = scenario.draws.is_none();
    scenario.requested.open_draws |= open;
    *scenario
        .draws
        .get_or_insert_with(|| SamplingRules::of_scene(scene))
}

/// Fills in open placements, target, start pose and instruction, and removes missing
/// objects from the scene. Returns for each object whether the scenario's placement
/// differs from the sampled one.
pub(super) fn sample_open_values(
    scenario: &mut Scenario,
    scene: &mut Scene,
    task: Option<(&TaskSpec, TaskSample)>,
) -> Result<Vec<bool>, SimError> {
    if let Some((name, _)) = scenario
        .objects
        .iter()
        .find(|(n, _)| !scene.objects.iter().any(|o| o.name == *n))
    {
        let known: Vec<_> = scene.objects.iter().map(|o| o.name.as_str()).collect();
        return Err(SimError::Object {
            name: name.clone(),
            scene: scene.name.clone(),
            known: known.join(", "),
        });
    }
    if let Some((name, ..)) = scenario
        .slides
        .iter()
        .find(|(n, ..)| scene.joint_named(n).is_none())
    {
        let known: Vec<_> = scene.joints.iter().map(|j| j.name.as_str()).collect();
        return Err(SimError::Slide {
            name: name.clone(),
            scene: scene.name.clone(),
            known: known.join(", "),
        });
    }
    check_soft(scenario, scene)?;
    let (task, drawn) = match task {
        Some((task, sample)) => (Some(task), sample),
        None => (None, undisturbed(scene)),
    };
    let given = std::mem::take(&mut scenario.objects);
    let tells_none = given.is_empty();
    if let Some(task) = task {
        let area = || task.area.name.clone();
        if scenario.start.is_none() && !drawn.scene.has_start {
            return Err(SimError::NoStart {
                area: area(),
                seed: scenario.seed,
            });
        }
        if tells_none && !drawn.scene.has_reach {
            return Err(SimError::NoReach {
                area: area(),
                seed: scenario.seed,
            });
        }
        if tells_none && drawn.scene.clearance < 0.0 {
            return Err(SimError::NoRoom {
                area: area(),
                seed: scenario.seed,
            });
        }
    }
    let may_miss = |name: &str| task.is_some_and(|task| task.area.may_miss(name));
    let lists_missing = given.iter().any(|(name, _)| may_miss(name));
    let placed: Vec<bool>;
    (scenario.objects, placed) = scene
        .objects
        .iter()
        .zip(drawn.scene.placements)
        .filter_map(|(object, drawn)| {
            let given = given.iter().find(|(name, _)| *name == object.name);
            let elsewhere = given.is_some_and(|(_, p)| drawn.is_none_or(|d| d.pose != p.pose));
            // A scenario with objects lists every optional one; a scenario with an
            // object that may be missing lists every such object.
            let is_listed = object.optional || lists_missing && may_miss(&object.name);
            let drawn = drawn.filter(|_| tells_none || !is_listed);
            let placement = given.map(|(_, p)| *p).or(drawn)?;
            Some(((object.name.clone(), placement), elsewhere))
        })
        .unzip();
    scene.objects.retain(|object| {
        scenario
            .objects
            .iter()
            .any(|(name, _)| *name == object.name)
    });
    let slides = drawn.scene.slides.into_iter().zip(drawn.scene.positions);
    for (joint, drawn) in scene.joints.iter_mut().zip(slides) {
        let mut given = scenario.slides.iter();
        let given = given.find(|(name, ..)| *name == joint.name);
        (joint.resistance, joint.start) = given.map_or(drawn, |(_, r, p)| (*r, *p));
    }
    let slides = scene.joints.iter();
    let slides = slides.map(|j| (j.name.clone(), j.resistance, j.start));
    scenario.slides = slides.collect();
    let start: Isometry3<f64> = scenario.start.unwrap_or(drawn.scene.start);
    if scenario.start.is_none() {
        scenario.rejected_starts = drawn.scene.rejected_starts;
    }
    scenario.start = Some(start);
    scenario.arm = scenario.arm.or(drawn.scene.arm);
    scenario.knuckle = scenario.knuckle.or(drawn.scene.knuckle);
    if scenario.target.is_empty() {
        scenario.target = drawn.target;
    }
    if scenario.instruction.is_empty() {
        scenario.instruction = drawn.instruction;
    }
    Ok(placed)
}

/// Generates the instruction by the grammar, if requested.
pub(super) fn generate_instruction(
    assets: &Path,
    scenario: &mut Scenario,
    scene: &Scene,
    task: &TaskSpec,
) -> Result<(), SimError> {
    let Some(language) = &mut scenario.language else {
        return Ok(());
    };
    let placements: Vec<_> = scenario.objects.iter().map(|(_, p)| *p).collect();
    let about = (task, scenario.target.as_str());
    let sentence = tasks::sentence(assets, about, scene, &placements, scenario.seed, language)?;
    let Some(sentence) = sentence else {
        // A sentence of another split must not be used.
        return match language.split {
            LanguageSplit::Any => Ok(()),
            split => Err(SimError::NoSentence {
                task: task.name.clone(),
                split: split.name(),
            }),
        };
    };
    scenario.instruction = sentence.text;
    language.template = sentence.template;
    language.question = sentence.question;
    Ok(())
}

/// Rejects a start with a joint beyond its limits.
pub(super) fn check_pose(
    model: &RobotModel,
    arm: &[f64; ARM_JOINTS],
    knuckle: f64,
) -> Result<(), ScenarioError> {
    let joints = model.roles.arm.iter().zip(arm);
    let gripper = [(&model.roles.knuckles[0], &knuckle)];
    for (&joint, &position) in joints.chain(gripper) {
        let joint = &model.joints[joint];
        let (least, most) = (joint.limits.lower, joint.limits.upper);
        if !(least..=most).contains(&position) {
            return Err(ScenarioError::Joint {
                name: joint.name.clone(),
                position,
                least,
                most,
            });
        }
    }
    Ok(())
}

/// Rejects masses with which a deformable would not settle.
fn check_soft(scenario: &Scenario, scene: &Scene) -> Result<(), ScenarioError> {
    let (least, most) = SOFT_MASS;
    for (name, placement) in &scenario.objects {
        let mut objects = scene.objects.iter();
        let soft = objects.any(|o| o.name == *name && o.soft.is_some());
        if soft && !(least..=most).contains(&placement.mass) {
            return Err(ScenarioError::SoftMass {
                name: name.clone(),
                mass: placement.mass,
            });
        }
    }
    Ok(())
}

/// Samples the person in the chair, if the scenario has one.
pub(super) fn seated(
    assets: &Path,
    scenario: &mut Scenario,
    model: &RobotModel,
) -> Result<Option<(Arc<Person>, Motion)>, SimError> {
    let Some(setting) = &mut scenario.person else {
        return Ok(None);
    };
    if model.settings.seat.is_none() {
        return Err(SimError::NoSeat(scenario.robot.clone()));
    }
    let drawn = setting.sample(assets, scenario.seed)?;
    setting.drawn = Some(drawn.clone());
    let person = Person::load(assets, drawn)?;
    let motion = Motion {
        seed: setting.seed.unwrap_or(scenario.seed),
        strength: *setting.motion.get_or_insert(1.0),
        mouth_open: setting.mouth_open,
        limits: person.limits,
    };
    Ok(Some((Arc::new(person), motion)))
}

/// All objects at their places in the scene, without optional ones.
fn undisturbed(scene: &Scene) -> TaskSample {
    let placement = |object: &Body| (!object.optional).then(|| Placement::from_body(object));
    TaskSample {
        scene: SceneSample {
            placements: scene.objects.iter().map(placement).collect(),
            slides: scene.joints.iter().map(|joint| joint.resistance).collect(),
            positions: vec![0.0; scene.joints.len()],
            start: scene.start,
            arm: None,
            knuckle: None,
            attempts: 0,
            clearance: 0.0,
            has_start: true,
            has_reach: true,
            rejected_starts: 0,
            surroundings: Vec::new(),
        },
        target: String::new(),
        instruction: String::new(),
    }
}
