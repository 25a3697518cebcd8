# Clean Debian systems in folders, for tests/dist.sh, which sources this.
#
# mmdebstrap makes a system once below $chroots; checks run in copies. Commands there have their
# own processes and mounts and, with `offline`, a network with loopback only.

can_make_systems() {
    if [ "$(id -u)" != 0 ]; then
        skip "$check; other systems need root, for example in a container"
        return 1
    fi
    if ! command -v mmdebstrap >/dev/null; then
        skip "$check; no mmdebstrap: apt-get install -y mmdebstrap"
        return 1
    fi
}

# system SUITE KIND [PACKAGES]: makes $chroots/SUITE-KIND unless it exists.
system() {
    local folder=$chroots/$1-$2
    [ ! -d "$folder" ] || return 0
    echo "making $folder"
    rm -rf "$folder.part"
    # The release files of archived suites have expired.
    if ! mmdebstrap --quiet --variant=minbase --aptopt='Acquire::Check-Valid-Until "false"' \
        ${3:+--include="$3"} "$1" "$folder.part" ${MIRROR:+"$MIRROR"} >"$work/mmdebstrap.log" 2>&1; then
        rm -rf "$folder.part"
        skip "$1; mmdebstrap: $(tail -n 1 "$work/mmdebstrap.log")"
        return 1
    fi
    mv "$folder.part" "$folder"
}

copy_of() { cp -a --reflink=auto "$1" "$2"; }

glibc_of() { chroot "$1" ldd --version | sed -n '1s/.* //p'; }

# offline ROOT COMMAND...: runs a command in a system, as root, in /.
offline() { inside --net "$@"; }

# online ROOT COMMAND...: the same with this machine's network. With STRACE=FILE
# the addresses of its connections are written there.
online() { inside "" "$@"; }

inside() {
    local net=$1 root=$2
    shift 2
    if [ -z "$net" ]; then
        cp -L /etc/resolv.conf /etc/hosts "$root/etc/"
    fi
    # shellcheck disable=SC2016
    unshare --mount --pid --fork --kill-child $net \
        sh -euc '
            root=$1 net=$2 strace=$3
            shift 3
            mount -t proc proc "$root/proc"
            mount --rbind /dev "$root/dev"
            mount -t tmpfs -o mode=1777 tmpfs "$root/dev/shm"
            [ -z "$net" ] || ip link set lo up
            set -- chroot "$root" /usr/bin/env -i HOME=/root LC_ALL=C.UTF-8 \
                PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin "$@"
            if [ -n "$strace" ]; then
                exec strace -f --seccomp-bpf -qq -e trace=connect,sendto,sendmsg -e signal=none -o "$strace" "$@"
            fi
            exec "$@"
        ' inside "$root" "$net" "${STRACE:-}" "$@"
}
