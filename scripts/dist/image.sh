#!/usr/bin/env bash
# Makes the container image of the Debian package, and the recipe of an Apptainer
# image of it.
#   scripts/dist/image.sh DEB VERSION OUT
# Debian bookworm with a Vulkan loader, Mesa's drivers and what NVIDIA's driver
# wants from the image. Needs root (or a user namespace with the usual ids),
# mmdebstrap and buildah; where they are missing it says so and makes the recipe
# alone. MIRROR names another Debian mirror.
set -euo pipefail
deb=$1 version=$2 out=$3
archive=$out/wheelarm-$version-x86_64.oci.tar
cd "$(dirname "$0")"
umask 022

sed "s/@VERSION@/$version/g" apptainer.def.in >"$out/wheelarm-$version.def"

[ -f "$deb" ] || {
    echo "error: $deb is missing; run: scripts/dist.sh deb image" >&2
    exit 1
}
missing=
for program in mmdebstrap buildah; do
    command -v $program >/dev/null || missing+=" $program"
done
if [ -n "$missing" ]; then
    echo "skipped: the image; install it once: apt-get install -y$missing"
    exit 0
fi
echo "== $(basename "$archive")"
work=$(mktemp -d "${TMPDIR:-/tmp}/wheelarm-image-XXXXXX")
export STORAGE_DRIVER=vfs BUILDAH_ISOLATION=chroot
buildah() { command buildah --root "$work/root" --runroot "$work/run" "$@"; }
finish() {
    buildah rm --all >/dev/null 2>&1 || true
    buildah rmi --all --force >/dev/null 2>&1 || true
    rm -rf "$work"
}
trap finish EXIT

# libgl and libegl's neighbours: NVIDIA's libraries, which the container's runtime
# brings, name them (nvidia-container-toolkit, issues 16 and 1952).
mmdebstrap --quiet --variant=minbase \
    --include=libvulkan1,mesa-vulkan-drivers,libegl1,libxext6,ffmpeg,ca-certificates \
    --dpkgopt='path-exclude=/usr/share/doc/*' --dpkgopt='path-include=/usr/share/doc/*/copyright' \
    --dpkgopt='path-include=/usr/share/doc/wheelarm/*' \
    --dpkgopt='path-exclude=/usr/share/locale/*' --dpkgopt='path-exclude=/usr/share/man/*' \
    --customize-hook="copy-in '$deb' /tmp" \
    --customize-hook="chroot \"\$1\" sh -c 'dpkg -i /tmp/*.deb && rm /tmp/*.deb'" \
    --customize-hook='chroot "$1" useradd --uid 1000 --user-group --create-home wheelarm' \
    --customize-hook='mkdir -p "$1/data" && chmod 1777 "$1/data"' \
    --customize-hook="mkdir -p \"\$1/usr/share/vulkan/icd.d\" && cat nvidia_icd.json >\"\$1/usr/share/vulkan/icd.d/nvidia_icd.json\"" \
    --customize-hook='rm -rf "$1"/var/lib/apt/lists/* "$1"/var/cache/* "$1"/var/log/* "$1"/etc/hostname "$1"/etc/resolv.conf' \
    bookworm "$work/rootfs.tar" ${MIRROR:+"$MIRROR"}
# The container's runtime brings /dev; nodes of it cannot be unpacked everywhere.
tar --delete --wildcards --file "$work/rootfs.tar" './dev/*' 2>/dev/null || true

container=$(buildah from scratch)
buildah add "$container" "$work/rootfs.tar" / >/dev/null
rm "$work/rootfs.tar"
label=org.opencontainers.image
buildah config \
    --cmd '["wheelarm", "--help"]' --user 1000:1000 --workingdir /data --port 7447 \
    --env PATH=/usr/local/bin:/usr/bin:/bin --env HOME=/tmp \
    --env NVIDIA_VISIBLE_DEVICES=all --env NVIDIA_DRIVER_CAPABILITIES=graphics,compute,utility \
    --label $label.title=wheelarm --label "$label.version=$version" --label $label.licenses=Apache-2.0 \
    --label "$label.revision=${WHEELARM_COMMIT:-}" \
    "$container"
buildah commit --quiet --rm --timestamp "$SOURCE_DATE_EPOCH" "$container" "wheelarm:$version" >/dev/null
rm -f "$archive"
buildah push --quiet "wheelarm:$version" "oci-archive:$archive:wheelarm:$version"
