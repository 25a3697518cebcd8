"""Prints the first shell block below a heading of a guide.

    python guide_block.py GUIDE HEADING
"""

import re
import sys
from pathlib import Path

guide, heading = Path(sys.argv[1]), sys.argv[2]
_, found, below = guide.read_text(encoding="utf-8").partition(f"{heading}\n")
block = re.search(r"```sh\n(.*?)```", below.split("\n## ")[0], re.S)
if not found or not block:
    sys.exit(f"error: {guide} has no shell block below {heading!r}")
print(block[1], end="")
