//! The home as shipped: budgets, supports, lanes.

use std::path::PathBuf;

use super::*;
use crate::geometry::mesh;

/// The assets of this repository.
pub(crate) fn assets() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../assets"))
}

/// The home.
pub(crate) fn home() -> Scene {
    Scene::load(&assets(), "home").unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn the_home_stays_within_the_budget_of_triangles_and_ids() {
    let scene = home();
    let mut total = 0;
    for body in scene.furniture.iter().chain(&scene.objects) {
        let triangles: usize = body
            .visual
            .iter()
            .map(|v| mesh::build(&v.part.shape, &assets()).unwrap().indices.len() / 3)
            .sum();
        println!("{:20} {triangles}", body.name);
        total += triangles;
    }
    println!("total {total}");
    assert!(total <= 60_000, "{total} triangles");
    assert!(scene.furniture.len() + scene.objects.len() <= 200);
}
