#!/usr/bin/env bash
# Measures the value of multiplied demonstrations: the same training three times, on ten
# episodes, on their multiplication by `wheelarm multiply`, and on as many episodes of the
# scripted operator; each evaluated on unseen seeds. For a machine with one large GPU. Every
# stage continues after an interruption.
#   client/learn/scripts/train_multiplied.sh OUT [STAGE...]
# Stages, by default all in this order: sources operator multiplied, then train-ten
# train-operator train-multiplied, evaluate-ten evaluate-operator evaluate-multiplied, table.
# Several calls may run in parallel, for example on another GPU (CUDA_VISIBLE_DEVICES for
# training and serving, ADAPTERS for rendering).
# Requires python3 with torch, numpy, safetensors, eclipse-zenoh and protobuf.
#   PLAN      campaign of the operator's episodes (assets/campaigns/mustard-near.toml); the
#             sources use the same plan without disturbances, from seed 30000 on
#   TASK      its task (pick_mustard)
#   EPISODES  episodes of the operator, and of the multiplication (1000)
#   SOURCES   episodes that are multiplied (10)
#   DISTURB   disturbances of the multiplied episodes: those of the plan
#             (noise=2,pushes=1,slips=1,share=0.8)
#   JOBS      programs in parallel (one per core)
#   SECONDS_OF_TRAINING   of each of the three policies (350)
#   SEEDS     seeds of assets/splits/policy-claim.toml that are evaluated (100)
#   NETWORK   more options of train.py
#   DEVICE_OPTIONS   of train.py for another device (--precision bf16 --store device)
#   ADAPTERS  GPUs for rendering, as in --adapters (all)
#   TENSORS   folder of the exported episodes, 60 GB (OUT/tensors)
#   PROGRAMS  folder of wheelarm and its programs (target/release)
set -euo pipefail
cd "$(dirname "$0")/../../.."
out=${1:?give a folder}
shift
plan=${PLAN:-assets/campaigns/mustard-near.toml}
task=${TASK:-pick_mustard}
episodes=${EPISODES:-1000}
sources=${SOURCES:-10}
disturb=${DISTURB-noise=2,pushes=1,slips=1,share=0.8}
jobs=${JOBS:-$(nproc)}
training=${SECONDS_OF_TRAINING:-350}
seeds=${SEEDS:-100}
adapters=${ADAPTERS:-all}
tensors=${TENSORS:-$out/tensors}
python=${PYTHON:-python3}
PATH=$(realpath "${PROGRAMS:-target/release}"):$PATH
export PATH PYTHONPATH="$PWD/client/python/src${PYTHONPATH:+:$PYTHONPATH}"
export PYTHONUNBUFFERED=1 OMP_NUM_THREADS=${OMP_NUM_THREADS:-4}
learn=client/learn/python
mkdir -p "$out" "$tensors"
read -ra device <<<"${DEVICE_OPTIONS:---precision bf16 --store device}"
read -ra network <<<"--width 48 --norm batch --batch 128 --lr 2e-4 --warm-up 300 --shift 4 --execute 10 --pause 2 --without-state *.velocity,odometry.* --aim-weight 0.5 ${NETWORK:-}"

say() { printf '%s  %s\n' "$(date -u +%H:%M:%S)" "$*" | tee -a "$out/times.txt"; }
die() { say "failed: $*" && exit 1; }
done_before() { [ -e "$out/$1.done" ]; }
mark() { touch "$out/$1.done" && say "done: $1"; }

# With several processes: in one process HDF5 serves one thread at a time.
export_rows() { # recordings, name
    local recordings exported
    # Moved when complete: an interrupted export starts again.
    rm -rf "${tensors:?}/${2:?}" "$tensors/.$2.part"
    find "$1" -name '*.h5' -print0 | sort -z | xargs -0 -r -P $(((jobs + 1) / 2)) -n 25 sh -c \
        'out=$0; exec wheelarm-dataset export --format tensors --trim-idle 0.5 "$@" --out "$out"' "$tensors/.$2.part" >"$out/export-$2.log" 2>&1 ||
        say "export of $2: $(tail -n 2 "$out/export-$2.log")"
    recordings=$(find "$1" -name '*.h5' | wc -l) exported=$(find "$tensors/.$2.part" -name '*.safetensors' 2>/dev/null | wc -l)
    # An unreadable file is skipped; more than one in twenty missing means a full disk.
    [ $((exported * 20)) -ge $((recordings * 19)) ] && [ "$exported" -gt 0 ] || die "$exported of $recordings episodes of $2 were exported"
    mv "$tensors/.$2.part" "$tensors/$2"
    say "$2: $exported episodes, $(du -sh "$tensors/$2" | cut -f1)"
}
collect() { # name, plan
    local status=0
    say "episodes of $2"
    wheelarm collect "$2" --out "$out/$1" --workers "$jobs" --adapters "$adapters" >"$out/collect-$1.log" 2>&1 || status=$?
    # 3: some episodes are missing.
    [ $status -eq 0 ] || [ $status -eq 3 ] || die "collect: $(tail -n 3 "$out/collect-$1.log")"
    say "$(grep -h 'episodes,' "$out/collect-$1.log" | tail -n 1)"
    export_rows "$out/$1/episodes" "$1"
}
make_sources() {
    # The sources are recorded without disturbances.
    sed -e "s/^name = \"mustard-near\"/name = \"sources\"/" -e 's/^first_seed = .*/first_seed = 30000/' \
        -e "s/^episodes = .*/episodes = $sources/" -e '/^\[disturb\]/,/^$/d' "$plan" >"$out/sources.toml"
    collect ten "$out/sources.toml"
}
make_operator() {
    sed -e "s/^episodes = .*/episodes = $episodes/" "$plan" >"$out/operator.toml"
    collect operator "$out/operator.toml"
}
# Attempts without images; successful ones are rendered with the plan's cameras.
make_multiplied() {
    local status=0 gpus=("") cameras=() name size rate
    say "multiplying $sources episodes into $episodes"
    wheelarm multiply "$out/ten" --task "$task" --episodes "$episodes" --out "$out/multiplied" --jobs "$jobs" \
        ${disturb:+--disturb "$disturb"} >"$out/multiply.log" 2>&1 || status=$?
    [ $status -eq 0 ] || die "multiply: $(tail -n 2 "$out/multiply.log")"
    say "$(grep -h 'kept (' "$out/multiply.log" | tail -n 1)"
    while IFS='|' read -r name size rate; do
        cameras+=(--camera "$name=$size@$rate")
    done < <("$python" -c 'import sys, tomllib
for c in tomllib.load(open(sys.argv[1], "rb"))["camera"]:
    print(c["name"], "x".join(map(str, c["size"])), c["rate"], sep="|")' "$plan")
    [ "$adapters" = all ] || mapfile -t gpus < <(tr , '\n' <<<"$adapters")
    render() { # file, GPU, cameras
        local file=$1 gpu=$2
        shift 2
        local name
        name=$(basename "$file" .h5)
        [ ! -e "$out/rendered/$name-replay.h5" ] || return 0
        # Deletes the remains of an interrupted rendering.
        rm -rf "$out/rendering/$name"
        if wheelarm replay "$file" --out "$out/rendering/$name" ${gpu:+--adapter "$gpu"} "$@" >>"$out/render.log" 2>&1; then
            mv "$out/rendering/$name"/*-replay.h5 "$out/rendered/" && rm -rf "$out/rendering/$name"
        else
            echo "not rendered: $file" >>"$out/render.log"
        fi
    }
    export -f render
    export out
    mkdir -p "$out/rendered" "$out/rendering"
    : >"$out/render.log"
    # The GPUs in turn.
    local number=0 file
    for file in "$out"/multiplied/*.h5; do
        [ -e "$file" ] || die "nothing was multiplied: $(tail -n 2 "$out/multiply.log")"
        printf '%s\0%s\0' "$file" "${gpus[number % ${#gpus[@]}]}"
        number=$((number + 1))
    done | xargs -0 -r -n 2 -P "$jobs" bash -c 'render "${@: -2:1}" "${@: -1:1}" "${@:1:$#-2}"' render "${cameras[@]}"
    say "rendered: $(find "$out/rendered" -name '*.h5' | wc -l); not rendered: $(grep -c '^not rendered' "$out/render.log" || true)"
    export_rows "$out/rendered" multiplied
}
train() { # name
    say "training on $1, $training s"
    "$python" $learn/train.py "$tensors/$1" --out "$out/policy-$1" --name "$task-$1" --steps 1000000 --within "$training" \
        "${device[@]}" "${network[@]}" >"$out/train-$1.log" 2>&1 || die "training on $1: $(tail -n 3 "$out/train-$1.log")"
    say "$1: $(grep '^step' "$out/train-$1.log" | tail -n 1)"
}
evaluate() { # name
    local status=0
    say "evaluation of the policy trained on $1"
    wheelarm evaluate --task "$task" --split assets/splits/policy-claim.toml --episodes "$seeds" --jobs "$jobs" --no-grid \
        --adapters "$adapters" --policy "exec:$python $learn/serve.py $out/policy-$1/policy.safetensors" \
        --out "$out/evaluation-$1" >"$out/evaluate-$1.log" 2>&1 </dev/null || status=$?
    # The command fails when a seed fails; the evaluation is complete when it has all seeds.
    local count
    count=$(grep -c '"seed"' "$out/evaluation-$1/episodes.jsonl" 2>/dev/null || true)
    [ "${count:-0}" -ge "$seeds" ] || die "evaluation of $1 ended with $status, ${count:-0} of $seeds seeds: $(tail -n 3 "$out/evaluate-$1.log")"
    say "$1: $(grep -c '"success":true' "$out/evaluation-$1/episodes.jsonl") of $(wc -l <"$out/evaluation-$1/episodes.jsonl")"
}
table() {
    local name
    {
        echo "| trained on | episodes | success, of $seeds seeds |"
        echo "|---|---|---|"
        for name in ten multiplied operator; do
            [ -e "$out/evaluation-$name/episodes.jsonl" ] || continue
            echo "| $name | $(find "$tensors/$name" -name '*.safetensors' | wc -l) | $(grep -c '"success":true' "$out/evaluation-$name/episodes.jsonl") of $(wc -l <"$out/evaluation-$name/episodes.jsonl") |"
        done
        for name in ten multiplied; do
            if done_before "evaluate-$name" && done_before evaluate-operator; then
                echo && echo "$name compared with operator:"
                wheelarm evaluate compare "$out/evaluation-$name" "$out/evaluation-operator" --out "$out/compared-$name"
            fi
        done
    } | tee "$out/table.md"
}

[ $# -gt 0 ] || set -- sources operator multiplied train-{ten,operator,multiplied} evaluate-{ten,operator,multiplied} table
for program in wheelarm wheelarm-server wheelarm-worker wheelarm-dataset; do
    command -v "$program" >/dev/null || die "the program $program is not in PATH"
done
[ -e "$plan" ] || die "cannot read the plan $plan: it does not exist"
need() { done_before "$1" || die "the stage $stage needs the stage $1, which is not done"; }
for stage in "$@"; do
    if done_before "$stage"; then continue; fi
    case $stage in
    multiplied | train-ten) need sources ;;
    train-*) need "${stage#train-}" ;;
    evaluate-*) need "train-${stage#evaluate-}" ;;
    esac
    case $stage in
    sources) make_sources ;;
    operator) make_operator ;;
    multiplied) make_multiplied ;;
    train-ten | train-operator | train-multiplied) train "${stage#train-}" ;;
    evaluate-ten | evaluate-operator | evaluate-multiplied) evaluate "${stage#evaluate-}" ;;
    table) table && continue ;;
    *) die "unknown stage $stage" ;;
    esac
    mark "$stage"
done
