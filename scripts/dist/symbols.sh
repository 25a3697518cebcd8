#!/usr/bin/env bash
# Fails where a program asks for more than what is promised: a glibc above 2.28,
# a library beside glibc, the C library's trigonometry for the physics, or where
# it tells a path of this machine.
#   scripts/dist/symbols.sh PROGRAM...
set -euo pipefail
most=2.28
for program in "$@"; do
    glibc=$(objdump -T "$program" | grep -o 'GLIBC_[0-9.]*' | sed s/GLIBC_// | sort -Vu | tail -1)
    needed=$(readelf -d "$program" | sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p' | sort | xargs)
    echo "$(basename "$program"): $(du -m "$program" | cut -f1) MB, glibc $glibc, needs $needed"
    if [ "$(printf '%s\n%s\n' "$most" "$glibc" | sort -V | tail -1)" != "$most" ]; then
        echo "error: $program asks for glibc $glibc, more than $most" >&2
        exit 1
    fi
    for library in $needed; do
        case $library in
        libc.so.6 | libm.so.6 | libdl.so.2 | librt.so.1 | libpthread.so.0 | libutil.so.1 | ld-linux-x86-64.so.2) ;;
        *)
            echo "error: $program needs $library, which not every system has; link it statically" >&2
            exit 1
            ;;
        esac
    done
    case $(basename "$program") in wheelarm-server)
        # server/src/world/libm_overrides.rs defines them, the same for every glibc.
        foreign=$(nm -D --undefined-only "$program" | grep -owE '(acos|cos|sin|sincos)f' | xargs || true)
        if [ -n "$foreign" ]; then
            echo "error: the physics of $program calls $foreign of the C library, which has other bits elsewhere" >&2
            exit 1
        fi
        ;;
    esac
    # All of them are read: a pipe that ends early is a failure to pipefail.
    found=$(strings -a "$program" | grep -F -e "$HOME/" -e "$PWD/" || true)
    if [ -n "$found" ]; then
        echo "error: $program contains paths of this machine, the first: ${found%%$'\n'*}; see scripts/dist/neutral.py" >&2
        exit 1
    fi
done
