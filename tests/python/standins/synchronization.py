"""Replacement for WheelArm-Sim's step, written from its description: linear interpolation to the
timestamps of the gen3 images, number by number."""

from google.colab import drive
drive.mount('/content/drive')

import ast
import csv
import os

import numpy as np

for n in range(1, 21):
    folder = f'/content/drive/MyDrive/data/organization/picking/pick_mustard/Experiment{n}'
    if not os.path.exists(folder):
        continue
    with open(f"{folder}/synchronise_analysis.csv", newline="") as text:
        rows = list(csv.DictReader(text))
    reference = np.array([float(row["processed_data_cameras_rgb_gen3time"]) for row in rows])
    columns = {}
    for stamp in (k for k in rows[0] if k.startswith("timestep_")):
        topic = stamp.replace("timestep_", "processed_data_")
        values = np.array([ast.literal_eval(row[topic]) for row in rows])
        time = np.array([float(row[stamp]) for row in rows])
        for i, series in enumerate(values.T):
            columns[f"{topic}{i}"] = np.interp(reference, time, series)
    columns["sim_time"] = reference
    with open(f"{folder}/synchronised_data.csv", "w", newline="") as out:
        table = csv.writer(out)
        table.writerow(columns)
        table.writerows([repr(float(v)) for v in row] for row in zip(*columns.values()))
