"""Where things are, as `client/learn/python` learns it: pixels go with the pictures when
these are shifted, the loss knows the cell, and nothing of it is served.

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

import aims
import policy_file
from episodes import LAYOUT, Episodes, find
from network import Policy, Shape

HEIGHT, WIDTH, PADDED = 126, 224, (128, 224)


def check_shift():
    """A pixel that is painted stands where its share of the picture says, moved."""
    source = Episodes.__new__(Episodes)
    at = {"gen3": (40, 71), "wheelchair": (90, 20)}  # row and column
    source.cameras = [(name, (HEIGHT, WIDTH)) for name in at]
    source.device = torch.device("cpu")
    source.pictures = {name: torch.zeros((1, HEIGHT, WIDTH, 3), dtype=torch.uint8) for name in at}
    for name, (row, column) in at.items():
        source.pictures[name][0, row, column] = 255
    torch.manual_seed(1)
    pictures, moved = source.seen(torch.zeros(64, dtype=torch.long), PADDED, 16)
    assert moved.amin() < -8 and moved.amax() > 8
    for number, (row, column) in enumerate(at.values()):
        for picture, move in zip(pictures[:, number, ..., 0], moved[:, number]):
            (found,) = picture.nonzero().tolist()
            assert found == [row + move[1].item(), column + move[0].item()], (found, move)


def check_loss():
    """The loss is least where the tokens tell the right cell and place; what is not
    there costs nothing and spoils no gradient."""
    shape = Shape(dim=8, heads=2, cameras=2)
    torch.manual_seed(2)
    head = aims.Aims(shape, torch.zeros(2, 3), torch.ones(2, 3))
    rows, columns = grid = (4, 7)
    memory = torch.zeros(1, 3 + 2 * rows * columns, 8, requires_grad=True)
    places = torch.tensor([[[-0.8, 0.1, 0.4], [float("nan")] * 3]])
    # In the second camera in cell 2, 5, a quarter of a cell right of its middle.
    pixels = torch.full((1, 2, 2, 2), float("nan"))
    pixels[0, 1, 0] = torch.tensor([(5 + 0.75) * aims.CELL, (2 + 0.5) * aims.CELL])
    pixels[0, 0, 0] = torch.tensor([-40.0, 10.0])  # out of the first
    with torch.no_grad():
        for layer in (head.space, head.cell, head.offset):
            layer.weight.zero_()
            layer.bias.zero_()
        head.space.weight[:3, 0] = places[0, 0]
        head.cell.weight[:, 1] = 1.0
        head.cell.bias.fill_(-9.0)
        head.offset.weight[0, 1] = 0.25 / 18

        def told(row, column):
            out = torch.zeros_like(memory)
            out[0, 1, 0] = 1.0
            out[0, 3 + rows * columns + row * columns + column, 1] = 18.0
            return head.loss(out, grid, places, pixels).item()

        right, wrong = told(2, 5), told(2, 4)
    assert right < 0.01 < 1.0 < wrong, (right, wrong)
    loss = head.loss(memory, grid, places, pixels)
    loss.backward()
    assert torch.isfinite(loss) and torch.isfinite(memory.grad).all()
    nothing = head.loss(memory.detach(), grid, torch.full_like(places, float("nan")), pixels)
    assert nothing.item() == 0.0, nothing


def check_served():
    """The policy that is written has nothing of it; what another begins from has."""
    shape = Shape(state=3, action=2, chunk=4, dim=8, heads=2, feedforward=8, width=2, group_channels=1, vae_layers=1)
    network = Policy(shape)
    network.aims = aims.Aims(shape, torch.zeros(2, 3), torch.ones(2, 3))
    with tempfile.TemporaryDirectory() as folder:
        for training in (False, True):
            path = Path(folder) / "one.safetensors"
            policy_file.write(path, network.state_dict(), {"network": shape.told()}, training=training)
            state, _ = policy_file.read(path)
            assert any(name.startswith("aims.") for name in state) == training


def write_episode(path, task, area, thing, things, rows, expert=True):
    """An episode of which every number of thing k in row r is 100 k + r."""
    about = {
        "layout": LAYOUT, "task": task, "area": area, "thing": thing, "thing_names": things, "success": True, "seed": 1,
        "rate_hz": 10, "robot": "whill", "action": "next-pose", "action_names": ["hand.x", "knuckle.target"],
        "state_names": ["hand.x"], "instruction": f"get the {thing}",
    }  # fmt: skip
    numbers = 100.0 * np.arange(len(things)).repeat(7) + np.arange(rows)[:, None]
    own = things.index(thing) * 7
    aims_of = np.full((rows, 14), np.nan)
    aims_of[:, :7] = numbers[:, own : own + 7]
    tensors = {
        "states": np.zeros((rows, 1)), "actions": np.arange(rows * 2).reshape(rows, 2),
        "aims": aims_of, "things": numbers.reshape(rows, 7 * len(things)),
    }  # fmt: skip
    tensors = {name: np.ascontiguousarray(array, np.float32) for name, array in tensors.items()}
    tensors["incident"] = np.zeros(rows, np.uint8)
    tensors["expert"] = np.full(rows, expert, np.uint8)
    for camera in ("gen3", "wheelchair"):
        tensors[f"pictures.{camera}"] = np.zeros((rows, 2, 4, 3), np.uint8)
    save_file(tensors, path, {"wheelarm": json.dumps(about)})


def check_asked():
    """Who is asked for another thing of the area hears a sentence that asks for it, is
    told where it is, and has no actions. Things of other areas are not asked for."""
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        table = ["bowl", "cup", "tin"]
        write_episode(folder / "a.safetensors", "pick_cup", "table", "cup", table, 5)
        write_episode(folder / "b.safetensors", "pick_tin", "table", "tin", table, 4)
        write_episode(folder / "c.safetensors", "pick_bowl", "sink", "bowl", table, 3)
        write_episode(folder / "d.safetensors", "pick_tin", "table", "tin", table, 0)
        # Which of two it is about differs: no sentence of it fits another scene.
        write_episode(folder / "f.safetensors", "pick_any", "table", "bowl", table, 1)
        write_episode(folder / "g.safetensors", "pick_any", "table", "tin", table, 1)
        write_episode(folder / "e.safetensors", "pick_tin", "table", "tin", table, 2, expert=False)
        cameras = [("gen3", (2, 4)), ("wheelchair", (2, 4))]
        cpu = torch.device("cpu")
        episodes = Episodes(find([folder]), cameras, cpu, cpu, aims=14, things=True)
    vocabulary = ["<unknown>", "get", "the", "bowl", "cup", "tin"]
    episodes.tell(vocabulary, ["pick_*"])
    rows = torch.arange(episodes.total).repeat(200)
    torch.manual_seed(3)
    asked = episodes.asked(rows, 0.5)
    assert episodes.tasks == ["pick_any: told otherwise", "pick_bowl", "pick_cup", "pick_tin"]
    by_row = [set(asked[rows == row].tolist()) for row in range(episodes.total)]
    # The bowl is of another area, and nothing else is there.
    assert by_row == [{-1, 3}] * 5 + [{-1, 2}] * 4 + [{-1}] * 3 + [{-1, 2, 3}, {-1, 2}], by_row
    share = (asked[rows < 9] >= 0).float().mean().item()
    assert 0.45 < share < 0.55, share

    _, _, is_pad, words = episodes.numbers(rows, 2, True, asked)
    places = episodes.places(rows, asked)
    for row, other, pads, said, place in zip(rows.tolist(), asked.tolist(), is_pad, words, places):
        episode = sum(row >= first for first in (5, 9, 12, 13))
        own, first = [(1, 0), (2, 5), (0, 9), (0, 12), (2, 13)][episode]  # thing in all names; first row
        expected = own if other < 0 else other - 1
        assert vocabulary[said[2]] == table[expected] or (episode > 2 and other < 0), (row, other, said)
        assert place[:7].tolist() == [100.0 * expected + row - first] * 7
        assert place[7:].isnan().all()
        assert pads.all() == (other >= 0), (row, other, pads)
    assert torch.equal(episodes.places(rows).nan_to_num(), episodes.aims[rows].nan_to_num())
    # Whose sentences fit no other episode are not asked for.
    episodes.tell(vocabulary, ["pick_cup"])
    assert set(episodes.asked(rows, 0.9)[rows < 5].tolist()) == {-1}


def write_cans(path, which, sentence, turned=0.0, rows=3, things=True):
    """Four cans in a row across the way at 1 m, can_1 at the left, seen by a robot that has
    turned about the row's middle by so much."""
    names = ["bowl", "can_1", "can_2", "can_3", "can_4"]
    write_episode(path, "pick_can", "shelf", f"can_{which}", names, rows)
    state, about = load_file(path), json.loads(safe_open(path, "np").metadata()["wheelarm"])
    aside = np.array([0.5, 0.3, 0.1, -0.1, -0.3])
    told = np.zeros((rows, 5, 7), np.float32)
    told[:, :, 0] = 1 - aside * np.sin(turned)
    told[:, :, 1] = aside * np.cos(turned)
    told[:, :, 2] = np.arange(5)
    state["things"] = told.reshape(rows, 35)
    if not things:
        del state["things"]
    save_file(state, path, {"wheelarm": json.dumps({**about, "instruction": sentence})})


def check_equals():
    """Equal things are told apart by their place from the left: sentences are shared by
    those that ask for the same place, others are asked for by theirs. What is not told
    apart keeps its sentence to itself."""
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        write_cans(folder / "a.safetensors", 1, "take number one from the left")
        write_cans(folder / "b.safetensors", 1, "take number four from the right")
        write_cans(folder / "c.safetensors", 3, "take number three from the left", turned=0.3)
        write_cans(folder / "d.safetensors", 1, "take the nearest one")
        write_cans(folder / "e.safetensors", 2, "take number two from the left", turned=np.pi / 2)
        write_cans(folder / "f.safetensors", 4, "take number four from the left", things=False)
        write_cans(folder / "g.safetensors", 4, "take number four from the left", rows=0)
        cameras = [("gen3", (2, 4)), ("wheelchair", (2, 4))]
        cpu = torch.device("cpu")
        files = find([folder])
        episodes = Episodes(files, cameras, cpu, cpu, aims=14, things=True)
    alone = "pick_can: told otherwise"
    assert [file.asks for file in files] == ["pick_can: 1 of 4", "pick_can: 1 of 4", "pick_can: 3 of 4", alone, alone, alone, alone]
    vocabulary = ["<unknown>", "one", "two", "three", "four", "left", "right", "nearest"]
    episodes.tell(vocabulary, ["pick_*"])
    rows = torch.arange(episodes.total).repeat(100)
    _, _, _, words = episodes.numbers(rows, 2, True)
    heard = [set() for _ in files]
    for row, said in zip(rows.tolist(), words):
        heard[row // 3].add(" ".join(vocabulary[word] for word in said if word > 0))
    both = {"one left", "four right"}
    assert heard == [both, both, {"three left"}, {"nearest one"}, {"two left"}, {"four left"}, set()], heard
    asked = episodes.asked(rows, 0.9)
    told = [set(asked[rows == row].tolist()) for row in range(0, 18, 3)]
    assert told == [{-1, 1}, {-1, 1}, {-1, 0}, {-1, 1}, {-1}, {-1}], (told, episodes.tasks)
    # Where the third is, for those that are asked for it.
    is_third = asked == 1
    assert is_third.any() and (episodes.places(rows, asked)[is_third][:, 2] == 3).all()


if __name__ == "__main__":
    for check in (check_shift, check_loss, check_served, check_asked, check_equals):
        check()
        print(f"{check.__name__}: ok")
