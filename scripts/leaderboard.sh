#!/usr/bin/env bash
# Checks the results in docs/results/leaderboard and writes the tables of
# docs/results/leaderboard.md from them. Needs `wheelarm` in target/release or PROGRAMS.
#   scripts/leaderboard.sh
set -euo pipefail
cd "$(dirname "$0")/.."
programs=${PROGRAMS:-target/release}
shopt -s nullglob
files=(docs/results/leaderboard/*.json)
[ "${#files[@]}" -gt 0 ] || { echo "docs/results/leaderboard has no results: copy files of wheelarm evaluate --suite into it" >&2 && exit 1; }
"$programs/wheelarm" evaluate verify "${files[@]}" --leaderboard docs/results/leaderboard.md
