"""Replacement for WheelArm-Sim's step, written from its description: names and order of the final
table, velocities from positions, labels from typed counts."""

from google.colab import drive
drive.mount('/content/drive')
n = 4

import csv

import numpy as np

FOLDER = f'/content/drive/MyDrive/data/organization/picking/pick_mustard/Experiment{n}'
LABELS = [0] * 100 + [1] * 60 + [2] * 20 + [3] * 69
BODIES = "bicep end_effector forearm shoulder spherical_wrist_1 spherical_wrist_2 wheelchair".split()

with open(f"{FOLDER}/synchronised_data.csv", newline="") as text:
    head, *rows = csv.reader(text)
with open(f"{FOLDER}/data_cleaned.csv", newline="") as text:
    sentences = [row["instructions"] for row in csv.DictReader(text)]
data = dict(zip(head, np.array(rows, float).T))
time = data["sim_time"] - data["sim_time"][0]

order = []
for body in BODIES:
    prefix = "wheelchair_" if body == "wheelchair" else f"robot_arm_{body}_"
    parts = "pos_x pos_y pos_z quat_x quat_y quat_z quat_w".split()
    order += [(prefix + part, data[f"processed_data_cartesian_pose_{body}{i}"]) for i, part in enumerate(parts)]
for name, place in [(name, place) for name, place in order if "_pos_" in name]:
    speed = np.concatenate([[0.0], np.diff(place) / np.diff(time)])
    order.append((name.replace("_pos_", "_vel_"), speed))
for topic, short, axes in (("angular_velocity", "gyro", "xyz"), ("linear_acceleration", "accel", "xyz"), ("orientation", "quat", "xyzw")):
    order += [(f"imu_{short}_{a}", data[f"processed_data_imu_{topic}{i}"]) for i, a in enumerate(axes)]
topic = "processed_data_joint_state_"
for joint in dict.fromkeys(k[len(topic):-1] for k in head if k.startswith(topic)):
    order += [(f"{joint}_pos", data[f"{topic}{joint}0"]), (f"{joint}_vel", data[f"{topic}{joint}1"])]
order.append(("sim_time", time))

with open(f"{FOLDER}/final_data.csv", "w", newline="") as out:
    table = csv.writer(out)
    table.writerow([name for name, _ in order] + ["instructions", "trial_id", "image_frame_id", "state_labels"])
    for i, label in enumerate(LABELS):
        table.writerow([repr(float(column[i])) for _, column in order] + [sentences[i], n, i + 1, label])
