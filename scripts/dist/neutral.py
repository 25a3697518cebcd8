"""Takes the folders of the building machine out of programs, in place.

    python neutral.py FOLDER... -- PROGRAM...

HDF5 keeps how it was configured as texts, and the folder that it was built for as
a place where it looks for plugins, where somebody else might put one. Each FOLDER
is replaced by one of the same length that nobody has; longer ones first.
"""

import sys

NOWHERE = b"/nonexistent"

split = sys.argv.index("--")
folders = sorted((folder.encode() for folder in sys.argv[1:split]), key=len, reverse=True)
for program in sys.argv[split + 1 :]:
    with open(program, "r+b") as file:
        data = file.read()
        for folder in folders:
            # Slashes in a row are one; a name that is too short is made of one letter.
            length = len(folder)
            nowhere = NOWHERE.ljust(length, b"/") if length >= len(NOWHERE) else b"/" + b"_" * (length - 1)
            data = data.replace(folder, nowhere)
        file.seek(0)
        file.write(data)
