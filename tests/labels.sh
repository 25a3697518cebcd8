#!/usr/bin/env bash
# Counts the sentences of the grammar; records ten episodes of five tasks with its sentences,
# labels them, and computes 500 of their answers again from the files alone.
set -euo pipefail
cd "$(dirname "$0")/.."
built=${CARGO_TARGET_DIR:-target}/release
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"$built/examples/count" 60 25
for task in pick_mustard select_coke open_drawer place_knife pick_bowl; do
    "$built/wheelarm" evaluate --task "$task" --seeds 0..2 --record --camera '*=64x36@2' \
        --language 3 --no-grid --out "$folder/$task" --assets assets
done
"$built/wheelarm-dataset" annotate "$folder"/*/*.h5 --out "$folder/labels"
"${WHEELARM_PYTHON:-python3}" tests/python/check_answers.py --rows 500 "$folder"/labels/*.h5
