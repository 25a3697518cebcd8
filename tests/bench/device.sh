#!/usr/bin/env bash
# Measures campaigns on a host with one or several GPUs, with existing programs:
# small images and 720p, into memory and onto disk, one GPU and two; one table, and
# report.md and report.json in OUT. Eight minutes at most.
# Nothing is built; Python 3 is needed, without packages.
#   tests/bench/device.sh PROGRAMS ASSETS OUT [options of tests/bench/device.py]
# PROGRAMS holds wheelarm, wheelarm-server and wheelarm-worker.
set -euo pipefail
[ $# -ge 3 ] || {
    sed -n '2,7s/^# \{0,1\}//p' "$0" >&2
    exit 2
}
here=$(cd "$(dirname "$0")/../.." && pwd)
programs=$1 assets=$2 out=$3
shift 3
for program in wheelarm wheelarm-server wheelarm-worker; do
    [ -x "$programs/$program" ] || {
        echo "$programs/$program is missing; build it with: cargo build --release --bins" >&2
        exit 2
    }
done
export XDG_RUNTIME_DIR=${XDG_RUNTIME_DIR:-${TMPDIR:-/tmp}}
exec python3 "$here/tests/bench/device.py" --programs "$programs" --assets "$assets" --out "$out" "$@"
