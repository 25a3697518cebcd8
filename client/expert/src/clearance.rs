//! Collision queries of the planner: is the floor free for the chair, is the path of
//! the hand free.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Translation3};

use super::hand::{self, Ball, Hand};
use super::scene::SceneModel;
use wheelarm_planning::floor_map::{CHANGE_CLEARANCE, FloorMap};
use wheelarm_planning::footprint_check::{FootprintCheck, Pose2};
use wheelarm_planning::obb::Obb;
use wheelarm_planning::postures::changing;
use wheelarm_planning::route_planner::{Obstacle, RoutePlanner};

/// Objects lower than this block the chair, metres.
const LOW_OBJECT: f64 = 0.5;
/// Spacing of the collision checks along the path of the hand, metres.
const STEP: f64 = 0.02;
/// Objects in the hand extend no further from it than this, metres.
const HELD: f64 = 0.4;

impl SceneModel {
    /// Obstacles of the chair, with the objects at `poses`.
    #[must_use]
    pub fn footprint_check(&self, poses: &[Isometry3<f64>]) -> FootprintCheck {
        let mut footprint = self.fixed_footprint();
        for (obstacle, heights) in self.moved_obstacles(poses) {
            footprint.put(obstacle, heights);
        }
        footprint
    }

    /// Obstacles of the chair that never move.
    fn fixed_footprint(&self) -> FootprintCheck {
        self.among_furniture(FootprintCheck::from_outlines(self.outlines.iter().copied()))
    }

    fn among_furniture(&self, mut footprint: FootprintCheck) -> FootprintCheck {
        for obb in &self.furniture {
            footprint.put(obb.rectangle(), obb.heights());
        }
        let boxes = self.furniture.iter();
        footprint.put_edges(boxes.map(|obb| (obb.rectangle(), obb.heights())));
        footprint
    }

    /// Obstacles of the chair while its arm changes between home and the travel posture, with
    /// the objects at `poses`; `None` for a robot without a travel posture.
    #[must_use]
    pub fn change_check(&self, poses: &[Isometry3<f64>]) -> Option<FootprintCheck> {
        let mut footprint = self.among_furniture(self.changing()?);
        for (obstacle, heights) in self.moved_obstacles(poses) {
            footprint.put(obstacle, heights);
        }
        Some(footprint)
    }

    /// The map of where the arm has room to change, on the floor of [`Self::route_planner`].
    #[must_use]
    pub fn change_map(&self, poses: &[Isometry3<f64>], start: Pose2) -> Option<Arc<FloorMap>> {
        let fixed = self.among_furniture(self.changing()?);
        let mut planner = self.planner(fixed, poses, start, CHANGE_CLEARANCE);
        Some(planner.map(CHANGE_CLEARANCE))
    }

    fn changing(&self) -> Option<FootprintCheck> {
        let travel = self.travel.as_ref()?;
        let mount = self.chair_from_base.translation;
        let mount = [mount.x, mount.y];
        Some(changing(&self.outlines, &travel.outlines, mount))
    }

    /// Obstacles of the chair that may have moved, with the objects at `poses`.
    fn moved_obstacles(&self, poses: &[Isometry3<f64>]) -> Vec<Obstacle> {
        let lying = self.placed(poses).map(|(_, obb)| obb);
        let lying = lying.filter(|obb| obb.heights()[0] < LOW_OBJECT);
        lying.map(|obb| (obb.rectangle(), obb.heights())).collect()
    }

    /// A planner of drives from `start`, with the objects at `poses`. Goals are near
    /// furniture or objects.
    #[must_use]
    pub fn route_planner(
        &self,
        poses: &[Isometry3<f64>],
        start: Pose2,
        margin: f64,
    ) -> RoutePlanner {
        self.planner(self.fixed_footprint(), poses, start, margin)
    }

    fn planner(
        &self,
        fixed: FootprintCheck,
        poses: &[Isometry3<f64>],
        start: Pose2,
        margin: f64,
    ) -> RoutePlanner {
        let at = |pose: &Isometry3<f64>| Pose2 {
            x: pose.translation.x,
            y: pose.translation.y,
            heading: 0.0,
        };
        let goals: Vec<Pose2> = poses.iter().map(at).collect();
        let moved = self.moved_obstacles(poses);
        RoutePlanner::new(fixed, moved, start, &goals, margin)
    }

    /// Boxes of the movable objects in `house`, each with the index of its object.
    pub fn placed<'a>(
        &'a self,
        poses: &'a [Isometry3<f64>],
    ) -> impl Iterator<Item = (usize, Obb)> + 'a {
        self.items
            .iter()
            .zip(poses)
            .enumerate()
            .flat_map(|(index, (item, pose))| {
                item.boxes.iter().map(move |obb| (index, obb.at(pose)))
            })
    }

    /// Obstacles within `radius` metres of `point`, without the object `except`.
    #[must_use]
    pub fn near(
        &self,
        point: &Point3<f64>,
        radius: f64,
        poses: &[Isometry3<f64>],
        except: Option<usize>,
    ) -> Surroundings {
        let others = self
            .placed(poses)
            .filter(|(index, _)| Some(*index) != except)
            .map(|(_, obb)| obb);
        Surroundings {
            boxes: self
                .furniture
                .iter()
                .copied()
                .chain(others)
                .filter(|obb| obb.distance(point) < radius)
                .collect(),
        }
    }

    /// Obstacles near straight lines between `stops` in `house`.
    #[must_use]
    pub fn around(
        &self,
        stops: &[Isometry3<f64>],
        poses: &[Isometry3<f64>],
        except: Option<usize>,
    ) -> Surroundings {
        let count = stops.len().max(1) as f64;
        let sum = stops.iter().fold(nalgebra::Vector3::zeros(), |sum, pose| {
            sum + pose.translation.vector
        });
        let middle = Point3::from(sum / count);
        let radius = stops
            .iter()
            .map(|pose| (pose.translation.vector - middle.coords).norm())
            .fold(0.0, f64::max);
        self.near(&middle, radius + self.hand.reach() + HELD, poses, except)
    }
}

/// Boxes that a hand could touch.
#[derive(Clone, Debug, PartialEq)]
pub struct Surroundings {
    /// In `house`.
    pub boxes: Vec<Obb>,
}

impl Surroundings {
    /// Whether `balls` keep `margin` metres from every obstacle while their frame moves
    /// straight from `start` to `end`, both in `house`.
    #[must_use]
    pub fn is_free(
        &self,
        balls: &[Ball],
        start: &Isometry3<f64>,
        end: &Isometry3<f64>,
        margin: f64,
    ) -> bool {
        let length = (end.translation.vector - start.translation.vector)
            .norm()
            .max(0.15 * start.rotation.angle_to(&end.rotation));
        let steps = (length / STEP).ceil().max(1.0) as usize;
        let near = hand::reach(balls) + margin;
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
            let origin = Point3::from(pose.translation.vector);
            let mut close = self
                .boxes
                .iter()
                .filter(|obb| obb.distance(&origin) <= near)
                .peekable();
            close.peek().is_none()
                || close.all(|obb| {
                    balls.iter().all(|ball| {
                        let point = pose * Point3::from(ball.centre);
                        obb.distance(&point) > ball.radius + margin
                    })
                })
        })
    }

    /// Whether `hand`, open by `opening`, keeps `margin` metres from
    /// everything on straight lines between `stops`.
    #[must_use]
    pub fn hand_is_free(
        &self,
        hand: &Hand,
        opening: f64,
        stops: &[Isometry3<f64>],
        margin: f64,
    ) -> bool {
        let balls = hand.balls(opening);
        match stops {
            [only] => self.is_free(&balls, only, only, margin),
            _ => stops
                .windows(2)
                .all(|leg| self.is_free(&balls, &leg[0], &leg[1], margin)),
        }
    }
}

/// Balls around a held object in the end effector's frame: corners and centers of its
/// boxes.
#[must_use]
pub fn held_balls(boxes: &[Obb], tool_from_item: &Isometry3<f64>) -> Vec<Ball> {
    const CORNER: f64 = 0.004;
    boxes
        .iter()
        .flat_map(|obb| {
            let thin = obb.half.min();
            obb.corners()
                .map(|corner| (corner, CORNER))
                .chain([(Point3::from(obb.pose.translation.vector), thin)])
                .collect::<Vec<_>>()
        })
        .map(|(point, radius)| Ball {
            centre: (tool_from_item * point).coords,
            radius,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Item;
    use nalgebra::{UnitQuaternion, Vector3};

    #[test]
    fn hand_fits_around_a_bottle_but_not_through_its_neighbor() {
        let obb = |x: f64, y: f64, z: f64, half: [f64; 3]| Obb {
            pose: Isometry3::translation(x, y, z),
            half: half.into(),
            round: false,
        };
        let mut scene = SceneModel {
            furniture: vec![obb(0.0, 0.0, 0.79, [2.0, 2.0, 0.02])],
            items: vec![Item {
                name: "bottle".to_owned(),
                boxes: vec![obb(0.0, 0.0, 0.9, [0.048, 0.029, 0.09])],
            }],
            slides: Vec::new(),
            grasps: Vec::new(),
            chair_from_base: Isometry3::identity(),
            tool_length: 0.12,
            footprint: [0.0; 4],
            outlines: Vec::new(),
            travel: None,
            arm_range: [0.42, 0.88],
            hand: hand::tests::hand(),
            home: [0.0; 6],
            person: None,
        };
        let poses = [Isometry3::identity()];
        // Tool z along +x, tool x along y, tool y up.
        let rotation =
            UnitQuaternion::from_basis_unchecked(&[Vector3::y(), Vector3::z(), Vector3::x()]);
        let tool = |x: f64| Isometry3::from_parts(Translation3::new(x, 0.0, 0.9), rotation);
        let free = |scene: &SceneModel, except| {
            let stops = [tool(-0.24), tool(-0.13)];
            scene.around(&stops, &poses, except).hand_is_free(
                &scene.hand,
                scene.hand.stroke,
                &stops,
                0.005,
            )
        };
        assert!(free(&scene, Some(0)));
        assert!(!free(&scene, None), "the fingers reach around the bottle");
        scene
            .furniture
            .push(obb(0.0, 0.08, 0.9, [0.03, 0.03, 0.05]));
        assert!(!free(&scene, Some(0)), "a can stands in a finger's way");
    }
}
