#!/usr/bin/env bash
# Makes what is shipped, in dist/: programs that run on every Linux with glibc
# 2.28 or newer (RHEL 8, Debian 10, Ubuntu 18.10), HDF5 inside, and the packages
# made of that one set of programs.
#   scripts/dist.sh              everything
#   scripts/dist.sh PART...      of: programs archive deb wheels image crates sbom notes
# `crates` tests the publication of the contract and the client SDK on crates.io; `sbom` is a
# bill of materials; `notes` are the release notes, of CHANGELOG.md and the files.
# Names carry version and target; SHA256SUMS holds what the folder has. Times in
# the packages are SOURCE_DATE_EPOCH, which is the commit's when it is not set.
# JOBS=N limits the compiler. PROGRAMS=DIR packs the programs of that folder, which need
# libraries of this host; their wheel is tagged linux_x86_64 and is for tests only.
# VERIFY=no does not compile the published crates. Building takes 15 to 25 minutes of two cores.
set -euo pipefail
cd "$(dirname "$0")/.."

target=x86_64-unknown-linux-gnu
glibc=2.28
out=$PWD/dist
build=$PWD/target/dist-build
stage=$build/stage
venv=$PWD/.venv-dist
foreign=${PROGRAMS:-}
platform=manylinux_${glibc/./_}_x86_64
[ -z "$foreign" ] || platform=linux_x86_64
version=$(sed -n '/^\[workspace.package\]/,/^$/s/^version = "\(.*\)"/\1/p' Cargo.toml)
name=wheelarm-$version-$target
epoch=$(git log -1 --format=%ct 2>/dev/null || true)
export SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-${epoch:-0}}
WHEELARM_COMMIT=${WHEELARM_COMMIT:-$(git rev-parse --short=12 HEAD 2>/dev/null || true)}
export WHEELARM_COMMIT LC_ALL=C
umask 022

die() {
    echo "error: $*" >&2
    exit 1
}
say() { echo "== $*"; }
[ "$(uname -sm)" = "Linux x86_64" ] || die "packages are made on Linux x86_64; this is $(uname -sm)"
[ -n "$version" ] || die "Cargo.toml names no version in [workspace.package]"

# Zig is the C compiler and linker that knows every older glibc; CMake builds
# HDF5 and must be 3.26 or newer.
tools() {
    if ! "$venv/bin/python" -c 'import ziglang, hatchling, license_expression' 2>/dev/null; then
        say "tools into $venv"
        python3 -m venv "$venv"
        "$venv/bin/python" -m pip install --quiet --disable-pip-version-check \
            ziglang==0.17.1 cargo-zigbuild==0.24.0 'cmake<4' \
            'hatchling==1.*' 'license-expression==30.*'
    fi
    export PATH=$venv/bin:$PATH
}

# The three programs, for $glibc, without the paths of this machine.
programs() {
    [ -z "$foreign" ] || die "PROGRAMS names programs, so none are built; leave out the part \`programs\`"
    say "programs for $target, glibc $glibc"
    local from=("${CARGO_HOME:-$HOME/.cargo}/registry/src" "$PWD") to=(/cargo /wheelarm) rust='' c=''
    for i in "${!from[@]}"; do
        rust+=" --remap-path-prefix=${from[i]}=${to[i]}"
        c+=" -ffile-prefix-map=${from[i]}=${to[i]}"
    done
    CONFIG_SITE=$PWD/scripts/dist/config.site RUSTFLAGS=${rust# } CFLAGS_x86_64_unknown_linux_gnu=${c# } CXXFLAGS_x86_64_unknown_linux_gnu=${c# } \
        cargo zigbuild --locked --profile dist --target "$target.$glibc" --target-dir "$build" \
        ${JOBS:+-j "$JOBS"} --bins --features wheelarm-cli/static-hdf5,wheelarm-dataset/static-hdf5,wheelarm-worker/static-hdf5
}

# One prefix as it is installed: bin and share. Every package is made of it.
stage() {
    local built=${foreign:-$build/$target/dist} page
    [ -x "$built/wheelarm-server" ] || die "no program $built/wheelarm-server; run: scripts/dist.sh programs"
    rm -rf "$stage"
    mkdir -p "$stage"/{bin,share/man/man1,share/doc/wheelarm} \
        "$stage"/share/{bash-completion/completions,zsh/site-functions,fish/vendor_completions.d} \
        "$stage"/share/wheelarm/{assets,cluster,proto}
    install -m 755 "$built"/{wheelarm,wheelarm-server,wheelarm-worker,wheelarm-dataset} "$stage/bin/"
    if [ -z "$foreign" ]; then
        "$venv/bin/python" scripts/dist/neutral.py "$built"/build/hdf5-metno-src-*/out "$PWD" "$HOME" -- "$stage"/bin/*
        scripts/dist/symbols.sh "$stage"/bin/*
    else
        strip "$stage"/bin/*
    fi
    # The assets that git tracks, without other files beside them.
    git ls-files -z assets | tar -c --null -T - | tar -x -C "$stage/share/wheelarm"
    (cd proto && git ls-files -z -- '*.proto' | tar -c --null -T -) | tar -x -C "$stage/share/wheelarm/proto"
    install -m 755 client/cluster/slurm.sbatch "$stage/share/wheelarm/cluster/"
    install -m 644 client/cluster/kubernetes.yaml "$stage/share/wheelarm/cluster/"
    install -m 644 LICENSE CHANGELOG.md docs/start/install.md "$stage/share/doc/wheelarm/"
    "$venv/bin/python" scripts/dist/third_party.py --target "$target" --out "$stage/share/doc/wheelarm/THIRD_PARTY.txt"
    "$stage/bin/wheelarm" man "$stage/share/man/man1"
    "$stage/bin/wheelarm-server" --man >"$stage/share/man/man1/wheelarm-server.1"
    "$stage/bin/wheelarm-worker" --man >"$stage/share/man/man1/wheelarm-worker.1"
    for page in "$stage"/share/man/man1/*; do gzip -9n "$page"; done
    "$stage/bin/wheelarm" completions bash >"$stage/share/bash-completion/completions/wheelarm"
    "$stage/bin/wheelarm" completions zsh >"$stage/share/zsh/site-functions/_wheelarm"
    "$stage/bin/wheelarm" completions fish >"$stage/share/fish/vendor_completions.d/wheelarm.fish"
    chmod -R u=rwX,go=rX "$stage"
    find "$stage" -exec touch -h -d "@$SOURCE_DATE_EPOCH" {} +
}

archive() {
    say "$name.tar.gz"
    tar -C "$stage" --sort=name --mtime="@$SOURCE_DATE_EPOCH" --owner=0 --group=0 --numeric-owner \
        --format=gnu --transform="s,^\.,$name," -c . | gzip -9n >"$out/$name.tar.gz"
    cp "$stage/share/doc/wheelarm/THIRD_PARTY.txt" "$out/"
}

# The wheel with the programs and, of the same sources, the one without for
# macOS, Windows and other processors: pip takes the first where it fits.
wheels() {
    local package=client/python plugin stated
    if [ ! -f $package/pyproject.toml ]; then
        echo "skipped: wheels; $package/pyproject.toml is missing"
        return
    fi
    say "wheels"
    stated=$(cd $package && hatchling metadata version)
    [ "$stated" = "$version" ] || die "$package is version $stated, Cargo.toml $version; they must be the same"
    rm -f "$out"/wheelarm-*.whl
    (cd $package && hatchling build -t wheel -d "$out")
    (cd $package && WHEELARM_WHEEL_PREFIX=$stage WHEELARM_WHEEL_PLATFORM=$platform \
        hatchling build -t wheel -d "$out")
    compgen -G "$out/wheelarm-$version-*-$platform.whl" >/dev/null ||
        die "no wheel with programs was made: $package/pyproject.toml lacks the line [tool.hatch.build.targets.wheel.hooks.custom]"
    # Plugins that LeRobot finds by the beginning of their names.
    for plugin in "$package"/lerobot_*/pyproject.toml; do
        plugin=$(dirname "$plugin")
        rm -f "$out/$(basename "$plugin")"-*.whl
        (cd "$plugin" && hatchling build -t wheel -d "$out")
    done
}

# Packs the crates as crates.io receives them, and compiles the packed sources.
crates() {
    say "crates for crates.io"
    local verify=() packed=$build/crates crate
    [ "${VERIFY:-yes}" = yes ] || verify=(--no-verify)
    cargo publish --dry-run --locked --allow-dirty "${verify[@]}" --target-dir "$packed" \
        -p wheelarm-proto -p wheelarm-sdk
    for crate in wheelarm-proto wheelarm-sdk; do
        crate=$(find "$packed/package" -name "$crate-$version.crate" | head -n 1)
        [ -n "$crate" ] || die "cargo packed no crate in $packed/package"
        cp "$crate" "$out/"
    done
}

sbom() {
    say "bill of materials"
    "$venv/bin/python" scripts/dist/sbom.py --target "$target" --version "$version" --out "$out/wheelarm-$version.cdx.json"
}

notes() {
    say "release notes"
    "$venv/bin/python" scripts/dist/notes.py --version "$version" --changelog CHANGELOG.md --dist "$out"
}

all=(programs archive deb wheels image crates sbom notes)
parts=("$@")
if [ ${#parts[@]} -eq 0 ]; then
    parts=("${all[@]}")
    [ -z "$foreign" ] || parts=("${all[@]:1}")
fi
for part in "${parts[@]}"; do
    [[ " ${all[*]} " == *" $part "* ]] || die "no part named $part; available: ${all[*]}"
done
mkdir -p "$out"
tools
staged=
for part in "${parts[@]}"; do
    case $part in
    archive | deb | wheels)
        if [ -z "$staged" ]; then
            stage
            staged=yes
        fi
        ;;
    esac
    case $part in
    deb) scripts/dist/deb.sh "$stage" "$version" "$out" ;;
    image) scripts/dist/image.sh "$out/wheelarm_$version-1_amd64.deb" "$version" "$out" ;;
    *) "$part" ;;
    esac
done
cd "$out"
rm -f SHA256SUMS
if [ -n "$(ls)" ]; then
    sums=$(sha256sum -- *)
    echo "$sums" >SHA256SUMS
fi
ls -l
