"""Checks the language columns of a LeRobot export by the rules of LeRobot 0.6.

The rules are those of lerobot/datasets/language.py: persistent rows are in every frame of their
episode, with times of frames; rows about a view name the feature of a camera, the others none;
each style belongs to one of the two columns.

Usage: check_language.py DATASET
"""

import json
import pathlib
import sys

import pyarrow.parquet

PERSISTENT, EVENTS = {"subtask", "plan"}, {"vqa", "trace"}
FIELDS = ["role", "content", "style", "timestamp", "camera", "tool_calls"]


def main(folder):
    info = json.loads((folder / "meta/info.json").read_text())
    for name in ("language_persistent", "language_events"):
        assert info["features"][name] == {"dtype": "language", "shape": [1], "names": None}
    cameras = {k for k in info["features"] if k.startswith("observation.images.")}
    tables = [pyarrow.parquet.read_table(p) for p in sorted(folder.glob("data/*/*.parquet"))]
    columns = ["episode_index", "timestamp", "language_persistent", "language_events"]
    rows = [row for table in tables for row in table.select(columns).to_pylist()]
    counts = {}
    for episode in sorted({row["episode_index"] for row in rows}):
        own = [row for row in rows if row["episode_index"] == episode]
        always = own[0]["language_persistent"]
        times = {row["timestamp"] for row in own}
        assert all(row["language_persistent"] == always for row in own)
        for entry in always:
            assert list(entry) == FIELDS and entry["style"] in PERSISTENT, entry
            assert entry["camera"] is None and entry["timestamp"] in times, entry
            assert entry["role"] == "assistant" and entry["content"]
        steps = [entry["content"] for entry in always if entry["style"] == "subtask"]
        assert len(steps) >= 3, steps
        for row in own:
            questions = [entry for entry in row["language_events"] if entry["style"] == "vqa"]
            assert [entry["role"] for entry in questions] == ["user", "assistant"] * (len(questions) // 2)
            for entry in row["language_events"]:
                assert list(entry) == [f for f in FIELDS if f != "timestamp"], entry
                assert entry["style"] in EVENTS and entry["camera"] in cameras, entry
                counts[entry["style"]] = counts.get(entry["style"], 0) + 1
                if entry["style"] == "trace":
                    assert all(len(point) == 2 for point in json.loads(entry["content"]))
    assert set(counts) == EVENTS, counts
    print(f"{len(rows)} rows:", ", ".join(f"{k} {n}" for k, n in sorted(counts.items())))


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
