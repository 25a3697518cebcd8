#!/usr/bin/env python3
"""Results of `make test-objects`.

    object_results.py pending [KIND or OBJECT …]   names of objects without a result
    object_results.py report                       writes docs/results/objects.md
    object_results.py untried                      marks objects without trials as scenery where
                                                   no object of their kind passed

Reads assets/kinds.toml, and all but the last the lines of $OBJECT_RESULTS.
"""

import collections
import json
import os
import pathlib
import sys
import tomllib

DOCUMENT = pathlib.Path("docs/results/objects.md")
FIRST, LAST = "<!-- figures -->\n", "<!-- end of figures -->"
KINDS = tomllib.loads(pathlib.Path("assets/kinds.toml").read_text())["kind"]
NEEDED = 0.9


def results():
    lines = pathlib.Path(os.environ["OBJECT_RESULTS"]).read_text().splitlines()
    return {(result := json.loads(line))["object"]: result for line in lines}


def has_grasps(name, pack):
    text = pathlib.Path(f"assets/packs/{pack}/objects/{name}.toml").read_text()
    return "grasps" in tomllib.loads(text)


def pending(wanted):
    done = results()
    for kind in KINDS:
        for instance in kind["instance"]:
            name = f"{kind['name']}-{instance['name']}"
            is_wanted = not wanted or kind["name"] in wanted or name in wanted
            if is_wanted and name not in done and has_grasps(name, kind["pack"]):
                print(name)


def untried():
    for kind in KINDS:
        files = [pathlib.Path(f"assets/packs/{kind['pack']}/objects/{kind['name']}-{instance['name']}.toml")
                 for instance in kind["instance"]]
        stocks = [tomllib.loads(file.read_text()).get("stock", {}) for file in files]
        passes = any("trials" in stock and not stock.get("scenery") for stock in stocks)
        for file, stock in zip(files, stocks):
            if not stock or "trials" in stock:
                continue
            text = file.read_text().replace("scenery = true\n", "")
            if not passes:
                text = text.replace("yaw_deg = ", "scenery = true\nyaw_deg = ", 1)
            file.write_text(text)
            print(f"{file.stem}: {'as its kind' if passes else 'scenery'}")


def words(failures):
    return ", ".join(f"{count} {why}" for why, count in failures.most_common(3))


def report():
    done = results()
    rows, passed, repeated, care_missing = [], [], [], []
    ways = collections.defaultdict(lambda: [0, 0, 0, 0, collections.Counter()])
    down = [0, 0, 0.0]
    for kind in KINDS:
        names = [f"{kind['name']}-{instance['name']}" for instance in kind["instance"]]
        scenery = [name for name in names if not has_grasps(name, kind["pack"])]
        own = [done[name] for name in names if name in done]
        good = [result for result in own if result["trials"]["lifted"] >= NEEDED * result["trials"]["of"]]
        failures, grasps = collections.Counter(), collections.Counter()
        for result in own:
            trials = result["trials"]
            failures.update(trials["failures"])
            grasps.update(result["kept"])
            down = [down[0] + trials["put_down"], down[1] + trials["rested"], max(down[2], trials["still_after_s"])]
            for way, tally in zip(result["sampled"], result["grasps"]):
                count = ways[way]
                count[0] += 1
                count[1] += 2 * tally["lifted"] >= tally["of"]
                count[2] += tally["of"]
                count[3] += tally["lifted"]
                count[4].update(tally["failures"])
        if good:
            passed.append(kind)
            if len(good) > 1:
                repeated.append(kind)
        elif kind.get("care"):
            care_missing.append(kind["name"])
        lifted = " ".join(f"{r['trials']['lifted']}/{r['trials']['of']}" for r in own) or "not tried"
        note = words(failures) + ("; no grasp: " + ", ".join(scenery) if scenery else "")
        mark = " (held out)" if kind.get("held_out") else ""
        rows.append(f"| {kind['name']}{mark} | {kind['category']} | {lifted} | {' '.join(sorted(grasps))} | {note} |")
    categories = {kind["category"] for kind in passed}
    held = [kind for kind in passed if kind.get("held_out")]
    of_category = collections.defaultdict(list)
    for kind in KINDS:
        of_category[kind["category"]].append(kind.get("held_out", False))
    held_categories = sorted(c for c in categories if all(of_category[c]))
    lines = [
        f"- {len(passed)} of {len(KINDS)} kinds in {len(categories)} categories have an object with 18 of 20 trials or more; {len(repeated)} of them two or more.",
        f"- Held out: {len(held)} kinds that pass; categories of which every kind is held out: {', '.join(held_categories) or 'none'}.",
        f"- Kinds that care needs and that ship as scenery: {', '.join(care_missing) or 'none'}.",
        f"- Put down {down[0]} times: {down[1]} came to rest within 2 s and fell asleep; the last motion was {down[2]:.2f} s after the release.",
        "",
        "| grasp | grasps tried | kept | trials | successes | causes of failures |",
        "|---|---|---|---|---|---|",
    ]
    for way, (count, kept, of, lifted, failures) in sorted(ways.items()):
        lines.append(f"| {way} | {count} | {kept} | {of} | {lifted} | {words(failures)} |")
    lines += ["", "| kind | category | trials of each object | grasps | failures |", "|---|---|---|---|---|", *rows]
    text = DOCUMENT.read_text()
    before, rest = text.split(FIRST)
    DOCUMENT.write_text(before + FIRST + "\n".join(lines) + "\n" + LAST + rest.split(LAST)[1])
    print("\n".join(lines[:4]))
    print(f"written: {DOCUMENT}")


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["pending", *wanted]:
            pending(wanted)
        case ["report"]:
            report()
        case ["untried"]:
            untried()
        case _:
            raise SystemExit(__doc__)
