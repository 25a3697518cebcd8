#!/usr/bin/env bash
# Checks the output of `make dist` in clean Debian systems. Needs root and mmdebstrap; prints
# "skipped" and the reason for a check that cannot run.
#   tests/dist.sh                every check
#   tests/dist.sh CHECK...       of: symbols bits wheel network deb image apptainer
# WHEELARM_CHROOTS: folder that keeps the clean systems for the next run (2 GB); RECORDINGS:
# episode files for `bits` instead of new recordings; MIRROR: another Debian mirror.
set -euo pipefail
cd "$(dirname "$0")/.."
dist=$PWD/dist
version=$(sed -n '/^\[workspace.package\]/,/^$/s/^version = "\(.*\)"/\1/p' Cargo.toml)
name=wheelarm-$version-x86_64-unknown-linux-gnu
deb=$dist/wheelarm_$version-1_amd64.deb
oci=$dist/wheelarm-$version-x86_64.oci.tar
chroots=${WHEELARM_CHROOTS:-}
work=$(mktemp -d "${TMPDIR:-/tmp}/wheelarm-dist-XXXXXX")
[ -n "$chroots" ] || chroots=$work/chroots
mkdir -p "$chroots"
unset WHEELARM_ASSETS

source tests/dist/systems.sh
finish() {
    code=$?
    if [ $code -ne 0 ]; then
        echo "failed"
    fi
    rm -rf --one-file-system "$work"
}
trap finish EXIT

say() { echo "== $*"; }
skip() { echo "skipped: $*"; }
die() {
    echo "error: $*" >&2
    exit 1
}

# No symbol newer than glibc 2.28, no dependency on HDF5, no path of this machine.
check_symbols() {
    say "symbols: what the programs of the archive ask for"
    scripts/dist/symbols.sh "$work/$name"/bin/*
    local wheel
    if wheel=$(ls "$dist"/wheelarm-*manylinux*.whl 2>/dev/null); then
        python3 -m venv "$work/auditwheel"
        "$work/auditwheel/bin/pip" install --quiet --disable-pip-version-check auditwheel
        "$work/auditwheel/bin/auditwheel" show "$wheel" | tee "$work/audit"
        tr '\n' ' ' <"$work/audit" | grep -q 'manylinux_2_28_x86_64\|manylinux_2_27_x86_64\|manylinux_2_17_x86_64' ||
            die "auditwheel does not say manylinux_2_28 of $wheel"
    else
        skip "auditwheel; there is no wheel in $dist"
    fi
}

# Equal bits with every glibc, and with one without FMA.
check_bits() {
    say "bits: episodes replayed by the programs of the archive"
    local files=() native=${CARGO_TARGET_DIR:-target}/release/wheelarm
    if [ -n "${RECORDINGS:-}" ]; then
        read -ra files <<<"$RECORDINGS"
    else
        # Recorded by a build with another compiler and linker, if one exists.
        [ -x "$native" ] || native=$work/$name/bin/wheelarm
        for task in pick_mustard open_drawer place_teddy_bear; do
            WHEELARM_ASSETS=$PWD/assets "$native" evaluate --task $task --seeds 0..1 --record \
                --patience 600 --camera '*=160x90@1' --no-grid --out "$work/recorded/$task" >"$work/recorded-$task.log" 2>&1 ||
                die "recording $task: $(tail -n 5 "$work/recorded-$task.log")"
        done
        mapfile -t files < <(find "$work/recorded" -name '*.h5' | sort)
    fi
    [ ${#files[@]} -gt 0 ] || die "there is no recording to replay"
    local file told suite first
    for file in "${files[@]}"; do
        first=$("$work/$name/bin/wheelarm" replay "$file")
        case $first in *" 0 hashes"*) die "$file holds no hashes" ;; esac
        echo "$(basename "$file"): here, glibc $(ldd --version | sed -n '1s/.* //p'): $first"
        told=$(GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable,-FMA4_Usable \
            "$work/$name/bin/wheelarm" replay "$file")
        [ "$told" = "$first" ] || die "without FMA: $told"
        echo "$(basename "$file"): without FMA in glibc: $told"
    done
    for suite in bullseye bookworm trixie; do
        system $suite minbase || continue
        copy_of "$chroots/$suite-minbase" "$work/$suite"
        cp -a "$work/$name" "$work/$suite/opt/wheelarm"
        for file in "${files[@]}"; do
            cp "$file" "$work/$suite/root/"
            first=$("$work/$name/bin/wheelarm" replay "$file")
            told=$(offline "$work/$suite" /opt/wheelarm/bin/wheelarm replay "/root/$(basename "$file")")
            [ "$told" = "$first" ] || die "$suite: $told"
            echo "$(basename "$file"): $suite, glibc $(glibc_of "$work/$suite"): $told"
        done
        rm -rf "${work:?}/$suite"
    done
}

# Whether a wheel with programs exists, and a bookworm system for it, with Python and a Vulkan
# driver, without Rust and HDF5.
can_install_wheel() {
    compgen -G "$dist/wheelarm-*manylinux*.whl" >/dev/null || {
        skip "there is no wheel with programs in $dist"
        return 1
    }
    system bookworm wheel python3-venv,libvulkan1,mesa-vulkan-drivers
}

# Installs the wheel, from files only, in a copy of that system.
with_wheel() {
    local root=$1 wheel
    wheel=$(ls "$dist"/wheelarm-*manylinux*.whl)
    if [ ! -d "$work/wheelhouse" ]; then
        python3 -m venv "$work/pip"
        "$work/pip/bin/pip" download --quiet --disable-pip-version-check --dest "$work/wheelhouse" \
            --only-binary=:all: --python-version 3.11 --platform manylinux_2_28_x86_64 \
            --platform manylinux2014_x86_64 --platform manylinux_2_17_x86_64 "$wheel"
    fi
    copy_of "$chroots/bookworm-wheel" "$root"
    mkdir "$root/wheels"
    cp "$work"/wheelhouse/*.whl "$root/wheels/"
    if find "$root" -xdev \( -name 'libhdf5*' -o -name rustc -o -name cargo \) | grep .; then
        die "the clean system holds HDF5 or Rust"
    fi
    offline "$root" python3 -m venv /v
    offline "$root" /v/bin/pip install --quiet --no-index --find-links /wheels "/wheels/$(basename "$wheel")"
}

# Two commands from a wheel to an episode with images.
check_wheel() {
    say "wheel: pip install, then the demo, without Rust, HDF5 and network"
    can_install_wheel || return 0
    with_wheel "$work/wheel"
    offline "$work/wheel" /v/bin/wheelarm --version
    offline "$work/wheel" /v/bin/wheelarm doctor || true
    # shellcheck disable=SC2086
    offline "$work/wheel" /v/bin/wheelarm demo --out /data ${DEMO_OPTIONS:-} | tee "$work/demo"
    grep -q 'first image after' "$work/demo" || die "the demo had no image"
    [ -s "$work/wheel/data/pick_mustard-seed0.png" ] || die "the demo made no sheet"
    rm -rf "$work/wheel"
}

# The demo connects to no other machine.
check_network() {
    say "network: where the demo of the wheel connects to"
    command -v strace >/dev/null || {
        skip "no strace; install it once: apt-get install -y strace"
        return
    }
    can_install_wheel || return 0
    with_wheel "$work/network"
    STRACE=$work/connects online "$work/network" /v/bin/wheelarm demo --out /data \
        --camera 160x90@2 --no-sheet >"$work/demo" || die "the demo: $(cat "$work/demo")"
    python3 tests/dist/connects.py "$work/connects"
    rm -rf "$work/network"
}

check_deb() {
    say "deb: apt install in a clean system"
    [ -f "$deb" ] || {
        skip "there is no $deb"
        return
    }
    if command -v lintian >/dev/null; then
        lintian --fail-on error --allow-root "$deb"
        echo "lintian: no error"
    else
        skip "no lintian; install it once: apt-get install -y lintian"
    fi
    system bookworm minbase || return 0
    local root=$work/deb file
    copy_of "$chroots/bookworm-minbase" "$root"
    cp "$deb" "$root/opt/wheelarm.deb"
    online "$root" sh -c 'apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --install-recommends /opt/wheelarm.deb' \
        >"$work/apt.log" 2>&1 || die "apt install: $(tail -n 5 "$work/apt.log")"
    for file in bin/wheelarm bin/wheelarm-server bin/wheelarm-worker bin/wheelarm-dataset share/man/man1/wheelarm-demo.1.gz \
        share/man/man1/wheelarm-server.1.gz share/bash-completion/completions/wheelarm \
        share/zsh/vendor-completions/_wheelarm share/fish/vendor_completions.d/wheelarm.fish \
        share/wheelarm/assets/scenes/home.toml share/doc/wheelarm/copyright; do
        grep -qx "/usr/$file" <(offline "$root" dpkg -L wheelarm) || die "the package lacks /usr/$file"
    done
    offline "$root" bash -c '. /usr/share/bash-completion/completions/wheelarm && complete -p wheelarm'
    offline "$root" wheelarm --version
    offline "$root" wheelarm-server --list-adapters
    offline "$root" wheelarm collect assets/campaigns/small.toml --dry-run | tail -n 3
    offline "$root" wheelarm demo --out /data --camera 160x90@2 | tail -n 4
    online "$root" sh -c 'apt-get purge -y -qq wheelarm' >"$work/apt.log" 2>&1 || die "apt purge: $(tail -n 5 "$work/apt.log")"
    if find "$root/usr" -name 'wheelarm*' | grep .; then
        die "the removed package left these"
    fi
    echo "purge leaves nothing"
    rm -rf "$root"
}

source tests/dist/containers.sh

all=(symbols bits wheel network deb image apptainer)
checks=("$@")
[ ${#checks[@]} -gt 0 ] || checks=("${all[@]}")
for check in "${checks[@]}"; do
    [[ " ${all[*]} " == *" $check "* ]] || die "there is no check $check; checks are: ${all[*]}"
done
[ -f "$dist/$name.tar.gz" ] || die "there is no $dist/$name.tar.gz; run: make dist"
(cd "$dist" && sha256sum --quiet --check SHA256SUMS)
tar -C "$work" -xzf "$dist/$name.tar.gz"
for check in "${checks[@]}"; do
    if [ "$check" != symbols ] && ! can_make_systems; then
        continue
    fi
    "check_$check"
done
