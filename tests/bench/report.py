"""Writes a table of measurements with their goals as JSON and as an SVG image."""

import html
import json
import math
import re

FIGURE = r"(-?\d+(?:\.\d+)?)"
LINE, LEFT, BAR = 22, 700, 380


def goals(goal):
    """Bounds in the text of a goal: `[(">=", 1.9, True)]`, true for a ratio."""
    found = re.findall(rf"(>=|<=|>) {FIGURE}\s*(x?)(?![\w.])", goal)
    return [(sign, float(number), ratio == "x") for sign, number, ratio in found]


def first(words):
    found = re.search(FIGURE, words)
    return float(found[1]) if found else None


def share(ours, ratio, goal):
    """Value relative to the goal, 1 = exactly met; `None` without a goal or a number."""
    reached = []
    for sign, bound, of_ratio in goals(goal):
        value = first(ratio) if of_ratio and ratio else first(ours)
        if value is None or not bound:
            return None
        reached.append(bound / value if sign == "<=" and value else value / bound)
    return min(reached) if reached else None


def entries(rows):
    """The rows below the header as dictionaries."""
    keys = ("what", "ours", "reference", "ratio", "goal")
    checked = []
    for row in rows[1:]:
        entry = dict(zip(keys, (words.strip() for words in row)))
        entry["goal"] = entry["goal"] or "for comparison"
        reached = share(entry["ours"], entry["ratio"], entry["goal"])
        entry["reached"] = reached
        entry["met"] = None if reached is None else reached >= 1
        checked.append(entry)
    return checked


def draw_svg(rows, title):
    """Bars of each value relative to its goal, on a logarithmic scale from 1/8 to 8."""
    height = LINE * (len(rows) + 3)
    middle = LEFT + BAR / 2
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{LEFT + BAR + 20}" height="{height}" '
        'font-family="sans-serif" font-size="13">',
        f'<rect width="100%" height="100%" fill="white"/><text x="10" y="{LINE}" font-weight="bold">{html.escape(title)}</text>',
        f'<text x="{middle}" y="{LINE}" text-anchor="middle">goal</text>',
        f'<line x1="{middle}" x2="{middle}" y1="{LINE + 6}" y2="{height - 8}" stroke="#444"/>',
    ]
    for mark in (0.25, 0.5, 2, 4):
        x = middle + BAR / 2 * math.log2(mark) / 3
        parts.append(f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{LINE + 6}" y2="{height - 8}" stroke="#ddd"/>')
        parts.append(f'<text x="{x:.1f}" y="{LINE}" text-anchor="middle" fill="#777">{mark:g}x</text>')
    for number, entry in enumerate(rows):
        y = LINE * (number + 2.5)
        for x, width, words in ((10, 34, entry["what"]), (250, 18, entry["ours"]), (370, 26, entry["reference"]), (545, 22, entry["goal"])):
            shown = words if len(words) <= width else words[: width - 1] + "…"
            parts.append(f'<text x="{x}" y="{y:.1f}">{html.escape(shown)}</text>')
        if entry["reached"] is not None:
            log = max(-3.0, min(3.0, math.log2(max(entry["reached"], 1e-9))))
            x, width = middle + BAR / 6 * min(log, 0), abs(BAR / 6 * log)
            color = "#2a7f3f" if entry["met"] else "#b5402a"
            parts.append(f'<rect x="{x:.1f}" y="{y - 11:.1f}" width="{max(width, 2):.1f}" height="13" fill="{color}"/>')
    return "\n".join(parts) + "\n</svg>\n"


def write(rows, folder, title):
    """Writes `table.json` and `table.svg`; returns their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    checked = entries(rows)
    (folder / "table.json").write_text(json.dumps(dict(title=title, rows=checked), indent=1, ensure_ascii=False) + "\n")
    (folder / "table.svg").write_text(draw_svg(checked, title))
    return folder / "table.json", folder / "table.svg"


def check():
    """Tests `goals` and `share`."""
    assert goals(">= 25/s, >= 1.9x") == [(">=", 25.0, False), (">=", 1.9, True)]
    assert share("30.0", "2.00x", ">= 1.9x") > 1 > share("30.0", "1.80x", ">= 1.9x")
    assert share("40.0 us", "", "<= 50 us") == 1.25 and share("60.0 us", "", "<= 50 us") < 1
    assert share("99.95 %", "", ">= 99.9 %") > 1 and share("skipped", "", "<= 50 us") is None
    assert share("1.0", "", "for comparison") is None


if __name__ == "__main__":
    check()
    print("ok")
