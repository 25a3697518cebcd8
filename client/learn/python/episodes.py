"""Episodes of `wheelarm dataset export --format tensors`, on one device.

Images stay 8-bit: a thousand short episodes with two cameras of 224 x 126 need 32 GB. A
batch is one gather that also pads and shifts.
"""

import hashlib
import json
import re
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
import torch
from safetensors import SafetensorError, safe_open

LAYOUT = "wheelarm-tensors/1"
STILL = {"hand": 1e-3, "knuckle": 5e-3, "chair": 1e-2}  # changes of a row below which it counts as a pause
MIN_DEVIATION = 0.01  # in the unit of the value: limits the scale of nearly constant values
UNKNOWN = 0  # index of the word for all unknown words
MIN_SPACING = 0.02  # metres between equal objects that are distinguished by their positions
AMBIGUOUS = "ambiguous"  # suffix of requests whose sentence is not shared with other episodes
DELIBERATE_ERRORS = (1, 2)  # incidents that are not imitated: wrong grasp, wrong object


class DataError(Exception):
    """Unusable episodes; the text states the error and the fix."""


def split_words(sentence):
    """The words of a sentence, in lower case."""
    return re.findall(r"[a-z0-9']+", sentence.lower())


def word_indices(sentence, vocabulary):
    """Indices of the words of a sentence in the vocabulary, whose first word is the unknown one."""
    index = {word: at for at, word in enumerate(vocabulary)}
    return [index.get(word, UNKNOWN) for word in split_words(sentence)]


@dataclass
class File:
    path: Path
    about: dict
    shapes: dict
    #: Request: the task and, if its object is one of several equal ones, its position counted
    #: from the left (`tell_equal_objects_apart`).
    request: str = ""
    #: Names of the objects in the tensor of all objects; equal ones have their position in the name.
    names: tuple = ()
    #: Object of the task, one of `names`.
    target: str | None = None

    @staticmethod
    def open(path):
        try:
            with safe_open(path, "np") as file:
                metadata = file.metadata() or {}
                shapes = {name: file.get_slice(name).get_shape() for name in file.keys()}
        except SafetensorError as error:
            raise DataError(f"cannot read {path}: {error}; export it again") from None
        about = json.loads(metadata.get("wheelarm", "{}"))
        if about.get("layout") != LAYOUT:
            raise DataError(
                f"{path} has the layout {about.get('layout')!r}, expected {LAYOUT!r}: "
                "export it again with `wheelarm dataset export --format tensors`"
            )
        names = tuple(about.get("thing_names") or ())
        return File(Path(path), about, shapes, about["task"], names, about.get("thing"))

    @property
    def rows(self):
        return self.shapes["states"][0]

    @property
    def cameras(self):
        return {n.removeprefix("pictures."): tuple(s[1:3]) for n, s in self.shapes.items() if n.startswith("pictures.")}


def find_files(folders, keep_failed=False):
    """Files of the folders, sorted by path. All must have the same format.

    Raises DataError when there are none, or they differ."""
    paths = sorted(path for folder in folders for path in Path(folder).rglob("*.safetensors"))
    if not paths:
        raise DataError(
            f"no *.safetensors below {', '.join(map(str, folders))}: write them with "
            "`wheelarm dataset export --format tensors RECORDINGS --out FOLDER`"
        )
    with ThreadPoolExecutor(16) as pool:
        files = list(pool.map(File.open, paths))
    if not keep_failed:
        files = [file for file in files if file.about["success"]]
    if not files:
        raise DataError("no episode succeeded: add others, or give --keep-failed")
    first = files[0]
    for file in files:
        for key in ("action", "action_names", "state_names", "rate_hz", "robot"):
            if file.about[key] != first.about[key]:
                raise DataError(
                    f"{file.path} has {key} {file.about[key]!r}, and {first.path} {first.about[key]!r}: use "
                    "episodes of one export"
                )
        if file.cameras != first.cameras:
            raise DataError(
                f"{file.path} has the images {file.cameras}, and {first.path} {first.cameras}: "
                "export all with the same --size"
            )
    tell_equal_objects_apart(files)
    return files


def tell_equal_objects_apart(files):
    """Distinguishes the requests of a task whose target is one of several equal objects, for
    example of four cans in a row: by the position counted from the left, as in most sentences.
    So a sentence for another position fits the scene too. Without positions, or with a sentence
    that contains neither left nor right, the sentence is not shared (`AMBIGUOUS`)."""
    about = {}
    for file in files:
        if file.target in file.names:
            about.setdefault(file.about["task"], set()).add(file.target)
    for file in files:
        task = file.about["task"]
        if len(about.get(task, ())) < 2:
            continue
        equals = [file.names.index(name) for name in sorted(about[task]) if name in file.names]
        order = None
        if len({re.sub(r"_?\d+$", "", name) for name in about[task]}) == 1 and file.target in file.names:
            order = order_from_left(file, equals)
        if order is not None:
            names = list(file.names)
            for position, at in enumerate(order, 1):
                names[equals[at]] = f"{task}: {position} of {len(equals)}"
            file.request = file.target = names[file.names.index(file.target)]
            file.names = tuple(names)
        if order is None or not re.search(r"\b(left|right)", file.about["instruction"].lower()):
            file.request = f"{task}: {AMBIGUOUS}"


def order_from_left(file, equals):
    """Order of `equals` (indices of names) from left to right of the robot, at the row before a
    lift where they are most side by side. None if they are side by side in no row, or too
    close."""
    if "things" not in file.shapes or not file.rows:
        return None
    with safe_open(file.path, "np") as opened:
        objects = opened.get_tensor("things")
    rows = objects.reshape(len(objects), len(file.names), -1)[: max(1, file.rows // 2), equals, :2].astype(np.float64)
    rows = rows[np.isfinite(rows).all((1, 2))]  # [rows, equals, x and y in the frame of the arm's base]
    if not len(rows):
        return None
    ahead = rows.mean(1) / np.maximum(np.linalg.norm(rows.mean(1), axis=1, keepdims=True), 1e-9)
    depth = np.einsum("rek,rk->re", rows, ahead)
    aside = np.einsum("rek,rk->re", rows, np.stack((-ahead[:, 1], ahead[:, 0]), 1))
    slant = np.ptp(depth, 1) / np.maximum(np.ptp(aside, 1), 1e-9)
    best = slant.argmin()
    if slant[best] > 0.5 or np.diff(np.sort(aside[best])).min() < MIN_SPACING:
        return None
    return np.argsort(-aside[best])


def split(files, share):
    """Files of training and validation. A seed is in one of them, selected by its hash."""
    seeds = sorted({file.about["seed"] for file in files})
    ranked = sorted(seeds, key=lambda s: hashlib.sha256(str(s).encode()).digest())
    count = 0 if share <= 0 or len(seeds) < 2 else max(1, round(share * len(seeds)))
    held = set(ranked[:count])
    return [f for f in files if f.about["seed"] not in held], [f for f in files if f.about["seed"] in held]


def without_pauses(actions, names, longest):
    """Indices of the rows that remain when every pause is reduced to `longest` rows. In a pause
    no target changes. A network with one row as input cannot know the length of a pause, and
    would learn to stay in it."""
    change = np.abs(np.diff(actions, axis=0, prepend=actions[:1]))
    change[:1] = np.inf
    moves = np.zeros(len(actions), bool)
    for column, name in enumerate(names):
        kind = name.split(".")[0]
        motion = np.abs(actions[:, column]) if kind == "chair" else change[:, column]
        moves |= motion > STILL.get(kind, STILL["hand"])
    since = np.zeros(len(actions), np.int64)  # rows since the last motion
    for row in range(1, len(actions)):
        since[row] = 0 if moves[row] else since[row - 1] + 1
    return np.nonzero(since <= longest)[0]


def random_indices(count):
    """Random integers from 0 to `count` - 1; 0 where `count` is 0."""
    return (torch.rand(count.shape, device=count.device) * count).long().minimum((count - 1).clamp(min=0))


class OtherTargets:
    """Other tasks whose request fits the scene of an episode: tasks of the same area, or with
    another one of several equal objects."""

    def __init__(self, files, tasks):
        about = {task: set() for task in tasks}
        for file in files:
            if file.names:
                about[file.request].add((file.target, file.about["area"]))
        # A task whose target differs between scenes is excluded: its sentences do not fit others.
        self.targets = [next(iter(about[task])) if len(about[task]) == 1 else (None, None) for task in tasks]

    def others(self, file):
        """Indices of the tasks with another object of the file's area."""
        fits = lambda target, area: area == file.about["area"] and target in file.names and target != file.target  # noqa: E731
        return [task for task, target in enumerate(self.targets) if fits(*target)]

    def fill(self, out, file, objects):
        """Writes the positions of the targets of other tasks: [rows, tasks, numbers]."""
        numbers = out.shape[2]
        for task in self.others(file):
            at = file.names.index(self.targets[task][0]) * numbers
            out[:, task] = objects[:, at : at + numbers]


class Episodes:
    """The rows of all files, concatenated, without the ends of long pauses."""

    def __init__(self, files, cameras, device, store, report=lambda text: None, pause=None, aims=0, objects=False):
        """`aims`: numbers of a row of the tensor `aims`; 0: it is not read. `objects`: whether the
        positions of the targets of other tasks are read too."""
        start, self.files, self.cameras, self.device = time.monotonic(), files, cameras, device

        def kept_rows(file):
            with safe_open(file.path, "np") as opened:
                actions = opened.get_tensor("actions")
                experts = opened.get_tensor("expert") if "expert" in file.shapes else np.ones(len(actions))
            names = file.about["action_names"]
            rows = without_pauses(actions, names, len(actions) if pause is None else pause)
            # Rows of a policy before the takeover are not imitated, so they are not stored.
            first = np.argmax(experts != 0) if experts.any() else len(experts)
            return rows[rows >= first]

        with ThreadPoolExecutor(8) as pool:
            kept = list(pool.map(kept_rows, files))
        ends = np.cumsum([len(rows) for rows in kept])
        starts = ends - [len(rows) for rows in kept]
        total = int(ends[-1])
        self.images = {
            name: torch.empty((total, height, width, 3), dtype=torch.uint8, device=store)
            for name, (height, width) in cameras
        }
        states = np.empty((total, files[0].shapes["states"][1]), np.float32)
        actions = np.empty((total, files[0].shapes["actions"][1]), np.float32)
        incidents = np.empty(total, np.uint8)
        experts = np.ones(total, np.uint8)
        aim_rows = np.full((total, aims), np.nan, np.float32)
        self.tasks = sorted({file.request for file in files})
        self.kinds = np.array([self.tasks.index(file.request) for file in files])
        other_targets = OtherTargets(files, self.tasks)
        others = np.full((total, len(self.tasks) if objects else 0, aims // 2), np.nan, np.float32)

        def load(number):
            at, rows = slice(int(starts[number]), int(ends[number])), kept[number]
            with safe_open(files[number].path, "pt") as file:
                for name, images in self.images.items():
                    images[at].copy_(file.get_tensor(f"pictures.{name}")[torch.from_numpy(rows)])
                states[at] = file.get_tensor("states").numpy()[rows]
                actions[at] = file.get_tensor("actions").numpy()[rows]
                incidents[at] = file.get_tensor("incident").numpy()[rows]
                if "expert" in files[number].shapes:
                    experts[at] = file.get_tensor("expert").numpy()[rows]
                if aims and files[number].shapes.get("aims", [0, 0])[1] == aims:
                    aim_rows[at] = file.get_tensor("aims").numpy()[rows]
                    if objects and "things" in files[number].shapes:
                        other_targets.fill(others[at], files[number], file.get_tensor("things").numpy()[rows])

        with ThreadPoolExecutor(8) as pool:
            for _ in pool.map(load, range(len(files))):
                pass
        if not (np.isfinite(states).all() and np.isfinite(actions).all()):
            raise DataError("states or actions are not finite: find the file with `wheelarm dataset validate`")
        # For each row, the end of the rows after it that may be imitated.
        limits = np.empty(total, np.int64)
        for start_row, end in zip(starts, ends):
            limit = end
            for row in range(end - 1, start_row - 1, -1):
                if incidents[row] in DELIBERATE_ERRORS or not experts[row]:
                    limit = row
                limits[row] = limit
        self.states, self.actions, self.total = states, actions, total
        self.state = torch.from_numpy(states).to(device)
        self.action = torch.from_numpy(actions).to(device)
        self.aims = torch.from_numpy(aim_rows).to(device)
        self.other_aims, self.other_targets = torch.from_numpy(others).to(device), other_targets
        self.limit = torch.from_numpy(limits).to(device)
        self.episode = torch.from_numpy(np.repeat(np.arange(len(files)), ends - starts)).to(device)
        self.starts, self.ends = starts, ends
        self.task = torch.from_numpy(np.repeat(self.kinds, ends - starts)).to(device)
        whole = sum(file.rows for file in files)
        report(f"{len(files)} episodes, {total} of {whole} rows read in {time.monotonic() - start:.1f} s")

    def set_sentences(self, vocabulary, shared=()):
        """Sets the words of every episode: [episodes, longest], padded with -1. `shared` are
        patterns of tasks whose episodes share their sentences."""
        sentences = [word_indices(file.about["instruction"], vocabulary) for file in self.files]
        longest = max(1, max(map(len, sentences)))
        table = np.full((len(sentences), longest), -1, np.int64)
        for row, sentence in zip(table, sentences):
            row[: len(sentence)] = sentence
        self.words = torch.from_numpy(table).to(self.device)
        # Episodes sorted by task; first and number of those whose sentences an episode may use.
        order = np.argsort(self.kinds, kind="stable")
        places = np.argsort(order, kind="stable")
        first, count = places.copy(), np.ones(len(sentences), np.int64)
        name = lambda kind: kind.split(":")[0]  # noqa: E731
        fits = lambda kind: not kind.endswith(AMBIGUOUS) and any(fnmatch(name(kind), pattern) for pattern in shared)  # noqa: E731
        for kind, task in enumerate(self.tasks):
            own = self.kinds == kind
            if own.any() and fits(task):
                first[own], count[own] = places[own].min(), own.sum()
        tensor = lambda values: torch.from_numpy(np.asarray(values, np.int64)).to(self.device)  # noqa: E731
        self.by_task, self.first_sentence, self.count_sentences = tensor(order), tensor(first), tensor(count)
        is_shared = [fits(task) for task in self.tasks]
        others = [[o for o in self.other_targets.others(file) if is_shared[o]] for file in self.files]
        table = np.zeros((len(sentences), max(1, max(map(len, others)))), np.int64)
        for row, tasks in zip(table, others):
            row[: len(tasks)] = tasks
        self.others, self.count_others = tensor(table), tensor([len(tasks) for tasks in others])
        counts = np.bincount(self.kinds, minlength=len(self.tasks))
        self.first_of_task, self.count_of_task = tensor(counts.cumsum() - counts), tensor(counts)

    def weights(self, knuckle, around, factor, balanced=False):
        """Sampling weight of each row: `factor` within `around` rows of a change of the gripper, 0
        where nothing may be imitated, else 1. `balanced`: equal sums for all tasks."""
        weights = np.ones(self.total, np.float32)
        for start, end in zip(self.starts, self.ends):
            change = np.abs(np.diff(self.actions[start:end, knuckle])) > 0.01
            for row in np.nonzero(change)[0]:
                weights[max(start, start + row - around) : min(end, start + row + around + 1)] = factor
        limit = self.limit.cpu().numpy()
        weights[limit <= np.arange(self.total)] = 0
        if balanced:
            names = sorted({file.about["task"] for file in self.files})
            tasks = np.array([names.index(file.about["task"]) for file in self.files])
            tasks = np.repeat(tasks, self.ends - self.starts)
            sums = np.bincount(tasks, weights, len(names))
            weights *= (weights.sum() / len(names) / np.maximum(sums, 1e-9))[tasks].astype(np.float32)
        return torch.from_numpy(weights).to(self.device)

    def sample_other_tasks(self, rows, share):
        """For a `share` of the rows the index of a task with another object of the same area; -1
        for the others: [B]."""
        episode = self.episode[rows]
        count = self.count_others[episode]
        other = self.others[episode, random_indices(count)]
        return torch.where((torch.rand(len(rows), device=rows.device) < share) & (count > 0), other, -1)

    def numbers(self, rows, chunk, is_training, other_tasks=None):
        """State [B, S], actions [B, chunk, A], whether padding [B, chunk], words. Rows with one of
        the `other_tasks` have its words, and only padding as actions."""
        at = rows[:, None] + torch.arange(chunk, device=rows.device)
        limit = self.limit[rows][:, None]
        actions = self.action[torch.minimum(at, (limit - 1).clamp(min=0))]
        sentence = self.episode[rows]
        if is_training:
            sentence = self.by_task[self.first_sentence[sentence] + random_indices(self.count_sentences[sentence])]
        is_pad = at >= limit
        if other_tasks is not None:
            is_other = other_tasks >= 0
            other = self.first_of_task[other_tasks] + random_indices(self.count_of_task[other_tasks])
            sentence = torch.where(is_other, self.by_task[other], sentence)
            is_pad = is_pad | is_other[:, None]
        return self.state[rows], actions, is_pad, self.words[sentence]

    def aim_rows(self, rows, other_tasks=None):
        """Positions of object and goal, as rows of `aims`: [B, numbers]. Rows with one of the
        `other_tasks` have the position of its object, and no goal."""
        own = self.aims[rows]
        if other_tasks is None:
            return own
        other = self.other_aims[rows, other_tasks]
        return torch.where((other_tasks >= 0)[:, None], torch.cat((other, torch.full_like(other, torch.nan)), 1), own)

    def padded_images(self, rows, padded, shift):
        """Images [B, cameras, height, width, 3], 8-bit: padded on all sides with the edge to
        (height, width), each shifted by up to `shift` pixels in x and y. Also the offset of the
        content by padding and shift, pixels: [B, cameras, 2], x and y."""
        out, offsets = [], []
        for name, (height, width) in self.cameras:
            store = self.images[name]
            count, device = len(rows), store.device
            top, left = (padded[0] - height) // 2, (padded[1] - width) // 2
            move = torch.zeros((2, count, 1), dtype=torch.long, device=device)
            if shift:
                move = torch.randint(-shift, shift + 1, (2, count, 1), device=device)
            y = (torch.arange(padded[0], device=device) - top + move[0]).clamp(0, height - 1)
            x = (torch.arange(padded[1], device=device) - left + move[1]).clamp(0, width - 1)
            at = rows.to(device)[:, None, None]
            offsets.append(torch.cat((left - move[1], top - move[0]), 1))
            out.append(store[at, y[:, :, None], x[:, None, :]].to(self.device, non_blocking=True))
        return torch.stack(out, 1), torch.stack(offsets, 1).to(self.device)


def statistics(episodes):
    """Mean and standard deviation of states and actions; the deviation is at least 0.01."""
    out = {}
    for name, rows in (("state", episodes.states), ("action", episodes.actions)):
        rows = rows.astype(np.float64)
        out[name] = (
            rows.mean(0).astype(np.float32),
            np.maximum(rows.std(0), MIN_DEVIATION).astype(np.float32),
        )
    return out


def digest(files):
    """A hash of the training data: labels, seeds, sentences and row counts."""
    rows = [[f.about["label"], f.about["seed"], f.about["instruction"], f.rows] for f in files]
    return hashlib.sha256(json.dumps(sorted(rows)).encode()).hexdigest()
