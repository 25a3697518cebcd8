//! The robot: it stands, drives straight, turns true, holds its arm.

use super::*;
use wheelarm_proto::names::JOINT_NAMES;

#[test]
fn look() {
    let (mut world, _, start) = robot_alone();
    let model = model();
    let names: Vec<usize> = JOINT_NAMES.iter().map(|n| model.joint(n).unwrap()).collect();
    let t = std::time::Instant::now();
    for k in 0..10 {
        seconds(&mut world, 1.0, |_, _| {});
        let s = world.snapshot();
        let root = start.inverse() * s.links[0].pose;
        println!("{k} {:.6?} {:.6?} v {:.2e} anomalies {:?}", root.translation.vector.as_slice(), root.rotation.scaled_axis().as_slice(), s.links[0].linear.norm(), s.anomalies);
        for &j in &names { print!("{:.5}/{:.2} ", s.joints[j].position, s.joints[j].effort); }
        println!("\n{:?}", s.contacts.len());
    }
    println!("{:.1} us per tick", t.elapsed().as_secs_f64() * 1e6 / 2400.0);
}
