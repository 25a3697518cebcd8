"""A LeRobot export with videos, read by LeRobot: every picture asked for is that
of the recording, by each of its decoders, and so is depth where it reads depth.

Usage: check_videos.py [--language] DATA_SET RECORDING...
Prints PSNR in dB (mean over the pictures of a camera) and depth errors in mm.
"""

import importlib
import json
import sys
from importlib.metadata import version
from pathlib import Path

import h5py
import numpy as np
import torch

LEAST_DB = 38.0     # mean over a camera's pictures
WORST_DB = 30.0     # of one picture: another one, or one shifted, is far below
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
    """What the robot saw: the newest picture of a sensor of the camera that had
    arrived by then, or the exact colour of that instant. LeRobot gives times as 32
    bits: half a tick is let go."""
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
                    picture = item[key].numpy()
                    if feature["info"]["is_depth_map"]:
                        depth = source(file, camera.removesuffix("_depth"), "depth", nanos).astype(float)
                        assert picture.shape == (1, *depth.shape), picture.shape
                        read, seen = picture[0], (depth >= 10) & (depth <= 10_000)
                        # No return reads as the least depth there is.
                        assert (read[depth == 0] == 10).all(), (key, row, np.unique(read[depth == 0]))
                        off, far = np.abs(read - depth)[seen], depth[seen] / 1e3
                        # LeRobot rounds to millimetres at the end.
                        assert (off <= HALF_STEP * (far + 3.5) + 0.51).all(), (key, off.max())
                        found.setdefault(key, []).append(off)
                    else:
                        colour = source(file, camera, "rgb", nanos)
                        picture = (picture * 255).round().transpose(1, 2, 0)
                        assert picture.shape == colour.shape, picture.shape
                        found.setdefault(key, []).append(decibel(picture, colour))
        for key, values in found.items():
            if videos[key]["info"]["is_depth_map"]:
                off = np.concatenate(values)
                words = f"off by {off.mean():.2f} mm in the mean, {off.max():.2f} mm at most"
            else:
                assert np.mean(values) >= LEAST_DB and min(values) >= WORST_DB, (key, np.mean(values), min(values))
                words = f"{np.mean(values):.2f} dB in the mean, {min(values):.2f} dB at least"
            print(f"lerobot {version('lerobot')} {backend} {key}: {words}")
    # A window of rows at once, as a policy asks for it.
    step = 1 / info["fps"]
    key = next(iter(videos))
    data = reader()("local/wheelarm", root=root, delta_timestamps={key: [-step, 0.0, step]})
    assert data[5][key].shape[0] == 3
    # Lists of what is said differ in length: LeRobot's training keeps them as lists.
    collate = importlib.import_module("lerobot.utils.collate").lerobot_collate_fn if language else None
    batch = next(iter(torch.utils.data.DataLoader(data, batch_size=4, shuffle=True, collate_fn=collate)))
    assert batch[key].shape[:2] == (4, 3)
    if language:
        assert new, "LeRobot reads language from 0.6 on"
        said = [row for i in range(len(data)) for row in data.hf_dataset[i]["language_events"]]
        always = data.hf_dataset[0]["language_persistent"]
        styles = {row["style"] for row in [*said, *always]}
        assert {"plan", "subtask", "vqa", "trace"} <= styles, styles
        print(f"lerobot {version('lerobot')} reads {len(always)} persistent rows and {len(said)} events: {', '.join(sorted(styles))}")


main()
