//! Generates the instruction of an episode by the grammar in `assets/language`: a
//! sentence that identifies the target in the present scene. Uses its own random
//! stream.

use std::path::Path;

use wheelarm_language::{self as language, Grammar, Options, Role, Sentence, Split, Verb, Wish};
use wheelarm_proto::settings::LanguageSplit;

use super::goal::Goal;
use super::spec::TaskSpec;
use crate::scene::{Placement, Scene, SceneError, text};

/// Language settings of a task.
#[derive(Clone, Debug, PartialEq)]
pub struct Language {
    /// Seed of the sentence.
    pub seed: u64,
    /// Which templates and names are used.
    pub split: LanguageSplit,
    /// Share of sentences with a typing error, 0 to 1.
    pub typo_share: f64,
    /// Share of sentences with politeness, 0 to 1.
    pub politeness_share: f64,
    /// Share of ambiguous sentences, 0 to 1.
    pub ambiguous_share: f64,
    /// Template of the sentence; empty when none was generated.
    pub template: String,
    /// Clarification question; empty when the sentence is unambiguous.
    pub question: String,
}

/// Default share of sentences with politeness.
pub const POLITENESS: f64 = 0.5;

/// A sentence for the task with this target, with objects in the order of
/// `scene.objects` at `placements`. `None` when the grammar has no words for it.
///
/// # Errors
/// When a file of the grammar is invalid.
pub fn sentence(
    assets: &Path,
    (task, target): (&TaskSpec, &str),
    scene: &Scene,
    placements: &[Placement],
    seed: u64,
    settings: &Language,
) -> Result<Option<Sentence>, SceneError> {
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
    let described = language_scene(scene, placements, task);
    let (verb, goal) = match &task.goal {
        Goal::Lift => (Verb::Lift, None),
        Goal::Give => (Verb::Give, None),
        Goal::Bring => (Verb::Bring, None),
        Goal::Put { on } => (Verb::Put, described.named(on)),
        Goal::Open(_) => (Verb::Open, None),
        Goal::Close(_) => (Verb::Close, None),
    };
    let Some(target) = described.named(target) else {
        return Ok(None);
    };
    let wish = Wish { verb, target, goal };
    let options = Options {
        split: match settings.split {
            LanguageSplit::Any => Split::Any,
            LanguageSplit::Train => Split::Train,
            LanguageSplit::HeldOut => Split::HeldOut,
        },
        typos: settings.typo_share,
        politeness: settings.politeness_share,
        ambiguous: settings.ambiguous_share,
    };
    let purpose = format!("{} {seed}", task.name);
    Ok(language::generate(
        &grammar,
        &described,
        &wish,
        &options,
        settings.seed,
        &purpose,
    ))
}

/// The scene for the grammar: areas, objects, sliding furniture, and the regions of the
/// task and its area.
fn language_scene(scene: &Scene, placements: &[Placement], task: &TaskSpec) -> language::Scene {
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
        // Closed: drawers are not distinguished by how far they are open.
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
