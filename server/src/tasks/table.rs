//! Samples as a table, one line each, for classifiers.

use std::fmt::Write;

use nalgebra::{Isometry3, Vector3};
use wheelarm_proto::exact;

use super::area::AreaSpec;
use super::task_sampling::TaskSample;
use crate::scene::{Placement, Scene};

/// Columns of the table, comma separated: metres, radians, kg, N and N·s/m. `up` is the
/// cosine between the object's upright axis and the vertical, `home` lists the sampled
/// areas. All values of an absent object are zero. The areas of one home have the same
/// columns.
#[must_use]
pub fn columns(area: &AreaSpec) -> String {
    let mut text = "task,target,variant,home,seed,start_x,start_y,start_yaw,knuckle".to_owned();
    let mut add = |name: &str| {
        let _ = write!(text, ",{name}");
    };
    for joint in 1..=6 {
        add(&format!("arm_{joint}"));
    }
    for object in objects(area) {
        for what in ["there", "x", "y", "z", "yaw", "up", "mass", "friction"] {
            add(&format!("{object}_{what}"));
        }
    }
    for joint in slides(area) {
        for what in ["friction", "damping", "position"] {
            add(&format!("{joint}_{what}"));
        }
    }
    text
}

/// One sample as a line of the table of its area. `scene` is the sampled scene.
#[must_use]
pub fn row(
    area: &AreaSpec,
    scene: &Scene,
    task: &str,
    variant: &str,
    seed: u64,
    draw: &TaskSample,
) -> String {
    let mut home: Vec<&str> = draw.scene.surroundings.iter().map(String::as_str).collect();
    home.push(&area.name);
    home.sort_unstable();
    let home = home.join("+");
    let mut text = format!("{task},{},{variant},{home},{seed}", draw.target);
    let mut add = |value: f64| {
        let _ = write!(text, ",{value:.4}");
    };
    let drawn = &draw.scene;
    for value in place(&drawn.start) {
        add(value);
    }
    add(drawn.knuckle.unwrap_or(0.0));
    for position in drawn.arm.unwrap_or_default() {
        add(position);
    }
    for object in objects(area) {
        let placement = scene.object_named(object).and_then(|i| drawn.placements[i]);
        let numbers = placement.map_or(
            [0.0; 8],
            |Placement {
                 pose,
                 mass,
                 friction,
             }| {
                let [x, y, yaw] = place(&pose);
                let up = (pose.rotation * Vector3::z()).z;
                [1.0, x, y, pose.translation.z, yaw, up, mass, friction]
            },
        );
        for value in numbers {
            add(value);
        }
    }
    for joint in slides(area) {
        if let Some(joint) = scene.joint_named(joint) {
            let resistance = drawn.slides[joint];
            add(resistance.friction);
            add(resistance.damping);
            add(drawn.positions[joint]);
        }
    }
    text
}

/// An area and its surroundings.
fn areas(area: &AreaSpec) -> impl Iterator<Item = &AreaSpec> {
    [area].into_iter().chain(&area.surroundings)
}

/// Every joint that an area of the home slides.
fn slides(area: &AreaSpec) -> Vec<&str> {
    let slides = areas(area).flat_map(|area| &area.slides);
    let mut names: Vec<&str> = slides.map(|slide| slide.joint.as_str()).collect();
    names.sort_unstable();
    names
}

/// Every object that an area of the home places.
fn objects(area: &AreaSpec) -> Vec<&str> {
    let variants = areas(area).flat_map(|area| &area.variants);
    let places = variants.flat_map(|variant| &variant.places);
    let mut names: Vec<&str> = places.map(|place| place.object.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    names
}

/// Position on the floor plan and rotation about the vertical.
fn place(pose: &Isometry3<f64>) -> [f64; 3] {
    let forward = pose.rotation * Vector3::x();
    let yaw = exact::atan2(forward.y, forward.x);
    [pose.translation.x, pose.translation.y, yaw]
}
