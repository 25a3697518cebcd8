#!/usr/bin/env bash
# Trains one language-conditioned policy for many tasks on a machine with one large GPU:
# episodes, a first policy, rounds of corrections by the scripted operator (DAgger), each
# followed by a new policy, then the evaluation on unseen seeds, with sentences of the training
# split and held-out ones, compared with naive policies. CPU and GPU work in parallel: while a
# policy trains, the previous one is corrected.
#   client/learn/scripts/train_tasks.sh OUT
# With two GPUs, the second trains while the first renders. Every stage continues after an
# interruption; run it again until it prints that all is done. OUT/times.txt has the times of
# all stages, OUT/table.md the results.
# Requires python3 with torch, numpy, safetensors, eclipse-zenoh and protobuf.
#   PLAN      campaign of the episodes (assets/campaigns/all-near.toml; rigid-near.toml excludes
#             the bear, which needs the CPU time of five other tasks)
#   PARTS     number of parts of the plan (4)
#   BEFORE    parts that are collected before the first policy trains (half)
#   TASKS     tasks for corrections and evaluation, comma separated (all of the plan)
#   CORRECTED_TASKS  tasks for corrections (TASKS without place_teddy_bear, which is slow)
#   INIT      policy from which the first one starts (assets/policies/tasks.safetensors). Its card
#             lists its seeds: use a PLAN with another first_seed and another CORRECTED_FROM,
#             else its seeds are used again, and its corrections are rejected
#   JOBS      servers in parallel (one per core)
#   TRAINING  seconds of training: of the first policy on the parts of BEFORE, of one on all
#             episodes, and of the policy after each round of corrections
#   CORRECTIONS      seeds of each task in a round of corrections (22)
#   CORRECTED_FROM   first seed of the corrections (80000)
#   TAKEOVER  latest time at which the operator takes over, s (20)
#   SEEDS     evaluated seeds of each task, from 500 (20)
#   HELD_SEEDS  evaluated seeds of each task with held-out sentences (SEEDS)
#   KNOWING   seeds of each task for `hold`, `repeat` and `replay` (SEEDS)
#   LAST      seconds after the start of this call after which only the table of the present
#             results is printed (no limit)
#   COLLECTED_BY  seconds after the start of this call after which no further part of the plan is
#             started, except those of BEFORE (no limit)
#   TENSORS   folder of the exported episodes, 30 GB for the plan (OUT/tensors); the corrections,
#             of the same size, are in OUT/tensors
#   PROGRAMS  folder of wheelarm and its programs (target/release)
#   WORD_VECTORS   text file of GloVe or word2vec for a text encoder (text_encoder.py), with which
#             the policy is evaluated (no text encoder)
#   NETWORK   more options of train.py (--ask-others 0 if no two tasks share an area)
#   DEVICE_OPTIONS   of train.py for another device (--precision bf16 --store device)
set -euo pipefail
cd "$(dirname "$0")/../../.."
out=${1:?give a folder}
plan=${PLAN:-assets/campaigns/all-near.toml}
parts=${PARTS:-4}
init=${INIT-assets/policies/tasks.safetensors}
jobs=${JOBS:-$(nproc)}
read -ra training <<<"${TRAINING:-140 200 220 230}"
corrections=${CORRECTIONS:-22}
corrected_from=${CORRECTED_FROM:-80000}
takeover=${TAKEOVER:-20}
seeds=${SEEDS:-20}
held_seeds=${HELD_SEEDS:-$seeds}
knowing=${KNOWING:-$seeds}
last=${LAST:-1000000}
collected_by=${COLLECTED_BY:-1000000}
tensors=${TENSORS:-$out/tensors}
python=${PYTHON:-python3}
PATH=$(realpath "${PROGRAMS:-target/release}"):$PATH
export PATH PYTHONPATH="$PWD/client/python/src${PYTHONPATH:+:$PYTHONPATH}"
export PYTHONUNBUFFERED=1 OMP_NUM_THREADS=${OMP_NUM_THREADS:-4}
learn=client/learn/python
train_split=assets/splits/axes/language-1.toml
held_split=assets/splits/policy-claim-sentences.toml
mkdir -p "$out" "$tensors"
tasks=${TASKS:-$(sed -n '/^\[\[task\]\]/,/^name/s/^name = "\(.*\)"/\1/p' "$plan" | paste -sd,)}
corrected_tasks=${CORRECTED_TASKS:-$(tr , '\n' <<<"$tasks" | sed '/^place_teddy_bear$/d' | paste -sd,)}
read -ra device <<<"${DEVICE_OPTIONS:---precision bf16 --store device}"
read -ra network <<<"--width 48 --norm batch --film --batch 160 --lr 2e-4 --warm-up 200 --shift 4 --execute 10 --pause 2 --without-state *.velocity,odometry.* --share-sentences pick_*,place_*,select_* --balance-tasks --unknown-words 0.1 --validation 0.04 --aim-weight 0.5 --ask-others 0.3 ${NETWORK:-}"
# PCI ids of the GPUs in the format of --adapters. Training uses the last GPU, which is the only
# visible one; rendering uses the others at that time. With CUDA_VISIBLE_DEVICES or
# DEVICE_OPTIONS, the caller assigns the GPUs.
gpus=() render_all=() render_beside=() train_on=()
if [ -z "${CUDA_VISIBLE_DEVICES+x}${DEVICE_OPTIONS+x}" ]; then
    mapfile -t gpus < <(nvidia-smi --query-gpu=pci.bus_id --format=csv,noheader 2>/dev/null | tr A-F a-f |
        grep -Ex '[0-9a-f]{8}:[0-9a-f]{2}:[0-9a-f]{2}\.[0-9a-f]' | sed 's/^0000//')
fi
if [ ${#gpus[@]} -ge 2 ]; then
    render_all=(--adapters "$(IFS=, && echo "${gpus[*]}")")
    render_beside=(--adapters "$(IFS=, && echo "${gpus[*]:0:${#gpus[@]}-1}")")
    train_on=(env "CUDA_VISIBLE_DEVICES=$((${#gpus[@]} - 1))")
    export CUDA_DEVICE_ORDER=PCI_BUS_ID
fi

say() { printf '%4d s  %s  %s\n' "$SECONDS" "$(date -u +%H:%M:%S)" "$*" | tee -a "$out/times.txt"; }
die() { say "failed: $*" && exit 1; }
done_before() { [ -e "$out/$1.done" ]; }
mark() { touch "$out/$1.done" && say "done: $1"; }
left() { echo $((last - SECONDS)); }
# Runs a command within the remaining time; fails without time.
limited() { # command
    [ "$(left)" -gt 5 ] || return 124
    timeout --signal=TERM --kill-after=10 "$(left)" "$@"
}

# Reports missing files and packages before an hour of work.
check() {
    local what
    for what in wheelarm wheelarm-server wheelarm-worker wheelarm-dataset; do
        command -v "$what" >/dev/null || die "the program $what is not in PATH: set PROGRAMS to its folder"
    done
    wheelarm evaluate --help | grep -e --depth >/dev/null || die "wheelarm is older than this script: evaluate lacks --depth; build it again"
    for what in "$plan" "$train_split" "$held_split" ${init:+"$init"} $learn/train.py; do
        [ -e "$what" ] || die "cannot read $what: it does not exist"
    done
    "$python" -c 'import google.protobuf, numpy, safetensors, torch, zenoh; from wheelarm import policy; print("torch", torch.__version__, "on", torch.cuda.get_device_name() if torch.cuda.is_available() else "cpu")' \
        || die "$python lacks a package: see the error above"
    [ -z "$init" ] || "$python" - "$init" "$corrected_from" $((corrected_from + corrections * (${#training[@]} - 2))) 2>"$out/init.txt" <<'PYTHON' || die "$(tail -n 1 "$out/init.txt")"
import sys

sys.path.insert(0, "client/learn/python")
import policy_file

known = set(policy_file.read(sys.argv[1])[1].get("training_seeds", [])) & set(range(int(sys.argv[2]), int(sys.argv[3])))
sys.exit(f"{sys.argv[1]} was trained on {len(known)} seeds of the corrections: give another CORRECTED_FROM" if known else 0)
PYTHON
    wheelarm collect "$plan" --dry-run >"$out/plan.txt" || die "the plan $plan is invalid: see wheelarm collect $plan --dry-run"
    wheelarm-server --list-adapters >"$out/adapters.txt" 2>&1 || die "wheelarm-server --list-adapters: $(tail -n 2 "$out/adapters.txt")"
    say "$(tail -n 1 "$out/adapters.txt"); $(df -h --output=avail "$out" "$tensors" | tail -n 2 | paste -sd' ') free in $out and $tensors"
}

export_rows() { # recordings, folder
    local recordings exported
    # Moved when complete: an interrupted export starts again.
    rm -rf "$2.part" "$2"
    wheelarm-dataset export --format tensors --trim-idle 0.5 "$1" --out "$2.part" >"$out/export-${2##*/}.log" 2>&1 \
        || say "export of $2: $(tail -n 2 "$out/export-${2##*/}.log")"
    recordings=$(find "$1" -name '*.h5' | wc -l) exported=$(find "$2.part" -name '*.safetensors' 2>/dev/null | wc -l)
    # An unreadable file is skipped; more than one in twenty missing means a full disk.
    [ $((exported * 20)) -ge $((recordings * 19)) ] && [ "$exported" -gt 0 ] \
        || die "$exported of $recordings episodes of $1 were exported: $(tail -n 1 "$out/export-${2##*/}.log")"
    mv "$2.part" "$2"
    say "$(find "$2" -name '*.safetensors' | wc -l) episodes exported in $2, $(du -sh "$2" | cut -f1)"
}
# Parts of the plan's episodes: training starts with those of BEFORE while the CPU produces the
# others. A part is exported while the next one is collected.
collect() { # first part, last part plus 1, options of collect
    local part pid status exporting=() first=$1 end=$2
    shift 2
    for ((part = first; part < end; part++)); do
        done_before "data-$part" && continue
        if [ "$part" -ge "$before" ] && [ $SECONDS -gt "$collected_by" ]; then
            say "part $part is skipped: COLLECTED_BY has passed"
            continue
        fi
        say "episodes of $plan, part $part of $parts"
        status=0
        wheelarm collect "$plan" --out "$out/data-$part" --shard "$part/$parts" --workers "$jobs" "$@" >"$out/collect-$part.log" 2>&1 || status=$?
        # 3: some episodes are missing.
        [ $status -eq 0 ] || [ $status -eq 3 ] || die "part $part: $(tail -n 3 "$out/collect-$part.log")"
        say "$(grep -h 'episodes,' "$out/collect-$part.log" | tail -n 1)"
        { export_rows "$out/data-$part/episodes" "$tensors/data-$part" && mark "data-$part"; } &
        exporting+=($!)
    done
    for pid in "${exporting[@]}"; do
        wait "$pid" || die "a part was not exported"
    done
}
train() { # number, seconds, folders
    local name=policy-$1 seconds=$2
    shift 2
    done_before "$name" && return
    say "training $name, $seconds s, on $*"
    local from=$out/policy-$((${name#policy-} - 1))/training.safetensors status=0
    [ -e "$from" ] || from=$init
    mkdir -p "$out/$name"
    touch "$out/$name.started"
    limited "${train_on[@]}" "$python" $learn/train.py "$@" --out "$out/$name" --name "tasks-$name" --steps 1000000 --within "$seconds" \
        ${from:+--init "$from"} "${device[@]}" "${network[@]}" >"$out/$name.log" 2>&1 || status=$?
    # At LAST, train.py has saved its state: this call uses it, and another call continues it.
    if [ $status -eq 124 ] && [ "$out/$name/policy.safetensors" -nt "$out/$name.started" ]; then
        say "$name is not fully trained: $(tail -n 1 "$out/$name.log")"
        return
    fi
    [ $status -eq 0 ] || die "$name ended with $status: $(tail -n 3 "$out/$name.log")"
    grep -E 'parameters|^step' "$out/$name.log" | sed -n '1p;$p' | while read -r line; do say "$name: $line"; done
    mark "$name"
}
correct() { # round, number of the policy
    done_before "corrections-$1" && return
    local first=$((corrected_from + ($1 - 1) * corrections)) status=0
    say "corrections, round $1, of policy-$2, seeds $first.."
    # Failed episodes are not a failure of this stage.
    limited wheelarm evaluate --task "$corrected_tasks" --seeds "$first..$((first + corrections))" --jobs "$jobs" \
        --language 0 --language-split train "${render_beside[@]}" --takeover "$takeover" --record --depth none --no-grid \
        --policy "exec:$python $learn/serve.py $out/policy-$2/policy.safetensors" \
        --out "$out/corrections-$1" >"$out/corrections-$1.log" 2>&1 || status=$?
    local count wanted=$((corrections * $(tr , '\n' <<<"$corrected_tasks" | wc -l)))
    count=$(grep -c '"seed"' "$out/corrections-$1/episodes.jsonl" 2>/dev/null || true)
    [ "${count:-0}" -ge "$wanted" ] \
        || die "corrections $1 ended with $status, ${count:-0} of $wanted episodes: $(tail -n 3 "$out/corrections-$1.log")"
    say "corrections $1: $(grep -c '"success":true' "$out/corrections-$1/episodes.jsonl") of $(wc -l <"$out/corrections-$1/episodes.jsonl") succeed"
    export_rows "$out/corrections-$1" "$out/tensors/corrections-$1" || exit 1
    rm -f "$out/corrections-$1"/*.h5
    mark "corrections-$1"
}
# The evaluation runs all tasks of a seed before the next seed. After an interruption, the
# report uses the seeds with all tasks.
evaluate() { # name, jobs, seeds, policy, more arguments
    local name=$1 jobs=$2 count=$3 policy=$4 status=0 complete
    shift 4
    done_before "$name" && return
    say "evaluation $name: $policy"
    local command=(wheelarm evaluate --task "$tasks" --jobs "$jobs" "${render_all[@]}" --no-grid --policy "$policy" --out "$out/$name" "$@")
    limited "${command[@]}" --episodes "$count" >"$out/$name.log" 2>&1 </dev/null || status=$?
    [ -e "$out/$name/episodes.jsonl" ] || { say "evaluation $name has no results: $(tail -n 2 "$out/$name.log" 2>&1)" && return; }
    complete=$("$python" client/learn/scripts/tasks_table.py --whole "$out/$name" "$tasks")
    if [ "$complete" -ge "$count" ]; then
        mark "$name"
        return
    fi
    say "evaluation $name ended with $status: $complete of $count seeds have all tasks: $(tail -n 1 "$out/$name.log")"
    [ "$complete" -eq 0 ] || "${command[@]}" --episodes "$complete" >"$out/$name-part.log" 2>&1 </dev/null || true
}
# Tests of the use of images and language: images of another episode, and the sentence of another
# task of the same table. Tasks of an area have the same scene for the same seed, so the other
# task judges the result.
test_images_and_language() {
    local task=pick_mustard images
    images=$(find "$tensors"/data-* -name "$task-*.safetensors" | sort | paste -sd' ')
    has() { [[ ,$tasks, == *,$1,* ]]; }
    if has $task && [ -n "$images" ]; then
        tasks=$task evaluate "blind-$task" "$jobs" "$seeds" "$served --pictures-of $images" --split "$train_split"
        [ -z "$init" ] || tasks=$task evaluate "blind-shipped" "$jobs" "$seeds" \
            "exec:$python $learn/serve.py $init --pictures-of $images" --split assets/splits/policy-claim.toml
    fi
    local from to sentence
    while read -r from to sentence; do
        has "$from" && has "$to" || continue
        tasks=$from,$to evaluate "sentence-$to" "$jobs" "$seeds" "$served --say '$sentence'" --split "$train_split"
    done <<'PAIRS'
pick_mustard pick_crackers Please pick up the crackers from the coffee table
pick_bowl pick_blue_mug Please pick up the mug from the kitchen table
PAIRS
}
table() { "$python" client/learn/scripts/tasks_table.py "$out" "$tasks" >"$out/table.md" && cat "$out/table.md"; }

# Ends the programs of the background stages, not only their shells.
# shellcheck disable=SC2154 # `stage` is the loop variable of the trap itself.
trap 'for stage in $(jobs -p); do pkill -TERM -P "$stage"; kill "$stage"; done 2>/dev/null || true' EXIT
say "start; tasks: $tasks"
[ -e "$out/pieces.txt" ] || echo "$plan in $parts parts" >"$out/pieces.txt"
[ "$(cat "$out/pieces.txt")" = "$plan in $parts parts" ] || die "$out was started with $(cat "$out/pieces.txt"): choose another folder, or the same PLAN and PARTS"
check
before=${BEFORE:-$(((parts + 1) / 2))}
[ "$before" -ge 1 ] && [ "$before" -le "$parts" ] || die "invalid BEFORE=$before: give a number from 1 to PARTS, which is $parts"
collect 0 "$before" "${render_all[@]}"
collect "$before" "$parts" "${render_beside[@]}" &
second=$!
folders=()
for ((part = 0; part < before; part++)); do
    folders+=("$tensors/data-$part")
done
train 0 "${training[0]}" "${folders[@]}"
wait $second || die "the other parts of the episodes are missing"
rounds=$((${#training[@]} - 1))
for ((part = before; part < parts; part++)); do
    [ ! -e "$out/data-$part.done" ] || folders+=("$tensors/data-$part")
done
for round in $(seq 1 $rounds); do
    if [ "$round" -lt "$rounds" ]; then
        correct "$round" $((round - 1)) &
        correcting=$!
    elif [ "$knowing" -gt 0 ]; then
        # The last round has no corrections: naive policies are evaluated at this time, and the
        # rest of them at the end.
        {
            render_all=("${render_beside[@]}")
            last=$((SECONDS + ${training[$round]} + 20 < last ? SECONDS + ${training[$round]} + 20 : last))
            mkdir -p "$out/recordings"
            for file in "$out"/data-*/episodes/*.h5; do ln -sf "$(realpath "$file")" "$out/recordings/"; done
            evaluate replay "$jobs" "$knowing" "replay:$out/recordings" --split "$train_split"
        } &
        correcting=$!
    fi
    # A separate process: if it fails, the previous policy is used.
    train "$round" "${training[$round]}" "${folders[@]}" &
    wait $! || { say "policy-$round is skipped" && rounds=$((round - 1)); }
    [ -z "${correcting:-}" ] || wait "$correcting" || say "the stage in parallel with the training of policy-$round failed; continuing without it"
    [ "$rounds" -ge "$round" ] || break
    [ ! -e "$out/tensors/corrections-$round" ] || folders+=("$out/tensors/corrections-$round")
done
final=$out/tasks.safetensors
# Evaluations of an earlier state of the policy are moved away.
sum=$(sha256sum <"$out/policy-$rounds/policy.safetensors")
[ ! -e "$final" ] || [ -e "$out/final.txt" ] || echo "$sum" >"$out/final.txt"
if [ "$(cat "$out/final.txt" 2>/dev/null)" != "$sum" ]; then
    for name in tasks.safetensors tasks-reads.safetensors {seen,held_out,blind-pick_mustard,sentence-pick_crackers,sentence-pick_blue_mug}{,.done}; do
        [ ! -e "$out/$name" ] || { mkdir -p "$out/replaced-$$" && mv "$out/$name" "$out/replaced-$$/"; }
    done
    "$python" $learn/export.py "$out/policy-$rounds/policy.safetensors" --bits 8 --out "$final"
    echo "$sum" >"$out/final.txt"
fi
if [ -n "${WORD_VECTORS:-}" ]; then
    # Sentences of scenes that are not evaluated; sampling a scene needs some 50 ms.
    for task in ${tasks//,/ }; do
        [ -e "$out/sentences-$task.jsonl" ] || { wheelarm-server --task "$task" --sentences 10000..10150 --each 4 >"$out/$task.part" \
            && mv "$out/$task.part" "$out/sentences-$task.jsonl"; } &
    done
    wait
    for task in ${tasks//,/ }; do
        [ -s "$out/sentences-$task.jsonl" ] || die "no sentences of $task: see wheelarm-server --task $task --sentences 10000..10150"
    done
    reads=$out/tasks-reads.safetensors
    # "First from the left" and "fourth from the right" are equal, but the mean word vector of
    # the second is nearer to that of another can.
    best_said=()
    [[ ,$tasks, != *,select_coke,* ]] || best_said=(--best-said "select_coke=from the left")
    [ -e "$reads" ] || "$python" $learn/text_encoder.py "$final" --sentences "$out"/sentences-*.jsonl \
        --word-vectors "$WORD_VECTORS" "${best_said[@]}" --out "$reads" | tee "$out/text_encoder.log"
    final=$reads
fi
served="exec:$python $learn/serve.py $final"
# Servers wait for the policy, so more of them than cores are useful.
half=$(((jobs * 5 + 7) / 8))
evaluate seen "$half" "$seeds" "$served" --split "$train_split" &
seen=$!
evaluate held_out "$half" "$held_seeds" "$served" --split "$held_split" &
held=$!
wait $seen $held
table
test_images_and_language
if [ "$knowing" -gt 0 ]; then
    evaluate replay "$jobs" "$knowing" "replay:$out/recordings" --split "$train_split"
    evaluate hold "$jobs" "$knowing" hold --split "$train_split"
    evaluate repeat "$jobs" "$knowing" repeat --split "$train_split"
    table
fi
for ((round = 0; round <= ${#training[@]} - 1; round++)); do
    done_before "policy-$round" || { say "not done: policy-$round is not fully trained; run this again with a later LAST" && exit 4; }
done
say "all is done: $final"
