"""Checks a LeRobot export with videos in LeRobot: with each of its decoders, every image equals
that of the recording, and depth too if LeRobot reads it.

Usage: check_videos.py [--language] DATA_SET RECORDING...
Prints PSNR in dB (mean over the images of a camera) and depth errors in mm.
"""

import importlib
import json
import sys
from importlib.metadata import version
from pathlib import Path

import h5py
import numpy as np
import torch

LEAST_DB = 38.0     # mean over the images of a camera
WORST_DB = 30.0     # of one image: a wrong or shifted image is far below
HALF_STEP = 0.165   # of LeRobot's 12-bit codes, mm per m of depth and shift (3.5 m)
ROWS = 24           # of each episode


def reader():
    for module in ("lerobot.datasets.lerobot_dataset", "lerobot.datasets"):
        found = getattr(importlib.import_module(module), "LeRobotDataset", None)
        if found:
            return found
    raise SystemExit("lerobot has no LeRobotDataset")


def stamps(stream):
    return stream["stamp_nanos"][...].astype(np.int64)


def source(file, camera, what, nanos):
    """Expected image: the newest image of a sensor of the camera that had arrived, or the exact
    color at that time. LeRobot's 32-bit times need a tolerance of half a tick."""
    nanos += 2_000_000
    for sensor in file.get("streams/sensor", {}).values():
        name = sensor.attrs["camera"]
        name = name.decode() if isinstance(name, bytes) else name
        if name == camera and what in sensor:
            return sensor[what][np.searchsorted(stamps(sensor), nanos, side="right") - 1]
    assert what == "rgb", f"{camera} has no depth sensor"
    exact = file[f"streams/camera/{camera}"]
    return exact["rgb"][np.searchsorted(stamps(exact), nanos, side="right") - 1]


def decibel(a, b):
    return 10 * np.log10(255**2 / max(np.mean((a.astype(float) - b) ** 2), 1e-9))


def main():
    arguments = sys.argv[1:]
    language = "--language" in arguments
    root, *paths = [a for a in arguments if not a.startswith("--")]
    root, new = Path(root), tuple(map(int, version("lerobot").split(".")[:2])) >= (0, 6)
    files = {}
    for path in paths:
        file = h5py.File(path)
        label = file.attrs["label"]
        files[label.decode() if isinstance(label, bytes) else label] = file
    info = json.loads((root / "meta/info.json").read_text())
    videos = {k: f for k, f in info["features"].items() if f["dtype"] == "video"}
    assert videos, "no videos"
    for backend in ("torchcodec", "pyav"):
        data = reader()("local/wheelarm", root=root, video_backend=backend)
        assert len(data) == info["total_frames"]
        found = {}
        for episode in data.meta.episodes:
            file = files[episode["recording"]]
            rows = np.linspace(episode["dataset_from_index"], episode["dataset_to_index"] - 1, ROWS)
            for row in np.random.default_rng(0).permutation(rows.round().astype(int)):
                item = data[int(row)]
                nanos = round(float(item["simulation_time"]) * 1e9)
                for key, feature in videos.items():
                    camera = key.removeprefix("observation.images.")
                    image = item[key].numpy()
                    if feature["info"]["is_depth_map"]:
                        depth = source(file, camera.removesuffix("_depth"), "depth", nanos).astype(float)
                        assert image.shape == (1, *depth.shape), image.shape
                        read, valid = image[0], (depth >= 10) & (depth <= 10_000)
                        # Pixels without depth are read as the smallest depth.
                        assert (read[depth == 0] == 10).all(), (key, row, np.unique(read[depth == 0]))
                        off, far = np.abs(read - depth)[valid], depth[valid] / 1e3
                        # LeRobot rounds to millimetres at the end.
                        assert (off <= HALF_STEP * (far + 3.5) + 0.51).all(), (key, off.max())
                        found.setdefault(key, []).append(off)
                    else:
                        color = source(file, camera, "rgb", nanos)
                        image = (image * 255).round().transpose(1, 2, 0)
                        assert image.shape == color.shape, image.shape
                        found.setdefault(key, []).append(decibel(image, color))
        for key, values in found.items():
            if videos[key]["info"]["is_depth_map"]:
                off = np.concatenate(values)
                text = f"error {off.mean():.2f} mm mean, {off.max():.2f} mm maximum"
            else:
                assert np.mean(values) >= LEAST_DB and min(values) >= WORST_DB, (key, np.mean(values), min(values))
                text = f"{np.mean(values):.2f} dB mean, {min(values):.2f} dB minimum"
            print(f"lerobot {version('lerobot')} {backend} {key}: {text}")
    # A window of rows, as requested by policies.
    step = 1 / info["fps"]
    key = next(iter(videos))
    data = reader()("local/wheelarm", root=root, delta_timestamps={key: [-step, 0.0, step]})
    assert data[5][key].shape[0] == 3
    # Language columns differ in length: LeRobot's training keeps them as lists.
    collate = importlib.import_module("lerobot.utils.collate").lerobot_collate_fn if language else None
    batch = next(iter(torch.utils.data.DataLoader(data, batch_size=4, shuffle=True, collate_fn=collate)))
    assert batch[key].shape[:2] == (4, 3)
    if language:
        assert new, "LeRobot reads language from 0.6 on"
        events = [row for i in range(len(data)) for row in data.hf_dataset[i]["language_events"]]
        always = data.hf_dataset[0]["language_persistent"]
        styles = {row["style"] for row in [*events, *always]}
        assert {"plan", "subtask", "vqa", "trace"} <= styles, styles
        print(f"lerobot {version('lerobot')} reads {len(always)} persistent rows and {len(events)} events: {', '.join(sorted(styles))}")


main()
