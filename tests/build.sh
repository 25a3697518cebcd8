#!/usr/bin/env bash
# Tests the build itself: shellcheck over every tracked shell script, and `make test` in a
# copy of this checkout whose path contains a space, with cargo replaced by `true` and the
# Python tests only collected. Takes seconds. Uses the .venv of this checkout.
set -euo pipefail
cd "$(dirname "$0")/.."

git ls-files -z | xargs -0 grep -lIZ -m 1 -E '^#!.*\b(ba)?sh$' | xargs -0 shellcheck

# The copy has the tracked files as they are on disk, so that uncommitted work is tested.
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
copy="$folder/a folder"
mkdir "$copy"
git ls-files -z | tar --null --ignore-failed-read -T - -cf - 2>/dev/null | tar -xf - -C "$copy"
ln -s "$PWD/.venv" "$copy/.venv"
env -u WHEELARM_PYTHON -u CARGO_TARGET_DIR -u MAKEFLAGS -u MAKELEVEL \
    PYTEST_ADDOPTS="--collect-only -qq -p no:cacheprovider" PYTHONDONTWRITEBYTECODE=1 \
    make --no-print-directory -C "$copy" test CARGO=true BUILD_TEST= LINTS_AFTER=0 >"$folder/log" 2>&1 || {
    echo "make test failed in a folder with a space in its name:" >&2
    tail -n 20 "$folder/log" >&2
    exit 1
}
# Every other target expands to commands whose words survive the space: no unquoted
# use of a path that make computes.
read -ra targets <<<"$(sed -n 's/^\.PHONY: //p' Makefile)"
for target in "${targets[@]}"; do
    make --no-print-directory -C "$copy" -n "$target" CARGO=true BUILD_TEST= SCRIPTS="$folder/a folder" WHEEL="$folder/a folder" \
        OUT="$folder/a folder" RUN="$folder/a folder" PLAN="$folder/a folder" AGAINST="$folder/a folder" CARGO_TARGET_DIR="$folder/a folder" >"$folder/commands"
    # shellcheck disable=SC2016 # Programs for another shell.
    if tr -d '\\\n' <"$folder/commands" | sed 's/"[^"]*"//g' | grep -F "a folder" >/dev/null; then
        echo "make $target uses a path without quotes:" >&2
        grep -F "a folder" "$folder/commands" >&2
        exit 1
    fi
done
echo "the build passes in a folder with a space in its name"
