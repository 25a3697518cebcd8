"""The environments: Gymnasium's checks, equal bits for equal seeds, and errors."""

from __future__ import annotations

import subprocess
import sys
import warnings

import numpy as np
import pytest

import wheelarm

gymnasium = pytest.importorskip("gymnasium", minversion="1.1")
from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.vector import AutoresetMode  # noqa: E402

SMALL = {"gen3": (64, 36), "wheelchair": (64, 36)}
MUSTARD = "wheelarm/PickMustard-v0"


def equal(a, b):
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(equal(a[key], b[key]) for key in a)
    return np.array_equal(a, b)


def quiet_check(env):
    """`check_env` without warnings but those that our spaces cause on purpose."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_env(env)
    allowed = ("infinity", "symmetric and normalized")
    other = [str(one.message) for one in caught if not any(w in str(one.message) for w in allowed)]
    assert not other, other


@pytest.mark.slow
@pytest.mark.parametrize("task", sorted(wheelarm.TASKS))
def test_every_task_is_registered_and_passes_check_env(task):
    env = gymnasium.make("wheelarm:" + wheelarm.env_id(task), render_mode=None)
    assert env.spec.max_episode_steps == wheelarm.TASKS[task] * 10
    env.unwrapped.spec.kwargs["render_size"] = (32, 18)
    quiet_check(env.unwrapped)
    assert env.unwrapped.task == task
    env.close()
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("obs_mode", "control_mode"),
    [
        ("pixels", "row"),
        ("rgbd", "ee_delta"),
        ("state", "keys"),
        ("state", "joint_pos"),
        ("state", "applied"),
        ("state", "ee_pose"),
    ],
)
def test_every_mode_passes_check_env(obs_mode, control_mode):
    more = {"cameras": SMALL} if obs_mode != "state" else {}
    env = gymnasium.make(
        MUSTARD, obs_mode=obs_mode, control_mode=control_mode, render_size=(32, 18), **more
    )
    quiet_check(env.unwrapped)
    assert len(env.unwrapped.action_names) == env.action_space.shape[0]
    assert len(env.unwrapped.state_names) == env.observation_space["agent_pos"].shape[0]
    env.close()


def test_a_task_passes_check_env():
    env = gymnasium.make(MUSTARD)
    quiet_check(env.unwrapped)
    env.close()


def test_no_server_starts_before_reset():
    env = gymnasium.make(MUSTARD)
    assert env.unwrapped._server is None and env.unwrapped._client is None
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.unwrapped.step(np.zeros(12))
    env.close()


def hold_row(env):
    """The row that keeps the present pose."""
    row = np.zeros(12)
    pos = env.unwrapped._observation["agent_pos"]
    row[:9] = pos[14:23]
    row[9] = pos[12]
    return row


def test_equal_seeds_give_equal_bits_in_every_server():
    def run(env, seed):
        out = [env.reset(seed=seed)]
        for i in range(8):
            row = hold_row(env)
            row[2] += 0.01 * i
            row[10] = 0.2
            out.append(env.step(row))
        return out

    first, second = gymnasium.make(MUSTARD), gymnasium.make(MUSTARD)
    runs = [run(first, 5), run(first, 6), run(first, 5), run(second, 5)]
    for i in range(9):
        assert equal(runs[0][i][0], runs[2][i][0]) and equal(runs[0][i][0], runs[3][i][0]), i
    assert not equal(runs[0][0][0], runs[1][0][0])
    assert runs[0][3][1:4] == runs[3][3][1:4]
    first.close()
    second.close()


def test_scenario_seed_equals_that_of_the_other_programs():
    env = gymnasium.make(MUSTARD, scenario={"starts": "anywhere"})
    _, info = env.reset(options={"scenario_seed": 7, "lerobot_new_rollout": True})
    assert info["scenario_seed"] == 7
    with wheelarm.Server(task="pick_mustard", seed=7, starts="anywhere") as server:
        with server.connect() as client:
            expected = client.status().scenario
    found = env.unwrapped.client.status().scenario
    assert found.start == expected.start and found.objects == expected.objects
    assert info["instruction"] == expected.instruction == env.unwrapped.task_description
    _, info = env.reset(options={"scenario_seed": 7, "scenario": {"starts": "near"}})
    assert env.unwrapped.client.status().scenario.start != expected.start
    env.close()


def test_fields_of_one_episode_do_not_affect_the_next():
    more = {
        "person": {"body": "woman_p50", "posture": "hands_in_lap"},
        "appearance": {"seed": 3, "light": 2},
        "disturbances": {"noise": 2},
        "starts": "anywhere",
        "time_limit_seconds": 5.0,
        "style": "human",
        "imu_noise": True,
    }
    env = gymnasium.make(MUSTARD, scenario={"deformable_rate_hz": 0.0})

    def scenario(**options):
        observation, _ = env.reset(options={"scenario_seed": 7, **options})
        found = env.unwrapped.client.status().scenario
        # The server does not report whether a time limit is that of the task.
        if found.time_limit_seconds == wheelarm.TASKS["pick_mustard"]:
            found.ClearField("time_limit_seconds")
        return observation, found

    first = scenario()
    server = env.unwrapped._server
    other = scenario(scenario=more)
    assert other[1].person.body == "woman_p50" and other[1].time_limit_seconds == 5.0
    again = scenario()
    assert again[1] == first[1] and equal(again[0], first[0])
    assert env.unwrapped._server is server
    # A field that no reset can undo needs a new server.
    changed = scenario(scenario={"language": {"seed": 3}})
    assert changed[1].HasField("language")
    again = scenario()
    assert again[1] == first[1] and equal(again[0], first[0])
    env.close()


def test_persistent_field_of_a_running_server_raises(server):
    env = gymnasium.make(MUSTARD, endpoint=server.endpoint, sim=server.sim)
    _, before = env.reset(seed=0), env.unwrapped.client.status().scenario
    env.reset(seed=0, options={"scenario": {"language": {"seed": 3}, "time_limit_seconds": 5.0}})
    with pytest.raises(ValueError, match="language"):
        env.reset(seed=0)
    env.reset(seed=0, options={"scenario": {"language": {"seed": 3}}})
    limit = env.unwrapped.client.status().scenario.time_limit_seconds
    assert limit == wheelarm.TASKS["pick_mustard"] and not before.time_limit_seconds
    env.close()


def test_privileged_state_equals_the_scenario():
    env = gymnasium.make(MUSTARD)
    observation, info = env.reset(seed=1)
    names, values = env.unwrapped.privileged_names, observation["privileged_state"]
    scenario = env.unwrapped.client.status().scenario
    placed = {one.name: one.pose.position for one in scenario.objects}["mustard"]
    target = [values[names.index(f"target.{axis}")] for axis in "xyz"]
    assert np.allclose(target, [placed.x, placed.y, placed.z], atol=0.02)
    chair = [values[names.index(f"chair.{axis}")] for axis in "xy"]
    assert np.allclose(chair, [scenario.start.position.x, scenario.start.position.y], atol=0.01)
    assert observation["agent_pos"][23:].tolist() == [0, 0, 1, 0]
    assert info["is_success"] is False and info["conditions"] and info["failure"] == ""
    env.close()


def test_invalid_actions_raise_and_the_episode_continues():
    env = gymnasium.make(MUSTARD)
    env.reset(seed=0)
    for wrong in (np.zeros(11), np.full(12, np.nan), np.zeros(12)):
        with pytest.raises(ValueError):
            env.step(wrong)
    assert env.step(hold_row(env))[4]["tick"] == 24
    env.close()


def test_hand_moves_by_the_commanded_step():
    env = gymnasium.make(MUSTARD, control_mode="ee_delta")
    observation, _ = env.reset(seed=0)
    before = observation["agent_pos"][14:17]
    up = np.zeros(9)
    up[2] = 0.5
    for _ in range(10):
        observation = env.step(up)[0]
    for _ in range(5):
        observation = env.step(np.zeros(9))[0]
    translation = observation["agent_pos"][14:17] - before
    # Ten steps of 0.1 s at half the maximum speed, 0.5 m/s.
    assert np.allclose(translation, [0, 0, 0.25], atol=0.02), translation
    env.close()


def test_keys_drive_and_close_the_gripper():
    env = gymnasium.make(MUSTARD, control_mode="keys")
    observation, _ = env.reset(seed=0)
    for _ in range(10):
        observation = env.step([2, 0, 0, 1])[0]
    row = dict(zip(env.unwrapped.state_names, observation["agent_pos"], strict=True))
    assert row["odometry.x"] > 0.02 and row["knuckle.position"] > 0.2
    env.close()


def test_time_limit_truncates():
    env = gymnasium.make(MUSTARD, scenario={"time_limit_seconds": 0.5})
    env.reset(seed=0)
    for _ in range(10):
        _, reward, terminated, truncated, info = env.step(hold_row(env))
        if terminated or truncated:
            break
    assert (terminated, truncated, info["failure"], reward) == (False, True, "timeout", 0.0)
    assert 0.4 < info["elapsed"] < 0.7
    env.close()


def test_environment_uses_a_running_server(server):
    env = gymnasium.make(MUSTARD, endpoint=server.endpoint, sim=server.sim)
    _, info = env.reset(options={"scenario_seed": 2})
    assert env.unwrapped._server is None and info["scenario_seed"] == 2
    env.close()
    assert server.process.poll() is None
    with server.connect() as client:
        assert client.status().holder == "" and not client.status().HasField("episode")


def test_error_for_an_invalid_argument_lists_valid_values():
    for wrong, text in (
        ({"obs_mode": "smell"}, "pixels"),
        ({"control_mode": "mind"}, "ee_delta"),
        ({"reward_mode": "kind"}, "dense"),
        ({"control_rate": 7}, "divide"),
        ({"render_mode": "human"}, "rgb_array"),
        ({"obs_mode": "pixels", "cameras": {"gen3": (0, 4)}}, "width"),
    ):
        with pytest.raises(ValueError, match=text):
            wheelarm.WheelArmEnv("pick_mustard", **wrong)
    env = wheelarm.WheelArmEnv("pick_the_moon")
    with pytest.raises(wheelarm.NoServerError, match="pick_the_moon"):
        env.reset()


FORK = """
import sys
import gymnasium
import wheelarm

def one():
    return gymnasium.make("wheelarm:wheelarm/PickMustard-v0")

if __name__ == "__main__":
    env = one()
    env.reset(seed=0)
    try:
        envs = gymnasium.vector.AsyncVectorEnv([one] * 2, context=sys.argv[1])
        print("reset", envs.reset(seed=0)[0]["agent_pos"].shape)
        envs.close()
    except wheelarm.ForkedError as error:
        print("forked", error)
    env.close()
"""


@pytest.mark.parametrize(
    ("context", "output"),
    [("fork", "forkserver"), ("forkserver", "reset (2, 27)"), ("spawn", "reset (2, 27)")],
)
def test_fork_after_a_connection_raises_and_does_not_hang(context, output, tmp_path):
    script = tmp_path / "fork.py"
    script.write_text(FORK)
    found = subprocess.run(
        [sys.executable, str(script), context],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert output in found.stdout, found
    assert ("forked" in found.stdout) == (context == "fork"), found


def hold_all(observation):
    rows = np.zeros((len(observation["agent_pos"]), 12), np.float32)
    rows[:, :9] = observation["agent_pos"][:, 14:23]
    rows[:, 9] = observation["agent_pos"][:, 12]
    return rows


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_vector_environment_equals_gymnasiums(mode):
    more = {"scenario": {"time_limit_seconds": 0.55}}
    ours = gymnasium.make_vec(
        "wheelarm:" + MUSTARD,
        num_envs=2,
        vectorization_mode="vector_entry_point",
        autoreset_mode=mode,
        **more,
    )
    assert ours.metadata["autoreset_mode"] is mode
    theirs = gymnasium.make_vec(
        MUSTARD,
        num_envs=2,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": mode},
        **more,
    )
    a, b = ours.reset(seed=[3, 9]), theirs.reset(seed=[3, 9])
    assert equal(a[0], b[0])
    over = 0
    for _ in range(14):
        rows = hold_all(a[0])
        a, b = ours.step(rows), theirs.step(rows)
        assert equal(a[0], b[0])
        for i in (1, 2, 3):
            assert np.array_equal(a[i], b[i])
        assert a[4].keys() == b[4].keys()
        over += int(a[3].sum())
    assert over >= 4
    assert ours.call("task_description")[0]
    ours.close()
    theirs.close()


def test_seed_that_is_not_an_integer_raises():
    env = wheelarm.WheelArmEnv("pick_mustard")
    for bad in (1.5, "7", float("nan")):
        with pytest.raises(ValueError, match=r"scenario_seed=.*: it must be an integer"):
            env.reset(options={"scenario_seed": bad})
    assert env._client is None
    with pytest.raises(ValueError, match=r"control_rate=7\.5: it must be an integer"):
        wheelarm.WheelArmEnv("pick_mustard", control_rate=7.5)


def test_environment_continues_after_its_server_died_and_keeps_no_closed_subscription():
    envs = wheelarm.WheelArmVectorEnv(2, task="pick_mustard", control_mode="keys")
    envs.reset(seed=1)
    dead, alive = (env.unwrapped for env in envs.envs)
    opened = len(alive.client._open)
    for seed in range(3):
        alive.reset(seed=seed)
        assert len(alive.client._open) == opened
    envs.reset(seed=2)
    dead._server.process.kill()
    dead._server.process.wait()
    rest = np.zeros((2, 4), np.int64)
    _, _, terminated, truncated, info = envs.step(rest)
    assert truncated.tolist() == [True, False]
    assert not terminated.any()
    assert info["failure"][0] == "server"
    # The next step resets the dead environment, in a new server.
    observation, _, terminated, truncated, _ = envs.step(rest)
    assert not truncated.any()
    assert not terminated.any()
    assert np.isfinite(observation["agent_pos"]).all()
    # `reset` notices a dead server at once.
    dead._server.process.kill()
    dead._server.process.wait()
    dead.reset(seed=3)
    dead.step(rest[0])
    envs.close()
