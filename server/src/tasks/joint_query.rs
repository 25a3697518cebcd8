//! Tasks without an area that open or close furniture: a query over the handles of a home. The
//! seed selects a door or a drawer; [`settled`] is then a task of one area with one variant.

use super::area::{AreaSpec, Range, SlideSpec, StartSpec, Variant};
use super::file::TaskFile;
use super::goal::Goal;
use super::home_sites::{HomeQuery, Site};
use super::place_query::{PlaceQuery, counted, plain};
use super::sentence::language_scene;
use super::spec::TaskSpec;
use super::stock::every_object;
use super::template::{Template, Verb};
use crate::robot::CorridorSettings;
use crate::scene::{FurnitureJoint, Place, ReachedHandle, Scene, SceneError};
use wheelarm_language::space::TIE;
use wheelarm_proto::furniture::JointMotion;

/// Hinges and rails differ and wear: friction and damping as shares of the scene's values.
const WEAR: [f64; 2] = [0.8, 1.2];
/// Position of a door to close at its start, degrees.
const OPEN_TURN_DEG: [f64; 2] = [50.0, 60.0];
/// The same of a drawer, metres.
const OPEN_SLIDE: [f64; 2] = [0.15, 0.25];
/// Furniture is opened this far beyond the bound of its task, radians or metres: so far it has
/// to be free to move.
const BEYOND: f64 = 0.01;
/// Ordinals of doors and drawers of one piece of furniture.
const ORDINALS: [&str; 6] = ["first", "second", "third", "fourth", "fifth", "sixth"];

/// Reads the task of a file without an area whose template opens or closes.
pub(super) fn read(
    (name, path): (&str, &str),
    file: TaskFile,
    template: Template,
    scene: &Scene,
    hand: &CorridorSettings,
) -> Result<TaskSpec, SceneError> {
    if file.place.is_some() {
        return Err(Place::file(path).key("place").wrong(
            "given",
            format!("none with the template {:?}", file.template),
            "leave it out, and say with from where the furniture is",
        ));
    }
    let from = file.from.clone().unwrap_or_default();
    let mut spec = TaskSpec::from_query(
        (name, path),
        file.clone(),
        (empty_area(name, scene, hand), Vec::new(), Goal::Lift),
        HomeQuery {
            template: template.clone(),
            sites: Vec::new(),
            stock: Vec::new(),
        },
    )?;
    let bounds = spec.joint_bounds();
    let is_open = template.goal == Verb::Open;
    let moves =
        |joint: &FurnitureJoint| !is_open || joint.travel >= bounds.of(joint.motion) + BEYOND;
    let fits = |handle: &&ReachedHandle| {
        let joint = scene.joint_of_furniture(&handle.furniture);
        let is_wanted = |joint: &FurnitureJoint| {
            file.object.fits(&scene.furniture[joint.furniture]) && moves(joint)
        };
        from.fits(&handle.near) && joint.is_some_and(is_wanted)
    };
    let handles: Vec<&ReachedHandle> = scene.handles.iter().filter(fits).collect();
    let Some(first) = handles.first() else {
        return Err(SceneError::NotOffered {
            task: name.to_owned(),
            missing: format!("no {}", wanted(&file, &from)),
            scene: scene.name.clone(),
            available: available(scene),
        });
    };
    spec.goal = match is_open {
        true => Goal::Open(bounds),
        false => Goal::Close(bounds),
    };
    spec.area.start = StartSpec::near(&first.near);
    let share = 1.0 / handles.len() as f64;
    let variant = |handle: &&ReachedHandle| Variant {
        name: handle.near.name.clone(),
        share,
        furniture: Vec::new(),
        regions: Vec::new(),
        places: Vec::new(),
    };
    spec.area.variants = handles.iter().map(variant).collect();
    spec.targets = handles.iter().map(|h| h.furniture.clone()).collect();
    let site = |handle: &&ReachedHandle| Site {
        name: handle.near.name.clone(),
        from: handle.near.clone(),
        to: None,
        targets: Vec::new(),
        handle: Some(handle.furniture.clone()),
    };
    spec.query = Some(HomeQuery {
        template,
        sites: handles.iter().map(site).collect(),
        stock: Vec::new(),
    });
    Ok(spec)
}

/// An area of the home without objects.
fn empty_area(name: &str, scene: &Scene, hand: &CorridorSettings) -> AreaSpec {
    let nowhere = Range { min: 0.0, max: 0.0 };
    let area = AreaSpec {
        name: name.to_owned(),
        scene: scene.name.clone(),
        hand: *hand,
        start: StartSpec {
            x: nowhere,
            y: nowhere,
            yaw: nowhere,
        },
        slides: Vec::new(),
        variants: Vec::new(),
        elsewhere: 0.0,
        surroundings: Vec::new(),
    };
    // An area that is never sampled names the objects of the scene: none of them exists.
    let absent = scene.places.first().map(|place| AreaSpec {
        variants: vec![Variant {
            name: String::new(),
            share: 1.0,
            furniture: Vec::new(),
            regions: Vec::new(),
            places: every_object(scene, &[], place),
        }],
        ..area.clone()
    });
    AreaSpec {
        surroundings: absent.into_iter().collect(),
        ..area
    }
}

/// The task with its door or drawer; `target` is that, or empty.
pub(super) fn settled(
    task: &TaskSpec,
    site: &Site,
    handle: &str,
    (variant, scene): (&Variant, &Scene),
    target: &str,
) -> Result<(TaskSpec, Variant), SceneError> {
    let unsettled = || (task.clone(), variant.clone());
    let (Some(query), Some(joint)) = (&task.query, scene.joint_of_furniture(handle)) else {
        return Ok(unsettled());
    };
    if !target.is_empty() && target != handle {
        return Err(task.place().key("target").wrong(
            format!("{target:?}"),
            format!("{handle} on {}", site.from.words()),
            "name this one, or none to sample it",
        ));
    }
    let named = Some([handle, joint.name.as_str()]);
    let mut spec = TaskSpec {
        conditions: query.template.conditions(&task.template, named, None)?,
        targets: vec![handle.to_owned()],
        query: None,
        ..task.clone()
    };
    spec.area.start = StartSpec::near(&site.from);
    spec.area.variants = vec![variant.clone()];
    spec.area.slides = vec![slide(joint, &task.goal)];
    let words = words(&spec, scene, handle);
    spec.name_in_sentences(&words, &site.from.words(), "");
    spec.check_resolved(scene)?;
    Ok((spec, variant.clone()))
}

/// Friction of the joint and where it starts: closed, or open for a task that closes it.
fn slide(joint: &FurnitureJoint, goal: &Goal) -> SlideSpec {
    let worn = |value: f64| Range {
        min: WEAR[0] * value,
        max: WEAR[1] * value,
    };
    let open = match joint.motion {
        JointMotion::Slides => OPEN_SLIDE,
        JointMotion::Turns => OPEN_TURN_DEG.map(f64::to_radians),
    };
    let [min, max] = match goal {
        Goal::Close(_) => open.map(|position| position.min(joint.travel)),
        _ => [0.0; 2],
    };
    SlideSpec {
        joint: joint.name.clone(),
        friction: worn(joint.resistance.friction),
        damping: worn(joint.resistance.damping),
        position: Range { min, max },
    }
}

/// A door or drawer among those of its carrier: `left door`, `top drawer`, `second drawer from
/// the top`; the category alone where neither height nor side tells all of them apart.
fn words(task: &TaskSpec, scene: &Scene, handle: &str) -> String {
    let described = language_scene(scene, &[], task);
    let Some(own) = described.named(handle).map(|i| &described.entities[i]) else {
        return handle.replace('_', " ");
    };
    let category = match own.category.as_str() {
        "" => own.kind.replace('_', " "),
        category => category.to_owned(),
    };
    let others = described.entities.iter().filter(|other| {
        other.name != own.name && other.area == own.area && other.category == own.category
    });
    let others: Vec<[f64; 3]> = others.map(|other| other.at).collect();
    let count = others.len() + 1;
    let mut all: Vec<[f64; 3]> = others.clone();
    all.push(own.at);
    // By height, then from the left of a person before the furniture.
    for axis in [2, 1] {
        let mut keys: Vec<f64> = all.iter().map(|at| at[axis]).collect();
        keys.sort_by(f64::total_cmp);
        if keys.windows(2).any(|pair| pair[1] - pair[0] < TIE) {
            continue;
        }
        let place = others.iter().filter(|at| at[axis] > own.at[axis]).count();
        let (first, last, side) = match axis {
            2 => ("top", "bottom", "top"),
            _ => ("left", "right", "left"),
        };
        return match place {
            _ if count == 1 => category,
            0 => format!("{first} {category}"),
            place if place + 1 == count => format!("{last} {category}"),
            place => match ORDINALS.get(place) {
                Some(ordinal) => format!("{ordinal} {category} from the {side}"),
                None => category,
            },
        };
    }
    category
}

/// What a task file asks for: `door of a fridge in a kitchen`.
fn wanted(file: &TaskFile, from: &PlaceQuery) -> String {
    let object = &file.object;
    let leaf = match (&object.name, &object.category) {
        (Some(name), _) | (None, Some(name)) => plain(name),
        (None, None) => "door or drawer".to_owned(),
    };
    match (&from.name, &from.kind, &from.room) {
        (None, None, None) => format!("{leaf} of furniture that the robot moves"),
        (None, None, Some(room)) => format!("{leaf} in a {} that the robot moves", plain(room)),
        _ => format!("{leaf} of a {from} that the robot moves"),
    }
}

/// The doors and drawers that the robot moves, by furniture and room.
fn available(scene: &Scene) -> String {
    if scene.handles.is_empty() {
        return "it lists no door or drawer that the robot moves; a home that an earlier version imported has to be imported again".to_owned();
    }
    let words = scene.handles.iter().filter_map(|handle| {
        let body = &scene.furniture[scene.furniture_named(&handle.furniture)?];
        Some(format!(
            "{} of {}",
            plain(&body.category),
            handle.near.words()
        ))
    });
    format!("doors and drawers that the robot moves: {}", counted(words))
}
