#!/usr/bin/env python3
"""Trains a policy on a GPU (or, small ones, on a CPU).

    wheelarm dataset export --format tensors data/mustard/episodes --trim-idle 0.5 --out data/tensors
    python3 train.py data/tensors --out runs/mustard --steps 30000 --seconds 500
    python3 train.py data/tensors --out runs/mustard --steps 30000 --seconds 500    # goes on
    wheelarm-learn serve runs/mustard/policy.safetensors

Needs torch, numpy and safetensors; draws curves where matplotlib is there. The same
command goes on from the last checkpoint, until all steps are done: exit code 0 then,
4 while steps are left.
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

import numpy as np
import torch

import aims
import curves
import policy_file
from begin import begin_from
from episodes import Episodes, NoData, digest, find, split, statistics, words_of
from network import Policy, Shape
from progress import Log, line, locked

UNFINISHED = 4
PART_BYTES = 15_000_000  # a part of a checkpoint that travels
IMAGENET = {"mean": [0.485, 0.456, 0.406], "std": [0.229, 0.224, 0.225]}
WARM_STEPS = 20  # steps before one is captured as a graph
CALIBRATING = 16  # batches that the statistics of batch norms are of
MULTIPLE = 32  # what ResNet18 divides pictures by


def weight(text):
    value = float(text)
    if not 0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is no weight: say a number from 0 on")
    return value


def share(text):
    value = weight(text)
    if value >= 1:
        raise argparse.ArgumentTypeError(f"{text} is no share: say a number from 0 to below 1")
    return value


def arguments():
    shape = Shape()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("data", nargs="+", type=Path, help="folders with *.safetensors of `dataset export --format tensors`")
    add("--out", type=Path, required=True, help="folder for checkpoint, log, curves and policy")
    add("--name", help="name of the policy; that of --out without it")
    add("--kind", choices=["act", "flow"], default="act")
    add("--steps", type=int, default=30000, help="training steps in all; the cosine ends with them")
    add("--within", type=float, metavar="SECONDS", help="time of training in all: steps and cosine end with it at the latest")
    add("--seconds", type=float, help="ends this call after so many seconds, with a checkpoint")
    add("--batch", type=int, default=64)
    add("--lr", type=float, default=1e-4)
    add("--lr-backbone", type=float, help="learning rate of the ResNet; --lr without it")
    add("--weight-decay", type=float, default=1e-4)
    add("--warm-up", type=int, default=500, help="steps")
    add("--kl", type=float, default=5.0, help="weight of the latent's divergence")
    add("--chunk", type=int, default=shape.chunk, help="rows that are answered")
    add("--execute", type=int, default=10, help="rows of these that are played; for the card")
    add("--width", type=int, default=shape.width, help="channels of the first stage of the ResNet")
    add("--norm", choices=["group", "batch", "frozen-bn"], default=shape.norm,
        help="frozen-bn with --backbone; batch is fastest on a GPU, and saved as frozen-bn")
    add("--film", action="store_true", help="the words scale and shift what each stage of the ResNet gives (FiLM)")
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
    add("--no-language", action="store_true", help="the sentence is not read")
    add("--unknown-words", type=float, default=0.05, help="share of words hidden in training")
    add("--share-sentences", default="", metavar="PATTERNS",
        help="tasks, comma separated, * for any letters, of which each sentence fits every episode: a row is told one of "
        "all that its task has; 'pick_*'")
    add("--balance-tasks", action="store_true", help="draws rows of every task alike, however many it has")
    add("--cameras", help="names, comma separated; all without it")
    add("--without-state", default="", metavar="PATTERNS",
        help="names of the state that stay hidden, comma separated, * for any letters: '*.velocity,odometry.*'")
    add("--state-noise", type=float, default=0.0, help="deviations of noise on the state")
    add("--shift", type=int, default=8, help="pixels that pictures are shifted at most")
    add("--jitter", type=float, default=0.3, help="strength of changes of brightness, contrast, saturation")
    add("--gripper-weight", type=float, default=3.0, help="rows about a change of the gripper are drawn so often")
    add("--gripper-seconds", type=float, default=1.0, help="seconds before and behind that count as about it")
    add("--aim-weight", type=weight, default=0.0, help="weight of finding the task's thing and goal, where tensors tell "
        "them (`aims`), beside the actions; learned, and not served")
    add("--ask-others", type=share, default=0.0, metavar="SHARE", help="share of the rows that are told to get another thing "
        "of the area, by a sentence of --share-sentences, and learn only where that is; with --aim-weight")
    add("--ema", type=float, default=0.999, help="decay of the mean of the weights that is saved")
    add("--validation", type=float, default=0.05, help="share of the seeds that is held out")
    add("--pause", type=int, metavar="ROWS", help="rows that stay of a pause in which nothing moves; all without it")
    add("--keep-failed", action="store_true", help="also learns from episodes that failed")
    add("--init", type=Path, help="policy to start from; training.safetensors beside it has all that was learned")
    add("--precision", choices=["tf32", "bf16", "fp32"], default="tf32")
    add("--no-graph", action="store_true", help="no CUDA graph of a training step")
    add("--store", choices=["auto", "device", "cpu"], default="auto", help="where pictures lie")
    add("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    add("--interval", type=int, default=500, help="steps between lines of the log")
    add("--save-seconds", type=float, default=60.0, help="seconds between checkpoints")
    add("--travel", type=Path, help=f"folder for checkpoints in parts of {PART_BYTES // 10**6} MB at most, "
        "without the state of the optimiser; read when --out has none")
    add("--seed", type=int, default=0)
    return parser.parse_args()


def main():
    options = arguments()
    started = time.monotonic()
    try:
        return train(options, started)
    except (NoData, ValueError, OSError) as problem:
        print(f"train.py: {problem}", file=sys.stderr)
        return 1


def device_of(name):
    """The device of that name, where it is there."""
    try:
        torch.empty(1, device=name)
    except (RuntimeError, AssertionError) as problem:
        words = str(problem).splitlines()[0]
        raise ValueError(f"--device {name} cannot be used ({words}): leave --device out, or say cpu") from None
    return torch.device(name)


def train(options, started):
    if options.ask_others and (not options.aim_weight or not options.share_sentences or options.no_language):
        raise ValueError("--ask-others needs --aim-weight, --share-sentences and words: say them, or leave it out")
    device = device_of(options.device)
    tf32 = options.precision == "tf32"
    torch.backends.cuda.matmul.allow_tf32 = torch.backends.cudnn.allow_tf32 = tf32
    torch.backends.cudnn.benchmark = True
    torch.manual_seed(options.seed)
    options.out.mkdir(parents=True, exist_ok=True)
    lock = locked(options.out)  # noqa: F841, held until the end
    log = Log(options.out)

    files = find(options.data, options.keep_failed)
    about = files[0].about
    available = files[0].cameras
    names = options.cameras.split(",") if options.cameras else sorted(available)
    if missing := [name for name in names if name not in available]:
        raise NoData(f"there is no camera {missing[0]!r} in the episodes; there are {', '.join(available)}")
    cameras = [(name, available[name]) for name in names]
    if len({size for _, size in cameras}) > 1:
        raise NoData(f"cameras differ in size ({cameras}): export them with --size")
    padded = tuple(-(-side // MULTIPLE) * MULTIPLE for side in cameras[0][1])
    learned, held = split(files, options.validation)
    before = set(policy_file.read(options.init)[1].get("training_seeds", [])) if options.init else set()
    if known := [file for file in held if file.about["seed"] in before]:
        log.say(f"{len(known)} episodes are not held out: --init has learned from their seeds")
        held = [file for file in held if file.about["seed"] not in before]
    store = place(options, device, files, names)
    aim_width, asks = aims.width(len(cameras)) if options.aim_weight else 0, options.ask_others > 0
    if aim_width and names != sorted(available):
        raise ValueError("--aim-weight needs all cameras of the episodes: leave --cameras out")
    episodes = Episodes(learned, cameras, device, store, log.say, options.pause, aim_width, asks)
    tests = Episodes(held, cameras, device, store, log.say, options.pause, aim_width, asks) if held else None
    if aim_width and not episodes.aims.isfinite().any():
        raise NoData("no episode tells where things are (`aims`): export anew, or leave --aim-weight out")
    numbers = statistics(episodes)
    vocabulary = []
    if not options.no_language:
        vocabulary = ["<unknown>"] + sorted({w for f in learned for w in words_of(f.about["instruction"])})
    for part in (episodes, tests):
        if part is not None:
            part.tell(vocabulary, [p for p in options.share_sentences.split(",") if p])
    if options.ask_others and not episodes.count_others.any():
        raise NoData(
            "nothing can be asked for by --ask-others: episodes of before tell no `things` (export anew), or no two tasks "
            f"of one area, each about one thing, fit --share-sentences {options.share_sentences!r}; leave it out else"
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
        network.aims = aims.Aims(shape, *aims.statistics(episodes.aims, len(cameras)))
    network.to(device)
    if device.type == "cuda":
        network.model.backbone.to(memory_format=torch.channels_last)
    if options.backbone:
        backbone(network, options)
    hidden = hidden_state(about["state_names"], options.without_state)
    told = card(options, shape, about, cameras, numbers, vocabulary, hidden, learned, held, network)
    before = begin_from(network, options.init, told) if options.init else {}
    run = Run(options, network, episodes, tests, numbers, hidden, padded, about, device)
    run.card = told
    run.card["training_seeds"] = sorted({*run.card["training_seeds"], *before.get("training_seeds", [])})
    run.resume(log)
    parameters = sum(p.numel() for p in network.parameters())
    log.say(f"{options.kind}, {parameters / 1e6:.2f} M parameters, {len(learned)} episodes, {len(held)} held out, on {device}")
    return run.go(log, started)


def place(options, device, files, names):
    """Where pictures lie: on the device where they leave a third of it."""
    if options.store != "auto":
        return device if options.store == "device" else torch.device("cpu")
    if device.type != "cuda":
        return device
    size = sum(math.prod(f.shapes[f"pictures.{name}"]) for f in files for name in names)
    free = torch.cuda.mem_get_info(device)[0]
    return device if size < free * 0.67 else torch.device("cpu")


def hidden_state(names, patterns):
    patterns = [p for p in patterns.split(",") if p]
    for pattern in patterns:
        if not any(fnmatch(name, pattern) for name in names):
            raise ValueError(f"no name of the state is {pattern!r}: {', '.join(names)}")
    return [any(fnmatch(name, p) for p in patterns) for name in names]


def backbone(network, options):
    if options.norm != "frozen-bn":
        raise ValueError("--backbone has the norms of its training: use it with --norm frozen-bn")
    if options.backbone.suffix == ".safetensors":
        from safetensors.torch import load_file

        state = load_file(options.backbone)
    else:
        state = torch.load(options.backbone, map_location="cpu", weights_only=True)
    state = {n: t for n, t in state.items() if not n.startswith("fc.") and not n.endswith("num_batches_tracked")}
    missing, unknown = network.model.backbone.load_state_dict(state, strict=False)
    if missing or unknown:
        raise ValueError(f"{options.backbone} is no resnet18: missing {missing[:3]}, unknown {unknown[:3]}")


def card(options, shape, about, cameras, numbers, vocabulary, hidden, learned, held, network):
    commit = subprocess.run(["git", "rev-parse", "--short=12", "HEAD"], capture_output=True, text=True,
        cwd=Path(__file__).parent).stdout.strip()  # fmt: skip
    (state_mean, state_std), (action_mean, action_std) = numbers["state"], numbers["action"]
    return {
        "name": options.name or options.out.name,
        "network": shape.served(),
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
        "training_seeds": sorted({f.about["seed"] for f in learned}),
        "validation_seeds": sorted({f.about["seed"] for f in held}),
        "tasks": sorted({f.about["task"] for f in learned}),
        "data": {"episodes": len(learned), "rows": sum(f.rows for f in learned), "sha256": digest(learned)},
        "training": {
            "commit": os.environ.get("WHEELARM_COMMIT") or commit or "unknown",
            "torch": torch.__version__,
            "device": torch.cuda.get_device_name() if options.device.startswith("cuda") else "cpu",
            "parameters": sum(p.numel() for p in network.parameters()),
            "options": {k: str(v) if isinstance(v, Path) else v for k, v in vars(options).items()
                if k not in ("data", "out", "travel", "seconds", "within", "device", "init", "backbone")},
            "init": policy_file.sha256(options.init) if options.init else None,
            "backbone": policy_file.sha256(options.backbone) if options.backbone else None,
        },
    }  # fmt: skip


class Run:
    """What changes in training."""

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
        # A step is one graph where all that it needs lies on the GPU.
        on_gpu = device.type == "cuda" and all(p.device.type == "cuda" for p in episodes.pictures.values())
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
        # torch draws by weight from 2^24 rows at most; the sums do for any number.
        self.sums = self.weights.double().cumsum(0)

    # What a step sees.
    def batch(self, rows, source, is_training, ask=0.0):
        """`ask`: share of the rows that are asked for another thing."""
        options = self.options
        asked = source.asked(rows, ask) if ask else None
        state, actions, is_pad, words = source.numbers(rows, options.chunk, is_training, asked)
        state = (state - self.state_mean) / self.state_std
        pictures, moved = source.seen(rows, self.padded, options.shift if is_training else 0)
        pictures = policy_file.prepared(pictures, self.card) if not is_training else self.altered(pictures)
        if is_training and options.state_noise:
            state = state + options.state_noise * torch.randn_like(state)
        if is_training and options.unknown_words and self.network.shape.words:
            hide = torch.rand(words.shape, device=words.device) < options.unknown_words
            words = torch.where(hide & (words >= 0), 0, words)
        state = state * self.shown
        actions = (actions - self.action_mean) / self.action_std
        return pictures, state, words, actions, is_pad, self.aimed(source, rows, moved, asked), asked

    def aimed(self, source, rows, moved, asked):
        """Places of thing and goal, metres, and their pixels in the padded pictures."""
        if not self.options.aim_weight:
            return None
        places, shares = aims.split_row(source.places(rows, asked), len(source.cameras))
        sizes = [[width, height] for _, (height, width) in source.cameras]
        # What was copied to the device before is no part of a graph.
        if self.sizes is None:
            self.sizes = torch.tensor(sizes, dtype=torch.float32, device=self.device)
        return places, shares * self.sizes[:, None] + moved[:, :, None]

    def altered(self, pictures):
        """Brightness, contrast and saturation of each picture changed, and prepared."""
        strength = self.options.jitter
        x = pictures.permute(0, 1, 4, 2, 3).float() / 255
        if strength:
            factor = lambda: 1 + strength * (2 * torch.rand(*x.shape[:2], 1, 1, 1, device=x.device) - 1)  # noqa: E731
            x = x * factor()
            mean = x.mean((2, 3, 4), keepdim=True)
            x = (x - mean) * factor() + mean
            grey = x.mean(2, keepdim=True)
            x = ((x - grey) * factor() + grey).clamp(0, 1)
        mean, deviation = self.channels
        return (x - mean) / deviation

    def drawn(self):
        at = torch.rand(self.options.batch, device=self.device, dtype=torch.float64) * self.sums[-1]
        return torch.searchsorted(self.sums, at, right=True).clamp(max=len(self.sums) - 1)

    def go(self, log, started):
        options, network = self.options, self.network
        stop = {"asked": False}
        for name in (signal.SIGTERM, signal.SIGINT):
            signal.signal(name, lambda *_: stop.update(asked=True))
        network.train()
        self.begin()
        began, before = time.monotonic(), self.spent
        saved, first, sums, counted = began, self.step, {}, 0
        while self.progress() < 1:
            parts = self.advance()
            counted += 1
            for key, value in parts.items():
                sums[key] = sums.get(key, 0.0) + value
            now = time.monotonic()
            self.spent = before + now - began
            if self.step % options.interval == 0 or self.progress() >= 1:
                entry = self.measured(sums, counted, now - began, first)
                sums, counted = {}, 0
                log.add(entry)
                log.say(line(entry, options.steps))
            elif self.step % 20 == 0:
                log.bar(self.step, options.steps, (self.step - first) * self.pictures() / (now - began))
            over = options.seconds is not None and now - started > options.seconds
            if stop["asked"] or over:
                break
            if now - saved > options.save_seconds:
                self.save(log)
                saved = time.monotonic()
        self.save(log)
        is_done = self.progress() >= 1
        log.say(f"step {self.step} of {options.steps}: {'done' if is_done else 'the same command goes on'}")
        return 0 if is_done else UNFINISHED

    def progress(self):
        """Share of the training that is done, by steps or by time."""
        within = self.options.within
        return max(self.step / self.options.steps, self.spent / within if within else 0.0)

    def pictures(self):
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
            # What is captured later must have run on a stream of its own before.
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
        pictures, state, words, actions, is_pad, aimed, _ = self.batch(self.drawn(), self.episodes, True, options.ask_others)
        bf16 = options.precision == "bf16"
        with torch.autocast(self.device.type, torch.bfloat16, enabled=bf16, cache_enabled=not self.is_graphed):
            loss, parts, memory = self.network.loss(pictures, state, words, actions, is_pad, options.kl)
        if aimed is not None:
            parts["aim"] = self.network.aims.loss(memory.float(), self.grid, *aimed)
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

    def begin(self):
        """What steps need, after the weights have been read."""
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
        """Gives the mean weights the statistics of what their batch norms see; the
        network has those weights afterwards."""
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
            for _ in range(CALIBRATING):
                pictures, _, words, *_ = self.batch(self.drawn(), self.episodes, True)
                with torch.autocast(self.device.type, torch.bfloat16, enabled=bf16):
                    self.network.model.features(pictures, self.network.language(words))
        for norm in norms:
            norm.momentum = 0.1
        for name, tensor in self.network.state_dict().items():
            self.mean[name].copy_(tensor)

    @torch.no_grad()
    def measured(self, sums, counted, seconds, first):
        rate = float(self.optimiser.param_groups[0]["lr"])
        entry = {"step": self.step, "seconds": round(self.spent, 1), "lr": rate}
        entry |= {key: (value / counted).item() for key, value in sums.items()}
        entry["pictures_per_second"] = round((self.step - first) * self.pictures() / seconds)
        if self.tests is not None:
            entry |= self.validated()
        return entry

    @torch.no_grad()
    def validated(self, most=1024):
        """L1 of the mean weights on held-out episodes, normalised; of the first row
        held; by the tenths of the chunk."""
        options, tests = self.options, self.tests
        rows = torch.linspace(0, tests.total - 1, min(most, tests.total), device=self.device).long()
        own = {name: tensor.clone() for name, tensor in self.network.state_dict().items()}
        self.calibrate()
        self.network.eval()
        noise = torch.Generator(device=self.device).manual_seed(0)
        error, held, count = 0.0, 0.0, 0.0
        off, asked_off = torch.zeros((2, 2), device=self.device)
        by_task = torch.zeros(2, len(tests.tasks), device=self.device)
        for part in rows.split(options.batch):
            pictures, state, words, actions, is_pad, aimed, _ = self.batch(part, tests, False)
            start = torch.randn(actions.shape, device=self.device, generator=noise)
            with torch.autocast(self.device.type, torch.bfloat16, enabled=options.precision == "bf16"):
                found, memory = self.network.found(pictures, state, words, start)
            if aimed is not None:
                off = off + self.missed(memory, aimed)
            kept = (~is_pad[..., None]).float()
            if options.ask_others:
                asked_off = asked_off + self.missed_others(part)
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
            **({"asked_metres": (asked_off[0] / asked_off[1]).item()} if asked_off[1] else {}),
            "hold_first_row": (held.sum() / count.sum()).item(),
            "validation_by_row": [round(value, 5) for value in by_row],
            "validation_by_task": {
                task: round(value, 5) for task, value in zip(tests.tasks, (by_task[0] / by_task[1].clamp(min=1)).tolist())
            },
        }

    def missed(self, memory, aimed):
        """By how much the thing is missed in all, metres, and of how many rows."""
        far = (self.network.aims.places(memory.float()) - aimed[0]).norm(dim=-1)[:, 0]
        return torch.stack((far.nan_to_num().sum(), far.isfinite().sum()))

    def missed_others(self, rows):
        """As `missed`, of held-out rows that are asked for another thing."""
        devices = [self.device] if self.device.type == "cuda" else []
        with torch.random.fork_rng(devices):
            torch.manual_seed(0)
            pictures, state, words, _, _, aimed, asked = self.batch(rows, self.tests, False, 1.0)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.options.precision == "bf16"):
            _, memory = self.network.found(pictures, state, words)
        places = torch.where((asked >= 0)[:, None, None], aimed[0], torch.nan)
        return self.missed(memory, (places, aimed[1]))

    def save(self, log):
        own = {name: tensor.clone() for name, tensor in self.network.state_dict().items()}
        self.calibrate()
        self.network.load_state_dict(own)
        state = {
            "step": self.step, "spent": self.spent, "network": self.network.state_dict(), "mean": self.mean,
            "optimiser": self.optimiser.state_dict(), "random": torch.get_rng_state(),
            "random_device": torch.cuda.get_rng_state(self.device) if self.device.type == "cuda" else None,
            "shape": self.network.shape.told(), "data": self.card["data"]["sha256"],
        }  # fmt: skip
        path = self.options.out / "checkpoint.pt"
        part = path.with_suffix(".part")
        torch.save(state, part)
        part.replace(path)
        entries = log.entries()
        last = {k: v for k, v in entries[-1].items() if not k.startswith("validation_by_")} if entries else {}
        reached = {"steps": self.step, "seconds": round(self.spent, 1), "last": last}
        card = {**self.card, "training": {**self.card["training"], **reached}}
        policy_file.write(self.options.out / "policy.safetensors", self.mean, card)
        # With what only training needs, for --init of another.
        policy_file.write(self.options.out / "training.safetensors", self.mean, card, training=True)
        if self.options.travel:
            self.pack(card)
        if len(entries) > 1:
            curves.draw(entries, self.options.out / "curves.png", self.card["name"])

    def pack(self, card):
        """Weights in half precision, in parts that travel."""
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

    def same_aims(self, state, path):
        has = any(name.startswith("aims.") for name in state)
        if has != bool(self.options.aim_weight):
            cure = "say --aim-weight as before" if has else "leave --aim-weight out"
            raise ValueError(f"{path} was trained {'with' if has else 'without'} --aim-weight: {cure}, or choose another folder")

    def resume(self, log):
        options = self.options
        path = options.out / "checkpoint.pt"
        if path.exists():
            state = torch.load(path, map_location=self.device, weights_only=True)
            if Shape(**state["shape"]) != self.network.shape:
                raise ValueError(f"{path} is of a network of another shape: choose another --out, or the options of before")
            if state.get("data", self.card["data"]["sha256"]) != self.card["data"]["sha256"]:
                raise ValueError(
                    f"{path} was trained on other episodes: name the folders of before, or say another --out with "
                    f"--init {options.out / 'training.safetensors'}"
                )
            self.same_aims(state["network"], path)
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
            if Shape(**card["network"]).served() != self.network.shape.served():
                raise ValueError(f"{options.travel} is of a network of another shape: choose another --travel")
            self.same_aims(state, options.travel)
            self.network.load_state_dict(state, strict=self.network.shape.norm != "batch")
            self.mean = {n: t.detach().clone() for n, t in self.network.state_dict().items()}
            self.step, self.spent = card["training"]["steps"], card["training"]["seconds"]
            torch.manual_seed(options.seed + self.step)
        log.cut(self.step)
        if self.step:
            log.say(f"goes on from step {self.step}")


if __name__ == "__main__":
    sys.exit(main())
