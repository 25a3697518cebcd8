//! Generates the instruction of an episode by the grammar in `assets/language`: a
//! sentence that identifies the target in the present scene. Uses its own random
//! stream.

use std::path::Path;

use nalgebra::{Isometry3, Vector3};
use wheelarm_language::{self as language, Grammar, Options, Role, Sentence, Split, Verb, Wish};
use wheelarm_proto::exact;
use wheelarm_proto::furniture::JointMotion;
use wheelarm_proto::settings::LanguageSplit;

use super::goal::Goal;
use super::spec::TaskSpec;
use crate::scene::{
    FurnitureJoint, Placement, ReachedPlace, Scene, SceneError, Surface, kind_name, text,
};

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
    let grammar = grammar_of(assets)?;
    let described = language_scene(scene, placements, task);
    let grammar = grammar.for_scene(&described);
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

/// The grammar of the assets.
pub(super) fn grammar_of(assets: &Path) -> Result<Grammar, SceneError> {
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
    Grammar::read(&of).map_err(|e| SceneError::Language(Box::new(e)))
}

/// The scene for the grammar: areas, objects, sliding furniture, and the regions of the
/// task and its area.
pub(super) fn language_scene(
    scene: &Scene,
    placements: &[Placement],
    task: &TaskSpec,
) -> language::Scene {
    let mut out = language::Scene::default();
    for surface in &scene.surfaces {
        let body = &scene.furniture[surface.furniture];
        let place = scene.place_on(surface);
        let own = body.area == body.name;
        if own && out.areas.iter().all(|area| area.name != body.name) {
            // The words of other tasks are those of the area alone.
            let place = place.filter(|_| task.names_places());
            out.areas.push(area(surface, &body.name, place));
        } else if !own && place.is_some() {
            let name = format!("{}/{}", body.name, surface.name);
            out.areas.push(area(surface, &name, place));
        }
    }
    for (object, placement) in scene.objects.iter().zip(placements) {
        let words = [object.category.as_str(), object.colour.as_str()];
        let at = placement.pose.translation.vector.into();
        out.add(&object.name, words, Role::Object, at, None);
        let bounds = object.collision_bounds(&Isometry3::identity());
        out.describe(
            &object.noun,
            bounds.map_or(0.0, |bounds| bounds.size().max()),
        );
    }
    for joint in &scene.joints {
        let body = &scene.furniture[joint.furniture];
        let words = [body.category.as_str(), body.colour.as_str()];
        let is_known = out.areas.iter().any(|area| area.name == body.area);
        let area = match is_known {
            true => body.area.clone(),
            false => leaves(scene, joint, &mut out),
        };
        // Closed: drawers are not distinguished by how far they are open.
        let at = match (joint.motion, body.grasps.first()) {
            (JointMotion::Turns, Some(handle)) if !is_known => body.pose * handle.pose,
            _ => body.pose,
        };
        let at = at.translation.vector.into();
        out.add(&body.name, words, Role::Slide, at, Some(&area));
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

/// The area of the doors and drawers of one piece of furniture, as seen from before them; added
/// when it is missing. Returns its name.
fn leaves(scene: &Scene, joint: &FurnitureJoint, out: &mut language::Scene) -> String {
    let carrier = &scene.furniture[joint.carrier];
    let name = format!("{}/leaves", carrier.name);
    if out.areas.iter().any(|area| area.name == name) {
        return name;
    }
    let body = &scene.furniture[joint.furniture];
    let into = match (joint.motion, body.grasps.first()) {
        (JointMotion::Turns, Some(handle)) => body.pose * handle.pose.rotation * Vector3::z(),
        (JointMotion::Turns, None) => -(body.pose.rotation * Vector3::x()),
        (JointMotion::Slides, _) => -joint.axis.into_inner(),
    };
    let at = body.pose.translation.vector;
    out.areas.push(language::Area {
        name: name.clone(),
        edge: at.into(),
        inwards: exact::atan2(into.y, into.x),
        kind: kind_name(&carrier.category, &carrier.name),
        room: scene.room_at([at.x, at.y]),
        has_leaves: true,
        ..language::Area::default()
    });
    name
}

/// The area of a surface; with `place` its kind and its room are words.
fn area(surface: &Surface, name: &str, place: Option<&ReachedPlace>) -> language::Area {
    let inwards = surface.edge.rotation * Vector3::x();
    language::Area {
        name: name.to_owned(),
        edge: surface.edge.translation.vector.into(),
        inwards: exact::atan2(inwards.y, inwards.x),
        depth: surface.depth,
        width: surface.width,
        kind: place.map(ReachedPlace::kind_name).unwrap_or_default(),
        room: place.map(|place| place.room.clone()).unwrap_or_default(),
        furniture: place
            .map(|place| place.furniture.clone())
            .unwrap_or_default(),
        has_leaves: false,
    }
}
