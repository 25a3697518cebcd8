#!/usr/bin/env bash
# The compiler of `make test` (RUSTC_WRAPPER). Tests of this repository are compiled by clippy,
# with warnings denied, so that `make lints` does not check them again. Tests, and the programs
# that only tests run, are not optimised, except tests of packages that compute much. Other
# programs and libraries are compiled as always, and a later `make demo` uses them.
# docs/results/build-time.md has the times.
set -euo pipefail
case " $* " in
*" --test "* | *" --crate-name wheelarm_test_"*) ;;
*) exec "$@" ;;
esac
case "${CARGO_PRIMARY_PACKAGE:+own} $* " in
own*" --test "*) set -- "$("$1" --print sysroot)/bin/clippy-driver" "$@" -D warnings ;;
esac
case " $* " in
*" --crate-name wheelarm_server "* | *" --crate-name wheelarm_import "* | *" --crate-name wheelarm_language "* | \
    *" --crate-name wheelarm_planning "* | *" --crate-name wheelarm_expert "* | *" --crate-name wheelarm_sensor_models "* | \
    *" --crate-name wheelarm_codec "* | *" --crate-name zenoh_link_tls "*) exec "$@" ;;
esac
exec "${@/#opt-level=*/opt-level=0}"
