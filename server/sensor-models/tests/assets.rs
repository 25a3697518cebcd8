//! The bundled parameter files: each is valid, not empty, and names existing materials.

use std::path::{Path, PathBuf};

use wheelarm_sensor_models::{Model, Surface, Surfaces, surface};

fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets")
}

fn text(path: &str) -> String {
    std::fs::read_to_string(assets().join(path)).unwrap()
}

#[test]
fn every_file_is_a_model_with_a_source_for_every_parameter() {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(assets().join("sensors")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        let path = format!("sensors/{name}");
        if path == surface::FILE {
            continue;
        }
        let model = Model::read(&path, &text(&path)).unwrap();
        assert_ne!(model, Model::default(), "{path} describes no sensor");
        names.push(name);
    }
    names.sort();
    assert!(names.len() >= 6, "{names:?}");

    // The parser requires a source.
    let whole = text("sensors/imu.toml");
    for line in whole.lines().filter(|l| l.contains("source = \"")) {
        let source = line.split("source = \"").nth(1).unwrap();
        let without = whole.replacen(source, "\" }", 1);
        let error = Model::read("sensors/imu.toml", &without).unwrap_err();
        assert!(error.to_string().contains("source"), "{error}");
    }
}

/// The materials of every file: its path, their names and their values.
fn materials() -> Vec<(String, String, toml::Table)> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(assets().join("materials")).unwrap() {
        let path = format!("materials/{}", entry.unwrap().file_name().display());
        let file: toml::Table = text(&path).parse().unwrap();
        for (name, values) in file["material"].as_table().unwrap() {
            let values = values.as_table().unwrap().clone();
            all.push((path.clone(), name.clone(), values));
        }
    }
    assert!(all.len() > 20, "{} materials", all.len());
    all
}

#[test]
fn surfaces_refer_to_existing_materials() {
    let surfaces = Surfaces::read(&text(surface::FILE)).unwrap();
    let materials = materials();
    for name in surfaces.materials() {
        let known = materials.iter().any(|(_, known, _)| known == name);
        assert!(known, "no material {name} in assets/materials");
    }
    // A material that an infrared stereo camera loses has a class.
    for (file, name, values) in &materials {
        let value = |key: &str, default: f64| {
            let number = values.get(key).and_then(toml::Value::as_float);
            number.unwrap_or(default)
        };
        let is_lost = value("transmission", 0.0) > 0.0
            || value("metallic", 0.0) >= 0.3
            || value("roughness", 1.0) < 0.15;
        assert!(
            !is_lost || surfaces.materials().any(|known| known == name),
            "{file}: {name} transmits or reflects; give it a class in assets/{}",
            surface::FILE
        );
    }
    for class in &Surface::ALL[1..] {
        assert!(surfaces.materials().any(|m| surfaces.class_of(m) == *class));
    }
    // The largest visible area decides.
    let shown = [("glass", 1.0), ("oak", 3.0), ("glass_green", 1.5)];
    assert_eq!(surfaces.of_instance(shown), Surface::Matte);
    let shown = [("glass", 1.0), ("oak", 2.0), ("glass_green", 1.5)];
    assert_eq!(surfaces.of_instance(shown), Surface::Glass);
}
