//! Tests of the depth camera.

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
        window: 7,
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

/// The same camera at another size.
fn sized(width: usize, height: usize) -> DepthParameters {
    let mut p = parameters();
    let scale = width as f64 / p.lens.width as f64;
    p.lens = Lens {
        width,
        height,
        focal: p.lens.focal.map(|f| f * scale),
        principal: p.lens.principal.map(|c| c * scale),
    };
    p
}

/// An exact image whose depth and ID are functions of the direction (X/Z, Y/Z).
struct TestView {
    lens: Lens,
    depth: Vec<u8>,
    ids: Vec<u8>,
}

impl TestView {
    fn of(at: impl Fn(f64, f64) -> (f32, u16)) -> Self {
        Self::through(parameters().lens, at)
    }

    fn through(lens: Lens, at: impl Fn(f64, f64) -> (f32, u16)) -> Self {
        let (mut depth, mut ids) = (Vec::new(), Vec::new());
        for y in 0..lens.height {
            for x in 0..lens.width {
                let right = (x as f64 + 0.5 - lens.principal[0]) / lens.focal[0];
                let down = (y as f64 + 0.5 - lens.principal[1]) / lens.focal[1];
                let (z, id) = at(right, down);
                depth.extend(z.to_le_bytes());
                ids.extend(id.to_le_bytes());
            }
        }
        Self { lens, depth, ids }
    }

    fn exact(&self, tick: u64) -> Exact<'_> {
        Exact {
            lens: self.lens,
            tick,
            rgb: &[],
            depth: &self.depth,
            ids: &self.ids,
        }
    }

    fn depths(&self) -> Vec<f64> {
        let (depths, _) = self.depth.as_chunks::<4>();
        depths
            .iter()
            .map(|z| f64::from(f32::from_le_bytes(*z)))
            .collect()
    }
}

fn pixels(image: &[u8]) -> Vec<u16> {
    let (pairs, _) = image.as_chunks::<2>();
    pairs.iter().map(|&p| u16::from_le_bytes(p)).collect()
}

fn model(strength: f64) -> DepthModel {
    DepthModel::new(parameters(), 1, strength)
}

#[test]
fn noise_grows_with_the_square_of_the_distance() {
    for z in [0.5_f32, 1.0, 2.0] {
        let view = TestView::of(|_, _| (z, 0));
        let model = model(1.0);
        let mut all = Vec::new();
        for tick in 0..4 {
            let image = pixels(&model.image(&view.exact(tick), &[]));
            all.extend(image.into_iter().filter(|v| *v > 0).map(f64::from));
        }
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let variance = all.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / all.len() as f64;
        // Rounding to millimetres adds 1/12.
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
fn a_perfect_sensor_returns_the_exact_depth_of_every_pixel_that_both_eyes_see() {
    // A board of 40 cm by 20 cm in front of a wall, and a slanted plane.
    let board = TestView::of(|right, down| {
        let on = (right * 0.8).abs() < 0.2 && (down * 0.8).abs() < 0.1;
        (if on { 0.8 } else { 1.6 }, u16::from(on))
    });
    let slanted = TestView::of(|right, _| ((1.0 / (1.0 - 0.5 * right)) as f32, 0));
    for view in [board, slanted] {
        let image = pixels(&model(0.0).image(&view.exact(0), &[]));
        let mut returns = 0;
        for (mm, z) in image.iter().zip(view.depths()).filter(|(mm, _)| **mm > 0) {
            assert!(
                (f64::from(*mm) - 1000.0 * z).abs() <= 0.51,
                "{mm} mm of {z} m"
            );
            returns += 1;
        }
        let share = f64::from(returns) / image.len() as f64;
        assert!(share > 0.9, "{share} of the pixels have a return");
    }
}

#[test]
fn nine_in_ten_pixels_of_a_plain_view_have_a_return() {
    let wall = TestView::of(|right, down| ((0.8 + 0.1 * right + 0.1 * down) as f32, 0));
    let p = DepthParameters {
        holes: [0.005, 0.9, 0.85, 0.5, 0.4],
        ..parameters()
    };
    let image = pixels(&DepthModel::new(p, 3, 1.0).image(&wall.exact(7), &[]));
    let returns = image.iter().filter(|mm| **mm > 0).count() as f64 / image.len() as f64;
    assert!(returns >= 0.9, "{returns} of the pixels have a return");
    // Only the left band is outside the view of the second camera.
    let right = image.chunks(480).flat_map(|row| &row[60..]);
    let returns = right.clone().filter(|mm| **mm > 0).count() as f64 / right.count() as f64;
    assert!(returns >= 0.98, "{returns} of the pixels right of the band");
}

#[test]
fn noise_is_correlated_over_the_matching_window() {
    let window = parameters().window;
    let view = TestView::of(|_, _| (1.5, 0));
    let model = model(1.0);
    let (width, height) = (480, 270);
    // Right of the region that the second camera does not see.
    let first = 40;
    let mut products = vec![[0.0; 2]; window + 4];
    let mut counts = vec![[0.0; 2]; window + 4];
    for tick in 0..8 {
        let image = pixels(&model.image(&view.exact(tick), &[]));
        let error = |x: usize, y: usize| f64::from(image[y * width + x]) - 1500.0;
        for (lag, (products, counts)) in products.iter_mut().zip(&mut counts).enumerate() {
            for y in 0..height - lag {
                for x in first..width - lag {
                    products[0] += error(x, y) * error(x + lag, y);
                    products[1] += error(x, y) * error(x, y + lag);
                    counts.iter_mut().for_each(|count| *count += 1.0);
                }
            }
        }
    }
    let covariance = |lag: usize, axis: usize| products[lag][axis] / counts[lag][axis];
    for axis in 0..2 {
        for lag in 1..window + 4 {
            let found = covariance(lag, axis) / covariance(0, axis);
            let expected = (1.0 - lag as f64 / window as f64).max(0.0);
            assert!(
                (found - expected).abs() < 0.05,
                "axis {axis}, {lag} pixels apart: {found}, expected {expected}"
            );
        }
    }
}

#[test]
fn depth_has_no_bias_at_small_and_large_sizes() {
    for [width, height] in [[320, 180], [1280, 720]] {
        let p = sized(width, height);
        let per_square = p.disparity_noise / (p.lens.focal[0] * p.baseline);
        // Over many millimetres, so that rounding averages out.
        let near = TestView::through(p.lens, |right, down| {
            ((0.4 + 0.1 * right + 0.05 * down) as f32, 0)
        });
        let model = DepthModel::new(p, 5, 1.0);
        let (mut sum, mut count) = (0.0, 0.0);
        for tick in 0..4 {
            let image = pixels(&model.image(&near.exact(tick), &[]));
            for (mm, z) in image.iter().zip(near.depths()).filter(|(mm, _)| **mm > 0) {
                sum += (f64::from(*mm) / 1000.0 - z) / (per_square * z * z);
                count += 1.0;
            }
        }
        let bias = sum / count;
        assert!(bias.abs() < 0.1, "{width}x{height}: bias of {bias} σ");
        assert!(count > 3.0 * (width * height) as f64, "{count} returns");
    }
}

#[test]
fn the_occluded_band_is_as_wide_as_the_difference_of_disparities() {
    let view = TestView::of(|right, _| (if right * 0.8 < 0.0 { 1.6 } else { 0.8 }, 0));
    let image = pixels(&model(0.0).image(&view.exact(0), &[]));
    // Left of the near board's left edge is the region that the right camera does not
    // see: f·b·(1/0.8 - 1/1.6) = 12.4 pixels.
    let row = &image[100 * 480..101 * 480];
    let edge = row.iter().position(|mm| *mm == 800).unwrap();
    let hole = row[..edge].iter().rev().take_while(|mm| **mm == 0).count();
    assert!((11..=14).contains(&hole), "{hole} pixels");
}

#[test]
fn each_surface_loses_its_share_of_returns() {
    let classes = Surface::ALL;
    for (id, class) in classes.into_iter().enumerate() {
        let view = TestView::of(|_, _| (1.0, id as u16));
        let (model, full) = (model(1.0), model(0.0).image(&view.exact(0), &classes));
        let returns = |image: Vec<u8>| pixels(&image).iter().filter(|v| **v > 0).count();
        let full = returns(full) as f64;
        let mut lost = 0.0;
        for tick in 0..8 {
            lost += 1.0 - returns(model.image(&view.exact(tick), &classes)) as f64 / full;
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
fn edges_have_flying_pixels_and_too_near_surfaces_no_return() {
    let view = TestView::of(|_, down| (if down < 0.0 { 0.5 } else { 1.0 }, 0));
    let image = pixels(&model(1.0).image(&view.exact(0), &[]));
    let between = image.iter().filter(|mm| (540..940).contains(*mm)).count();
    assert!(between > 30, "{between} pixels between near and far");
    let near = TestView::of(|_, _| (0.14, 0));
    let image = pixels(&model(0.0).image(&near.exact(0), &[]));
    assert!(image.iter().all(|mm| *mm == 0));
}

#[test]
fn disparity_is_quantised_in_the_given_steps() {
    let stepped = DepthParameters {
        disparity_step: 0.125,
        ..parameters()
    };
    let view = TestView::of(|_, _| (2.0, 0));
    let image = pixels(&DepthModel::new(stepped, 1, 1.0).image(&view.exact(0), &[]));
    let mut values: Vec<u16> = image.into_iter().filter(|v| *v > 0).collect();
    values.sort_unstable();
    values.dedup();
    // 9.9 pixels ± 4σ in eighths.
    assert!((4..=10).contains(&values.len()), "{values:?}");
}

#[test]
fn only_the_same_seed_gives_the_same_bits() {
    let view = TestView::of(|right, _| (1.0 + 0.2 * right as f32, 1));
    let classes = [Surface::Matte, Surface::Glass];
    let take =
        |seed, tick| DepthModel::new(parameters(), seed, 1.0).image(&view.exact(tick), &classes);
    assert_eq!(take(1, 24), take(1, 24));
    assert_ne!(take(1, 24), take(2, 24));
    assert_ne!(take(1, 24), take(1, 48));
    // Strength 0 does not depend on the seed.
    let perfect = |seed| DepthModel::new(parameters(), seed, 0.0).image(&view.exact(0), &classes);
    assert_eq!(perfect(1), perfect(2));
}
