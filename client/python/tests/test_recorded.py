"""Samples received in Python equal those in the recording, one by one."""

from __future__ import annotations

import subprocess
import threading

import numpy as np
import pytest

import wheelarm
from wheelarm import _contract

h5py = pytest.importorskip("h5py", reason="recorded files are HDF5")


def recorder_program():
    try:
        return wheelarm.find_program("wheelarm")
    except wheelarm.NoServerError:
        neighbor = wheelarm.find_program().with_name("wheelarm")
        assert neighbor.is_file(), (
            "the recorder `wheelarm` is neither on PATH nor next to the server"
        )
        return neighbor


#: Every stream whose messages become columns of a recording.
TOPICS = [
    name
    for name, key, *_ in _contract.TOPICS
    if key.startswith("stream/") and "{" not in key and name != "event"
]


def test_streams_and_images_equal_the_recording(tmp_path):
    cameras = {"gen3": (64, 36, 10.0), "wheelchair": (64, 36, 10.0)}
    with (
        wheelarm.Server(
            task="place_teddy_bear", seed=2, pacing="lock-step", cameras=cameras
        ) as server,
        server.connect() as client,
        client.streams(*TOPICS) as streams,
        client.camera("gen3", queue_size=1000) as gen3,
        client.camera("wheelchair", queue_size=1000) as wheelchair,
    ):
        recorder = subprocess.Popen(
            [
                recorder_program(),
                "record",
                "--connect",
                server.endpoint,
                "--sim",
                server.sim,
                "--out",
                tmp_path,
                "--episodes",
                "1",
            ],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        with client.lockstep("me", "both", recorders=1) as episode:
            for i in range(10):
                episode.step(
                    wheelarm.command(linear=0.2, angular=0.1 * i, knuckle=0.02 * i, over_ticks=6)
                )
            number, stopped = episode.episode, episode.stop()
        # The recorder's output must not fill the pipe.
        output: list[str] = []
        reader = threading.Thread(target=lambda: output.extend(recorder.stdout), daemon=True)
        reader.start()
        assert recorder.wait(60) == 0, output
        wanted = {one.stream: one.count for one in stopped.manifest}
        received: dict[str, list[wheelarm.Sample]] = {topic: [] for topic in TOPICS}
        while (sample := streams.next(timeout=2.0)) is not None:
            if sample.header.episode == number:
                received[sample.topic].append(sample)
            if all(len(received[topic]) == wanted.get(topic, 0) for topic in TOPICS):
                break
        images = {}
        for camera in (gen3, wheelchair):
            frames = []
            while (frame := camera.next(timeout=0.5)) is not None:
                if frame.header.episode == number:
                    frames.append(frame)
            images[frames[0].camera] = frames
    compared = 0
    with h5py.File(tmp_path / "both.h5") as file:
        for topic in TOPICS:
            group, samples = file["streams"][topic], received[topic]
            assert len(samples) == wanted.get(topic, 0) == len(group["tick"]), topic
            for name in ("tick", "sequence", "stamp_nanos"):
                assert [getattr(one.header, name) for one in samples] == group[name][:].tolist()
            columns = [sample.arrays() for sample in samples]
            for name in columns[0] if columns else ():
                if name in group:
                    ours = np.array([column[name] for column in columns])
                    assert np.array_equal(ours, group[name][:], equal_nan=True), (topic, name)
                    compared += 1
        for camera, frames in images.items():
            group = file["streams/camera"][camera]
            assert len(frames) == wanted[f"camera/{camera}"] == 11
            for name, plane in (("rgb", "color"), ("depth", "depth"), ("ids", "segmentation")):
                ours = np.array([getattr(frame, plane) for frame in frames])
                assert np.array_equal(ours, group[name][:]), (camera, name)
                compared += 1
            poses = np.array([wheelarm.pose(frame.pose) for frame in frames])
            assert np.array_equal(poses, group["pose"][:])
    assert compared >= 30, compared
