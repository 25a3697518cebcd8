#!/usr/bin/env bash
# The compiler of `make lints` (RUSTC_WRAPPER): clippy and rustdoc for each crate of this
# repository, with warnings denied. Writes metadata only, and reads the metadata that the build
# wrote for other crates: `cargo clippy` and `cargo doc` would check all of them again.
set -euo pipefail
[ -n "${CARGO_PRIMARY_PACKAGE:-}" ] || exec "$@"
tools=$("$1" --print sysroot)/bin
clippy=("$tools/clippy-driver" "$@" -D warnings)
# It is run, and therefore compiled.
case " $* " in *" --crate-name build_script_"*) exec "${clippy[@]}" ;; esac
clippy=("${clippy[@]/#--emit=*/--emit=dep-info,metadata}")
"${clippy[@]/%.rlib/.rmeta}"

# Documented are libraries, and the program without one: the others are a file without links.
private=()
case " $* " in
*" --test "* | *"/release/examples "*) exit ;;
*" --crate-type bin "*)
    [ ! -e "$CARGO_MANIFEST_DIR/src/lib.rs" ] || exit 0
    private=(--document-private-items)
    ;;
esac
shift
arguments=()
while [ $# -gt 0 ]; do
    case $1 in
    --emit=*) ;;
    --out-dir) shift ;;
    *) arguments+=("${1/%.rlib/.rmeta}") ;;
    esac
    shift
done
pages=$(mktemp -d)
trap 'rm -rf "$pages"' EXIT
"$tools/rustdoc" "${arguments[@]}" "${private[@]}" -D warnings --out-dir "$pages"
