"""Replaces the folders of the build machine in programs, in place.

    python neutral.py FOLDER... -- PROGRAM...

HDF5 contains its configuration as text, and its build folder as a search path for
plugins, where another user could place one. Each FOLDER is replaced by a path of the
same length that does not exist; longer ones first.
"""

import sys

MISSING = b"/nonexistent"

split = sys.argv.index("--")
folders = sorted((folder.encode() for folder in sys.argv[1:split]), key=len, reverse=True)
for program in sys.argv[split + 1 :]:
    with open(program, "r+b") as file:
        data = file.read()
        for folder in folders:
            # Repeated slashes count as one; a shorter name is filled with one letter.
            length = len(folder)
            missing = MISSING.ljust(length, b"/") if length >= len(MISSING) else b"/" + b"_" * (length - 1)
            data = data.replace(folder, missing)
        file.seek(0)
        file.write(data)
