//! Laws of the elastic body alone, without the engine.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::elastic::{Elastic, Elasticity};
use super::motion::{State, TickLoads, step};
use super::solver::Scratch;
use crate::geometry::tetrahedra::Tetrahedra;

const TICK: f64 = 1.0 / 240.0;
const PITCH: f64 = 0.02;
/// Cubes along and across the bar.
const CUBES: [i32; 3] = [12, 3, 3];
const MATERIAL: Elasticity = Elasticity {
    young_modulus: 7000.0,
    poisson_ratio: 0.4,
    damping: 0.005,
};

/// A body without contacts.
fn alone<L: Fn(usize) -> Vector3<f64>>(
    load: L,
    held: &[usize],
) -> TickLoads<'_, L, impl FnOnce(f64, f64) -> f64> {
    TickLoads {
        candidates: &[],
        solids: &[],
        load,
        held,
        soften: |_, _| 1.0,
    }
}

fn bar() -> (Tetrahedra, Elastic) {
    let mesh = Tetrahedra::block(CUBES, PITCH);
    let body = Elastic::new(&mesh, &MATERIAL, 0.05);
    (mesh, body)
}

/// A pull on the far end, distributed over its faces, N per node.
fn end_load(mesh: &Tetrahedra, stress: f64) -> Vec<f64> {
    let far = f64::from(CUBES[0]) * PITCH;
    let mut load = vec![0.0; mesh.nodes.len()];
    for cell in &mesh.cells {
        let face: Vec<usize> = cell
            .iter()
            .copied()
            .filter(|&i| (mesh.nodes[i].x - far).abs() < 1e-9)
            .collect();
        if let [a, b, c] = face[..] {
            let edges = [b, c].map(|i| mesh.nodes[i] - mesh.nodes[a]);
            let area = edges[0].cross(&edges[1]).norm() / 2.0;
            for i in face {
                load[i] += stress * area / 3.0;
            }
        }
    }
    load
}

/// Strain = stress / E along, minus nu times that across, in any orientation.
#[test]
fn a_bar_in_tension_obeys_young_and_poisson() {
    let (mesh, body) = bar();
    for (stress, angle) in [(350.0, 0.0), (700.0, 2.0)] {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, 0.5, 1.0) * angle);
        let pose = Isometry3::from_parts(Vector3::new(1.0, 2.0, 3.0).into(), rotation);
        let mut state = State::placed(&body, &pose);
        let load = end_load(&mesh, stress);
        let held: Vec<usize> = (0..body.nodes())
            .filter(|&i| mesh.nodes[i].x < 1e-9)
            .collect();
        let mut scratch = Scratch::default();
        let pull = |i: usize| rotation * Vector3::x() * load[i];
        for _ in 0..6 * 240 {
            step(&body, &mut state, alone(pull, &held), TICK, &mut scratch);
        }
        let local = |i: usize| pose.inverse() * nalgebra::Point3::from(state.position[i]);
        let mean = |axis: usize, x: f64, keep: &dyn Fn(usize) -> bool| {
            let section: Vec<usize> = (0..body.nodes())
                .filter(|&i| (mesh.nodes[i].x - x).abs() < 1e-9 && keep(i))
                .collect();
            section.iter().map(|&i| local(i)[axis]).sum::<f64>() / section.len() as f64
        };
        let (near, far) = (4.0 * PITCH, 8.0 * PITCH);
        let along = (mean(0, far, &|_| true) - mean(0, near, &|_| true)) / (far - near) - 1.0;
        let top = f64::from(CUBES[1]) * PITCH;
        let half = mean(1, 6.0 * PITCH, &|i| mesh.nodes[i].y > top - 1e-9)
            - mean(1, 6.0 * PITCH, &|i| mesh.nodes[i].y < 1e-9);
        let across = half / top - 1.0;
        let expected = stress / MATERIAL.young_modulus;
        assert!(
            (along / expected - 1.0).abs() < 0.05,
            "strain {along}, expected {expected}"
        );
        assert!(
            (across / along + 0.4).abs() < 0.04,
            "across {across}, along {along}"
        );
    }
}

/// A free body falls, spins and oscillates without changing its momentum.
#[test]
fn a_free_body_keeps_its_momentum_and_falls_freely() {
    let (_, body) = bar();
    let mut state = State::placed(&body, &Isometry3::identity());
    let centre = body.centre(&state.position);
    let spin = Vector3::new(0.0, 2.0, 3.0);
    for (v, x) in state.velocity.iter_mut().zip(&state.position) {
        *v = Vector3::new(0.5, 0.0, 0.0) + spin.cross(&(x - centre));
    }
    let fall = Vector3::z() * -9.81;
    let mut scratch = Scratch::default();
    let ticks = 120;
    for _ in 0..ticks {
        step(
            &body,
            &mut state,
            alone(|i| fall * body.masses[i], &[]),
            TICK,
            &mut scratch,
        );
    }
    let t = f64::from(ticks) * TICK;
    let mean = body.centre(&state.velocity);
    let expected = Vector3::new(0.5, 0.0, -9.81 * t);
    assert!(
        (mean - expected).norm() < 1e-3,
        "{mean} after {t} s, expected {expected}"
    );
    // A sum over equal ticks falls half a tick further than the integral.
    let drop = 9.81 * t * (t + TICK) / 2.0;
    let moved = body.centre(&state.position) - centre;
    assert!(
        (moved.z + drop).abs() < 1e-3,
        "fell {} m, expected {drop}",
        -moved.z
    );
}

/// Stretched, sheared or inverted, a body recovers its shape.
#[test]
fn the_rest_shape_is_recovered() {
    let (mesh, body) = bar();
    let squeeze = |x: &Vector3<f64>| Vector3::new(0.4 * x.x, x.y + 0.5 * x.x, -0.3 * x.z);
    let mut state = State::placed(&body, &Isometry3::identity());
    for x in &mut state.position {
        *x = squeeze(x);
    }
    body.extract_rotation(&state.position, &mut state.rotations);
    let (stored, _) = state.energy(&body);
    let mut scratch = Scratch::default();
    for _ in 0..10 * 240 {
        step(
            &body,
            &mut state,
            alone(|_| Vector3::zeros(), &[]),
            TICK,
            &mut scratch,
        );
    }
    let (elastic, kinetic) = state.energy(&body);
    for cell in &mesh.cells {
        for (a, b) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            let (a, b) = (cell[a], cell[b]);
            let now = (state.position[a] - state.position[b]).norm();
            let rest = (mesh.nodes[a] - mesh.nodes[b]).norm();
            assert!(
                (now / rest - 1.0).abs() < 0.01,
                "an edge of {rest} m is {now} m"
            );
        }
    }
    // The remaining motion is a slow rotation: corotated steps nearly keep angular
    // momentum.
    assert!(
        elastic < 1e-4 * stored && kinetic < 0.01 * stored,
        "of {stored} J {elastic} J are elastic and {kinetic} J kinetic"
    );
}
