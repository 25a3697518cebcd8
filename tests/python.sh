#!/usr/bin/env bash
# Tests the Python package with all supported versions: Python 3.10 to 3.13 with protobuf
# 3.20.3, 5.29.6, 6.31.1 and the newest 7. One of them also tests every task and mode, types,
# lints, the guide's Python and the notebook, and prints the cost of images and steps.
#   WHEELARM_PYTHONS   folder of the virtual environments, default .venv-python
# Searches interpreters on PATH and in ~/.pyenv; reports a missing one at the end.
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD package=$PWD/client/python
folder=${WHEELARM_PYTHONS:-$root/.venv-python}
export PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1
export WHEELARM_ASSETS=${WHEELARM_ASSETS:-$root/assets}
mkdir -p "$folder"
missing=()
python_of() { # version
    local candidate
    for candidate in "python$1" "$HOME"/.pyenv/versions/"$1".*/bin/python3; do
        "$candidate" -c "import sys; sys.exit('%d.%d' % sys.version_info[:2] != '$1')" 2>/dev/null && echo "$candidate" && return
    done
    return 1
}
whole=
for pair in 3.10=3.20.3=numpy==1.23.5 3.11=5.29.6=numpy 3.12=6.31.1=numpy '3.13=7.*=numpy'; do
    IFS="=" read -r version protobuf numpy <<<"$pair"
    if ! found=$(python_of "$version"); then
        missing+=("$version")
        continue
    fi
    venv=$folder/$version python=$folder/$version/bin/python
    [ -x "$python" ] || "$found" -m venv "$venv"
    "$python" -c 'import zenoh, gymnasium, pytest, hatchling, editables' 2>/dev/null ||
        "$python" -m pip install -q 'eclipse-zenoh>=1.10,<1.11' "protobuf==$protobuf" "$numpy" 'gymnasium>=1.1,<2' pytest hatchling editables
    "$python" -m pip install -q --no-build-isolation --no-deps -e "$package"
    echo "== Python $version, $("$python" -m pip list 2>/dev/null | grep -E '^(protobuf|numpy|gymnasium) ' | tr -s ' ' | paste -sd, -)"
    (cd "$package" && "$python" -m pytest -q -m "not slow")
    whole=$python
done
[ -n "$whole" ] || { echo "no Python from 3.10 to 3.13 is found; install one" >&2; exit 1; }
echo "== everything else, with $("$whole" --version)"
"$whole" -c 'import grpc_tools, h5py, mypy, nbconvert, ipykernel, matplotlib' 2>/dev/null ||
    "$whole" -m pip install -q grpcio-tools h5py mypy types-protobuf ruff nbconvert ipykernel matplotlib
cd "$package"
"$whole" scripts/make_contract.py --check
"$whole" -m ruff check -q . && "$whole" -m ruff format -q --check .
"$whole" -m mypy
"$whole" -m pytest -q tests/test_contract.py tests/test_recorded.py
"$whole" -m pytest -q -m slow
echo "== the guide's Python"
"$whole" "$root/tests/python/guide_blocks.py" "$root/docs/integrate-and-operate/python.md" python | "$whole" -
echo "== the notebook"
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
"$whole" -m nbconvert --log-level ERROR --to notebook --execute --output-dir "$out" notebooks/ten_minutes.ipynb
echo "== what pictures and steps cost"
"$whole" tests/throughput.py
"$whole" tests/steps.py
if [ ${#missing[@]} -gt 0 ]; then
    echo "NOT TESTED: Python ${missing[*]} is neither on PATH nor in ~/.pyenv" >&2
    exit 3
fi
