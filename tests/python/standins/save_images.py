"""Replacement for WheelArm-Sim's step, written from its description: every image as PNG, depth in
grey between its smallest and largest value."""

from google.colab import drive
drive.mount('/content/drive')

import os
import struct
import zlib

import h5py
import numpy as np

HEIGHT, WIDTH = 36, 64


def png(pixels):
    height, width = pixels.shape[:2]
    colour = 2 if pixels.ndim == 3 else 0
    lines = b"".join(b"\0" + line.tobytes() for line in pixels)

    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    head = struct.pack(">IIBBBBB", width, height, 8, colour, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(lines)) + chunk(b"IEND", b"")


def grey(metres):
    finite = metres[np.isfinite(metres)]
    low, high = finite.min(), finite.max()
    return np.where(np.isfinite(metres), (metres - low) / max(high - low, 1e-6) * 255, 255).astype(np.uint8)


for n in range(1, 21):
    folder = f'/content/drive/MyDrive/data/organization/picking/pick_mustard/Experiment{n}'
    if not os.path.exists(folder):
        continue
    with h5py.File(f"{folder}/experiment{n}.hdf5") as file:
        for kind in ("rgb", "depth"):
            for camera in ("gen3", "wheelchair"):
                os.mkdir(f"{folder}/{camera}_{kind}")
                for number, sample in file["data"].items():
                    bytes_ = sample[f"processed_data_cameras_{kind}_{camera}"][...].astype(np.uint8)
                    if kind == "rgb":
                        image = bytes_.reshape(HEIGHT, WIDTH, 3)
                    else:
                        image = grey(bytes_.view("<f4").reshape(HEIGHT, WIDTH))
                    with open(f"{folder}/{camera}_{kind}/frame_{number}.png", "wb") as out:
                        out.write(png(image))
