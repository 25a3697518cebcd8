//! Laws of the depth camera.

use super::*;

fn parameters() -> DepthParameters {
    DepthParameters {
        lens: Lens {
            width: 480,
            height: 270,
            focal: [360.0, 360.0],
            principal: [243.9, 137.9],
        },
        offset: [-0.0195, -0.005, 0.0],
        baseline: 0.055,
        disparity_noise: 0.1,
        disparity_step: 0.0,
        range: [0.15, 10.0],
        flying: 0.3,
        edge_holes: 0.3,
        edge: 1.0,
        holes: [0.0, 0.9, 0.6, 0.3, 0.5],
        hole_size: 4.0,
        rate: 15.0,
        phase: 0.0,
        age: Delay::NONE,
    }
}

const COLOR: Lens = Lens {
    width: 640,
    height: 360,
    focal: [648.85, 648.85],
    principal: [310.5, 119.2],
};

/// A picture whose depth and id follow from the point's direction (X/Z, Y/Z).
struct Seen {
    depth: Vec<u8>,
    ids: Vec<u8>,
}

impl Seen {
    fn of(at: impl Fn(f64, f64) -> (f32, u16)) -> Self {
        let (mut depth, mut ids) = (Vec::new(), Vec::new());
        for y in 0..COLOR.height {
            for x in 0..COLOR.width {
                let right = (x as f64 + 0.5 - COLOR.principal[0]) / COLOR.focal[0];
                let down = (y as f64 + 0.5 - COLOR.principal[1]) / COLOR.focal[1];
                let (z, id) = at(right, down);
                depth.extend(z.to_le_bytes());
                ids.extend(id.to_le_bytes());
            }
        }
        Self { depth, ids }
    }

    fn exact(&self, tick: u64) -> Exact<'_> {
        Exact {
            lens: COLOR,
            tick,
            rgb: &[],
            depth: &self.depth,
            ids: &self.ids,
        }
    }
}

fn pixels(picture: &[u8]) -> Vec<u16> {
    let (pairs, _) = picture.as_chunks::<2>();
    pairs.iter().map(|&p| u16::from_le_bytes(p)).collect()
}

fn model(strength: f64) -> DepthModel {
    DepthModel::new(parameters(), 1, strength)
}

#[test]
fn noise_grows_with_the_square_of_the_distance() {
    for z in [0.5_f32, 1.0, 2.0] {
        let seen = Seen::of(|_, _| (z, 0));
        let mut model = model(1.0);
        let mut all = Vec::new();
        for tick in 0..4 {
            let picture = pixels(&model.picture(&seen.exact(tick), &[]));
            all.extend(picture.into_iter().filter(|v| *v > 0).map(f64::from));
        }
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let variance = all.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / all.len() as f64;
        // Writing whole millimetres adds 1/12.
        let deviation = (variance - 1.0 / 12.0).sqrt();
        let expected = 1000.0 * f64::from(z * z) * 0.1 / (360.0 * 0.055);
        assert!(
            (deviation / expected - 1.0).abs() < 0.05,
            "at {z} m: {deviation} mm, expected {expected}"
        );
        assert!((mean / (1000.0 * f64::from(z)) - 1.0).abs() < 0.002);
    }
}

#[test]
fn a_plane_is_seen_where_it_should_be() {
    // A board of 40 cm by 20 cm before a wall, and a plane that slants.
    let (board, wall) = (0.8_f64, 1.6_f64);
    let seen = Seen::of(|right, down| {
        let on = (right * board).abs() < 0.2 && (down * board).abs() < 0.1;
        (if on { board } else { wall } as f32, u16::from(on))
    });
    let p = parameters();
    let picture = pixels(&model(0.0).picture(&seen.exact(0), &[]));
    let at = |x: f64, y: f64, z: f64| {
        let u = p.lens.focal[0] * (x - p.offset[0]) / z + p.lens.principal[0];
        let v = p.lens.focal[1] * (y - p.offset[1]) / z + p.lens.principal[1];
        (u, v)
    };
    let (left, top) = at(-0.2, -0.1, board);
    let (right, bottom) = at(0.2, 0.1, board);
    let mut far = 0;
    for (i, &mm) in picture.iter().enumerate() {
        let (x, y) = ((i % 480) as f64 + 0.5, (i / 480) as f64 + 0.5);
        let within = |a: f64, x: f64, b: f64| a + 1.0 < x && x < b - 1.0;
        if within(left, x, right) && within(top, y, bottom) {
            assert_eq!(mm, 800, "at {x}, {y}");
        } else if x < left - 1.0 || x > right + 1.0 || y < top - 1.0 || y > bottom + 1.0 {
            assert!(mm == 0 || mm == 1600, "{mm} at {x}, {y}");
            far += usize::from(mm > 0);
        }
    }
    assert!(far > 20_000, "{far} pixels of the wall");

    // z = 1 + 0.5·X: seen along (r, d) at z = 1/(1 - 0.5·r).
    let slanted = Seen::of(|right, _| ((1.0 / (1.0 - 0.5 * right)) as f32, 0));
    let picture = pixels(&model(0.0).picture(&slanted.exact(0), &[]));
    let mut error: f64 = 0.0;
    let mut count = 0;
    for (i, &mm) in picture.iter().enumerate().filter(|(_, mm)| **mm > 0) {
        let right = ((i % 480) as f64 + 0.5 - p.lens.principal[0]) / p.lens.focal[0];
        // X = r·z + tx, z = 1 + 0.5·X.
        let z = (1.0 + 0.5 * p.offset[0]) / (1.0 - 0.5 * right);
        error += (f64::from(mm) / 1000.0 / z - 1.0).abs();
        count += 1;
    }
    let error = error / f64::from(count);
    assert!(error < 0.001 && count > 50_000, "{error}, {count} pixels");
}

#[test]
fn the_second_eye_casts_a_shadow_as_wide_as_the_disparities_differ() {
    let seen = Seen::of(|right, _| (if right * 0.8 < 0.0 { 1.6 } else { 0.8 }, 0));
    let picture = pixels(&model(0.0).picture(&seen.exact(0), &[]));
    // Left of the near board's left edge stands what the right eye does not see:
    // f·b·(1/0.8 - 1/1.6) = 12.4 pixels.
    let row = &picture[100 * 480..101 * 480];
    let edge = row.iter().position(|mm| *mm == 800).unwrap();
    let hole = row[..edge].iter().rev().take_while(|mm| **mm == 0).count();
    assert!((11..=14).contains(&hole), "{hole} pixels");
}

#[test]
fn surfaces_lose_the_share_that_is_theirs() {
    let classes = Surface::ALL;
    for (id, class) in classes.into_iter().enumerate() {
        let seen = Seen::of(|_, _| (1.0, id as u16));
        let (mut model, full) = (model(1.0), model(0.0).picture(&seen.exact(0), &classes));
        let returns = |picture: Vec<u8>| pixels(&picture).iter().filter(|v| **v > 0).count();
        let full = returns(full) as f64;
        let mut lost = 0.0;
        for tick in 0..8 {
            lost += 1.0 - returns(model.picture(&seen.exact(tick), &classes)) as f64 / full;
        }
        let (lost, expected) = (lost / 8.0, parameters().holes[id]);
        assert!(
            (lost - expected).abs() < 0.015,
            "{}: {lost}, expected {expected}",
            class.name()
        );
    }
}

#[test]
fn edges_bleed_and_what_is_too_near_has_no_return() {
    let seen = Seen::of(|_, down| (if down < 0.0 { 0.5 } else { 1.0 }, 0));
    let picture = pixels(&model(1.0).picture(&seen.exact(0), &[]));
    let between = picture.iter().filter(|mm| (540..940).contains(*mm)).count();
    assert!(between > 30, "{between} pixels between near and far");
    let near = Seen::of(|_, _| (0.14, 0));
    let picture = pixels(&model(0.0).picture(&near.exact(0), &[]));
    assert!(picture.iter().all(|mm| *mm == 0));
}

#[test]
fn disparity_comes_in_the_steps_of_the_parameters() {
    let stepped = DepthParameters {
        disparity_step: 0.125,
        ..parameters()
    };
    let seen = Seen::of(|_, _| (2.0, 0));
    let picture = pixels(&DepthModel::new(stepped, 1, 1.0).picture(&seen.exact(0), &[]));
    let mut values: Vec<u16> = picture.into_iter().filter(|v| *v > 0).collect();
    values.sort_unstable();
    values.dedup();
    // 9.9 pixels ± 4σ in eighths.
    assert!((4..=10).contains(&values.len()), "{values:?}");
}

#[test]
fn the_same_seed_gives_the_same_bits_and_another_one_others() {
    let seen = Seen::of(|right, _| (1.0 + 0.2 * right as f32, 1));
    let classes = [Surface::Matte, Surface::Glass];
    let take =
        |seed, tick| DepthModel::new(parameters(), seed, 1.0).picture(&seen.exact(tick), &classes);
    assert_eq!(take(1, 24), take(1, 24));
    assert_ne!(take(1, 24), take(2, 24));
    assert_ne!(take(1, 24), take(1, 48));
    // Strength 0 knows no seed.
    let perfect = |seed| DepthModel::new(parameters(), seed, 0.0).picture(&seen.exact(0), &classes);
    assert_eq!(perfect(1), perfect(2));
}
