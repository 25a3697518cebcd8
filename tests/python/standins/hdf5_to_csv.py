"""Replacement for WheelArm-Sim's step, written from its description: one row per sample, arrays as
text, without images. Like a Google Colab notebook it mounts a drive and numbers its experiment."""

from google.colab import drive
drive.mount('/content/drive')

n = 1

import csv

import h5py

FOLDER = f'/content/drive/MyDrive/data/organization/picking/pick_mustard/Experiment{n}/'
IMAGES = [f"processed_data_cameras_{kind}_{camera}" for kind in ("rgb", "depth") for camera in ("gen3", "wheelchair")]


def row(group, name):
    cells = {"Group Name": name}
    for key, item in group.items():
        if isinstance(item, h5py.Dataset) and key not in IMAGES:
            value = item[()]
            cells[key] = value.tolist() if hasattr(value, "tolist") else value
    return cells


with h5py.File(f"{FOLDER}experiment{n}.hdf5") as file:
    samples = file["data"]
    rows = [row(samples[k], f"data/{k}") for k in sorted(samples, key=int)]
    rows += [row(samples, "data"), row(file, "/")]
head = sorted({key for cells in rows for key in cells})
with open(f"{FOLDER}experiment{n}.csv", "w", newline="") as out:
    table = csv.DictWriter(out, head, restval="")
    table.writeheader()
    table.writerows(rows)
