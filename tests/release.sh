#!/usr/bin/env bash
# Installs the files of `make release` on this host as docs/start/install.md says: from a local
# package index (PEP 503) with `pip install wheelarm`, from files, from the archive. Also checks
# sums, crates, bill of materials and notes. Clean systems are in tests/dist.sh.
#   tests/release.sh             the files in dist/
#   DIST=DIR tests/release.sh    those of another folder
# Needs PyPI for the packages that the wheels depend on.
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD
dist=$(realpath "${DIST:-dist}")
version=$(sed -n '/^\[workspace.package\]/,/^$/s/^version = "\(.*\)"/\1/p' Cargo.toml)
work=$(mktemp -d "${TMPDIR:-/tmp}/wheelarm-release-XXXXXX")
server=
finish() {
    code=$?
    [ -z "$server" ] || kill "$server" 2>/dev/null || true
    [ $code -eq 0 ] || echo "failed"
    rm -rf "$work"
}
trap finish EXIT
say() { echo "== $*"; }
die() {
    echo "error: $*" >&2
    exit 1
}
for variable in $(compgen -e | grep '^WHEELARM_' || true); do
    unset "$variable"
done
unset PYTHONPATH
export PIP_DISABLE_PIP_VERSION_CHECK=1

say "checksums"
[ -f "$dist/SHA256SUMS" ] || die "no $dist/SHA256SUMS; run: make release"
(cd "$dist" && sha256sum --quiet --check SHA256SUMS)
for file in "$dist"/*; do
    grep -q " $(basename "$file")\$" "$dist/SHA256SUMS" || [ "$(basename "$file")" = SHA256SUMS ] ||
        die "SHA256SUMS lacks $(basename "$file")"
done

say "index: pip install wheelarm"
python3 tests/dist/simple_index.py "$dist" "$work/index"
python3 -u -m http.server --bind 127.0.0.1 --directory "$work/index" 0 >"$work/http.log" 2>&1 &
server=$!
for _ in $(seq 100); do
    port=$(sed -n 's/.* port \([0-9]*\) .*/\1/p' "$work/http.log")
    [ -z "$port" ] || break
    sleep 0.1
done
[ -n "$port" ] || die "the index did not start: $(cat "$work/http.log")"
# The command stays as in the guide: `pip install wheelarm` finds our packages in this index only.
export PIP_INDEX_URL=http://127.0.0.1:$port/simple/ PIP_EXTRA_INDEX_URL=https://pypi.org/simple/
from_index() { # folder, command line that the guides contain
    local folder=$1
    shift
    grep -rqF -- "pip install $*" docs || die "no guide contains: pip install $*"
    python3 -m venv "$folder"
    (
        # shellcheck source=/dev/null
        source "$folder/bin/activate"
        eval "pip install --quiet $*"
    )
}
from_index "$work/plain" wheelarm
case $("$work/plain/bin/wheelarm" --version) in
"wheelarm $version "*) ;;
*) die "the installed program is $("$work/plain/bin/wheelarm" --version), not $version" ;;
esac
"$work/plain/bin/wheelarm" demo --camera 160x90@2 --out "$work/demo" | tee "$work/demo.log"
[ -s "$work/demo/pick_mustard-seed0.png" ] || die "the demo made no sheet"
from_index "$work/gym" "'wheelarm[gym]'"
(cd "$work" && "$work/gym/bin/python" -c '
import gymnasium

env = gymnasium.make("wheelarm:wheelarm/PickMustard-v0", obs_mode="state", control_mode="ee_delta")
observation, _ = env.reset(seed=0)
env.step(env.action_space.sample())
env.close()
print("gym:", len(observation["agent_pos"]), "numbers")
')
for plugin in env robot teleoperator; do
    "$work/gym/bin/pip" install --quiet --no-deps "lerobot_${plugin}_wheelarm"
done
"$work/gym/bin/pip" list 2>/dev/null | grep -E '^(wheelarm|lerobot_)'
"$work/gym/bin/pip" download --quiet --no-deps --dest "$work/mac" --only-binary=:all: \
    --platform macosx_11_0_arm64 wheelarm
[ -f "$work/mac/wheelarm-$version-py3-none-any.whl" ] || die "macOS does not get the pure wheel: $(ls "$work/mac")"

say "file: the commands of install.md"
# The block below `## With pip`, run in the folder of the files.
python3 tests/dist/guide_block.py docs/start/install.md "## With pip" >"$work/with-pip.sh"
mkdir "$work/files"
for file in "$dist"/*; do
    ln -s "$file" "$work/files/"
done
if ls "$dist"/wheelarm-*-linux_x86_64.whl >/dev/null 2>&1; then
    # Programs of this host in place of those for every Linux.
    sed -i 's/manylinux_2_28_x86_64/linux_x86_64/' "$work/with-pip.sh"
fi
# The demo ran above; here the size of its images is enough.
sed -i 's/wheelarm demo$/wheelarm demo --camera 160x90@2 --no-sheet/' "$work/with-pip.sh"
(cd "$work/files" && bash -euxo pipefail "$work/with-pip.sh") >"$work/with-pip.log" 2>&1 ||
    die "the commands of the guide: $(tail -n 5 "$work/with-pip.log")"
tail -n 3 "$work/with-pip.log"

say "archive"
tar -C "$work" -xzf "$dist/wheelarm-$version-x86_64-unknown-linux-gnu.tar.gz"
prefix=$work/wheelarm-$version-x86_64-unknown-linux-gnu
(cd / && "$prefix/bin/wheelarm" tasks >"$work/tasks" 2>/dev/null)
grep -q pick_mustard "$work/tasks" || die "the archive does not find its assets"
for file in man/man1/wheelarm-demo.1.gz bash-completion/completions/wheelarm doc/wheelarm/THIRD_PARTY.txt; do
    [ -s "$prefix/share/$file" ] || die "the archive lacks share/$file"
done

say "Debian package"
if command -v dpkg-deb >/dev/null; then
    dpkg-deb -x "$dist/wheelarm_$version-1_amd64.deb" "$work/deb"
    (cd / && "$work/deb/usr/bin/wheelarm" tasks 2>/dev/null) | cmp - "$work/tasks" ||
        die "the Debian package lists other tasks than the archive"
    echo "unpacked and run; sudo make test-dist installs it in a clean system"
else
    echo "skipped: the Debian package; this host has no dpkg-deb"
fi

say "image"
if [ -f "$dist/wheelarm-$version-x86_64.oci.tar" ]; then
    tar -tf "$dist/wheelarm-$version-x86_64.oci.tar" | grep -qx './index.json\|index.json' || die "the image has no index.json"
    echo "present; sudo make test-dist runs it"
else
    echo "skipped: the image was not made on this host (mmdebstrap, buildah)"
fi

say "crates"
for crate in proto sdk; do
    tar -tzf "$dist/wheelarm-$crate-$version.crate" "wheelarm-$crate-$version/Cargo.toml" "wheelarm-$crate-$version/src/lib.rs"
done

say "bill of materials and notes"
python3 -m venv "$work/sbom"
PIP_INDEX_URL=https://pypi.org/simple/ "$work/sbom/bin/pip" install --quiet 'cyclonedx-python-lib[json-validation]==11.*'
"$work/sbom/bin/python" tests/dist/check_sbom.py "$dist/wheelarm-$version.cdx.json" Cargo.lock
for file in "$dist"/*.whl "$dist"/*.deb "$dist"/*.tar.gz "$dist"/*.crate; do
    grep -qF "$(basename "$file")" "$dist/RELEASE_NOTES.md" || die "the notes lack $(basename "$file")"
done
grep -q "^# WheelArm $version\$" "$dist/RELEASE_NOTES.md" || die "the notes are not of $version"
cd "$root"
echo "all installed as the guides say"
