"""Renders the exported home in MuJoCo: two cameras 1280x720, color and depth.

render_mujoco.py DIR MODE [PNG]

MODE `renderer`: mujoco.Renderer, first color, then depth, as in its manual;
`single`: the lower-level functions, both from one pass;
`plain`: the same without shadows.
"""

import os
import sys
import time
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")
import mujoco
import numpy as np

WIDTH, HEIGHT, CAMERAS, WARM = 1280, 720, 2, 3
folder, mode = Path(sys.argv[1]), sys.argv[2]
model = mujoco.MjModel.from_xml_path(str(folder / "render.xml"))
data = mujoco.MjData(model)
poses = np.fromfile(folder / "poses.f64").reshape(-1, model.nmocap, 7)


def place(pair):
    data.mocap_pos[:] = poses[pair, :, :3]
    data.mocap_quat[:] = poses[pair, :, 3:]
    mujoco.mj_forward(model, data)


if mode == "renderer":
    renderer = mujoco.Renderer(model, HEIGHT, WIDTH, max_geom=model.ngeom + 100)

    def draw(camera):
        renderer.update_scene(data, camera=camera)
        color = renderer.render()
        renderer.enable_depth_rendering()
        depth = renderer.render()
        renderer.disable_depth_rendering()
        return color, depth

else:
    context = mujoco.GLContext(WIDTH, HEIGHT)
    context.make_current()
    gpu = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
    mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, gpu)
    scene = mujoco.MjvScene(model, maxgeom=model.ngeom + 100)
    scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = int(mode == "single")
    scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = 0
    option, rect = mujoco.MjvOption(), mujoco.MjrRect(0, 0, WIDTH, HEIGHT)
    eye = mujoco.MjvCamera()
    eye.type = mujoco.mjtCamera.mjCAMERA_FIXED
    near = model.vis.map.znear * model.stat.extent
    far = model.vis.map.zfar * model.stat.extent
    raw = np.empty((HEIGHT, WIDTH, 3), np.uint8), np.empty((HEIGHT, WIDTH), np.float32)

    def draw(camera):
        eye.fixedcamid = camera
        mujoco.mjv_updateScene(
            model, data, option, None, eye, mujoco.mjtCatBit.mjCAT_ALL, scene
        )
        mujoco.mjr_render(rect, scene, gpu)
        mujoco.mjr_readPixels(raw[0], raw[1], rect, gpu)
        depth = near / (1.0 - raw[1] * np.float32(1.0 - near / far))
        return raw[0][::-1].copy(), depth[::-1].copy()


times = []
for pair in range(-WARM, len(poses)):
    if pair == 0:
        process = time.process_time()
    begin = time.perf_counter()
    place(max(pair, 0))
    images = [draw(camera) for camera in range(CAMERAS)]
    if pair >= 0:
        times.append((time.perf_counter() - begin) * 1e3)
process = (time.process_time() - process) / len(times) * 1e3
times = np.array(times)
if len(sys.argv) > 3:
    import struct
    import zlib

    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    for camera, (color, depth) in enumerate(images):
        rows = b"".join(b"\0" + row.tobytes() for row in color)
        with open(f"{sys.argv[3]}_{camera}.png", "wb") as file:
            file.write(b"\x89PNG\r\n\x1a\n")
            file.write(chunk(b"IHDR", struct.pack(">IIBBBBB", WIDTH, HEIGHT, 8, 2, 0, 0, 0)))
            file.write(chunk(b"IDAT", zlib.compress(rows, 1)) + chunk(b"IEND", b""))
        print(f"camera {camera}: depth {depth.min():.2f} to {np.median(depth):.2f} (median)")
print(
    f"MuJoCo {mujoco.__version__} {mode}, {int(model.mesh_facenum.sum())} triangles in "
    f"{model.nmesh} meshes, {model.ngeom} geoms: min {times.min():.1f} ms, median "
    f"{np.median(times):.1f} ms, {process:.1f} ms of CPU"
)
