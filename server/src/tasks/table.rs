//! Draws as a table, one line each: what a classifier may see of them.

use std::fmt::Write;

use nalgebra::{Isometry3, Vector3};
use wheelarm_proto::exact;

use super::area::AreaSpec;
use super::draw::Draw;
use crate::scene::{Placement, Scene};

/// Columns of the table of an area, comma separated: metres, radians, kg, N and
/// N·s/m. An object that is not there is all zero.
#[must_use]
pub fn columns(area: &AreaSpec) -> String {
    let mut text = "task,target,variant,seed,start_x,start_y,start_yaw,knuckle".to_owned();
    let mut add = |name: &str| {
        let _ = write!(text, ",{name}");
    };
    for joint in 1..=6 {
        add(&format!("arm_{joint}"));
    }
    for object in objects(area) {
        for what in ["there", "x", "y", "yaw", "mass", "friction"] {
            add(&format!("{object}_{what}"));
        }
    }
    for slide in &area.slides {
        for what in ["friction", "damping", "position"] {
            add(&format!("{}_{what}", slide.joint));
        }
    }
    text
}

/// One draw as a line of the table of its area. `scene` is the one that was drawn.
#[must_use]
pub fn row(
    area: &AreaSpec,
    scene: &Scene,
    task: &str,
    variant: &str,
    seed: u64,
    draw: &Draw,
) -> String {
    let mut text = format!("{task},{},{variant},{seed}", draw.target);
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
            [0.0; 6],
            |Placement {
                 pose,
                 mass,
                 friction,
             }| {
                let [x, y, yaw] = place(&pose);
                [1.0, x, y, yaw, mass, friction]
            },
        );
        for value in numbers {
            add(value);
        }
    }
    for slide in &area.slides {
        if let Some(joint) = scene.joint_named(&slide.joint) {
            let resistance = drawn.slides[joint];
            add(resistance.friction);
            add(resistance.damping);
            add(drawn.positions[joint]);
        }
    }
    text
}

/// Every object that any variant of an area places.
fn objects(area: &AreaSpec) -> Vec<&str> {
    let places = area.variants.iter().flat_map(|variant| &variant.places);
    let mut names: Vec<&str> = places.map(|place| place.object.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    names
}

/// Place on the floor plan and turn about the vertical.
fn place(pose: &Isometry3<f64>) -> [f64; 3] {
    let forward = pose.rotation * Vector3::x();
    let yaw = exact::atan2(forward.y, forward.x);
    [pose.translation.x, pose.translation.y, yaw]
}
