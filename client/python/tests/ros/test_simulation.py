"""The services of `simulation_interfaces`: states, steps, resets, entities."""

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


class SimulationServices:
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
def services(peer):
    return SimulationServices(peer)


def ok(result):
    assert result.result == Result.RESULT_OK, result.error_message


def subscribe_hashes(probe) -> dict:
    """Subscribes to the state hashes; returns the dict of them by timestamp."""
    return probe.subscribe("state_hash")["state_hash"]


SECOND = 1_000_000_000


def hash_of_client(probe, answers, over) -> int:
    """State hash after one second of an episode that the WheelArm client steps: `answers`
    empty commands, each over `over` control ticks."""
    found = subscribe_hashes(probe)
    with probe.client.lockstep("own", topics=()) as episode:
        for _ in range(answers):
            moment = episode.step(wheelarm.command(over_ticks=over))
        assert moment.header.stamp_nanos == SECOND
    return until(lambda: found.get(SECOND)).hash


def test_sixty_steps_are_one_second_with_the_hash_of_a_wheelarm_client(
    server, bridge, peer, services, probe
):
    flags = ["--no-cameras", "--pacing", "lock-step", "--seed", "11"]
    expected = hash_of_client(probe(server(*flags)), 60, 1)
    assert hash_of_client(probe(server(*flags)), 1, 60) == expected
    assert (
        hash_of_client(
            probe(server("--no-cameras", "--pacing", "lock-step", "--seed", "12")), 1, 60
        )
        != expected
    )
    endpoint = server(*flags)
    bridge(endpoint)
    other = probe(endpoint)
    found, clock, client = subscribe_hashes(other), peer.subscribe("/clock", Clock), other.client
    assert services.state() == STOPPED
    before = client.status().header
    ok(services.step(60))
    after = client.status().header
    assert after.stamp_nanos - before.stamp_nanos == SECOND
    assert after.tick - before.tick == 240
    reached = until(lambda: found.get(SECOND)).hash
    print(f"hash at 1 s: {reached:016x} by steps, {expected:016x} by the WheelArm client")
    assert reached == expected
    until(lambda: clock and mapping.nanos(clock[-1].clock) == SECOND)
    assert services.state() == PAUSED
    # Time does not advance between single steps.
    for number in range(1, 4):
        ok(services.step(1))
        assert client.status().header.tick == 240 + 4 * number
    # The same hash after a reset.
    found.clear()
    ok(services.reset())
    assert services.state() == STOPPED
    assert client.status().header.tick == 0
    ok(services.step(60))
    assert until(lambda: found.get(SECOND)).hash == expected


def test_commands_take_effect_at_the_next_step(server, bridge, peer, services):
    bridge(server("--no-cameras", "--pacing", "lock-step"))
    odom = peer.subscribe("odom", Odometry, 100)
    drive, twist = peer.publisher("cmd_vel", Twist), Twist()
    twist.linear.x = 0.3
    ok(services.step(2))
    drive.publish(twist)
    # Time waits, so the command waits for the next step.
    ok(services.step(1))
    ok(services.step(29))
    until(lambda: odom and odom[-1].twist.twist.linear.x > 0.1)
    # In simulation time: the chair brakes after 0.5 s without commands and rests 0.7 s later.
    ok(services.step(80))
    until(lambda: abs(odom[-1].twist.twist.linear.x) < 1e-3)


def test_real_time_can_be_paused_played_and_reset(server, bridge, peer, services, probe):
    endpoint = server("--no-cameras")
    bridge(endpoint)
    client = probe(endpoint).client
    assert services.state() == PLAYING
    again = services.set(PLAYING)
    assert again.result == SetSimulationState.Response.ALREADY_IN_TARGET_STATE
    ok(services.set(PAUSED))
    assert services.state() == PAUSED
    here = client.status().header.tick
    steps = services.step(5)
    assert steps.result == Result.RESULT_FEATURE_UNSUPPORTED
    assert "--pacing lock-step" in steps.error_message
    assert client.status().header.tick == here
    ok(services.set(STOPPED))
    assert services.state() == STOPPED and client.status().header.tick == 0
    ok(services.set(PLAYING))
    until(lambda: client.status().header.tick > 40)
    scope = services.reset(ResetSimulation.Request.SCOPE_TIME)
    assert scope.result == Result.RESULT_FEATURE_UNSUPPORTED
    ok(services.reset(ResetSimulation.Request.SCOPE_ALL))


def test_lock_step_can_be_played_and_paused(server, bridge, peer, services, probe):
    endpoint = server("--no-cameras", "--pacing", "lock-step")
    bridge(endpoint, "--ros-args", "-p", "play_rate:=0.0")
    client = probe(endpoint).client
    ok(services.set(PLAYING))
    until(lambda: client.status().header.tick > 480)
    assert services.state() == PLAYING
    refused = services.step(5)
    assert refused.result == Result.RESULT_OPERATION_FAILED and "pause" in refused.error_message
    ok(services.set(PAUSED))
    assert services.state() == PAUSED
    ok(services.step(10))
    ok(services.set(STOPPED))
    assert services.state() == STOPPED and client.status().header.tick == 0


def test_steps_fail_while_another_client_is_in_control(server, bridge, peer, services, probe):
    endpoint = server("--no-cameras", "--pacing", "lock-step")
    bridge(endpoint)
    other = probe(endpoint).client.commander("anna")
    for result in (services.step(1), services.set(PLAYING), services.reset()):
        assert result.result == Result.RESULT_OPERATION_FAILED
        assert "anna" in result.error_message
    other.close()
    ok(services.step(1))


def test_features_depend_on_the_pacing(server, bridge, peer):
    kind = SimulatorFeatures
    steps = {kind.STEP_SIMULATION_SINGLE, kind.STEP_SIMULATION_MULTIPLE}
    bridge(server("--no-cameras"))
    features = peer.call("get_simulator_features", GetSimulatorFeatures).features
    assert not steps & set(features.features)
    assert {kind.SIMULATION_STATE_PAUSE, kind.SIMULATION_RESET} <= set(features.features)
    assert "--pacing lock-step" in features.custom_info


def test_entities_are_the_robot_objects_and_drawers(server, bridge, peer, probe):
    endpoint = server("--no-cameras", "--task", "open_drawer")
    bridge(endpoint)
    client_probe = probe(endpoint)
    sent, scene = client_probe.subscribe("object_pose"), client_probe.client.scene()

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
    # A sphere around the first object contains it.
    name = scene.objects[0]
    state = peer.call("get_entity_state", GetEntityState, GetEntityState.Request(entity=name))
    ok(state.result)
    at = mapping.nanos(state.state.header.stamp)
    assert state.state.header.frame_id == "house"
    until(lambda: at in sent["object_pose"])
    expected, reported = sent["object_pose"][at].poses[0].position, state.state.pose.position
    assert (reported.x, reported.y, reported.z) == (expected.x, expected.y, expected.z)
    near = Bounds(type=Bounds.TYPE_SPHERE)
    near.points = [Vector3(x=reported.x, y=reported.y, z=reported.z), Vector3(x=0.01)]
    assert name in entities(bounds=near).entities
    near.points[0].z += 50.0
    assert not entities(bounds=near).entities
    missing = peer.call(
        "get_entity_state", GetEntityState, GetEntityState.Request(entity="unknown")
    )
    assert missing.result.result == Result.RESULT_NOT_FOUND
    assert "wheelarm" in missing.result.error_message
    all_states = peer.call("get_entities_states", GetEntitiesStates)
    ok(all_states.result)
    assert len(all_states.states) == len(all_states.entities) == len(answer.entities)


def test_episode_can_be_started_and_stopped(server, bridge, peer, probe):
    endpoint = server("--no-cameras")
    bridge(endpoint, "--ros-args", "-p", "label:=mine", "-p", "instruction:=Take the cup")
    client = probe(endpoint).client
    ended = peer.call("wheelarm/episode_stop", Trigger)
    assert not ended.success and "episode" in ended.message
    begun = peer.call("wheelarm/episode_start", Trigger)
    assert begun.success and "mine" in begun.message and "Take the cup" in begun.message
    assert client.status().episode.label == "mine"
    twice = peer.call("wheelarm/episode_start", Trigger)
    assert not twice.success and "episode" in twice.message
    assert peer.call("wheelarm/episode_stop", Trigger).success
    assert not client.status().HasField("episode")
