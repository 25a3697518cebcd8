#!/usr/bin/env python3
"""Cost of images: a test publisher, two cameras of 1280x720 with depth and ids.

    python tests/throughput.py [--seconds 20] [--rate 30] [--endpoint unixsock-stream/…]

A second process replaces a server: it publishes 7.4 MB per image and camera. This one
converts every image to numpy as users do. Prints the number of images, the missing
sequence numbers, the latency, and this process's share of a core with the transport's
threads. Exit status 1 when an image is missing.
"""

from __future__ import annotations

import argparse
import multiprocessing
import tempfile
import time

import numpy as np
import zenoh

import wheelarm
from wheelarm import _wire, v1

CAMERAS = ("gen3", "wheelchair")
SIZE = (1280, 720)


def publish(endpoint: str, rate: float, go, over) -> None:
    """Publishes the images in the place of a server."""
    config = zenoh.Config()
    for key, value in {
        "mode": '"peer"',
        "listen/endpoints": f'["{endpoint}"]',
        "scouting/multicast/enabled": "false",
        "transport/link/tx/queue/congestion_control/drop/wait_before_drop": "500000",
    }.items():
        config.insert_json5(key, value)
    session = zenoh.open(config)
    status = v1.Status(
        scenario=v1.Scenario(
            cameras=[v1.CameraSetting(name=name, rate_hz=rate) for name in CAMERAS]
        )
    )

    def answer(query) -> None:
        query.reply(query.key_expr, status.SerializeToString(), encoding=_wire.encoding("Status"))

    kept = [
        session.declare_queryable("wheelarm/bench/query/status", answer),
        session.liveliness().declare_token(f"wheelarm/bench/alive/{session.zid()}"),
    ]
    width, height = SIZE
    random = np.random.default_rng(0)
    plain = {
        "intrinsics": v1.Intrinsics(width=width, height=height, fx=900, fy=900, cx=640, cy=360),
        "color": random.integers(0, 255, width * height * 3, np.uint8).tobytes(),
        "depth": random.random(width * height, np.float32).tobytes(),
        "segmentation": random.integers(0, 99, width * height).astype("<u2").tobytes(),
        "color_format": 1,
        "depth_format": 2,
        "segmentation_format": 5,
    }
    # Encoded once without the header: fields may have any order, so it can precede the rest.
    rest = {name: v1.CameraFrame(camera=name, **plain).SerializeToString() for name in CAMERAS}
    publishers = {
        name: session.declare_publisher(
            f"wheelarm/bench/camera/{name}",
            encoding=_wire.encoding("CameraFrame"),
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.DATA_LOW,
        )
        for name in CAMERAS
    }
    go.wait()
    sequence, due = 0, time.monotonic()
    while not over.is_set():
        for name, publisher in publishers.items():
            header = v1.Header(sequence=sequence, episode=1, stamp_nanos=time.monotonic_ns())
            publisher.put(
                v1.CameraFrame(header=header).SerializeToString() + rest[name],
                source_info=zenoh.SourceInfo(session.id, sequence),
            )
        sequence += 1
        due += 1.0 / rate
        time.sleep(max(0.0, due - time.monotonic()))
    del kept
    session.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--rate", type=float, default=30.0)
    parser.add_argument("--endpoint")
    args = parser.parse_args()
    spawn = multiprocessing.get_context("spawn")
    go, over = spawn.Event(), spawn.Event()
    with tempfile.TemporaryDirectory() as folder:
        endpoint = args.endpoint or f"unixsock-stream/{folder}/bench"
        other = spawn.Process(target=publish, args=(endpoint, args.rate, go, over), daemon=True)
        other.start()
        client = wheelarm.connect(endpoint, "bench", timeout=20.0)
        cameras = {name: client.camera(name, queue_size=8) for name in CAMERAS}
        found: dict[str, list[int]] = {name: [] for name in CAMERAS}
        delays, mean = [], 0.0
        go.set()
        begun, busy = time.monotonic(), time.process_time()
        while time.monotonic() - begun < args.seconds:
            for name, camera in cameras.items():
                frame = camera.next(timeout=1.0)
                if frame is None:
                    continue
                delays.append(time.monotonic_ns() - frame.header.stamp_nanos)
                found[name].append(frame.header.sequence)
                # Reads every plane, as a user would.
                mean += float(frame.color[::64, ::64].mean() + frame.depth[::64, ::64].mean())
                assert frame.segmentation.shape == SIZE[::-1]
        wall, busy = time.monotonic() - begun, time.process_time() - busy
        over.set()
        client.close()
        other.join(10)
    missing = sum(s[-1] - s[0] + 1 - len(s) for s in found.values())
    count = sum(map(len, found.values()))
    p50, p99 = np.percentile(delays, [50, 99]) * 1e-6
    print(
        f"{count} images in {wall:.1f} s ({count / 2 / wall:.1f} Hz of each camera), {missing} "
        f"missing; latency p50 {p50:.1f} ms, p99 {p99:.1f} ms; {100 * busy / wall:.1f} % of a core"
    )
    if missing:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
