#!/usr/bin/env bash
# Installs what WheelArm needs beside Rust, or prints the exact line that does.
#   scripts/setup.sh          system packages (HDF5, Vulkan loader and a CPU driver)
#   scripts/setup.sh python   also strace, ffmpeg, shellcheck, and .venv with the Python packages named after it
#   scripts/setup.sh chromium   also a browser for the test that opens a page, if apt has one
#   scripts/setup.sh room GB    nothing but says whether the disk has room to compile
set -euo pipefail
cd "$(dirname "$0")/.."

# A disk that fills up ends a compiler after a quarter of an hour, with words about
# something else. What is compiled already counts as room.
if [ "${1:-}" = room ]; then
    target=${CARGO_TARGET_DIR:-target}
    mkdir -p "$target"
    free=$(df -Pk "$target" | awk 'NR == 2 { print $4 }')
    used=$(du -sk "$target" | cut -f1)
    if [ $(((free + used) / 1000000)) -lt "$2" ]; then
        echo "$(df -Ph "$target" | awk 'NR == 2 { print $4 }') are free for $target, and compiling takes $2 GB:" >&2
        echo "make room, or name a folder on another disk by CARGO_TARGET_DIR" >&2
        exit 1
    fi
    exit
fi

missing=()
need() { # package, test command
    local package=$1
    shift
    "$@" >/dev/null 2>&1 || missing+=("$package")
}
# No `grep -q`: it would close the pipe early, which pipefail takes for a failure.
have_lib() { PATH=$PATH:/sbin:/usr/sbin ldconfig -p | grep "$1" >/dev/null; }
have_icd() { compgen -G '/usr/share/vulkan/icd.d/*.json' || compgen -G '/etc/vulkan/icd.d/*.json'; }
need build-essential cc --version
need pkg-config pkg-config --version
# ISA-L compresses the recordings and is built from its source.
need autoconf autoreconf --version
need libtool libtoolize --version
need nasm nasm --version
need libhdf5-dev pkg-config --exists hdf5
need libvulkan1 have_lib libvulkan.so.1
need mesa-vulkan-drivers have_icd
if [ "${1:-}" = python ]; then
    need python3-venv python3 -c 'import venv, ensurepip'
    # The tests kill recorders at chosen system calls with it.
    need strace strace -V
    # Data sets for LeRobot have videos.
    need ffmpeg ffmpeg -version
    # tests/build.sh checks the shell scripts.
    need shellcheck shellcheck --version
fi
if [ ${#missing[@]} -gt 0 ]; then
    line="apt-get install -y ${missing[*]}"
    if ! command -v apt-get >/dev/null; then
        echo "missing: ${missing[*]} (Debian names); install them with this system's package manager" >&2
        exit 1
    elif [ "$(id -u)" = 0 ]; then
        echo "installing ${missing[*]}"
        apt-get update -qq
        DEBIAN_FRONTEND=noninteractive apt-get install -y -qq "${missing[@]}" >/dev/null
    elif sudo -n true 2>/dev/null; then
        echo "installing ${missing[*]}"
        sudo -n apt-get update -qq
        sudo -n env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq "${missing[@]}" >/dev/null
    else
        echo "missing system packages; run this once, then try again:" >&2
        echo "    sudo apt-get update && sudo $line" >&2
        exit 1
    fi
fi
if ! command -v cargo >/dev/null; then
    echo "Rust is missing; install it once with" >&2
    echo "    curl --proto '=https' --tlsv1.2 -sSf https://sh.rustup.rs | sh" >&2
    exit 1
fi
if [ "${1:-}" = python ]; then
    shift
    [ -x .venv/bin/python ] || python3 -m venv .venv
    # PACKAGE, or PACKAGE:MODULE where the module has another name.
    for entry in "$@"; do
        package=${entry%%:*} module=${entry##*:}
        .venv/bin/python -c "import ${module%%=*}" 2>/dev/null ||
            .venv/bin/python -m pip install --quiet --disable-pip-version-check "$package"
    done
fi
# Without a browser its one test says that it is skipped; so nothing here fails.
if [ "${1:-}" = chromium ]; then
    for browser in chromium chromium-browser google-chrome; do
        "$browser" --version >/dev/null 2>&1 && exit 0
    done
    install=(apt-get install -y --no-install-recommends chromium)
    if [ "$(id -u)" = 0 ]; then
        as_root=(env)
    else
        as_root=(sudo -n)
    fi
    echo "installing chromium"
    if ! { "${as_root[@]}" apt-get update -qq && "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive "${install[@]}" -qq; } >/dev/null 2>&1; then
        echo "chromium cannot be installed from here; the test that opens a page will be skipped"
        echo "    sudo apt-get update && sudo ${install[*]}"
    fi
fi
