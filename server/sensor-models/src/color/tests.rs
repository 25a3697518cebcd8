//! Tests of the colour camera.

use super::*;

const SIZE: [usize; 2] = [160, 96];

fn parameters() -> ColorParameters {
    ColorParameters {
        exposure_target: 0.2,
        exposure_speed: 0.3,
        exposure_range: [0.3, 4.0],
        white_balance: 0.0,
        gamma: 1.0,
        full_well: 5000.0,
        read_noise: 4.0,
        bit_rate: 0.0,
        coded_rate: 30.0,
        coding_gain: 4.0,
        rate: 30.0,
        phase: 0.0,
        age: Delay::NONE,
    }
}

fn exact(rgb: &[u8], tick: u64) -> Exact<'_> {
    Exact {
        lens: Lens {
            width: SIZE[0],
            height: SIZE[1],
            focal: [150.0; 2],
            principal: [80.0, 48.0],
        },
        tick,
        rgb,
        depth: &[],
        ids: &[],
    }
}

fn flat(level: u8) -> Vec<u8> {
    vec![level; 3 * SIZE[0] * SIZE[1]]
}

fn statistics(image: &[u8]) -> (f64, f64) {
    let n = image.len() as f64;
    let mean = image.iter().map(|v| f64::from(*v)).sum::<f64>() / n;
    let square = |v: &u8| (f64::from(*v) - mean).powi(2);
    (mean, (image.iter().map(square).sum::<f64>() / n).sqrt())
}

#[test]
fn strength_0_is_the_exact_image() {
    let rgb: Vec<u8> = (0..3 * SIZE[0] * SIZE[1])
        .map(|i| (i % 251) as u8)
        .collect();
    let with = ColorParameters {
        bit_rate: 4e6,
        white_balance: 0.1,
        gamma: 1.2,
        ..parameters()
    };
    let made = ColorModel::new(with, 1, 0.0).image(&exact(&rgb, 0));
    let worst = made.iter().zip(&rgb).map(|(a, b)| a.abs_diff(*b)).max();
    // 12 bits of linear levels distinguish the darkest sRGB levels.
    assert!(worst.unwrap() <= 1);
}

#[test]
fn photon_noise_has_the_deviation_of_counting() {
    for level in [60_u8, 118, 180] {
        let rgb = flat(level);
        let one = ColorParameters {
            exposure_range: [1.0, 1.0],
            ..parameters()
        };
        let made = ColorModel::new(one, 1, 1.0).image(&exact(&rgb, 0));
        let linear = to_linear(f64::from(level) / 255.0);
        let electrons = linear * 5000.0;
        let deviation = (electrons + 16.0).sqrt() / 5000.0;
        // Through the slope of the tone curve; quantisation adds 1/12.
        let slope = (to_srgb(linear + 1e-4) - to_srgb(linear - 1e-4)) / 2e-4;
        let expected = ((255.0 * slope * deviation).powi(2) + 1.0 / 12.0).sqrt();
        let (mean, found) = statistics(&made);
        assert!(
            (found / expected - 1.0).abs() < 0.05,
            "{found}, expected {expected}"
        );
        assert!((mean - f64::from(level)).abs() < 0.5);
    }
}

#[test]
fn exposure_approaches_its_target_by_a_share_per_image() {
    let mut model = ColorModel::new(parameters(), 1, 1.0);
    let (dark, bright) = (flat(70), flat(200));
    model.image(&exact(&bright, 0));
    let mut before = f64::INFINITY;
    for tick in 1..20 {
        let (mean, _) = statistics(&model.image(&exact(&dark, tick)));
        let aim = 255.0 * to_srgb(0.2);
        let off = (mean - aim).abs();
        assert!(off <= before + 0.5, "{off} after {before}");
        before = off;
    }
    assert!(before < 3.0, "{before}");
}

#[test]
fn coding_costs_detail_and_the_same_seed_gives_the_same_bits() {
    let rgb: Vec<u8> = (0..SIZE[1])
        .flat_map(|y| {
            (0..SIZE[0]).flat_map(move |x| [if (x / 3 + y / 5) % 2 == 0 { 60 } else { 170 }; 3])
        })
        .collect();
    let coded = ColorParameters {
        bit_rate: 1e5,
        ..parameters()
    };
    let run = |parameters: &ColorParameters, seed| {
        let mut model = ColorModel::new(parameters.clone(), seed, 1.0);
        (0..12)
            .map(|tick| model.image(&exact(&rgb, tick)))
            .collect::<Vec<_>>()
    };
    let (plain, coarse) = (run(&parameters(), 1), run(&coded, 1));
    assert_eq!(coarse, run(&coded, 1));
    assert_ne!(coarse, run(&coded, 2));
    let contrast = |all: &[Vec<u8>]| statistics(&all[11]).1;
    assert!(contrast(&coarse) < 0.98 * contrast(&plain));
}
