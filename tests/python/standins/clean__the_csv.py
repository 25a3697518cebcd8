"""Replacement for WheelArm-Sim's step, written from its description: converts bytes to text and
removes rows with an empty cell."""

from google.colab import drive
drive.mount('/content/drive')

import csv
import os

for n in range(1, 21):
    folder = f'/content/drive/MyDrive/data/organization/picking/pick_mustard/Experiment{n}'
    if not os.path.exists(folder):
        continue
    with open(f"{folder}/experiment{n}.csv", newline="") as text:
        head, *rows = csv.reader(text)
    plain = [[c[2:-1] if c.startswith("b'") else c for c in row] for row in rows]
    with open(f"{folder}/data_cleaned.csv", "w", newline="") as out:
        table = csv.writer(out)
        table.writerow(head)
        table.writerows(row for row in plain if all(c.strip() for c in row))
