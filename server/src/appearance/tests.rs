//! Looks are deterministic for a seed and within their bounds.

use std::collections::BTreeSet;

use nalgebra::Vector3;

use super::*;

fn assets() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets")
}

fn appearance(seed: u64, strength: u8) -> Appearance {
    Appearance {
        seed,
        light: strength,
        background: strength,
        materials: strength,
        exposure: strength,
        decoration: strength,
        ..Appearance::default()
    }
}

fn drawn(appearance: Appearance) -> SampledAppearance {
    drawn_in("home", appearance)
}

fn drawn_in(scene: &str, appearance: Appearance) -> SampledAppearance {
    let scene = Scene::load(&assets(), scene).unwrap();
    SampledAppearance::new(appearance, &scene, &assets()).unwrap()
}

/// Names of the scenes of the assets.
fn scene_names() -> Vec<String> {
    let names = crate::scene::names(&assets(), "scenes").unwrap();
    assert!(!names.is_empty());
    names
}

#[test]
fn a_look_is_deterministic_and_its_axes_are_independent() {
    for scene in scene_names() {
        let all = appearance(5, 2);
        assert_eq!(drawn_in(&scene, all), drawn_in(&scene, all), "{scene}");
    }
    let all = appearance(5, 2);
    assert_eq!(drawn(all), drawn(all));
    assert_ne!(drawn(all).lighting, drawn(appearance(6, 2)).lighting);
    let light = Appearance {
        seed: 5,
        light: 2,
        ..Appearance::default()
    };
    assert_eq!(drawn(light).irradiance, {
        let none = Appearance { exposure: 0, ..all };
        drawn(none).irradiance
    });
    let decoration = Appearance {
        seed: 5,
        decoration: 2,
        ..Appearance::default()
    };
    assert_eq!(drawn(decoration).decoration, drawn(all).decoration);
}

#[test]
fn axes_that_are_off_change_nothing() {
    let home = Scene::load(&assets(), "home").unwrap();
    let exposure = Appearance {
        seed: 3,
        exposure: 3,
        ..Appearance::default()
    };
    let sampled = drawn(exposure);
    assert!(sampled.decoration.is_empty());
    assert_eq!(sampled.lighting.sun_direction, home.lighting.sun_direction);
    for body in &home.furniture {
        for visual in &body.visual {
            let was = &visual.material;
            let is = sampled.furniture(was);
            assert_eq!((is.color, &is.texture), (was.color, &was.texture));
        }
    }
    // A floor receives the sky, a ceiling the ground.
    let plain = Irradiance::hemispheric(home.lighting.sky, home.lighting.ground);
    for (n, light) in [
        (Vector3::z(), home.lighting.sky),
        (-Vector3::z(), home.lighting.ground),
    ] {
        let found = plain.evaluate(&n);
        assert!(
            (0..3).all(|k| (found[k] - light[k]).abs() < 1e-6),
            "{found:?}"
        );
    }
}

/// As the shader displays it.
fn displayed(c: f32) -> f32 {
    (c * (6.2 * c + 0.5)) / (c * (6.2 * c + 1.7) + 0.06)
}

#[test]
fn no_look_clips_a_white_wall_or_leaves_it_black() {
    for scene in scene_names() {
        check_brightness(&scene);
    }
}

fn check_brightness(name: &str) {
    let scene = Scene::load(&assets(), name).unwrap();
    let file = file::load(&assets(), name).unwrap();
    let (mut darkest, mut brightest) = (1.0f32, 0.0f32);
    for seed in 0..300 {
        for strength in 1..=3 {
            let appearance = appearance(seed, strength);
            let light = light::draw(&appearance, &file, scene.lighting);
            let gain = light::exposure(&appearance);
            let irradiance = light.irradiance.times(gain);
            for k in 0..3 {
                for sign in [1.0, -1.0] {
                    let n: Vector3<f32> = Vector3::ith(k, sign);
                    let around = irradiance.evaluate(&n);
                    let sun = Vector3::from(light.lighting.sun_direction).dot(&n).max(0.0);
                    for c in 0..3 {
                        let shade = displayed(0.85 * 0.7 * around[c]);
                        let sunny = 0.85 * (around[c] + sun * light.lighting.sun[c] * gain[c]);
                        darkest = darkest.min(shade);
                        brightest = brightest.max(displayed(sunny));
                    }
                }
            }
            let up = Vector3::from(light.lighting.sun_direction);
            assert!((up.norm() - 1.0).abs() < 1e-5 && up.z > 0.3);
            let stops = 0.7 * f32::from(strength) / 3.0;
            assert!(gain.iter().all(|g| g.log2().abs() <= stops + 0.15));
        }
    }
    assert!(darkest > 0.12, "{name}: {darkest}");
    assert!(brightest < 0.975, "{name}: {brightest}");
}

#[test]
fn strong_looks_show_every_sky_and_stay_in_their_families() {
    let home = Scene::load(&assets(), "home").unwrap();
    let file = file::load(&assets(), "home").unwrap();
    assert!(file.sky.len() >= 8);
    let mut panes = BTreeSet::new();
    let mut floors = BTreeSet::new();
    for seed in 0..60 {
        let sampled = drawn(appearance(seed, 3));
        panes.insert((sampled.outdoors * 1e4) as i64);
        for body in &home.furniture {
            for visual in &body.visual {
                let was = &visual.material;
                let is = sampled.furniture(was);
                assert_eq!((is.family, is.transmission), (was.family, was.transmission));
                assert_eq!(is.metallic, was.metallic);
                if was.family == Some(Family::Outdoors) {
                    assert!((0..3).all(|k| is.color[k] <= was.color[k]));
                    continue;
                }
                let Some(family) = was.family else {
                    assert_eq!((is.color, &is.texture), (was.color, &was.texture));
                    continue;
                };
                let palette = file.family.get(&family);
                let allowed = |p: &file::Palette| p.colors.contains(&file::Color(is.color));
                assert!(is.color == was.color || palette.is_some_and(allowed));
                if family == Family::Floor {
                    floors.insert(is.texture.map(|t| t.pattern));
                }
            }
        }
        // The same material has the same replacement everywhere.
        let oak = &home.furniture[home.furniture_named("coffee_table").unwrap()].visual[0].material;
        assert_eq!(sampled.furniture(oak), sampled.furniture(&oak.clone()));
    }
    assert!(panes.len() > 30 && floors.len() == 4, "{floors:?}");
}

#[test]
fn the_reflection_is_brighter_at_the_windows_and_smoother_at_each_level() {
    let sampled = drawn(appearance(1, 1));
    let contrast = |level: &Vec<u8>| {
        let values = level.as_chunks::<4>().0.iter().map(|p| p[1]);
        values.clone().max().unwrap() - values.min().unwrap()
    };
    let levels = &sampled.reflection.levels;
    let sides: Vec<usize> = levels.iter().map(|level| level.len() / 4).collect();
    assert_eq!(sides, [64 * 64, 32 * 32, 16 * 16, 8 * 8, 4 * 4]);
    let contrasts: Vec<u8> = levels.iter().map(contrast).collect();
    assert!(contrasts.windows(2).all(|w| w[0] >= w[1]), "{contrasts:?}");
    assert!(contrasts[0] > 80, "{contrasts:?}");
}

#[test]
fn errors_in_a_file_name_line_key_value_and_allowed_values() {
    let folder = std::env::temp_dir().join(format!("looks{}", std::process::id()));
    std::fs::create_dir_all(folder.join("appearances")).unwrap();
    std::fs::create_dir_all(folder.join("textures")).unwrap();
    let good = std::fs::read_to_string(assets().join("appearances/home.toml")).unwrap();
    let error_of = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        let text = good.replacen(from, to, 1);
        std::fs::write(folder.join("appearances/home.toml"), text).unwrap();
        file::load(&folder, "home").unwrap_err().to_string()
    };
    for (from, to, words) in [
        (
            "sun = 1.7",
            "sun = 9.0",
            ["sun = 9.0", "9, expected 0 to 3"],
        ),
        (
            "[35, 50]",
            "[50, 35]",
            ["elevation_deg", "lower value first"],
        ),
        ("\"#bcd6f5\"", "\"blue\"", ["color", "expected a colour as"]),
        (
            "family.wall",
            "family.wal",
            ["family.wal", "expected one of"],
        ),
        (
            "brightness = 1.0",
            "bright = 1.0",
            ["bright", "expected one of"],
        ),
        (
            "\"rug\"",
            "\"sofa\"",
            ["kind = \"sofa\"", "`picture`, `rug`"],
        ),
    ] {
        let message = error_of(from, to);
        assert!(
            message.contains("appearances/home.toml") && message.contains("line"),
            "{message}"
        );
        assert!(words.iter().all(|w| message.contains(w)), "{message}");
    }
    let message = error_of("origin", "origin");
    assert!(
        message.contains("family.wall.textures") && message.contains("\"plaster\""),
        "{message}"
    );
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn fruit_and_flowers_never_have_fabric() {
    let home = Scene::load(&assets(), "home").unwrap();
    for (name, family) in [
        ("fruit_bowl", Family::Fruit),
        ("table_vase", Family::Flower),
    ] {
        let body = home
            .furniture
            .iter()
            .find(|body| body.name == name)
            .unwrap();
        let balls = body.visual.iter().map(|visual| &visual.material);
        let balls: Vec<_> = balls.filter(|m| m.family == Some(family)).collect();
        assert!(balls.len() >= 4, "{name}");
        assert!(
            body.visual
                .iter()
                .all(|v| v.material.family != Some(Family::Fabric))
        );
        let colors: BTreeSet<_> = (0..40)
            .map(|seed| drawn(appearance(seed, 3)).furniture(balls[0]))
            .map(|material| {
                assert_eq!(material.texture, None, "{name}");
                material.color.map(f32::to_bits)
            })
            .collect();
        assert!(colors.len() > 3, "{name}");
    }
}
