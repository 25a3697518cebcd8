#!/usr/bin/env python3
"""Trains a policy on a GPU (small ones also on a CPU).

    wheelarm dataset export --format tensors data/mustard/episodes --trim-idle 0.5 --out data/tensors
    python3 train.py data/tensors --out runs/mustard --steps 30000 --seconds 500
    python3 train.py data/tensors --out runs/mustard --steps 30000 --seconds 500    # continues
    wheelarm-learn serve runs/mustard/policy.safetensors

Requires torch, numpy and safetensors; plots curves with matplotlib. The same command continues
from the last checkpoint until all steps are done: exit code 0 then, 4 while steps are left.
"""

import argparse
import math
import os
import signal
import subprocess
import sys
import time
from fnmatch import fnmatch
from pathlib import Path

import torch

import keypoint_targets
import curves
import ledger
import policy_file
import worlds
from warm_start import initialize_from
from episodes import DataError, Episodes, digest, find_files, split, split_words, statistics
from network import Policy, Shape
from progress import Log, lock_folder, summarize

UNFINISHED = 4
PART_BYTES = 15_000_000  # size of a part of a transferable checkpoint
IMAGENET = {"mean": [0.485, 0.456, 0.406], "std": [0.229, 0.224, 0.225]}
WARM_STEPS = 20  # steps before a step is captured as a CUDA graph
CALIBRATION_BATCHES = 16  # batches for the statistics of batch norms
MULTIPLE = 32  # factor by which ResNet18 reduces images


def parse_weight(text):
    value = float(text)
    if not 0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"invalid weight {text}: give a number of at least 0")
    return value


def parse_share(text):
    value = parse_weight(text)
    if value >= 1:
        raise argparse.ArgumentTypeError(f"invalid share {text}: give a number of at least 0 and below 1")
    return value


def parse_arguments():
    shape = Shape()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("data", nargs="+", type=Path, help="folders with *.safetensors of `dataset export --format tensors`")
    add("--out", type=Path, required=True, help="folder for checkpoint, log, curves and policy")
    add("--name", help="name of the policy; that of --out if absent")
    add("--kind", choices=["act", "flow"], default="act")
    add("--steps", type=int, default=30000, help="training steps in total; the cosine ends with them")
    add("--within", type=float, metavar="SECONDS", help="training time in total: steps and cosine end with it at the latest")
    add("--seconds", type=float, help="ends this call after this time, with a checkpoint")
    add("--batch", type=int, default=64)
    add("--lr", type=float, default=1e-4)
    add("--lr-backbone", type=float, help="learning rate of the ResNet; --lr if absent")
    add("--weight-decay", type=float, default=1e-4)
    add("--warm-up", type=int, default=500, help="steps")
    add("--kl", type=float, default=5.0, help="weight of the divergence of the latent")
    add("--chunk", type=int, default=shape.chunk, help="rows of a chunk")
    add("--execute", type=int, default=10, help="rows of a chunk that are executed; for the card")
    add("--width", type=int, default=shape.width, help="channels of the first stage of the ResNet")
    add("--norm", choices=["group", "batch", "frozen-bn"], default=shape.norm,
        help="frozen-bn with --backbone; batch is fastest on a GPU, and saved as frozen-bn")
    add("--film", action="store_true", help="words scale and shift the output of each stage of the ResNet (FiLM)")
    add("--group-channels", type=int, default=shape.group_channels)
    add("--backbone", type=Path, help="weights of torchvision's resnet18, .pth or .safetensors")
    add("--dim", type=int, default=shape.dim)
    add("--feedforward", type=int, default=shape.feedforward)
    add("--heads", type=int, default=shape.heads)
    add("--encoder-layers", type=int, default=shape.encoder_layers)
    add("--decoder-layers", type=int, default=shape.decoder_layers)
    add("--vae-layers", type=int, default=shape.vae_layers)
    add("--latent", type=int, default=shape.latent)
    add("--flow-layers", type=int, default=shape.flow_layers)
    add("--flow-steps", type=int, default=shape.flow_steps)
    add("--dropout", type=float, default=shape.dropout)
    add("--no-language", action="store_true", help="ignores the sentence")
    add("--unknown-words", type=float, default=0.05, help="share of words that are hidden in training")
    add("--share-sentences", default="", metavar="PATTERNS",
        help="tasks, comma separated, * for any letters, whose sentences fit every episode of the task: a row gets one of "
        "all sentences of its task; 'pick_*'")
    add("--balance-tasks", action="store_true", help="samples rows of every task equally often")
    add("--cameras", help="names, comma separated; all if absent")
    add("--without-state", default="", metavar="PATTERNS",
        help="names of the state that are hidden, comma separated, * for any letters: '*.velocity,odometry.*'")
    add("--state-noise", type=float, default=0.0, help="standard deviation of noise on the normalised state")
    add("--shift", type=int, default=8, help="largest shift of images, pixels")
    add("--jitter", type=float, default=0.3, help="strength of the changes of brightness, contrast, saturation")
    add("--gripper-weight", type=float, default=3.0, help="sampling weight of rows near a change of the gripper")
    add("--gripper-seconds", type=float, default=1.0, help="seconds before and after a change that are near it")
    add("--aim-weight", type=parse_weight, default=0.0, help="weight of the auxiliary task, locating the task's object and "
        "goal (tensor `aims`); not part of the served policy")
    add("--ask-others", type=parse_share, default=0.0, metavar="SHARE", help="share of the rows with the sentence of another "
        "object of the area (--share-sentences), which learn only its position; with --aim-weight")
    add("--ema", type=float, default=0.999, help="decay of the mean of the weights, which is saved")
    add("--validation", type=float, default=0.05, help="share of held-out seeds")
    add("--pause", type=int, metavar="ROWS", help="rows that remain of a pause; all if absent")
    add("--keep-failed", action="store_true", help="uses failed episodes too")
    add("--init", type=Path, help="policy to start from; training.safetensors next to it has all weights")
    add("--precision", choices=["tf32", "bf16", "fp32"], default="tf32")
    add("--no-graph", action="store_true", help="does not capture a training step as a CUDA graph")
    add("--store", choices=["auto", "device", "cpu"], default="auto", help="memory of the images")
    add("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    add("--interval", type=int, default=500, help="steps between lines of the log")
    add("--save-seconds", type=float, default=60.0, help="seconds between checkpoints")
    add("--travel", type=Path, help=f"folder for transferable checkpoints in parts of at most {PART_BYTES // 10**6} MB, "
        "without the state of the optimiser; read when --out has no checkpoint")
    add("--worlds", type=Path, help="file of what is kept for tests, which no training uses; that of the assets if absent")
    add("--seed", type=int, default=0)
    return parser.parse_args()


def main():
    options = parse_arguments()
    started = time.monotonic()
    try:
        return train(options, started)
    except (DataError, ValueError, OSError) as error:
        print(f"train.py: {error}", file=sys.stderr)
        return 1


def open_device(name):
    """The device `name`.

    Raises ValueError when it cannot be used."""
    try:
        torch.empty(1, device=name)
    except (RuntimeError, AssertionError) as error:
        text = str(error).splitlines()[0]
        raise ValueError(f"cannot use --device {name}: {text}; leave --device out, or give cpu") from None
    return torch.device(name)


def train(options, started):
    if options.ask_others and (not options.aim_weight or not options.share_sentences or options.no_language):
        raise ValueError("--ask-others needs --aim-weight, --share-sentences and words: give them, or leave it out")
    device = open_device(options.device)
    tf32 = options.precision == "tf32"
    torch.backends.cuda.matmul.allow_tf32 = torch.backends.cudnn.allow_tf32 = tf32
    torch.backends.cudnn.benchmark = True
    torch.manual_seed(options.seed)
    options.out.mkdir(parents=True, exist_ok=True)
    lock = lock_folder(options.out)  # noqa: F841, held until the end
    log = Log(options.out)

    files = find_files(options.data, options.keep_failed)
    kept_for_tests = worlds.read(options.worlds)
    worlds.check(kept_for_tests, files)
    about = files[0].about
    available = files[0].cameras
    names = options.cameras.split(",") if options.cameras else sorted(available)
    if missing := [name for name in names if name not in available]:
        raise DataError(f"no camera named {missing[0]!r} in the episodes; available: {', '.join(available)}")
    cameras = [(name, available[name]) for name in names]
    if len({size for _, size in cameras}) > 1:
        raise DataError(f"cameras differ in size ({cameras}): export them with --size")
    padded = tuple(-(-side // MULTIPLE) * MULTIPLE for side in cameras[0][1])
    training, held = split(files, options.validation)
    known_seeds = set(policy_file.read(options.init)[1].get("training_seeds", [])) if options.init else set()
    if known := [file for file in held if file.about["seed"] in known_seeds]:
        log.report(f"{len(known)} episodes are not held out: --init was trained on their seeds")
        held = [file for file in held if file.about["seed"] not in known_seeds]
    store = choose_store(options, device, files, names)
    aim_width = keypoint_targets.row_width(len(cameras)) if options.aim_weight else 0
    uses_others = options.ask_others > 0
    if aim_width and names != sorted(available):
        raise ValueError("--aim-weight needs all cameras of the episodes: leave --cameras out")
    load = lambda files: Episodes(files, cameras, device, store, log.report, options.pause, aim_width, uses_others)  # noqa: E731
    episodes, tests = load(training), load(held) if held else None
    if aim_width and not episodes.aims.isfinite().any():
        raise DataError("no episode has the positions `aims`: export again, or leave --aim-weight out")
    numbers = statistics(episodes)
    vocabulary = []
    if not options.no_language:
        vocabulary = ["<unknown>"] + sorted({w for f in training for w in split_words(f.about["instruction"])})
    for part in (episodes, tests):
        if part is not None:
            part.set_sentences(vocabulary, [p for p in options.share_sentences.split(",") if p])
    if options.ask_others and not episodes.count_others.any():
        raise DataError(
            "--ask-others finds no other objects: old episodes lack `things` (export again), or no two tasks of one area, "
            f"each with one object, match --share-sentences {options.share_sentences!r}; else leave it out"
        )

    shape = Shape(
        kind=options.kind, state=len(about["state_names"]), action=len(about["action_names"]),
        chunk=options.chunk, cameras=len(cameras), words=len(vocabulary), width=options.width,
        norm=options.norm, film=options.film, group_channels=options.group_channels, dim=options.dim,
        feedforward=options.feedforward, heads=options.heads, encoder_layers=options.encoder_layers,
        decoder_layers=options.decoder_layers, vae_layers=options.vae_layers, latent=options.latent,
        dropout=options.dropout, flow_layers=options.flow_layers, flow_steps=options.flow_steps,
    )  # fmt: skip
    network = Policy(shape)
    if aim_width:
        network.aims = keypoint_targets.KeypointHead(shape, *keypoint_targets.statistics(episodes.aims, len(cameras)))
    network.to(device)
    if device.type == "cuda":
        network.model.backbone.to(memory_format=torch.channels_last)
    if options.backbone:
        load_backbone(network, options)
    hidden = hidden_numbers(about["state_names"], options.without_state)
    card = make_card(options, shape, about, cameras, numbers, vocabulary, hidden, training, held, network)
    before = initialize_from(network, options.init, card) if options.init else {}
    run = Run(options, network, episodes, tests, numbers, hidden, padded, about, device)
    run.card = card
    run.card["data"]["worlds"] = kept_for_tests["frozen"]
    episode_ledgers = [f.about.get("ledger") or ledger.from_seeds([f.about["seed"]]) for f in [*training, *held]]
    run.ledger = ledger.merge([*episode_ledgers, *ledger_of_start(options.init, before)])
    run.card["training_seeds"] = sorted({*run.card["training_seeds"], *before.get("training_seeds", [])})
    run.resume(log)
    parameters = sum(p.numel() for p in network.parameters())
    log.report(f"{options.kind}, {parameters / 1e6:.2f} M parameters, {len(training)} episodes, {len(held)} held out, on {device}")
    return run.run(log, started)


def ledger_of_start(path, card):
    """The training ledger of the policy at `path`, from which the training starts; none without
    it. Of a policy without a ledger the seeds alone are known."""
    if path is None:
        return []
    return [ledger.read(path) or ledger.from_seeds([*card.get("training_seeds", []), *card.get("validation_seeds", [])])]


def choose_store(options, device, files, names):
    """Device of the images: the training device if a third of its memory stays free, else the CPU."""
    if options.store != "auto":
        return device if options.store == "device" else torch.device("cpu")
    if device.type != "cuda":
        return device
    size = sum(math.prod(f.shapes[f"pictures.{name}"]) for f in files for name in names)
    free = torch.cuda.mem_get_info(device)[0]
    return device if size < free * 0.67 else torch.device("cpu")


def hidden_numbers(names, patterns):
    patterns = [p for p in patterns.split(",") if p]
    for pattern in patterns:
        if not any(fnmatch(name, pattern) for name in names):
            raise ValueError(f"no number of the state matches {pattern!r}; available: {', '.join(names)}")
    return [any(fnmatch(name, p) for p in patterns) for name in names]


def load_backbone(network, options):
    if options.norm != "frozen-bn":
        raise ValueError("--backbone contains batch norms: use it with --norm frozen-bn")
    if options.backbone.suffix == ".safetensors":
        from safetensors.torch import load_file

        state = load_file(options.backbone)
    else:
        state = torch.load(options.backbone, map_location="cpu", weights_only=True)
    state = {n: t for n, t in state.items() if not n.startswith("fc.") and not n.endswith("num_batches_tracked")}
    missing, unknown = network.model.backbone.load_state_dict(state, strict=False)
    if missing or unknown:
        raise ValueError(f"{options.backbone} is not a resnet18: missing {missing[:3]}, unknown {unknown[:3]}")


def make_card(options, shape, about, cameras, numbers, vocabulary, hidden, training, held, network):
    commit = subprocess.run(["git", "rev-parse", "--short=12", "HEAD"], capture_output=True, text=True,
        cwd=Path(__file__).parent).stdout.strip()  # fmt: skip
    (state_mean, state_std), (action_mean, action_std) = numbers["state"], numbers["action"]
    return {
        "name": options.name or options.out.name,
        "network": shape.to_served_dict(),
        "robot": about["robot"],
        "rate_hz": about["rate_hz"],
        "chunk": options.chunk,
        "execute": min(options.execute, options.chunk),
        "history": 1,
        "stochastic": options.kind == "flow",
        "cameras": [{"name": name, "width": size[1], "height": size[0], "depth": False} for name, size in cameras],
        "picture": {**IMAGENET, "multiple": MULTIPLE, "padding": "edge"},
        "state": {"names": about["state_names"], "mean": state_mean.tolist(), "std": state_std.tolist(),
            "hidden": [name for name, h in zip(about["state_names"], hidden) if h]},
        "action": {"kind": about["action"], "names": about["action_names"], "units": about["action_units"],
            "mean": action_mean.tolist(), "std": action_std.tolist()},
        "vocabulary": vocabulary,
        "training_seeds": sorted({f.about["seed"] for f in training}),
        "validation_seeds": sorted({f.about["seed"] for f in held}),
        "tasks": sorted({f.about["task"] for f in training}),
        "data": {"episodes": len(training), "rows": sum(f.rows for f in training), "sha256": digest(training)},
        "training": {
            "commit": os.environ.get("WHEELARM_COMMIT") or commit or "unknown",
            "torch": torch.__version__,
            "device": torch.cuda.get_device_name() if options.device.startswith("cuda") else "cpu",
            "parameters": sum(p.numel() for p in network.parameters()),
            "options": {k: str(v) if isinstance(v, Path) else v for k, v in vars(options).items()
                if k not in ("data", "out", "travel", "seconds", "within", "device", "init", "backbone", "worlds")},
            "init": policy_file.sha256(options.init) if options.init else None,
            "backbone": policy_file.sha256(options.backbone) if options.backbone else None,
        },
    }  # fmt: skip


class Run:
    """State of a training."""

    def __init__(self, options, network, episodes, tests, numbers, hidden, padded, about, device):
        self.options, self.network, self.episodes, self.tests = options, network, episodes, tests
        self.device, self.padded, self.step, self.spent = device, padded, 0, 0.0
        tensor = lambda values: torch.as_tensor(values, device=device)  # noqa: E731
        self.state_mean, self.state_std = map(tensor, numbers["state"])
        self.action_mean, self.action_std = map(tensor, numbers["action"])
        self.shown = ~tensor(hidden)
        self.sizes, self.grid = None, [side // MULTIPLE for side in padded]
        slow = [p for n, p in network.named_parameters() if n.startswith("model.backbone.")]
        fast = [p for n, p in network.named_parameters() if not n.startswith("model.backbone.")]
        rate = options.lr_backbone or options.lr
        groups = [{"params": fast, "base": options.lr}, {"params": slow, "base": rate}]
        groups = [group for group in groups if group["params"]]
        # A step is one graph if all its data is on the GPU.
        on_gpu = device.type == "cuda" and all(p.device.type == "cuda" for p in episodes.images.values())
        self.is_graphed, self.graph, self.parts = on_gpu and not options.no_graph, None, None
        self.optimiser = torch.optim.AdamW(
            groups, lr=options.lr, weight_decay=options.weight_decay, fused=device.type == "cuda",
            capturable=self.is_graphed,
        )  # fmt: skip
        self.parameters = [p for group in groups for p in group["params"]]
        self.mean = {n: t.detach().clone() for n, t in network.state_dict().items()}
        self.channels = [torch.tensor(IMAGENET[k], device=device).view(1, 1, 3, 1, 1) for k in ("mean", "std")]
        knuckle = about["action_names"].index("knuckle.target")
        around = round(options.gripper_seconds * about["rate_hz"])
        self.weights = episodes.weights(knuckle, around, options.gripper_weight, options.balance_tasks)
        # torch.multinomial samples from at most 2^24 rows; cumulative sums have no limit.
        self.sums = self.weights.double().cumsum(0)

    def batch(self, rows, source, is_training, other_share=0.0):
        """Inputs and targets of rows. `other_share`: share of the rows with another object."""
        options = self.options
        other_tasks = source.sample_other_tasks(rows, other_share) if other_share else None
        state, actions, is_pad, words = source.numbers(rows, options.chunk, is_training, other_tasks)
        state = (state - self.state_mean) / self.state_std
        images, offsets = source.padded_images(rows, self.padded, options.shift if is_training else 0)
        images = policy_file.normalize_images(images, self.card) if not is_training else self.augment(images)
        if is_training and options.state_noise:
            state = state + options.state_noise * torch.randn_like(state)
        if is_training and options.unknown_words and self.network.shape.words:
            hide = torch.rand(words.shape, device=words.device) < options.unknown_words
            words = torch.where(hide & (words >= 0), 0, words)
        state = state * self.shown
        actions = (actions - self.action_mean) / self.action_std
        aims = self.aim_targets(source, rows, offsets, other_tasks)
        return images, state, words, actions, is_pad, aims, other_tasks

    def aim_targets(self, source, rows, offsets, other_tasks):
        """Positions of object and goal, metres, and their pixels in the padded images."""
        if not self.options.aim_weight:
            return None
        positions, shares = keypoint_targets.split_row(source.aim_rows(rows, other_tasks), len(source.cameras))
        sizes = [[width, height] for _, (height, width) in source.cameras]
        # Copied once: a copy from the host cannot be part of a graph.
        if self.sizes is None:
            self.sizes = torch.tensor(sizes, dtype=torch.float32, device=self.device)
        return positions, shares * self.sizes[:, None] + offsets[:, :, None]

    def augment(self, images):
        """Changes brightness, contrast and saturation of each image, and normalises it."""
        strength = self.options.jitter
        x = images.permute(0, 1, 4, 2, 3).float() / 255
        if strength:
            factor = lambda: 1 + strength * (2 * torch.rand(*x.shape[:2], 1, 1, 1, device=x.device) - 1)  # noqa: E731
            x = x * factor()
            mean = x.mean((2, 3, 4), keepdim=True)
            x = (x - mean) * factor() + mean
            grey = x.mean(2, keepdim=True)
            x = ((x - grey) * factor() + grey).clamp(0, 1)
        mean, deviation = self.channels
        return (x - mean) / deviation

    def sample_rows(self):
        at = torch.rand(self.options.batch, device=self.device, dtype=torch.float64) * self.sums[-1]
        return torch.searchsorted(self.sums, at, right=True).clamp(max=len(self.sums) - 1)

    def run(self, log, started):
        options, network = self.options, self.network
        stop = {"requested": False}
        for name in (signal.SIGTERM, signal.SIGINT):
            signal.signal(name, lambda *_: stop.update(requested=True))
        network.train()
        self.prepare()
        begin, before = time.monotonic(), self.spent
        saved, first, sums, counted = begin, self.step, {}, 0
        while self.progress() < 1:
            parts = self.advance()
            counted += 1
            for key, value in parts.items():
                sums[key] = sums.get(key, 0.0) + value
            now = time.monotonic()
            self.spent = before + now - begin
            if self.step % options.interval == 0 or self.progress() >= 1:
                entry = self.measure(sums, counted, now - begin, first)
                sums, counted = {}, 0
                log.add(entry)
                log.report(summarize(entry, options.steps))
            elif self.step % 20 == 0:
                log.show_bar(self.step, options.steps, (self.step - first) * self.images_per_step() / (now - begin))
            over = options.seconds is not None and now - started > options.seconds
            if stop["requested"] or over:
                break
            if now - saved > options.save_seconds:
                self.save(log)
                saved = time.monotonic()
        self.save(log)
        is_done = self.progress() >= 1
        log.report(f"step {self.step} of {options.steps}: {'done' if is_done else 'the same command continues'}")
        return 0 if is_done else UNFINISHED

    def progress(self):
        """Completed share of the training, by steps or by time."""
        within = self.options.within
        return max(self.step / self.options.steps, self.spent / within if within else 0.0)

    def images_per_step(self):
        return self.options.batch * self.network.shape.cameras

    def advance(self):
        options = self.options
        share = min(1.0, (self.step + 1) / max(1, options.warm_up))
        share *= 0.5 * (1 + math.cos(math.pi * min(1.0, self.progress())))
        for group in self.optimiser.param_groups:
            rate = max(1e-7, group["base"] * share)
            if isinstance(group["lr"], torch.Tensor):
                group["lr"].fill_(rate)
            else:
                group["lr"] = rate
        if self.graph is not None:
            self.graph.replay()
        elif self.is_graphed and self.step >= self.first + WARM_STEPS:
            self.capture()
            self.graph.replay()
        elif self.is_graphed:
            # CUDA graphs need warm-up steps on a side stream.
            self.side.wait_stream(torch.cuda.current_stream())
            with torch.cuda.stream(self.side):
                self.parts = self.learn()
            torch.cuda.current_stream().wait_stream(self.side)
        else:
            self.parts = self.learn()
        self.step += 1
        decay = min(options.ema, (1 + self.step) / (10 + self.step))
        torch._foreach_lerp_(self.means, self.owns, 1 - decay)
        return self.parts

    def learn(self):
        """One step of the optimiser."""
        options = self.options
        images, state, words, actions, is_pad, aims, _ = self.batch(self.sample_rows(), self.episodes, True, options.ask_others)
        bf16 = options.precision == "bf16"
        with torch.autocast(self.device.type, torch.bfloat16, enabled=bf16, cache_enabled=not self.is_graphed):
            loss, parts, memory = self.network.loss(images, state, words, actions, is_pad, options.kl)
        if aims is not None:
            parts["aim"] = self.network.aims.loss(memory.float(), self.grid, *aims)
            loss = loss + options.aim_weight * parts["aim"]
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.parameters, 10.0)
        self.optimiser.step()
        return {name: value.detach() for name, value in parts.items()}

    def capture(self):
        self.optimiser.zero_grad(set_to_none=True)
        torch.cuda.synchronize()
        self.graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(self.graph):
            self.parts = self.learn()

    def prepare(self):
        """Prepares the steps after the weights are loaded."""
        self.first = self.step
        own = self.network.state_dict()
        names = [name for name, tensor in own.items() if tensor.is_floating_point()]
        self.owns, self.means = [own[n] for n in names], [self.mean[n] for n in names]
        if self.is_graphed:
            self.side = torch.cuda.Stream()
            for group in self.optimiser.param_groups:
                group["lr"] = torch.tensor(float(group["lr"]), device=self.device)

    @torch.no_grad()
    def calibrate(self):
        """Computes the statistics of the batch norms for the mean weights, and loads these weights
        into the network."""
        self.network.load_state_dict(self.mean)
        norms = [m for m in self.network.modules() if isinstance(m, torch.nn.BatchNorm2d)]
        if not norms:
            return
        self.network.train()
        for norm in norms:
            norm.reset_running_stats()
            norm.momentum = None
        bf16 = self.options.precision == "bf16"
        devices = [self.device] if self.device.type == "cuda" else []
        with torch.random.fork_rng(devices):
            for _ in range(CALIBRATION_BATCHES):
                images, _, words, *_ = self.batch(self.sample_rows(), self.episodes, True)
                with torch.autocast(self.device.type, torch.bfloat16, enabled=bf16):
                    self.network.model.features(images, self.network.language(words))
        for norm in norms:
            norm.momentum = 0.1
        for name, tensor in self.network.state_dict().items():
            self.mean[name].copy_(tensor)

    @torch.no_grad()
    def measure(self, sums, counted, seconds, first):
        rate = float(self.optimiser.param_groups[0]["lr"])
        entry = {"step": self.step, "seconds": round(self.spent, 1), "lr": rate}
        entry |= {key: (value / counted).item() for key, value in sums.items()}
        entry["pictures_per_second"] = round((self.step - first) * self.images_per_step() / seconds)
        if self.tests is not None:
            entry |= self.validate()
        return entry

    @torch.no_grad()
    def validate(self, most=1024):
        """Normalised L1 error of the mean weights on held-out episodes, of holding the first row, and
        by row of the chunk and by task."""
        options, tests = self.options, self.tests
        rows = torch.linspace(0, tests.total - 1, min(most, tests.total), device=self.device).long()
        own = {name: tensor.clone() for name, tensor in self.network.state_dict().items()}
        self.calibrate()
        self.network.eval()
        noise = torch.Generator(device=self.device).manual_seed(0)
        error, held, count = 0.0, 0.0, 0.0
        off, other_off = torch.zeros((2, 2), device=self.device)
        by_task = torch.zeros(2, len(tests.tasks), device=self.device)
        for part in rows.split(options.batch):
            images, state, words, actions, is_pad, aims, _ = self.batch(part, tests, False)
            start = torch.randn(actions.shape, device=self.device, generator=noise)
            with torch.autocast(self.device.type, torch.bfloat16, enabled=options.precision == "bf16"):
                found, memory = self.network.predict(images, state, words, start)
            if aims is not None:
                off = off + self.position_error(memory, aims)
            kept = (~is_pad[..., None]).float()
            if options.ask_others:
                other_off = other_off + self.other_position_error(part)
            own_error = ((found.float() - actions).abs() * kept).mean(2)
            error = error + own_error.sum(0)
            by_task[0].index_add_(0, tests.task[part], own_error.sum(1))
            by_task[1].index_add_(0, tests.task[part], kept.squeeze(2).sum(1))
            held = held + ((actions[:, :1] - actions).abs() * kept).mean(2).sum(0)
            count = count + kept.squeeze(2).sum(0)
        self.network.load_state_dict(own)
        self.network.train()
        by_row = (error / count.clamp(min=1)).tolist()
        return {
            "validation": (error.sum() / count.sum()).item(),
            **({"aim_metres": (off[0] / off[1]).item()} if off[1] else {}),
            **({"asked_metres": (other_off[0] / other_off[1]).item()} if other_off[1] else {}),
            "hold_first_row": (held.sum() / count.sum()).item(),
            "validation_by_row": [round(value, 5) for value in by_row],
            "validation_by_task": {
                task: round(value, 5) for task, value in zip(tests.tasks, (by_task[0] / by_task[1].clamp(min=1)).tolist())
            },
        }

    def position_error(self, memory, aims):
        """Sum of the position errors of the object, metres, and the number of its rows."""
        far = (self.network.aims.positions(memory.float()) - aims[0]).norm(dim=-1)[:, 0]
        return torch.stack((far.nan_to_num().sum(), far.isfinite().sum()))

    def other_position_error(self, rows):
        """As `position_error`, for held-out rows with the sentence of another object."""
        devices = [self.device] if self.device.type == "cuda" else []
        with torch.random.fork_rng(devices):
            torch.manual_seed(0)
            images, state, words, _, _, aims, other_tasks = self.batch(rows, self.tests, False, 1.0)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.options.precision == "bf16"):
            _, memory = self.network.predict(images, state, words)
        positions = torch.where((other_tasks >= 0)[:, None, None], aims[0], torch.nan)
        return self.position_error(memory, (positions, aims[1]))

    def save(self, log):
        own = {name: tensor.clone() for name, tensor in self.network.state_dict().items()}
        self.calibrate()
        self.network.load_state_dict(own)
        state = {
            "step": self.step, "spent": self.spent, "network": self.network.state_dict(), "mean": self.mean,
            "optimiser": self.optimiser.state_dict(), "random": torch.get_rng_state(),
            "random_device": torch.cuda.get_rng_state(self.device) if self.device.type == "cuda" else None,
            "shape": self.network.shape.to_dict(), "data": self.card["data"]["sha256"],
        }  # fmt: skip
        path = self.options.out / "checkpoint.pt"
        part = path.with_suffix(".part")
        torch.save(state, part)
        part.replace(path)
        entries = log.entries()
        last = {k: v for k, v in entries[-1].items() if not k.startswith("validation_by_")} if entries else {}
        reached = {"steps": self.step, "seconds": round(self.spent, 1), "last": last}
        card = {**self.card, "training": {**self.card["training"], **reached}}
        policy_file.write(self.options.out / "policy.safetensors", self.mean, card, record=self.ledger)
        # With the tensors that only training needs, for --init of another training.
        policy_file.write(self.options.out / "training.safetensors", self.mean, card, training=True, record=self.ledger)
        if self.options.travel:
            self.write_parts(card)
        if len(entries) > 1:
            curves.plot(entries, self.options.out / "curves.png", self.card["name"])

    def write_parts(self, card):
        """Writes the weights in half precision, in parts."""
        folder = self.options.travel
        folder.mkdir(parents=True, exist_ok=True)
        whole = folder / "travel.safetensors"
        policy_file.write(whole, self.network.state_dict(), card, training=True)
        data = whole.read_bytes()
        whole.unlink()
        whole.with_suffix(".json").unlink()
        for old in folder.glob("travel-*.part"):
            old.unlink()
        for number, at in enumerate(range(0, len(data), PART_BYTES)):
            (folder / f"travel-{number:02}.part").write_bytes(data[at : at + PART_BYTES])

    def check_aims(self, state, path):
        has = any(name.startswith("aims.") for name in state)
        if has != bool(self.options.aim_weight):
            fix = "give --aim-weight" if has else "leave --aim-weight out"
            raise ValueError(f"{path} was trained {'with' if has else 'without'} --aim-weight: {fix}, or choose another folder")

    def resume(self, log):
        options = self.options
        path = options.out / "checkpoint.pt"
        if path.exists():
            state = torch.load(path, map_location=self.device, weights_only=True)
            if Shape(**state["shape"]) != self.network.shape:
                raise ValueError(f"{path} has a network of another shape: choose another --out, or the same options")
            if state.get("data", self.card["data"]["sha256"]) != self.card["data"]["sha256"]:
                raise ValueError(
                    f"{path} was trained on other episodes: name the same folders, or choose another --out with "
                    f"--init {options.out / 'training.safetensors'}"
                )
            self.check_aims(state["network"], path)
            self.network.load_state_dict(state["network"])
            self.mean = state["mean"]
            self.optimiser.load_state_dict(state["optimiser"])
            torch.set_rng_state(state["random"].cpu())
            if state["random_device"] is not None and self.device.type == "cuda":
                torch.cuda.set_rng_state(state["random_device"].cpu(), self.device)
            self.step, self.spent = state["step"], state["spent"]
        elif options.travel and (parts := sorted(options.travel.glob("travel-*.part"))):
            whole = options.out / "travel.safetensors"
            whole.write_bytes(b"".join(part.read_bytes() for part in parts))
            state, card = policy_file.read(whole)
            whole.unlink()
            if Shape(**card["network"]).to_served_dict() != self.network.shape.to_served_dict():
                raise ValueError(f"{options.travel} has a network of another shape: choose another --travel")
            self.check_aims(state, options.travel)
            self.network.load_state_dict(state, strict=self.network.shape.norm != "batch")
            self.mean = {n: t.detach().clone() for n, t in self.network.state_dict().items()}
            self.step, self.spent = card["training"]["steps"], card["training"]["seconds"]
            torch.manual_seed(options.seed + self.step)
        log.truncate(self.step)
        if self.step:
            log.report(f"continues from step {self.step}")


if __name__ == "__main__":
    sys.exit(main())
