#!/usr/bin/env bash
# The compiler of `make test` (RUSTC_WRAPPER): compiles tests, and the programs that only tests
# run, without optimisation, except tests of packages that compute much. Other programs and
# libraries are compiled as always, and a later `make demo` uses them. docs/results/build-time.md
# has the times.
set -euo pipefail
case " $* " in
*" --test "* | *" --crate-name wheelarm_test_"*) ;;
*) exec "$@" ;;
esac
case " $* " in
# `make lints` finds it built.
*" --crate-name zenoh_link_tls "*) exec "$("$1" --print sysroot)/bin/clippy-driver" "$@" -D warnings ;;
*" --crate-name wheelarm_server "* | *" --crate-name wheelarm_import "* | *" --crate-name wheelarm_language "* | \
    *" --crate-name wheelarm_planning "* | *" --crate-name wheelarm_expert "* | *" --crate-name wheelarm_sensor_models "* | \
    *" --crate-name wheelarm_codec "*) exec "$@" ;;
esac
exec "${@/#opt-level=*/opt-level=0}"
