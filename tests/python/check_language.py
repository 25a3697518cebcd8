"""Checks the language columns of a LeRobot export against LeRobot 0.6's own rules.

The rules are those of lerobot/datasets/language.py: persistent rows stand in every
frame of their episode, with times of frames; rows that are about a view name a
camera's feature, the others none; styles belong to one of the two columns.

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
        for said in always:
            assert list(said) == FIELDS and said["style"] in PERSISTENT, said
            assert said["camera"] is None and said["timestamp"] in times, said
            assert said["role"] == "assistant" and said["content"]
        steps = [said["content"] for said in always if said["style"] == "subtask"]
        assert len(steps) >= 3, steps
        for row in own:
            asked = [said for said in row["language_events"] if said["style"] == "vqa"]
            assert [said["role"] for said in asked] == ["user", "assistant"] * (len(asked) // 2)
            for said in row["language_events"]:
                assert list(said) == [f for f in FIELDS if f != "timestamp"], said
                assert said["style"] in EVENTS and said["camera"] in cameras, said
                counts[said["style"]] = counts.get(said["style"], 0) + 1
                if said["style"] == "trace":
                    assert all(len(point) == 2 for point in json.loads(said["content"]))
    assert set(counts) == EVENTS, counts
    print(f"{len(rows)} rows:", ", ".join(f"{k} {n}" for k, n in sorted(counts.items())))


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
