"""`lerobot-train` (lerobot 0.4.4) with a time limit and fast access to images.

    python client/learn/python/train_lerobot.py --within 900 --dataset.repo_id=local/wheelarm \\
        --dataset.root=data/lerobot --policy.type=diffusion --policy.push_to_hub=false ...

Runs LeRobot's training with all options of `lerobot-train`, and these:

    --within SECONDS     time limit from the start of the program, including set-up and earlier
                         calls; the learning rate reaches 0 at the limit
    --save-every SECONDS     time between checkpoints (120); the last one is at the end
    --without-state PATTERNS     names of state numbers to ignore, comma separated
                         (`*.velocity,odometry.*`): their range is set so wide that they are
                         nearly 0, also in the checkpoint's processors
    --least-range NUMBER     smallest range of a number of state or action (0.04), which limits
                         the scale of nearly constant numbers

With `--resume=true --config_path=OUT/checkpoints/last/pretrained_model/train_config.json` it
continues with the remaining seconds.

For an item of two cameras LeRobot decodes 46 images, although the policy uses 4: each query of
other columns decodes the images of its rows. Here the PNG images of the data set are decoded
once, into memory: 85 kB each at 224x126.
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

START = time.monotonic()
#: More steps than any training has.
UNLIMITED = 999_999


def pop_option(name: str, default: str) -> str:
    """Removes an option from the arguments before LeRobot parses them, and returns its value."""
    value = default
    rest = []
    given = iter(sys.argv)
    for argument in given:
        key, equals, text = argument.partition("=")
        if key != name:
            rest.append(argument)
        else:
            value = text if equals else next(given, "")
    sys.argv[:] = rest
    return value


class Clock:
    """Time limit of the training and times of the checkpoints."""

    def __init__(self, within: float, every: float) -> None:
        self.within, self.every = within, every
        self.earlier = 0.0
        self.config = None

    def elapsed(self) -> float:
        return time.monotonic() - START + self.earlier

    def steps(self, first: int, end: int):
        """Replaces `range` in LeRobot's loop, which compares its step with `steps` and `save_freq`
        of the configuration after each iteration."""
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
    """Columns of a data set as tensors, images as 8-bit."""

    def __init__(self, data) -> None:
        import numpy as np
        import torch

        table = data.hf_dataset.data
        self.image_keys = set(data.meta.image_keys)
        self.columns = {}
        for key, feature in data.meta.features.items():
            if key in self.image_keys:
                height, width, _ = feature["shape"]
                images = shared_bytes((len(table), 3, height, width))
                decode_column(images, table[key])
                self.columns[key] = images
            elif feature["dtype"] not in ("string", "video"):
                kind = {"bool": bool, "int64": np.int64}.get(feature["dtype"], np.float32)
                self.columns[key] = torch.from_numpy(np.array(table[key].to_pylist(), dtype=kind))


def shared_bytes(size: tuple[int, ...]):
    """A byte tensor in memory that is shared with forked processes."""
    import torch

    return torch.frombuffer(mmap.mmap(-1, math.prod(size)), dtype=torch.uint8).view(size)


def decode_column(images, column) -> None:
    """Decodes a column of PNG files with one process per core."""
    blocks, at = [], 0
    for chunk in column.chunks:
        files = chunk.field("bytes")
        for begin in range(0, len(files), 256):
            blocks.append((at + begin, files.slice(begin, 256)))
        at += len(files)
    count = max(1, min(os.cpu_count() or 1, len(blocks)))
    fork = multiprocessing.get_context("fork")
    parts = [fork.Process(target=decode_blocks, args=(images, blocks[i::count])) for i in range(count)]
    for part in parts:
        part.start()
    for part in parts:
        part.join()
    if any(part.exitcode != 0 for part in parts):
        raise SystemExit("cannot decode the images: see the error of the process above; without one, memory was too small")


def decode_blocks(images, blocks) -> None:
    import numpy as np
    from PIL import Image

    into = images.numpy()
    for first, files in blocks:
        for at, png in enumerate(files.to_pylist(), first):
            into[at] = np.array(Image.open(io.BytesIO(png)).convert("RGB")).transpose(2, 0, 1)


def serve_from_memory(data) -> None:
    """Makes a `LeRobotDataset` return the same items from memory, with 8-bit images: `to_float`
    converts them to 0 to 1 on the device."""
    import torch
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    memory = Memory(data)
    bounds = [
        (data.meta.episodes[i]["dataset_from_index"], data.meta.episodes[i]["dataset_to_index"])
        for i in range(data.meta.total_episodes)
    ]
    tasks = list(data.meta.tasks.index)
    subtasks = list(data.meta.subtasks.index) if data.meta.subtasks is not None else []

    class MemoryDataset(LeRobotDataset):
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
                for key in memory.image_keys:
                    item[key] = self.image_transforms(item[key].float() / 255)
            item["task"] = tasks[int(memory.columns["task_index"][at])]
            if subtasks and "subtask_index" in memory.columns:
                item["subtask"] = subtasks[int(memory.columns["subtask_index"][at])]
            return item

    data.__class__ = MemoryDataset


def to_float(batch: dict) -> dict:
    import torch

    return {
        key: value.float() / 255 if torch.is_tensor(value) and value.dtype == torch.uint8 else value
        for key, value in batch.items()
    }


def limit_ranges(data, without: str, least: float) -> None:
    """Sets the statistics for the scales of state and action."""
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
            logging.info("ignored numbers of the state: %s", ", ".join(np.array(names)[hidden]))
            middle[hidden], half[hidden], mean[hidden], std[hidden] = 0, 1e6, 0, 1e6
        elif key != "action" and patterns:
            raise SystemExit(f"--without-state: no number of the state matches {without}; available: {', '.join(names)}")
        for which, values in (("min", middle - half), ("max", middle + half), ("mean", mean), ("std", std)):
            stats[which] = values.astype(np.float32)


def main() -> None:
    if {"-h", "--help"} & set(sys.argv):
        raise SystemExit(f"{__doc__}\nOptions of lerobot-train: lerobot-train --help")
    clock = Clock(float(pop_option("--within", "900")), float(pop_option("--save-every", "120")))
    without, least = pop_option("--without-state", ""), float(pop_option("--least-range", "0.04"))
    try:
        import torch
        from lerobot.configs import parser
        from lerobot.configs.train import TrainPipelineConfig
        from lerobot.scripts import lerobot_train
    except ImportError as error:
        raise SystemExit(f"cannot import lerobot-train: {error}; pip install lerobot==0.4.4") from None
    make_dataset, save_checkpoint = lerobot_train.make_dataset, lerobot_train.save_checkpoint
    make_optimizer, cycle = lerobot_train.make_optimizer_and_scheduler, lerobot_train.cycle
    torch.set_float32_matmul_precision("high")

    def dataset(config):
        data = make_dataset(config)
        limit_ranges(data, without, least)
        if data.meta.image_keys and not data.meta.video_keys and config.dataset.episodes is None:
            serve_from_memory(data)
            count = len(data) * len(data.meta.image_keys)
            logging.info("%d images are in memory after %.0f s", count, clock.elapsed())
        return data

    def optimizer_and_scheduler(config, policy):
        """A cosine over the elapsed time instead of the steps."""
        optimizer, _ = make_optimizer(config, policy)
        warm_up = max(1, getattr(config.scheduler, "num_warmup_steps", None) or 1)

        def rate(step: int) -> float:
            over = min(1.0, clock.elapsed() / clock.within)
            return min(1.0, (step + 1) / warm_up) * 0.5 * (1 + math.cos(math.pi * over))

        return optimizer, torch.optim.lr_scheduler.LambdaLR(optimizer, rate)

    def save(*arguments, **named) -> None:
        save_checkpoint(*arguments, **named)
        text = json.dumps({"seconds": clock.elapsed(), "step": named["step"]})
        Path(named["checkpoint_dir"], "seconds.json").write_text(text)

    @parser.wrap()
    def train(config: TrainPipelineConfig) -> None:
        clock.config = config
        config.steps, config.eval_freq = UNLIMITED, 0
        if config.resume:
            folder = Path(parser.parse_arg("config_path")).resolve().parent.parent
            clock.earlier = json.loads((folder / "seconds.json").read_text())["seconds"]
        lerobot_train.train(config)

    lerobot_train.make_dataset = dataset
    lerobot_train.make_optimizer_and_scheduler = optimizer_and_scheduler
    lerobot_train.save_checkpoint = save
    lerobot_train.cycle = lambda batches: map(to_float, cycle(batches))
    lerobot_train.range = clock.steps
    # Hides the progress bar, which would count to a million steps.
    lerobot_train.inside_slurm = lambda: True
    train()


if __name__ == "__main__":
    main()
