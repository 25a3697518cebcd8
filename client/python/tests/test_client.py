"""The client against a real server."""

from __future__ import annotations

import socket
import time

import numpy as np
import pytest

import wheelarm
from wheelarm import v1


def test_queries_return_replies_and_rejections_have_a_code(client):
    status = client.status()
    assert status.scenario.task == "pick_mustard"
    assert status.scenario.pacing == v1.PACING_LOCK_STEP
    assert {task.name for task in client.tasks()} >= set(wheelarm.TASKS)
    scene = client.scene()
    assert scene.target in scene.objects and scene.robot.joints
    sampled = client.reset(task="pick_bowl", seed=7)
    assert (sampled.task, sampled.seed) == ("pick_bowl", 7) and sampled.instruction
    with pytest.raises(wheelarm.RefusedError, match="episode") as refused:
        client.stop_episode()
    assert refused.value.code == v1.FAILURE_CODE_NO_EPISODE
    assert refused.value.reason == "NO_EPISODE"
    with pytest.raises(wheelarm.RefusedError) as refused:
        client.reset(task="pick_the_moon")
    assert "pick_the_moon" in str(refused.value)
    with pytest.raises(ValueError, match="available"):
        client.reset(sed=7)
    with pytest.raises(ValueError, match="pacing"):
        client.reset(pacing="fastest")


def test_reach_reports_whether_a_pose_is_reachable(client):
    home = client.scene().robot.home_positions
    with client.lockstep("me", topics=["pose"]) as episode:
        hand = episode.now.message("pose").frames[-1].pose
        assert client.reach(hand, near_joints=home).reachable
        far = v1.Pose(position=v1.Vector3(x=9.0), orientation=v1.Quaternion(w=1.0))
        reply = client.reach(far)
        assert not reply.reachable and reply.problem == v1.REACH_PROBLEM_TOO_FAR


def test_error_without_a_server_contains_the_fix():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    with pytest.raises(wheelarm.NoServerError, match="wheelarm-server"):
        wheelarm.connect(endpoint, timeout=0.3)
    with pytest.raises(ValueError, match="letters"):
        wheelarm.connect(sim="a/b")
    with pytest.raises(ValueError, match="endpoint"):
        wheelarm.connect("nonsense", timeout=0.3)


def test_error_for_an_unknown_name_lists_the_servers(server):
    with pytest.raises(wheelarm.OtherNameError, match=server.sim):
        wheelarm.connect(server.endpoint, sim="unknown", timeout=0.5)


def test_chair_drives_the_commanded_distance_in_lock_step(client):
    client.reset(task="pick_mustard", seed=1)
    with client.lockstep("me", "drive") as episode:
        assert episode.now.tick == 0 and episode.episode >= 1
        for _ in range(30):
            moment = episode.step(wheelarm.command(linear=0.3, over_ticks=6))
        assert moment.tick == 30 * 24 and moment.stamp == pytest.approx(3.0)
        odometry = moment.samples["odometry"].arrays()
        assert odometry["pose"].shape == (7,) and 0.4 < odometry["pose"][0] < 0.9
        stopped = episode.stop()
    counts = {one.stream: one.count for one in stopped.manifest}
    assert counts["clock"] == 30 * 6 + 1
    assert stopped.cause == v1.END_CAUSE_REQUESTED


def test_rejected_command_raises_and_the_tick_can_be_answered_again(client):
    with client.lockstep("me") as episode:
        with pytest.raises(wheelarm.RefusedError, match="NaN") as refused:
            episode.step(wheelarm.command(linear=float("nan")))
        assert refused.value.reason == "INVALID"
        assert episode.step(wheelarm.command(hold=True)).tick == 4


def test_one_commander_holds_control_and_releases_it(server, client):
    with server.connect() as other:
        first = client.commander("anna")
        with pytest.raises(wheelarm.RefusedError, match="anna") as refused:
            other.commander("bert")
        assert refused.value.code == v1.FAILURE_CODE_CONTROL_HELD
        taken = other.commander("bert", take=True)
        assert client.status().holder == "bert"
        taken.close()
        first.close()
        assert client.status().holder == ""


def test_samples_arrive_in_order_with_the_clock_of_a_tick_last(client):
    topics = ["joint_state", "pose", "clock"]
    with client.streams(*topics) as streams, client.lockstep("me", topics=[]) as episode:
        for _ in range(4):
            episode.step(wheelarm.command(hold=True))
        received = []
        while (sample := streams.next(timeout=0.5)) is not None:
            if sample.header.episode == episode.episode:
                received.append((sample.tick, sample.topic))
    assert received == sorted(received, key=lambda one: (one[0], topics.index(one[1]) == 2))
    assert [tick for tick, topic in received if topic == "clock"] == [0, 4, 8, 12, 16]
    with pytest.raises(ValueError, match="joint_state"):
        client.streams("joint_sate")


def test_images_of_a_tick_have_the_instance_ids_of_the_scene():
    cameras = {"gen3": (96, 54, 10.0), "room": (96, 54, 20.0)}
    with (
        wheelarm.Server(task="pick_mustard", seed=3, pacing="lock-step", cameras=cameras) as server,
        server.connect() as client,
    ):
        legend = {one.id for one in client.scene().instances}
        with pytest.raises(ValueError, match="gen3"):
            client.camera("gen4")
        with client.lockstep("me", cameras=["gen3", "room"]) as episode:
            for _ in range(3):
                moment = episode.step(wheelarm.command(linear=0.2, over_ticks=3))
                assert moment.frames["room"].tick == moment.tick
                assert moment.frames["gen3"].tick == moment.tick - moment.tick % 24
        frame = moment.frames["room"]
        assert frame.color.shape == (54, 96, 3) and frame.depth.shape == (54, 96)
        assert set(np.unique(frame.segmentation)) - {0} <= legend and len(np.unique(frame.segmentation)) > 3
        assert np.isfinite(frame.depth).mean() > 0.5 and frame.depth.min() > 0.0


def test_lost_image_is_requested_again():
    with (
        wheelarm.Server(
            task="pick_mustard", pacing="lock-step", cameras={"gen3": (64, 36, 10.0)}
        ) as server,
        server.connect() as client,
        client.lockstep("me", cameras=["gen3"]) as episode,
    ):
        lost, put = [], episode._queue.put

        class Lossy:
            """The queue, which drops the next image."""

            get = episode._queue.get

            @staticmethod
            def put(item):
                if item[0] == "camera/gen3" and not lost:
                    lost.append(item)
                else:
                    put(item)

        for subscriber in episode._subscribers:
            subscriber.undeclare()
        episode._subscribers, episode._queue = [], Lossy
        for topic in ("clock", "refusal", "episode_stop"):
            episode._subscribe(topic, client._topic_key(topic))
        episode._subscribe("camera/gen3", client._key("camera/gen3"))
        moment = episode.step(wheelarm.command(over_ticks=6))
        assert lost and moment.frames["gen3"].tick == moment.tick == 24
        assert episode.step(wheelarm.command(over_ticks=6)).frames["gen3"].tick == 48


def test_sample_of_another_session_is_dropped():
    with (
        wheelarm.Server(task="pick_mustard", pacing="lock-step") as server,
        server.connect() as client,
        client.lockstep("me", topics=["joint_state"]) as episode,
    ):
        for over_ticks in (1, 6):
            episode.send(wheelarm.command(over_ticks=over_ticks))
            # The server has published and waits; then the forged sample arrives last.
            while client.status().header.tick < episode.now.tick + 4 * over_ticks:
                time.sleep(0.01)
            client._session.put(client._topic_key("joint_state"), b"noise")
            time.sleep(0.1)
            moment = episode.receive()
            assert moment.message("joint_state").header.tick == moment.tick


def test_commander_drives_in_real_time_and_lock_step_commands_are_rejected():
    with wheelarm.Server(task="pick_mustard", pacing="real-time") as server:
        with server.connect() as client, client.commander("me") as me:
            with client.streams("odometry") as streams:
                for sample in streams:
                    me.send(linear=0.2, angular=0.0)
                    if sample.message.pose.position.x > 0.02:
                        break
            me.check()
            with client.streams("refusal") as refusals:
                me.send(linear=0.2, over_ticks=6)
                assert refusals.next(timeout=20.0) is not None
            with pytest.raises(wheelarm.RefusedError, match="lock-step"):
                me.check()


def test_closed_client_raises(server):
    client = server.connect()
    streams = client.streams("clock")
    client.close()
    client.close()
    with pytest.raises(wheelarm.GoneError):
        streams.next(timeout=1.0)
    with pytest.raises(wheelarm.GoneError):
        client.status()


def test_commands_from_plain_numbers_are_checked():
    for wrong, text in (
        ({"joints": [1.0] * 5}, "5 numbers, expected 6"),
        ({"joints": [0.0] * 6, "hold": True}, "several targets"),
        ({"opening": 0.1, "knuckle": 0.1}, "two targets"),
        ({"pose": [0.0] * 7, "frame": "moon"}, "moon"),
        ({"device": "mind"}, "mind"),
    ):
        with pytest.raises(ValueError, match=text):
            wheelarm.command(**wrong)
    step = wheelarm.command(step=[0, 0, 0.1, 0, 0, 0], frame="house")
    assert step.arm.step.HasField("rotation") and step.arm.step.translation.z == 0.1
