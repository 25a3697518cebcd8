#!/usr/bin/env bash
# Makes a policy on a machine with one big GPU: episodes, a first policy, corrections
# by the scripted operator where that goes astray (DAgger), a second policy, and its
# success on seeds that nothing was trained on. Every stage goes on where it was
# interrupted; run it again until it says that all is done.
#   scripts/train_policy.sh OUT
# Needs python3 with torch, numpy, safetensors, eclipse-zenoh and protobuf.
#   PLAN      campaign of the episodes (assets/campaigns/mustard-near.toml)
#   TASK      task of the corrections and the evaluation (pick_mustard)
#   JOBS      servers at work at one time (a processor each)
#   FIRST, SECOND    training steps
#   PIECE     seconds of training at a time (500)
#   CORRECTIONS      episodes with corrections (300)
#   SPLIT     what is evaluated (assets/splits/policy-claim.toml)
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:?say a folder}
plan=${PLAN:-assets/campaigns/mustard-near.toml}
task=${TASK:-pick_mustard}
jobs=${JOBS:-$(nproc)}
first=${FIRST:-9000} second=${SECOND:-14000} piece=${PIECE:-500}
corrections=${CORRECTIONS:-300}
split=${SPLIT:-assets/splits/policy-claim.toml}
python=${PYTHON:-python3}
export PATH="$PWD/target/release:$PATH" PYTHONPATH="$PWD/client/python/src${PYTHONPATH:+:$PYTHONPATH}"
learn=client/learn/python
mkdir -p "$out"
say() { printf '%s  %s\n' "$(date -u +%H:%M:%S)" "$*"; }
# A stage is done when its mark is there.
done_before() { [ -e "$out/$1.done" ]; }
mark() { touch "$out/$1.done"; }
network=(--width 48 --norm batch --precision bf16 --batch 128 --lr 2e-4 --warm-up 300 --shift 4 --execute 10)
train() { # name, steps, more arguments
    local name=$1 steps=$2
    shift 2
    done_before "$name" && return
    say "training $name"
    # 4: steps are left.
    local status=0
    "$python" $learn/train.py "$@" --out "$out/$name" --name "$name" --steps "$steps" --seconds "$piece" "${network[@]}" || status=$?
    case $status in
    0) mark "$name" ;;
    4) say "run this again: steps are left" && exit 4 ;;
    *) exit $status ;;
    esac
}
served() { echo "exec:$python $learn/serve.py $out/$1/policy.safetensors"; }

if ! done_before data; then
    say "episodes by $plan"
    wheelarm collect "$plan" --out "$out/data" --workers "$jobs" | tail -n 4
    wheelarm-dataset export --format tensors --trim-idle 0.5 "$out/data/episodes" --out "$out/tensors/data" >"$out/export.log"
    mark data
fi
train first "$first" "$out/tensors/data"
if ! done_before corrections; then
    say "corrections"
    # Not all succeed, which is no failure of this stage.
    wheelarm evaluate --task "$task" --seeds 20000..$((20000 + corrections)) --jobs "$jobs" --policy "$(served first)" \
        --takeover 20 --record --no-grid --out "$out/corrections" >"$out/corrections.log" || [ $? -le 3 ]
    wheelarm-dataset export --format tensors --trim-idle 0.5 "$out/corrections" --out "$out/tensors/corrections" >>"$out/export.log"
    mark corrections
fi
train second "$second" "$out/tensors" --init "$out/first/policy.safetensors"
if ! done_before evaluation; then
    "$python" $learn/export.py "$out/second/policy.safetensors" --bits 8 --out "$out/$task.safetensors"
    say "evaluation on $split"
    wheelarm evaluate --task "$task" --split "$split" --jobs "$jobs" --no-grid --out "$out/evaluation" \
        --policy "exec:$python $learn/serve.py $out/$task.safetensors" >"$out/evaluation.log" || [ $? -le 3 ]
    tail -n 30 "$out/evaluation.log"
    mark evaluation
fi
say "done: $out/$task.safetensors"
