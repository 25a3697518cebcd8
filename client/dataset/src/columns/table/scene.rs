//! The robot's surroundings: objects, furniture, deformables, the user in the chair,
//! contacts and obstacles.

use wheelarm_proto::v1;

use super::units::{POSE, POSE_UNIT, TWIST, TWIST_UNIT, WHEELS, XYZ};
use crate::columns::codec::{derived, f64s, list, number, part, singles, text, u64s, whole, words};
use crate::columns::values::{self as take, put_each, to_pose, to_twist, to_vector};
use crate::columns::{Axis, Codec, MAX_CONTACTS, Table, TextCodec};

const PADS: Axis = Axis::Names(&["left", "right"]);
const HEAD_TURNS: Axis = Axis::Names(&["yaw", "pitch", "roll"]);
const BODY_PARTS: Axis = Axis::Names(&[
    "head", "face", "mouth", "torso", "arms", "hands", "lap", "legs",
]);

pub(super) static OBJECT_POSE: Table<v1::ObjectPoses> = Table {
    columns: &[
        f64s(
            "pose",
            POSE_UNIT,
            "house",
            &[Axis::Objects, POSE],
            Codec {
                take: |m, _, o| m.poses.iter().for_each(|p| take::pose(Some(p), o)),
                put: |m, _, v| {
                    put_each(&mut m.poses, v, 7, |p, v| {
                        *p = to_pose(v).unwrap_or_default()
                    })
                },
            },
        ),
        f64s(
            "twist",
            TWIST_UNIT,
            "house",
            &[Axis::Objects, TWIST],
            Codec {
                take: |m, _, o| m.twists.iter().for_each(|t| take::twist(Some(t), o)),
                put: |m, _, v| {
                    put_each(&mut m.twists, v, 6, |t, v| {
                        *t = to_twist(v).unwrap_or_default()
                    })
                },
            },
        ),
    ],
};

pub(super) static FURNITURE_JOINT: Table<v1::FurnitureJoints> = Table {
    columns: &[
        f64s(
            "position",
            "m or rad",
            "",
            &[Axis::FurnitureJoints],
            list!(positions),
        ),
        f64s(
            "velocity",
            "m/s or rad/s",
            "",
            &[Axis::FurnitureJoints],
            list!(velocities),
        ),
    ],
};

pub(super) static DEFORMABLE: Table<v1::Deformable> = Table {
    columns: &[
        text("object", words!(object)),
        f64s(
            "vertex",
            "m",
            "house",
            &[Axis::Vertices, XYZ],
            singles!(vertices),
        ),
        f64s("elastic_energy", "J", "", &[], number!(elastic_energy)),
        f64s("kinetic_energy", "J", "", &[], number!(kinetic_energy)),
    ],
};

pub(super) static DISTURBANCE: Table<v1::Disturbance> = Table {
    columns: &[
        f64s(
            "joint_offset",
            "rad",
            "",
            &[Axis::ArmJoints],
            list!(joint_offsets),
        ),
        f64s("wheel_factor", "1", "", &[WHEELS], list!(wheel_factors)),
        text("pushed", words!(pushed)),
        f64s(
            "push_force",
            "N (NaN where nothing is pushed)",
            "house",
            &[XYZ],
            part!(push_force, take::vector, to_vector),
        ),
        f64s("grip_factor", "1", "", &[], number!(grip_factor)),
    ],
};

pub(super) static PERSON: Table<v1::PersonState> = Table {
    columns: &[
        f64s(
            "head",
            "rad (to the left, down, to the right)",
            "",
            &[HEAD_TURNS],
            list!(head_angles),
        ),
        f64s("jaw", "rad", "", &[], number!(jaw)),
        f64s(
            "mouth",
            POSE_UNIT,
            "house",
            &[POSE],
            part!(mouth, take::pose, to_pose),
        ),
        f64s(
            "force",
            "N (greatest of the physics ticks)",
            "",
            &[BODY_PARTS],
            list!(forces),
        ),
        f64s("robot_force", "N", "", &[], number!(robot_force)),
        text(
            "contact_pairs",
            TextCodec {
                take: |m| {
                    let pair = |c: &v1::PersonContact| [c.part().word(), c.partner.clone()];
                    take::pairs(m.contacts.iter().map(pair))
                },
                put: |m, text| {
                    let contact = |[part, partner]: [String; 2]| v1::PersonContact {
                        part: v1::BodyPart::from_word(&part).into(),
                        partner,
                        ..v1::PersonContact::default()
                    };
                    m.contacts = take::to_pairs(&text)?.into_iter().map(contact).collect();
                    Ok(())
                },
            },
        ),
        f64s(
            "contact_force",
            "N (greatest of the physics ticks; mean for objects)",
            "",
            &[Axis::Contacts],
            Codec {
                take: |m, _, o| {
                    let end = o.len() + MAX_CONTACTS;
                    o.extend(m.contacts.iter().take(MAX_CONTACTS).map(|c| c.force));
                    o.resize(end, f64::NAN);
                },
                put: |m, _, v| {
                    let contacts = m.contacts.iter_mut();
                    contacts.zip(v).for_each(|(c, force)| c.force = *force);
                },
            },
        ),
        u64s(
            "contact_count",
            "1 (contacts, also of those that are not listed)",
            whole!(contact_count),
        ),
    ],
};

pub(super) static CONTACT: Table<v1::Contacts> = Table {
    columns: &[
        f64s(
            "pad_force",
            "N (normal force and friction)",
            "",
            &[PADS],
            list!(pad_forces),
        ),
        u64s(
            "count",
            "1 (touching pairs that are listed)",
            derived(|m: &v1::Contacts, _, o| o.push(m.contacts.len() as u64)),
        ),
        u64s(
            "contact_count",
            "1 (touching pairs, also those that are not listed)",
            whole!(contact_count),
        ),
        text(
            "pairs",
            TextCodec {
                take: |m| {
                    let pair = |c: &v1::Contact| [c.first.clone(), c.second.clone()];
                    take::pairs(m.contacts.iter().map(pair))
                },
                put: |m, text| {
                    let contact = |[first, second]: [String; 2]| v1::Contact {
                        first,
                        second,
                        ..v1::Contact::default()
                    };
                    m.contacts = take::to_pairs(&text)?.into_iter().map(contact).collect();
                    Ok(())
                },
            },
        ),
        f64s(
            "point",
            "m",
            "house",
            &[Axis::Contacts, XYZ],
            Codec {
                take: |m, _, o| of_contacts(m, o, |c| c.point.as_ref()),
                put: |m, _, v| to_contacts(m, v, |c, v| c.point = to_vector(v)),
            },
        ),
        f64s(
            "force",
            "N (on the second body)",
            "house",
            &[Axis::Contacts, XYZ],
            Codec {
                take: |m, _, o| of_contacts(m, o, |c| c.force.as_ref()),
                put: |m, _, v| to_contacts(m, v, |c, v| c.force = to_vector(v)),
            },
        ),
    ],
};

/// A vector of each of the strongest contacts; NaN where there are fewer.
fn of_contacts(
    m: &v1::Contacts,
    out: &mut Vec<f64>,
    of: impl Fn(&v1::Contact) -> Option<&v1::Vector3>,
) {
    let start = out.len();
    let strongest = m.contacts.iter().take(MAX_CONTACTS);
    strongest.for_each(|c| take::vector(of(c), out));
    out.resize(start + 3 * MAX_CONTACTS, f64::NAN);
}

/// Writes the vectors into the existing contacts.
fn to_contacts(m: &mut v1::Contacts, v: &[f64], put: impl Fn(&mut v1::Contact, &[f64])) {
    let contacts = m.contacts.iter_mut();
    contacts.zip(v.chunks_exact(3)).for_each(|(c, v)| put(c, v));
}
