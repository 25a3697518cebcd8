"""Gymnasium environments: every task, in lock-step, each with its own server.

    import gymnasium
    env = gymnasium.make("wheelarm:wheelarm/PickMustard-v0", obs_mode="pixels")

`WheelArmEnv` documents observations and actions. No process starts before the first
`reset`.
"""

from __future__ import annotations

import contextlib
import operator
import os
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from . import v1
from ._contract import CONTROL_HZ, TASKS
from ._reward import DenseReward
from ._scenario_reset import persistent_fields, undo_value
from ._session import refuse_fork
from .client import Client, camera_setting
from .errors import EpisodeEndedError, GoneError, WheelArmError
from .local import Server
from .lockstep import LockStep, Moment
from .rows import (
    STATE,
    Observer,
    Player,
    action_names,
    arm_joint_names,
    force_cap,
    from_vector,
    multiply,
    state_names,
)
from .streams import pose as pose_of
from .streams import twist as twist_of
from .streams import vector

OBS_MODES = ("state", "pixels", "rgbd")
REWARD_MODES = ("sparse", "dense")
CONTROL_MODES = ("row", "joint_pos", "applied", "ee_pose", "ee_delta", "keys")
RENDER_MODES = ("rgb_array", "depth_array", "rgbd_tuple")
#: Kind of the action row, for the control modes whose action is a row.
ROW_KINDS = {"row": "next-pose", "joint_pos": "next-joints", "applied": "applied"}
#: Default cameras: width and height, pixels.
CAMERAS = {"gen3": (320, 180), "wheelchair": (320, 180)}

_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
_TWIST = ("vx", "vy", "vz", "wx", "wy", "wz")
#: Names of the values of `privileged_state`.
PRIVILEGED = (
    *(f"chair.{part}" for part in (*_POSE, *_TWIST)),
    *(f"target.{part}" for part in (*_POSE, *_TWIST)),
    "pad_left.force",
    "pad_right.force",
    "goal.x",
    "goal.y",
    "goal.z",
)

#: Keys of the chair: direction forward and to the left; ``k`` is the stop key.
KEYS_CHAIR = {
    "k": (0, 0),
    "u": (1, 1),
    "i": (1, 0),
    "o": (1, -1),
    "j": (0, 1),
    "l": (0, -1),
    "m": (-1, -1),
    ",": (-1, 0),
    ".": (-1, 1),
}
#: Keys of the hand: axis of `base_link` or of the tool, and direction; "" for none.
KEYS_HAND = {
    "": (0, 0),
    "n": (0, 1),
    "v": (0, -1),
    "f": (1, 1),
    "h": (1, -1),
    "g": (2, 1),
    "b": (2, -1),
}
#: Keys of the gripper: "" for none, close, open.
KEYS_GRIPPER = {"": 0, "r": 1, "y": -1}
#: Speeds of the keys, m/s and rad/s, and their steps, m, rad and rad at the knuckle: the
#: initial values of `wheelarm teleop`.
KEY_SPEEDS = (0.5, 1.0)
KEY_STEPS = (0.025, 0.05, 0.05)
#: Largest distance of the hand's target from the hand, m and rad.
MAX_LEAD = (0.12, 0.40)


def _row_bounds(kind: str) -> tuple[list[float], list[float]]:
    """Bounds of a row for the robot `wheelarm`: SI units and radians."""
    turn = 2.0 * np.pi
    joints = [turn, 2.24, 2.57, turn, 2.09, turn]
    chair_low, chair_high = [0.0, -0.5, -1.0], [0.8, 0.5, 1.0]
    if kind == "next-pose":
        hand = [1.5, 1.5, 1.5, *[1.0] * 6]
        return [*(-v for v in hand), *chair_low], [*hand, *chair_high]
    if kind == "next-joints":
        return [*(-v for v in joints), *chair_low], [*joints, *chair_high]
    return [*(-v for v in joints), -8.0, -8.0, 0.0], [*joints, 8.0, 8.0, 0.8]


class WheelArmEnv(gymnasium.Env[dict[str, Any], Any]):
    """One task with its own server, in which time waits for this program.

    Observations are a dict:

    ================== ===================== ===============================================
    key                shape                 content
    ================== ===================== ===============================================
    agent_pos          (27,) float64         measurements of the robot: `state_names`,
                                             the same as ``observation.state`` of exports
    privileged_state   (31,) float64         ground truth, only with `obs_mode="state"`:
                                             `privileged_names`; metres, m/s, rad/s, N
    pixels             NAME: (h, w, 3) uint8 with ``pixels`` and ``rgbd``: sRGB
    depth              NAME: (h, w) float32  with ``rgbd``: metres, infinite without a surface
    ================== ===================== ===============================================

    Actions, one per step of 1 / `control_rate` s, by `control_mode`:

    ========= ==================================================================================
    row       (12,) the ``action`` of exports: pose of the hand in `base_link` (m, two
              columns of its rotation), knuckle (rad), v (m/s), ω (rad/s) in force at the
              next image
    joint_pos (9,) the same with six joints (rad) in place of the pose: exports with
              ``--action next-joints``
    applied   (9,) six joints (rad), two wheel speeds (rad/s), knuckle (rad): exports with
              ``--action applied``
    ee_pose   (10,) hand x y z (m), qx qy qz qw in `base_link`, knuckle (rad), v, ω
    ee_delta  (9,) in [-1, 1]: translation in `base_link`, rotation about the tool's axes,
              knuckle (1 closes), forward, left; 1 is the maximum speed of the robot
    keys      (4,) MultiDiscrete: keys of `wheelarm teleop` for the chair (9), the hand (7),
              its rotation (7), the gripper (3); see `KEYS_CHAIR`, `KEYS_HAND`, `KEYS_GRIPPER`
    ========= ==================================================================================

    The reward is 1 while the task's conditions hold. Else it is 0, or with
    ``reward_mode="dense"`` 0 to 0.9: 0.3 for the distance of the grasp point to the nearest
    grasp of the target, 0.2 for its hold, 0.4 for the progress of the goal. `terminated` is
    true at the end of the task, `truncated` at its time limit. `info` has ``is_success``, ``success``,
    ``failure``, ``conditions``, ``elapsed`` (s), ``tick``, ``instruction``.

    Args:
        task: Name of the task; see `wheelarm.TASKS`.
        obs_mode: ``state``, ``pixels`` or ``rgbd``.
        control_mode: See above.
        reward_mode: ``sparse`` or ``dense``.
        control_rate: Steps per simulated second, Hz; must divide 60.
        cameras: ``{"gen3": (width, height)}``, pixels; ``room`` is the camera in the home.
        render_mode: ``rgb_array``, ``depth_array`` or ``rgbd_tuple``.
        render_camera: Camera of `render`.
        render_size: Its width and height, pixels, unless `cameras` has it.
        scenario: Other fields of `v1.Scenario`, for example
            ``{"starts": "anywhere", "appearance": {"seed": 3, "light": 2}}``. State streams have the
            rate `control_rate`; for a recording, give ``{"state_rate_hz": 60.0}``.
        server: Arguments of `wheelarm.Server`, for example ``{"adapter": "llvmpipe"}``.
        endpoint: A running server to use instead of starting one.
        sim: Name of that server.
        scenario_seeds: ``reset(seed=s)`` uses `s` itself as the scenario's seed.

    Seeds: ``reset(seed=s)`` samples the scenario's seed from the environment's generator;
    ``reset(options={"scenario_seed": 7})`` uses this seed, as ``wheelarm evaluate`` does.
    ``options={"scenario": {...}}`` changes other fields for one episode; the next episode has
    the environment's own fields. No reset can undo ``language``, ``variant_share`` and
    ``calibration_seed``: after these a new server starts. With `endpoint`, give these fields
    by ``scenario`` only.
    """

    metadata: ClassVar[dict[str, Any]] = {  # type: ignore[misc]
        "render_modes": list(RENDER_MODES),
        "render_fps": 10,
    }

    def __init__(
        self,
        task: str = "pick_mustard",
        *,
        obs_mode: str = "state",
        control_mode: str = "row",
        reward_mode: str = "sparse",
        control_rate: int = 10,
        cameras: Mapping[str, Sequence[int]] | None = None,
        render_mode: str | None = None,
        render_camera: str = "room",
        render_size: Sequence[int] = (320, 180),
        scenario: Mapping[str, Any] | None = None,
        server: Mapping[str, Any] | None = None,
        endpoint: str | None = None,
        sim: str = "sim",
        scenario_seeds: bool = False,
    ) -> None:
        for what, value, known in (
            ("obs_mode", obs_mode, OBS_MODES),
            ("control_mode", control_mode, CONTROL_MODES),
            ("reward_mode", reward_mode, REWARD_MODES),
            ("render_mode", render_mode, (None, *RENDER_MODES)),
        ):
            if value not in known:
                raise ValueError(f"invalid {what}={value!r}: choose one of {known}")
        control_rate = _integer("control_rate", control_rate)
        if control_rate <= 0 or CONTROL_HZ % control_rate:
            raise ValueError(f"invalid control_rate={control_rate}: it must divide {CONTROL_HZ} Hz")
        self.task, self.obs_mode, self.control_mode = task, obs_mode, control_mode
        self.reward_mode = reward_mode
        self.control_rate, self.over_ticks = control_rate, CONTROL_HZ // control_rate
        self.render_mode, self.render_camera = render_mode, render_camera
        self.metadata = {**type(self).metadata, "render_fps": control_rate}  # type: ignore[misc]
        self.cameras = (
            {} if obs_mode == "state" else _sizes(CAMERAS if cameras is None else cameras)
        )
        self._image_sizes = dict(self.cameras)
        if render_mode is not None:
            self._image_sizes.setdefault(render_camera, _sizes({"": render_size})[""])
        self._scenario = dict(scenario or {})
        self._server_options = dict(server or {})
        self._endpoint, self._sim, self._scenario_seeds = endpoint, sim, scenario_seeds
        #: Names of the values of `agent_pos` and of the action, as in exports. After the first
        #: reset they have the joint names of the robot.
        self.state_names = state_names()
        self.privileged_names = list(PRIVILEGED)
        self.action_names = self._action_names()
        #: Instruction sentence; that of the present episode after a reset.
        self.task_description = task.replace("_", " ")
        self.observation_space = self._observation_space()
        self.action_space = self._action_space()
        self._owner = os.getpid()
        self._server: Server | None = None
        self._client: Client | None = None
        self._lockstep: LockStep | None = None
        #: Scenario before the first reset, and the fields that episodes since have changed.
        self._original = v1.Scenario()
        self._changed: set[str] = set()
        self._sent = False
        self._episodes = 0

    # -- spaces ----------------------------------------------------------------------

    def _action_names(self, joints: Sequence[str] | None = None) -> list[str]:
        if self.control_mode in ROW_KINDS:
            kind = ROW_KINDS[self.control_mode]
            return action_names(kind) if joints is None else action_names(kind, joints)
        if self.control_mode == "ee_pose":
            chair = ["knuckle.target", "chair.linear", "chair.angular"]
            return [*(f"hand.{part}" for part in _POSE), *chair]
        if self.control_mode == "ee_delta":
            hand = [f"hand.{part}.delta" for part in ("x", "y", "z", "rx", "ry", "rz")]
            return [*hand, "knuckle.delta", "chair.forward", "chair.left"]
        return ["keys.chair", "keys.hand", "keys.turn", "keys.gripper"]

    def _action_space(self) -> spaces.Space[Any]:
        if self.control_mode in ROW_KINDS:
            low, high = _row_bounds(ROW_KINDS[self.control_mode])
        elif self.control_mode == "ee_pose":
            low = [*[-1.5] * 3, *[-1.0] * 4, 0.0, -0.5, -1.0]
            high = [*[1.5] * 3, *[1.0] * 4, 0.8, 0.5, 1.0]
        elif self.control_mode == "ee_delta":
            low, high = [-1.0] * 9, [1.0] * 9
        else:
            keys = (KEYS_CHAIR, KEYS_HAND, KEYS_HAND, KEYS_GRIPPER)
            return spaces.MultiDiscrete([len(one) for one in keys])
        if (
            self._scenario.get("robot", "wheelarm") != "wheelarm"
            and self.control_mode != "ee_delta"
        ):
            low, high = [-np.inf] * len(low), [np.inf] * len(high)
        return spaces.Box(np.array(low, np.float32), np.array(high, np.float32), dtype=np.float32)

    def _observation_space(self) -> spaces.Dict:
        def numbers(count: int) -> spaces.Box:
            return spaces.Box(-np.inf, np.inf, (count,), np.float64)

        parts: dict[str, spaces.Space[Any]] = {"agent_pos": numbers(STATE)}
        if self.obs_mode == "state":
            parts["privileged_state"] = numbers(len(PRIVILEGED))
            return spaces.Dict(parts)
        sizes = {name: (height, width) for name, (width, height) in self.cameras.items()}
        parts["pixels"] = spaces.Dict(
            {name: spaces.Box(0, 255, (*size, 3), np.uint8) for name, size in sizes.items()}
        )
        if self.obs_mode == "rgbd":
            parts["depth"] = spaces.Dict(
                {name: spaces.Box(0.0, np.inf, size, np.float32) for name, size in sizes.items()}
            )
        return spaces.Dict(parts)

    @property
    def _max_episode_steps(self) -> int:
        """Steps until the time limit of the task (read by LeRobot)."""
        return round(TASKS.get(self.task, 100.0) * self.control_rate)

    # -- server ----------------------------------------------------------------------

    @property
    def client(self) -> Client:
        """The connection to the environment's server, which starts if necessary."""
        if self._client is None:
            self.start()
        assert self._client is not None
        return self._client

    def start(self) -> None:
        """Starts the server, or connects to `endpoint`. `reset` calls it.

        Raises:
            ForkedError: in a process that was forked after it had opened a connection.
            NoServerError: when the server does not start, or does not listen.
        """
        if self._client is not None:
            return
        refuse_fork()
        if self._endpoint is not None:
            self._client = Client(self._endpoint, self._sim)
        else:
            options = {"pacing": "lock-step", **self._server_options}
            self._server = Server(
                task=self.task,
                cameras={
                    name: (*size, self.control_rate) for name, size in self._image_sizes.items()
                },
                **options,
            )
            self._client = self._server.connect()
        self._owner = os.getpid()
        self._changed = set()
        self._original = self._client.status().scenario
        if self._server is not None and not self._server_options.keys() & {"person", "scenario"}:
            # The person is that of the task, which selects the person again.
            self._original.ClearField("person")

    def _undo_changes(self, more: Mapping[str, Any]) -> dict[str, Any]:
        """Fields that undo the changes of earlier episodes, without those of `more`. Starts a
        new server if no reset can undo them."""
        out = {}
        for field in sorted(self._changed - more.keys()):
            value = self._server_options.get(field) if self._endpoint is None else None
            if value is None:
                value = undo_value(field, self._original, self.task)
            if value is not None:
                out[field] = value
            elif self._endpoint is None:
                self._disconnect()
                self.start()
                return {}
            else:
                raise ValueError(
                    f"the server at {self._endpoint} keeps the {field} of an earlier episode, "
                    f"which no reset can undo: give {field} in every reset, or create the "
                    f"environment with scenario={{{field!r}: ...}}"
                )
        return out

    def _fields(self, seed: int, more: Mapping[str, Any]) -> dict[str, Any]:
        cameras = [
            camera_setting(name, *size, rate_hz=self.control_rate)
            for name, size in self._image_sizes.items()
        ]
        if self._endpoint is not None and not cameras:
            # Cameras of an earlier client would be rendered without use.
            cameras = [camera_setting("*", 320, 180, rate_hz=0.0)]
        return {
            "task": self.task,
            "pacing": "lock-step",
            # Samples between steps are unused and cost a third of a step.
            "state_rate_hz": float(self.control_rate),
            "cameras": cameras,
            **self._scenario,
            **more,
            "seed": seed,
        }

    # -- episodes --------------------------------------------------------------------

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Starts an episode; see the class for seeds and options. Unknown options are ignored.
        If the environment's own server has ended, a new one starts.

        Raises:
            ValueError: when a seed is not an integer.
            GoneError: when the server ends during the call; the next call starts a new one.
        """
        super().reset(seed=seed)
        refuse_fork(self._owner if self._client is not None else None)
        options = options or {}
        scenario_seed = options.get("scenario_seed", seed if self._scenario_seeds else None)
        if scenario_seed is None:
            scenario_seed = self.np_random.integers(2**31)
        scenario_seed = _integer("scenario_seed", scenario_seed)
        if self._server is not None and self._server.process.poll() is not None:
            self._drop_server()
        try:
            return self._start_episode(scenario_seed, options)
        except GoneError:
            self._drop_server()
            raise

    def _start_episode(
        self, scenario_seed: int, options: Mapping[str, Any]
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        self._end_episode()
        more = {**(options.get("scenario") or {})}
        # Every reset sets these fields, so they need no undo.
        always = {name for name, value in self._fields(0, {}).items() if value}
        changed = persistent_fields(more) - always
        undo = self._undo_changes(more)
        self._changed |= changed
        client = self.client
        fields = self._fields(scenario_seed, {**undo, **more})
        label = str(options.get("label") or f"{self.task}-seed{scenario_seed}")
        scenario = client.reset(**fields)
        self._changed = changed
        scene = client.scene()
        self._use_scene(scene)
        topics = ["joint_state", "pose", "odometry", "evaluation"]
        if self.control_mode in ("ee_delta", "keys"):
            topics.append("applied")
        if self.obs_mode == "state" or self.reward_mode == "dense":
            topics += ["object_pose", "furniture_joint", "contact"]
        self._lockstep = client.lockstep(
            "gym", label, topics=topics, cameras=tuple(self._image_sizes)
        )
        self._episodes += 1
        self._seed_in_force = int(scenario.seed)
        self.task_description = scenario.instruction
        self._target_start: NDArray[np.float64] | None = None
        self._sent, self._over = False, False
        self._moment = self._lockstep.now
        if self.reward_mode == "dense":
            self._dense = DenseReward(scene, self._target(self._moment))
        self._observation = self._observe(self._moment)
        return self._observation, self._info(self._moment.message("evaluation"))

    def _use_scene(self, scene: v1.SceneReply) -> None:
        robot = scene.robot
        joints = arm_joint_names(robot)
        self.state_names = state_names(joints)
        self.action_names = self._action_names(joints)
        self._scene, self._robot = scene, robot
        self._observer = Observer.for_robot(robot)
        self._player = Player(
            ROW_KINDS.get(self.control_mode, "next-pose"), robot, float(self.control_rate)
        )
        self._player.max_force = force_cap(scene)

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Executes an action for 1 / `control_rate` s of simulated time. If the server has
        ended, the episode is truncated with the failure ``server``, and the next `reset`
        starts a new server.

        Raises:
            ValueError: when the action is invalid; it is not sent.
            RefusedError: when the server rejects the command.
        """
        if not self._sent:
            self.send(action)
        self._sent = False
        if self._lockstep is None:
            raise gymnasium.error.ResetNeeded("call reset before step")
        try:
            self._moment = self._lockstep.receive()
        except EpisodeEndedError as ended:
            # Physics diverged, or another client ended the episode, without a new sample.
            self._lockstep.close()
            self._lockstep, self._over = None, True
            info = self._info(ended.stopped.evaluation)
            info["failure"] = "physics" if ended.stopped.cause == v1.END_CAUSE_PHYSICS else "ended"
            info["is_success"] = info["success"] = False
            return self._observation, 0.0, True, False, info
        except GoneError:
            info = self._info(self._moment.message("evaluation"))
            self._drop_server()
            self._over = True
            info["failure"] = "server"
            info["is_success"] = info["success"] = False
            return self._observation, 0.0, False, True, info
        evaluation = self._moment.message("evaluation")
        self._observation = self._observe(self._moment)
        info = self._info(evaluation)
        is_late = evaluation.failure_reason == v1.FAILURE_REASON_TIMEOUT
        terminated = bool(evaluation.done) and not is_late
        return self._observation, self._reward(evaluation), terminated, is_late, info

    def _reward(self, evaluation: v1.Evaluation) -> float:
        if evaluation.success or self.reward_mode == "sparse":
            return float(evaluation.success)
        frames = self._moment.message("pose").frames
        return self._dense.value(
            pose_of(frames[self._observer.chair].pose),
            pose_of(frames[self._observer.hand].pose),
            self._target(self._moment)[:7],
            list(self._moment.message("contact").pad_forces),
            list(self._moment.message("furniture_joint").positions),
        )

    def send(self, action: Any) -> None:
        """First half of `step`: sends the action without waiting. The next `step` ignores its
        own action and returns the result of this one."""
        refuse_fork(self._owner)
        if self._lockstep is None:
            raise gymnasium.error.ResetNeeded("call reset before step")
        command = self.command(action)
        # `step` reports the end of the server.
        with contextlib.suppress(GoneError):
            self._lockstep.send(command)
        self._sent = True

    def command(self, action: Any) -> v1.Command:
        """The command of an action at the present tick.

        Raises:
            ValueError: when it has a wrong length or a number that is not finite.
        """
        if self.control_mode in ROW_KINDS:
            return self._player.command(action)
        values = np.asarray(action, dtype=np.float64)
        if values.shape != self.action_space.shape or not np.isfinite(values).all():
            raise ValueError(
                f"invalid action {action!r}: control_mode={self.control_mode} has the shape "
                f"{self.action_space.shape} and finite numbers"
            )
        out = v1.Command(
            over_ticks=self.over_ticks, device=v1.DEVICE_POLICY, mode=v1.INPUT_MODE_STREAM
        )
        if self.control_mode == "ee_pose":
            norm = float(np.linalg.norm(values[3:7]))
            if norm < 1e-6:
                raise ValueError("invalid action: its quaternion (numbers 3 to 6) has the length 0")
            self._set_hand_target(out, values[:3], values[3:7] / norm)
            self._player.chair_and_gripper(out, *values[7:].tolist())
            return out
        if self.control_mode == "ee_delta":
            values = np.clip(values, -1.0, 1.0)
            arm, drive = self._robot.arm, self._robot.drive
            seconds = 1.0 / self.control_rate
            translation = values[:3] * arm.tool_speed * seconds
            rotation = values[3:6] * arm.tool_turn_rate * seconds
            knuckle = values[6] * self._robot.gripper.max_velocity * seconds
            linear = values[7] * (drive.forward_speed if values[7] > 0 else drive.backward_speed)
            angular = values[8] * drive.turn_rate
        else:
            chair, hand, turn, gripper = (int(v) for v in values)
            forward, left = list(KEYS_CHAIR.values())[chair]
            linear, angular = forward * KEY_SPEEDS[0], left * KEY_SPEEDS[1]
            translation = _key_vector(hand) * KEY_STEPS[0]
            rotation = _key_vector(turn) * KEY_STEPS[1]
            knuckle = list(KEYS_GRIPPER.values())[gripper] * KEY_STEPS[2]
        applied = self._moment.samples.get("applied")
        if applied is None:  # before the first tick: the measured values
            target, closed = self._hand_pose(), self._observation["agent_pos"][12]
        else:
            target, closed = pose_of(applied.message.desired_pose), applied.message.knuckle
        if translation.any() or rotation.any():
            position, quaternion = self._limit_lead(
                target[:3] + translation, multiply(target[3:], from_vector(rotation))
            )
            self._set_hand_target(out, position, quaternion)
        self._player.chair_and_gripper(out, float(closed + knuckle), float(linear), float(angular))
        return out

    def _hand_pose(self) -> NDArray[np.float64]:
        frame = self._moment.message("pose").frames[self._observer.hand]
        return pose_of(frame.pose)

    def _limit_lead(
        self, position: NDArray[np.float64], quaternion: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Limits a target to `MAX_LEAD` from the hand, so that actions faster than the arm do
        not accumulate."""
        hand = self._hand_pose()
        ahead = position - hand[:3]
        distance = float(np.linalg.norm(ahead))
        if distance > MAX_LEAD[0]:
            position = hand[:3] + ahead * (MAX_LEAD[0] / distance)
        between = multiply(quaternion, [*-hand[3:6], hand[6]])
        if between[3] < 0.0:
            between = -between
        sine = float(np.linalg.norm(between[:3]))
        angle = 2.0 * float(np.arctan2(sine, between[3]))
        if angle > MAX_LEAD[1]:
            quaternion = multiply(from_vector(between[:3] / sine * MAX_LEAD[1]), hand[3:])
        return position, quaternion / np.linalg.norm(quaternion)

    @staticmethod
    def _set_hand_target(
        out: v1.Command, position: NDArray[np.float64], quaternion: NDArray[np.float64]
    ) -> None:
        target = out.arm.pose
        target.frame = v1.COMMAND_FRAME_BASE_LINK
        p, q = target.pose.position, target.pose.orientation
        p.x, p.y, p.z = position.tolist()
        q.x, q.y, q.z, q.w = quaternion.tolist()

    # -- observations ----------------------------------------------------------------

    def _observe(self, moment: Moment) -> dict[str, Any]:
        for topic in ("joint_state", "pose", "odometry"):
            if topic not in moment.samples or moment.samples[topic].tick != moment.tick:
                raise WheelArmError(
                    f"no sample of `{topic}` for tick {moment.tick}: keep the default of "
                    "state_rate_hz; with the default, the sample was lost, so reset"
                )
        row = self._observer.row(
            moment.message("joint_state"), moment.message("pose"), moment.message("odometry")
        )
        out: dict[str, Any] = {"agent_pos": row}
        if self.obs_mode == "state":
            out["privileged_state"] = self._privileged(moment)
            return out
        frames = {name: moment.frames[name] for name in self.cameras}
        # Copies: a frame is a read-only view of a message.
        out["pixels"] = {name: np.array(frame.color) for name, frame in frames.items()}
        if self.obs_mode == "rgbd":
            out["depth"] = {name: np.array(frame.depth) for name, frame in frames.items()}
        return out

    def _privileged(self, moment: Moment) -> NDArray[np.float64]:
        chair = moment.message("pose").frames[self._observer.chair]
        pads = list(moment.message("contact").pad_forces) or [0.0, 0.0]
        target = self._target(moment)
        if self._target_start is None:
            self._target_start = target[:3].copy()
        parts = (
            pose_of(chair.pose),
            twist_of(chair.twist),
            target,
            pads[:2],
            self._goal(),
        )
        return np.concatenate([np.asarray(part, dtype=np.float64) for part in parts])

    def _target(self, moment: Moment) -> NDArray[np.float64]:
        """Pose and velocity of the task's object or furniture in `house`, (13,)."""
        name = self._scene.goal.target or self._scene.target
        if name in self._scene.objects:
            objects, index = moment.message("object_pose"), list(self._scene.objects).index(name)
            return np.concatenate([pose_of(objects.poses[index]), twist_of(objects.twists[index])])
        for index, joint in enumerate(self._scene.joints):
            if name in (joint.body, joint.name):
                joints = moment.message("furniture_joint")
                axis, rest = vector(joint.axis), pose_of(joint.rest)
                rest[:3] += axis * joints.positions[index]
                return np.concatenate([rest, axis * joints.velocities[index], np.zeros(3)])
        return np.zeros(13)

    def _goal(self) -> NDArray[np.float64]:
        """Goal position in `house`, (3,), metres: the centre of the goal region, or the
        furniture at its goal position, or the start of an object to lift."""
        goal = self._scene.goal
        if goal.kind == v1.GOAL_KIND_PUT:
            return vector(goal.region.pose.position)
        for joint in self._scene.joints:
            if goal.joint and joint.name == goal.joint:
                return pose_of(joint.rest)[:3] + vector(joint.axis) * goal.position
        assert self._target_start is not None
        return self._target_start

    def _info(self, evaluation: v1.Evaluation) -> dict[str, Any]:
        reason = v1.FailureReason.Name(evaluation.failure_reason)
        failure = reason.removeprefix("FAILURE_REASON_").lower()
        return {
            "is_success": bool(evaluation.success),
            "success": bool(evaluation.success),
            "failure": "" if failure in ("none", "unspecified") else failure,
            "conditions": {one.name: bool(one.holds) for one in evaluation.conditions},
            "elapsed": float(evaluation.elapsed_seconds),
            "tick": self._moment.tick,
            "scenario_seed": self._seed_in_force,
            "instruction": self.task_description,
        }

    def render(self) -> Any:
        """The newest image of `render_camera`: (h, w, 3) uint8, depth (h, w) float32 in metres,
        or both."""
        if self.render_mode is None:
            gymnasium.logger.warn('cannot render: give render_mode, for example "rgb_array"')
            return None
        if self._lockstep is None and not self._over:
            raise gymnasium.error.ResetNeeded("call reset before render")
        frame = self._moment.frames[self.render_camera]
        if self.render_mode == "rgb_array":
            return np.array(frame.color)
        if self.render_mode == "depth_array":
            return np.array(frame.depth)
        return np.array(frame.color), np.array(frame.depth)

    # -- end -------------------------------------------------------------------------

    def _end_episode(self) -> None:
        lockstep, self._lockstep = self._lockstep, None
        if lockstep is not None:
            lockstep.close()

    def close(self) -> None:
        """Ends the episode and the server. A second call has no effect."""
        if self._owner != os.getpid():
            return
        # The server may have ended.
        with contextlib.suppress(WheelArmError):
            self._end_episode()
        self._disconnect()
        super().close()

    def _drop_server(self) -> None:
        """Releases a server that has ended, or the connection to it."""
        with contextlib.suppress(WheelArmError):
            self._end_episode()
        if self._server is not None:
            ended = self._server.process.poll()
            why = "does not answer" if ended is None else f"ended with status {ended}"
            gymnasium.logger.warn(
                f"the server of this environment {why}: the next reset starts a new one; the end "
                f"of its log:\n{self._server.log_tail()[-1000:]}"
            )
        self._disconnect()

    def _disconnect(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close()
        server, self._server = self._server, None
        if server is not None:
            server.close()


def _integer(what: str, value: Any) -> int:
    """An integer, also from a float such as ``10.0``."""
    if isinstance(value, float) and value.is_integer():
        return int(value)
    try:
        return operator.index(value)
    except TypeError:
        raise ValueError(f"invalid {what}={value!r}: it must be an integer") from None


def _key_vector(index: int) -> NDArray[np.float64]:
    axis, sign = list(KEYS_HAND.values())[index]
    out = np.zeros(3)
    out[axis] = sign
    return out


def _sizes(cameras: Mapping[str, Sequence[int]]) -> dict[str, tuple[int, int]]:
    out = {}
    for name, size in cameras.items():
        width, height = (_integer(f"size of the camera {name!r}", v) for v in size)
        if not (1 <= width <= 8192 and 1 <= height <= 8192):
            raise ValueError(
                f"invalid size {width}x{height} of the camera {name!r}: give width and height, "
                "1 to 8192 pixels"
            )
        out[name] = (width, height)
    return out


def env_id(task: str) -> str:
    """Id of a task's environment: ``pick_mustard`` is ``wheelarm/PickMustard-v0``."""
    return f"wheelarm/{task.title().replace('_', '')}-v0"


def register_task(task: str, seconds: float) -> str:
    """Registers the environment of a task, with its time limit in simulated seconds.

    Returns:
        Id of the environment.
    """
    name = env_id(task)
    if name not in gymnasium.registry:
        gymnasium.register(
            id=name,
            entry_point="wheelarm.env:WheelArmEnv",
            vector_entry_point="wheelarm.vector:WheelArmVectorEnv",
            max_episode_steps=round(seconds * 10.0),
            kwargs={"task": task},
        )
    return name


def register_all() -> None:
    """Registers every task of the package."""
    for task, seconds in TASKS.items():
        register_task(task, seconds)


__all__ = [
    "CONTROL_MODES",
    "OBS_MODES",
    "PRIVILEGED",
    "REWARD_MODES",
    "WheelArmEnv",
    "env_id",
    "register_all",
    "register_task",
]
