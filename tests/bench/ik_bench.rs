//! Prints how fast and how surely the inverse kinematics solves 10 000 random
//! reachable poses from the home position, on one core.
//!
//! `cargo run --release -p wheelarm-tests --example ik_bench`

use std::f64::consts::PI;
use std::path::Path;
use std::time::Instant;

use anyhow::Context as _;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use wheelarm_server::robot::RobotModel;
use wheelarm_server::robot::kinematics::ArmKinematics;

const POSES: usize = 10_000;

fn main() -> anyhow::Result<()> {
    let assets = std::env::args()
        .nth(1)
        .unwrap_or_else(|| concat!(env!("CARGO_MANIFEST_DIR"), "/../assets").to_owned());
    let model = RobotModel::load(Path::new(&assets), "wheelarm").context("loading the robot")?;
    let arm = ArmKinematics::new(&model);
    let mut random = ChaCha8Rng::seed_from_u64(20);
    let mut micros = Vec::with_capacity(POSES);
    let (mut solved, mut first, mut worst) = (0, 0, [0.0_f64; 2]);
    let mut iterations = Vec::with_capacity(POSES);
    for _ in 0..POSES {
        let joints: [f64; 6] = std::array::from_fn(|i| {
            let (lower, upper) = (arm.lower()[i].max(-PI), arm.upper()[i].min(PI));
            random.random_range(lower..upper)
        });
        let target = arm.forward(&joints);
        let begin = Instant::now();
        let answer = arm.solve(&target, &model.settings.home);
        micros.push(begin.elapsed().as_secs_f64() * 1e6);
        if let Ok(solution) = answer {
            let error = arm.forward(&solution.joints).inv_mul(&target);
            let errors = [error.translation.vector.norm(), error.rotation.angle()];
            if errors[0] < 1e-6 && errors[1] < 1e-6 {
                solved += 1;
            }
            worst = [worst[0].max(errors[0]), worst[1].max(errors[1])];
            first += usize::from(solution.restarts == 0);
            iterations.push(solution.iterations);
        }
    }
    micros.sort_by(f64::total_cmp);
    iterations.sort_unstable();
    let at = |fraction: f64| micros[((POSES - 1) as f64 * fraction) as usize];
    println!(
        "inverse kinematics, {POSES} random reachable poses from home:\n\
         solved to 1e-6          {:.2} %  (worst {:.1e} m, {:.1e} rad)\n\
         at the first attempt    {:.2} %\n\
         iterations, median      {}\n\
         time, median            {:.1} µs   (mean {:.1}, 95 % {:.1}, 99 % {:.1}, greatest {:.0})",
        100.0 * solved as f64 / POSES as f64,
        worst[0],
        worst[1],
        100.0 * first as f64 / POSES as f64,
        iterations.get(iterations.len() / 2).copied().unwrap_or(0),
        at(0.5),
        micros.iter().sum::<f64>() / POSES as f64,
        at(0.95),
        at(0.99),
        at(1.0),
    );
    let joints = model.settings.home;
    let begin = Instant::now();
    let mut sum = 0.0;
    for i in 0..100_000 {
        let mut moved = joints;
        moved[0] += f64::from(i) * 1e-5;
        let (pose, jacobian) = arm.forward_and_jacobian(&moved);
        sum += pose.translation.x + jacobian[(0, 0)];
    }
    println!(
        "forward kinematics and Jacobian {:.2} µs (checksum {sum:.3})",
        begin.elapsed().as_secs_f64() * 10.0
    );
    Ok(())
}
