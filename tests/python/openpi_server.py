"""A policy with openpi's protocol and the message code of the real `openpi-client`: it checks the
observations and holds the robot. It ends after COUNT observations of an episode.

    python openpi_server.py PORT_FILE COUNT [roboarena]
"""

import os
import sys
from pathlib import Path

import numpy as np
import websockets.sync.server
from openpi_client import image_tools, msgpack_numpy

HAND, KNUCKLE, ROWS = slice(14, 23), 12, 10


def infer(observation, roboarena):
    image = observation["observation/image"]
    assert image.shape == (224, 224, 3) and image.dtype == np.uint8, (image.shape, image.dtype)
    assert observation["observation/wrist_image"].shape == (224, 224, 3)
    state = observation["observation/state"]
    assert state.shape == (27,) and state.dtype == np.float32, (state.shape, state.dtype)
    assert isinstance(observation["prompt"], str) and observation["prompt"]
    # The image is centred, as by openpi's own clients.
    inner = image[49:175]
    assert inner.any() and not image[:49].any() and not image[175:].any()
    again = image_tools.resize_with_pad(inner, 224, 224)
    assert np.array_equal(again, image)
    if roboarena:
        assert observation["session_id"], observation.keys()
    row = np.concatenate([state[HAND], [state[KNUCKLE], 0, 0]]).astype(np.float32)
    return np.tile(row, (ROWS, 1))


def main():
    port_file, count, roboarena = Path(sys.argv[1]), int(sys.argv[2]), "roboarena" in sys.argv
    observations, resets = [], []

    def handle(connection):
        packer = msgpack_numpy.Packer()
        metadata = {"image_resolution": (224, 224), "needs_session_id": True} if roboarena else {"name": "hold"}
        connection.send(packer.pack(metadata))
        for message in connection:
            observation = msgpack_numpy.unpackb(message)
            if roboarena and observation["endpoint"] == "reset":
                resets.append(observation["session_id"])
                connection.send("reset successful")
                continue
            observations.append(observation)
            if len(observations) > count:
                connection.send("Traceback (most recent call last):\nRuntimeError: that is enough")
                connection.close()
                server.shutdown()
                return
            rows = infer(observation, roboarena)
            connection.send(packer.pack(rows if roboarena else {"actions": rows, "server_timing": {"infer_ms": 1.0}}))

    server = websockets.sync.server.serve(handle, "127.0.0.1", 0, compression=None, max_size=None)
    port_file.write_text(str(server.socket.getsockname()[1]))
    server.serve_forever()
    assert len(observations) == count + 1 and bool(resets) == roboarena, (len(observations), resets)
    print(f"{count} observations were read by openpi-client's own code, {len(resets)} resets", flush=True)
    # Threads of websockets 17 that wait for the peer would keep the program alive.
    os._exit(0)


main()
