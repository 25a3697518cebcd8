"""Runs WheelArm-Sim's processing scripts on our files.

run_original_scripts.py SCRIPTS SAMPLES.hdf5 FINAL.csv WORK

SCRIPTS    folder with WheelArm-Sim's Data_Processing/*.py
SAMPLES    an episode from `wheelarm dataset export --format wheelarm-sim`, at 1280x720
           as the scripts expect; it is moved into WORK
FINAL      the same episode's final_data.csv from `--format csv`
WORK       an empty folder

Copies the scripts and adapts the parts that are specific to one machine, printing every change:
folders before `organization/`, and the number or the range of experiments, of which there is
one. The scripts were saved from Google Colab and mount a drive, so WORK has a module
`google.colab` that mounts nothing. The experiment is number 6, for which the script states the
label counts (249 rows). Then the scripts run in their order, each output is counted, and the
final table is compared with ours.
Exit code 77 when a requirement is missing.
"""

import ast
import csv
import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import h5py

NUMBER = 6
ROWS = 249
TRIAL = Path("organization/picking/pick_mustard") / f"Experiment{NUMBER}"
# Script and its outputs: file or folder, columns, rows or images.
STEPS = [
    ("hdf5_to_csv.py", [(f"experiment{NUMBER}.csv", 57, None)]),
    ("save_images.py", [(f, None, ROWS) for f in ("wheelchair_rgb", "gen3_rgb", "gen3_depth", "wheelchair_depth")]),
    ("clean__the_csv.py", [("data_cleaned.csv", 57, ROWS)]),
    ("syn_analysis.py", [("synchronise_analysis.csv", 72, ROWS), ("timesheet.csv", 38, ROWS)]),
    ("synchronization.py", [("synchronised_data.csv", 113, ROWS)]),
    ("final_data_and_label.py", [("final_data.csv", 117, ROWS)]),
]
# The scripts compute velocities of bodies from positions, and start the clock at 0; labels are
# typed counts, frames and trials are numbers.
NOT_COMPARED = re.compile(r"(robot_arm_.*|wheelchair)_vel_[xyz]|instructions|trial_id|image_frame_id|state_labels")


def skip(why):
    print(f"skipped: {why}")
    sys.exit(77)


def adapt(name, text, work):
    """Adapts the parts of a script that are specific to one machine."""

    def folder(match):
        changed = f"{match[1]}{work}/organization/"
        if match[0] != changed:
            print(f"{name}: {match[0]} -> {changed}")
        return changed

    text = re.sub(r"""((?<![\w])[rfRF]{0,2}["'])[^"'\n]*?organization[/\\]+""", folder, text)

    def experiments(changed):
        def replace(match):
            if match[0] != changed:
                print(f"{name}: {match[0]} -> {changed}")
            return changed

        return replace

    text = re.sub(r"range\(\s*1\s*,\s*(?:20|21)\s*\)", experiments(f"range({NUMBER}, {NUMBER + 1})"), text)
    return re.sub(r"^n = \d+$", experiments(f"n = {NUMBER}"), text, flags=re.M)


def mount_nothing(work):
    """Writes a `google.colab` that mounts nothing."""
    google = work / "google"
    (google / "colab").mkdir(parents=True)
    # Other modules of the name `google` remain importable.
    (google / "__init__.py").write_text('__path__ = __import__("pkgutil").extend_path(__path__, __name__)\n')
    (google / "colab/__init__.py").write_text(
        "class drive:\n    @staticmethod\n    def mount(where, *args, **more):\n"
        '        print(f"nothing is mounted at {where}")\n'
    )


def modules(name, text):
    """Full names of the modules that a script imports."""
    found = set()
    for node in ast.walk(ast.parse(text, name)):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.add(node.module)
    return sorted(found)


def is_there(module):
    """Whether a module can be found by its full name: `google` may exist without
    `google.colab`."""
    try:
        return importlib.util.find_spec(module) is not None
    except ModuleNotFoundError:
        return False


def first_samples(source, target):
    """Moves the file (gigabytes) and keeps the first ROWS samples, as if the recorder had stopped
    then."""
    source.rename(target)
    with h5py.File(target, "r+") as file:
        count = len(file["data"])
        if count < ROWS:
            sys.exit(f"{source} has {count} samples, the scripts' label counts need {ROWS}")
        for number in range(ROWS + 1, count + 1):
            del file[f"data/{number}"]


def table(path):
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    return rows[0], rows[1:]


def check(path, columns, rows):
    if columns is None:
        found = len(list(path.glob("frame_*.png")))
        assert found == rows, f"{path} has {found} images, expected {rows}"
        return f"{found} images"
    head, body = table(path)
    assert len(head) == columns, f"{path} has {len(head)} columns, expected {columns}"
    # The first table ends with two empty rows for the groups "data" and "/".
    assert len(body) == rows or (rows is None and len(body) == ROWS + 2), f"{path} has {len(body)} rows, expected {rows}"
    return f"{len(head)} columns, {len(body)} rows"


def compare(theirs, ours):
    """Greatest difference of the columns that both make of the same samples."""
    (names, rows), (our_names, our_rows) = table(theirs), table(ours)
    assert names == our_names, f"columns differ: {[p for p in zip(names, our_names) if p[0] != p[1]][:3]}"
    # Ours may have dropped rows at the ends where WheelArm-Sim keeps them: both
    # begin at the same sample, found by the chair's and the arm's pose.
    start = [float(v) for v in rows[0][:49]]
    distance = [max(abs(float(r[k]) - start[k]) for k in range(49)) for r in our_rows]
    first = distance.index(min(distance))
    worst = (0.0, "")
    count = min(len(rows), len(our_rows) - first)
    assert count > ROWS // 2, f"only {count} rows in common"
    clock = names.index("sim_time")
    for k, name in enumerate(names):
        if NOT_COMPARED.fullmatch(name):
            continue
        zero = float(our_rows[first][k]) if k == clock else 0.0
        for i in range(count):
            worst = max(worst, (abs(float(rows[i][k]) - float(our_rows[first + i][k]) + zero), f"{name}, row {i + 1}"))
    assert worst[0] < 1e-6, f"the final tables differ by {worst[0]} in {worst[1]}"
    print(f"final_data.csv: {count} rows as in ours, largest difference {worst[0]:.1e}")


def main():
    scripts, samples, final, work = (Path(a).resolve() for a in sys.argv[1:])
    missing = [name for name, _ in STEPS if not (scripts / name).is_file()]
    if missing:
        skip(f"{scripts} lacks {', '.join(missing)}")
    (work / TRIAL).mkdir(parents=True)
    mount_nothing(work)
    sys.path[0] = str(work)
    # Plots need no display.
    environment = {**os.environ, "MPLBACKEND": "Agg"}
    first_samples(samples, work / TRIAL / f"experiment{NUMBER}.hdf5")
    for name, outputs in STEPS:
        text = (scripts / name).read_text()
        for module in modules(name, text):
            if not is_there(module):
                skip(f"{name} imports {module}, which {sys.executable} does not have")
        (work / name).write_text(adapt(name, text, work))
        done = subprocess.run([sys.executable, name], cwd=work, env=environment, capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(f"{name} ends with {done.returncode}:\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}")
        for output, columns, rows in outputs:
            print(f"{name}: {output}: {check(work / TRIAL / output, columns, rows)}", flush=True)
    compare(work / TRIAL / "final_data.csv", final)


if __name__ == "__main__":
    main()
