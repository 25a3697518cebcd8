"""Steps the exported robot in MuJoCo under the same controls as our world.

step_mujoco.py DIR [SUBSTEPS]

Elliptic friction cones with impratio 10 (what a grasp needs), implicitfast,
Newton solver. Each tick of 1/240 s has SUBSTEPS steps, default 1; our settings
for data use four.
"""

import sys
import time
from pathlib import Path

import mujoco
import numpy as np

folder = Path(sys.argv[1])
model = mujoco.MjModel.from_xml_path(str(folder / "step.xml"))
substeps = int(sys.argv[2]) if len(sys.argv) > 2 else 1
model.opt.timestep /= substeps
data = mujoco.MjData(model)
targets = np.fromfile(folder / "targets.f64").reshape(-1, model.nu)
for i in range(6):
    data.qpos[model.joint(f"joint_{i + 1}").qposadr[0]] = targets[0, i]

times = np.empty(len(targets))
contacts = 0
processor = time.process_time()
for tick, control in enumerate(targets):
    data.ctrl[:] = control
    begin = time.perf_counter()
    mujoco.mj_step(model, data, substeps)
    times[tick] = time.perf_counter() - begin
    contacts += data.ncon
processor = (time.process_time() - processor) / len(times) * 1e6
times *= 1e6
bottle = data.body("mustard").xpos
hand = data.body("bracelet_link").xpos
reach = np.linalg.norm(bottle - hand)
print(
    f"MuJoCo {mujoco.__version__}, {len(times)} ticks of {substeps} steps: median {np.median(times):.1f} us "
    f"(mean {times.mean():.1f}, least {times.min():.1f}, 95 % {np.quantile(times, 0.95):.1f}); "
    f"processor time {processor:.1f} us per tick; "
    f"{model.nbody} bodies, {model.nv} degrees of freedom, {contacts / len(times):.0f} contacts\n"
    f"at the end the bottle is {bottle[2]:.2f} m high, {reach:.2f} m from the bracelet"
)
