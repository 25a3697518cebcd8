"""The node's services: episodes, control, and ``simulation_interfaces``."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.node import Node
from std_srvs.srv import Trigger

from ..errors import WheelArmError
from . import mapping
from .controller import Controller
from .entities import Entities
from .simulation import AlreadyInStateError, Simulation, UnsupportedError, WrongStateError

try:
    from simulation_interfaces import srv as standard
    from simulation_interfaces.msg import Bounds, Result, SimulatorFeatures
except ImportError:
    standard = None

#: Whether ``simulation_interfaces`` is installed.
HAS_STANDARD = standard is not None


def trigger_services(node: Node, simulation: Simulation, controller: Controller) -> None:
    """``~/episode_start``, ``~/episode_stop``, ``~/episode_discard``,
    ``~/take_control`` and ``~/release_control``: std_srvs/Trigger. The message of the response
    states the result or the error."""
    group = MutuallyExclusiveCallbackGroup()

    def offer(name: str, act: Callable[[], str]) -> None:
        def answer(_, response: Trigger.Response) -> Trigger.Response:
            try:
                response.message, response.success = act(), True
            except WheelArmError as error:
                response.message, response.success = str(error), False
                node.get_logger().error(f"{name}: {error}")
            return response

        node.create_service(Trigger, f"~/{name}", answer, callback_group=group)

    def start() -> str:
        simulation.refresh()
        started = simulation.start()
        return f"episode {started.header.episode} {started.label}: {started.instruction}"

    def stop(discard: bool) -> str:
        stopped = simulation.stop(discard)
        success = "success" if stopped.evaluation.success else "no success"
        stamp = stopped.header.stamp_nanos * 1e-9
        discarded = ", discarded" if discard else ""
        return f"episode {stopped.header.episode} ended at {stamp:.3f} s, {success}{discarded}"

    def take() -> str:
        controller.take_control()
        return f"{controller.name} is in control"

    def release() -> str:
        controller.release()
        return f"{controller.name} is not in control"

    offer("episode_start", start)
    offer("episode_stop", lambda: stop(False))
    offer("episode_discard", lambda: stop(True))
    offer("take_control", take)
    offer("release_control", release)


class StandardServices:
    """The services of ``simulation_interfaces``, with their standard names."""

    def __init__(self, node: Node, simulation: Simulation, entities: Callable[[], Entities]):
        self.node, self.simulation, self.entities = node, simulation, entities
        reading, acting = ReentrantCallbackGroup(), MutuallyExclusiveCallbackGroup()
        for name, answer, group in (
            ("GetSimulatorFeatures", self.features, reading),
            ("GetSimulationState", self.state, reading),
            ("GetEntities", self.names, reading),
            ("GetEntityState", self.entity, reading),
            ("GetEntitiesStates", self.states, reading),
            ("SetSimulationState", self.set_state, acting),
            ("ResetSimulation", self.reset, acting),
            ("StepSimulation", self.step, acting),
        ):
            kind = getattr(standard, name, None)
            if kind is None:
                continue
            topic = "".join(f"_{c.lower()}" if c.isupper() else c for c in name).lstrip("_")
            node.create_service(kind, topic, answer, callback_group=group)

    def _attempt(self, result, act: Callable[[], None], already: int | None = None) -> None:
        try:
            act()
            result.result = Result.RESULT_OK
            return
        except UnsupportedError as error:
            result.result, text = Result.RESULT_FEATURE_UNSUPPORTED, str(error)
        except AlreadyInStateError as error:
            result.result, text = already, str(error)
        except WrongStateError as error:
            # The definition of StepSimulation names this code for this case.
            result.result, text = Result.RESULT_OPERATION_FAILED, str(error)
        except (WheelArmError, ValueError) as error:
            result.result, text = Result.RESULT_OPERATION_FAILED, str(error)
        result.error_message = text

    def features(self, _, response):
        """GetSimulatorFeatures."""
        has = SimulatorFeatures
        offered = [
            "ENTITY_CATEGORIES",
            "ENTITY_STATE_GETTING",
            "SIMULATION_RESET",
            "SIMULATION_RESET_TIME",
            "SIMULATION_RESET_STATE",
            "SIMULATION_STATE_GETTING",
            "SIMULATION_STATE_SETTING",
            "SIMULATION_STATE_PAUSE",
        ]
        text = "steps need a server with --pacing lock-step"
        try:
            self.simulation.refresh()
            if self.simulation.controller.lock_step:
                offered += ["STEP_SIMULATION_SINGLE", "STEP_SIMULATION_MULTIPLE"]
                text = "a step is 1/60 s"
        except WheelArmError as error:
            text = str(error)
        response.features.features = [getattr(has, name) for name in offered if hasattr(has, name)]
        response.features.custom_info = f"WheelArm; {text}"
        return response

    def state(self, _, response):
        """GetSimulationState."""

        def act() -> None:
            response.state.state = self.simulation.state()

        self._attempt(response.result, act)
        return response

    def set_state(self, request, response):
        """SetSimulationState."""
        already = standard.SetSimulationState.Response.ALREADY_IN_TARGET_STATE
        act = lambda: self.simulation.set_state(request.state.state)  # noqa: E731
        self._attempt(response.result, act, already)
        return response

    def reset(self, request, response):
        """ResetSimulation: time and state together."""
        kind = standard.ResetSimulation.Request
        both = kind.SCOPE_TIME | kind.SCOPE_STATE

        def act() -> None:
            if request.scope != kind.SCOPE_DEFAULT and request.scope & both != both:
                raise UnsupportedError(
                    "cannot reset only time or only state: use SCOPE_DEFAULT, SCOPE_ALL, or "
                    "SCOPE_TIME with SCOPE_STATE"
                )
            self.simulation.reset()

        self._attempt(response.result, act)
        return response

    def step(self, request, response):
        """StepSimulation: control ticks of 1/60 s."""
        self._attempt(response.result, lambda: self.simulation.step(request.steps))
        return response

    def _matching(self, filters) -> list[str]:
        bounds, sphere = filters.bounds, None
        if bounds.type == Bounds.TYPE_SPHERE:
            if len(bounds.points) != 2:
                raise ValueError(
                    f"a sphere has {len(bounds.points)} points, expected 2: the centre, and the radius "
                    "in x"
                )
            centre, size = bounds.points
            sphere = ((centre.x, centre.y, centre.z), size.x)
        elif bounds.type != Bounds.TYPE_EMPTY:
            raise UnsupportedError("unsupported type of bounds: use a sphere")
        if filters.tags.tags:
            raise UnsupportedError(
                "unsupported filter: entities have no tags; filter by name or category"
            )
        categories = [one.category for one in filters.categories]
        return self.entities().matching(filters.filter, categories, sphere)

    def names(self, request, response):
        """GetEntities."""

        def act() -> None:
            response.entities = self._matching(request.filters)

        self._attempt(response.result, act)
        return response

    def _fill(self, name: str, state) -> None:
        entities = self.entities()
        known = entities.states.get(name)
        if known is None:
            raise ValueError(
                f"the state of {name!r} is unknown before the first tick: step or play"
            )
        state.header = mapping.header(known.stamp_nanos, entities.robot.world)
        place, turn = known.pose
        _set(state.pose.position, place)
        _set(state.pose.orientation, turn)
        _set(state.twist.linear, known.linear)
        _set(state.twist.angular, known.angular)

    def entity(self, request, response):
        """GetEntityState; the acceleration is unknown and stays 0."""
        entities = self.entities()
        if request.entity not in entities.names:
            response.result.result = Result.RESULT_NOT_FOUND
            response.result.error_message = (
                f"no entity named {request.entity!r}; available: {', '.join(entities.names)}"
            )
            return response
        self._attempt(response.result, lambda: self._fill(request.entity, response.state))
        return response

    def states(self, request, response):
        """GetEntitiesStates."""

        def act() -> None:
            kind = type(standard.GetEntityState.Response().state)
            names = self._matching(request.filters)
            states = [kind() for _ in names]
            for name, state in zip(names, states, strict=False):
                self._fill(name, state)
            response.entities, response.states = names, states

        self._attempt(response.result, act)
        return response


def _set(target, numbers) -> None:
    for name, number in zip("xyzw", numbers, strict=False):
        setattr(target, name, number)
