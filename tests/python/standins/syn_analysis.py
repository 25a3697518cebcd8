"""Replacement for WheelArm-Sim's step, written from its description: a column for the timestamp of
every topic."""

from google.colab import drive
drive.mount('/content/drive')

import ast
import csv
import os

for n in range(1, 21):
    folder = f'/content/drive/MyDrive/data/organization/picking/pick_mustard/Experiment{n}'
    if not os.path.exists(folder):
        continue
    with open(f"{folder}/data_cleaned.csv", newline="") as text:
        rows = list(csv.DictReader(text))
    for row in rows:
        for key in [k for k in row if k.endswith("_joint_name") or k in ("instructions", "processed_data_desired_pose")]:
            del row[key]
        for key in [k for k, cell in row.items() if cell.startswith("[")]:
            stamp, *values = ast.literal_eval(row[key])
            row[key] = values
            row[key.replace("processed_data_", "timestep_")] = stamp
    stamps = [k for k in rows[0] if k.startswith("timestep_") or k.endswith("time") or k.endswith("timesteps")]
    for name, columns in (("synchronise_analysis", list(rows[0])), ("timesheet", stamps)):
        with open(f"{folder}/{name}.csv", "w", newline="") as out:
            table = csv.DictWriter(out, columns, extrasaction="ignore")
            table.writeheader()
            table.writerows(rows)
