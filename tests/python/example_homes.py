"""Writes the example homes of Sweet Home 3D as .sh3d files: example_homes.py JAR FOLDER.

The program's archive has them as XML files, and their models beside them."""

import re
import sys
import zipfile
from pathlib import Path

RESOURCES = "com/eteks/sweethome3d/io/resources/"


def main() -> None:
    jar, folder = zipfile.ZipFile(sys.argv[1]), Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    known = set(jar.namelist())
    for path in sorted(known):
        found = re.fullmatch(RESOURCES + r"examples/(\w+)\.xml", path)
        if found is None:
            continue
        text = jar.read(path)
        models = sorted({model.decode() for model in re.findall(rb"model='([^']+)'", text)})
        libraries = [model[:-3] + "mtl" for model in models]
        files = models + [library for library in libraries if library in known]
        with zipfile.ZipFile(folder / f"{found[1]}.sh3d", "w", zipfile.ZIP_DEFLATED) as home:
            for name, content in [("Home.xml", text), *((file, jar.read(file)) for file in files)]:
                entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
                home.writestr(entry, content, zipfile.ZIP_DEFLATED)


main()
