//! Values of `robot.toml`: properties of a robot that a URDF cannot contain.
//!
//! Read and checked once at load; nothing here is computed from the URDF.

use std::collections::BTreeMap;

use nalgebra::Isometry3;
use serde::Deserialize;

/// Values of `robot.toml`.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Cameras on the robot.
    pub cameras: Vec<CameraMount>,
    /// The IMU.
    pub imu: ImuSettings,
    /// Link of the recorded end effector.
    pub end_effector_link: String,
    /// Link of the arm's base.
    pub arm_base_link: String,
    /// Distance from the end effector frame to the grasp point along z, metres.
    pub tool_length: f64,
    /// Home position of the six arm joints, radians.
    pub home: [f64; 6],
    /// Other positions of the arm in which the robot may be at rest and drive: within
    /// its outlines, radians.
    pub postures: Vec<[f64; 6]>,
    /// Coulomb friction of every surface except tyres and pads, averaged with that of
    /// the other body, no unit.
    pub shell_friction: f64,
    /// Footprint in `wheelchair_root`: x min, x max, y min, y max, metres.
    pub footprint: [f64; 4],
    /// Outlines of the robot by height, bottom up, with the arm at home.
    pub outlines: Vec<OutlineSettings>,
    /// The arm stowed for long ways and narrow doors, if the robot has such a posture.
    pub travel: Option<TravelSettings>,
    /// Reach of the arm.
    pub reach: ReachSettings,
    /// Wheels, motors and speeds of the chair.
    pub drive: DriveSettings,
    /// Gains and limits of the arm.
    pub arm: ArmSettings,
    /// Motors, limits and sizes of the gripper.
    pub gripper: GripperSettings,
    /// Seat of a person, if the robot has one.
    pub seat: Option<SeatSettings>,
    /// Laser scanner, if the robot has one.
    pub scanner: Option<ScannerSettings>,
}

/// A laser scanner that measures distances in the x-y plane of its frame.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScannerSettings {
    /// Name of its frame.
    pub frame: String,
    /// Link that carries it; its axes are those of the link.
    pub link: String,
    /// Origin of its frame in the link, metres.
    pub at: [f64; 3],
    /// Angle of the first ray about z, from x, degrees.
    pub first_deg: f64,
    /// Angle between two rays, degrees.
    pub step_deg: f64,
    /// Rays of a scan.
    pub rays: u32,
    /// Least and greatest distance that it measures, metres.
    pub range: [f64; 2],
}

/// Seat of a person. Frame of the root, `wheelchair_root`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SeatSettings {
    /// Middle of the upper side, metres.
    pub at: [f64; 3],
    /// Along x and y, metres.
    pub size: [f64; 2],
    /// Material of a cushion on it, one of the URDF's.
    pub material: String,
}

/// Role of a recorded joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JointRole {
    /// Left driven wheel.
    WheelLeft,
    /// Right driven wheel.
    WheelRight,
    /// Left passive wheel.
    CasterLeft,
    /// Right passive wheel.
    CasterRight,
    /// One of the arm's.
    Arm,
    /// Knuckle of the left finger.
    Knuckle,
    /// Knuckle of the right finger.
    KnuckleRight,
    /// Tip of the left finger.
    FingerTipLeft,
    /// Tip of the right finger.
    FingerTipRight,
    /// Inner knuckle of the left finger.
    InnerKnuckleLeft,
    /// Inner knuckle of the right finger.
    InnerKnuckleRight,
    /// Any other.
    Other,
}

/// Role of a recorded frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FrameRole {
    /// The chair, expressed in the house.
    Chair,
    /// A link of the arm, expressed in the arm's base.
    ArmLink,
    /// The end effector, expressed in the arm's base.
    EndEffector,
    /// Any other, expressed in the arm's base.
    Other,
}

/// The robot's outline from above, up to a height.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutlineSettings {
    /// Height above the floor, metres.
    pub top: f64,
    /// x min, x max, y min, y max in `wheelchair_root`, metres.
    pub footprint: [f64; 4],
}

/// The arm stowed beside the seat.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TravelSettings {
    /// Positions of the six arm joints, radians.
    pub joints: [f64; 6],
    /// Outlines of the robot by height, bottom up, with the arm in this posture.
    #[serde(rename = "outline")]
    pub outlines: Vec<OutlineSettings>,
}

/// Reach of the arm, for estimates.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReachSettings {
    /// Middle of the shell in `base_link`, metres.
    pub centre: [f64; 3],
    /// Smallest distance of the end effector from the middle, metres.
    pub inner_radius: f64,
    /// Largest distance, metres.
    pub outer_radius: f64,
    /// Smallest distance from the arm's base on the floor plan, metres.
    pub nearest: f64,
    /// Largest distance on the floor plan, metres.
    pub furthest: f64,
}

/// A camera on a link.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraMount {
    /// Name.
    pub name: String,
    /// Link that carries it.
    pub link: String,
    /// link_from_optical.
    pub pose: Isometry3<f64>,
    /// Image size for which the intrinsics hold, pixels.
    pub size: [u32; 2],
    /// Focal lengths, pixels.
    pub focal: [f64; 2],
    /// Principal point, pixels from the top left corner.
    pub principal: [f64; 2],
    /// Near and far plane, metres.
    pub range: [f64; 2],
    /// Rendered only when a scenario names it, not for `*`.
    pub on_request: bool,
    /// Tolerances of one specimen.
    pub tolerance: CameraTolerance,
}

/// Largest deviations of one specimen of a camera, in each direction and uniform.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraTolerance {
    /// Of the focal length, as a share of it.
    pub focal: f64,
    /// Of the principal point, pixels at the native size.
    pub principal: f64,
    /// Of its position, along each axis, metres.
    pub position: f64,
    /// Of its orientation, about each axis, degrees.
    pub rotation_deg: f64,
}

/// The IMU. Its white noise is applied only when a scenario requests it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImuSettings {
    /// Link name.
    pub link: String,
    /// Density of the acceleration noise, m/s²/√Hz.
    pub acceleration_noise: f64,
    /// Density of the angular velocity noise, rad/s/√Hz.
    pub gyro_noise: f64,
    /// Standard deviation of the orientation per sample, rad.
    pub orientation_noise: f64,
}

/// Wheels, motors and speed profile of the chair. Decelerations apply when a speed falls.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveSettings {
    /// Wheel radius for drive and odometry, metres.
    pub wheel_radius: f64,
    /// Distance between the driven wheels for drive and odometry, metres.
    pub track: f64,
    /// m/s².
    pub forward_acceleration: f64,
    /// m/s².
    pub forward_deceleration: f64,
    /// m/s².
    pub backward_acceleration: f64,
    /// m/s².
    pub backward_deceleration: f64,
    /// rad/s².
    pub turn_acceleration: f64,
    /// rad/s².
    pub turn_deceleration: f64,
    /// Smallest deceleration when stopping is commanded, m/s².
    pub stop_deceleration: f64,
    /// Smallest turn deceleration when stopping is commanded, rad/s².
    pub stop_turn_deceleration: f64,
    /// Largest forward speed of a command, m/s.
    pub forward_speed: f64,
    /// Largest backward speed of a command, m/s, positive.
    pub backward_speed: f64,
    /// Largest turn rate of a command, rad/s.
    pub turn_speed: f64,
    /// Hard limit of the forward speed, m/s.
    pub hard_forward_speed: f64,
    /// Hard limit of the backward speed, m/s, positive.
    pub hard_backward_speed: f64,
    /// Hard limit of the turn rate, rad/s.
    pub hard_turn_speed: f64,
    /// Torque cap of each driven wheel, N·m.
    pub wheel_torque: f64,
    /// Position gain of each driven wheel, N·m/rad.
    pub wheel_stiffness: f64,
    /// Velocity gain of each driven wheel, N·m·s/rad.
    pub wheel_damping: f64,
    /// Coulomb friction of a driven tyre, no unit; the larger of this and the other
    /// body's applies.
    pub tyre_friction: f64,
    /// Coulomb friction of a caster, no unit; the smaller of this and the other body's
    /// applies.
    pub caster_friction: f64,
    /// Dry friction of each driven wheel's gear and bearings, N·m.
    pub wheel_friction: f64,
    /// Rolling resistance of a driven tyre per load, N/N.
    pub tyre_rolling_resistance: f64,
    /// Rolling resistance of a caster per load, N/N.
    pub caster_rolling_resistance: f64,
}

/// Gains and limits of the arm beyond those of the URDF.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArmSettings {
    /// Position gains from base to hand, N·m/rad.
    pub stiffness: [f64; 6],
    /// Velocity gains from base to hand, N·m·s/rad.
    pub damping: [f64; 6],
    /// Dry friction of the joints from base to hand, N·m.
    pub dry_friction: [f64; 6],
    /// Viscous friction of the joints from base to hand, N·m·s/rad.
    pub viscous_friction: [f64; 6],
    /// Links at least this many moving joints from the arm's base collide with the
    /// chair.
    pub chair_contact_joints: u32,
    /// Links this many moving joints apart collide with each other.
    pub self_contact_joints: u32,
    /// Joint acceleration, rad/s².
    pub acceleration: f64,
    /// Speed of the grasp point, m/s.
    pub tool_speed: f64,
    /// Turn rate of the end effector, rad/s.
    pub tool_turn_rate: f64,
    /// Acceleration of the end effector along lines and twists, m/s².
    pub tool_acceleration: f64,
    /// Turn acceleration of the end effector along lines and twists, rad/s².
    pub tool_turn_acceleration: f64,
}

/// Motors, limits and sizes of the gripper beyond those of the URDF. Balls are centre x,
/// y, z and radius, metres.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GripperSettings {
    /// Largest commanded distance between the pads, metres.
    pub stroke: f64,
    /// Largest commanded knuckle angle, rad.
    pub closed: f64,
    /// Knuckle speed, rad/s.
    pub speed: f64,
    /// Knuckle acceleration, rad/s².
    pub acceleration: f64,
    /// Position gain of each knuckle, N·m/rad.
    pub stiffness: f64,
    /// Velocity gain of each knuckle, N·m·s/rad.
    pub damping: f64,
    /// Viscous friction of each knuckle, N·m·s/rad.
    pub viscous_friction: f64,
    /// Inertia of the motor reflected to each knuckle, kg·m².
    pub knuckle_armature: f64,
    /// Inertia of the linkage reflected to each finger tip, kg·m².
    pub tip_armature: f64,
    /// Largest travel of any point of a finger per knuckle angle, m/rad: an upper bound,
    /// for the limits near a person.
    pub finger_lever: f64,
    /// Default force cap at each pad, N.
    pub force: f64,
    /// Largest force cap at each pad, N.
    pub max_force: f64,
    /// Balls around hand and wrist, in the end effector's frame.
    pub hand_balls: Vec<[f64; 4]>,
    /// Balls around the left crank and finger, from the knuckle's axis at angle 0.
    pub crank_balls: Vec<[f64; 4]>,
    /// Balls around the left finger tip, from its axis.
    pub tip_balls: Vec<[f64; 4]>,
    /// Space that the hand needs on its way to an object.
    pub corridor: CorridorSettings,
}

/// Space that the hand with open fingers needs on its way to an object, relative to the
/// grasp point.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CorridorSettings {
    /// Half of the width of the open fingers across the hand, metres.
    pub fingers: f64,
    /// Half of the width of palm and wrist, metres.
    pub wrist: f64,
    /// Extension of the finger tips beyond the grasp point, metres.
    pub tip: f64,
    /// Extension of the fingers back from the grasp point, metres.
    pub palm: f64,
    /// End of the wrist back from the grasp point, metres.
    pub back: f64,
    /// Half of the height of the fingers, metres.
    pub fingers_height: f64,
    /// Half of the height of the palm, metres.
    pub palm_height: f64,
    /// From above, the wrist extends down to this height above the grasp point, metres.
    pub above: f64,
}

/// Appearance of a material in addition to its colour in the URDF.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Surface {
    /// 0 (mirror) to 1.
    pub roughness: f32,
    /// 0 dielectric, 1 metal.
    pub metallic: f32,
    /// Pattern that multiplies the colour.
    pub texture: Option<SurfaceTexture>,
}

/// Texture of a material.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SurfaceTexture {
    /// Pattern name.
    pub pattern: String,
    /// Metres of surface per repetition.
    pub metres: f32,
}

/// Layout of `robot.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub name: String,
    pub urdf: String,
    arm_base_link: String,
    end_effector_link: String,
    tool_length: f64,
    shell_friction: f64,
    home: [f64; 6],
    #[serde(default)]
    postures: Vec<[f64; 6]>,
    footprint: [f64; 4],
    pub joints: Vec<JointTable>,
    pub frames: Vec<FrameTable>,
    outline: Vec<OutlineSettings>,
    travel: Option<TravelSettings>,
    reach: ReachSettings,
    drive: DriveSettings,
    arm: ArmSettings,
    gripper: GripperSettings,
    imu: ImuSettings,
    seat: Option<SeatSettings>,
    scanner: Option<ScannerSettings>,
    #[serde(default)]
    camera: Vec<CameraTable>,
    #[serde(default)]
    pub material: BTreeMap<String, Surface>,
}

/// One recorded joint.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct JointTable {
    pub name: String,
    pub role: JointRole,
}

/// One recorded frame.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FrameTable {
    pub name: String,
    pub link: String,
    pub role: FrameRole,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraTable {
    name: String,
    link: String,
    size: [u32; 2],
    focal: [f64; 2],
    principal: [f64; 2],
    range: [f64; 2],
    #[serde(default)]
    on_request: bool,
    #[serde(default)]
    tolerance: CameraTolerance,
}

impl File {
    /// The settings that are kept with the model.
    pub(super) fn settings(&self) -> Settings {
        Settings {
            cameras: self
                .camera
                .iter()
                .map(|camera| CameraMount {
                    name: camera.name.clone(),
                    link: camera.link.clone(),
                    pose: Isometry3::identity(),
                    size: camera.size,
                    focal: camera.focal,
                    principal: camera.principal,
                    range: camera.range,
                    on_request: camera.on_request,
                    tolerance: camera.tolerance,
                })
                .collect(),
            imu: self.imu.clone(),
            end_effector_link: self.end_effector_link.clone(),
            arm_base_link: self.arm_base_link.clone(),
            tool_length: self.tool_length,
            home: self.home,
            postures: self.postures.clone(),
            shell_friction: self.shell_friction,
            footprint: self.footprint,
            outlines: self.outline.clone(),
            travel: self.travel.clone(),
            reach: self.reach,
            drive: self.drive,
            arm: self.arm,
            gripper: self.gripper.clone(),
            seat: self.seat.clone(),
            scanner: self.scanner.clone(),
        }
    }
}

impl Settings {
    /// The first invalid number: its name and the allowed range.
    pub(super) fn fault(&self) -> Option<(String, f64, String)> {
        let (drive, corridor) = (&self.drive, &self.gripper.corridor);
        let positive = [
            ("tool_length", self.tool_length),
            ("drive.wheel_radius", drive.wheel_radius),
            ("drive.track", drive.track),
            ("drive.forward_acceleration", drive.forward_acceleration),
            ("drive.forward_deceleration", drive.forward_deceleration),
            ("drive.backward_acceleration", drive.backward_acceleration),
            ("drive.backward_deceleration", drive.backward_deceleration),
            ("drive.turn_acceleration", drive.turn_acceleration),
            ("drive.turn_deceleration", drive.turn_deceleration),
            ("drive.stop_deceleration", drive.stop_deceleration),
            ("drive.stop_turn_deceleration", drive.stop_turn_deceleration),
            ("drive.forward_speed", drive.forward_speed),
            ("drive.backward_speed", drive.backward_speed),
            ("drive.turn_speed", drive.turn_speed),
            ("drive.hard_forward_speed", drive.hard_forward_speed),
            ("drive.hard_backward_speed", drive.hard_backward_speed),
            ("drive.hard_turn_speed", drive.hard_turn_speed),
            ("drive.wheel_torque", drive.wheel_torque),
            ("arm.acceleration", self.arm.acceleration),
            ("arm.tool_speed", self.arm.tool_speed),
            ("arm.tool_turn_rate", self.arm.tool_turn_rate),
            ("arm.tool_acceleration", self.arm.tool_acceleration),
            (
                "arm.tool_turn_acceleration",
                self.arm.tool_turn_acceleration,
            ),
            ("reach.inner_radius", self.reach.inner_radius),
            (
                "reach.outer_radius - reach.inner_radius",
                self.reach.outer_radius - self.reach.inner_radius,
            ),
            ("reach.nearest", self.reach.nearest),
            (
                "reach.furthest - reach.nearest",
                self.reach.furthest - self.reach.nearest,
            ),
            ("gripper.stroke", self.gripper.stroke),
            ("gripper.closed", self.gripper.closed),
            ("gripper.speed", self.gripper.speed),
            ("gripper.acceleration", self.gripper.acceleration),
            ("gripper.force", self.gripper.force),
            ("gripper.max_force", self.gripper.max_force),
            ("gripper.corridor.fingers", corridor.fingers),
            ("gripper.corridor.wrist", corridor.wrist),
            ("gripper.corridor.tip", corridor.tip),
            ("gripper.corridor.palm", corridor.palm),
            (
                "gripper.corridor.back - gripper.corridor.palm",
                corridor.back - corridor.palm,
            ),
            ("gripper.corridor.fingers_height", corridor.fingers_height),
            ("gripper.corridor.palm_height", corridor.palm_height),
            ("gripper.corridor.above", corridor.above),
        ];
        let gains = (0..6).flat_map(|i| {
            [
                (format!("arm.stiffness[{i}]"), self.arm.stiffness[i]),
                (format!("arm.damping[{i}]"), self.arm.damping[i]),
            ]
        });
        let optics = self.cameras.iter().flat_map(|camera| {
            let name = &camera.name;
            [
                (format!("camera {name}: focal[0]"), camera.focal[0]),
                (format!("camera {name}: focal[1]"), camera.focal[1]),
                (format!("camera {name}: size[0]"), f64::from(camera.size[0])),
                (format!("camera {name}: size[1]"), f64::from(camera.size[1])),
                (format!("camera {name}: range[0]"), camera.range[0]),
                (
                    format!("camera {name}: range[1] - range[0]"),
                    camera.range[1] - camera.range[0],
                ),
            ]
        });
        let balls = [
            ("hand", &self.gripper.hand_balls),
            ("crank", &self.gripper.crank_balls),
            ("tip", &self.gripper.tip_balls),
        ];
        let balls = balls.into_iter().flat_map(|(name, balls)| {
            let radii = balls.iter().enumerate();
            radii.map(move |(i, ball)| (format!("gripper.{name}_balls[{i}]: radius"), ball[3]))
        });
        let travel = self.travel.as_ref().map(|travel| &travel.outlines);
        let lists = [("outline", &self.outlines)].into_iter();
        let lists = lists.chain(travel.map(|outlines| ("travel.outline", outlines)));
        let outlines = lists.flat_map(|(name, list)| {
            let below = std::iter::once(0.0).chain(list.iter().map(|o| o.top));
            let numbered = list.iter().zip(below).enumerate();
            numbered.flat_map(move |(i, (outline, below))| {
                let [x_min, x_max, y_min, y_max] = outline.footprint;
                [
                    (
                        format!("{name}[{i}]: top above the one below"),
                        outline.top - below,
                    ),
                    (format!("{name}[{i}]: x max - x min"), x_max - x_min),
                    (format!("{name}[{i}]: y max - y min"), y_max - y_min),
                ]
            })
        });
        let seat = self.seat.iter().flat_map(|seat| {
            let [length, width] = seat.size;
            [
                ("seat.at[2]".to_owned(), seat.at[2]),
                ("seat.size[0]".to_owned(), length),
                ("seat.size[1]".to_owned(), width),
            ]
        });
        let scanner = self.scanner.iter().flat_map(|scanner| {
            let [least, greatest] = scanner.range;
            [
                ("scanner.step_deg".to_owned(), scanner.step_deg),
                ("scanner.range[0]".to_owned(), least),
                (
                    "scanner.range[1] - scanner.range[0]".to_owned(),
                    greatest - least,
                ),
            ]
        });
        let [x_min, x_max, y_min, y_max] = self.footprint;
        let footprint = [
            ("footprint: x max - x min".to_owned(), x_max - x_min),
            ("footprint: y max - y min".to_owned(), y_max - y_min),
        ];
        let not_negative = [
            ("drive.wheel_friction", drive.wheel_friction),
            (
                "drive.tyre_rolling_resistance",
                drive.tyre_rolling_resistance,
            ),
            (
                "drive.caster_rolling_resistance",
                drive.caster_rolling_resistance,
            ),
            ("gripper.viscous_friction", self.gripper.viscous_friction),
            ("imu.acceleration_noise", self.imu.acceleration_noise),
            ("imu.gyro_noise", self.imu.gyro_noise),
            ("imu.orientation_noise", self.imu.orientation_noise),
        ];
        let not_negative = not_negative.map(|(name, value)| (name.to_owned(), value));
        let friction = (0..6).flat_map(|i| {
            let (dry, viscous) = (self.arm.dry_friction[i], self.arm.viscous_friction[i]);
            [
                (format!("arm.dry_friction[{i}]"), dry),
                (format!("arm.viscous_friction[{i}]"), viscous),
            ]
        });
        positive
            .into_iter()
            .map(|(name, value)| (name.to_owned(), value))
            .chain(gains)
            .chain(optics)
            .chain(balls)
            .chain(outlines)
            .chain(footprint)
            .chain(seat)
            .chain(scanner)
            .find(|(_, value)| !(value.is_finite() && *value > 0.0))
            .map(|(name, value)| (name, value, "greater than 0".to_owned()))
            .or_else(|| {
                not_negative
                    .into_iter()
                    .chain(friction)
                    .find(|(_, value)| !(value.is_finite() && *value >= 0.0))
                    .map(|(name, value)| (name, value, "0 or more".to_owned()))
            })
            .or_else(|| self.out_of_range())
    }

    /// The first gain, friction, inertia or count of joints outside the range in which
    /// the physics has been tried.
    fn out_of_range(&self) -> Option<(String, f64, String)> {
        let (drive, gripper) = (&self.drive, &self.gripper);
        let joints = |count: u32| f64::from(count);
        let (chair, own) = (self.arm.chair_contact_joints, self.arm.self_contact_joints);
        let ranges = [
            ("shell_friction", self.shell_friction, FRICTIONS, ""),
            ("drive.tyre_friction", drive.tyre_friction, FRICTIONS, ""),
            (
                "drive.caster_friction",
                drive.caster_friction,
                FRICTIONS,
                "",
            ),
            (
                "drive.wheel_stiffness",
                drive.wheel_stiffness,
                GAINS,
                "N·m/rad",
            ),
            (
                "drive.wheel_damping",
                drive.wheel_damping,
                GAINS,
                "N·m·s/rad",
            ),
            ("gripper.stiffness", gripper.stiffness, GAINS, "N·m/rad"),
            ("gripper.damping", gripper.damping, GAINS, "N·m·s/rad"),
            (
                "gripper.knuckle_armature",
                gripper.knuckle_armature,
                ARMATURES,
                "kg·m²",
            ),
            (
                "gripper.tip_armature",
                gripper.tip_armature,
                ARMATURES,
                "kg·m²",
            ),
            (
                "gripper.finger_lever",
                gripper.finger_lever,
                [0.0, 1.0],
                "m/rad",
            ),
            ("arm.chair_contact_joints", joints(chair), JOINT_COUNTS, ""),
            ("arm.self_contact_joints", joints(own), JOINT_COUNTS, ""),
        ];
        let scanner = self.scanner.iter().flat_map(|scanner| {
            let rays = f64::from(scanner.rays);
            let turn = scanner.step_deg * (rays - 1.0);
            [
                ("scanner.rays", rays, RAYS, ""),
                ("scanner.first_deg", scanner.first_deg, [-360.0, 360.0], "°"),
                ("scanner.range[1]", scanner.range[1], [0.0, 100.0], "m"),
                (
                    "scanner.step_deg * (scanner.rays - 1)",
                    turn,
                    [0.0, 360.0],
                    "°",
                ),
            ]
        });
        let mut ranges = ranges.into_iter().chain(scanner);
        // A comparison with NaN is false, so NaN is out of every range.
        let outside =
            ranges.find(|(_, value, [least, most], _)| !(least <= value && value <= most));
        outside.map(|(name, value, [least, most], unit)| {
            let expected = format!("{least} to {most} {unit}");
            (name.to_owned(), value, expected.trim_end().to_owned())
        })
    }
}

/// Range of Coulomb coefficients, no unit.
const FRICTIONS: [f64; 2] = [0.0, 2.0];
/// Range of the gains of wheels and knuckles, N·m/rad and N·m·s/rad.
const GAINS: [f64; 2] = [0.1, 1e5];
/// Range of reflected inertias, kg·m². [choice: ten times those of two
/// grippers to either side]
const ARMATURES: [f64; 2] = [1e-4, 0.1];
/// Range of the rays of a scan.
const RAYS: [f64; 2] = [1.0, 4096.0];
/// Range of the numbers of joints between links that collide.
const JOINT_COUNTS: [f64; 2] = [1.0, 15.0];
