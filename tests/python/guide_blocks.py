"""Prints the code blocks of one language in a chapter of the guide.

Usage: guide_blocks.py CHAPTER.md LANGUAGE
"""

import sys
from pathlib import Path

parts = Path(sys.argv[1]).read_text(encoding="utf-8").split("```")[1::2]
print("\n".join(p.split("\n", 1)[1] for p in parts if p.split("\n", 1)[0] == sys.argv[2]))
