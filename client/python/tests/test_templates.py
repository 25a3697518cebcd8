"""Templates of `wheelarm new` in Python: the axes of an input device become commands."""

from __future__ import annotations

import pathlib
import struct
import types

import pytest

TEMPLATES = pathlib.Path(__file__).resolve().parents[2] / "cli/templates"


def load(name: str) -> types.ModuleType:
    if not TEMPLATES.is_dir():
        pytest.skip("the templates are part of a checkout")
    text = (TEMPLATES / name).read_text().replace("NAME", "mine")
    module = types.ModuleType("mine")
    exec(compile(text, name, "exec"), module.__dict__)
    return module


def test_device_converts_axes_to_one_step_per_control_tick():
    device = load("device/device.py")
    driver = device.Driver()
    axes = dict.fromkeys(device.AXES, 0.0) | {"x": 0.6, "rz": 0.3, "forward": 0.2, "close": 3.0}
    command = driver.command(list(axes.values()))
    assert command.arm.step.translation.x == pytest.approx(0.01)
    assert command.arm.step.rotation.z == pytest.approx(0.005)
    assert command.base.linear == pytest.approx(0.2)
    assert command.gripper.knuckle == pytest.approx(0.05)
    for _ in range(60):
        command = driver.command(list(axes.values()))
    assert command.gripper.knuckle == pytest.approx(0.8)
    # At rest the arm keeps its target.
    rest = driver.command([0.0] * len(device.AXES))
    assert rest.arm.WhichOneof("target") is None and rest.base.linear == 0.0


def test_joystick_reads_events_and_notices_that_it_is_gone(tmp_path):
    device = load("device/device.py")
    path = tmp_path / "js0"
    events = [(-32767, 2, 1), (500, 2, 0), (1, 1, 4), (32767, 0x82, 3), (1, 1, 9)]
    path.write_bytes(b"".join(struct.pack("IhBB", 0, *event) for event in events))
    stick = device.Joystick(str(path))
    with pytest.raises(SystemExit, match="joystick is gone"):
        stick.read()
    assert stick.axes["forward"] == pytest.approx(0.4)
    assert stick.axes["left"] == 0.0
    assert stick.axes["close"] == pytest.approx(0.8)
    assert stick.axes["y"] == pytest.approx(-0.1)


def test_policy_returns_the_rows_after_the_most_similar_step(tmp_path):
    h5py, np = pytest.importorskip("h5py"), pytest.importorskip("numpy")
    policy = load("policy/policy.py")
    steps, size = 5, (policy.HEIGHT, policy.WIDTH, 3)
    with h5py.File(tmp_path / "rows.hdf5", "w") as file:
        demo = file.create_group("data/demo_0")
        demo["actions_raw"] = np.arange(steps * 12.0).reshape(steps, 12)
        demo["states"] = np.linspace(0.0, 1.0, steps)[:, None] * np.ones((1, 27))
        for camera in policy.CAMERAS:
            demo[f"obs/{camera}_image"] = np.zeros((steps, *size), np.uint8)
    mine = policy.Policy(str(tmp_path / "rows.hdf5"))
    spec = mine.spec()
    assert [camera.name for camera in spec.cameras] == list(policy.CAMERAS)
    images = {camera: np.zeros(size, np.uint8) for camera in policy.CAMERAS}
    seen = types.SimpleNamespace(images=[images], state=np.full(27, 0.26))
    (rows,) = mine.infer([seen])
    assert rows.shape == (policy.CHUNK, 12)
    assert rows[0].tolist() == list(range(12, 24)) and rows[-1].tolist() == list(range(48, 60))
