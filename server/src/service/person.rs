//! Conversion of the person in the chair between message and scenario.

use wheelarm_proto::check::{self, Invalid};
use wheelarm_proto::geometry::{pose, vector};
use wheelarm_proto::person::NO_PERSON;
use wheelarm_proto::{MAX_CONTACTS, v1};

use super::convert::body_name;
use crate::people::{BodyPart, HeadPose, Person, PersonSetting, SampledPerson};
use crate::sim::Simulation;
use crate::snapshot::Touch;

/// Converts the person of a scenario.
pub(super) fn to_proto(value: &PersonSetting) -> v1::Person {
    v1::Person {
        body: value.body.clone(),
        posture: value.posture.clone(),
        skin: value.skin.clone(),
        hair: value.hair.clone(),
        clothes: value.clothes.clone(),
        seed: value.seed,
        motion: value.motion,
        mouth_open: value.mouth_open,
        guard: value.guard,
        unguarded: !value.guard,
        sampled: value.drawn.as_ref().map(drawn),
    }
}

fn drawn(of: &SampledPerson) -> v1::SampledPerson {
    v1::SampledPerson {
        body: of.body.clone(),
        posture: of.posture.clone(),
        skin: of.skin.clone(),
        hair: of.hair.clone(),
        clothes: of.clothes.clone(),
    }
}

/// Converts a requested person; `None` for an empty chair.
///
/// # Errors
/// [`Invalid`] that names the field.
pub(super) fn from_proto(message: &v1::Person) -> Result<Option<PersonSetting>, Invalid> {
    if message.body == NO_PERSON {
        return Ok(None);
    }
    if message.guard && message.unguarded {
        return Err(Invalid::Word {
            what: "person.unguarded",
            value: "true".to_owned(),
            expected: "false while person.guard is true",
        });
    }
    let none = v1::SampledPerson::default();
    let drawn = message.sampled.as_ref().unwrap_or(&none);
    for (what, name) in [
        ("person.body", &message.body),
        ("person.posture", &message.posture),
        ("person.skin", &message.skin),
        ("person.hair", &message.hair),
        ("person.clothes", &message.clothes),
        ("person.sampled.body", &drawn.body),
        ("person.sampled.posture", &drawn.posture),
        ("person.sampled.skin", &drawn.skin),
        ("person.sampled.hair", &drawn.hair),
        ("person.sampled.clothes", &drawn.clothes),
    ] {
        if !name.is_empty() {
            check::name(what, name)?;
        }
    }
    Ok(Some(PersonSetting {
        body: message.body.clone(),
        posture: message.posture.clone(),
        skin: message.skin.clone(),
        hair: message.hair.clone(),
        clothes: message.clothes.clone(),
        seed: message.seed,
        motion: message
            .motion
            .map(|motion| check::within("person.motion", motion, 0.0, 1.0))
            .transpose()?,
        mouth_open: message.mouth_open,
        // Recordings without this field are of versions without the guard.
        guard: message.guard || (!message.unguarded && message.sampled.is_none()),
        drawn: message.sampled.as_ref().map(|drawn| SampledPerson {
            body: drawn.body.clone(),
            posture: drawn.posture.clone(),
            skin: drawn.skin.clone(),
            hair: drawn.hair.clone(),
            clothes: drawn.clothes.clone(),
        }),
    }))
}

/// A part of the body as an enum.
pub(super) fn part(of: BodyPart) -> v1::BodyPart {
    match of {
        BodyPart::Head => v1::BodyPart::Head,
        BodyPart::Face => v1::BodyPart::Face,
        BodyPart::Mouth => v1::BodyPart::Mouth,
        BodyPart::Torso => v1::BodyPart::Torso,
        BodyPart::Arms => v1::BodyPart::Arms,
        BodyPart::Hands => v1::BodyPart::Hands,
        BodyPart::Lap => v1::BodyPart::Lap,
        BodyPart::Legs => v1::BodyPart::Legs,
    }
}

/// The person, for the scene query.
pub(super) fn seated(person: &Person) -> v1::SeatedPerson {
    let straight = HeadPose::default();
    let capsules = person.capsules.iter().map(|capsule| {
        let [a, b] = person.ends(capsule, &straight);
        v1::PersonCapsule {
            name: capsule.name.clone(),
            part: part(capsule.part).into(),
            a: Some(vector(&a.coords)),
            b: Some(vector(&b.coords)),
            radius: capsule.radius,
            moves: capsule.moves,
        }
    });
    v1::SeatedPerson {
        sampled: Some(drawn(&person.drawn)),
        words: person.words.clone(),
        stature: person.stature,
        mass: person.mass,
        seat_height: person.seat_height,
        capsules: capsules.collect(),
        margin: person.margin,
        lap: Some(lap(person)),
        mouth: Some(pose(&person.mouth(&straight))),
    }
}

/// The lap, in the frame of the chair.
pub(super) fn lap(person: &Person) -> v1::BoxGeometry {
    let [length, width] = person.lap.size;
    v1::BoxGeometry {
        pose: Some(pose(
            &nalgebra::Translation3::from(person.lap.at.coords).into(),
        )),
        half: Some(v1::Vector3 {
            x: length / 2.0,
            y: width / 2.0,
            z: 0.0,
        }),
    }
}

/// The person at the present tick, as a message.
pub(super) fn state(sim: &Simulation) -> Option<v1::PersonState> {
    let (person, snapshot) = (sim.person()?, sim.snapshot());
    let state = snapshot.person.as_ref()?;
    let chair = snapshot.links.first()?.pose;
    let head = &state.head;
    Some(v1::PersonState {
        header: None,
        head_angles: vec![head.yaw, head.pitch, head.roll],
        jaw: head.jaw,
        mouth: Some(pose(&(chair * person.mouth(head)))),
        forces: state.forces.to_vec(),
        robot_force: state.robot_force,
        contact_count: state.touches.len().try_into().unwrap_or(u32::MAX),
        contacts: strongest(&state.touches)
            .into_iter()
            .map(|touch| v1::PersonContact {
                part: part(touch.part).into(),
                partner: body_name(touch.partner, sim.model(), sim.scene()),
                force: touch.force,
            })
            .collect(),
    })
}

/// The strongest contacts of the person, as many as one sample holds.
fn strongest(touches: &[Touch]) -> Vec<Touch> {
    let mut sorted = touches.to_vec();
    sorted.sort_by(|a, b| b.force.total_cmp(&a.force));
    sorted.truncate(MAX_CONTACTS);
    sorted
}
