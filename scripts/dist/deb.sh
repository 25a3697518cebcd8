#!/usr/bin/env bash
# Makes the Debian package of a staged prefix.
#   scripts/dist/deb.sh STAGE VERSION OUT
# The folders bin and share of STAGE go to /usr. Times are SOURCE_DATE_EPOCH.
# DEB_MAINTAINER names who answers for the package.
set -euo pipefail
stage=$1 version=$2 out=$3
maintainer=${DEB_MAINTAINER:-The WheelArm authors <wheelarm@wheelarm.invalid>}
package=$out/wheelarm_$version-1_amd64.deb
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
umask 022
echo "== $(basename "$package")"

mkdir -p "$root"/{DEBIAN,usr}
cp -a "$stage/bin" "$stage/share" "$root/usr/"
doc=$root/usr/share/doc/wheelarm
# Debian's places and names.
mv "$root/usr/share/zsh/site-functions" "$root/usr/share/zsh/vendor-completions"
gzip -9n <"$doc/CHANGELOG.md" >"$doc/changelog.gz"
gzip -9n "$doc/THIRD_PARTY.txt"
rm "$doc/CHANGELOG.md" "$doc/LICENSE"
cat >"$doc/copyright" <<COPYRIGHT
Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/
Upstream-Name: wheelarm

Files: *
Copyright: $(date -u -d "@$SOURCE_DATE_EPOCH" +%Y) The WheelArm authors
License: Apache-2.0
Comment: The programs contain crates and C libraries of others; which, and under
 which licences, is in THIRD_PARTY.txt.gz beside this file.

License: Apache-2.0
 On Debian systems the full text of the Apache License, version 2.0, is in
 /usr/share/common-licenses/Apache-2.0.
COPYRIGHT
gzip -9n >"$doc/changelog.Debian.gz" <<CHANGES
wheelarm ($version-1) unstable; urgency=medium

  * Version $version, as changelog.gz tells.

 -- $maintainer  $(date -uR -d "@$SOURCE_DATE_EPOCH")
CHANGES
# Linked by Zig, not by Debian's compiler; strip and the rest are in order.
mkdir -p "$root/usr/share/lintian/overrides"
cat >"$root/usr/share/lintian/overrides/wheelarm" <<'OVERRIDES'
# HDF5, libdeflate and zlib are inside on purpose: one set of programs for every system.
wheelarm: embedded-library *
# An unofficial package: no bug requested it.
wheelarm: initial-upload-closes-no-bugs *
OVERRIDES

# glibc is what the programs ask for, as scripts/dist/symbols.sh holds them to.
cat >"$root/DEBIAN/control" <<CONTROL
Package: wheelarm
Version: $version-1
Architecture: amd64
Maintainer: $maintainer
Installed-Size: $(du -ks --exclude=DEBIAN "$root" | cut -f1)
Depends: libc6 (>= 2.28)
Recommends: libvulkan1, mesa-vulkan-drivers
Suggests: ffmpeg
Section: science
Priority: optional
Homepage: https://arxiv.org/abs/2601.21129
Description: simulator of a power wheelchair with a robotic arm
 A headless server simulates a WHILL Model CR2 wheelchair with a Kinova Gen3 arm
 and a Robotiq 2F-85 gripper in a furnished home; clients drive it, record
 episodes to HDF5, replay them bit for bit and export data sets. Without a GPU,
 Mesa's driver for processors draws the cameras.
CONTROL
(cd "$root" && find usr -type f -print0 | sort -z | xargs -0 md5sum) >"$root/DEBIAN/md5sums"
find "$root" -exec touch -h -d "@$SOURCE_DATE_EPOCH" {} +
dpkg-deb --root-owner-group -Zxz --build "$root" "$package" >/dev/null
