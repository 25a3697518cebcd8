"""Messages of the contract `wheelarm.v1`. Made by `scripts/make_contract.py`."""

from collections.abc import Iterable as _Iterable
from collections.abc import Mapping as _Mapping
from typing import Any as _Any
from typing import ClassVar as _ClassVar

from google.protobuf.internal.containers import RepeatedCompositeFieldContainer as _Messages
from google.protobuf.internal.containers import RepeatedScalarFieldContainer as _Scalars
from google.protobuf.internal.enum_type_wrapper import EnumTypeWrapper as _EnumWrapper
from google.protobuf.message import Message as _Message

class FailureCode(int, metaclass=_EnumWrapper):
    """Why a request was not carried out, for programs."""
    FAILURE_CODE_UNSPECIFIED: _ClassVar[FailureCode]
    """Not told."""
    FAILURE_CODE_INVALID: _ClassVar[FailureCode]
    """The request cannot be read, or a field of it is wrong."""
    FAILURE_CODE_TOO_LONG: _ClassVar[FailureCode]
    """The request is too long."""
    FAILURE_CODE_BUSY: _ClassVar[FailureCode]
    """Too many queries wait; the same request may do in a moment."""
    FAILURE_CODE_CONTROL_HELD: _ClassVar[FailureCode]
    """Somebody else is in control."""
    FAILURE_CODE_NO_CONTROL: _ClassVar[FailureCode]
    """Nobody is in control, and somebody must be."""
    FAILURE_CODE_SECRET: _ClassVar[FailureCode]
    """The secret is not that of the lease."""
    FAILURE_CODE_EPISODE_RUNS: _ClassVar[FailureCode]
    """An episode runs."""
    FAILURE_CODE_NO_EPISODE: _ClassVar[FailureCode]
    """No episode runs."""
    FAILURE_CODE_BROKEN: _ClassVar[FailureCode]
    """The state of the simulation is broken; a `reset` mends it."""
    FAILURE_CODE_SCENARIO: _ClassVar[FailureCode]
    """The scenario cannot be simulated."""
    FAILURE_CODE_PACING: _ClassVar[FailureCode]
    """The pacing is another than what this needs."""
    FAILURE_CODE_FOREIGN: _ClassVar[FailureCode]
    """The payload names somebody else than the key does."""
    FAILURE_CODE_VERSION: _ClassVar[FailureCode]
    """The other side speaks another version of the contract."""
    FAILURE_CODE_INTERNAL: _ClassVar[FailureCode]
    """The server's own fault."""

FAILURE_CODE_UNSPECIFIED: FailureCode
FAILURE_CODE_INVALID: FailureCode
FAILURE_CODE_TOO_LONG: FailureCode
FAILURE_CODE_BUSY: FailureCode
FAILURE_CODE_CONTROL_HELD: FailureCode
FAILURE_CODE_NO_CONTROL: FailureCode
FAILURE_CODE_SECRET: FailureCode
FAILURE_CODE_EPISODE_RUNS: FailureCode
FAILURE_CODE_NO_EPISODE: FailureCode
FAILURE_CODE_BROKEN: FailureCode
FAILURE_CODE_SCENARIO: FailureCode
FAILURE_CODE_PACING: FailureCode
FAILURE_CODE_FOREIGN: FailureCode
FAILURE_CODE_VERSION: FailureCode
FAILURE_CODE_INTERNAL: FailureCode

class BodyPart(int, metaclass=_EnumWrapper):
    """A part of a person."""
    BODY_PART_UNSPECIFIED: _ClassVar[BodyPart]
    """None, or the whole person."""
    BODY_PART_HEAD: _ClassVar[BodyPart]
    """The head without the face."""
    BODY_PART_FACE: _ClassVar[BodyPart]
    """The face."""
    BODY_PART_MOUTH: _ClassVar[BodyPart]
    """The mouth."""
    BODY_PART_TORSO: _ClassVar[BodyPart]
    """Neck and torso."""
    BODY_PART_ARMS: _ClassVar[BodyPart]
    """Upper arms and forearms."""
    BODY_PART_HANDS: _ClassVar[BodyPart]
    """Hands."""
    BODY_PART_LAP: _ClassVar[BodyPart]
    """The lap: thighs of who sits."""
    BODY_PART_LEGS: _ClassVar[BodyPart]
    """Legs below the knee, and feet."""

BODY_PART_UNSPECIFIED: BodyPart
BODY_PART_HEAD: BodyPart
BODY_PART_FACE: BodyPart
BODY_PART_MOUTH: BodyPart
BODY_PART_TORSO: BodyPart
BODY_PART_ARMS: BodyPart
BODY_PART_HANDS: BodyPart
BODY_PART_LAP: BodyPart
BODY_PART_LEGS: BodyPart

class PixelFormat(int, metaclass=_EnumWrapper):
    """How the pixels of a plane are written; rows follow each other from the top, numbers are
    little-endian.
    """
    PIXEL_FORMAT_UNSPECIFIED: _ClassVar[PixelFormat]
    """As the first recordings had them: RGB8, float32 metres, 8-bit ids."""
    PIXEL_FORMAT_RGB8: _ClassVar[PixelFormat]
    """Red, green, blue, 8 bits each, sRGB."""
    PIXEL_FORMAT_DEPTH_METRES_F32: _ClassVar[PixelFormat]
    """float32, metres along the optical axis; +inf where nothing is hit."""
    PIXEL_FORMAT_DEPTH_MILLIMETRES_U16: _ClassVar[PixelFormat]
    """16 bits, millimetres along the optical axis; 0 where nothing is hit."""
    PIXEL_FORMAT_ID_U8: _ClassVar[PixelFormat]
    """8 bits, instance id; 0 where nothing is hit."""
    PIXEL_FORMAT_ID_U16: _ClassVar[PixelFormat]
    """16 bits, instance id; 0 where nothing is hit."""

PIXEL_FORMAT_UNSPECIFIED: PixelFormat
PIXEL_FORMAT_RGB8: PixelFormat
PIXEL_FORMAT_DEPTH_METRES_F32: PixelFormat
PIXEL_FORMAT_DEPTH_MILLIMETRES_U16: PixelFormat
PIXEL_FORMAT_ID_U8: PixelFormat
PIXEL_FORMAT_ID_U16: PixelFormat

class PreviewLevel(int, metaclass=_EnumWrapper):
    """Size, rate and quality of a preview."""
    PREVIEW_LEVEL_UNSPECIFIED: _ClassVar[PreviewLevel]
    """Not told."""
    PREVIEW_LEVEL_LOW: _ClassVar[PreviewLevel]
    """For links of about 0.5 Mbit/s."""
    PREVIEW_LEVEL_MEDIUM: _ClassVar[PreviewLevel]
    """For links of about 3 Mbit/s."""
    PREVIEW_LEVEL_HIGH: _ClassVar[PreviewLevel]
    """For local networks."""
    PREVIEW_LEVEL_FLAT: _ClassVar[PreviewLevel]
    """Raw pictures of 640 pixels' width, for who encodes them on the same host."""
    PREVIEW_LEVEL_FLAT_LARGE: _ClassVar[PreviewLevel]
    """Raw pictures of 1280 pixels' width, for who encodes them on the same host."""

PREVIEW_LEVEL_UNSPECIFIED: PreviewLevel
PREVIEW_LEVEL_LOW: PreviewLevel
PREVIEW_LEVEL_MEDIUM: PreviewLevel
PREVIEW_LEVEL_HIGH: PreviewLevel
PREVIEW_LEVEL_FLAT: PreviewLevel
PREVIEW_LEVEL_FLAT_LARGE: PreviewLevel

class CommandFrame(int, metaclass=_EnumWrapper):
    """Frame in which a Cartesian command is expressed."""
    COMMAND_FRAME_UNSPECIFIED: _ClassVar[CommandFrame]
    """Taken as `base_link`."""
    COMMAND_FRAME_BASE_LINK: _ClassVar[CommandFrame]
    """Base of the arm."""
    COMMAND_FRAME_END_EFFECTOR: _ClassVar[CommandFrame]
    """The end effector itself."""
    COMMAND_FRAME_WHEELCHAIR: _ClassVar[CommandFrame]
    """The chair (`wheelchair_root`)."""
    COMMAND_FRAME_HOUSE: _ClassVar[CommandFrame]
    """The world (`house`)."""

COMMAND_FRAME_UNSPECIFIED: CommandFrame
COMMAND_FRAME_BASE_LINK: CommandFrame
COMMAND_FRAME_END_EFFECTOR: CommandFrame
COMMAND_FRAME_WHEELCHAIR: CommandFrame
COMMAND_FRAME_HOUSE: CommandFrame

class Phase(int, metaclass=_EnumWrapper):
    """Phase of the work as the operator sees it."""
    PHASE_UNSPECIFIED: _ClassVar[Phase]
    """Not told."""
    PHASE_NAVIGATING: _ClassVar[Phase]
    """The chair drives (label 0 of WheelArm-Sim)."""
    PHASE_REACHING: _ClassVar[Phase]
    """The arm reaches (label 1)."""
    PHASE_GRASPING: _ClassVar[Phase]
    """The gripper closes (label 2)."""
    PHASE_RETRACTING: _ClassVar[Phase]
    """The arm lifts or retracts (label 3)."""

PHASE_UNSPECIFIED: Phase
PHASE_NAVIGATING: Phase
PHASE_REACHING: Phase
PHASE_GRASPING: Phase
PHASE_RETRACTING: Phase

class Device(int, metaclass=_EnumWrapper):
    """What a person, or a program, commands with."""
    DEVICE_UNSPECIFIED: _ClassVar[Device]
    """Not told."""
    DEVICE_KEYBOARD: _ClassVar[Device]
    """A keyboard."""
    DEVICE_MOUSE: _ClassVar[Device]
    """A mouse."""
    DEVICE_TOUCH: _ClassVar[Device]
    """A touch screen."""
    DEVICE_GAMEPAD: _ClassVar[Device]
    """A gamepad, an adaptive controller, a joystick."""
    DEVICE_SWITCH: _ClassVar[Device]
    """One switch or two, by scanning."""
    DEVICE_DWELL: _ClassVar[Device]
    """Dwelling with a head mouse or the eyes."""
    DEVICE_VOICE: _ClassVar[Device]
    """The voice."""
    DEVICE_VR: _ClassVar[Device]
    """A headset with controllers."""
    DEVICE_SCRIPT: _ClassVar[Device]
    """The scripted operator."""
    DEVICE_POLICY: _ClassVar[Device]
    """A learned policy."""
    DEVICE_REPLAY: _ClassVar[Device]
    """A recording that is played again."""
    DEVICE_PROGRAM: _ClassVar[Device]
    """Another program, for example a bridge."""

DEVICE_UNSPECIFIED: Device
DEVICE_KEYBOARD: Device
DEVICE_MOUSE: Device
DEVICE_TOUCH: Device
DEVICE_GAMEPAD: Device
DEVICE_SWITCH: Device
DEVICE_DWELL: Device
DEVICE_VOICE: Device
DEVICE_VR: Device
DEVICE_SCRIPT: Device
DEVICE_POLICY: Device
DEVICE_REPLAY: Device
DEVICE_PROGRAM: Device

class InputMode(int, metaclass=_EnumWrapper):
    """How an input becomes motion."""
    INPUT_MODE_UNSPECIFIED: _ClassVar[InputMode]
    """Not told."""
    INPUT_MODE_HOLD: _ClassVar[InputMode]
    """It moves while it is held."""
    INPUT_MODE_LATCH: _ClassVar[InputMode]
    """One press starts, the next one stops."""
    INPUT_MODE_STEP: _ClassVar[InputMode]
    """One press is one step."""
    INPUT_MODE_GOAL: _ClassVar[InputMode]
    """A place or a pose is named, and skills or a policy go there."""
    INPUT_MODE_STREAM: _ClassVar[InputMode]
    """Every control tick has a value of its own."""

INPUT_MODE_UNSPECIFIED: InputMode
INPUT_MODE_HOLD: InputMode
INPUT_MODE_LATCH: InputMode
INPUT_MODE_STEP: InputMode
INPUT_MODE_GOAL: InputMode
INPUT_MODE_STREAM: InputMode

class Assistance(int, metaclass=_EnumWrapper):
    """What helps the person who commands."""
    ASSISTANCE_UNSPECIFIED: _ClassVar[Assistance]
    """Not told."""
    ASSISTANCE_SKILL: _ClassVar[Assistance]
    """Skills carry out what the person named."""
    ASSISTANCE_SHARED: _ClassVar[Assistance]
    """The person's own motion is corrected or bounded."""
    ASSISTANCE_NONE: _ClassVar[Assistance]
    """Nothing helps."""

ASSISTANCE_UNSPECIFIED: Assistance
ASSISTANCE_SKILL: Assistance
ASSISTANCE_SHARED: Assistance
ASSISTANCE_NONE: Assistance

class Incident(int, metaclass=_EnumWrapper):
    """What a commander says of an error of its own, for the recording."""
    INCIDENT_UNSPECIFIED: _ClassVar[Incident]
    """Nothing."""
    INCIDENT_FORCED_WRONG_GRASP: _ClassVar[Incident]
    """The hand closes beside the thing, on purpose."""
    INCIDENT_FORCED_WRONG_OBJECT: _ClassVar[Incident]
    """It takes another thing than the one that is asked for, on purpose."""
    INCIDENT_FORCED_DROP: _ClassVar[Incident]
    """It drops the thing, on purpose."""
    INCIDENT_MISSED: _ClassVar[Incident]
    """An attempt came to nothing, not on purpose."""
    INCIDENT_MOVED: _ClassVar[Incident]
    """The thing is no longer where it was."""
    INCIDENT_RECOVERED: _ClassVar[Incident]
    """The thing is in the hand again."""

INCIDENT_UNSPECIFIED: Incident
INCIDENT_FORCED_WRONG_GRASP: Incident
INCIDENT_FORCED_WRONG_OBJECT: Incident
INCIDENT_FORCED_DROP: Incident
INCIDENT_MISSED: Incident
INCIDENT_MOVED: Incident
INCIDENT_RECOVERED: Incident

class RefusalCode(int, metaclass=_EnumWrapper):
    """Why a command was not taken, for programs."""
    REFUSAL_CODE_UNSPECIFIED: _ClassVar[RefusalCode]
    """Not told."""
    REFUSAL_CODE_INVALID: _ClassVar[RefusalCode]
    """It cannot be read, or a field of it is wrong."""
    REFUSAL_CODE_TOO_LONG: _ClassVar[RefusalCode]
    """It is too long."""
    REFUSAL_CODE_NO_CONTROL: _ClassVar[RefusalCode]
    """Nobody is in control; ask for it."""
    REFUSAL_CODE_CONTROL_HELD: _ClassVar[RefusalCode]
    """Somebody else is in control, or another process of the same name."""
    REFUSAL_CODE_SEAL: _ClassVar[RefusalCode]
    """It has no seal, or a wrong one."""
    REFUSAL_CODE_EPISODE: _ClassVar[RefusalCode]
    """It is for another episode."""
    REFUSAL_CODE_TOO_OLD: _ClassVar[RefusalCode]
    """It answers a state that is too old, or in lock-step one that is over."""
    REFUSAL_CODE_AHEAD: _ClassVar[RefusalCode]
    """It answers a state that has not come."""
    REFUSAL_CODE_NO_TICK: _ClassVar[RefusalCode]
    """It moves something and does not say which state it answers."""
    REFUSAL_CODE_ANSWERED: _ClassVar[RefusalCode]
    """The state was answered already."""
    REFUSAL_CODE_SEQUENCE: _ClassVar[RefusalCode]
    """Its sequence number is old, repeated, or jumps too far."""
    REFUSAL_CODE_RATE: _ClassVar[RefusalCode]
    """Commands come too fast."""
    REFUSAL_CODE_CLOSED: _ClassVar[RefusalCode]
    """No command is taken before a `reset`: the state is broken."""
    REFUSAL_CODE_FOREIGN: _ClassVar[RefusalCode]
    """The payload names another commander than the key does."""
    REFUSAL_CODE_VERSION: _ClassVar[RefusalCode]
    """It is of another version of the contract."""

REFUSAL_CODE_UNSPECIFIED: RefusalCode
REFUSAL_CODE_INVALID: RefusalCode
REFUSAL_CODE_TOO_LONG: RefusalCode
REFUSAL_CODE_NO_CONTROL: RefusalCode
REFUSAL_CODE_CONTROL_HELD: RefusalCode
REFUSAL_CODE_SEAL: RefusalCode
REFUSAL_CODE_EPISODE: RefusalCode
REFUSAL_CODE_TOO_OLD: RefusalCode
REFUSAL_CODE_AHEAD: RefusalCode
REFUSAL_CODE_NO_TICK: RefusalCode
REFUSAL_CODE_ANSWERED: RefusalCode
REFUSAL_CODE_SEQUENCE: RefusalCode
REFUSAL_CODE_RATE: RefusalCode
REFUSAL_CODE_CLOSED: RefusalCode
REFUSAL_CODE_FOREIGN: RefusalCode
REFUSAL_CODE_VERSION: RefusalCode

class JointRole(int, metaclass=_EnumWrapper):
    """What a joint of the robot is for."""
    JOINT_ROLE_UNSPECIFIED: _ClassVar[JointRole]
    """Nothing that a client has to know."""
    JOINT_ROLE_WHEEL_LEFT: _ClassVar[JointRole]
    """Left driven wheel."""
    JOINT_ROLE_WHEEL_RIGHT: _ClassVar[JointRole]
    """Right driven wheel."""
    JOINT_ROLE_CASTER_LEFT: _ClassVar[JointRole]
    """Left wheel that rolls along."""
    JOINT_ROLE_CASTER_RIGHT: _ClassVar[JointRole]
    """Right wheel that rolls along."""
    JOINT_ROLE_ARM: _ClassVar[JointRole]
    """One of the arm's; `arm_index` says which."""
    JOINT_ROLE_KNUCKLE: _ClassVar[JointRole]
    """Knuckle of the left finger: `GripperCommand.knuckle` is its position."""
    JOINT_ROLE_KNUCKLE_RIGHT: _ClassVar[JointRole]
    """Knuckle of the right finger, which turns as far the other way."""
    JOINT_ROLE_FINGER_TIP_LEFT: _ClassVar[JointRole]
    """Tip of the left finger: keeps the left pad parallel to the hand."""
    JOINT_ROLE_FINGER_TIP_RIGHT: _ClassVar[JointRole]
    """Tip of the right finger."""
    JOINT_ROLE_INNER_KNUCKLE_LEFT: _ClassVar[JointRole]
    """Inner knuckle of the left finger: the closed side of its parallelogram."""
    JOINT_ROLE_INNER_KNUCKLE_RIGHT: _ClassVar[JointRole]
    """Inner knuckle of the right finger."""

JOINT_ROLE_UNSPECIFIED: JointRole
JOINT_ROLE_WHEEL_LEFT: JointRole
JOINT_ROLE_WHEEL_RIGHT: JointRole
JOINT_ROLE_CASTER_LEFT: JointRole
JOINT_ROLE_CASTER_RIGHT: JointRole
JOINT_ROLE_ARM: JointRole
JOINT_ROLE_KNUCKLE: JointRole
JOINT_ROLE_KNUCKLE_RIGHT: JointRole
JOINT_ROLE_FINGER_TIP_LEFT: JointRole
JOINT_ROLE_FINGER_TIP_RIGHT: JointRole
JOINT_ROLE_INNER_KNUCKLE_LEFT: JointRole
JOINT_ROLE_INNER_KNUCKLE_RIGHT: JointRole

class JointType(int, metaclass=_EnumWrapper):
    """How a joint moves."""
    JOINT_TYPE_UNSPECIFIED: _ClassVar[JointType]
    """Not told."""
    JOINT_TYPE_REVOLUTE: _ClassVar[JointType]
    """Turns within limits."""
    JOINT_TYPE_CONTINUOUS: _ClassVar[JointType]
    """Turns without limits; positions are not wrapped."""
    JOINT_TYPE_PRISMATIC: _ClassVar[JointType]
    """Slides within limits."""

JOINT_TYPE_UNSPECIFIED: JointType
JOINT_TYPE_REVOLUTE: JointType
JOINT_TYPE_CONTINUOUS: JointType
JOINT_TYPE_PRISMATIC: JointType

class FrameRole(int, metaclass=_EnumWrapper):
    """What a recorded frame is."""
    FRAME_ROLE_UNSPECIFIED: _ClassVar[FrameRole]
    """Nothing that a client has to know."""
    FRAME_ROLE_CHAIR: _ClassVar[FrameRole]
    """The chair; its parent is `house`."""
    FRAME_ROLE_ARM_LINK: _ClassVar[FrameRole]
    """A link of the arm, from the base outwards; its parent is the arm's base."""
    FRAME_ROLE_END_EFFECTOR: _ClassVar[FrameRole]
    """The end effector; its parent is the arm's base."""

FRAME_ROLE_UNSPECIFIED: FrameRole
FRAME_ROLE_CHAIR: FrameRole
FRAME_ROLE_ARM_LINK: FrameRole
FRAME_ROLE_END_EFFECTOR: FrameRole

class CameraMount(int, metaclass=_EnumWrapper):
    """What a camera of the robot rides on."""
    CAMERA_MOUNT_UNSPECIFIED: _ClassVar[CameraMount]
    """Not told."""
    CAMERA_MOUNT_CHAIR: _ClassVar[CameraMount]
    """The chair."""
    CAMERA_MOUNT_ARM: _ClassVar[CameraMount]
    """The arm: it moves with the hand."""

CAMERA_MOUNT_UNSPECIFIED: CameraMount
CAMERA_MOUNT_CHAIR: CameraMount
CAMERA_MOUNT_ARM: CameraMount

class ReachProblem(int, metaclass=_EnumWrapper):
    """Why the end effector does not reach a pose."""
    REACH_PROBLEM_UNSPECIFIED: _ClassVar[ReachProblem]
    """It does; or not told by an older server."""
    REACH_PROBLEM_TOO_FAR: _ClassVar[ReachProblem]
    """The pose is further from the shoulder than the arm is long."""
    REACH_PROBLEM_JOINT_LIMITS: _ClassVar[ReachProblem]
    """The closest joint positions lie on their limits."""
    REACH_PROBLEM_NO_SOLUTION: _ClassVar[ReachProblem]
    """Within reach, but no joint positions were found."""
    REACH_PROBLEM_JUMP: _ClassVar[ReachProblem]
    """Near the given joint positions only a jump of a joint leads there."""
    REACH_PROBLEM_PERSON: _ClassVar[ReachProblem]
    """The arm would touch the person in the chair."""

REACH_PROBLEM_UNSPECIFIED: ReachProblem
REACH_PROBLEM_TOO_FAR: ReachProblem
REACH_PROBLEM_JOINT_LIMITS: ReachProblem
REACH_PROBLEM_NO_SOLUTION: ReachProblem
REACH_PROBLEM_JUMP: ReachProblem
REACH_PROBLEM_PERSON: ReachProblem

class LanguageSplit(int, metaclass=_EnumWrapper):
    """Which templates and names of the grammar are said."""
    LANGUAGE_SPLIT_UNSPECIFIED: _ClassVar[LanguageSplit]
    """The one in force; at first all."""
    LANGUAGE_SPLIT_ANY: _ClassVar[LanguageSplit]
    """All."""
    LANGUAGE_SPLIT_TRAIN: _ClassVar[LanguageSplit]
    """Those that are not held out."""
    LANGUAGE_SPLIT_HELD_OUT: _ClassVar[LanguageSplit]
    """A template that is held out, and a name that is for what the task is about."""

LANGUAGE_SPLIT_UNSPECIFIED: LanguageSplit
LANGUAGE_SPLIT_ANY: LanguageSplit
LANGUAGE_SPLIT_TRAIN: LanguageSplit
LANGUAGE_SPLIT_HELD_OUT: LanguageSplit

class Pacing(int, metaclass=_EnumWrapper):
    """How simulation time relates to wall time."""
    PACING_UNSPECIFIED: _ClassVar[Pacing]
    """The one in force."""
    PACING_REAL_TIME: _ClassVar[Pacing]
    """One simulated second per second, slower where the host cannot keep up."""
    PACING_LOCK_STEP: _ClassVar[Pacing]
    """Waits for the commander at every control tick and for the recorders' credit."""
    PACING_FAST: _ClassVar[Pacing]
    """As fast as it goes, for benchmarks."""

PACING_UNSPECIFIED: Pacing
PACING_REAL_TIME: Pacing
PACING_LOCK_STEP: Pacing
PACING_FAST: Pacing

class RenderQuality(int, metaclass=_EnumWrapper):
    """How much work goes into a camera picture. Recorded with the data."""
    RENDER_QUALITY_UNSPECIFIED: _ClassVar[RenderQuality]
    """The one in force."""
    RENDER_QUALITY_FAST: _ClassVar[RenderQuality]
    """No shadows."""
    RENDER_QUALITY_STANDARD: _ClassVar[RenderQuality]
    """Filtered shadows, anti-aliased edges, smoothed ambient light."""
    RENDER_QUALITY_HIGH: _ClassVar[RenderQuality]
    """Multisampling and soft shadows."""
    RENDER_QUALITY_DRAFT: _ClassVar[RenderQuality]
    """One shadow map; neither shadows nor edges are filtered."""

RENDER_QUALITY_UNSPECIFIED: RenderQuality
RENDER_QUALITY_FAST: RenderQuality
RENDER_QUALITY_STANDARD: RenderQuality
RENDER_QUALITY_HIGH: RenderQuality
RENDER_QUALITY_DRAFT: RenderQuality

class Starts(int, metaclass=_EnumWrapper):
    """Where the robot starts."""
    STARTS_UNSPECIFIED: _ClassVar[Starts]
    """The one in force."""
    STARTS_NEAR: _ClassVar[Starts]
    """Near by, facing the shelf, the arm at home and the gripper open."""
    STARTS_ANYWHERE: _ClassVar[Starts]
    """Anywhere in the home from where there is a way, the arm in one of the robot's postures, the
    gripper open or closed.
    """

STARTS_UNSPECIFIED: Starts
STARTS_NEAR: Starts
STARTS_ANYWHERE: Starts

class GoalKind(int, metaclass=_EnumWrapper):
    """What a task asks for."""
    GOAL_KIND_UNSPECIFIED: _ClassVar[GoalKind]
    """No task."""
    GOAL_KIND_LIFT: _ClassVar[GoalKind]
    """The target is lifted and held."""
    GOAL_KIND_PUT: _ClassVar[GoalKind]
    """The target is put into a region and left there."""
    GOAL_KIND_OPEN: _ClassVar[GoalKind]
    """A joint of furniture is opened."""
    GOAL_KIND_CLOSE: _ClassVar[GoalKind]
    """A joint of furniture is closed."""
    GOAL_KIND_GIVE: _ClassVar[GoalKind]
    """The target is put into the lap of the person in the chair and left there."""
    GOAL_KIND_BRING: _ClassVar[GoalKind]
    """The target's tip is brought to the mouth of the person in the chair and held there."""

GOAL_KIND_UNSPECIFIED: GoalKind
GOAL_KIND_LIFT: GoalKind
GOAL_KIND_PUT: GoalKind
GOAL_KIND_OPEN: GoalKind
GOAL_KIND_CLOSE: GoalKind
GOAL_KIND_GIVE: GoalKind
GOAL_KIND_BRING: GoalKind

class FailureReason(int, metaclass=_EnumWrapper):
    """Why a task failed, for programs."""
    FAILURE_REASON_UNSPECIFIED: _ClassVar[FailureReason]
    """Not told: the first recordings have the words alone."""
    FAILURE_REASON_DROPPED: _ClassVar[FailureReason]
    """The target fell, from the gripper or from where it stood."""
    FAILURE_REASON_TIPPED: _ClassVar[FailureReason]
    """The target lies where it stood."""
    FAILURE_REASON_TIMEOUT: _ClassVar[FailureReason]
    """The time is over."""
    FAILURE_REASON_UNREACHABLE: _ClassVar[FailureReason]
    """The target rests where no arm gets it."""
    FAILURE_REASON_HARD_COLLISION: _ClassVar[FailureReason]
    """The robot hit furniture much too hard."""
    FAILURE_REASON_LOST: _ClassVar[FailureReason]
    """The simulation lost the target."""
    FAILURE_REASON_PHYSICS: _ClassVar[FailureReason]
    """The state of the simulation broke."""
    FAILURE_REASON_NONE: _ClassVar[FailureReason]
    """It has not failed."""
    FAILURE_REASON_PERSON_FORCE: _ClassVar[FailureReason]
    """The person in the chair was pressed harder than the task allows."""
    FAILURE_REASON_WRONG_OBJECT: _ClassVar[FailureReason]
    """An object that was not asked for was lifted."""
    FAILURE_REASON_KNOCKED_OVER: _ClassVar[FailureReason]
    """Another object fell or leaned further than the task allows."""
    FAILURE_REASON_TILTED: _ClassVar[FailureReason]
    """The target leaned further than the task allows."""

FAILURE_REASON_UNSPECIFIED: FailureReason
FAILURE_REASON_DROPPED: FailureReason
FAILURE_REASON_TIPPED: FailureReason
FAILURE_REASON_TIMEOUT: FailureReason
FAILURE_REASON_UNREACHABLE: FailureReason
FAILURE_REASON_HARD_COLLISION: FailureReason
FAILURE_REASON_LOST: FailureReason
FAILURE_REASON_PHYSICS: FailureReason
FAILURE_REASON_NONE: FailureReason
FAILURE_REASON_PERSON_FORCE: FailureReason
FAILURE_REASON_WRONG_OBJECT: FailureReason
FAILURE_REASON_KNOCKED_OVER: FailureReason
FAILURE_REASON_TILTED: FailureReason

class InstanceKind(int, metaclass=_EnumWrapper):
    """What an instance id stands for."""
    INSTANCE_KIND_UNSPECIFIED: _ClassVar[InstanceKind]
    """Not told."""
    INSTANCE_KIND_FURNITURE: _ClassVar[InstanceKind]
    """Furniture, a wall, the floor."""
    INSTANCE_KIND_OBJECT: _ClassVar[InstanceKind]
    """An object."""
    INSTANCE_KIND_ROBOT: _ClassVar[InstanceKind]
    """The robot or a part of it."""
    INSTANCE_KIND_PERSON: _ClassVar[InstanceKind]
    """A person or a part of one."""

INSTANCE_KIND_UNSPECIFIED: InstanceKind
INSTANCE_KIND_FURNITURE: InstanceKind
INSTANCE_KIND_OBJECT: InstanceKind
INSTANCE_KIND_ROBOT: InstanceKind
INSTANCE_KIND_PERSON: InstanceKind

class EndCause(int, metaclass=_EnumWrapper):
    """Why an episode ended."""
    END_CAUSE_UNSPECIFIED: _ClassVar[EndCause]
    """Not told: an older server."""
    END_CAUSE_ASKED: _ClassVar[EndCause]
    """A client asked for it."""
    END_CAUSE_PHYSICS: _ClassVar[EndCause]
    """The state of the simulation broke; the last of `anomalies` says how. The last sample is of
    the last good state, and the episode is no success.
    """
    END_CAUSE_RECORDERS: _ClassVar[EndCause]
    """It never began: its recorders were not ready."""
    END_CAUSE_SHUTDOWN: _ClassVar[EndCause]
    """The server was told to end."""

END_CAUSE_UNSPECIFIED: EndCause
END_CAUSE_ASKED: EndCause
END_CAUSE_PHYSICS: EndCause
END_CAUSE_RECORDERS: EndCause
END_CAUSE_SHUTDOWN: EndCause

class AnomalyKind(int, metaclass=_EnumWrapper):
    """What was odd in an episode: the first three go on, the others are faults that end it.
    """
    ANOMALY_KIND_UNSPECIFIED: _ClassVar[AnomalyKind]
    """Not told by an older server."""
    ANOMALY_KIND_ESCAPED: _ClassVar[AnomalyKind]
    """An object left the home."""
    ANOMALY_KIND_JOINT_FAST: _ClassVar[AnomalyKind]
    """A joint was faster than twice its limit."""
    ANOMALY_KIND_NOT_FINITE: _ClassVar[AnomalyKind]
    """The state of a body that nothing depends on is not finite."""
    ANOMALY_KIND_FAULT_NOT_FINITE: _ClassVar[AnomalyKind]
    """Fault: the state of a body is not finite."""
    ANOMALY_KIND_FAULT_JOINT_SPEED: _ClassVar[AnomalyKind]
    """Fault: a joint is faster than can be."""
    ANOMALY_KIND_FAULT_CONTACT_FORCE: _ClassVar[AnomalyKind]
    """Fault: two bodies press harder than can be."""
    ANOMALY_KIND_FAULT_NODE_SPEED: _ClassVar[AnomalyKind]
    """Fault: a node of a soft object is faster than can be."""
    ANOMALY_KIND_FAULT_ENERGY: _ClassVar[AnomalyKind]
    """Fault: a soft object has more energy than can be."""
    ANOMALY_KIND_FAULT_OUTSIDE: _ClassVar[AnomalyKind]
    """Fault: the chair is outside the home, or in the free air."""
    ANOMALY_KIND_FAULT_PANIC: _ClassVar[AnomalyKind]
    """Fault: the simulation panicked."""

ANOMALY_KIND_UNSPECIFIED: AnomalyKind
ANOMALY_KIND_ESCAPED: AnomalyKind
ANOMALY_KIND_JOINT_FAST: AnomalyKind
ANOMALY_KIND_NOT_FINITE: AnomalyKind
ANOMALY_KIND_FAULT_NOT_FINITE: AnomalyKind
ANOMALY_KIND_FAULT_JOINT_SPEED: AnomalyKind
ANOMALY_KIND_FAULT_CONTACT_FORCE: AnomalyKind
ANOMALY_KIND_FAULT_NODE_SPEED: AnomalyKind
ANOMALY_KIND_FAULT_ENERGY: AnomalyKind
ANOMALY_KIND_FAULT_OUTSIDE: AnomalyKind
ANOMALY_KIND_FAULT_PANIC: AnomalyKind

class RecorderState(int, metaclass=_EnumWrapper):
    """Progress of one recorder."""
    RECORDER_STATE_UNSPECIFIED: _ClassVar[RecorderState]
    """Not told."""
    RECORDER_STATE_IDLE: _ClassVar[RecorderState]
    """Connected, no episode."""
    RECORDER_STATE_READY: _ClassVar[RecorderState]
    """The log of the episode is open."""
    RECORDER_STATE_FINISHED: _ClassVar[RecorderState]
    """The file is finished."""
    RECORDER_STATE_FAILED: _ClassVar[RecorderState]
    """Recording failed; `message` says why."""
    RECORDER_STATE_FINISHING: _ClassVar[RecorderState]
    """The episode is over and its log is being made into the file; the recorder can take the next
    episode meanwhile.
    """

RECORDER_STATE_UNSPECIFIED: RecorderState
RECORDER_STATE_IDLE: RecorderState
RECORDER_STATE_READY: RecorderState
RECORDER_STATE_FINISHED: RecorderState
RECORDER_STATE_FAILED: RecorderState
RECORDER_STATE_FINISHING: RecorderState

class ArmProblem(int, metaclass=_EnumWrapper):
    """Why the arm does not follow, for programs."""
    ARM_PROBLEM_UNSPECIFIED: _ClassVar[ArmProblem]
    """Not told: the first recordings have the words alone."""
    ARM_PROBLEM_UNREACHABLE: _ClassVar[ArmProblem]
    """No joint positions reach the pose, or no straight line leads there."""
    ARM_PROBLEM_JOINT_LIMIT: _ClassVar[ArmProblem]
    """A joint was asked beyond its limit and goes to the limit."""
    ARM_PROBLEM_STALLED: _ClassVar[ArmProblem]
    """It does not come on along its line."""
    ARM_PROBLEM_HINDERED: _ClassVar[ArmProblem]
    """A limit or a singular posture keeps it from following a twist."""
    ARM_PROBLEM_NONE: _ClassVar[ArmProblem]
    """It follows."""

ARM_PROBLEM_UNSPECIFIED: ArmProblem
ARM_PROBLEM_UNREACHABLE: ArmProblem
ARM_PROBLEM_JOINT_LIMIT: ArmProblem
ARM_PROBLEM_STALLED: ArmProblem
ARM_PROBLEM_HINDERED: ArmProblem
ARM_PROBLEM_NONE: ArmProblem

class ControlChange(int, metaclass=_EnumWrapper):
    """What became of control."""
    CONTROL_CHANGE_UNSPECIFIED: _ClassVar[ControlChange]
    """Not told."""
    CONTROL_CHANGE_GIVEN: _ClassVar[ControlChange]
    """The commander has it now, and nobody had it before."""
    CONTROL_CHANGE_TAKEN: _ClassVar[ControlChange]
    """The commander has taken it from another one."""
    CONTROL_CHANGE_RETURNED: _ClassVar[ControlChange]
    """The commander gave it back."""
    CONTROL_CHANGE_LOST: _ClassVar[ControlChange]
    """The commander is gone."""

CONTROL_CHANGE_UNSPECIFIED: ControlChange
CONTROL_CHANGE_GIVEN: ControlChange
CONTROL_CHANGE_TAKEN: ControlChange
CONTROL_CHANGE_RETURNED: ControlChange
CONTROL_CHANGE_LOST: ControlChange

class EventKind(int, metaclass=_EnumWrapper):
    """What kind of thing happened."""
    EVENT_KIND_UNSPECIFIED: _ClassVar[EventKind]
    """Not told."""
    EVENT_KIND_REFUSED: _ClassVar[EventKind]
    """Commands were refused."""
    EVENT_KIND_COLLISION: _ClassVar[EventKind]
    """The robot hit furniture hard."""
    EVENT_KIND_ANOMALY: _ClassVar[EventKind]
    """The physics did something odd, or broke."""
    EVENT_KIND_PAUSED: _ClassVar[EventKind]
    """Time is paused."""
    EVENT_KIND_RESUMED: _ClassVar[EventKind]
    """Time goes on."""
    EVENT_KIND_CONTROL: _ClassVar[EventKind]
    """Control was given, given back, taken over or lost."""
    EVENT_KIND_NOTE: _ClassVar[EventKind]
    """Something else that people may want to know."""
    EVENT_KIND_PERSON_CONTACT: _ClassVar[EventKind]
    """The robot, or what it holds, touched the person in the chair."""

EVENT_KIND_UNSPECIFIED: EventKind
EVENT_KIND_REFUSED: EventKind
EVENT_KIND_COLLISION: EventKind
EVENT_KIND_ANOMALY: EventKind
EVENT_KIND_PAUSED: EventKind
EVENT_KIND_RESUMED: EventKind
EVENT_KIND_CONTROL: EventKind
EVENT_KIND_NOTE: EventKind
EVENT_KIND_PERSON_CONTACT: EventKind

class Access(int, metaclass=_EnumWrapper):
    """From where a server is reached, and who may do what there."""
    ACCESS_UNSPECIFIED: _ClassVar[Access]
    """Not told."""
    ACCESS_LOCAL: _ClassVar[Access]
    """From this host alone, where everybody may do everything."""
    ACCESS_KEYS: _ClassVar[Access]
    """With the keys of a user, who may do what the user's role says."""
    ACCESS_INSECURE: _ClassVar[Access]
    """From other hosts without keys: everybody may do everything."""

ACCESS_UNSPECIFIED: Access
ACCESS_LOCAL: Access
ACCESS_KEYS: Access
ACCESS_INSECURE: Access

class WaitingFor(int, metaclass=_EnumWrapper):
    """What the simulation waits for, for programs."""
    WAITING_FOR_UNSPECIFIED: _ClassVar[WaitingFor]
    """Not told."""
    WAITING_FOR_RESET: _ClassVar[WaitingFor]
    """A `reset`, because the state is broken."""
    WAITING_FOR_FAILED_CAMERAS: _ClassVar[WaitingFor]
    """The cameras, which failed."""
    WAITING_FOR_CAMERAS: _ClassVar[WaitingFor]
    """The cameras, which draw the last pictures before an act."""
    WAITING_FOR_EPISODE: _ClassVar[WaitingFor]
    """An episode: lock-step time is paused between episodes."""
    WAITING_FOR_RECORDERS: _ClassVar[WaitingFor]
    """Recorders that are to be ready before the episode begins."""
    WAITING_FOR_CREDIT: _ClassVar[WaitingFor]
    """A recorder's credit."""
    WAITING_FOR_COMMANDER: _ClassVar[WaitingFor]
    """The commander's answer."""
    WAITING_FOR_CONTROL: _ClassVar[WaitingFor]
    """Somebody who takes control."""
    WAITING_FOR_NOTHING: _ClassVar[WaitingFor]
    """Nothing: time goes on."""

WAITING_FOR_UNSPECIFIED: WaitingFor
WAITING_FOR_RESET: WaitingFor
WAITING_FOR_FAILED_CAMERAS: WaitingFor
WAITING_FOR_CAMERAS: WaitingFor
WAITING_FOR_EPISODE: WaitingFor
WAITING_FOR_RECORDERS: WaitingFor
WAITING_FOR_CREDIT: WaitingFor
WAITING_FOR_COMMANDER: WaitingFor
WAITING_FOR_CONTROL: WaitingFor
WAITING_FOR_NOTHING: WaitingFor

class PolicyAction(int, metaclass=_EnumWrapper):
    """What the numbers of an action row are."""
    POLICY_ACTION_UNSPECIFIED: _ClassVar[PolicyAction]
    """As POLICY_ACTION_NEXT_POSE."""
    POLICY_ACTION_NEXT_POSE: _ClassVar[PolicyAction]
    """In force at the next picture: pose of the hand in `base_link` (3 m, and 6 of its rotation),
    knuckle (rad); forward speed (m/s) and turn rate (rad/s) until then.
    """
    POLICY_ACTION_NEXT_JOINTS: _ClassVar[PolicyAction]
    """The same with the six joints of the arm (rad) in place of the hand's pose."""

POLICY_ACTION_UNSPECIFIED: PolicyAction
POLICY_ACTION_NEXT_POSE: PolicyAction
POLICY_ACTION_NEXT_JOINTS: PolicyAction

class Header(_Message):
    """Stands first in every message that is published and in every answer."""
    run_id: str
    """Identifies one run of one server process (no unit)."""
    episode: int
    """Episode the message belongs to; 0 outside an episode (no unit)."""
    sequence: int
    """Counts up by one per message of one stream and run, from 0 (no unit)."""
    stamp_nanos: int
    """Simulation time in nanoseconds: tick * 10^9 / 240, rounded."""
    tick: int
    """Physics tick, 240 per second of simulation time (ticks)."""
    def __init__(
        self,
        *,
        run_id: str | None = ...,
        episode: int | None = ...,
        sequence: int | None = ...,
        stamp_nanos: int | None = ...,
        tick: int | None = ...,
    ) -> None: ...

class Vector3(_Message):
    """A vector; unit and frame are given by the field that holds it."""
    x: float
    """Component along x (unit of the field that holds the vector)."""
    y: float
    """Component along y (unit of the field that holds the vector)."""
    z: float
    """Component along z (unit of the field that holds the vector)."""
    def __init__(
        self,
        *,
        x: float | None = ...,
        y: float | None = ...,
        z: float | None = ...,
    ) -> None: ...

class Quaternion(_Message):
    """A unit quaternion (no unit)."""
    x: float
    """Imaginary part along x (no unit)."""
    y: float
    """Imaginary part along y (no unit)."""
    z: float
    """Imaginary part along z (no unit)."""
    w: float
    """Real part (no unit)."""
    def __init__(
        self,
        *,
        x: float | None = ...,
        y: float | None = ...,
        z: float | None = ...,
        w: float | None = ...,
    ) -> None: ...

class Pose(_Message):
    """Pose of a frame in another one, named by the field that holds it."""
    position: Vector3
    """Origin of the frame, metres."""
    orientation: Quaternion
    """Orientation of the frame (no unit)."""
    def __init__(
        self,
        *,
        position: Vector3 | _Mapping[str, _Any] | None = ...,
        orientation: Quaternion | _Mapping[str, _Any] | None = ...,
    ) -> None: ...

class Twist(_Message):
    """Velocity of a frame; the field that holds it says in which frame."""
    linear: Vector3
    """Velocity of the origin, m/s."""
    angular: Vector3
    """Angular velocity, rad/s."""
    def __init__(
        self,
        *,
        linear: Vector3 | _Mapping[str, _Any] | None = ...,
        angular: Vector3 | _Mapping[str, _Any] | None = ...,
    ) -> None: ...

class BoxGeometry(_Message):
    """A box that encloses a body or a part of it."""
    pose: Pose
    """Pose of the centre in `house`, metres."""
    half: Vector3
    """Half extents, metres."""
    def __init__(
        self,
        *,
        pose: Pose | _Mapping[str, _Any] | None = ...,
        half: Vector3 | _Mapping[str, _Any] | None = ...,
    ) -> None: ...

class Failure(_Message):
    """Why a request was not carried out."""
    header: Header
    """Stamp of the answer."""
    message: str
    """What is wrong and the cure, for people (no unit)."""
    code: FailureCode
    """What is wrong, for programs (no unit)."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        message: str | None = ...,
        code: FailureCode | str | int | None = ...,
    ) -> None: ...

class Ack(_Message):
    """Answers `pause`, `resume` and other queries that only acknowledge."""
    header: Header
    """Stamp of the answer."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
    ) -> None: ...

class Intrinsics(_Message):
    """Pinhole intrinsics without distortion. The middle of the first pixel is at (0.5, 0.5);
    OpenCV and ROS count from its middle: subtract 0.5 from cx and cy.
    """
    width: int
    """Picture width, pixels."""
    height: int
    """Picture height, pixels."""
    fx: float
    """Focal length along x, pixels."""
    fy: float
    """Focal length along y, pixels."""
    cx: float
    """Principal point along x from the left edge, pixels."""
    cy: float
    """Principal point along y from the top edge, pixels."""
    def __init__(
        self,
        *,
        width: int | None = ...,
        height: int | None = ...,
        fx: float | None = ...,
        fy: float | None = ...,
        cx: float | None = ...,
        cy: float | None = ...,
    ) -> None: ...

class CameraFrame(_Message):
    """One picture of one camera: colour, depth and instance ids, registered."""
    header: Header
    """Stamp of the exposure."""
    camera: str
    """Camera name (no unit)."""
    intrinsics: Intrinsics
    """Intrinsics of this picture, pixels."""
    pose: Pose
    """Pose of the optical frame in `house`, metres."""
    rgb: bytes
    """Colour in `rgb_format`, row-major from the top left (0 to 255)."""
    depth: bytes
    """Depth in `depth_format`, row-major from the top left, metres or millimetres along the
    optical axis.
    """
    ids: bytes
    """Instance ids in `ids_format`, row-major from the top left; legend in the scene query (no
    unit).
    """
    rgb_format: PixelFormat
    """Format of `rgb` (no unit)."""
    depth_format: PixelFormat
    """Format of `depth` (no unit)."""
    ids_format: PixelFormat
    """Format of `ids` (no unit)."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        camera: str | None = ...,
        intrinsics: Intrinsics | _Mapping[str, _Any] | None = ...,
        pose: Pose | _Mapping[str, _Any] | None = ...,
        rgb: bytes | None = ...,
        depth: bytes | None = ...,
        ids: bytes | None = ...,
        rgb_format: PixelFormat | str | int | None = ...,
        depth_format: PixelFormat | str | int | None = ...,
        ids_format: PixelFormat | str | int | None = ...,
    ) -> None: ...

class CompressedCameraFrame(_Message):
    """A CameraFrame of the same camera and sequence number whose planes are compressed, once for
    all who record: what a recorder writes as it comes. A plane is one zlib stream (RFC 1950). A
    picture that nobody waited for in this form has its stamp alone: all its planes are empty.
    """
    header: Header
    """Stamp of the exposure."""
    camera: str
    """Camera name (no unit)."""
    intrinsics: Intrinsics
    """Intrinsics of this picture, pixels."""
    pose: Pose
    """Pose of the optical frame in `house`, metres."""
    rgb: bytes
    """Colour in `rgb_format`, deflated (bytes)."""
    depth: bytes
    """Depth in `depth_format`, metres, or millimetres as all who record keep it: the bytes of its
    elements shuffled as HDF5's filter does, then deflated (bytes); empty where nobody keeps
    depth.
    """
    ids: bytes
    """Instance ids in `ids_format`, the bytes of their 16-bit elements shuffled, then deflated
    (bytes).
    """
    rgb_format: PixelFormat
    """Format of `rgb` (no unit)."""
    depth_format: PixelFormat
    """Format of `depth` (no unit)."""
    ids_format: PixelFormat
    """Format of `ids` (no unit)."""
    digest: bytes
    """BLAKE3 hash of the encoded CameraFrame, of which the manifest's digest of `camera/NAME` is
    made (32 bytes).
    """
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        camera: str | None = ...,
        intrinsics: Intrinsics | _Mapping[str, _Any] | None = ...,
        pose: Pose | _Mapping[str, _Any] | None = ...,
        rgb: bytes | None = ...,
        depth: bytes | None = ...,
        ids: bytes | None = ...,
        rgb_format: PixelFormat | str | int | None = ...,
        depth_format: PixelFormat | str | int | None = ...,
        ids_format: PixelFormat | str | int | None = ...,
        digest: bytes | None = ...,
    ) -> None: ...

class SensorFrame(_Message):
    """One picture as a real camera would give it, made from the exact picture of a camera by a
    sensor model: through a lens of its own, with noise, late. Colour or depth.
    """
    header: Header
    """Stamp of the arrival: from then on the robot knows the picture."""
    sensor: str
    """Name of the sensor: the camera's name, `_`, and `color` or `depth` (no unit)."""
    intrinsics: Intrinsics
    """Intrinsics of this picture, pixels."""
    pose: Pose
    """Pose of the optical frame in `house` at the exposure, metres."""
    rgb: bytes
    """Colour in `rgb_format`, row-major from the top left (0 to 255); empty of a depth sensor.
    """
    depth: bytes
    """Depth in `depth_format`, row-major from the top left, millimetres along the optical axis; 0
    where there is no return; empty of a colour sensor.
    """
    rgb_format: PixelFormat
    """Format of `rgb` (no unit)."""
    depth_format: PixelFormat
    """Format of `depth` (no unit)."""
    camera: str
    """Camera whose exact picture it was made from (no unit)."""
    exposure_nanos: int
    """Stamp of the exposure: of the exact picture, nanoseconds of simulation time."""
    exposure_tick: int
    """Tick of the exposure (ticks)."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        sensor: str | None = ...,
        intrinsics: Intrinsics | _Mapping[str, _Any] | None = ...,
        pose: Pose | _Mapping[str, _Any] | None = ...,
        rgb: bytes | None = ...,
        depth: bytes | None = ...,
        rgb_format: PixelFormat | str | int | None = ...,
        depth_format: PixelFormat | str | int | None = ...,
        camera: str | None = ...,
        exposure_nanos: int | None = ...,
        exposure_tick: int | None = ...,
    ) -> None: ...

class PreviewFrame(_Message):
    """A compressed picture for people who watch from afar; never recorded."""
    header: Header
    """Stamp of the exposure; sequence numbers count per camera and level."""
    camera: str
    """Camera name (no unit)."""
    level: PreviewLevel
    """Its level (no unit)."""
    width: int
    """Picture width, pixels."""
    height: int
    """Picture height, pixels."""
    jpeg: bytes
    """JPEG file (bytes)."""
    sent_unix_nanos: int
    """Wall clock of the server when the picture was sent, nanoseconds since 1970 (Unix time):
    differences tell the growth of the delay.
    """
    i420: bytes
    """Raw picture in the place of a JPEG file: I420, BT.601 with values 16 to 235, rows from the
    top, width and height even (bytes).
    """
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        camera: str | None = ...,
        level: PreviewLevel | str | int | None = ...,
        width: int | None = ...,
        height: int | None = ...,
        jpeg: bytes | None = ...,
        sent_unix_nanos: int | None = ...,
        i420: bytes | None = ...,
    ) -> None: ...

class JointTarget(_Message):
    """Six joint targets."""
    positions: _Scalars[float]
    """The arm's joints from base to hand, radians."""
    def __init__(
        self,
        *,
        positions: _Iterable[float] | None = ...,
    ) -> None: ...

class CartesianTarget(_Message):
    """A pose for the end effector."""
    frame: CommandFrame
    """Frame of `pose` (no unit)."""
    pose: Pose
    """Wanted pose of the end effector in `frame`, metres."""
    def __init__(
        self,
        *,
        frame: CommandFrame | str | int | None = ...,
        pose: Pose | _Mapping[str, _Any] | None = ...,
    ) -> None: ...

class CartesianTwist(_Message):
    """A velocity for the end effector; held until it goes stale."""
    frame: CommandFrame
    """Frame in which `twist` is expressed (no unit)."""
    twist: Twist
    """Wanted velocity of the end effector, m/s and rad/s in `frame`."""
    def __init__(
        self,
        *,
        frame: CommandFrame | str | int | None = ...,
        twist: Twist | _Mapping[str, _Any] | None = ...,
    ) -> None: ...

class CartesianStep(_Message):
    """A step of the end effector from its present target."""
    frame: CommandFrame
    """Frame in which the translation is expressed (no unit)."""
    translation: Vector3
    """Translation, metres in `frame`."""
    rotation: Vector3
    """Rotation vector about the tool's own axes, radians."""
    def __init__(
        self,
        *,
        frame: CommandFrame | str | int | None = ...,
        translation: Vector3 | _Mapping[str, _Any] | None = ...,
        rotation: Vector3 | _Mapping[str, _Any] | None = ...,
    ) -> None: ...

class ArmCommand(_Message):
    """A command for the arm."""
    joints: JointTarget
    """Joint targets, radians."""
    pose: CartesianTarget
    """End effector pose, metres."""
    twist: CartesianTwist
    """End effector velocity, m/s and rad/s."""
    step: CartesianStep
    """End effector step, metres and radians."""
    hold: bool
    """Stops where it is; the value is ignored (no unit)."""
    def __init__(
        self,
        *,
        joints: JointTarget | _Mapping[str, _Any] | None = ...,
        pose: CartesianTarget | _Mapping[str, _Any] | None = ...,
        twist: CartesianTwist | _Mapping[str, _Any] | None = ...,
        step: CartesianStep | _Mapping[str, _Any] | None = ...,
        hold: bool | None = ...,
    ) -> None: ...

class BaseCommand(_Message):
    """A command for the chair, in `wheelchair_root`."""
    linear: float
    """Forward speed, m/s."""
    angular: float
    """Turn rate, rad/s, positive to the left."""
    def __init__(
        self,
        *,
        linear: float | None = ...,
        angular: float | None = ...,
    ) -> None: ...

class GripperCommand(_Message):
    """A command for the gripper."""
    opening: float
    """Distance between the pads, metres, 0 to the robot's stroke."""
    knuckle: float
    """Angle of the knuckle (JOINT_ROLE_KNUCKLE), radians, 0 to the robot's `max_knuckle`."""
    max_force: float
    """Force cap at each pad, N; absent takes the robot's usual force, 0 is none. Optional.
    """
    def __init__(
        self,
        *,
        opening: float | None = ...,
        knuckle: float | None = ...,
        max_force: float | None = ...,
    ) -> None: ...

class Command(_Message):
    """One message of a commander. Absent groups stay as they are."""
    header: Header
    """Sequence numbers count per commander; episode must be the running one."""
    commander: str
    """Name of the commander, as in the key (no unit)."""
    answers_tick: int
    """Tick of the state this command answers: that of the newest `clock`. In lock-step every
    command carries it, in real time every one that drives the chair or gives the arm a twist;
    what answers a state more than 1 s old is refused. Absent: it answers none (ticks).
    Optional.
    """
    arm: ArmCommand
    """Arm, if it is commanded."""
    base: BaseCommand
    """Chair, if it is commanded."""
    gripper: GripperCommand
    """Gripper, if it is commanded."""
    phase: Phase
    """Phase of the work, published and recorded (no unit)."""
    phase_name: str
    """Finer name of the phase, for example `lifting` (no unit)."""
    over_ticks: int
    """Lock-step: this command answers for so many control ticks, 0 and 1 for one. Arm pose, arm
    joints, gripper and the chair's velocities go straight from what is in force to what is
    asked, which they reach with the last tick of them. A pose is in `base_link`,
    `wheelchair_root` or `house`. At most 60 (count).
    """
    device: Device
    """What it is commanded with; recorded (no unit)."""
    mode: InputMode
    """How the input becomes motion; recorded (no unit)."""
    assistance: Assistance
    """What helps; recorded (no unit)."""
    incident: Incident
    """What went wrong or right again at this tick; recorded (no unit)."""
    seal: bytes
    """Seal of a lease that was asked for with `sealed`: HMAC-SHA256 with the lease's secret (its
    text) as key, over all bytes of the encoded command that stand before this field, which is
    the last (bytes).
    """
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        commander: str | None = ...,
        answers_tick: int | None = ...,
        arm: ArmCommand | _Mapping[str, _Any] | None = ...,
        base: BaseCommand | _Mapping[str, _Any] | None = ...,
        gripper: GripperCommand | _Mapping[str, _Any] | None = ...,
        phase: Phase | str | int | None = ...,
        phase_name: str | None = ...,
        over_ticks: int | None = ...,
        device: Device | str | int | None = ...,
        mode: InputMode | str | int | None = ...,
        assistance: Assistance | str | int | None = ...,
        incident: Incident | str | int | None = ...,
        seal: bytes | None = ...,
    ) -> None: ...

class Refusal(_Message):
    """Why a command was not taken."""
    header: Header
    """Stamp of the moment of refusal."""
    commander: str
    """Name of the commander (no unit)."""
    sequence: int
    """Sequence number of the refused command (no unit)."""
    reason: str
    """What is wrong and what would be right, for people (no unit)."""
    count: int
    """Commands that this refusal speaks of: 1, or more when it sums up those that came too fast to
    be answered one by one; then `sequence` and `reason` are those of the last (count).
    """
    code: RefusalCode
    """What is wrong, for programs; of a sum that of the last (no unit)."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        commander: str | None = ...,
        sequence: int | None = ...,
        reason: str | None = ...,
        count: int | None = ...,
        code: RefusalCode | str | int | None = ...,
    ) -> None: ...

class JointMimic(_Message):
    """A joint that follows another one."""
    joint: str
    """The joint that it follows (no unit)."""
    multiplier: float
    """Position per position of the other one (no unit)."""
    offset: float
    """Position where the other one is at 0, radians."""
    def __init__(
        self,
        *,
        joint: str | None = ...,
        multiplier: float | None = ...,
        offset: float | None = ...,
    ) -> None: ...

class RobotJoint(_Message):
    """One recorded joint."""
    name: str
    """Name, as in the URDF and in files (no unit)."""
    role: JointRole
    """What it is for (no unit)."""
    arm_index: int
    """JOINT_ROLE_ARM: its place in joint targets, 0 nearest to the base (no unit)."""
    type: JointType
    """How it moves (no unit)."""
    lower: float
    """Least position, radians or metres; absent without limit. Optional."""
    upper: float
    """Greatest position, radians or metres; absent without limit. Optional."""
    max_velocity: float
    """Greatest speed, rad/s or m/s."""
    max_effort: float
    """Greatest torque or force, N·m or N."""
    axis: Vector3
    """Axis of growing positions in the frame of the child link (no unit)."""
    parent_link: str
    """Link that it hangs on (no unit)."""
    child_link: str
    """Link that it moves (no unit)."""
    mimic: JointMimic
    """Which joint it follows; absent where it moves by itself."""
    origin: Pose
    """Pose of the child link in the parent link at position 0, metres."""
    def __init__(
        self,
        *,
        name: str | None = ...,
        role: JointRole | str | int | None = ...,
        arm_index: int | None = ...,
        type: JointType | str | int | None = ...,
        lower: float | None = ...,
        upper: float | None = ...,
        max_velocity: float | None = ...,
        max_effort: float | None = ...,
        axis: Vector3 | _Mapping[str, _Any] | None = ...,
        parent_link: str | None = ...,
        child_link: str | None = ...,
        mimic: JointMimic | _Mapping[str, _Any] | None = ...,
        origin: Pose | _Mapping[str, _Any] | None = ...,
    ) -> None: ...

class RobotFrame(_Message):
    """One recorded frame."""
    name: str
    """Short name, as in files, for example `end_effector` (no unit)."""
    parent: str
    """Frame in which its pose is told: `house` or a link (no unit)."""
    link: str
    """Link whose pose it is (no unit)."""
    role: FrameRole
    """What it is (no unit)."""
    def __init__(
        self,
        *,
        name: str | None = ...,
        parent: str | None = ...,
        link: str | None = ...,
        role: FrameRole | str | int | None = ...,
    ) -> None: ...

class Footprint(_Message):
    """A rectangle on the floor, along the axes of the frame that its field names."""
    x_min: float
    """Least x, metres."""
    x_max: float
    """Greatest x, metres."""
    y_min: float
    """Least y, metres."""
    y_max: float
    """Greatest y, metres."""
    def __init__(
        self,
        *,
        x_min: float | None = ...,
        x_max: float | None = ...,
        y_min: float | None = ...,
        y_max: float | None = ...,
    ) -> None: ...

class Outline(_Message):
    """The robot seen from above between two heights."""
    top: float
    """It holds up to this height above the floor, metres; the next one begins there."""
    footprint: Footprint
    """What the robot takes up, in the chair's frame, metres."""
    def __init__(
        self,
        *,
        top: float | None = ...,
        footprint: Footprint | _Mapping[str, _Any] | None = ...,
    ) -> None: ...

class ReachShell(_Message):
    """Where the arm reaches, for first guesses; the query `reach` knows."""
    centre: Vector3
    """Middle of the shell in the frame of the arm's base, metres."""
    inner_radius: float
    """Least distance of the end effector from the middle, metres."""
    outer_radius: float
    """Greatest distance, metres."""
    nearest: float
    """Least distance on the floor plan from the arm's base to what is taken, metres."""
    furthest: float
    """Greatest distance on the floor plan, metres."""
    def __init__(
        self,
        *,
        centre: Vector3 | _Mapping[str, _Any] | None = ...,
        inner_radius: float | None = ...,
        outer_radius: float | None = ...,
        nearest: float | None = ...,
        furthest: float | None = ...,
    ) -> None: ...

class Ball(_Message):
    """A ball that encloses a part of the robot."""
    centre: Vector3
    """Its middle in the frame that its field names, metres."""
    radius: float
    """Its radius, metres."""
    def __init__(
        self,
        *,
        centre: Vector3 | _Mapping[str, _Any] | None = ...,
        radius: float | None = ...,
    ) -> None: ...

class GripperLinkage(_Message):
    """The parallelogram of a finger, in the frame of the end effector: `x` points to the left
    finger, `z` along the hand. The right finger is its mirror image. With c and s cosine and
    sine of the knuckle angle, the pads are 2 (pin_x + crank_x c - crank_z s - pad_x) apart, and
    their middle is at pin_z + crank_x s + crank_z c + pad_z along the hand.
    """
    pin_x: float
    """Knuckle's axis along x, metres."""
    pin_z: float
    """Knuckle's axis along z, metres."""
    crank_x: float
    """From the knuckle's axis to that of the finger tip at angle 0, along x, metres."""
    crank_z: float
    """The same along z, metres."""
    pad_x: float
    """From the finger tip's axis inwards to the face of the pad, metres."""
    pad_z: float
    """From the finger tip's axis to the middle of the pad along z, metres."""
    pad_half: float
    """Half of the pad's length along z, metres."""
    def __init__(
        self,
        *,
        pin_x: float | None = ...,
        pin_z: float | None = ...,
        crank_x: float | None = ...,
        crank_z: float | None = ...,
        pad_x: float | None = ...,
        pad_z: float | None = ...,
        pad_half: float | None = ...,
    ) -> None: ...

class GripperDescription(_Message):
    """The gripper."""
    stroke: float
    """Distance between the pads that may be asked at most, metres."""
    closed: float
    """Knuckle angle at which the pads meet: it goes no further, radians."""
    max_knuckle: float
    """Greatest knuckle angle that may be asked, radians."""
    max_velocity: float
    """Greatest speed of the knuckle, rad/s."""
    usual_force: float
    """Force cap at each pad where a command names none, N."""
    max_force: float
    """Greatest force cap at each pad, N."""
    linkage: GripperLinkage
    """Its fingers, metres."""
    hand_balls: _Messages[Ball]
    """Balls around hand and wrist in the frame of the end effector, for planning, metres."""
    crank_balls: _Messages[Ball]
    """Balls around the left crank: from the knuckle's axis, at angle 0 along the axes of the end
    effector; they turn with the knuckle, metres.
    """
    tip_balls: _Messages[Ball]
    """Balls around the left finger tip: from its axis, along the axes of the end effector, metres.
    """
    def __init__(
        self,
        *,
        stroke: float | None = ...,
        closed: float | None = ...,
        max_knuckle: float | None = ...,
        max_velocity: float | None = ...,
        usual_force: float | None = ...,
        max_force: float | None = ...,
        linkage: GripperLinkage | _Mapping[str, _Any] | None = ...,
        hand_balls: _Iterable[Ball | _Mapping[str, _Any]] | None = ...,
        crank_balls: _Iterable[Ball | _Mapping[str, _Any]] | None = ...,
        tip_balls: _Iterable[Ball | _Mapping[str, _Any]] | None = ...,
    ) -> None: ...

class DriveDescription(_Message):
    """How the chair drives. Speeds of commands are cut to these."""
    track: float
    """Distance between the driven wheels, metres."""
    wheel_radius: float
    """Radius of the driven wheels, metres."""
    forward_speed: float
    """Greatest forward speed, m/s."""
    backward_speed: float
    """Greatest backward speed, m/s, positive."""
    turn_rate: float
    """Greatest turn rate, rad/s."""
    forward_acceleration: float
    """Forward acceleration and deceleration, m/s²."""
    forward_deceleration: float
    """Forward deceleration, m/s²."""
    backward_acceleration: float
    """Backward acceleration, m/s²."""
    backward_deceleration: float
    """Backward deceleration, m/s²."""
    turn_acceleration: float
    """Turn acceleration, rad/s²."""
    turn_deceleration: float
    """Turn deceleration, rad/s²."""
    def __init__(
        self,
        *,
        track: float | None = ...,
        wheel_radius: float | None = ...,
        forward_speed: float | None = ...,
        backward_speed: float | None = ...,
        turn_rate: float | None = ...,
        forward_acceleration: float | None = ...,
        forward_deceleration: float | None = ...,
        backward_acceleration: float | None = ...,
        backward_deceleration: float | None = ...,
        turn_acceleration: float | None = ...,
        turn_deceleration: float | None = ...,
    ) -> None: ...

class ArmDescription(_Message):
    """How fast the arm may move; its joints have limits of their own."""
    joint_acceleration: float
    """Greatest joint acceleration, rad/s²."""
    tool_speed: float
    """Greatest speed of the grasp point, m/s."""
    tool_turn_rate: float
    """Greatest turn rate of the end effector, rad/s."""
    tool_acceleration: float
    """Greatest acceleration along lines and twists, m/s²."""
    tool_turn_acceleration: float
    """Greatest turn acceleration along lines and twists, rad/s²."""
    def __init__(
        self,
        *,
        joint_acceleration: float | None = ...,
        tool_speed: float | None = ...,
        tool_turn_rate: float | None = ...,
        tool_acceleration: float | None = ...,
        tool_turn_acceleration: float | None = ...,
    ) -> None: ...

class RobotCamera(_Message):
    """A camera on the robot."""
    name: str
    """Name (no unit)."""
    link: str
    """Link that carries it (no unit)."""
    pose: Pose
    """Pose of the optical frame in that link, metres."""
    intrinsics: Intrinsics
    """Size and intrinsics as delivered, pixels; they scale with the pictures."""
    near: float
    """Nearest distance that it sees, metres."""
    far: float
    """Furthest distance that it sees, metres."""
    mount: CameraMount
    """What it rides on (no unit)."""
    def __init__(
        self,
        *,
        name: str | None = ...,
        link: str | None = ...,
        pose: Pose | _Mapping[str, _Any] | None = ...,
        intrinsics: Intrinsics | _Mapping[str, _Any] | None = ...,
        near: float | None = ...,
        far: float | None = ...,
        mount: CameraMount | str | int | None = ...,
    ) -> None: ...

class RobotDescription(_Message):
    """All that a client has to know of a robot. The server makes it from the robot's folder; it
    stands in the answer to `scene` and in every recording.
    """
    name: str
    """Its name: that of its folder in assets/robots (no unit)."""
    urdf: str
    """Path of its URDF below assets (no unit)."""
    joints: _Messages[RobotJoint]
    """Recorded joints, in the order of JointState."""
    frames: _Messages[RobotFrame]
    """Recorded frames, in the order of PoseSet."""
    root_link: str
    """Link of the chair, on the floor under the middle of the driven axle (no unit)."""
    arm_base_link: str
    """Link of the arm's base: COMMAND_FRAME_BASE_LINK (no unit)."""
    end_effector_link: str
    """Link of the end effector: COMMAND_FRAME_END_EFFECTOR (no unit)."""
    imu_link: str
    """Link of the inertial measurement unit (no unit)."""
    arm_mount: Pose
    """Pose of the arm's base in the chair, metres."""
    tool_length: float
    """From the end effector to the grasp point along its z axis, metres."""
    home_positions: _Scalars[float]
    """Positions of the arm's joints at home, radians."""
    footprint: Footprint
    """Footprint of chair and arm base in the chair's frame, metres."""
    outlines: _Messages[Outline]
    """The robot by height, bottom up, with its arm at home."""
    reach: ReachShell
    """Where the arm reaches."""
    arm: ArmDescription
    """How fast the arm moves."""
    gripper: GripperDescription
    """The gripper."""
    drive: DriveDescription
    """How the chair drives."""
    cameras: _Messages[RobotCamera]
    """Cameras on it."""
    urdf_text: str
    """Its URDF; paths of meshes are below the robot's folder (no unit)."""
    def __init__(
        self,
        *,
        name: str | None = ...,
        urdf: str | None = ...,
        joints: _Iterable[RobotJoint | _Mapping[str, _Any]] | None = ...,
        frames: _Iterable[RobotFrame | _Mapping[str, _Any]] | None = ...,
        root_link: str | None = ...,
        arm_base_link: str | None = ...,
        end_effector_link: str | None = ...,
        imu_link: str | None = ...,
        arm_mount: Pose | _Mapping[str, _Any] | None = ...,
        tool_length: float | None = ...,
        home_positions: _Iterable[float] | None = ...,
        footprint: Footprint | _Mapping[str, _Any] | None = ...,
        outlines: _Iterable[Outline | _Mapping[str, _Any]] | None = ...,
        reach: ReachShell | _Mapping[str, _Any] | None = ...,
        arm: ArmDescription | _Mapping[str, _Any] | None = ...,
        gripper: GripperDescription | _Mapping[str, _Any] | None = ...,
        drive: DriveDescription | _Mapping[str, _Any] | None = ...,
        cameras: _Iterable[RobotCamera | _Mapping[str, _Any]] | None = ...,
        urdf_text: str | None = ...,
    ) -> None: ...

class JointState(_Message):
    """The recorded joints, in the order of RobotDescription.joints."""
    header: Header
    """Stamp of the sample."""
    positions: _Scalars[float]
    """Positions, radians, unwrapped."""
    velocities: _Scalars[float]
    """Velocities at the stamp, rad/s. Their integral is the way."""
    efforts: _Scalars[float]
    """Torques of the drives that move and hold the joints at the stamp, N·m; 0 where there is no
    drive.
    """
    opening: float
    """Distance between the gripper's pads by its linkage, metres; the first recordings lack it.
    Optional.
    """
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        positions: _Iterable[float] | None = ...,
        velocities: _Iterable[float] | None = ...,
        efforts: _Iterable[float] | None = ...,
        opening: float | None = ...,
    ) -> None: ...

class FramePose(_Message):
    """One frame of a PoseSet."""
    pose: Pose
    """Pose in the parent frame (RobotFrame.parent), metres."""
    twist: Twist
    """Velocity relative to the parent frame, expressed in it, m/s and rad/s."""
    def __init__(
        self,
        *,
        pose: Pose | _Mapping[str, _Any] | None = ...,
        twist: Twist | _Mapping[str, _Any] | None = ...,
    ) -> None: ...

class PoseSet(_Message):
    """The recorded frames, in the order of RobotDescription.frames."""
    header: Header
    """Stamp of the sample."""
    frames: _Messages[FramePose]
    """One entry per frame, metres."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        frames: _Iterable[FramePose | _Mapping[str, _Any]] | None = ...,
    ) -> None: ...

class Imu(_Message):
    """Inertial measurement unit of the chair, in `imu_link`."""
    header: Header
    """Stamp of the sample."""
    orientation: Quaternion
    """Orientation of `imu_link` in `house` (no unit)."""
    angular_velocity: Vector3
    """Angular velocity, rad/s, in `imu_link`."""
    linear_acceleration: Vector3
    """Specific force (at rest +9.81 along z), m/s², in `imu_link`."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        orientation: Quaternion | _Mapping[str, _Any] | None = ...,
        angular_velocity: Vector3 | _Mapping[str, _Any] | None = ...,
        linear_acceleration: Vector3 | _Mapping[str, _Any] | None = ...,
    ) -> None: ...

class Odometry(_Message):
    """Wheel odometry of the chair since the last reset."""
    header: Header
    """Stamp of the sample."""
    pose: Pose
    """Pose of `wheelchair_root` in the odometry frame (where it started), metres."""
    twist: Twist
    """Velocity in `wheelchair_root`, m/s and rad/s."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        pose: Pose | _Mapping[str, _Any] | None = ...,
        twist: Twist | _Mapping[str, _Any] | None = ...,
    ) -> None: ...

class SensedJoints(_Message):
    """The arm's joints and the gripper as a robot's encoders and torque sensors would tell them,
    made by a sensor model; nothing where none is on.
    """
    header: Header
    """Stamp of the sample."""
    positions: _Scalars[float]
    """Positions of the arm's joints, from base to hand, radians."""
    velocities: _Scalars[float]
    """Their velocities, rad/s."""
    efforts: _Scalars[float]
    """Their torques, N·m."""
    opening: float
    """Distance between the gripper's pads; all that a gripper tells, metres."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        positions: _Iterable[float] | None = ...,
        velocities: _Iterable[float] | None = ...,
        efforts: _Iterable[float] | None = ...,
        opening: float | None = ...,
    ) -> None: ...

class SensedOdometry(_Message):
    """Wheel odometry with the errors of real wheels, made by a sensor model; nothing where none is
    on.
    """
    header: Header
    """Stamp of the sample."""
    pose: Pose
    """Pose of `wheelchair_root` in the odometry frame: where it was when the episode began, or at
    the last reset, metres.
    """
    twist: Twist
    """Velocity in `wheelchair_root`, m/s and rad/s."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        pose: Pose | _Mapping[str, _Any] | None = ...,
        twist: Twist | _Mapping[str, _Any] | None = ...,
    ) -> None: ...

class SensedImu(_Message):
    """Inertial measurement unit with noise and a bias that walks, made by a sensor model; nothing
    where none is on.
    """
    header: Header
    """Stamp of the sample."""
    angular_velocity: Vector3
    """Angular velocity, rad/s, in `imu_link`."""
    linear_acceleration: Vector3
    """Specific force (at rest +9.81 along z), m/s², in `imu_link`."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        angular_velocity: Vector3 | _Mapping[str, _Any] | None = ...,
        linear_acceleration: Vector3 | _Mapping[str, _Any] | None = ...,
    ) -> None: ...

class ReachRequest(_Message):
    """Asks whether the end effector can reach a pose. Query `reach`."""
    pose: Pose
    """Wanted pose of the end effector in `base_link`, metres."""
    near_joints: _Scalars[float]
    """Joint positions near which alone a solution is looked for, in the order of the arm's joints,
    radians: whether a step of a movement can be followed. Empty: any solution will do, looked
    for from the present joint positions.
    """
    next_poses: _Messages[Pose]
    """Poses that follow `pose` one after another, at most 256, metres: each is looked for near the
    joint positions of the one before it alone.
    """
    max_joint_change: float
    """Greatest change of a joint from one of these poses to the next, radians: more is a jump.
    Absent: as far as the search near joint positions goes. Optional.
    """
    def __init__(
        self,
        *,
        pose: Pose | _Mapping[str, _Any] | None = ...,
        near_joints: _Iterable[float] | None = ...,
        next_poses: _Iterable[Pose | _Mapping[str, _Any]] | None = ...,
        max_joint_change: float | None = ...,
    ) -> None: ...

class ReachReply(_Message):
    """Answers `reach`."""
    header: Header
    """Stamp of the answer."""
    reachable: bool
    """A joint solution was found, and one for every pose that follows (no unit)."""
    joints: _Scalars[float]
    """The solution for the last pose, in the order of the arm's joints, radians; empty when
    unreachable.
    """
    reason: str
    """Why not, in words (no unit)."""
    problem: ReachProblem
    """Code of `reason` (no unit)."""
    reached_count: int
    """Poses that were reached, from the first on (count)."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        reachable: bool | None = ...,
        joints: _Iterable[float] | None = ...,
        reason: str | None = ...,
        problem: ReachProblem | str | int | None = ...,
        reached_count: int | None = ...,
    ) -> None: ...

class Disturbances(_Message):
    """Disturbances between the gate and the motors. They follow from the seed and the tick alone;
    `applied` keeps what was intended. Strengths are 0 (none) to 3.
    """
    seed: int
    """Seed of what is drawn; absent: the scenario's (no unit). Optional."""
    noise: int
    """Strength of the noise on what is applied to arm and wheels (no unit)."""
    pushes: int
    """Strength of short pushes on the chair, the hand or the target (no unit)."""
    slips: int
    """Strength of moments in which the gripper presses less (no unit)."""
    def __init__(
        self,
        *,
        seed: int | None = ...,
        noise: int | None = ...,
        pushes: int | None = ...,
        slips: int | None = ...,
    ) -> None: ...

class Disturbance(_Message):
    """What disturbs one control tick; published where the scenario has disturbances."""
    header: Header
    """Stamp of the control tick, that of `applied`."""
    joint_offsets: _Scalars[float]
    """What is added to the targets of the arm's joints at the end of the tick, from base to hand,
    rad.
    """
    wheel_factors: _Scalars[float]
    """By what the speeds of the left and the right wheel are multiplied (no unit)."""
    pushed: str
    """Body that is pushed: a link of the robot or an object; empty for none (no unit)."""
    push_force: Vector3
    """Force on it, in `house`, N."""
    grip_factor: float
    """By what the gripper's force is multiplied (no unit)."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        joint_offsets: _Iterable[float] | None = ...,
        wheel_factors: _Iterable[float] | None = ...,
        pushed: str | None = ...,
        push_force: Vector3 | _Mapping[str, _Any] | None = ...,
        grip_factor: float | None = ...,
    ) -> None: ...

class Language(_Message):
    """A sentence from the grammar in assets/language, about the scene as it was drawn. Left,
    right, in front and behind are those of who sits in the chair while it stands at the area
    and looks at it.
    """
    seed: int
    """Seed of the sentence; the scene does not depend on it (no unit)."""
    split: LanguageSplit
    """Which templates and names are said (no unit)."""
    typo_share: float
    """Share of sentences with a typing error, 0 to 1 (no unit)."""
    politeness_share: float
    """Share of sentences with politeness, 0 to 1; absent is 0.5 (no unit). Optional."""
    ambiguous_share: float
    """Share of sentences that may mean several things, 0 to 1 (no unit)."""
    template: str
    """Template of the sentence; the server fills it in (no unit)."""
    question: str
    """Question that must be asked back, where the sentence may mean several things; empty where it
    is clear; the server fills it in (no unit).
    """
    ambiguous: bool
    """Whether the sentence may mean several things; the server fills it in (no unit)."""
    def __init__(
        self,
        *,
        seed: int | None = ...,
        split: LanguageSplit | str | int | None = ...,
        typo_share: float | None = ...,
        politeness_share: float | None = ...,
        ambiguous_share: float | None = ...,
        template: str | None = ...,
        question: str | None = ...,
        ambiguous: bool | None = ...,
    ) -> None: ...

class Look(_Message):
    """What the cameras see of a run beside what moves. Physics does not know it: the same scenario
    with another look has the same state hashes. Every axis has a strength: 0 off, 1 slight, 2
    usual, 3 strong; each draws from the seed alone, whatever the others are.
    """
    seed: int
    """Seed of all draws of the look (no unit)."""
    light: int
    """Sun, sky, lamps and their colours: strength, 0 to 3 (no unit)."""
    background: int
    """Walls, floor, ceiling: strength, 0 to 3 (no unit)."""
    materials: int
    """Furniture, by families of materials: strength, 0 to 3 (no unit)."""
    exposure: int
    """Exposure and white balance of the cameras: strength, 0 to 3 (no unit)."""
    decoration: int
    """Pictures on the walls, rugs, plants, lamps that touch nothing: strength, 0 to 3. They have
    the id 0, depth sees them (no unit).
    """
    camera: int
    """Places of the robot's cameras, up to 1.5 cm and 8 degrees at strength 3, on top of the
    calibration: strength, 0 to 3. What is drawn stands in `cameras` (no unit).
    """
    lens: int
    """Focal length of the robot's cameras, up to 12 % at strength 3, on top of the calibration:
    strength, 0 to 3. What is drawn stands in `cameras` (no unit).
    """
    def __init__(
        self,
        *,
        seed: int | None = ...,
        light: int | None = ...,
        background: int | None = ...,
        materials: int | None = ...,
        exposure: int | None = ...,
        decoration: int | None = ...,
        camera: int | None = ...,
        lens: int | None = ...,
    ) -> None: ...

class Person(_Message):
    """Who is to sit in the chair. Names are those of assets/people; what is empty is drawn by the
    seed.
    """
    body: str
    """Body, for example `woman_p50`; `none`: nobody sits there (no unit)."""
    posture: str
    """Posture, for example `hands_in_lap` (no unit)."""
    skin: str
    """Colour of the skin, by name (no unit)."""
    hair: str
    """Colour of the hair, by name (no unit)."""
    clothes: str
    """Clothes, by name (no unit)."""
    seed: int
    """Seed of what is drawn and of the motion of head and mouth; absent: the scenario's (no unit).
    Optional.
    """
    motion: float
    """How much head and mouth move, 0 (still) to 1; absent: 1 (no unit). Optional."""
    mouth_open: bool
    """The mouth opens in the first second and stays open, as of who waits for a sip (no unit).
    """
    guard: bool
    """The guard is on: the server bounds speed and force of arm, gripper and chair beside the
    person (no unit). Replies always set it. A request needs it only with `drawn`: otherwise the
    guard is on unless `unguarded` is set.
    """
    drawn: PersonDrawn
    """Who was drawn; where it is told it is taken as it is."""
    unguarded: bool
    """The guard is off (no unit)."""
    def __init__(
        self,
        *,
        body: str | None = ...,
        posture: str | None = ...,
        skin: str | None = ...,
        hair: str | None = ...,
        clothes: str | None = ...,
        seed: int | None = ...,
        motion: float | None = ...,
        mouth_open: bool | None = ...,
        guard: bool | None = ...,
        drawn: PersonDrawn | _Mapping[str, _Any] | None = ...,
        unguarded: bool | None = ...,
    ) -> None: ...

class PersonDrawn(_Message):
    """Who was drawn. Names are those of assets/people."""
    body: str
    """Body (no unit)."""
    posture: str
    """Posture (no unit)."""
    skin: str
    """Colour of the skin (no unit)."""
    hair: str
    """Colour of the hair (no unit)."""
    clothes: str
    """Clothes (no unit)."""
    def __init__(
        self,
        *,
        body: str | None = ...,
        posture: str | None = ...,
        skin: str | None = ...,
        hair: str | None = ...,
        clothes: str | None = ...,
    ) -> None: ...

class PersonState(_Message):
    """The person in the chair; published where somebody sits there."""
    header: Header
    """Stamp of the sample."""
    head_angles: _Scalars[float]
    """How the head is turned beside the posture: to the left, down, to the right, rad."""
    jaw: float
    """How far the jaw is turned down, rad."""
    mouth: Pose
    """Pose of the mouth in `house`: origin between the lips, x out of the mouth, z up, metres.
    """
    forces: _Scalars[float]
    """What presses on each part of the body, in the order of `BodyPart` from the head on: the sum
    of the forces of all that touches it, of four physics ticks the greatest, N. What touches
    the mouth also counts for the face.
    """
    robot_force: float
    """What the robot itself presses on all of the body, likewise, N."""
    contacts: _Messages[PersonContact]
    """Each body that touched a part of the person in these four physics ticks, strongest first, at
    most 16. The seat of the person's own chair is left out.
    """
    contact_count: int
    """Number of these contacts, also of those beyond 16 (no unit)."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        head_angles: _Iterable[float] | None = ...,
        jaw: float | None = ...,
        mouth: Pose | _Mapping[str, _Any] | None = ...,
        forces: _Iterable[float] | None = ...,
        robot_force: float | None = ...,
        contacts: _Iterable[PersonContact | _Mapping[str, _Any]] | None = ...,
        contact_count: int | None = ...,
    ) -> None: ...

class PersonContact(_Message):
    """A body that touches a part of the person."""
    part: BodyPart
    """Part of the person. A contact at the mouth is listed for mouth and face (no unit)."""
    partner: str
    """Link of the robot, object or furniture, as in the scene query (no unit)."""
    force: float
    """Force on the part, of four physics ticks the greatest, for an object their mean, N."""
    def __init__(
        self,
        *,
        part: BodyPart | str | int | None = ...,
        partner: str | None = ...,
        force: float | None = ...,
    ) -> None: ...

class CameraSetting(_Message):
    """One camera of the scenario."""
    name: str
    """One of the robot's, or `room`; where it asks, `*` stands for each of the robot's that is not
    named (no unit).
    """
    width: int
    """Picture width, 16 to 4096 pixels; the intrinsics scale with it. There is no usual size: 0 is
    refused.
    """
    height: int
    """Picture height, 16 to 4096 pixels."""
    rate_hz: float
    """Pictures per second of simulation time, Hz; must divide 240. Absent takes 10, 0 is off.
    Optional.
    """
    lens: Intrinsics
    """Lens, where it is not that of the robot's description; it scales to the size above. Where
    the server draws calibrations, it fills it in.
    """
    place: CameraPlace
    """Where the camera is, where that is not as the robot's description says."""
    def __init__(
        self,
        *,
        name: str | None = ...,
        width: int | None = ...,
        height: int | None = ...,
        rate_hz: float | None = ...,
        lens: Intrinsics | _Mapping[str, _Any] | None = ...,
        place: CameraPlace | _Mapping[str, _Any] | None = ...,
    ) -> None: ...

class CameraPlace(_Message):
    """Where a camera is."""
    frame: str
    """Frame that carries it: one of the robot's frames, or `house` (no unit)."""
    pose: Pose
    """Pose of the optical frame (z forward, x right, y down) in that frame, metres."""
    def __init__(
        self,
        *,
        frame: str | None = ...,
        pose: Pose | _Mapping[str, _Any] | None = ...,
    ) -> None: ...

class ObjectPlacement(_Message):
    """Where an object starts and what was drawn for it."""
    name: str
    """Object name in the scene (no unit)."""
    pose: Pose
    """Pose of the object's frame in `house`, metres."""
    mass: float
    """Mass, kg; absent takes the drawn one. Optional."""
    friction: float
    """Coulomb friction coefficient; absent takes the drawn one (no unit). Optional."""
    def __init__(
        self,
        *,
        name: str | None = ...,
        pose: Pose | _Mapping[str, _Any] | None = ...,
        mass: float | None = ...,
        friction: float | None = ...,
    ) -> None: ...

class SlideResistance(_Message):
    """What was drawn for furniture that slides."""
    joint: str
    """Joint, for example `drawer_1_joint` (no unit)."""
    friction: float
    """Dry friction, N; absent takes the drawn one. Optional."""
    damping: float
    """Viscous friction, N·s/m; absent takes the drawn one. Optional."""
    position: float
    """Joint position at the start, metres; absent is 0, closed. Optional."""
    def __init__(
        self,
        *,
        joint: str | None = ...,
        friction: float | None = ...,
        damping: float | None = ...,
        position: float | None = ...,
    ) -> None: ...

class SensorSetting(_Message):
    """A sensor model that is on: what it makes is published and recorded beside the truth.
    """
    model: str
    """File in assets/sensors, without `.toml` (no unit)."""
    camera: str
    """Camera whose pictures it takes; empty for a model of no camera (no unit)."""
    seed: int
    """Seed of its noise; absent takes the scenario's (no unit). Optional."""
    strength: float
    """How far from perfect, 0 to 3: 1 is as the file says, 0 has no noise and no delay; absent is
    1 (no unit). Optional.
    """
    def __init__(
        self,
        *,
        model: str | None = ...,
        camera: str | None = ...,
        seed: int | None = ...,
        strength: float | None = ...,
    ) -> None: ...

class Scenario(_Message):
    """What is simulated. Start-up, reset, episode start, replay, collection and the attributes of
    a recording all use this message. Where it asks (`reset`), what is absent takes the value in
    force. Who gives a scene, a task, a robot or a seed, be it the same, or other starts or
    another variant, has drawn anew what he does not give: objects, slides, start, arm, gripper,
    instruction, target and variant. Where it answers, and in recordings, everything is there.
    """
    scene: str
    """Scene name in assets/scenes; empty takes the one in force (no unit)."""
    task: str
    """Task name in assets/tasks; empty for none (no unit). Optional."""
    seed: int
    """Seed of every random choice (no unit). Optional."""
    robot: str
    """Robot description folder in assets/robots; empty takes the one in force (no unit)."""
    cameras: _Messages[CameraSetting]
    """Cameras in use; empty takes those in force, or all where another robot is asked for. A
    camera of rate 0 is off.
    """
    state_rate_hz: float
    """Rate of the state streams, Hz; must divide 60; 0 is off. At start-up 60. Optional."""
    imu_rate_hz: float
    """Rate of the IMU, Hz; must divide 240; 0 is off. At start-up 240. Optional."""
    pacing: Pacing
    """Pacing of the simulation (no unit)."""
    quality: RenderQuality
    """Quality of the camera pictures (no unit)."""
    imu_noise: bool
    """Adds the IMU noise of the robot description, drawn from the seed (no unit). Optional.
    """
    objects: _Messages[ObjectPlacement]
    """Object placements in `house`. Those that are given are taken as they are, the others are
    drawn, and the answer has all. Where some are given, clutter that is not is not there.
    """
    start: Pose
    """Pose of `wheelchair_root` in `house` at the start, metres."""
    instruction: str
    """Instruction sentence; where the server draws, one of the task's by seed (no unit). Optional.
    """
    target: str
    """What the task is about: an object, or furniture that slides; where the server draws, the
    task's only target, or one of several by seed (no unit). Optional.
    """
    slides: _Messages[SlideResistance]
    """Resistance of furniture that slides. Where the server draws, it fills in what is not named.
    """
    deformable_rate_hz: float
    """Rate of the shapes of soft objects, Hz; must divide 60; 0 is off. At start-up 10. Optional.
    """
    calibration_seed: int
    """Which specimen of the robot: lens and place of each of its cameras that has none of its own
    are drawn from this number, within the tolerances of the robot's folder, and told in
    `cameras`. Absent: as the description says (no unit). Optional.
    """
    language: Language
    """How the task is said, where the server draws the sentence. Absent takes what is in force, at
    start-up one of the task's own sentences (no unit). Optional.
    """
    look: Look
    """How it looks. Absent: as the scene's files say, or the one in force; with all axes 0 as the
    files say.
    """
    disturbances: Disturbances
    """What hinders the robot on purpose. Absent takes what is in force, at start-up nothing (no
    unit). Optional.
    """
    style: str
    """How the scripted operator moves: `quick` or `human`. Absent takes the one in force, at
    start-up `quick` (no unit). Optional.
    """
    person: Person
    """Who sits in the chair. Absent takes what is in force, at start-up nobody; what of it is
    drawn is drawn anew as the scene is (no unit). Optional.
    """
    starts: Starts
    """Where the robot starts; at start-up near by (no unit)."""
    arm_positions: _Scalars[float]
    """Positions of the arm's joints at the start, from base to hand, radians. Empty where the
    server draws.
    """
    knuckle: float
    """Angle of the gripper's knuckle at the start, radians; 0 is open. Absent where the server
    draws. Optional.
    """
    variant: str
    """Variant of the task's area (see assets/areas), empty for the first. Where the server draws,
    one by the shares of the area (no unit). Optional.
    """
    variant_share: float
    """How often a variant other than the area's first is drawn, 0 to 1. Absent takes what the area
    says (no unit). Optional.
    """
    sensors: _Messages[SensorSetting]
    """Sensor models that are on; where it asks, empty takes those in force, or none where another
    robot is asked for. One of model `none` switches all off.
    """
    time_limit_seconds: float
    """Simulated seconds after which the task has failed. 0 asks the server for three times what
    the operator is expected to take, which the answer tells. Absent takes the one in force, at
    start-up that of the task, s. Optional.
    """
    rejected_starts: int
    """Start poses that the server drew before `start` and rejected because chair or arm would have
    met the person (count).
    """
    start_in_view: bool
    """Where the server draws the start: a start from which the wrist camera or the chair's camera
    has the target in its field of view and nothing but objects between. Absent takes the one in
    force, at start-up false (no unit). Optional.
    """
    look_around: bool
    """The scripted operator looks around before it drives. Absent takes the one in force, at
    start-up false (no unit). Optional.
    """
    def __init__(
        self,
        *,
        scene: str | None = ...,
        task: str | None = ...,
        seed: int | None = ...,
        robot: str | None = ...,
        cameras: _Iterable[CameraSetting | _Mapping[str, _Any]] | None = ...,
        state_rate_hz: float | None = ...,
        imu_rate_hz: float | None = ...,
        pacing: Pacing | str | int | None = ...,
        quality: RenderQuality | str | int | None = ...,
        imu_noise: bool | None = ...,
        objects: _Iterable[ObjectPlacement | _Mapping[str, _Any]] | None = ...,
        start: Pose | _Mapping[str, _Any] | None = ...,
        instruction: str | None = ...,
        target: str | None = ...,
        slides: _Iterable[SlideResistance | _Mapping[str, _Any]] | None = ...,
        deformable_rate_hz: float | None = ...,
        calibration_seed: int | None = ...,
        language: Language | _Mapping[str, _Any] | None = ...,
        look: Look | _Mapping[str, _Any] | None = ...,
        disturbances: Disturbances | _Mapping[str, _Any] | None = ...,
        style: str | None = ...,
        person: Person | _Mapping[str, _Any] | None = ...,
        starts: Starts | str | int | None = ...,
        arm_positions: _Iterable[float] | None = ...,
        knuckle: float | None = ...,
        variant: str | None = ...,
        variant_share: float | None = ...,
        sensors: _Iterable[SensorSetting | _Mapping[str, _Any]] | None = ...,
        time_limit_seconds: float | None = ...,
        rejected_starts: int | None = ...,
        start_in_view: bool | None = ...,
        look_around: bool | None = ...,
    ) -> None: ...

class TaskGoal(_Message):
    """What a task asks for, for who has to do it."""
    kind: GoalKind
    """What is to be done (no unit)."""
    target: str
    """Object or furniture that the hand takes (no unit)."""
    region: BoxGeometry
    """GOAL_KIND_PUT: the rectangle in which the target's centre of mass is to be, its x axis
    pointing away from who approaches; metres in `house`. GOAL_KIND_GIVE: the lap, metres in
    `wheelchair_root`.
    """
    joint: str
    """GOAL_KIND_OPEN and GOAL_KIND_CLOSE: name of the joint (no unit)."""
    position: float
    """GOAL_KIND_OPEN and GOAL_KIND_CLOSE: wanted joint position, metres."""
    tip: Vector3
    """GOAL_KIND_BRING: the point of the target that goes to the mouth, metres in the target's own
    frame.
    """
    def __init__(
        self,
        *,
        kind: GoalKind | str | int | None = ...,
        target: str | None = ...,
        region: BoxGeometry | _Mapping[str, _Any] | None = ...,
        joint: str | None = ...,
        position: float | None = ...,
        tip: Vector3 | _Mapping[str, _Any] | None = ...,
    ) -> None: ...

class TaskInfo(_Message):
    """One task of the library. Query `tasks` answers a TaskList."""
    name: str
    """Task name (no unit)."""
    activity: str
    """Activity of daily living, `serve` or `organize` (no unit)."""
    area: str
    """Area of the home where it happens (no unit)."""
    instructions: _Scalars[str]
    """Instruction sentences (no unit)."""
    predicates: _Scalars[str]
    """Predicates as text (no unit)."""
    goal: GoalKind
    """What is to be done (no unit)."""
    targets: _Scalars[str]
    """What it is done to: one of these is drawn by the seed (no unit)."""
    variants: _Scalars[str]
    """Variants of its area in which it can be done, by name; the first has none (no unit).
    """
    def __init__(
        self,
        *,
        name: str | None = ...,
        activity: str | None = ...,
        area: str | None = ...,
        instructions: _Iterable[str] | None = ...,
        predicates: _Iterable[str] | None = ...,
        goal: GoalKind | str | int | None = ...,
        targets: _Iterable[str] | None = ...,
        variants: _Iterable[str] | None = ...,
    ) -> None: ...

class TasksRequest(_Message):
    """Asks for the library of tasks. Query `tasks`."""

class TaskList(_Message):
    """Answers the query `tasks`."""
    header: Header
    """Stamp of the answer."""
    tasks: _Messages[TaskInfo]
    """The tasks."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        tasks: _Iterable[TaskInfo | _Mapping[str, _Any]] | None = ...,
    ) -> None: ...

class Condition(_Message):
    """One condition of the task."""
    name: str
    """The condition's name in its task, by which it is told from the others: the predicate with
    its arguments (no unit).
    """
    holds: bool
    """Whether it holds now (no unit)."""
    value: float
    """The measured quantity, in the unit of its threshold (SI)."""
    required: bool
    """False for conditions that are reported but not required (no unit)."""
    predicate: str
    """The predicate alone, as in the task file, for example `lifted_and_held` (no unit)."""
    def __init__(
        self,
        *,
        name: str | None = ...,
        holds: bool | None = ...,
        value: float | None = ...,
        required: bool | None = ...,
        predicate: str | None = ...,
    ) -> None: ...

class Evaluation(_Message):
    """State of the task."""
    header: Header
    """Stamp of the sample."""
    success: bool
    """All required conditions hold, or held until the end (no unit)."""
    done: bool
    """The task is over, by success or by failure (no unit)."""
    failure: str
    """Why it failed, for people; empty while it runs or when it succeeded (no unit)."""
    conditions: _Messages[Condition]
    """Every condition by name."""
    elapsed_seconds: float
    """Simulated time since the task began, s."""
    failure_reason: FailureReason
    """Why it failed, for programs (no unit)."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        success: bool | None = ...,
        done: bool | None = ...,
        failure: str | None = ...,
        conditions: _Iterable[Condition | _Mapping[str, _Any]] | None = ...,
        elapsed_seconds: float | None = ...,
        failure_reason: FailureReason | str | int | None = ...,
    ) -> None: ...

class SceneBody(_Message):
    """One body of the scene."""
    name: str
    """Name (no unit)."""
    fixed: bool
    """It stays where it is (no unit)."""
    boxes: _Messages[BoxGeometry]
    """Boxes around its collision shapes in `house`; of what moves in the body's own frame, metres.
    """
    area: str
    """Area it belongs to, for example `coffee_table` (no unit)."""
    def __init__(
        self,
        *,
        name: str | None = ...,
        fixed: bool | None = ...,
        boxes: _Iterable[BoxGeometry | _Mapping[str, _Any]] | None = ...,
        area: str | None = ...,
    ) -> None: ...

class FurnitureJoint(_Message):
    """Furniture that slides along an axis, for example a drawer."""
    name: str
    """Name, for example `drawer_1_joint` (no unit)."""
    body: str
    """Body that moves; its boxes and grasps are in its own frame (no unit)."""
    rest: Pose
    """Pose of the body in `house` at joint position 0, metres."""
    axis: Vector3
    """Unit vector of growing positions in `house` (no unit)."""
    travel: float
    """Greatest position, metres or radians; the least is 0."""
    type: JointType
    """How it moves (no unit)."""
    def __init__(
        self,
        *,
        name: str | None = ...,
        body: str | None = ...,
        rest: Pose | _Mapping[str, _Any] | None = ...,
        axis: Vector3 | _Mapping[str, _Any] | None = ...,
        travel: float | None = ...,
        type: JointType | str | int | None = ...,
    ) -> None: ...

class GraspFrame(_Message):
    """Where the end effector takes an object."""
    object: str
    """Object, or furniture that slides, that it belongs to (no unit)."""
    name: str
    """Name of the grasp (no unit)."""
    pose: Pose
    """Grasp point in the body's frame: z approach direction, x closing direction, metres."""
    width: float
    """Width between the pads at the grasp, metres."""
    symmetric: bool
    """The object may be taken at any turn about its own z axis (no unit)."""
    force: float
    """Cap of the force at each pad for what is soft, N; absent leaves it to the client. Optional.
    """
    from_above: bool
    """It takes the object only where the hand comes from above, for example by an arm of what has
    fallen over (no unit).
    """
    def __init__(
        self,
        *,
        object: str | None = ...,
        name: str | None = ...,
        pose: Pose | _Mapping[str, _Any] | None = ...,
        width: float | None = ...,
        symmetric: bool | None = ...,
        force: float | None = ...,
        from_above: bool | None = ...,
    ) -> None: ...

class Instance(_Message):
    """One instance id of the pictures."""
    id: int
    """Id in the pictures, 1 to 65535 (no unit)."""
    name: str
    """Body name (no unit)."""
    kind: InstanceKind
    """What it is (no unit)."""
    part: BodyPart
    """Part of the person, where it is one (no unit)."""
    def __init__(
        self,
        *,
        id: int | None = ...,
        name: str | None = ...,
        kind: InstanceKind | str | int | None = ...,
        part: BodyPart | str | int | None = ...,
    ) -> None: ...

class SceneRequest(_Message):
    """Asks what stands in the home. Query `scene`."""

class SceneReply(_Message):
    """Answers the query `scene`."""
    header: Header
    """Stamp of the answer."""
    bodies: _Messages[SceneBody]
    """Furniture and objects."""
    grasps: _Messages[GraspFrame]
    """Grasps of the objects."""
    target: str
    """Object or furniture the task is about; empty without a task (no unit)."""
    instances: _Messages[Instance]
    """Legend of the instance ids."""
    objects: _Scalars[str]
    """Object names, in the order of ObjectPoses (no unit)."""
    joints: _Messages[FurnitureJoint]
    """Furniture that slides, in the order of FurnitureJoints."""
    goal: TaskGoal
    """What the task asks for; absent without a task."""
    cameras: _Messages[RobotCamera]
    """Cameras that stand in the scene; their link is `house`."""
    robot: RobotDescription
    """The robot in it."""
    persons: _Messages[SeatedPerson]
    """Who sits in the chair; none or one."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        bodies: _Iterable[SceneBody | _Mapping[str, _Any]] | None = ...,
        grasps: _Iterable[GraspFrame | _Mapping[str, _Any]] | None = ...,
        target: str | None = ...,
        instances: _Iterable[Instance | _Mapping[str, _Any]] | None = ...,
        objects: _Iterable[str] | None = ...,
        joints: _Iterable[FurnitureJoint | _Mapping[str, _Any]] | None = ...,
        goal: TaskGoal | _Mapping[str, _Any] | None = ...,
        cameras: _Iterable[RobotCamera | _Mapping[str, _Any]] | None = ...,
        robot: RobotDescription | _Mapping[str, _Any] | None = ...,
        persons: _Iterable[SeatedPerson | _Mapping[str, _Any]] | None = ...,
    ) -> None: ...

class PickRequest(_Message):
    """Asks what stands at a pixel of a picture that was shown. Query `pick`. The server knows the
    last 30 pictures of each camera that somebody previews.
    """
    camera: str
    """Camera (no unit)."""
    tick: int
    """Tick of the picture (ticks)."""
    u: float
    """Place from the left edge, 0 to 1 (share of the width, no unit)."""
    v: float
    """Place from the upper edge, 0 to 1 (share of the height, no unit)."""
    snap: float
    """The nearest thing that can be taken is looked for within this share of the width, at most
    0.25; 0 takes what stands at the pixel (no unit).
    """
    def __init__(
        self,
        *,
        camera: str | None = ...,
        tick: int | None = ...,
        u: float | None = ...,
        v: float | None = ...,
        snap: float | None = ...,
    ) -> None: ...

class PickReply(_Message):
    """Answers the query `pick`."""
    header: Header
    """Stamp of the answer."""
    body: str
    """Body at the pixel, or the thing that it snapped to; empty where nothing is (no unit).
    """
    kind: InstanceKind
    """What it is (no unit)."""
    graspable: bool
    """It has grasps: the operator's skills can take it (no unit)."""
    point: Vector3
    """The point that was met, in `house`, metres; absent where nothing is."""
    u: float
    """Where it was met, from the left edge, 0 to 1 (no unit)."""
    v: float
    """Where it was met, from the upper edge, 0 to 1 (no unit)."""
    bounds: _Scalars[float]
    """Box around what is seen of it: left, upper, right and lower edge, 0 to 1; empty where
    nothing is (no unit).
    """
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        body: str | None = ...,
        kind: InstanceKind | str | int | None = ...,
        graspable: bool | None = ...,
        point: Vector3 | _Mapping[str, _Any] | None = ...,
        u: float | None = ...,
        v: float | None = ...,
        bounds: _Iterable[float] | None = ...,
    ) -> None: ...

class SeatedPerson(_Message):
    """Who sits in the chair. Places are in `wheelchair_root`, with the head as the posture has it.
    """
    drawn: PersonDrawn
    """Who, how and in what."""
    words: str
    """The body in words (no unit)."""
    stature: float
    """Sole to crown, metres."""
    mass: float
    """Mass, kg."""
    seat_height: float
    """Height of the seat over the foot plate, metres."""
    capsules: _Messages[PersonCapsule]
    """What stands for the body in contacts and for planning."""
    margin: float
    """How far clothes and skin may stand out of the capsules, metres."""
    lap: BoxGeometry
    """Where a thing may lie in the lap: its upper side has no height, metres."""
    mouth: Pose
    """Pose of the mouth: origin between the lips, x out of the mouth, z up, metres."""
    def __init__(
        self,
        *,
        drawn: PersonDrawn | _Mapping[str, _Any] | None = ...,
        words: str | None = ...,
        stature: float | None = ...,
        mass: float | None = ...,
        seat_height: float | None = ...,
        capsules: _Iterable[PersonCapsule | _Mapping[str, _Any]] | None = ...,
        margin: float | None = ...,
        lap: BoxGeometry | _Mapping[str, _Any] | None = ...,
        mouth: Pose | _Mapping[str, _Any] | None = ...,
    ) -> None: ...

class PersonCapsule(_Message):
    """A capsule of a person's body."""
    name: str
    """Name, for example `left_forearm` (no unit)."""
    part: BodyPart
    """Part of the body (no unit)."""
    a: Vector3
    """One end of its axis, metres."""
    b: Vector3
    """The other end, metres."""
    radius: float
    """Its radius, metres."""
    moves: bool
    """It moves with the head (no unit)."""
    def __init__(
        self,
        *,
        name: str | None = ...,
        part: BodyPart | str | int | None = ...,
        a: Vector3 | _Mapping[str, _Any] | None = ...,
        b: Vector3 | _Mapping[str, _Any] | None = ...,
        radius: float | None = ...,
        moves: bool | None = ...,
    ) -> None: ...

class EpisodeStartRequest(_Message):
    """Asks to start an episode."""
    label: str
    """File label: letters, digits, `-`, `_`, `.`; 1 to 100 characters (no unit)."""
    instruction: str
    """Instruction sentence, stored exactly; absent takes the scenario's (no unit). Optional.
    """
    require_recorders: int
    """Number of recorders that must be ready before time goes on (count)."""
    commander: str
    """Lock-step: the commander to wait for; it must hold control. Empty takes the one that does
    (no unit).
    """
    replay: bool
    """Commands are taken as they are, without the age rule: for replaying what the gate let
    through once already. Lock-step only, where time waits for every command (no unit).
    """
    practice: bool
    """Nothing of the episode is recorded, whichever recorders are connected (no unit)."""
    time_limit_seconds: float
    """Simulated seconds after which the task of this episode has failed. Absent takes the time
    limit of the scenario, s. Optional.
    """
    def __init__(
        self,
        *,
        label: str | None = ...,
        instruction: str | None = ...,
        require_recorders: int | None = ...,
        commander: str | None = ...,
        replay: bool | None = ...,
        practice: bool | None = ...,
        time_limit_seconds: float | None = ...,
    ) -> None: ...

class EpisodeStarted(_Message):
    """Published on `episode/start` and answered to the request."""
    header: Header
    """Stamp of the first tick; its episode number names the episode."""
    label: str
    """File label (no unit)."""
    instruction: str
    """Instruction sentence (no unit)."""
    scenario: Scenario
    """Scenario with the drawn values."""
    activity: str
    """Activity of daily living of the task, `serve` or `organize` (no unit)."""
    area: str
    """Area of the task (no unit)."""
    streams: _Scalars[str]
    """Streams that will be published, without pictures (no unit)."""
    cameras: _Scalars[str]
    """Cameras that will be published (no unit)."""
    adapter: str
    """Adapter that draws the pictures (no unit)."""
    version: str
    """Server version (no unit)."""
    objects: _Scalars[str]
    """Object names, in the order of ObjectPoses (no unit)."""
    joints: _Scalars[str]
    """Names of the furniture's joints, in the order of FurnitureJoints (no unit)."""
    physics_version: int
    """Version of the physics that computes the episode; servers of the same version replay it bit
    for bit (no unit, 0 = told none).
    """
    robot: RobotDescription
    """The robot that is recorded."""
    as_recorded: bool
    """The states are those of a recording, see ShowRequest: only they and the pictures are
    published, and no version of the physics computes them (no unit).
    """
    sensors: _Scalars[str]
    """Picture sensors that will be published (no unit)."""
    compressed_cameras: bool
    """The cameras' pictures come compressed as well, see CompressedCameraFrame (no unit)."""
    practice: bool
    """Recorders leave this episode out (no unit)."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        label: str | None = ...,
        instruction: str | None = ...,
        scenario: Scenario | _Mapping[str, _Any] | None = ...,
        activity: str | None = ...,
        area: str | None = ...,
        streams: _Iterable[str] | None = ...,
        cameras: _Iterable[str] | None = ...,
        adapter: str | None = ...,
        version: str | None = ...,
        objects: _Iterable[str] | None = ...,
        joints: _Iterable[str] | None = ...,
        physics_version: int | None = ...,
        robot: RobotDescription | _Mapping[str, _Any] | None = ...,
        as_recorded: bool | None = ...,
        sensors: _Iterable[str] | None = ...,
        compressed_cameras: bool | None = ...,
        practice: bool | None = ...,
    ) -> None: ...

class SnapshotRequest(_Message):
    """Asks for state and assets of the running episode. Query `snapshot`."""

class SnapshotReply(_Message):
    """What an episode's recording needs beside the streams. Query `snapshot`."""
    header: Header
    """Stamp of the snapshot: the first tick of the episode."""
    snapshot: bytes
    """Opaque state of the simulation (bytes)."""
    assets: _Messages[AssetText]
    """Text of the asset files in use, by path below assets (no unit)."""
    instances: _Messages[Instance]
    """Legend of the instance ids."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        snapshot: bytes | None = ...,
        assets: _Iterable[AssetText | _Mapping[str, _Any]] | None = ...,
        instances: _Iterable[Instance | _Mapping[str, _Any]] | None = ...,
    ) -> None: ...

class AssetText(_Message):
    """One asset file."""
    path: str
    """Path below the assets folder (no unit)."""
    text: str
    """Content (no unit)."""
    def __init__(
        self,
        *,
        path: str | None = ...,
        text: str | None = ...,
    ) -> None: ...

class EpisodeStopRequest(_Message):
    """Asks to stop the running episode."""
    discard: bool
    """Recorders throw the episode away; refused while somebody else is in control (no unit).
    """
    episode: int
    """Number of the episode that is meant; refused with NO_EPISODE where another one runs or none.
    Absent ends whichever runs (no unit). Optional.
    """
    force: bool
    """Discards although somebody else is in control (no unit)."""
    secret: str
    """Secret of the lease of whoever is in control (no unit)."""
    def __init__(
        self,
        *,
        discard: bool | None = ...,
        episode: int | None = ...,
        force: bool | None = ...,
        secret: str | None = ...,
    ) -> None: ...

class StreamCount(_Message):
    """What one stream published in an episode."""
    stream: str
    """Stream or `camera/NAME` (no unit)."""
    first: int
    """First sequence number (no unit)."""
    last: int
    """Last sequence number (no unit)."""
    count: int
    """Number of samples (count)."""
    digest: bytes
    """What was published, to the last bit: BLAKE3 over the BLAKE3 hashes of the encoded messages
    in the order of their sequence numbers (32 bytes).
    """
    compressed_digest: bytes
    """Of a camera the same of its CompressedCameraFrames (32 bytes)."""
    def __init__(
        self,
        *,
        stream: str | None = ...,
        first: int | None = ...,
        last: int | None = ...,
        count: int | None = ...,
        digest: bytes | None = ...,
        compressed_digest: bytes | None = ...,
    ) -> None: ...

class EpisodeRequest(_Message):
    """Asks what runs and what has run lately. Query `episode`."""
    recorder: str
    """Name that a recorder claims when it starts. The server refuses a second recorder of that
    name. Empty claims none (no unit).
    """
    session: str
    """Id of the session that claims the name (no unit)."""
    def __init__(
        self,
        *,
        recorder: str | None = ...,
        session: str | None = ...,
    ) -> None: ...

class EpisodeState(_Message):
    """What runs and what has run lately. Query `episode`. Whoever records asks for it: what is
    heard on `episode/start` and `episode/stop` only says when.
    """
    header: Header
    """Stamp of the answer."""
    running: EpisodeStarted
    """Running episode, one that waits for its recorders included; absent between episodes.
    """
    ended: _Messages[EpisodeStopped]
    """The last episodes of this run that ended, at most 8, oldest first."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        running: EpisodeStarted | _Mapping[str, _Any] | None = ...,
        ended: _Iterable[EpisodeStopped | _Mapping[str, _Any]] | None = ...,
    ) -> None: ...

class EpisodeStopped(_Message):
    """Published on `episode/stop` and answered to the request."""
    header: Header
    """Stamp of the last tick."""
    discard: bool
    """Whether the episode is to be thrown away (no unit)."""
    evaluation: Evaluation
    """Task state at the end."""
    manifest: _Messages[StreamCount]
    """What every stream published: the manifest."""
    wall_seconds: float
    """Wall seconds that the episode took, s."""
    cause: EndCause
    """Why it ended (no unit)."""
    anomalies: _Scalars[str]
    """What was odd in it, in words, oldest first, each once (no unit)."""
    anomaly_kinds: _Scalars[AnomalyKind]
    """Codes of `anomalies`, as many and in the same order (no unit)."""
    unconfirmed_recorders: _Scalars[str]
    """In the answer to the query: recorders that took part and have not confirmed that they have
    the whole episode (no unit). Their files may be missing or incomplete.
    """
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        discard: bool | None = ...,
        evaluation: Evaluation | _Mapping[str, _Any] | None = ...,
        manifest: _Iterable[StreamCount | _Mapping[str, _Any]] | None = ...,
        wall_seconds: float | None = ...,
        cause: EndCause | str | int | None = ...,
        anomalies: _Iterable[str] | None = ...,
        anomaly_kinds: _Iterable[AnomalyKind | str | int] | None = ...,
        unconfirmed_recorders: _Iterable[str] | None = ...,
    ) -> None: ...

class RecorderStatus(_Message):
    """Published by a recorder on `recorder/NAME`: readiness, credit and result. It counts while
    the liveliness token `recorder/NAME/alive` is declared.
    """
    header: Header
    """Stamp of the newest sample accepted; episode it speaks of."""
    recorder: str
    """Name of the recorder, as in the key (no unit)."""
    state: RecorderState
    """What it does (no unit)."""
    accepted_frames: int
    """Camera frames accepted into its queue in this episode (count). Servers that do not know
    `credit_frames` take this and `missed` together for the credit.
    """
    missed: int
    """Samples missing so far in this episode, also those that may still come (count)."""
    path: str
    """Path of the finished file; empty where the episode was discarded (no unit)."""
    complete: bool
    """The file holds everything that was published (no unit)."""
    message: str
    """Problem in words (no unit)."""
    credit_frames: int
    """The credit in pictures: camera frames of this episode that were accepted, and those that
    were asked for in vain, as of the last moment at which no sample was missing that may still
    come (count). Absent from older recorders: `accepted_frames` and `missed` stand for it.
    Optional.
    """
    credit_tick: int
    """The credit in time: tick up to which every state stream of a fixed rate was there at that
    moment (ticks). In lock-step time stands still 480 ticks beyond it, so a recorder tells it
    at least every 48 ticks. Absent from older recorders, for which time waits only with
    cameras. Optional.
    """
    free_label: str
    """Where recording failed because a file or a log of that label exists: the next label of the
    same stem that is free at this recorder (no unit).
    """
    silent_seconds: float
    """In the server's account of its recorders: for how long a connected recorder has told
    nothing, where that is so long that it does not answer, s. Recorders leave it out. Optional.
    """
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        recorder: str | None = ...,
        state: RecorderState | str | int | None = ...,
        accepted_frames: int | None = ...,
        missed: int | None = ...,
        path: str | None = ...,
        complete: bool | None = ...,
        message: str | None = ...,
        credit_frames: int | None = ...,
        credit_tick: int | None = ...,
        free_label: str | None = ...,
        silent_seconds: float | None = ...,
    ) -> None: ...

class Clock(_Message):
    """Published last for every control tick."""
    header: Header
    """Stamp of the control tick."""
    real_time_factor: float
    """Simulated seconds per wall second over the last second (no unit)."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        real_time_factor: float | None = ...,
    ) -> None: ...

class CommandLog(_Message):
    """A command as it was sent and accepted."""
    header: Header
    """Stamp of the control tick that took it."""
    command: Command
    """The command, as decoded."""
    loop_age_ticks: int
    """Age of the state that it answers when it was taken: the loop of who commands (ticks). Absent
    where the command does not say which state it answers. Optional.
    """
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        command: Command | _Mapping[str, _Any] | None = ...,
        loop_age_ticks: int | None = ...,
    ) -> None: ...

class Applied(_Message):
    """What the robot was told at one control tick. With the snapshot at the start of the episode
    the first four fields replay it bit for bit.
    """
    header: Header
    """Stamp of the control tick at which it took effect."""
    arm: ArmCommand
    """Arm command newly taken at this tick, if any."""
    base: BaseCommand
    """Chair command newly taken at this tick, if any."""
    gripper: GripperCommand
    """Gripper command newly taken at this tick, if any."""
    joint_positions: _Scalars[float]
    """Resulting joint targets, joint_1 to joint_6, radians."""
    joint_velocities: _Scalars[float]
    """Resulting joint velocity targets, joint_1 to joint_6, rad/s."""
    wheel_velocities: _Scalars[float]
    """Resulting speeds of the left and the right rear wheel, rad/s."""
    knuckle: float
    """Resulting knuckle target, radians."""
    desired_pose: Pose
    """Desired pose of the end effector in `base_link`, metres."""
    stale: bool
    """True when the gate braked the chair because its command went stale (no unit)."""
    arm_problem: str
    """Empty, or why the last arm command is not followed, for people (no unit)."""
    arm_problem_code: ArmProblem
    """Why the last arm command is not followed, for programs (no unit)."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        arm: ArmCommand | _Mapping[str, _Any] | None = ...,
        base: BaseCommand | _Mapping[str, _Any] | None = ...,
        gripper: GripperCommand | _Mapping[str, _Any] | None = ...,
        joint_positions: _Iterable[float] | None = ...,
        joint_velocities: _Iterable[float] | None = ...,
        wheel_velocities: _Iterable[float] | None = ...,
        knuckle: float | None = ...,
        desired_pose: Pose | _Mapping[str, _Any] | None = ...,
        stale: bool | None = ...,
        arm_problem: str | None = ...,
        arm_problem_code: ArmProblem | str | int | None = ...,
    ) -> None: ...

class ObjectPoses(_Message):
    """Objects in the order of the scene query."""
    header: Header
    """Stamp of the sample."""
    poses: _Messages[Pose]
    """Poses of the objects' frames in `house`, metres."""
    twists: _Messages[Twist]
    """Velocities in `house`, m/s and rad/s."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        poses: _Iterable[Pose | _Mapping[str, _Any]] | None = ...,
        twists: _Iterable[Twist | _Mapping[str, _Any]] | None = ...,
    ) -> None: ...

class FurnitureJoints(_Message):
    """Joints of the furniture, in the order of the scene query and of EpisodeStarted.joints.
    """
    header: Header
    """Stamp of the sample."""
    positions: _Scalars[float]
    """Joint positions, metres or radians; 0 is closed."""
    velocities: _Scalars[float]
    """Joint velocities, m/s or rad/s."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        positions: _Iterable[float] | None = ...,
        velocities: _Iterable[float] | None = ...,
    ) -> None: ...

class Deformable(_Message):
    """Shape of the soft object, at the rate of the scenario; nothing where there is none."""
    header: Header
    """Stamp of the sample."""
    object: str
    """Name of the object, as in the scene query (no unit)."""
    vertices: _Scalars[float]
    """Vertices of its skin in `house`, x y z of each, metres."""
    elastic_energy: float
    """Energy of its deformation, J."""
    kinetic_energy: float
    """Energy of its motion, J."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        object: str | None = ...,
        vertices: _Iterable[float] | None = ...,
        elastic_energy: float | None = ...,
        kinetic_energy: float | None = ...,
    ) -> None: ...

class Contact(_Message):
    """One touching pair, summed over its points."""
    first: str
    """First body, as in the scene query (no unit)."""
    second: str
    """Second body (no unit)."""
    point: Vector3
    """Mean contact point in `house`, metres."""
    force: Vector3
    """Force on the second body in `house`, N."""
    def __init__(
        self,
        *,
        first: str | None = ...,
        second: str | None = ...,
        point: Vector3 | _Mapping[str, _Any] | None = ...,
        force: Vector3 | _Mapping[str, _Any] | None = ...,
    ) -> None: ...

class Contacts(_Message):
    """Contacts of the robot with anything but the floor, and of objects and the person."""
    header: Header
    """Stamp of the sample."""
    pad_forces: _Scalars[float]
    """Contact force at the left and the right finger tip, normal and friction, N."""
    contacts: _Messages[Contact]
    """Touching pairs, at most 16. Pairs of the robot, of the objects that it touches and of the
    person come first, then the others; strongest first in both groups.
    """
    contact_count: int
    """Number of touching pairs, also of those beyond 16 (no unit)."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        pad_forces: _Iterable[float] | None = ...,
        contacts: _Iterable[Contact | _Mapping[str, _Any]] | None = ...,
        contact_count: int | None = ...,
    ) -> None: ...

class PhaseSample(_Message):
    """Phase of the work as published by the operator."""
    header: Header
    """Stamp of the control tick that took it."""
    phase: Phase
    """The phase (no unit)."""
    name: str
    """Its finer name (no unit)."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        phase: Phase | str | int | None = ...,
        name: str | None = ...,
    ) -> None: ...

class StateHash(_Message):
    """Hash over the whole state, once per simulated second."""
    header: Header
    """Stamp of the tick that was hashed."""
    hash: int
    """64-bit hash (no unit)."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        hash: int | None = ...,
    ) -> None: ...

class Event(_Message):
    """Something that happened."""
    header: Header
    """Stamp of the event."""
    kind: EventKind
    """What kind of thing (no unit)."""
    text: str
    """In words (no unit)."""
    body: str
    """Body that it happened to, for example the robot's link of a collision; empty where it is
    about none (no unit).
    """
    other_body: str
    """The other body (no unit)."""
    force: float
    """Force between them, N. Optional."""
    commander: str
    """Commander that it is about (no unit)."""
    control: ControlChange
    """EVENT_KIND_CONTROL: what became of control (no unit)."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        kind: EventKind | str | int | None = ...,
        text: str | None = ...,
        body: str | None = ...,
        other_body: str | None = ...,
        force: float | None = ...,
        commander: str | None = ...,
        control: ControlChange | str | int | None = ...,
    ) -> None: ...

class StatusRequest(_Message):
    """Asks for the state of everything. Query `status`."""

class PauseRequest(_Message):
    """Asks to pause time. Query `pause`."""

class ResumeRequest(_Message):
    """Asks that time goes on. Query `resume`."""

class Status(_Message):
    """Answers the query `status`."""
    header: Header
    """Stamp of the answer."""
    version: str
    """Server version (no unit)."""
    scenario: Scenario
    """Scenario in force, with the drawn values."""
    adapter: str
    """Graphics adapter, driver and type; empty without cameras (no unit)."""
    paused: bool
    """The simulation is paused (no unit)."""
    real_time_factor: float
    """Simulated seconds per wall second (no unit)."""
    episode: EpisodeStarted
    """Running episode; absent between episodes."""
    waiting_for: str
    """Whom or what the simulation waits for, for people; empty when it does not (no unit).
    """
    recorders: _Messages[RecorderStatus]
    """Recorders that are connected. One that still makes an earlier episode into its file, or just
    has, appears once more for that, before the newest.
    """
    refused: int
    """Commands refused since the start (count)."""
    evaluation: Evaluation
    """State of the task."""
    holder: str
    """Commander that holds control; empty when nobody does (no unit)."""
    held_seconds: float
    """For how long it has held control, wall time, s."""
    unix_nanos: int
    """Wall clock of the server at the answer, nanoseconds since 1970 (Unix time)."""
    broken: str
    """Why the state of the simulation is broken: time is paused and commands are refused until a
    `reset`. Empty while all is well (no unit).
    """
    waiting_for_code: WaitingFor
    """What the simulation waits for, for programs (no unit)."""
    access: Access
    """From where the server is reached, and who may do what (no unit)."""
    strange: int
    """Messages since the start whose sender named somebody else than the key under which it sent,
    or that could not be read; commands among them are also in `refused`. What the transport's
    own rules refuse never gets here (count).
    """
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        version: str | None = ...,
        scenario: Scenario | _Mapping[str, _Any] | None = ...,
        adapter: str | None = ...,
        paused: bool | None = ...,
        real_time_factor: float | None = ...,
        episode: EpisodeStarted | _Mapping[str, _Any] | None = ...,
        waiting_for: str | None = ...,
        recorders: _Iterable[RecorderStatus | _Mapping[str, _Any]] | None = ...,
        refused: int | None = ...,
        evaluation: Evaluation | _Mapping[str, _Any] | None = ...,
        holder: str | None = ...,
        held_seconds: float | None = ...,
        unix_nanos: int | None = ...,
        broken: str | None = ...,
        waiting_for_code: WaitingFor | str | int | None = ...,
        access: Access | str | int | None = ...,
        strange: int | None = ...,
    ) -> None: ...

class LeaseRequest(_Message):
    """Asks for control, takes it over, or gives it back. Query `lease`. Whoever asks has declared
    its liveliness token `commander/NAME/RUN_ID/alive` before: control ends with that token.
    """
    header: Header
    """Its run id names the life of the asking process."""
    commander: str
    """Name of the commander, as in the key (no unit)."""
    take: bool
    """Takes control over from whoever holds it (no unit)."""
    release: bool
    """Gives control back instead of asking for it; needs the secret (no unit)."""
    secret: str
    """Secret of the lease, from the answer that gave it: proves that the asking process is the one
    in control (no unit).
    """
    sealed: bool
    """The asker seals its commands: in this lease no command without a seal is taken, so that
    nobody else can command in its name (no unit).
    """
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        commander: str | None = ...,
        take: bool | None = ...,
        release: bool | None = ...,
        secret: str | None = ...,
        sealed: bool | None = ...,
    ) -> None: ...

class LeaseReply(_Message):
    """Answers `lease`. Control that somebody else holds is answered by a Failure that names the
    holder and how to take it over.
    """
    header: Header
    """Stamp of the answer."""
    holder: str
    """Commander that holds control now. Empty when nobody does: after a release, or because the
    server has not seen the asking process's token yet (ask again) (no unit).
    """
    held_seconds: float
    """For how long it has held control, wall time, s."""
    secret: str
    """Secret of the lease, 32 hexadecimal digits: only in the answer that gives control, and to an
    asker that shows it (no unit).
    """
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        holder: str | None = ...,
        held_seconds: float | None = ...,
        secret: str | None = ...,
    ) -> None: ...

class ResetRequest(_Message):
    """Asks for a new scenario. Refused while an episode runs, and while somebody else is in
    control.
    """
    scenario: Scenario
    """What to simulate; what is absent takes the value in force."""
    snapshot: bytes
    """A snapshot to continue from (see SnapshotReply), at most 4 MiB with the rest of the request;
    empty for none (bytes).
    """
    force: bool
    """Resets although somebody else is in control (no unit)."""
    secret: str
    """Secret of the lease of whoever is in control (no unit)."""
    playback: bool
    """The scenario only shows recorded states (query `show`): a robot that starts inside of
    something is accepted (no unit).
    """
    def __init__(
        self,
        *,
        scenario: Scenario | _Mapping[str, _Any] | None = ...,
        snapshot: bytes | None = ...,
        force: bool | None = ...,
        secret: str | None = ...,
        playback: bool | None = ...,
    ) -> None: ...

class ResetReply(_Message):
    """Answers `reset`."""
    header: Header
    """Stamp after the reset."""
    scenario: Scenario
    """Scenario in force, with the drawn values."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        scenario: Scenario | _Mapping[str, _Any] | None = ...,
    ) -> None: ...

class SensorsRequest(_Message):
    """Asks what the sensors on cameras have given by the present tick. In lock-step the answer
    waits until every picture of the tick is drawn, so that who waits for the pictures that it
    counts sees what the robot knows. Query `sensors`. An empty message.
    """

class SensorGiven(_Message):
    """What a sensor on a camera has given."""
    sensor: str
    """Name of the sensor, as in the key of its pictures (no unit)."""
    camera: str
    """Camera whose exact pictures it takes (no unit)."""
    depth: bool
    """It gives depth, and not colour (no unit)."""
    pictures: int
    """Pictures of the running episode that have arrived (count)."""
    newest: int
    """Sequence number of the newest of them; 0 without any (no unit)."""
    def __init__(
        self,
        *,
        sensor: str | None = ...,
        camera: str | None = ...,
        depth: bool | None = ...,
        pictures: int | None = ...,
        newest: int | None = ...,
    ) -> None: ...

class SensorsReply(_Message):
    """Answers `sensors`."""
    header: Header
    """Stamp of the answer."""
    sensors: _Messages[SensorGiven]
    """Every sensor on a camera; none where no sensor model is on."""
    def __init__(
        self,
        *,
        header: Header | _Mapping[str, _Any] | None = ...,
        sensors: _Iterable[SensorGiven | _Mapping[str, _Any]] | None = ...,
    ) -> None: ...

class ShutdownRequest(_Message):
    """Asks the server to end. Refused while somebody else is in control. An empty request is one
    without force.
    """
    force: bool
    """Ends although somebody else is in control (no unit)."""
    secret: str
    """Secret of the lease of whoever is in control (no unit)."""
    def __init__(
        self,
        *,
        force: bool | None = ...,
        secret: str | None = ...,
    ) -> None: ...

class ShowRequest(_Message):
    """Shows one state of a recording in place of a computed one: new pictures of an episode whose
    physics this server cannot compute again. In lock-step pacing only, and while nobody is in
    control. From the first one on, until a `reset`, nothing is computed; an episode that begins
    meanwhile is marked `as_recorded`, goes on with every request, and publishes again what the
    request holds. Query `show`; answered when the state is shown, which waits for cameras and
    recorders.
    """
    tick: int
    """Tick of the state; in an episode later than the one before (ticks)."""
    joints: JointState
    """Joints, as recorded."""
    poses: PoseSet
    """Frames, as recorded; the one whose parent is `house` is the robot's root."""
    objects: ObjectPoses
    """Objects, as recorded."""
    furniture: FurnitureJoints
    """Furniture that slides, as recorded."""
    deformable: Deformable
    """Shape of the soft object; absent where it is as it was."""
    applied_samples: _Messages[Applied]
    """What was applied since the state before, oldest first."""
    commands: _Messages[CommandLog]
    """Commands that were taken since the state before, oldest first."""
    evaluation: Evaluation
    """State of the task; absent where the recording holds none."""
    phase: PhaseSample
    """Phase of the work; absent where the recording holds none."""
    odometry: Odometry
    """Wheel odometry; absent where the recording holds none."""
    contacts: Contacts
    """Contacts; absent where the recording holds none."""
    imu_samples: _Messages[Imu]
    """Measurements of the IMU since the state before, oldest first."""
    def __init__(
        self,
        *,
        tick: int | None = ...,
        joints: JointState | _Mapping[str, _Any] | None = ...,
        poses: PoseSet | _Mapping[str, _Any] | None = ...,
        objects: ObjectPoses | _Mapping[str, _Any] | None = ...,
        furniture: FurnitureJoints | _Mapping[str, _Any] | None = ...,
        deformable: Deformable | _Mapping[str, _Any] | None = ...,
        applied_samples: _Iterable[Applied | _Mapping[str, _Any]] | None = ...,
        commands: _Iterable[CommandLog | _Mapping[str, _Any]] | None = ...,
        evaluation: Evaluation | _Mapping[str, _Any] | None = ...,
        phase: PhaseSample | _Mapping[str, _Any] | None = ...,
        odometry: Odometry | _Mapping[str, _Any] | None = ...,
        contacts: Contacts | _Mapping[str, _Any] | None = ...,
        imu_samples: _Iterable[Imu | _Mapping[str, _Any]] | None = ...,
    ) -> None: ...

class PolicyCamera(_Message):
    """Pictures that a policy wants."""
    name: str
    """Name of the robot's camera (no unit)."""
    width: int
    """Width (pixels)."""
    height: int
    """Height (pixels)."""
    depth: bool
    """Depth is wanted beside the colours (no unit)."""
    def __init__(
        self,
        *,
        name: str | None = ...,
        width: int | None = ...,
        height: int | None = ...,
        depth: bool | None = ...,
    ) -> None: ...

class SeedRange(_Message):
    """A range of seeds."""
    first: int
    """First seed (no unit)."""
    end: int
    """One after the last (no unit)."""
    def __init__(
        self,
        *,
        first: int | None = ...,
        end: int | None = ...,
    ) -> None: ...

class PolicyDescribeRequest(_Message):
    """Asks a policy what it is. Query `describe`."""

class PolicySpec(_Message):
    """Answers the query `describe`."""
    name: str
    """Name, for reports (no unit)."""
    weights_sha256: str
    """SHA-256 of its weights, hexadecimal; empty without weights (no unit)."""
    cameras: _Messages[PolicyCamera]
    """Pictures that every observation holds, in this order."""
    state_names: _Scalars[str]
    """Names of the state that it was made for, in order; empty for any (no unit)."""
    history: int
    """Moments that an observation holds, the newest last; 0 for 1 (count)."""
    rate_hz: float
    """Observations and rows of action per second, Hz."""
    chunk: int
    """Rows of an answer (count)."""
    execute: int
    """Rows of an answer that are carried out before it is asked again (count)."""
    action: PolicyAction
    """What a row is (no unit)."""
    action_names: _Scalars[str]
    """Names of the numbers of a row, in order; empty for any (no unit)."""
    max_batch: int
    """Observations that one request may hold; 0 for 1 (count)."""
    stochastic: bool
    """It draws random numbers, from the seeds of the observations alone (no unit)."""
    training_seeds: _Messages[SeedRange]
    """Seeds whose episodes it was trained on."""
    def __init__(
        self,
        *,
        name: str | None = ...,
        weights_sha256: str | None = ...,
        cameras: _Iterable[PolicyCamera | _Mapping[str, _Any]] | None = ...,
        state_names: _Iterable[str] | None = ...,
        history: int | None = ...,
        rate_hz: float | None = ...,
        chunk: int | None = ...,
        execute: int | None = ...,
        action: PolicyAction | str | int | None = ...,
        action_names: _Iterable[str] | None = ...,
        max_batch: int | None = ...,
        stochastic: bool | None = ...,
        training_seeds: _Iterable[SeedRange | _Mapping[str, _Any]] | None = ...,
    ) -> None: ...

class PolicyResetRequest(_Message):
    """An episode begins. Query `reset`."""
    episode_key: str
    """Names the episode among those that run at one time (no unit)."""
    seed: int
    """Seed of its scenario (no unit)."""
    instruction: str
    """What the person says (no unit)."""
    def __init__(
        self,
        *,
        episode_key: str | None = ...,
        seed: int | None = ...,
        instruction: str | None = ...,
    ) -> None: ...

class PolicyResetReply(_Message):
    """Answers the query `reset`."""

class PolicyPicture(_Message):
    """One picture."""
    camera: str
    """Name of the camera (no unit)."""
    width: int
    """Width (pixels)."""
    height: int
    """Height (pixels)."""
    rgb: bytes
    """Red, green, blue, 8 bits each, sRGB, row-major from the top left (no unit)."""
    depth: bytes
    """Depth along the optical axis as little-endian float32, metres; infinite where nothing is.
    Empty where it is not wanted.
    """
    def __init__(
        self,
        *,
        camera: str | None = ...,
        width: int | None = ...,
        height: int | None = ...,
        rgb: bytes | None = ...,
        depth: bytes | None = ...,
    ) -> None: ...

class PolicyMoment(_Message):
    """What is seen at one instant."""
    state_values: _Scalars[float]
    """Row of state; radians, rad/s, metres."""
    pictures: _Messages[PolicyPicture]
    """Pictures in the order of the spec."""
    def __init__(
        self,
        *,
        state_values: _Iterable[float] | None = ...,
        pictures: _Iterable[PolicyPicture | _Mapping[str, _Any]] | None = ...,
    ) -> None: ...

class PolicyObservation(_Message):
    """What a policy is asked about."""
    episode_key: str
    """Names the episode (no unit)."""
    seed: int
    """Seed of its scenario (no unit)."""
    first: bool
    """It is the first of its episode (no unit)."""
    tick: int
    """Tick of the newest moment, 1/240 s."""
    instruction: str
    """What the person says (no unit)."""
    moments: _Messages[PolicyMoment]
    """As many as the spec says, the newest last; at the beginning of an episode the first stands
    there several times.
    """
    def __init__(
        self,
        *,
        episode_key: str | None = ...,
        seed: int | None = ...,
        first: bool | None = ...,
        tick: int | None = ...,
        instruction: str | None = ...,
        moments: _Iterable[PolicyMoment | _Mapping[str, _Any]] | None = ...,
    ) -> None: ...

class InferRequest(_Message):
    """Asks a policy what is to be done. Query `infer`."""
    observations: _Messages[PolicyObservation]
    """One for each episode that waits."""
    def __init__(
        self,
        *,
        observations: _Iterable[PolicyObservation | _Mapping[str, _Any]] | None = ...,
    ) -> None: ...

class PolicyChunk(_Message):
    """Answer to one observation."""
    episode_key: str
    """Episode of the observation (no unit)."""
    tick: int
    """Tick of the observation, 1/240 s."""
    rows: int
    """Rows (count)."""
    values: _Scalars[float]
    """The rows, one after the other; metres, radians, m/s, rad/s."""
    problem: str
    """Why there are no rows, for people; empty where there are some (no unit)."""
    def __init__(
        self,
        *,
        episode_key: str | None = ...,
        tick: int | None = ...,
        rows: int | None = ...,
        values: _Iterable[float] | None = ...,
        problem: str | None = ...,
    ) -> None: ...

class InferReply(_Message):
    """Answers the query `infer`."""
    chunks: _Messages[PolicyChunk]
    """In the order of the observations."""
    def __init__(
        self,
        *,
        chunks: _Iterable[PolicyChunk | _Mapping[str, _Any]] | None = ...,
    ) -> None: ...
