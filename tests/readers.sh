#!/usr/bin/env bash
# Records two episodes, exports them, and runs the guide's Python with the real readers: lerobot
# 0.4.4 and robomimic 0.3.0, in a separate virtual environment. Compares the joint signals with
# Pinocchio. The first run downloads several gigabytes (torch).
# lerobot 0.4.4 also checks videos and the features of a policy, and so does 0.6.1, which reads
# depth and language too, in a second environment with Python 3.12 or newer.
#   WHEELARM_READERS   the environment, default .venv-readers; the second one has this name with
#                      `-new` appended
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD
venv=${WHEELARM_READERS:-$root/.venv-readers}
python=$venv/bin/python
NEEDED=13
newer=
for candidate in python3.12 python3.13 "$HOME"/.pyenv/versions/3.1[23]*/bin/python3; do
    "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 12))' 2>/dev/null && newer=$candidate && break
done
[ -n "$newer" ] || { echo "lerobot 0.6.1 needs Python 3.12 or 3.13, and neither python3.12 nor python3.13 is found; install one (Debian 13, pyenv install 3.12) and put it on PATH" >&2; exit 1; }
command -v ffmpeg >/dev/null || { echo "ffmpeg is missing: apt-get install -y ffmpeg" >&2; exit 1; }
[ -x "$python" ] || python3 -m venv "$venv"
# Installed packages need no pip cache.
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
new=$venv-new/bin/python
[ -x "$new" ] || "$newer" -m venv "$venv-new"
"$new" -c "import av, datasets, h5py; from importlib.metadata import version; import sys; sys.exit(version('lerobot') != '0.6.1')" 2>/dev/null ||
    "$new" -m pip install --quiet --disable-pip-version-check 'lerobot[dataset]==0.6.1' h5py

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
export PATH=$root/target/release:$PATH WHEELARM_ASSETS=$root/assets
export HF_HUB_OFFLINE=1 HF_HOME=$folder/hf
cd "$folder"
wheelarm demo --seeds 0..2 --width 320 --height 180 --no-sheet --out data/session >/dev/null
for chapter in lerobot robomimic; do
    echo "== $chapter"
    "$python" "$root/tests/python/guide_blocks.py" "$root/docs/train-and-evaluate/$chapter.md" sh | sh -e
    "$python" "$root/tests/python/guide_blocks.py" "$root/docs/train-and-evaluate/$chapter.md" python >"read_$chapter.py"
    "$python" "read_$chapter.py"
done
echo "== what LeRobot gives to a policy"
wheelarm demo --seed 0 --width 640 --height 360 --no-sheet --out data/sensed \
    --sensor kinova_vision@gen3 --sensor chair_stereo@wheelchair >/dev/null
wheelarm dataset export --format lerobot data/sensed --out data/colour >/dev/null
wheelarm dataset export --format lerobot data/sensed --pictures av1 --out data/av1 >/dev/null
wheelarm dataset export --format lerobot data/sensed --depth --language --out data/depth >/dev/null
for set in lerobot colour; do
    "$python" "$root/tests/python/check_policy_features.py" "data/$set"
done
for set in lerobot colour depth; do
    "$new" "$root/tests/python/check_policy_features.py" "data/$set"
done
echo "== videos as LeRobot decodes them"
check=$root/tests/python/check_videos.py
for set in colour av1; do
    "$python" -W ignore "$check" "data/$set" data/sensed/*.h5
    "$new" -W ignore "$check" "data/$set" data/sensed/*.h5
done
"$new" -W ignore "$check" --language data/depth data/sensed/*.h5
echo "== openpi and RoboArena"
has openpi-client 0.1.2 || pip --no-deps openpi-client==0.1.2
"$python" -c 'import msgpack, websockets, tree' 2>/dev/null || pip msgpack websockets dm-tree
sed 's/^protocol = .*/protocol = "roboarena"/' "$root/assets/policies/openpi.toml" >roboarena.toml
for protocol in openpi roboarena; do
    map=$root/assets/policies/openpi.toml
    [ "$protocol" = openpi ] || map=$PWD/roboarena.toml
    "$python" "$root/tests/python/openpi_server.py" port 6 "$protocol" & server=$!
    while [ ! -s port ]; do kill -0 "$server"; sleep 0.1; done
    # The error ends the only episode, which is counted.
    wheelarm evaluate --task pick_bowl --seeds 0..1 --policy "openpi:ws://127.0.0.1:$(cat port)" --policy-map "$map" \
        --no-grid --out "$protocol" >told || [ $? = 3 ]
    grep -q 'RuntimeError: that is enough' told || { cat told; exit 1; }
    wait "$server"
    rm port
done
echo "== checkpoints of LeRobot"
"$python" -c 'import zenoh' 2>/dev/null || pip eclipse-zenoh==1.10.2
export PYTHONPATH=$root/client/python/src
"$python" -W ignore "$root/tests/python/check_lerobot_policy.py" "$folder/checkpoints"
for kind in act diffusion; do
    WHEELARM_PYTHON=$python wheelarm evaluate --task pick_bowl --seeds 0..1 --policy "lerobot:checkpoints/$kind" --time-limits \
        --no-grid --out "lerobot-$kind" >told || [ $? = 1 ] || [ $? = 3 ]
    grep -q "lerobot $kind" "lerobot-$kind/report.json" || { cat told; exit 1; }
done
unset PYTHONPATH
echo "== ACT against LeRobot's"
"$python" -W ignore "$root/tests/python/check_act.py" "$root/client/learn/python"
"$python" -W ignore "$root/tests/python/check_aims.py"
"$python" -W ignore "$root/tests/python/check_text.py"
"$python" -W ignore "$root/tests/python/check_worlds.py"
echo "== our trainer, in two pieces"
wheelarm dataset export --format tensors data/session --size 64x36 --trim-idle 0.5 --out data/tensors >/dev/null
train() {
    "$python" -W ignore "$root/client/learn/python/train.py" data/tensors --out run --steps 6 --interval 2 --batch 4 \
        --width 4 --group-channels 2 --dim 16 --feedforward 16 --heads 2 --encoder-layers 1 --vae-layers 1 \
        --validation 0.5 --device cpu --travel run/travel "$@"
}
status=0
train --seconds 0 || status=$?
[ "$status" = 4 ] || { echo "a piece that leaves steps ended with $status, expected 4" >&2; exit 1; }
train
rm run/checkpoint.pt
train | grep "continues from step 6"
"$python" "$root/client/learn/python/export.py" run/policy.safetensors --bits 8 --out small.safetensors
echo "== joint signals against Pinocchio"
"$python" "$root/tests/python/check_signals.py" data/session/*.h5
# Through a file: a reader that stops early would break the pipe.
info=$("$python" -c "from importlib.util import find_spec; print(find_spec('robomimic').submodule_search_locations[0] + '/scripts/get_dataset_info.py')")
"$python" "$info" --dataset data/robomimic.hdf5 >info.txt
sed -n 1,12p info.txt
