//! The scene: the checked reply of the `scene` query. Decisions are made elsewhere.

use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use wheelarm_proto::check::{self, Invalid};
use wheelarm_proto::exact;
use wheelarm_proto::furniture::JointMotion;
use wheelarm_proto::geometry::normalized;
use wheelarm_proto::v1;

use super::hand::Hand;
use super::observation::Observation;
use wheelarm_planning::footprint_check::{Limb, Outline, occupied, wrap};
use wheelarm_planning::handle::LAGS;
use wheelarm_planning::hinged_leaf::HingedLeaf;
use wheelarm_planning::obb::Obb;

/// A movable object: a rigid or deformable object, or furniture that slides.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// Name.
    pub name: String,
    /// Boxes around it in its own frame.
    pub boxes: Vec<Obb>,
}

/// A piece of furniture on a joint: a drawer slides, a door turns.
#[derive(Clone, Debug, PartialEq)]
pub struct Slide {
    /// Name of the joint.
    pub name: String,
    /// Index among the objects.
    pub item: usize,
    /// Its pose in `house` at joint position 0.
    pub rest: Isometry3<f64>,
    /// Whether it slides or turns.
    pub motion: JointMotion,
    /// Direction of growing positions in `house`, or the axis through the origin of
    /// `rest` about which they grow.
    pub axis: Unit<Vector3<f64>>,
}

/// Poses along the arc of what turns, between its ends.
const ARC_STOPS: u32 = 8;

impl Slide {
    /// Its pose in `house` at a joint position, metres or radians.
    #[must_use]
    pub fn pose(&self, position: f64) -> Isometry3<f64> {
        self.motion.pose(&self.axis, &self.rest, position)
    }

    /// Poses in `house` through which a hand at `hand` moves that holds it while its
    /// position changes by `by`, metres or radians: the end alone of what slides, stops
    /// along the arc of what turns.
    #[must_use]
    pub fn carried(&self, hand: &Isometry3<f64>, by: f64) -> Vec<Isometry3<f64>> {
        let stops = match self.motion {
            JointMotion::Slides => 1,
            JointMotion::Turns => ARC_STOPS,
        };
        let at = |share: f64| self.motion.displacement(&self.axis, &self.rest, by * share) * hand;
        let shares = (1..=stops).map(|stop| f64::from(stop) / f64::from(stops));
        shares.map(at).collect()
    }

    /// The same for a hand that turns less than the furniture: about a bar, `grip` metres before
    /// the hand, it lags by a share of the angle. What slides does not turn.
    #[must_use]
    pub fn carried_about_bar(
        &self,
        hand: &Isometry3<f64>,
        by: f64,
        (lag, grip): (f64, f64),
    ) -> Vec<Isometry3<f64>> {
        let mut poses = self.carried(hand, by);
        if self.motion == JointMotion::Turns && lag != 0.0 {
            let count = poses.len() as f64;
            for (i, pose) in poses.iter_mut().enumerate() {
                let turned = by * (i + 1) as f64 / count;
                let back = UnitQuaternion::from_axis_angle(&self.axis, -lag * turned);
                let bar = Translation3::from(*pose * Point3::new(0.0, 0.0, grip));
                *pose = bar * back * bar.inverse() * *pose;
            }
        }
        poses
    }

    /// Its position at a pose in `house`, metres or radians.
    #[must_use]
    pub fn position_at(&self, pose: &Isometry3<f64>) -> f64 {
        match self.motion {
            JointMotion::Slides => {
                let moved = pose.translation.vector - self.rest.translation.vector;
                moved.dot(&self.axis)
            }
            JointMotion::Turns => {
                let turn = pose.rotation * self.rest.rotation.inverse();
                let half = exact::atan2(turn.imag().dot(&self.axis), turn.scalar());
                wrap(2.0 * half)
            }
        }
    }

    /// Shares of its angle by which a hand may lag about the handle, the least first.
    #[must_use]
    pub fn lags(&self) -> &'static [f64] {
        match self.motion {
            JointMotion::Slides => &[0.0],
            JointMotion::Turns => &LAGS,
        }
    }

    /// A length along the path of the hand, metres, as a change of the position: itself
    /// of what slides, an angle of what turns about an axis `radius` metres away.
    #[must_use]
    pub fn change(&self, length: f64, radius: f64) -> f64 {
        match self.motion {
            JointMotion::Slides => length,
            JointMotion::Turns => length / radius.max(NEAREST_HANDLE),
        }
    }

    /// Distance of a point in `house` from the axis, metres.
    #[must_use]
    pub fn radius(&self, point: &Point3<f64>) -> f64 {
        let arm = point.coords - self.rest.translation.vector;
        (arm - self.axis.scale(arm.dot(&self.axis))).norm()
    }
}

/// A handle is at least this far from the axis of what turns, metres.
const NEAREST_HANDLE: f64 = 0.05;

/// A grasp of an object.
#[derive(Clone, Debug, PartialEq)]
pub struct Grasp {
    /// Index of the object.
    pub item: usize,
    /// Name.
    pub name: String,
    /// Grasp point in the object's frame: z approach, x closing.
    pub item_from_grasp: Isometry3<f64>,
    /// Distance between the pads at the grasp, metres.
    pub width: f64,
    /// Any turn about the object's z axis is equivalent.
    pub symmetric: bool,
    /// Only for a hand from above.
    pub from_above: bool,
    /// Cap of the pads' force, N; `None` leaves it to the operator profile.
    pub force: Option<f64>,
}

/// The seated person, in `wheelchair_root`, with the head straight.
#[derive(Clone, Debug, PartialEq)]
pub struct Seated {
    /// Capsules of the body.
    pub capsules: Vec<Capsule>,
    /// Between the lips, x out of the mouth.
    pub mouth: Isometry3<f64>,
}

/// A capsule of a body.
#[derive(Clone, Debug, PartialEq)]
pub struct Capsule {
    /// Ends of its axis.
    pub ends: [Point3<f64>; 2],
    /// Metres.
    pub radius: f64,
    /// It moves with the head.
    pub moves: bool,
}

impl Capsule {
    /// The capsule as a part of the chair's footprint.
    fn limb(&self) -> Limb {
        Limb {
            ends: self.ends.map(|end| end.coords.into()),
            radius: self.radius,
        }
    }

    /// Distance of a point from the surface, metres; negative inside.
    #[must_use]
    pub fn distance(&self, at: &Point3<f64>) -> f64 {
        let [a, b] = self.ends;
        let along = b - a;
        let length = along.norm_squared().max(1e-12);
        let share = ((at - a).dot(&along) / length).clamp(0.0, 1.0);
        (at - (a + along * share)).norm() - self.radius
    }
}

/// The arm stowed beside the seat.
#[derive(Clone, Debug, PartialEq)]
pub struct Travel {
    /// Positions of the arm's joints, from base to hand, radians.
    pub joints: [f64; 6],
    /// The robot and the person in it by height, as [`SceneModel::outlines`], with the arm
    /// in this posture.
    pub outlines: Vec<(f64, Outline)>,
}

/// Geometry of one scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneModel {
    /// Fixed furniture, in `house`.
    pub furniture: Vec<Obb>,
    /// Movable objects: in the order of their poses, then the slides.
    pub items: Vec<Item>,
    /// Furniture that slides, in the order of the joint positions.
    pub slides: Vec<Slide>,
    /// Grasps of the objects.
    pub grasps: Vec<Grasp>,
    /// `base_link` in `wheelchair_root`.
    pub chair_from_base: Isometry3<f64>,
    /// From the end effector to the grasp point along tool z, metres.
    pub tool_length: f64,
    /// Footprint of the chair: x min, x max, y min, y max, metres.
    pub footprint: [f64; 4],
    /// The robot and the person in it by height, bottom up: height to which it holds,
    /// metres, and outline with the arm at home.
    pub outlines: Vec<(f64, Outline)>,
    /// The arm stowed for long ways and narrow doors, if the robot has such a posture.
    pub travel: Option<Travel>,
    /// Least and greatest distance on the floor plan from the arm's base to what
    /// is taken, metres.
    pub arm_range: [f64; 2],
    /// The hand.
    pub hand: Hand,
    /// Positions of the arm's joints at home, from base to hand, radians.
    pub home: [f64; 6],
    /// The seated person.
    pub person: Option<Seated>,
}

fn read_boxes(boxes: &[v1::BoxGeometry]) -> Result<Vec<Obb>, Invalid> {
    boxes
        .iter()
        .map(|geometry| {
            Ok(Obb {
                pose: normalized("box pose", geometry.pose.as_ref())?,
                half: check::vector("box half extents", geometry.half.as_ref())?.into(),
                round: false,
            })
        })
        .collect()
}

/// The object of that name with its boxes; empty when the scene lists no body of that
/// name.
fn read_item(reply: &v1::SceneReply, name: &str) -> Result<Item, Invalid> {
    let body = reply.bodies.iter().find(|body| body.name == name);
    Ok(Item {
        name: name.to_owned(),
        boxes: read_boxes(body.map_or(&[], |body| &body.boxes))?,
    })
}

fn read_slide(joint: &v1::FurnitureJoint, item: usize) -> Result<Slide, Invalid> {
    let axis = check::vector("axis of a joint", joint.axis.as_ref())?;
    Ok(Slide {
        name: joint.name.clone(),
        item,
        rest: normalized("rest pose of a joint", joint.rest.as_ref())?,
        motion: JointMotion::of(joint),
        axis: Unit::new_normalize(axis.into()),
    })
}

fn read_grasp(grasp: &v1::GraspFrame, items: &[Item]) -> Result<Grasp, Invalid> {
    let item = items
        .iter()
        .position(|item| item.name == grasp.object)
        .ok_or_else(|| Invalid::Word {
            what: "object of a grasp",
            value: grasp.object.clone(),
            expected: "the name of a body that moves",
        })?;
    Ok(Grasp {
        item,
        name: grasp.name.clone(),
        item_from_grasp: normalized("grasp pose", grasp.pose.as_ref())?,
        width: check::within("grasp width", grasp.width, 0.0, 1.0)?,
        symmetric: grasp.symmetric,
        from_above: grasp.from_above,
        force: grasp
            .force
            .map(|force| check::within("grasp force", force, 0.0, 1e4))
            .transpose()?,
    })
}

fn read_seated(person: &v1::SeatedPerson) -> Result<Seated, Invalid> {
    let read = |capsule: &v1::PersonCapsule| {
        let end = |end: Option<&v1::Vector3>| {
            check::vector("end of a person's capsule", end).map(Point3::from)
        };
        Ok(Capsule {
            ends: [end(capsule.a.as_ref())?, end(capsule.b.as_ref())?],
            radius: check::within("radius of a person's capsule", capsule.radius, 0.0, 1.0)?,
            moves: capsule.moves,
        })
    };
    Ok(Seated {
        capsules: person.capsules.iter().map(read).collect::<Result<_, _>>()?,
        mouth: normalized("pose of the mouth", person.mouth.as_ref())?,
    })
}

/// A box belongs to a round object when width and depth differ by less than this,
/// metres.
const ROUND: f64 = 1e-3;

impl SceneModel {
    /// Reads the server's answer.
    ///
    /// # Errors
    /// [`Invalid`] that names the field.
    pub fn read(reply: &v1::SceneReply) -> Result<Self, Invalid> {
        let mut furniture = Vec::new();
        for body in reply.bodies.iter().filter(|body| body.fixed) {
            furniture.extend(read_boxes(&body.boxes)?);
        }
        let mut items = Vec::new();
        for name in &reply.objects {
            items.push(read_item(reply, name)?);
        }
        let mut slides = Vec::new();
        for joint in &reply.joints {
            slides.push(read_slide(joint, items.len())?);
            items.push(read_item(reply, &joint.body)?);
        }
        let mut grasps = Vec::new();
        for grasp in &reply.grasps {
            grasps.push(read_grasp(grasp, &items)?);
        }
        for grasp in grasps.iter().filter(|grasp| grasp.symmetric) {
            for obb in &mut items[grasp.item].boxes {
                // An object with a symmetric grasp is round.
                let upright = (obb.pose.rotation * Vector3::z()).z.abs() > 0.999;
                obb.round = upright && (obb.half.x - obb.half.y).abs() < ROUND;
            }
        }
        let robot = reply.robot.as_ref();
        let robot = robot.ok_or(Invalid::Missing("description of the robot"))?;
        let gripper = robot.gripper.as_ref();
        let reach = robot.reach.unwrap_or_default();
        let outlines = read_outlines(&robot.outlines)?;
        let person = reply.persons.first().map(read_seated).transpose()?;
        let capsules = person.iter().flat_map(|person| &person.capsules);
        let limbs: Vec<Limb> = capsules.map(Capsule::limb).collect();
        let travel = robot.travel.as_ref().map(|travel| {
            let outlines = read_outlines(&travel.outlines)?;
            Ok::<_, Invalid>(Travel {
                joints: check::list("travel posture of the arm", &travel.positions)?,
                outlines: occupied(&outlines, &limbs),
            })
        });
        // An object that does not fit into the hand has no grasp.
        let hand = Hand::read(gripper.ok_or(Invalid::Missing("gripper"))?)?;
        grasps.retain(|grasp| grasp.width <= hand.stroke);
        Ok(Self {
            furniture,
            items,
            slides,
            grasps,
            chair_from_base: normalized("arm mount", robot.arm_mount.as_ref())?,
            tool_length: check::within("tool length", robot.tool_length, 0.0, 0.5)?,
            footprint: footprint(robot.footprint.as_ref())?,
            outlines: occupied(&outlines, &limbs),
            travel: travel.transpose()?,
            arm_range: check::list("range of the arm", &[reach.nearest, reach.furthest])?,
            hand,
            home: check::list("home of the arm", &robot.home_positions)?,
            person,
        })
    }

    /// Poses of all objects in `house`.
    #[must_use]
    pub fn poses(&self, observation: &Observation) -> Vec<Isometry3<f64>> {
        let slides = self.slides.iter().enumerate().map(|(index, slide)| {
            let position = observation.slides.get(index).copied().unwrap_or(0.0);
            slide.pose(position)
        });
        observation.objects.iter().copied().chain(slides).collect()
    }

    /// Furniture on a hinge as a door that may be pushed; `None` for what slides.
    #[must_use]
    pub fn leaf(&self, slide: usize) -> Option<HingedLeaf> {
        let slide = self.slides.get(slide)?;
        (slide.motion == JointMotion::Turns).then(|| HingedLeaf {
            rest: slide.rest,
            axis: slide.axis,
            boxes: self.items[slide.item].boxes.clone(),
        })
    }

    /// `base_link` in `house`.
    #[must_use]
    pub fn house_from_base(&self, observation: &Observation) -> Isometry3<f64> {
        observation.house_from_chair * self.chair_from_base
    }

    /// The end effector in `house`.
    #[must_use]
    pub fn house_from_tool(&self, observation: &Observation) -> Isometry3<f64> {
        self.house_from_base(observation) * observation.base_from_tool
    }
}

fn read_outlines(outlines: &[v1::Outline]) -> Result<Vec<(f64, Outline)>, Invalid> {
    let read = |outline: &v1::Outline| {
        let sides = footprint(outline.footprint.as_ref())?;
        let top = check::within("top of an outline", outline.top, 0.0, 10.0)?;
        Ok((top, Outline { sides }))
    };
    outlines.iter().map(read).collect()
}

fn footprint(footprint: Option<&v1::Footprint>) -> Result<[f64; 4], Invalid> {
    let footprint = footprint.ok_or(Invalid::Missing("footprint"))?;
    let sides = [
        footprint.x_min,
        footprint.x_max,
        footprint.y_min,
        footprint.y_max,
    ];
    check::list("footprint", &sides)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn hand_that_lags_behind_a_door_keeps_the_handle_and_turns_less() {
        let door = Slide {
            name: "door_joint".to_owned(),
            item: 0,
            rest: Isometry3::translation(1.0, 2.0, 0.5),
            motion: JointMotion::Turns,
            axis: Vector3::z_axis(),
        };
        let hand = Isometry3::new(Vector3::new(0.6, 1.6, 0.9), Vector3::new(0.0, 1.2, 0.0));
        let grip = 0.16;
        let bar = |pose: &Isometry3<f64>| pose * Point3::new(0.0, 0.0, grip);
        let [rigid, lagging] =
            [0.0, 0.8].map(|lag| door.carried_about_bar(&hand, 0.8, (lag, grip)));
        assert_eq!(rigid, door.carried(&hand, 0.8));
        for (rigid, lagging) in rigid.iter().zip(&lagging) {
            assert!((bar(rigid) - bar(lagging)).norm() < 1e-12);
        }
        let turned = |poses: &[Isometry3<f64>]| {
            poses
                .last()
                .map_or(0.0, |pose| pose.rotation.angle_to(&hand.rotation))
        };
        assert!((turned(&rigid) - 0.8).abs() < 1e-9 && (turned(&lagging) - 0.16).abs() < 1e-9);
        let drawer = Slide {
            motion: JointMotion::Slides,
            ..door.clone()
        };
        assert_eq!(drawer.lags(), [0.0]);
        for (slide, position) in [(&door, 1.2), (&door, -0.3), (&drawer, 0.2)] {
            let found = slide.position_at(&slide.pose(position));
            assert!((found - position).abs() < 1e-9, "{found}");
        }
    }
}
