//! Work for the physics that both engines can be given: before the coffee table
//! the arm reaches out, takes the mustard, raises it; the chair backs off and
//! turns while the arm waves with the bottle in the hand.

use std::path::Path;

use anyhow::{Context as _, Result};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use wheelarm_server::robot::RobotModel;
use wheelarm_server::robot::control::{
    ArmIntent, BaseIntent, ControlInput, GripperIntent, IntentFrame, RobotControl,
};
use wheelarm_server::scene::{Placement, Scene};
use wheelarm_server::world::World;

/// Control ticks of the whole course, 60 per second.
pub const CONTROL_TICKS: u64 = 60 * 15;

/// Objects on the table: name, metres inwards from its east edge and along it.
const PLACES: [(&str, f64, f64); 4] = [
    ("mustard", 0.15, 0.0),
    ("tomato_soup", 0.30, 0.45),
    ("crackers", 0.30, -0.55),
    ("grey_cup", 0.25, 0.75),
];
/// The bottle in the frame of the standing chair, metres: ahead and to the left.
const AHEAD: [f64; 2] = [1.14, 0.36];

/// Everything that the course needs.
pub struct Course {
    pub robot: RobotModel,
    pub scene: Scene,
    pub placements: Vec<Placement>,
    /// world_from_root of the standing chair.
    pub start: Isometry3<f64>,
    /// End effector around the bottle, in `house`.
    at: Isometry3<f64>,
}

impl Course {
    pub fn load(assets: &Path) -> Result<Self> {
        let robot = RobotModel::load(assets, "wheelarm")?;
        let mut scene = Scene::load(assets, "home")?;
        scene.objects.retain(|object| !object.optional);
        let table = scene
            .surface_named("coffee_table", None)
            .context("a coffee table")?;
        let placements: Vec<Placement> = scene
            .objects
            .iter()
            .map(|object| Placement {
                pose: PLACES
                    .iter()
                    .find(|(name, _, _)| *name == object.name)
                    .map_or(object.pose, |&(_, inwards, along)| {
                        table.standing(inwards, along, 0.0)
                    }),
                mass: object.mass.map_or(0.0, |m| m.mass),
                friction: object.friction,
            })
            .collect();
        let bottle = scene.object_named("mustard").context("a mustard bottle")?;
        let inwards = table.edge.rotation * Vector3::x();
        let chair = placements[bottle].pose.translation.vector
            - inwards * AHEAD[0]
            - Vector3::z().cross(&inwards) * AHEAD[1];
        let start = Isometry3::from_parts(
            Translation3::new(chair.x, chair.y, 0.0),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), inwards.y.atan2(inwards.x)),
        );
        let flip = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
        let at = scene.objects[bottle]
            .grasps
            .iter()
            .flat_map(|grasp| {
                [
                    placements[bottle].pose * grasp.pose,
                    placements[bottle].pose * grasp.pose * flip,
                ]
            })
            .find(|pose| {
                (pose.rotation * Vector3::z()).dot(&inwards) > 0.9
                    && (pose.rotation * Vector3::y()).z > 0.9
            })
            .context("a grasp from the edge of the table")?
            * Translation3::new(0.0, 0.0, -robot.settings.tool_length);
        Ok(Self {
            robot,
            scene,
            placements,
            start,
            at,
        })
    }

    pub fn world(&self) -> Result<World> {
        let home = self.robot.settings.home;
        Ok(World::new(
            &self.robot,
            &self.scene,
            &self.placements,
            &self.start,
            &home,
        )?)
    }

    pub fn control(&self) -> RobotControl {
        RobotControl::new(&self.robot)
    }

    /// Control input of a control tick.
    pub fn input(&self, control_tick: u64) -> ControlInput {
        let mut input = ControlInput::default();
        let pose = |pose| {
            Some(ArmIntent::Pose {
                frame: IntentFrame::House,
                pose,
            })
        };
        let time = control_tick as f64 / 60.0;
        match control_tick {
            0 => input.arm = pose(self.at * Translation3::new(0.0, 0.0, -0.12)),
            240 => input.arm = pose(self.at),
            330 => {
                input.gripper = Some(GripperIntent {
                    knuckle: self.robot.settings.gripper.closed,
                    max_force: None,
                });
            }
            430 => input.arm = pose(Translation3::new(0.0, 0.0, 0.12) * self.at),
            500 => {
                input.base = Some(BaseIntent {
                    linear: -0.4,
                    angular: 0.0,
                })
            }
            600 => {
                input.base = Some(BaseIntent {
                    linear: -0.2,
                    angular: 0.6,
                })
            }
            _ => {}
        }
        if control_tick >= 500 {
            let phase = 4.0 * (time - 500.0 / 60.0);
            input.arm = Some(ArmIntent::Twist {
                frame: IntentFrame::ArmBase,
                linear: Vector3::new(0.0, 0.15 * phase.cos(), 0.1 * (1.5 * phase).cos()),
                angular: Vector3::new(0.0, 0.0, 0.4 * phase.cos()),
            });
        }
        input
    }
}
