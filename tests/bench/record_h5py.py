"""Writes samples as the recorder of WheelArm-Sim does, with its layout and settings.

record_h5py.py FRAMES_FILE SAMPLES FOLDER

One group `data/N` per sample; color and depth of both cameras as lists of
bytes, which h5py stores as int64, gzip level 4; 16 joints, 7 poses, 7
velocities, 3 IMU quantities, times, desired pose and the sentence as small
datasets: 60 in all. FRAMES_FILE is the `frames.bin` of the example `dump_frames`.
"""

import os
import sys
import time
from pathlib import Path

import h5py
import numpy as np

WIDTH, HEIGHT = 1280, 720
PIXELS = WIDTH * HEIGHT
PAIR = 2 * 8 * PIXELS
JOINTS = (
    [f"{end}_{side}_wheel_joint" for end in ("back", "front") for side in ("left", "right")]
    + [f"joint_{i}" for i in range(1, 7)]
    + [
        "left_inner_knuckle_finger_tip_joint",
        "right_inner_knuckle_finger_tip_joint",
        "robotiq_85_left_finger_tip_joint",
        "robotiq_85_left_knuckle_joint",
        "robotiq_85_right_finger_tip_joint",
        "robotiq_85_right_knuckle_joint",
    ]
)
FRAMES = (
    "wheelchair shoulder bicep forearm spherical_wrist_1 spherical_wrist_2 end_effector"
).split()

frames, samples = Path(sys.argv[1]), int(sys.argv[2])
path = Path(sys.argv[3]) / f"original_{os.getpid()}.hdf5"
distinct = frames.stat().st_size // PAIR


def make_sample(number):
    """The values that WheelArm-Sim's callbacks collect: lists and numbers."""
    random = np.random.default_rng(number)
    stamp = number / 10
    cache = {}
    for name in JOINTS:
        key = f"processed_data_joint_state_{name}"
        cache[key] = [stamp, *random.normal(size=2)]
        cache[f"{key}_joint_name"] = name
    for name in FRAMES:
        cache[f"processed_data_cartesian_pose_{name}"] = [stamp, *random.normal(size=7)]
        cache[f"processed_data_cartesian_velocity_{name}"] = [stamp, *random.normal(size=3)]
    cache["processed_data_imu_orientation"] = [stamp, *random.normal(size=4)]
    cache["processed_data_imu_linear_acceleration"] = [stamp, *random.normal(size=3)]
    cache["processed_data_imu_angular_velocity"] = [stamp, *random.normal(size=3)]
    cache["processed_data_timesteps"] = stamp
    cache["processed_data_desired_pose"] = list(random.normal(size=7))
    cache["instructions"] = "Turn right, go to the coffee table, and pick up the mustard"
    with open(frames, "rb") as file:
        file.seek(number % distinct * PAIR)
        for camera in ("gen3", "wheelchair"):
            for kind, size in (("rgb", 3), ("depth", 4)):
                key = f"processed_data_cameras_{kind}_{camera}"
                cache[key] = file.read(size * PIXELS)
                cache[f"{key}time"] = stamp
            file.seek(PIXELS, os.SEEK_CUR)  # ids are not in its layout
    return cache


prepared = [make_sample(i) for i in range(min(samples, distinct))]
spent, cpu = time.perf_counter(), time.process_time()
with h5py.File(path, "w") as file:
    data = file.create_group("data")
    for number in range(samples):
        group = data.create_group(str(number + 1))
        for key, value in prepared[number % len(prepared)].items():
            if isinstance(value, bytes):
                value = list(value)
            if isinstance(value, (float, str)):
                group.create_dataset(key, data=value)
            else:
                group.create_dataset(key, data=value, compression="gzip", compression_opts=4)
spent, cpu = time.perf_counter() - spent, time.process_time() - cpu
size = path.stat().st_size
path.unlink()
print(f"h5py {h5py.__version__}, WheelArm-Sim's layout")
print(f"frames                   {samples} pairs of 1280x720 RGB and depth")
print(f"file bytes per frame     {size / samples * 1e-6:.2f} MB")
print(f"until the file is there  {samples / spent:.2f} frames/s ({cpu / samples:.2f} s of CPU each)")
