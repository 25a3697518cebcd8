#!/usr/bin/env bash
# Measures step, inverse kinematics, cameras and recording, each with its reference in the same
# run, and prints one table; then the exports of a recording, and the error of aligned poses.
# `make bench` builds and installs first.
#   tests/bench.sh [--rounds N] [--no-demo]
set -euo pipefail
cd "$(dirname "$0")/.."
python=${WHEELARM_PYTHON:-.venv/bin/python}
if ! "$python" -c 'import numpy' 2>/dev/null; then
    echo "the references need Python packages; run: scripts/setup.sh python numpy h5py mujoco" >&2
    exit 1
fi
# MuJoCo draws headless through EGL; the rest runs without.
if ! PATH=$PATH:/sbin:/usr/sbin ldconfig -p | grep libEGL.so.1 >/dev/null; then
    echo "MuJoCo's pictures will be skipped; to have them: sudo apt-get install -y libegl1 libgl1-mesa-dri" >&2
fi
"$python" tests/bench/compare.py "$@"
echo
"$python" tests/bench/dataset.py
echo
"$python" tests/bench/align.py
