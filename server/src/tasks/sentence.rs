//! The sentence of an episode by the grammar in `assets/language`: what the task
//! asks of the scene as it stands, in words that tell it from all else there. Its
//! random numbers are of a stream of their own.

use std::path::Path;

use wheelarm_language::{self as language, Grammar, Options, Role, Said, Split, Verb, Wish};
use wheelarm_proto::settings::LanguageSplit;

use super::goal::Goal;
use super::spec::TaskSpec;
use crate::scene::{Placement, Scene, SceneError, text};

/// How a task is said.
#[derive(Clone, Debug, PartialEq)]
pub struct Language {
    /// Seed of the sentence.
    pub seed: u64,
    /// Which templates and names are said.
    pub split: LanguageSplit,
    /// Share of sentences with a typing error, 0 to 1.
    pub typo_share: f64,
    /// Share of sentences with politeness, 0 to 1.
    pub politeness_share: f64,
    /// Share of sentences that may mean several things, 0 to 1.
    pub ambiguous_share: f64,
    /// Template of the sentence; empty where none was drawn.
    pub template: String,
    /// What must be asked back; empty where the sentence is clear.
    pub question: String,
}

/// Politeness where nobody says how much.
pub const POLITENESS: f64 = 0.5;

/// A sentence for the task about this target, with objects in the order of
/// `scene.objects` at `placements`. `None` where the grammar has no words for it.
///
/// # Errors
/// When a file of the grammar cannot be used.
pub fn sentence(
    assets: &Path,
    (task, target): (&TaskSpec, &str),
    scene: &Scene,
    placements: &[Placement],
    seed: u64,
    asked: &Language,
) -> Result<Option<Said>, SceneError> {
    let mut texts = Vec::new();
    for file in language::FILES {
        texts.push((file, text(assets, &format!("language/{file}"))?));
    }
    let of = |name: &str| {
        texts
            .iter()
            .find(|(file, _)| *file == name)
            .map(|(_, text)| text.clone())
    };
    let grammar = Grammar::read(&of).map_err(|e| SceneError::Language(Box::new(e)))?;
    let seen = seen(scene, placements, task);
    let (verb, goal) = match &task.goal {
        Goal::Lift => (Verb::Lift, None),
        Goal::Give => (Verb::Give, None),
        Goal::Bring => (Verb::Bring, None),
        Goal::Put { on } => (Verb::Put, seen.named(on)),
        Goal::Open { .. } => (Verb::Open, None),
        Goal::Close { .. } => (Verb::Close, None),
    };
    let Some(target) = seen.named(target) else {
        return Ok(None);
    };
    let wish = Wish { verb, target, goal };
    let options = Options {
        split: match asked.split {
            LanguageSplit::Any => Split::Any,
            LanguageSplit::Train => Split::Train,
            LanguageSplit::HeldOut => Split::HeldOut,
        },
        typos: asked.typo_share,
        politeness: asked.politeness_share,
        ambiguous: asked.ambiguous_share,
    };
    let purpose = format!("{} {seed}", task.name);
    Ok(language::say(
        &grammar, &seen, &wish, &options, asked.seed, &purpose,
    ))
}

/// The scene as language takes it: areas, objects, what slides, and the task's
/// region and those of its area.
fn seen(scene: &Scene, placements: &[Placement], task: &TaskSpec) -> language::Scene {
    let mut out = language::Scene::default();
    for surface in &scene.surfaces {
        let body = &scene.furniture[surface.furniture];
        if body.area == body.name && out.areas.iter().all(|area| area.name != body.name) {
            out.areas.push(area(surface, &body.name));
        }
    }
    for (object, placement) in scene.objects.iter().zip(placements) {
        let words = [object.category.as_str(), object.colour.as_str()];
        let at = placement.pose.translation.vector.into();
        out.add(&object.name, words, Role::Object, at, None);
    }
    for joint in &scene.joints {
        let body = &scene.furniture[joint.furniture];
        let words = [body.category.as_str(), body.colour.as_str()];
        // Closed: nobody tells drawers apart by how far they stand open.
        let at = body.pose.translation.vector.into();
        out.add(&body.name, words, Role::Slide, at, Some(&body.area));
    }
    let regions = task.area.variants.iter().flat_map(|v| &v.regions);
    let mut regions: Vec<&String> = regions.collect();
    regions.dedup();
    for name in regions {
        if let Some(surface) = scene.surface_named(name, None)
            && out.named(name).is_none()
        {
            let at = surface.centre().translation.vector.into();
            out.add(name, ["", ""], Role::Goal, at, Some(&task.area.name));
        }
    }
    out
}

fn area(surface: &crate::scene::Surface, name: &str) -> language::Area {
    let inwards = surface.edge.rotation * nalgebra::Vector3::x();
    language::Area {
        name: name.to_owned(),
        edge: surface.edge.translation.vector.into(),
        inwards: wheelarm_proto::exact::atan2(inwards.y, inwards.x),
        depth: surface.depth,
        width: surface.width,
    }
}
