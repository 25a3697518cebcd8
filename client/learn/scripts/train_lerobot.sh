#!/usr/bin/env bash
# Trains LeRobot's diffusion policy on recordings with lerobot-train (lerobot 0.4.4) on an
# export, and prints the command of its evaluation. Every stage continues after an
# interruption; run it again until it prints that all is done. It downloads nothing.
#   client/learn/scripts/train_lerobot.sh RECORDINGS... OUT
# RECORDINGS are folders of episodes (.h5). Results: OUT/set, the data set, and
# OUT/train/checkpoints/last/pretrained_model, the policy.
# Requires python3 with lerobot 0.4.4, eclipse-zenoh and protobuf.
#   SECONDS_OF_TRAINING  in total, from the start of the training until the last checkpoint is
#             written (900)
#   SAVE_EVERY  seconds between checkpoints (120)
#   WITHOUT_STATE  names of state numbers to ignore, or empty (*.velocity,odometry.*): a policy
#             with its speed as input learns to keep it, and stops
#   SIZE      of the images, WxH (as recorded)
#   TRIM_IDLE  seconds of idle rows that are kept at both ends of an episode (0.5)
#   BATCH     rows of a step (256: a step of 64 needed the same time on an H200)
#   LR        initial learning rate, which decreases to 0 over the time (3e-4)
#   PRECISION  bf16, fp16 or no (bf16)
#   WORKERS   processes that load batches (8, at most one per core)
#   POLICY    more options of lerobot-train, which override those of this script
#   PROGRAMS  folder of wheelarm and its programs (target/release)
#   PYTHON    Python with lerobot (python3); PYTHONPATH can add other packages
#   CACHE     folder for LeRobot's cache, as large as the data set (OUT/cache)
set -euo pipefail
cd "$(dirname "$0")/../../.."
[ $# -ge 2 ] || { sed -n '2,/^set -/s/^# \{0,1\}//p' "$0" && exit 2; }
recordings=("${@:1:$#-1}")
out=${!#}
seconds=${SECONDS_OF_TRAINING:-900}
save_every=${SAVE_EVERY:-120}
without_state=${WITHOUT_STATE-*.velocity,odometry.*}
size=${SIZE:-}
trim_idle=${TRIM_IDLE:-0.5}
batch=${BATCH:-256}
lr=${LR:-3e-4}
workers=${WORKERS:-$(($(nproc) < 8 ? $(nproc) : 8))}
python=${PYTHON:-python3}
PATH=$(realpath "${PROGRAMS:-target/release}"):$PATH
export PATH PYTHONPATH="$PWD/client/python/src${PYTHONPATH:+:$PYTHONPATH}"
export HF_HUB_OFFLINE=1 HF_DATASETS_OFFLINE=1 HF_HUB_DISABLE_TELEMETRY=1 TOKENIZERS_PARALLELISM=false PYTHONUNBUFFERED=1
export ACCELERATE_MIXED_PRECISION=${PRECISION:-bf16}
mkdir -p "$out"
out=$(realpath "$out")
export HF_HOME=${CACHE:-$out/cache}
# The state keeps 27 numbers with WITHOUT_STATE, so that the policy is served like any other.
read -ra policy <<<"--policy.type=diffusion --policy.push_to_hub=false --policy.crop_shape=null --policy.use_separate_rgb_encoder_per_camera=true --policy.noise_scheduler_type=DDIM --policy.num_inference_steps=10 --policy.n_obs_steps=1 --policy.horizon=16 --policy.n_action_steps=8 --policy.drop_n_last_frames=8 --policy.down_dims=[256,512,1024] --policy.optimizer_lr=$lr --policy.scheduler_warmup_steps=300 ${POLICY:-}"
last=$out/train/checkpoints/last/pretrained_model

say() { printf '%4d s  %s  %s\n' "$SECONDS" "$(date -u +%H:%M:%S)" "$*" | tee -a "$out/times.txt"; }
die() { say "failed: $*" && exit 1; }
done_before() { [ -e "$out/$1.done" ]; }
mark() { touch "$out/$1.done" && say "done: $1"; }

# Reports missing files and packages before an hour of work.
check() {
    local what
    done_before export || for what in wheelarm wheelarm-dataset; do
        command -v "$what" >/dev/null || die "the program $what is not in PATH: set PROGRAMS to its folder"
    done
    done_before export || for what in "${recordings[@]}"; do
        [ -e "$what" ] || die "cannot read the recordings $what: they do not exist"
    done
    "$python" - <<'PYTHON' || die "$python lacks a package: pip install lerobot==0.4.4 eclipse-zenoh protobuf"
import importlib
import sys

missing = []
for name in ("torch", "torchvision", "numpy", "safetensors", "accelerate", "datasets", "diffusers", "draccus", "einops",
             "zenoh", "google.protobuf", "lerobot.scripts.lerobot_train", "lerobot.policies.diffusion.modeling_diffusion",
             "wheelarm.lerobot_policy"):
    try:
        importlib.import_module(name)
    except ImportError as error:
        missing.append(f"{name}: {error}")
if missing:
    sys.exit("\n".join(missing))
import torch

print("torch", torch.__version__, "on", torch.cuda.get_device_name() if torch.cuda.is_available() else "cpu")
PYTHON
}
export_set() {
    done_before export && return
    say "export of ${recordings[*]}"
    rm -rf "$out/set.part" "$out/set"
    # PNG needs no ffmpeg to decode, and is decoded once.
    wheelarm-dataset export --format lerobot --pictures png --trim-idle "$trim_idle" ${size:+--size "$size"} \
        "${recordings[@]}" --out "$out/set.part" >"$out/export.log" 2>&1 || die "export: $(tail -n 3 "$out/export.log")"
    wheelarm-dataset ledger "${recordings[@]}" --out "$out/ledger.json" >"$out/ledger.log" 2>&1 || die "ledger: $(tail -n 3 "$out/ledger.log")"
    mv "$out/set.part" "$out/set"
    say "$(tail -n 1 "$out/export.log" | sed 's/.*: //'), $(du -sh "$out/set" | cut -f1) in $out/set"
    mark export
}
train() {
    done_before train && return
    local status=0 options=(--within "$seconds" --save-every "$save_every" --without-state "$without_state")
    if [ -e "$last/train_config.json" ]; then
        say "training continues after $(cat "$last/../seconds.json")"
        options+=(--resume=true "--config_path=$last/train_config.json")
    else
        say "training, $seconds s"
        rm -rf "$out/train"
        options+=(--dataset.repo_id=local/wheelarm "--dataset.root=$out/set" "--output_dir=$out/train"
            --batch_size="$batch" --num_workers="$workers" --wandb.enable=false --log_freq=100 "${policy[@]}")
    fi
    "$python" client/learn/python/train_lerobot.py "${options[@]}" >>"$out/train.log" 2>&1 || status=$?
    [ $status -eq 0 ] || die "training ended with $status: $(tail -n 3 "$out/train.log")"
    [ ! -e "$out/ledger.json" ] || cp "$out/ledger.json" "$last/ledger.json"
    say "$(grep 'step:' "$out/train.log" | tail -n 1 | sed 's/.*step:/step:/')"
    mark train
}

check
export_set
train
say "all is done: $last"
echo "evaluate it:"
echo "  wheelarm evaluate --task pick_mustard --seeds 900..920 --policy 'exec:$python -m wheelarm.lerobot_policy $last' --out $out/evaluation"
