#!/usr/bin/env bash
# Records two episodes, exports them, and runs the guide's Python with the real
# readers: lerobot 0.4.4 and robomimic 0.3.0, in a virtual environment of its
# own; and holds the joint signals against Pinocchio. The first run downloads several gigabytes (torch).
# What lerobot gives to a policy is asked of 0.4.4 and, where there is Python 3.12
# or newer, of 0.6.1 in another environment.
#   WHEELARM_READERS   the environment, .venv-readers without it; the other one
#                      lies beside it with `-new` behind its name
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD
venv=${WHEELARM_READERS:-$root/.venv-readers}
python=$venv/bin/python
NEEDED=13
[ -x "$python" ] || python3 -m venv "$venv"
# What is installed needs no cache beside it.
export PIP_NO_CACHE_DIR=1
has() { "$python" -c "from importlib.metadata import version; import sys; sys.exit(version('$1') != '$2')" 2>/dev/null; }
pip() { "$python" -m pip install --quiet --disable-pip-version-check "$@"; }
if ! has lerobot 0.4.4; then
    free=$(($(df --output=avail -k "$venv" | tail -1) >> 20))
    [ "$free" -ge "$NEEDED" ] || { echo "lerobot and torch take about $NEEDED GB while they are installed; $free GB are free in $venv" >&2; exit 1; }
    pip lerobot==0.4.4
fi
has pin 4.1.0 || pip pin==4.1.0
# Its dependency egl_probe does not build with new versions of CMake.
has robomimic 0.3.0 || pip --no-deps robomimic==0.3.0
"$python" -c 'import h5py, tensorboard, tensorboardX, imageio, termcolor, psutil, tqdm' 2>/dev/null ||
    pip h5py tensorboard tensorboardX imageio termcolor psutil tqdm
newer=
for candidate in python3.12 python3.13; do
    "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 12))' 2>/dev/null && newer=$candidate && break
done
if [ -n "$newer" ]; then
    [ -x "$venv-new/bin/python" ] || "$newer" -m venv "$venv-new"
    "$venv-new/bin/python" -c "from importlib.metadata import version; import sys; sys.exit(version('lerobot') != '0.6.1')" 2>/dev/null ||
        "$venv-new/bin/python" -m pip install --quiet --disable-pip-version-check lerobot==0.6.1
fi

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
export PATH=$root/target/release:$PATH WHEELARM_ASSETS=$root/assets
export HF_HUB_OFFLINE=1 HF_HOME=$folder/hf
cd "$folder"
wheelarm demo --seeds 0..2 --width 320 --height 180 --no-sheet --out data/session >/dev/null
for chapter in lerobot robomimic; do
    echo "== $chapter"
    "$python" "$root/tests/python/guide_blocks.py" "$root/client/guide/$chapter.md" sh | sh -e
    "$python" "$root/tests/python/guide_blocks.py" "$root/client/guide/$chapter.md" python >"read_$chapter.py"
    "$python" "read_$chapter.py"
done
echo "== what LeRobot gives to a policy"
"$python" "$root/tests/python/check_policy_features.py" data/lerobot
if [ -n "$newer" ]; then
    "$venv-new/bin/python" "$root/tests/python/check_policy_features.py" data/lerobot
else
    echo "lerobot 0.6.1 is not asked: it needs Python 3.12, which is not here"
fi
echo "== joint signals against Pinocchio"
"$python" "$root/tests/python/check_signals.py" data/session/*.h5
# Through a file: a reader that stops early would break the pipe.
info=$("$python" -c "from importlib.util import find_spec; print(find_spec('robomimic').submodule_search_locations[0] + '/scripts/get_dataset_info.py')")
"$python" "$info" --dataset data/robomimic.hdf5 >info.txt
sed -n 1,12p info.txt
