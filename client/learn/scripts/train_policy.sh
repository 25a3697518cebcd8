#!/usr/bin/env bash
# Trains a policy on a machine with one large GPU: episodes, a first policy, rounds of
# corrections by the scripted operator (DAgger), each followed by a new policy, and the
# evaluation of the last policy on unseen seeds. Every stage continues after an interruption;
# run it again until it prints that all is done.
#   client/learn/scripts/train_policy.sh OUT
# Requires python3 with torch, numpy, safetensors, eclipse-zenoh and protobuf.
#   PLAN      campaign of the episodes (assets/campaigns/mustard-near.toml)
#   TASK      task of the corrections and the evaluation (pick_mustard)
#   JOBS      servers in parallel (one per core)
#   TRAINING  seconds of training: of the first policy, and of the policy after each round
#   PIECE     seconds of training per call (500)
#   CORRECTIONS      episodes with corrections in each round (250)
#   CORRECTED_FROM   first seed of the corrections (20000)
#   INIT      policy from which the first one starts, trained on other seeds
#   TAKEOVER  latest time at which the operator takes over, s (30)
#   NETWORK   more options of train.py
#   STARTS    starts of the corrected episodes, as in the plan (near)
#   SPLIT     split of the evaluation (assets/splits/policy-claim.toml)
#   SEEDS     number of its seeds (all)
#   ADAPTERS  GPUs for rendering, as in --adapters (the first)
#   PROGRAMS  folder of wheelarm and its programs (target/release)
set -euo pipefail
cd "$(dirname "$0")/../../.."
out=${1:?give a folder}
plan=${PLAN:-assets/campaigns/mustard-near.toml}
task=${TASK:-pick_mustard}
jobs=${JOBS:-$(nproc)}
read -ra training <<<"${TRAINING:-200 250 400}"
piece=${PIECE:-500}
corrections=${CORRECTIONS:-250}
corrected_from=${CORRECTED_FROM:-20000}
init=(${INIT:+--init "$INIT"})
takeover=${TAKEOVER:-30}
starts=${STARTS:-near}
split=${SPLIT:-assets/splits/policy-claim.toml}
rendering=(${ADAPTERS:+--adapters "$ADAPTERS"})
python=${PYTHON:-python3}
PATH=$(realpath "${PROGRAMS:-target/release}"):$PATH
export PATH PYTHONPATH="$PWD/client/python/src${PYTHONPATH:+:$PYTHONPATH}"
learn=client/learn/python
mkdir -p "$out"
read -ra network <<<"--width 48 --norm batch --precision bf16 --batch 128 --lr 2e-4 --warm-up 300 --shift 4 --execute 10 --pause 2 --without-state *.velocity,odometry.* ${NETWORK:-}"
say() { printf '%s  %s\n' "$(date -u +%H:%M:%S)" "$*"; }
# A stage is done when its mark exists.
done_before() { [ -e "$out/$1.done" ]; }
mark() { touch "$out/$1.done"; }
# Moved when complete: an interrupted export starts again.
export_rows() { # recordings, name
    rm -rf "$out/exporting-$2" "$out/tensors/$2"
    wheelarm-dataset export --format tensors --trim-idle 0.5 "$1" --out "$out/exporting-$2" >"$out/export-$2.log" 2>&1 ||
        say "export of $2: $(tail -n 2 "$out/export-$2.log")"
    [ "$(find "$out/exporting-$2" -name '*.safetensors' | wc -l)" -gt 0 ] || { say "failed: nothing was exported from $1" && return 1; }
    mkdir -p "$out/tensors"
    mv "$out/exporting-$2" "$out/tensors/$2"
}
# An evaluation is complete when it has all its seeds, successful or not.
check_complete() { # folder, seeds
    local count
    count=$(grep -c '"seed"' "$1/episodes.jsonl" 2>/dev/null || true)
    [ "${count:-0}" -ge "$2" ] || { say "failed: $1 has ${count:-0} of $2 seeds: $(tail -n 2 "$1.log")" && return 1; }
}
# Half of the plan's episodes: training starts with the first half while the CPU produces the
# second.
collect() { # shard
    done_before "data-$1" && return
    say "episodes of $plan, part $1 of 0 and 1"
    wheelarm collect "$plan" --out "$out/data-$1" --shard "$1/2" --workers "$jobs" "${rendering[@]}" >"$out/collect-$1.log" || [ $? -eq 3 ]
    tail -n 4 "$out/collect-$1.log"
    export_rows "$out/data-$1/episodes" "data-$1"
    mark "data-$1"
}
train() { # name, seconds, more arguments
    local name=$1 seconds=$2
    shift 2
    done_before "$name" && return
    say "training $name"
    # 4: steps are left.
    local status=0
    "$python" $learn/train.py "$@" --out "$out/$name" --name "$task-$name" --steps 1000000 --within "$seconds" \
        --seconds "$piece" "${network[@]}" || status=$?
    case $status in
    0) mark "$name" ;;
    4) say "run this again: steps are left" && return 4 ;;
    *) return $status ;;
    esac
}
correct() { # round
    done_before "corrections-$1" && return
    say "corrections, round $1"
    local first=$((corrected_from + ($1 - 1) * corrections))
    # Failed episodes are not a failure of this stage.
    wheelarm evaluate --task "$task" --seeds $first..$((first + corrections)) --jobs "$jobs" \
        --starts "$starts" "${rendering[@]}" --policy "exec:$python $learn/serve.py $out/policy-$(($1 - 1))/policy.safetensors" --takeover "$takeover" \
        --record --no-grid --out "$out/corrections-$1" >"$out/corrections-$1.log" 2>&1 || true
    check_complete "$out/corrections-$1" "$corrections"
    tail -n 12 "$out/corrections-$1.log"
    export_rows "$out/corrections-$1" "corrections-$1"
    mark "corrections-$1"
}

collect 0
collect 1 &
second_half=$!
status=0
train policy-0 "${training[0]}" "$out/tensors/data-0" "${init[@]}" || status=$?
wait $second_half
[ $status -eq 0 ] || exit $status
rounds=$((${#training[@]} - 1))
for round in $(seq 1 $rounds); do
    correct "$round"
    train "policy-$round" "${training[$round]}" "$out/tensors" --init "$out/policy-$((round - 1))/policy.safetensors"
done
if ! done_before evaluation; then
    [ -e "$out/$task.safetensors" ] || "$python" $learn/export.py "$out/policy-$rounds/policy.safetensors" --bits 8 --out "$out/$task.safetensors"
    say "evaluation on $split"
    wheelarm evaluate --task "$task" --split "$split" ${SEEDS:+--episodes "$SEEDS"} --jobs "$jobs" "${rendering[@]}" --no-grid --out "$out/evaluation" \
        --policy "exec:$python $learn/serve.py $out/$task.safetensors" >"$out/evaluation.log" 2>&1 || true
    check_complete "$out/evaluation" "${SEEDS:-1}"
    tail -n 30 "$out/evaluation.log"
    mark evaluation
fi
say "done: $out/$task.safetensors"
