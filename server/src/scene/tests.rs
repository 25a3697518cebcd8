//! The home as shipped.

use std::path::PathBuf;

use super::*;

/// The assets of this repository.
pub(crate) fn assets() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../assets"))
}

#[test]
fn the_home_loads() {
    let scene = Scene::load(&assets(), "home").unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(scene.furniture[0].name, "floor");
    assert!(scene.object_named("mustard").is_some());
}
