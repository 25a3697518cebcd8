//! What stands around: the server's answer to the `scene` query, checked, and
//! the two questions that planning asks of it: is the floor free, is the way
//! of the hand free.

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use wheelarm_proto::check::{self, Invalid};
use wheelarm_proto::v1;

use super::ground::{Ground, Outline, Rectangle};

/// A box with a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Pose of the middle, in `house` or in an object's frame.
    pub pose: Isometry3<f64>,
    /// Half extents, metres.
    pub half: Vector3<f64>,
}

impl Block {
    /// Distance from `point` to the surface; 0 inside, metres.
    #[must_use]
    pub fn distance(&self, point: &Point3<f64>) -> f64 {
        let local = self.pose.inverse_transform_point(point).coords;
        let outside = local.abs() - self.half;
        outside.map(|v| v.max(0.0)).norm()
    }

    fn corners(&self) -> impl Iterator<Item = Point3<f64>> + '_ {
        (0..8).map(|i| {
            let sign = |bit: usize| if i & bit == 0 { -1.0 } else { 1.0 };
            let corner = Vector3::new(sign(1), sign(2), sign(4)).component_mul(&self.half);
            self.pose * Point3::from(corner)
        })
    }

    /// Lowest and highest point, metres.
    fn heights(&self) -> [f64; 2] {
        self.corners()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |h, p| {
                [h[0].min(p.z), h[1].max(p.z)]
            })
    }

    /// Outline on the floor: exact for upright boxes, else the box around it.
    fn rectangle(&self) -> Rectangle {
        let up = self.pose.rotation * Vector3::z();
        if up.z.abs() > 0.999 {
            let along = self.pose.rotation * Vector3::x();
            let length = along.xy().norm();
            return Rectangle {
                centre: [self.pose.translation.x, self.pose.translation.y],
                half: [self.half.x, self.half.y],
                along: [along.x / length, along.y / length],
            };
        }
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for p in self.corners() {
            for (i, v) in [p.x, p.y].into_iter().enumerate() {
                low[i] = low[i].min(v);
                high[i] = high[i].max(v);
            }
        }
        Rectangle {
            centre: [
                f64::midpoint(low[0], high[0]),
                f64::midpoint(low[1], high[1]),
            ],
            half: [(high[0] - low[0]) / 2.0, (high[1] - low[1]) / 2.0],
            along: [1.0, 0.0],
        }
    }
}

/// An object that can be moved.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// Name.
    pub name: String,
    /// Boxes around it in its own frame.
    pub blocks: Vec<Block>,
}

/// One way to take an object.
#[derive(Clone, Debug, PartialEq)]
pub struct Grasp {
    /// Index of the object.
    pub object: usize,
    /// Name.
    pub name: String,
    /// Grasp point in the object's frame: z approach, x closing.
    pub object_from_grasp: Isometry3<f64>,
    /// Distance between the pads at the grasp, metres.
    pub width: f64,
    /// Any turn about the object's z axis will do.
    pub symmetric: bool,
}

/// Geometry of one scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneModel {
    /// What stays, in `house`.
    pub furniture: Vec<Block>,
    /// What moves, in the order of the object poses.
    pub items: Vec<Item>,
    /// Ways to take things.
    pub grasps: Vec<Grasp>,
    /// Index of the object that the task is about.
    pub target: Option<usize>,
    /// `base_link` in `wheelchair_root`.
    pub chair_from_base: Isometry3<f64>,
    /// From the end effector to the grasp point along tool z, metres.
    pub tool_length: f64,
    /// Footprint of the chair: x min, x max, y min, y max, metres.
    pub footprint: [f64; 4],
}

/// Reads a pose of a message.
///
/// # Errors
/// [`Invalid`] as in `wheelarm_proto::check::pose`.
pub fn read_pose(what: &'static str, pose: Option<&v1::Pose>) -> Result<Isometry3<f64>, Invalid> {
    let ([x, y, z], [qx, qy, qz, qw]) = check::pose(what, pose)?;
    Ok(Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_quaternion(Quaternion::new(qw, qx, qy, qz)),
    ))
}

/// Writes a pose into a message.
#[must_use]
pub fn write_pose(pose: &Isometry3<f64>) -> v1::Pose {
    let (t, q) = (pose.translation, pose.rotation);
    v1::Pose {
        position: Some(v1::Vector3 {
            x: t.x,
            y: t.y,
            z: t.z,
        }),
        orientation: Some(v1::Quaternion {
            x: q.i,
            y: q.j,
            z: q.k,
            w: q.w,
        }),
    }
}

fn read_blocks(boxes: &[v1::BoxGeometry]) -> Result<Vec<Block>, Invalid> {
    boxes
        .iter()
        .map(|geometry| {
            Ok(Block {
                pose: read_pose("box pose", geometry.pose.as_ref())?,
                half: check::vector("box half extents", geometry.half.as_ref())?.into(),
            })
        })
        .collect()
}

/// Lower than this is floor, metres.
const FLOOR: f64 = 0.03;
/// What reaches above this can touch the arm while it is carried, metres.
const ARM_HEIGHT: f64 = 0.95;
/// Nothing of the robot is above this, metres.
const ROBOT_HEIGHT: f64 = 1.50;
/// Objects that lie lower than this lie in the chair's way, metres.
const LOW_OBJECT: f64 = 0.5;
/// How far hand and fingers stand out of the footprint in front and at the
/// left when the arm is carried at its home, metres.
const HAND_OUT: [f64; 2] = [0.19, 0.06];

/// Spheres around the open hand: middle in the end effector frame and radius,
/// metres. From the collision sizes of the 2F-85 and the bracelet.
const HAND: [([f64; 3], f64); 14] = [
    ([0.0, 0.0, -0.10], 0.05),
    ([0.0, 0.0, -0.04], 0.05),
    ([0.0, 0.0, 0.02], 0.045),
    ([0.0, 0.06, -0.01], 0.03),
    ([0.04, 0.0, 0.06], 0.03),
    ([-0.04, 0.0, 0.06], 0.03),
    ([0.059, 0.0, 0.075], 0.018),
    ([-0.059, 0.0, 0.075], 0.018),
    ([0.059, 0.0, 0.10], 0.018),
    ([-0.059, 0.0, 0.10], 0.018),
    ([0.058, 0.0, 0.125], 0.017),
    ([-0.058, 0.0, 0.125], 0.017),
    ([0.056, 0.0, 0.145], 0.015),
    ([-0.056, 0.0, 0.145], 0.015),
];

impl SceneModel {
    /// Reads the server's answer.
    ///
    /// # Errors
    /// [`Invalid`] that names the field.
    pub fn read(reply: &v1::SceneReply) -> Result<Self, Invalid> {
        let mut furniture = Vec::new();
        for body in reply.bodies.iter().filter(|body| body.fixed) {
            furniture.extend(read_blocks(&body.boxes)?);
        }
        let mut items = Vec::new();
        for name in &reply.objects {
            let body = reply.bodies.iter().find(|body| &body.name == name);
            items.push(Item {
                name: name.clone(),
                blocks: read_blocks(body.map_or(&[], |body| &body.boxes))?,
            });
        }
        let index = |name: &str| items.iter().position(|item| item.name == name);
        let mut grasps = Vec::new();
        for grasp in &reply.grasps {
            let object = index(&grasp.object).ok_or_else(|| Invalid::Word {
                what: "object of a grasp",
                value: grasp.object.clone(),
                expected: "the name of an object of the scene",
            })?;
            grasps.push(Grasp {
                object,
                name: grasp.name.clone(),
                object_from_grasp: read_pose("grasp pose", grasp.pose.as_ref())?,
                width: check::within("grasp width", grasp.width, 0.0, 0.085)?,
                symmetric: grasp.symmetric,
            });
        }
        let footprint = check::list::<4>("footprint", &reply.footprint)?;
        Ok(Self {
            furniture,
            target: index(&reply.target),
            items,
            grasps,
            chair_from_base: read_pose("arm mount", reply.arm_mount.as_ref())?,
            tool_length: check::within("tool length", reply.tool_length, 0.0, 0.5)?,
            footprint,
        })
    }

    /// What the chair must not touch, with the objects where they are.
    #[must_use]
    pub fn ground(&self, objects: &[Isometry3<f64>]) -> Ground {
        let [back, front, right, left] = self.footprint;
        let mut ground = Ground {
            low: Outline {
                sides: self.footprint,
            },
            high: Outline {
                sides: [back, front + HAND_OUT[0], right, left + HAND_OUT[1]],
            },
            low_obstacles: Vec::new(),
            tall_obstacles: Vec::new(),
        };
        let lying = self
            .placed(objects)
            .map(|(_, block)| block)
            .filter(|block| block.heights()[0] < LOW_OBJECT);
        for block in self.furniture.iter().copied().chain(lying) {
            let [low, high] = block.heights();
            if high <= FLOOR || low >= ROBOT_HEIGHT {
                continue;
            }
            if high > ARM_HEIGHT {
                ground.tall_obstacles.push(block.rectangle());
            } else {
                ground.low_obstacles.push(block.rectangle());
            }
        }
        ground
    }

    /// Boxes of the objects in `house`, with the objects' indices.
    fn placed<'a>(
        &'a self,
        objects: &'a [Isometry3<f64>],
    ) -> impl Iterator<Item = (usize, Block)> + 'a {
        self.items
            .iter()
            .zip(objects)
            .enumerate()
            .flat_map(|(index, (item, pose))| {
                item.blocks.iter().map(move |block| {
                    (
                        index,
                        Block {
                            pose: pose * block.pose,
                            half: block.half,
                        },
                    )
                })
            })
    }

    /// Whether the open hand keeps `margin` metres from everything on the way
    /// from `start` to `end` (`house_from_tool`), the object `except` left out.
    #[must_use]
    pub fn hand_is_free(
        &self,
        start: &Isometry3<f64>,
        end: &Isometry3<f64>,
        objects: &[Isometry3<f64>],
        except: Option<usize>,
        margin: f64,
    ) -> bool {
        let blocks: Vec<Block> = self
            .furniture
            .iter()
            .copied()
            .chain(
                self.placed(objects)
                    .filter(|(index, _)| Some(*index) != except)
                    .map(|(_, block)| block),
            )
            .collect();
        let length = (end.translation.vector - start.translation.vector).norm();
        let steps = (length / 0.02).ceil().max(1.0) as usize;
        (0..=steps).all(|i| {
            let share = i as f64 / steps as f64;
            let pose = Isometry3::from_parts(
                Translation3::from(
                    start
                        .translation
                        .vector
                        .lerp(&end.translation.vector, share),
                ),
                start.rotation.slerp(&end.rotation, share),
            );
            HAND.iter().all(|(middle, radius)| {
                let point = pose * Point3::from(Vector3::from(*middle));
                blocks
                    .iter()
                    .all(|block| block.distance(&point) > radius + margin)
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hand_fits_around_a_bottle_but_not_through_its_neighbour() {
        let block = |x: f64, y: f64, half: [f64; 3]| Block {
            pose: Isometry3::translation(x, y, 0.9),
            half: half.into(),
        };
        let mut scene = SceneModel {
            furniture: vec![block(0.0, 0.0, [2.0, 2.0, 0.02])],
            items: vec![Item {
                name: "bottle".to_owned(),
                blocks: vec![block(0.0, 0.0, [0.048, 0.029, 0.09])],
            }],
            grasps: Vec::new(),
            target: Some(0),
            chair_from_base: Isometry3::identity(),
            tool_length: 0.12,
            footprint: [0.0; 4],
        };
        scene.furniture[0].pose.translation.z = 0.79;
        let objects = [Isometry3::identity()];
        // Tool z along +x, tool x along y, tool y up.
        let rotation =
            UnitQuaternion::from_basis_unchecked(&[Vector3::y(), Vector3::z(), Vector3::x()]);
        let tool = |x: f64| Isometry3::from_parts(Translation3::new(x, 0.0, 0.9), rotation);
        let free = |scene: &SceneModel, except| {
            scene.hand_is_free(&tool(-0.24), &tool(-0.12), &objects, except, 0.005)
        };
        assert!(free(&scene, Some(0)));
        assert!(!free(&scene, None), "the fingers reach around the bottle");
        scene.furniture.push(block(0.0, 0.08, [0.03, 0.03, 0.05]));
        assert!(!free(&scene, Some(0)), "a can stands in a finger's way");
    }
}
