"""`lerobot-train` (lerobot 0.4.4) that ends in time and reads a data set of pictures fast.

    python client/learn/python/train_lerobot.py --within 900 --dataset.repo_id=local/wheelarm \\
        --dataset.root=data/lerobot --policy.type=diffusion --policy.push_to_hub=false ...

Takes all options of `lerobot-train`, whose own training it runs, and these:

    --within SECONDS     ends then, counted from the start of the program, set-up and earlier
                         pieces included; the learning rate has gone down to 0 by then
    --save-every SECONDS     writes a checkpoint so often (120), and one at the end
    --without-state PATTERNS     numbers of the state that it does not learn from, by name,
                         comma separated (`*.velocity,odometry.*`): their range is made so
                         wide that they are nearly 0, in the checkpoint's processors too
    --least-range NUMBER     of a number of state or action (0.04): what hardly changes is
                         not blown up to -1 to 1

With `--resume=true --config_path=OUT/checkpoints/last/pretrained_model/train_config.json`
it goes on, with the seconds that were left.

LeRobot decodes 46 pictures for an item of two cameras where the policy sees 4 (each query
of other columns decodes the pictures of its rows). Here pictures that lie as PNG in the
data set are decoded once, into memory: 85 kB each at 224x126.
"""

import fnmatch
import io
import json
import logging
import math
import mmap
import multiprocessing
import os
import sys
import time
from pathlib import Path

BEGAN = time.monotonic()
#: Steps that no training reaches.
ENDLESS = 999_999


def own_option(name: str, default: str) -> str:
    """Takes an option of ours out of what LeRobot reads."""
    value = default
    rest = []
    given = iter(sys.argv)
    for argument in given:
        key, equals, told = argument.partition("=")
        if key != name:
            rest.append(argument)
        else:
            value = told if equals else next(given, "")
    sys.argv[:] = rest
    return value


class Clock:
    """Steps until the time is over, and the checkpoints between."""

    def __init__(self, within: float, every: float) -> None:
        self.within, self.every = within, every
        self.earlier = 0.0
        self.config = None

    def elapsed(self) -> float:
        return time.monotonic() - BEGAN + self.earlier

    def steps(self, first: int, end: int):
        """In place of `range` in LeRobot's loop, which compares its own step with
        `steps` and `save_freq` of the configuration after each turn."""
        saved = self.elapsed()
        for step in range(first, end):
            now = self.elapsed()
            last = now >= self.within
            self.config.save_freq = end + 1
            if now - saved >= self.every:
                saved, self.config.save_freq = now, step + 1
            if last:
                self.config.steps = step + 1
            yield step
            if last:
                return


class Memory:
    """A data set's columns as tensors, pictures as bytes."""

    def __init__(self, data) -> None:
        import numpy as np
        import torch

        table = data.hf_dataset.data
        self.pictures = set(data.meta.image_keys)
        self.columns = {}
        for key, feature in data.meta.features.items():
            if key in self.pictures:
                height, width, _ = feature["shape"]
                pictures = shared((len(table), 3, height, width))
                fill(pictures, table[key])
                self.columns[key] = pictures
            elif feature["dtype"] not in ("string", "video"):
                kind = {"bool": bool, "int64": np.int64}.get(feature["dtype"], np.float32)
                self.columns[key] = torch.from_numpy(np.array(table[key].to_pylist(), dtype=kind))


def shared(size: tuple[int, ...]):
    """Bytes of that size which processes that come of this one share."""
    import torch

    return torch.frombuffer(mmap.mmap(-1, math.prod(size)), dtype=torch.uint8).view(size)


def fill(pictures, column) -> None:
    """Decodes a column of PNG files, by a process on each processor."""
    blocks, at = [], 0
    for chunk in column.chunks:
        files = chunk.field("bytes")
        for begin in range(0, len(files), 256):
            blocks.append((at + begin, files.slice(begin, 256)))
        at += len(files)
    count = max(1, min(os.cpu_count() or 1, len(blocks)))
    fork = multiprocessing.get_context("fork")
    parts = [fork.Process(target=decode, args=(pictures, blocks[i::count])) for i in range(count)]
    for part in parts:
        part.start()
    for part in parts:
        part.join()
    if any(part.exitcode != 0 for part in parts):
        raise SystemExit("a process that decodes pictures has ended: its error stands above; without one, memory was short")


def decode(pictures, blocks) -> None:
    import numpy as np
    from PIL import Image

    into = pictures.numpy()
    for first, files in blocks:
        for at, png in enumerate(files.to_pylist(), first):
            into[at] = np.array(Image.open(io.BytesIO(png)).convert("RGB")).transpose(2, 0, 1)


def from_memory(data) -> None:
    """Makes a `LeRobotDataset` answer from memory, the same items as before, but that
    pictures are bytes still: `unpacked` makes numbers from 0 to 1 of them on the device."""
    import torch
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    memory = Memory(data)
    bounds = [
        (data.meta.episodes[i]["dataset_from_index"], data.meta.episodes[i]["dataset_to_index"])
        for i in range(data.meta.total_episodes)
    ]
    tasks = list(data.meta.tasks.index)
    subtasks = list(data.meta.subtasks.index) if data.meta.subtasks is not None else []

    class FromMemory(LeRobotDataset):
        def __getitem__(self, at) -> dict:
            at = int(at)
            begin, end = bounds[int(memory.columns["episode_index"][at])]
            deltas = self.delta_indices or {}
            item = {key: values[at] for key, values in memory.columns.items() if key not in deltas}
            for key, delta in deltas.items():
                rows = torch.tensor([at + by for by in delta])
                item[key] = memory.columns[key][rows.clamp(begin, end - 1)]
                item[f"{key}_is_pad"] = (rows < begin) | (rows >= end)
            if self.image_transforms is not None:
                for key in memory.pictures:
                    item[key] = self.image_transforms(item[key].float() / 255)
            item["task"] = tasks[int(memory.columns["task_index"][at])]
            if subtasks and "subtask_index" in memory.columns:
                item["subtask"] = subtasks[int(memory.columns["subtask_index"][at])]
            return item

    data.__class__ = FromMemory


def unpacked(batch: dict) -> dict:
    import torch

    return {
        key: value.float() / 255 if torch.is_tensor(value) and value.dtype == torch.uint8 else value
        for key, value in batch.items()
    }


def limit_ranges(data, without: str, least: float) -> None:
    """Sets the statistics by which state and action are scaled."""
    import numpy as np

    patterns = [pattern for pattern in without.split(",") if pattern]
    for key in ("observation.state", "action"):
        names, stats = data.meta.features[key]["names"], data.meta.stats[key]
        low, high = (np.array(stats[which], dtype=np.float64) for which in ("min", "max"))
        middle, half = (low + high) / 2, np.maximum((high - low) / 2, least / 2)
        mean, std = (np.array(stats[which], dtype=np.float64) for which in ("mean", "std"))
        hidden = [
            key != "action" and any(fnmatch.fnmatch(name, pattern) for pattern in patterns)
            for name in names
        ]
        if any(hidden):
            logging.info("not learned from: %s", ", ".join(np.array(names)[hidden]))
            middle[hidden], half[hidden], mean[hidden], std[hidden] = 0, 1e6, 0, 1e6
        elif key != "action" and patterns:
            raise SystemExit(f"--without-state: no number is named {without}; there are {', '.join(names)}")
        for which, values in (("min", middle - half), ("max", middle + half), ("mean", mean), ("std", std)):
            stats[which] = values.astype(np.float32)


def main() -> None:
    if {"-h", "--help"} & set(sys.argv):
        raise SystemExit(f"{__doc__}\nThose of lerobot-train: lerobot-train --help")
    clock = Clock(float(own_option("--within", "900")), float(own_option("--save-every", "120")))
    without, least = own_option("--without-state", ""), float(own_option("--least-range", "0.04"))
    try:
        import torch
        from lerobot.configs import parser
        from lerobot.configs.train import TrainPipelineConfig
        from lerobot.scripts import lerobot_train
    except ImportError as problem:
        raise SystemExit(f"this Python cannot run lerobot-train: {problem}; pip install lerobot==0.4.4") from None
    make_dataset, save_checkpoint = lerobot_train.make_dataset, lerobot_train.save_checkpoint
    make_optimizer, cycle = lerobot_train.make_optimizer_and_scheduler, lerobot_train.cycle
    torch.set_float32_matmul_precision("high")

    def dataset(config):
        data = make_dataset(config)
        limit_ranges(data, without, least)
        if data.meta.image_keys and not data.meta.video_keys and config.dataset.episodes is None:
            from_memory(data)
            pictures = len(data) * len(data.meta.image_keys)
            logging.info("%d pictures are in memory after %.0f s", pictures, clock.elapsed())
        return data

    def optimizer_and_scheduler(config, policy):
        """A cosine of the time that has passed, in place of the steps."""
        optimizer, _ = make_optimizer(config, policy)
        warm_up = max(1, getattr(config.scheduler, "num_warmup_steps", None) or 1)

        def rate(step: int) -> float:
            over = min(1.0, clock.elapsed() / clock.within)
            return min(1.0, (step + 1) / warm_up) * 0.5 * (1 + math.cos(math.pi * over))

        return optimizer, torch.optim.lr_scheduler.LambdaLR(optimizer, rate)

    def save(*arguments, **named) -> None:
        save_checkpoint(*arguments, **named)
        told = json.dumps({"seconds": clock.elapsed(), "step": named["step"]})
        Path(named["checkpoint_dir"], "seconds.json").write_text(told)

    @parser.wrap()
    def train(config: TrainPipelineConfig) -> None:
        clock.config = config
        config.steps, config.eval_freq = ENDLESS, 0
        if config.resume:
            folder = Path(parser.parse_arg("config_path")).resolve().parent.parent
            clock.earlier = json.loads((folder / "seconds.json").read_text())["seconds"]
        lerobot_train.train(config)

    lerobot_train.make_dataset = dataset
    lerobot_train.make_optimizer_and_scheduler = optimizer_and_scheduler
    lerobot_train.save_checkpoint = save
    lerobot_train.cycle = lambda batches: map(unpacked, cycle(batches))
    lerobot_train.range = clock.steps
    # Its bar would tell an end of a million steps.
    lerobot_train.inside_slurm = lambda: True
    train()


if __name__ == "__main__":
    main()
