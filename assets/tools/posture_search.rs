//! Looks for postures of the arm in which the robot may start: within its
//! outlines, touching nothing of itself, there and on the straight way home in
//! joint space. Prints them as lines for robot.toml.
//!
//! `posture_search [ASSETS] [COUNT]`

use std::path::PathBuf;

use anyhow::Result;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use wheelarm_server::robot::RobotModel;
use wheelarm_server::robot::control::{ArmIntent, ControlInput};
use wheelarm_server::sim::{Scenario, Simulation};
use wheelarm_server::snapshot::BodyRef;

/// Kept postures differ by at least this much, rad, summed in squares.
const APART: f64 = 0.7;

fn main() -> Result<()> {
    let arguments: Vec<_> = std::env::args().collect();
    let assets = PathBuf::from(arguments.get(1).map_or("assets", String::as_str));
    let count = arguments.get(2).map_or(Ok(24), |text| text.parse())?;
    let model = RobotModel::load(&assets, "wheelarm")?;
    let home = model.settings.home;
    println!(
        "# home within the outlines: {}",
        model.is_within_outlines(&home)
    );
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut kept: Vec<[f64; 6]> = Vec::new();
    let mut tried = 0;
    while kept.len() < count && tried < 4_000_000 {
        tried += 1;
        let posture: [f64; 6] = std::array::from_fn(|i| {
            let limits = model.joints[model.roles.arm[i]].limits;
            let around = home[i] + random.random_range(-1.5..1.5);
            (around.clamp(limits.lower.max(-3.1), limits.upper.min(3.1)) * 1e3).round() / 1e3
        });
        let near = |other: &[f64; 6]| {
            let squares = posture.iter().zip(other).map(|(a, b)| (a - b).powi(2));
            squares.sum::<f64>().sqrt() < APART
        };
        let way = || {
            (0..=20).all(|i| {
                let share = f64::from(i) / 20.0;
                let at = std::array::from_fn(|j| posture[j] + (home[j] - posture[j]) * share);
                i == 20 || model.is_within_outlines(&at)
            })
        };
        if near(&home) || kept.iter().any(near) || !way() || !touches_nothing(&assets, &posture)? {
            continue;
        }
        println!("  {posture:?},");
        kept.push(posture);
    }
    println!("# {} of {tried}", kept.len());
    Ok(())
}

/// Whether no link of the robot touches another at a posture and on the way home.
fn touches_nothing(assets: &std::path::Path, posture: &[f64; 6]) -> Result<bool> {
    let scenario = Scenario {
        task: String::new(),
        arm: Some(*posture),
        cameras: Vec::new(),
        ..Scenario::default()
    };
    let mut sim = Simulation::new(assets, scenario)?;
    let home = sim.model().settings.home;
    for tick in 0..8 * 60 {
        let arm = (tick == 30).then_some(ArmIntent::Joints(home));
        sim.step(&ControlInput {
            arm,
            ..ControlInput::default()
        });
        let touch = sim.snapshot().contacts.iter().any(|contact| {
            matches!(
                (contact.first, contact.second),
                (BodyRef::Link(_), BodyRef::Link(_))
            )
        });
        if touch {
            return Ok(false);
        }
    }
    let arm = sim.arm_positions();
    Ok(arm.iter().zip(home).all(|(a, b)| (a - b).abs() < 0.02))
}
