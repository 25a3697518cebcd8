//! The bear in the engine's own soft body: on a table, squeezed by two pads,
//! lifted and shaken. docs/drive-and-record/deformable.md has the result.
//!
//! `plush_trial SUBSTEPS PGS GRIP_N CLOSE_MM ATTACH`, each pad closing by
//! CLOSE_MM at most with GRIP_N newtons; ATTACH 1 attaches the nodes at a pad.

use std::path::Path;
use std::time::Instant;

use rapier3d::dynamics::*;
use rapier3d::prelude::*;
use wheelarm_server::geometry::tetrahedra::Tetrahedra;

fn main() {
    let argument = |i: usize, default: f32| {
        let given = std::env::args().nth(i).and_then(|a| a.parse().ok());
        given.unwrap_or(default)
    };
    let (substeps, pgs) = (argument(1, 4.0) as usize, argument(2, 4.0) as usize);
    let (grip, close, attach) = (argument(3, 5.0), argument(4, 20.0) * 1e-3, argument(5, 0.0));

    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
    let bear = wheelarm_server::scene::object(&assets, "teddy_bear").expect("the bear");
    let soft = bear.soft.expect("it is soft");
    let tet_mesh = Tetrahedra::tet_mesh(&soft.plush, soft.tet_pitch);
    let volume: f64 = tet_mesh.cells.iter().map(|c| tet_mesh.volume(c)).sum();
    println!(
        "{} nodes, {} cells, {:.2} l, skin {:.2} l",
        tet_mesh.nodes.len(),
        tet_mesh.cells.len(),
        volume * 1e3,
        soft.skin().volume() * 1e3
    );

    let mut world = PhysicsWorld::new();
    world.gravity = Vector::new(0.0, 0.0, -9.81);
    world.integration_parameters = IntegrationParameters {
        dt: 1.0 / 240.0,
        num_solver_iterations: substeps,
        num_internal_pgs_iterations: pgs,
        contact_recycling: false,
        friction_in_bias_pass: true,
        ..IntegrationParameters::default()
    };
    let table = world.insert_body(RigidBodyBuilder::fixed());
    let top = ColliderBuilder::cuboid(0.4, 0.4, 0.02).translation(Vector::new(0.0, 0.0, -0.022));
    world.insert_collider(top.friction(1.5), Some(table));
    let positions = tet_mesh.nodes.iter().map(|p| {
        let p = p.coords.cast::<f32>();
        Vector::new(p.x, p.y, p.z + 0.003)
    });
    let cells = tet_mesh.cells.iter().map(|c| c.map(|i| i as u32));
    let builder = SoftBodyBuilder::new(positions.collect())
        .cells(cells.collect())
        .cell_model(SoftBodyCellModel::Corotational)
        .material(SoftBodyMaterial {
            young_modulus: soft.young_modulus as f32,
            poisson_ratio: soft.poisson_ratio as f32,
            elastic_damping_ratio: 1.0,
            ..Default::default()
        })
        .mass(0.2)
        .particle_radius(0.002)
        .can_sleep(false)
        .surface_collider(ColliderBuilder::ball(0.1).friction(1.5));
    let bear = world.insert_soft_body(builder);

    let waist = Vector::new(0.03, 0.0, 0.1);
    let base = world.insert_body(RigidBodyBuilder::kinematic_position_based().translation(waist));
    let (mut pads, mut joints) = (Vec::new(), Vec::new());
    for side in [1.0f32, -1.0] {
        let at = Vector::new(0.0, side * 0.045, 0.0);
        let body = RigidBodyBuilder::dynamic()
            .translation(waist + at)
            .can_sleep(false);
        let pad = world.insert_body(body);
        let shape = ColliderBuilder::cuboid(0.0187, 0.004, 0.011)
            .translation(Vector::new(0.0, side * 0.004, 0.0))
            .mass(0.5)
            .friction(1.5);
        world.insert_collider(shape, Some(pad));
        let joint = PrismaticJointBuilder::new(Vector::Y * -side)
            .local_anchor1(at)
            .motor_model(MotorModel::ForceBased)
            .set_motor(0.0, 0.0, 2000.0, 60.0)
            .motor_max_force(grip)
            .build();
        joints.push(world.insert_impulse_joint(base, pad, joint));
        pads.push(pad);
    }
    let mut spent = Vec::new();
    let mut attached = 0;
    for tick in 0..12 * 240 {
        let t = tick as f32 / 240.0;
        let closing = ((t - 2.0) * 0.05).clamp(0.0, close);
        for joint in &joints {
            if let Some(joint) = world.impulse_joints.get_mut(*joint, true) {
                joint
                    .data
                    .set_motor_position(JointAxis::LinX, closing, 2000.0, 60.0);
            }
        }
        if attach > 0.0 && tick == 3 * 240 {
            for pad in &pads {
                let centre = world.bodies[*pad].translation();
                for i in 0..world.soft_bodies[bear].num_particles() {
                    let p = world.soft_bodies[bear].particle_position(i) - centre;
                    if p.x.abs() < 0.022 && p.y.abs() < 0.006 && p.z.abs() < 0.014 {
                        world.soft_bodies[bear].attach_particle(i, *pad, &world.bodies);
                        attached += 1;
                    }
                }
            }
        }
        let rise = ((t - 4.0) * 0.1).clamp(0.0, 0.2);
        let sway = if t > 7.0 {
            0.05 * (6.0 * (t - 7.0)).sin()
        } else {
            0.0
        };
        let to = waist + Vector::new(sway, 0.0, rise);
        world.bodies[base].set_next_kinematic_translation(to);
        let start = Instant::now();
        world.step();
        spent.push(start.elapsed().as_secs_f64());
        let soft = &world.soft_bodies[bear];
        let com = soft.center_of_mass();
        if !com.is_finite() {
            println!("not finite at {t:.2} s");
            return;
        }
        if tick % 240 == 239 {
            let fastest = soft
                .particle_velocities()
                .map(|v| v.length())
                .fold(0.0, f32::max);
            let gap = world.bodies[pads[0]].translation() - world.bodies[pads[1]].translation();
            let low = (0..soft.num_particles())
                .map(|i| soft.particle_position(i).z)
                .fold(f32::INFINITY, f32::min);
            let last: f64 = spent[spent.len() - 240..].iter().sum();
            println!(
                "t {:4.1} s  gap {:5.1} mm  centre in hand {:6.1} {:6.1} {:6.1} mm  lowest {:6.1} mm  fastest {fastest:.3} m/s  volume {:.3}  attached {attached}  cost {last:.2} s/s",
                t,
                gap.length() * 1e3,
                (com.x - to.x) * 1e3,
                (com.y - to.y) * 1e3,
                (com.z - to.z) * 1e3,
                low * 1e3,
                soft.volume() / soft.rest_volume(),
            );
        }
    }
}
