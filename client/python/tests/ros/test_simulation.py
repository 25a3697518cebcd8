"""Time by `simulation_interfaces`: states, steps, resets, entities."""

import pytest
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry
from peer import until
from rosgraph_msgs.msg import Clock
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
from std_srvs.srv import Trigger

import wheelarm
from wheelarm.ros import mapping

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


def hashes_of(own) -> dict:
    """State hashes by stamp, growing."""
    return own.hear("state_hash")["state_hash"]


SECOND = 1_000_000_000


def own_hash(own, answers, over) -> int:
    """State hash at one second of an episode that our own client steps: `answers`
    empty commands, each for `over` control ticks."""
    found = hashes_of(own)
    with own.client.lockstep("own", topics=()) as episode:
        for _ in range(answers):
            moment = episode.step(wheelarm.command(over_ticks=over))
        assert moment.header.stamp_nanos == SECOND
    return until(lambda: found.get(SECOND)).hash


def test_sixty_steps_are_one_second_with_the_hash_of_our_own_client(
    server, bridge, peer, steering, ear
):
    flags = ["--no-cameras", "--pacing", "lock-step", "--seed", "11"]
    own = own_hash(ear(server(*flags)), 60, 1)
    assert own_hash(ear(server(*flags)), 1, 60) == own
    assert (
        own_hash(ear(server("--no-cameras", "--pacing", "lock-step", "--seed", "12")), 1, 60) != own
    )
    endpoint = server(*flags)
    bridge(endpoint)
    other = ear(endpoint)
    found, clock, client = hashes_of(other), peer.hear("/clock", Clock), other.client
    assert steering.state() == STOPPED
    before = client.status().header
    ok(steering.step(60))
    after = client.status().header
    assert after.stamp_nanos - before.stamp_nanos == SECOND
    assert after.tick - before.tick == 240
    told = until(lambda: found.get(SECOND)).hash
    print(f"hash at 1 s: {told:016x} by steps, {own:016x} by our own client")
    assert told == own
    until(lambda: clock and mapping.nanos(clock[-1].clock) == SECOND)
    assert steering.state() == PAUSED
    # Step by step, and time stands between them.
    for number in range(1, 4):
        ok(steering.step(1))
        assert client.status().header.tick == 240 + 4 * number
    # From the start again, with the same hash.
    found.clear()
    ok(steering.reset())
    assert steering.state() == STOPPED
    assert client.status().header.tick == 0
    ok(steering.step(60))
    assert until(lambda: found.get(SECOND)).hash == own


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


def test_real_time_is_paused_played_and_reset(server, bridge, peer, steering, ear):
    endpoint = server("--no-cameras")
    bridge(endpoint)
    client = ear(endpoint).client
    assert steering.state() == PLAYING
    again = steering.set(PLAYING)
    assert again.result == SetSimulationState.Response.ALREADY_IN_TARGET_STATE
    ok(steering.set(PAUSED))
    assert steering.state() == PAUSED
    here = client.status().header.tick
    steps = steering.step(5)
    assert steps.result == Result.RESULT_FEATURE_UNSUPPORTED
    assert "--pacing lock-step" in steps.error_message
    assert client.status().header.tick == here
    ok(steering.set(STOPPED))
    assert steering.state() == STOPPED and client.status().header.tick == 0
    ok(steering.set(PLAYING))
    until(lambda: client.status().header.tick > 40)
    scope = steering.reset(ResetSimulation.Request.SCOPE_TIME)
    assert scope.result == Result.RESULT_FEATURE_UNSUPPORTED
    ok(steering.reset(ResetSimulation.Request.SCOPE_ALL))


def test_lock_step_is_played_and_paused(server, bridge, peer, steering, ear):
    endpoint = server("--no-cameras", "--pacing", "lock-step")
    bridge(endpoint, "--ros-args", "-p", "play_rate:=0.0")
    client = ear(endpoint).client
    ok(steering.set(PLAYING))
    until(lambda: client.status().header.tick > 480)
    assert steering.state() == PLAYING
    refused = steering.step(5)
    assert refused.result == Result.RESULT_OPERATION_FAILED and "pause" in refused.error_message
    ok(steering.set(PAUSED))
    assert steering.state() == PAUSED
    ok(steering.step(10))
    ok(steering.set(STOPPED))
    assert steering.state() == STOPPED and client.status().header.tick == 0


def test_somebody_else_is_in_control_and_nothing_is_stepped(server, bridge, peer, steering, ear):
    endpoint = server("--no-cameras", "--pacing", "lock-step")
    bridge(endpoint)
    other = ear(endpoint).client.commander("anna")
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


def test_entities_are_the_robot_objects_and_drawers(server, bridge, peer, ear):
    endpoint = server("--no-cameras", "--task", "open_drawer")
    bridge(endpoint)
    own = ear(endpoint)
    sent, scene = own.hear("object_pose"), own.client.scene()

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


def test_an_episode_is_begun_and_ended(server, bridge, peer, ear):
    endpoint = server("--no-cameras")
    bridge(endpoint, "--ros-args", "-p", "label:=mine", "-p", "instruction:=Take the cup")
    client = ear(endpoint).client
    ended = peer.call("wheelarm/episode_stop", Trigger)
    assert not ended.success and "episode" in ended.message
    begun = peer.call("wheelarm/episode_start", Trigger)
    assert begun.success and "mine" in begun.message and "Take the cup" in begun.message
    assert client.status().episode.label == "mine"
    twice = peer.call("wheelarm/episode_start", Trigger)
    assert not twice.success and "episode" in twice.message
    assert peer.call("wheelarm/episode_stop", Trigger).success
    assert not client.status().HasField("episode")
