#!/usr/bin/env bash
# Imports the nine example homes of Sweet Home 3D, prints the time of each, and compares what is
# in the packs with tests/data/homes.csv. Fetches Debian's package sweethome3d once; it is not
# installed. `make test-import` builds first.
#   WHEELARM_HOMES   folder of the homes and packs, default data/homes
#   --update         writes the table again
set -euo pipefail
cd "$(dirname "$0")/.."
wheelarm=${WHEELARM:-$PWD/target/release/wheelarm}
folder=${WHEELARM_HOMES:-$PWD/data/homes}
table=tests/data/homes.csv
mkdir -p "$folder"

if ! [ -e "$folder/4BedroomHouse.sh3d" ]; then
    unpacked=$(mktemp -d)
    trap 'rm -rf "$unpacked"' EXIT
    (
        cd "$unpacked"
        apt-get download sweethome3d || { apt-get update -qq && apt-get download sweethome3d; }
        dpkg-deb -x sweethome3d_*.deb .
    ) || { echo "the package sweethome3d cannot be fetched; put the nine .sh3d files into $folder" >&2; exit 1; }
    python3 tests/python/example_homes.py "$unpacked/usr/share/sweethome3d/sweethome3d.jar" "$folder"
fi

found=$(mktemp)
echo "home,found,placed,left_out,rooms,surfaces,hinges,drawers,physics,rendering" > "$found"
for home in "$folder"/*.sh3d; do
    name=$(basename "$home" .sh3d)
    start=$(date +%s%N)
    text=$("$wheelarm" home import "$home" --name "$name" --out "$folder/packs")
    echo "$name: $((($(date +%s%N) - start) / 1000000)) ms"
    # Every piece is in the pack or in the printed list.
    python3 - "$name" "$text" >> "$found" <<'PYTHON'
import re
import sys

name, text = sys.argv[1:]
number = lambda pattern: int(re.search(pattern, text)[1])
placed, pieces = number(r"(\d+) of \d+ pieces"), number(r"\d+ of (\d+) pieces")
left = sum(int(count) for count in re.findall(r"^left out, (\d+):", text, re.M))
assert placed + left == pieces, f"{name}: {placed} placed and {left} left out of {pieces}"
digests = re.search(r"physics (\w+), rendering (\w+)", text)
print(name, pieces, placed, left, number(r"(\d+) rooms"), number(r"(\d+) surfaces"),
      number(r"(\d+) doors"), number(r"(\d+) drawers"), digests[1], digests[2], sep=",")
PYTHON
done
if [ "${1:-}" = --update ]; then
    cp "$found" "$table"
    echo "written: $table"
elif diff "$table" "$found"; then
    echo "9 homes are as in $table"
else
    echo "the packs differ from $table; after a change of the importer: tests/import.sh --update" >&2
    exit 1
fi
