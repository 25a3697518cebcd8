#!/usr/bin/env bash
# Tests the page that drives (client/teleop/web/page).
#   tests/drive.sh        its logic with node; every device, accessibility and a headset in
#                         Chromium; and one switch that lifts the mustard, on twelve seeds. Installs
#                         Chromium and four npm packages if they are missing. With SLOW=4 all
#                         clocks of the last part run at a quarter, for a busy machine.
#   tests/drive.sh fast   only its logic: seconds, with node alone
set -euo pipefail
cd "$(dirname "$0")/drive"

# Ends a run without its tool: an error, but `fast` without WHEELARM_NO_SKIPS skips its tests.
missing() {
    if [ "$1" = fast ] && [ -z "${WHEELARM_NO_SKIPS:-}" ]; then
        echo "$2: the tests of the driving page are skipped (apt-get install nodejs)"
        exit 0
    fi
    echo "$2: install node 20 or newer (apt-get install nodejs npm)" >&2
    exit 1
}
mode=${1:-all}
command -v node >/dev/null || missing "$mode" "node is missing"
node -e 'process.exit(Number(process.versions.node.split(".")[0]) < 20 ? 1 : 0)' ||
    missing "$mode" "node $(node --version) is too old for the tests of the driving page"
node --test unit/
[ "$mode" = fast ] && exit 0

../../scripts/setup.sh chromium
for browser in chromium chromium-browser google-chrome; do
    CHROMIUM=${CHROMIUM:-$(command -v "$browser" || true)}
done
[ -n "$CHROMIUM" ] || { echo "no Chromium: apt-get install chromium" >&2; exit 1; }
export CHROMIUM
[ -d node_modules/ws ] || npm install --no-audit --no-fund --no-package-lock --silent
# One file after the other: each starts a browser, and the page counts as frozen while it waits
# for a CPU.
node --test --test-concurrency=1 browser/
# With the real server: the whole task with one switch.
if [ -x ../../target/release/wheelarm ]; then
    node lift.js
else
    echo "one switch alone was not tried: there are no programs (make build)"
fi
