#!/usr/bin/env bash
# Makes layouts of the own homes, checks each by the report, and writes the figures into
# docs/results/own-homes.md. `make test-homes` builds first.
#   HOME_SEEDS   layout seeds of each plan, default 0..150
#   HOME_JOBS    plans at a time, default the number of processors
set -euo pipefail
cd "$(dirname "$0")/.."
wheelarm=${WHEELARM:-$PWD/target/release/wheelarm}
seeds=${HOME_SEEDS:-0..150}
jobs=${HOME_JOBS:-$(nproc)}
results=$(mktemp -d)
trap 'rm -rf "$results"' EXIT
for plan in assets/homes/plans/*.toml; do
    basename "$plan" .toml
done | xargs -P "$jobs" -I PLAN sh -c \
    "'$wheelarm' home make PLAN --style all --held-out --layout-seeds '$seeds' --check --assets assets --out '$results' > '$results/PLAN.txt'"
python3 - "$results" "$seeds" <<'PYTHON'
import pathlib
import re
import sys

folder, seeds = pathlib.Path(sys.argv[1]), sys.argv[2]
rows, total = [], [0] * 5
for path in sorted(folder.glob("*.txt")):
    plan, *numbers, why = path.read_text().splitlines()[-1].split(",")
    numbers = [int(number) for number in numbers]
    total = [a + b for a, b in zip(total, numbers)]
    rows.append((plan, numbers, re.sub(r" (\d)", r", \1", why.replace("_", " "))))
    assert numbers[2] >= 100, f"{plan}: {numbers[2]} distinct layouts that are ready, at least 100 are needed"
rows.append(("all", total, ""))
lines = ["| plan | seeds | ready | distinct | surfaces reached | rejected |", "|---|---|---|---|---|---|"]
for plan, (tried, ready, distinct, reached, surfaces), why in rows:
    share = f"{ready} ({100 * ready / tried:.0f} %)"
    lines.append(f"| {plan} | {tried} | {share} | {distinct} | {reached} of {surfaces} ({100 * reached / max(1, surfaces):.1f} %) | {why} |")
document = pathlib.Path("docs/results/own-homes.md")
text = document.read_text()
first, last = "<!-- figures -->\n", "<!-- end of figures -->"
before, rest = text.split(first)
after = rest.split(last)[1]
document.write_text(before + first + "\n".join(lines) + "\n" + last + after)
print("\n".join(lines))
print(f"written: {document} (seeds {seeds} of each plan)")
PYTHON
