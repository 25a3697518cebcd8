//! Rejects names that do not exist in a scene, with the available ones.

use super::condition::Name;
use super::context::TARGET;
use crate::scene::{FurnitureJoint, Place, Scene, SceneError};

/// Checks a name in a condition or a goal; the target's placeholder is always valid.
pub(super) fn check_name(place: &Place, scene: &Scene, name: Name<'_>) -> Result<(), SceneError> {
    match name {
        Name::Object(TARGET) | Name::Joint(TARGET) => Ok(()),
        Name::Object(object) => known_object(&place.key("object"), scene, object),
        Name::Surface(on) => scene.surface(place, on, None).map(|_| ()),
        Name::Joint(joint) => known_joint(&place.key("joint"), scene, joint).map(|_| ()),
    }
}

pub(super) fn known_joint<'a>(
    place: &Place,
    scene: &'a Scene,
    name: &str,
) -> Result<&'a FurnitureJoint, SceneError> {
    let known = scene.joints.iter().map(|j| j.name.as_str());
    let known: Vec<_> = known.collect();
    scene.joints.iter().find(|j| j.name == name).ok_or_else(|| {
        place.wrong(
            format!("{name:?}"),
            format!("one of {}", known.join(", ")),
            "correct the name or give the furniture a slide or a hinge",
        )
    })
}

pub(super) fn known_object(place: &Place, scene: &Scene, name: &str) -> Result<(), SceneError> {
    if scene.object_named(name).is_some() {
        return Ok(());
    }
    let known: Vec<_> = scene.objects.iter().map(|o| o.name.as_str()).collect();
    Err(place.wrong(
        format!("{name:?}"),
        format!("one of {}", known.join(", ")),
        format!(
            "correct the name or add the object to scenes/{}.toml",
            scene.name
        ),
    ))
}
