"""Time by `simulation_interfaces`: states, steps, resets, entities."""

import pytest
from simulation_interfaces.msg import Bounds, Result, SimulationState, SimulatorFeatures
from simulation_interfaces.srv import (
    GetEntities,
    GetEntitiesStates,
    GetEntityState,
    GetSimulationState,
    GetSimulatorFeatures,
    ResetSimulation,
    SetSimulationState,
    StepSimulation,
)
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from conftest import until
from test_streams import client  # noqa: F401
from wheelarm.ros import mapping
from wheelarm.ros.link import Control, v1

STOPPED, PLAYING, PAUSED = (
    SimulationState.STATE_STOPPED,
    SimulationState.STATE_PLAYING,
    SimulationState.STATE_PAUSED,
)


class Steering:
    """The services as functions."""

    def __init__(self, peer):
        self.peer = peer

    def state(self):
        answer = self.peer.call("get_simulation_state", GetSimulationState)
        assert answer.result.result == Result.RESULT_OK, answer.result.error_message
        return answer.state.state

    def set(self, state):
        request = SetSimulationState.Request()
        request.state.state = state
        return self.peer.call("set_simulation_state", SetSimulationState, request).result

    def step(self, steps):
        request = StepSimulation.Request(steps=steps)
        return self.peer.call("step_simulation", StepSimulation, request).result

    def reset(self, scope=ResetSimulation.Request.SCOPE_DEFAULT):
        request = ResetSimulation.Request(scope=scope)
        return self.peer.call("reset_simulation", ResetSimulation, request).result


@pytest.fixture
def steering(peer):
    return Steering(peer)


def ok(result):
    assert result.result == Result.RESULT_OK, result.error_message


def hashes_of(link):
    found = {}
    link.listen(["state_hash"], lambda _, s: found.update({s.header.tick: s.hash}))
    return found


def own_hash(link, answers, over):
    """State hashes of an episode that our own client steps: `answers` empty
    commands, each for `over` control ticks."""
    found, clocks = hashes_of(link), []
    link.listen(["clock"], lambda _, s: clocks.append(s.header))
    control = Control(link, "own")
    control.ask(False)
    started = link.ask("episode_start", v1.EpisodeStartRequest(label="own", commander="own"))
    tick = started.header.tick
    for _ in range(answers):
        header = until(
            lambda: next(
                (h for h in clocks if h.tick == tick and h.episode == started.header.episode), None
            )
        )
        control.answer(header, v1.Command(over_ticks=over))
        tick += 4 * over
    until(lambda: found.get(tick))
    link.ask("episode_stop", v1.EpisodeStopRequest(secret=control.secret))
    control.close()
    return tick - started.header.tick, dict(found)


def test_sixty_steps_are_one_second_with_the_hash_of_our_own_client(
    server, bridge, peer, steering, client  # noqa: F811
):
    flags = ["--no-cameras", "--pacing", "lock-step", "--seed", "11"]
    ticks, own = own_hash(client(server(*flags)), 60, 1)
    assert ticks == 240
    assert own_hash(client(server(*flags)), 1, 60)[1][240] == own[240]
    endpoint = server(*flags)
    bridge(endpoint)
    link = client(endpoint)
    found, clock = hashes_of(link), peer.hear("/clock", Clock)
    assert steering.state() == STOPPED
    before = link.ask("status").header
    ok(steering.step(60))
    after = link.ask("status").header
    assert after.stamp_nanos - before.stamp_nanos == 1_000_000_000
    assert after.tick - before.tick == 240
    until(lambda: 240 in found)
    print(f"hash at 1 s: {found[240]:016x} by steps, {own[240]:016x} by our own client")
    assert found[240] == own[240]
    until(lambda: clock and mapping.nanos(clock[-1].clock) == 1_000_000_000)
    assert steering.state() == PAUSED
    # Step by step, and time stands between them.
    for number in range(1, 4):
        ok(steering.step(1))
        assert link.ask("status").header.tick == 240 + 4 * number
    # From the start again, with the same hash.
    found.clear()
    ok(steering.reset())
    assert steering.state() == STOPPED
    assert link.ask("status").header.tick == 0
    ok(steering.step(60))
    until(lambda: 240 in found)
    assert found[240] == own[240]


def test_commands_go_with_the_steps(server, bridge, peer, steering):
    bridge(server("--no-cameras", "--pacing", "lock-step"))
    odom = peer.hear("odom", Odometry, 100)
    drive, twist = peer.publisher("cmd_vel", Twist), Twist()
    twist.linear.x = 0.3
    ok(steering.step(2))
    drive.publish(twist)
    # Time stands: the command waits for the next step, however long it takes.
    ok(steering.step(1))
    ok(steering.step(29))
    until(lambda: odom and odom[-1].twist.twist.linear.x > 0.1)
    # Silence of simulation time: 0.5 s later it brakes, 0.7 s later it is at rest.
    ok(steering.step(80))
    until(lambda: abs(odom[-1].twist.twist.linear.x) < 1e-3)


def test_real_time_is_paused_played_and_reset(server, bridge, peer, steering, client):  # noqa: F811
    endpoint = server("--no-cameras")
    bridge(endpoint)
    link = client(endpoint)
    assert steering.state() == PLAYING
    again = steering.set(PLAYING)
    assert again.result == SetSimulationState.Response.ALREADY_IN_TARGET_STATE
    ok(steering.set(PAUSED))
    assert steering.state() == PAUSED
    here = link.ask("status").header.tick
    steps = steering.step(5)
    assert steps.result == Result.RESULT_FEATURE_UNSUPPORTED
    assert "--pacing lock-step" in steps.error_message
    assert link.ask("status").header.tick == here
    ok(steering.set(STOPPED))
    assert steering.state() == STOPPED and link.ask("status").header.tick == 0
    ok(steering.set(PLAYING))
    until(lambda: link.ask("status").header.tick > 40)
    scope = steering.reset(ResetSimulation.Request.SCOPE_TIME)
    assert scope.result == Result.RESULT_FEATURE_UNSUPPORTED
    ok(steering.reset(ResetSimulation.Request.SCOPE_ALL))


def test_lock_step_is_played_and_paused(server, bridge, peer, steering, client):  # noqa: F811
    endpoint = server("--no-cameras", "--pacing", "lock-step")
    bridge(endpoint, "--ros-args", "-p", "play_rate:=0.0")
    link = client(endpoint)
    ok(steering.set(PLAYING))
    until(lambda: link.ask("status").header.tick > 480)
    assert steering.state() == PLAYING
    refused = steering.step(5)
    assert refused.result == Result.RESULT_OPERATION_FAILED and "pause" in refused.error_message
    ok(steering.set(PAUSED))
    assert steering.state() == PAUSED
    ok(steering.step(10))
    ok(steering.set(STOPPED))
    assert steering.state() == STOPPED and link.ask("status").header.tick == 0


def test_somebody_else_is_in_control_and_nothing_is_stepped(
    server, bridge, peer, steering, client  # noqa: F811
):
    endpoint = server("--no-cameras", "--pacing", "lock-step")
    bridge(endpoint)
    other = Control(client(endpoint), "anna")
    other.ask(False)
    for result in (steering.step(1), steering.set(PLAYING), steering.reset()):
        assert result.result == Result.RESULT_OPERATION_FAILED
        assert "anna" in result.error_message
    other.close()
    ok(steering.step(1))


def test_features_say_what_this_server_does(server, bridge, peer):
    kind = SimulatorFeatures
    steps = {kind.STEP_SIMULATION_SINGLE, kind.STEP_SIMULATION_MULTIPLE}
    bridge(server("--no-cameras"))
    features = peer.call("get_simulator_features", GetSimulatorFeatures).features
    assert not steps & set(features.features)
    assert {kind.SIMULATION_STATE_PAUSE, kind.SIMULATION_RESET} <= set(features.features)
    assert "--pacing lock-step" in features.custom_info


def test_entities_are_the_robot_objects_and_drawers(server, bridge, peer, client):  # noqa: F811
    endpoint = server("--no-cameras", "--task", "open_drawer")
    bridge(endpoint)
    link, sent = client(endpoint), {}
    link.listen(
        ["object_pose", "pose"],
        lambda topic, s: sent.setdefault(topic, {}).update({s.header.stamp_nanos: s}),
    )
    scene = link.ask("scene")

    def entities(**filters):
        request = GetEntities.Request()
        for name, value in filters.items():
            setattr(request.filters, name, value)
        return peer.call("get_entities", GetEntities, request)

    answer = entities()
    ok(answer.result)
    drawers = [one.body for one in scene.joints]
    assert drawers and list(answer.entities) == ["wheelarm", *scene.objects, *drawers]
    assert list(entities(filter="^wheel").entities) == ["wheelarm"]
    broken = entities(filter="(")
    assert broken.result.result == Result.RESULT_OPERATION_FAILED
    assert "regular expression" in broken.result.error_message
    box = Bounds(type=Bounds.TYPE_BOX, points=[Vector3(), Vector3()])
    assert entities(bounds=box).result.result == Result.RESULT_FEATURE_UNSUPPORTED
    # Where the first object is, there is it.
    name = scene.objects[0]
    state = peer.call("get_entity_state", GetEntityState, GetEntityState.Request(entity=name))
    ok(state.result)
    at = mapping.nanos(state.state.header.stamp)
    assert state.state.header.frame_id == "house"
    until(lambda: at in sent["object_pose"])
    want, told = sent["object_pose"][at].poses[0].position, state.state.pose.position
    assert (told.x, told.y, told.z) == (want.x, want.y, want.z)
    near = Bounds(type=Bounds.TYPE_SPHERE)
    near.points = [Vector3(x=told.x, y=told.y, z=told.z), Vector3(x=0.01)]
    assert name in entities(bounds=near).entities
    near.points[0].z += 50.0
    assert not entities(bounds=near).entities
    missing = peer.call("get_entity_state", GetEntityState, GetEntityState.Request(entity="nobody"))
    assert missing.result.result == Result.RESULT_NOT_FOUND
    assert "wheelarm" in missing.result.error_message
    all_states = peer.call("get_entities_states", GetEntitiesStates)
    ok(all_states.result)
    assert len(all_states.states) == len(all_states.entities) == len(answer.entities)


def test_an_episode_is_begun_and_ended(server, bridge, peer, client):  # noqa: F811
    endpoint = server("--no-cameras")
    bridge(endpoint, "--ros-args", "-p", "label:=mine", "-p", "instruction:=Take the cup")
    link = client(endpoint)
    ended = peer.call("wheelarm/episode_stop", Trigger)
    assert not ended.success and "episode" in ended.message
    begun = peer.call("wheelarm/episode_start", Trigger)
    assert begun.success and "mine" in begun.message and "Take the cup" in begun.message
    assert link.ask("status").episode.label == "mine"
    twice = peer.call("wheelarm/episode_start", Trigger)
    assert not twice.success and "episode" in twice.message
    assert peer.call("wheelarm/episode_stop", Trigger).success
    assert not link.ask("status").HasField("episode")
