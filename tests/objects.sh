#!/usr/bin/env bash
# Trials of the objects of assets/kinds.toml with the scripted operator: each grasp alone, then the
# object. Writes the verdicts into assets/packs and the figures into docs/results/objects.md.
# `make test-objects` builds first.
#   OBJECT_JOBS     objects at a time, default the number of processors
#   OBJECT_TRIALS   trials of each object, default 20
#   GRASP_TRIALS    trials of each of its grasps before, default 2
#   OBJECT_RESULTS  lines of results, default data/objects.jsonl; objects in it are not tried again
#   OBJECTS         kinds or objects to try, default all
set -euo pipefail
cd "$(dirname "$0")/.."
wheelarm=${WHEELARM:-$PWD/target/release/wheelarm}
jobs=${OBJECT_JOBS:-$(nproc)}
export OBJECT_RESULTS=${OBJECT_RESULTS:-$PWD/data/objects.jsonl}
export WHEELARM_ASSETS=$PWD/assets
mkdir -p "$(dirname "$OBJECT_RESULTS")"
touch "$OBJECT_RESULTS"
# The packs of the user are not tried.
none=$(mktemp -d)
trap 'rmdir "$none"' EXIT
read -ra objects <<<"${OBJECTS:-}"
python3 tests/python/object_results.py pending "${objects[@]}" | xargs -P "$jobs" -I NAME sh -c \
    "'$wheelarm' object check NAME --trials '${OBJECT_TRIALS:-20}' --grasp-trials '${GRASP_TRIALS:-2}' \
    --packs '$none' --json '$OBJECT_RESULTS' 2> /dev/null || echo 'NAME: no result' >&2"
python3 tests/python/object_results.py untried
python3 tests/python/object_results.py report
