#!/usr/bin/env bash
# The LeRobot plugins with the real programs: lerobot-eval (an ACT of random weights) and
# lerobot-record (our robot, our teleoperator) with lerobot 0.4.4 on Python 3.11 and 0.6.1 on
# 3.12 or newer; then what they wrote, and that a success is counted as one. And the rows of
# exports, played open loop through the environments. Downloads gigabytes the first time.
#   WHEELARM_READERS   the environments of tests/readers.sh, .venv-readers without it
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD package=$PWD/client/python
venv=${WHEELARM_READERS:-$root/.venv-readers}
export PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1
export PATH=${CARGO_TARGET_DIR:-$root/target}/release:$PATH WHEELARM_ASSETS=${WHEELARM_ASSETS:-$root/assets}
python_of() { # least and greatest minor version
    local candidate
    for candidate in python3.1{3,2,1} "$HOME"/.pyenv/versions/3.1[123].*/bin/python3; do
        "$candidate" -c "import sys; sys.exit(not $1 <= sys.version_info[1] <= $2)" 2>/dev/null && echo "$candidate" && return
    done
    echo "Python 3.$1 to 3.$2 is needed: install one (pyenv install 3.$1) and put it on PATH" >&2
    return 1
}
install() { # environment, Python, what
    [ -x "$1/bin/python" ] || "$2" -m venv "$1"
    "$1/bin/python" -c "from importlib.metadata import version; import sys; sys.exit(version('lerobot') != '${3##*==}')" 2>/dev/null ||
        "$1/bin/python" -m pip install -q "$3"
    "$1/bin/python" -c 'import zenoh, google.protobuf, pyarrow, hatchling, editables' 2>/dev/null ||
        "$1/bin/python" -m pip install -q 'eclipse-zenoh>=1.10,<1.11' 'protobuf>=3.20.3,<8' pyarrow hatchling editables
    for part in "" /lerobot_env_wheelarm /lerobot_robot_wheelarm /lerobot_teleoperator_wheelarm; do
        "$1/bin/python" -m pip install -q --no-build-isolation --no-deps -e "$package$part"
    done
}
if [ -z "${WHEELARM_LEROBOT_READY:-}" ]; then
    old=$(python_of 10 11) new=$(python_of 12 13)
    install "$venv" "$old" lerobot==0.4.4
    install "$venv-new" "$new" 'lerobot[dataset]==0.6.1'
fi

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
export HF_HUB_OFFLINE=1 HF_HOME=$folder/hf
cd "$folder"
wheelarm demo --seeds 0..10 --rate 10 --width 96 --height 64 --no-sheet --out recorded >/dev/null
for kind in next-pose next-joints applied; do
    wheelarm dataset export --format lerobot recorded --pictures png --action $kind --out "rows-$kind" >/dev/null
    echo "== rows of --action $kind, open loop"
    "$venv-new/bin/python" "$package/tests/open_loop.py" "rows-$kind"
done
for one in "$venv" "$venv-new"; do
    version=$("$one/bin/python" -c 'from importlib.metadata import version; print(version("lerobot"))')
    case $version in 0.4.*) codec=--dataset.vcodec=h264 ;; *) codec=--dataset.rgb_encoder.vcodec=h264 ;; esac
    echo "== lerobot-eval $version"
    "$one/bin/lerobot-eval" --policy.type=act --policy.pretrained_backbone_weights=null --policy.device=cpu \
        --policy.push_to_hub=false --env.type=wheelarm --env.task=PickMustard-v0 \
        --env.observation_width=128 --env.observation_height=96 --env.episode_length=40 \
        --eval.n_episodes=2 --eval.batch_size=2 --seed=0 --output_dir="eval-$version" >"eval-$version.log" 2>&1 ||
        { tail -30 "eval-$version.log" >&2; exit 1; }
    grep -o '"pc_success": [0-9.]*' "eval-$version/eval_info.json" | tail -1
    echo "== lerobot-record $version"
    "$one/bin/lerobot-record" --robot.type=wheelarm --robot.task=pick_mustard --robot.seed=3 \
        --robot.width=128 --robot.height=96 --teleop.type=wheelarm \
        --teleop.recording=recorded/pick_mustard-seed3.h5 --dataset.repo_id=me/wheelarm \
        --dataset.root="set-$version" --dataset.single_task="Pick up the mustard" --dataset.fps=10 \
        --dataset.episode_time_s=24 --dataset.num_episodes=1 --dataset.reset_time_s=0 \
        --dataset.push_to_hub=false $codec --play_sounds=false >"record-$version.log" 2>&1 ||
        { tail -30 "record-$version.log" >&2; exit 1; }
    "$one/bin/python" -W ignore "$package/tests/lerobot_check.py" rows-next-pose "set-$version" 3 2>/dev/null ||
        { "$one/bin/python" -W ignore "$package/tests/lerobot_check.py" rows-next-pose "set-$version" 3; exit 1; }
done
