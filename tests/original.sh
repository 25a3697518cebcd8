#!/usr/bin/env bash
# Records an episode at WheelArm-Sim's image size and runs WheelArm-Sim's processing scripts on
# it, in a separate virtual environment.
#   original.sh FOLDER     folder with Data_Processing/*.py, of which no copy is kept
#   WHEELARM_ORIGINAL      the environment, default .venv-original
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD
[ -f "${1:-}/hdf5_to_csv.py" ] || { echo "usage: make test-original SCRIPTS=…/Data_Processing, from https://github.com/madibabaiasl/WheelArmSimISMR2026" >&2; exit 2; }
scripts=$(cd "$1" && pwd)
venv=${WHEELARM_ORIGINAL:-$root/.venv-original}
python=$venv/bin/python
[ -x "$python" ] || python3 -m venv "$venv"
# Newer versions of pandas lack a function that the scripts call.
"$python" -c 'import h5py, matplotlib, pandas, sys; sys.exit(pandas.__version__ != "2.2.3")' 2>/dev/null ||
    "$python" -m pip install --quiet --disable-pip-version-check pandas==2.2.3 h5py matplotlib

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
export PATH=${CARGO_TARGET_DIR:-$root/target}/release:$PATH WHEELARM_ASSETS=$root/assets
cd "$folder"
wheelarm demo --task place_knife --seed 0 --no-sheet --out raw >/dev/null
wheelarm dataset export --format wheelarm-sim raw --out original
wheelarm dataset export --format csv raw --out csv
"$python" "$root/tests/python/run_original_scripts.py" "$scripts" \
    original/place_knife-seed0.hdf5 csv/place_knife-seed0/final_data.csv work
