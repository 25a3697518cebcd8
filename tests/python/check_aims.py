"""Checks the auxiliary task of `client/learn/python`, locating objects: pixels shift with the
images, the loss selects the cell, and served policies do not contain the head.

    python tests/python/check_aims.py     # needs torch, numpy, safetensors
"""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np
import torch
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

sys.path.insert(0, str(Path(__file__).parents[2] / "client/learn/python"))

import keypoint_targets
import policy_file
from episodes import LAYOUT, Episodes, find_files
from network import Policy, Shape

HEIGHT, WIDTH, PADDED = 126, 224, (128, 224)


def check_shift():
    """A painted pixel is at its position plus the returned offset."""
    source = Episodes.__new__(Episodes)
    at = {"gen3": (40, 71), "wheelchair": (90, 20)}  # row and column
    source.cameras = [(name, (HEIGHT, WIDTH)) for name in at]
    source.device = torch.device("cpu")
    source.images = {name: torch.zeros((1, HEIGHT, WIDTH, 3), dtype=torch.uint8) for name in at}
    for name, (row, column) in at.items():
        source.images[name][0, row, column] = 255
    torch.manual_seed(1)
    images, offsets = source.padded_images(torch.zeros(64, dtype=torch.long), PADDED, 16)
    assert offsets.amin() < -8 and offsets.amax() > 8
    for number, (row, column) in enumerate(at.values()):
        for image, offset in zip(images[:, number, ..., 0], offsets[:, number]):
            (found,) = image.nonzero().tolist()
            assert found == [row + offset[1].item(), column + offset[0].item()], (found, offset)


def check_loss():
    """The loss is smallest for the right cell and position; absent points have no loss and finite
    gradients."""
    shape = Shape(dim=8, heads=2, cameras=2)
    torch.manual_seed(2)
    head = keypoint_targets.KeypointHead(shape, torch.zeros(2, 3), torch.ones(2, 3))
    rows, columns = grid = (4, 7)
    memory = torch.zeros(1, 3 + 2 * rows * columns, 8, requires_grad=True)
    positions = torch.tensor([[[-0.8, 0.1, 0.4], [float("nan")] * 3]])
    # In the second camera in cell 2, 5, a quarter of a cell right of its centre.
    pixels = torch.full((1, 2, 2, 2), float("nan"))
    pixels[0, 1, 0] = torch.tensor([(5 + 0.75) * keypoint_targets.CELL, (2 + 0.5) * keypoint_targets.CELL])
    pixels[0, 0, 0] = torch.tensor([-40.0, 10.0])  # outside the image of the first camera
    with torch.no_grad():
        for layer in (head.space, head.cell, head.offset):
            layer.weight.zero_()
            layer.bias.zero_()
        head.space.weight[:3, 0] = positions[0, 0]
        head.cell.weight[:, 1] = 1.0
        head.cell.bias.fill_(-9.0)
        head.offset.weight[0, 1] = 0.25 / 18

        def loss_at(row, column):
            out = torch.zeros_like(memory)
            out[0, 1, 0] = 1.0
            out[0, 3 + rows * columns + row * columns + column, 1] = 18.0
            return head.loss(out, grid, positions, pixels).item()

        right, wrong = loss_at(2, 5), loss_at(2, 4)
    assert right < 0.01 < 1.0 < wrong, (right, wrong)
    loss = head.loss(memory, grid, positions, pixels)
    loss.backward()
    assert torch.isfinite(loss) and torch.isfinite(memory.grad).all()
    nothing = head.loss(memory.detach(), grid, torch.full_like(positions, float("nan")), pixels)
    assert nothing.item() == 0.0, nothing


def check_served_policy():
    """A served policy lacks the head; a policy for further training has it."""
    shape = Shape(state=3, action=2, chunk=4, dim=8, heads=2, feedforward=8, width=2, group_channels=1, vae_layers=1)
    network = Policy(shape)
    network.aims = keypoint_targets.KeypointHead(shape, torch.zeros(2, 3), torch.ones(2, 3))
    with tempfile.TemporaryDirectory() as folder:
        for training in (False, True):
            path = Path(folder) / "one.safetensors"
            policy_file.write(path, network.state_dict(), {"network": shape.to_dict()}, training=training)
            state, _ = policy_file.read(path)
            assert any(name.startswith("aims.") for name in state) == training


def write_episode(path, task, area, target, objects, rows, expert=True):
    """Writes an episode in which every number of object k in row r is 100 k + r."""
    about = {
        "layout": LAYOUT, "task": task, "area": area, "thing": target, "thing_names": objects, "success": True, "seed": 1,
        "rate_hz": 10, "robot": "whill", "action": "next-pose", "action_names": ["hand.x", "knuckle.target"],
        "state_names": ["hand.x"], "instruction": f"get the {target}",
    }  # fmt: skip
    numbers = 100.0 * np.arange(len(objects)).repeat(7) + np.arange(rows)[:, None]
    own = objects.index(target) * 7
    aim_rows = np.full((rows, 14), np.nan)
    aim_rows[:, :7] = numbers[:, own : own + 7]
    tensors = {
        "states": np.zeros((rows, 1)), "actions": np.arange(rows * 2).reshape(rows, 2),
        "aims": aim_rows, "things": numbers.reshape(rows, 7 * len(objects)),
    }  # fmt: skip
    tensors = {name: np.ascontiguousarray(array, np.float32) for name, array in tensors.items()}
    tensors["incident"] = np.zeros(rows, np.uint8)
    tensors["expert"] = np.full(rows, expert, np.uint8)
    for camera in ("gen3", "wheelchair"):
        tensors[f"pictures.{camera}"] = np.zeros((rows, 2, 4, 3), np.uint8)
    save_file(tensors, path, {"wheelarm": json.dumps(about)})


def check_other_tasks():
    """A row with another object of the area has a sentence for it, its position, and no actions.
    Objects of other areas are excluded."""
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        table = ["bowl", "cup", "tin"]
        write_episode(folder / "a.safetensors", "pick_cup", "table", "cup", table, 5)
        write_episode(folder / "b.safetensors", "pick_tin", "table", "tin", table, 4)
        write_episode(folder / "c.safetensors", "pick_bowl", "sink", "bowl", table, 3)
        write_episode(folder / "d.safetensors", "pick_tin", "table", "tin", table, 0)
        # Its target differs between scenes: no sentence of it fits another scene.
        write_episode(folder / "f.safetensors", "pick_any", "table", "bowl", table, 1)
        write_episode(folder / "g.safetensors", "pick_any", "table", "tin", table, 1)
        write_episode(folder / "e.safetensors", "pick_tin", "table", "tin", table, 2, expert=False)
        cameras = [("gen3", (2, 4)), ("wheelchair", (2, 4))]
        cpu = torch.device("cpu")
        episodes = Episodes(find_files([folder]), cameras, cpu, cpu, aims=14, objects=True)
    vocabulary = ["<unknown>", "get", "the", "bowl", "cup", "tin"]
    episodes.set_sentences(vocabulary, ["pick_*"])
    rows = torch.arange(episodes.total).repeat(200)
    torch.manual_seed(3)
    other_tasks = episodes.sample_other_tasks(rows, 0.5)
    assert episodes.tasks == ["pick_any: ambiguous", "pick_bowl", "pick_cup", "pick_tin"]
    by_row = [set(other_tasks[rows == row].tolist()) for row in range(episodes.total)]
    # The bowl is the only object of its area.
    assert by_row == [{-1, 3}] * 5 + [{-1, 2}] * 4 + [{-1}] * 3 + [{-1, 2, 3}, {-1, 2}], by_row
    share = (other_tasks[rows < 9] >= 0).float().mean().item()
    assert 0.45 < share < 0.55, share

    _, _, is_pad, words = episodes.numbers(rows, 2, True, other_tasks)
    aim_rows = episodes.aim_rows(rows, other_tasks)
    for row, other, pads, sentence, aims in zip(rows.tolist(), other_tasks.tolist(), is_pad, words, aim_rows):
        episode = sum(row >= first for first in (5, 9, 12, 13))
        own, first = [(1, 0), (2, 5), (0, 9), (0, 12), (2, 13)][episode]  # index of the object; first row
        expected = own if other < 0 else other - 1
        assert vocabulary[sentence[2]] == table[expected] or (episode > 2 and other < 0), (row, other, sentence)
        assert aims[:7].tolist() == [100.0 * expected + row - first] * 7
        assert aims[7:].isnan().all()
        assert pads.all() == (other >= 0), (row, other, pads)
    assert torch.equal(episodes.aim_rows(rows).nan_to_num(), episodes.aims[rows].nan_to_num())
    # Tasks without shared sentences are excluded.
    episodes.set_sentences(vocabulary, ["pick_cup"])
    assert set(episodes.sample_other_tasks(rows, 0.9)[rows < 5].tolist()) == {-1}


def write_cans(path, which, sentence, turned=0.0, rows=3, objects=True):
    """Writes an episode with four cans in a row at 1 m, can_1 at the left, rotated by `turned`
    radians about the centre of the row."""
    names = ["bowl", "can_1", "can_2", "can_3", "can_4"]
    write_episode(path, "pick_can", "shelf", f"can_{which}", names, rows)
    state, about = load_file(path), json.loads(safe_open(path, "np").metadata()["wheelarm"])
    aside = np.array([0.5, 0.3, 0.1, -0.1, -0.3])
    positions = np.zeros((rows, 5, 7), np.float32)
    positions[:, :, 0] = 1 - aside * np.sin(turned)
    positions[:, :, 1] = aside * np.cos(turned)
    positions[:, :, 2] = np.arange(5)
    state["things"] = positions.reshape(rows, 35)
    if not objects:
        del state["things"]
    save_file(state, path, {"wheelarm": json.dumps({**about, "instruction": sentence})})


def check_equal_objects():
    """Equal objects are distinguished by their position from the left: episodes with the same
    position share sentences. Ambiguous episodes keep their own sentence."""
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        write_cans(folder / "a.safetensors", 1, "take number one from the left")
        write_cans(folder / "b.safetensors", 1, "take number four from the right")
        write_cans(folder / "c.safetensors", 3, "take number three from the left", turned=0.3)
        write_cans(folder / "d.safetensors", 1, "take the nearest one")
        write_cans(folder / "e.safetensors", 2, "take number two from the left", turned=np.pi / 2)
        write_cans(folder / "f.safetensors", 4, "take number four from the left", objects=False)
        write_cans(folder / "g.safetensors", 4, "take number four from the left", rows=0)
        cameras = [("gen3", (2, 4)), ("wheelchair", (2, 4))]
        cpu = torch.device("cpu")
        files = find_files([folder])
        episodes = Episodes(files, cameras, cpu, cpu, aims=14, objects=True)
    alone = "pick_can: ambiguous"
    assert [file.request for file in files] == ["pick_can: 1 of 4", "pick_can: 1 of 4", "pick_can: 3 of 4", alone, alone, alone, alone]
    vocabulary = ["<unknown>", "one", "two", "three", "four", "left", "right", "nearest"]
    episodes.set_sentences(vocabulary, ["pick_*"])
    rows = torch.arange(episodes.total).repeat(100)
    _, _, _, words = episodes.numbers(rows, 2, True)
    sentences = [set() for _ in files]
    for row, sentence in zip(rows.tolist(), words):
        sentences[row // 3].add(" ".join(vocabulary[word] for word in sentence if word > 0))
    both = {"one left", "four right"}
    assert sentences == [both, both, {"three left"}, {"nearest one"}, {"two left"}, {"four left"}, set()], sentences
    other_tasks = episodes.sample_other_tasks(rows, 0.9)
    others = [set(other_tasks[rows == row].tolist()) for row in range(0, 18, 3)]
    assert others == [{-1, 1}, {-1, 1}, {-1, 0}, {-1, 1}, {-1}, {-1}], (others, episodes.tasks)
    # Rows with the third can have its position.
    is_third = other_tasks == 1
    assert is_third.any() and (episodes.aim_rows(rows, other_tasks)[is_third][:, 2] == 3).all()


if __name__ == "__main__":
    for check in (check_shift, check_loss, check_served_policy, check_other_tasks, check_equal_objects):
        check()
        print(f"{check.__name__}: ok")
