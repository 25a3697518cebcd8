"""Checks an episode file with plain h5py and the documented layout.

Usage: check_episode.py FILE [EXPECTED.json]
Exit code 0 when the whole file is readable and consistent. With a second argument, compares
data sets with the JSON file: {"dataset path": {"shape": [...], "sum": number}}.
"""

import json
import sys

import h5py
import numpy as np

ROOT = [
    "format", "schema_version", "label", "instruction", "task", "activity",
    "area", "seed", "success", "failure_reason", "complete", "partial",
    "problems", "samples_expected", "samples_received", "samples_missed",
    "samples_recovered", "server_version", "recorder_version", "adapter",
    "quality", "pacing", "depth_unit", "run_id", "episode",
    "physics_version",
]
STREAMS = {
    "joint_state": {"position": (16,), "velocity": (16,), "effort": (16,), "opening": ()},
    "pose": {"pose": (7, 7), "twist": (7, 6)},
    "imu": {"orientation": (4,), "angular_velocity": (3,), "linear_acceleration": (3,)},
    "clock": {"real_time_factor": ()},
    "odometry": {"pose": (7,), "twist": (6,)},
    "applied": {"joint_position": (6,), "wheel_velocity": (2,), "message": ()},
    "command": {"arm": (7,), "base": (2,), "gripper": (3,), "message": ()},
    "contact": {"pad_force": (2,), "point": (16, 3), "force": (16, 3)},
    "evaluation": {"success": (), "elapsed": ()},
    "phase": {"label": (), "phase": (), "name": ()},
    "state_hash": {"hash": ()},
}
problems = []


def check(condition, text):
    if not condition:
        problems.append(text)


def dataset(data, count):
    """Checks length, attributes and filters of a dataset, and reads all of it."""
    name = data.name
    check(data.shape[0] == count, f"{name} has {data.shape[0]} samples, expected {count}")
    check("units" in data.attrs, f"{name} lacks units")
    check("frame" in data.attrs, f"{name} lacks a frame")
    check(data.compression in ("gzip", None), f"{name} has the filter {data.compression}")
    if data.shape[0] == 0 or 0 in data.shape:
        return
    if len(data.shape) > 2 and data.chunks is not None and data.chunks[0] == 1:
        for i in range(data.shape[0]):
            data[i]
    else:
        data[...]


def group(g):
    stamps = g["stamp_nanos"][...]
    sequence = g["sequence"][...]
    check(stamps.dtype == np.uint64, f"{g.name}/stamp_nanos is {stamps.dtype}")
    check(bool(np.all(sequence[1:] > sequence[:-1])), f"{g.name}: sequence does not increase")
    check(bool(np.all(stamps[1:] >= stamps[:-1])), f"{g.name}: timestamps decrease")
    for key in ("expected", "received", "missed", "recovered"):
        check(key in g.attrs, f"{g.name} lacks the attribute {key}")
    check(int(g.attrs["received"]) == len(stamps), f"{g.name}: received differs from the length")
    for data in g.values():
        dataset(data, len(stamps))
    return len(stamps)


def main():
    file = h5py.File(sys.argv[1], "r")
    for name in ROOT:
        check(name in file.attrs, f"lacks the root attribute {name}")
    check(isinstance(file.attrs["label"], str), "label is not a str")
    check(isinstance(file.attrs["complete"], np.bool_), "complete is not a bool")
    received = 0
    for name, columns in STREAMS.items():
        g = file["streams"][name]
        for column, shape in columns.items():
            check(g[column].shape[1:] == shape, f"{g[column].name} has shape {g[column].shape}")
    objects = file["streams/object_pose/pose"]
    check(objects.shape[1:] == (len(objects.attrs["names"]), 7), "object poses")
    for name, g in file["streams"].items():
        if name != "camera":
            received += group(g)
    for g in file["streams/camera"].values():
        received += group(g)
        if len(g["stamp_nanos"]):
            n, h, w, c = g["rgb"].shape
            check(c == 3 and g["rgb"].dtype == np.uint8, f"{g.name}/rgb")
            check(g["depth"].shape == (n, h, w), f"{g.name}/depth")
            check(g["depth"].dtype in (np.float32, np.uint16), f"{g.name}/depth")
            check(g["ids"].shape == (n, h, w) and g["ids"].dtype == np.uint16, f"{g.name}/ids")
            check(g["intrinsics"].shape == (n, 6) and g["pose"].shape == (n, 7), g.name)
            attributes = g["intrinsics"].attrs
            check(attributes.get("pixel_centre") == 0.5, f"{g.name}/intrinsics: pixel_centre differs from 0.5")
            check(attributes.get("convention", "").startswith("pixel edge"), f"{g.name}/intrinsics lack the convention")
    events = file["events"]
    for data in events.values():
        dataset(data, len(events["tick"]))
    kinds = [k.decode() for k in events["kind"][...]]
    check(kinds[0] == "started", f"the first event is {kinds[:1]}")
    received += sum(s == b"event" for s in events["source"][...])
    check(int(file.attrs["samples_received"]) == received, "samples_received differs from the sum")
    json.loads(file["scenario/text"][()])
    check(len(file["scenario/message"]) > 0, "the scenario message is empty")
    robot = file["robot"]
    check(len(robot["message"]) > 0, "the description of the robot is empty")
    check(list(robot.attrs["joints"]) == list(file["streams/joint_state/position"].attrs["names"]), "joints of the robot")
    check(len(robot.attrs["arm_joints"]) == 6 and robot.attrs["arm_mount"].shape == (7,), "arm of the robot")
    initial = file["initial_state"]
    check(initial["snapshot"].dtype == np.uint8, "the snapshot does not have bytes")
    check(len(initial["assets/path"]) == len(initial["assets/text"]), "assets")
    check(len(initial["instances/id"]) == len(initial["instances/name"]), "instances")

    if len(sys.argv) > 2:
        with open(sys.argv[2], encoding="utf-8") as text:
            expected = json.load(text)
        for path, expected_data in expected.items():
            data = file[path][...]
            check(list(data.shape) == expected_data["shape"], f"{path} has shape {data.shape}")
            total = int(data.astype(np.uint64).sum() % 2**53)
            check(total == expected_data["sum"], f"{path} sums to {total}, expected {expected_data['sum']}")
    for problem in problems:
        print(problem)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
