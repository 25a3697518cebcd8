//! Handles of a scene: doors and drawers of furniture that the robot opens and closes. Tasks
//! without an area sample from them.

use super::error::{Place, SceneError};
use super::file::HandleEntry;
use super::places::{LONGEST, MOST, start};
use super::{FurnitureJoint, ReachedPlace, Scene};

/// A door or a drawer that the robot opens and closes, with starts of the chair near it.
#[derive(Clone, Debug, PartialEq)]
pub struct ReachedHandle {
    /// Furniture on a joint.
    pub furniture: String,
    /// Its carrier as a place without a surface: kind, room and start of the chair.
    pub near: ReachedPlace,
}

impl Scene {
    /// The joint of furniture with this name.
    #[must_use]
    pub fn joint_of_furniture(&self, name: &str) -> Option<&FurnitureJoint> {
        self.joint_of(self.furniture_named(name)?)
    }

    /// Reads the handles of the scene's file.
    pub(super) fn add_handles(
        &mut self,
        file: &Place,
        entries: &[HandleEntry],
    ) -> Result<(), SceneError> {
        if entries.len() > MOST {
            return Err(file.key("handle").wrong(
                entries.len(),
                format!("at most {MOST} handles"),
                "leave some out",
            ));
        }
        for (number, entry) in entries.iter().enumerate() {
            let place = file.entry("handle", &entry.on);
            let furniture = self.furniture_named(&entry.on);
            let joint = furniture.and_then(|furniture| self.joint_of(furniture));
            let graspable = joint.filter(|joint| {
                let body = &self.furniture[joint.furniture];
                !body.grasps.is_empty()
            });
            let Some(joint) = graspable else {
                return Err(place.key("on").wrong(
                    format!("{:?}", entry.on),
                    "furniture on a joint with a grasp",
                    "correct the name or leave it out",
                ));
            };
            let is_known = |known: &ReachedHandle| known.furniture == entry.on;
            if self.handles.iter().any(is_known) {
                return Err(place.key("on").wrong(
                    format!("{:?}, which has two handles", entry.on),
                    "one [[handle]] for each door and drawer",
                    "leave one out",
                ));
            }
            let carrier = &self.furniture[joint.carrier];
            let near = ReachedPlace {
                name: short_name(&entry.on, number),
                furniture: carrier.name.clone(),
                surface: String::new(),
                kind: entry.kind.as_ref().unwrap_or(&carrier.category).clone(),
                room: entry.room.clone().unwrap_or_default(),
                inwards: [0.0; 2],
                along: [0.0; 2],
                headroom: 0.0,
                apart: entry.apart,
                start: start(&place, &entry.start)?,
            };
            self.handles.push(ReachedHandle {
                furniture: entry.on.clone(),
                near,
            });
        }
        Ok(())
    }
}

/// The name of furniture, cut to the length of names of places; its number among the handles
/// keeps it unique.
fn short_name(furniture: &str, number: usize) -> String {
    if furniture.chars().count() <= LONGEST {
        return furniture.to_owned();
    }
    let ending = format!("-{number}");
    let kept = furniture.chars().take(LONGEST - ending.len());
    kept.collect::<String>() + &ending
}
