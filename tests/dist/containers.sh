# The image in buildah and in Apptainer, for tests/dist.sh, which sources this file: one small
# campaign on this machine and the same in a container, as an ordinary user, with one shard
# killed. The data must be equal.

plan=$PWD/tests/dist/plan.toml

# The campaign with the programs of the archive, once.
native_campaign() {
    [ ! -d "$work/native" ] || return 0
    "$work/$name/bin/wheelarm" collect "$plan" --out "$work/native" --workers 1 --patience 600 >"$work/native.log" 2>&1 ||
        die "the campaign on this machine: $(tail -n 5 "$work/native.log")"
}

# Waits for the first finished episode below a folder, or the end of a process.
first_episode() { # FOLDER PID LOG
    until compgen -G "$1/episodes/*.h5" >/dev/null; do
        kill -0 "$2" 2>/dev/null || die "it ended before its first episode: $(tail -n 5 "$3")"
        sleep 0.2
    done
}

# Waits until the killed processes are gone: the kernel needs a moment for all of a namespace,
# and the shard is locked until then.
gone() { # WORDS OF ITS COMMAND LINE
    while pgrep -f "$1" >/dev/null; do sleep 0.1; done
}

same_data() {
    .venv/bin/python tests/dist/same_data.py "$work/native" "$1"
}

check_image() {
    say "image: a campaign by buildah, as user 1000"
    [ -f "$oci" ] || {
        skip "there is no $oci"
        return
    }
    command -v buildah >/dev/null || {
        skip "no buildah; install it once: apt-get install -y buildah"
        return
    }
    native_campaign
    local container killed data=$work/data log=$work/image.log store=(--root "$work/store" --runroot "$work/storerun")
    export STORAGE_DRIVER=vfs BUILDAH_ISOLATION=chroot
    container=$(buildah "${store[@]}" from "oci-archive:$oci")
    mkdir "$data"
    chown 1000:1000 "$data"
    cp "$plan" "$data/plan.toml"
    # A separate PID namespace, so that a kill ends all of its processes at once.
    in_image() {
        unshare --pid --fork --kill-child --mount-proc \
            buildah "${store[@]}" run --volume "$data:/data" "$container" -- "$@"
    }
    in_image sh -euc 'test "$(id -u)" = 1000
        if touch /usr/x 2>/dev/null; then echo "/usr can be written"; exit 1; fi
        wheelarm --version
        wheelarm-server --list-adapters'
    in_image wheelarm collect plan.toml --out campaign --workers 1 --patience 600 --shard 0/2 >"$log" 2>&1 &
    killed=$!
    first_episode "$data/campaign" $killed "$log"
    kill -KILL $killed
    wait $killed 2>/dev/null || true
    gone 'collect plan.toml --out campaign --workers 1'
    echo "killed after $(find "$data/campaign/episodes" -name '*.h5' | wc -l) episode(s)"
    for shard in 0 1; do
        in_image wheelarm collect plan.toml --out campaign --workers 1 --patience 600 --shard $shard/2 >"$log" 2>&1 ||
            die "shard $shard: $(tail -n 5 "$log")"
    done
    in_image wheelarm collect --merge campaign | tail -n 1
    same_data "$data/campaign"
    buildah "${store[@]}" rm --all >/dev/null
}

# Runs a command in a system with its own `/`, as its user u. A chroot is not sufficient for
# Apptainer, which makes namespaces and mounts.
as_user() { # ROOT COMMAND
    unshare --mount --pid --fork --kill-child sh -euc '
        mount --bind "$1" "$1"
        cd "$1"
        mkdir -p old
        pivot_root . old
        mount -t proc proc /proc
        mount --rbind old/dev /dev
        mount -t tmpfs -o mode=1777 tmpfs /tmp
        umount -l old
        : >/etc/hosts
        : >/etc/resolv.conf
        exec env -i PATH=/usr/local/bin:/usr/bin:/bin su u -c "export APPTAINER_TMPDIR=\$HOME; cd; $2"
    ' as_user "$1" "$2"
}

check_apptainer() {
    say "apptainer: a campaign by the job script of Slurm, as a user, in the image"
    [ -f "$oci" ] || {
        skip "there is no $oci"
        return
    }
    case $(stat -c %A /dev/fuse 2>/dev/null) in
    *rw?) ;;
    *)
        skip "/dev/fuse is closed to users, which Apptainer mounts images by: chmod 666 /dev/fuse"
        return
        ;;
    esac
    system sid apptainer apptainer,squashfuse,procps || return 0
    native_campaign
    local root=$work/sid killed log=$work/apptainer.log data
    copy_of "$chroots/sid-apptainer" "$root"
    mkdir -p "$root/release" "$root/scratch"
    cp "$oci" "$dist/wheelarm-$version.def" "$root/release/"
    cp "$plan" "$root/scratch/plan.toml"
    cp "$work/$name/share/wheelarm/cluster/slurm.sbatch" "$root/scratch/"
    chroot "$root" useradd --uid 1000 --user-group --create-home u
    # Slurm runs in `make test-cluster`; here a substitute logs its arguments.
    printf '#!/bin/sh\necho "$@" >>/scratch/requeued\n' >"$root/usr/local/bin/scontrol"
    chmod 755 "$root/usr/local/bin/scontrol"
    chown -R 1000:1000 "$root/scratch"
    as_user "$root" 'cd /release && apptainer build ~/wheelarm.sif *.def' >"$log" 2>&1 ||
        die "apptainer build: $(tail -n 5 "$log")"
    echo "$(chroot "$root" apptainer --version): wheelarm.sif of $(du -m "$root/home/u/wheelarm.sif" | cut -f1) MB"
    as_user "$root" 'apptainer --quiet exec wheelarm.sif sh -euc "
        test \$(id -u) = 1000
        if touch /usr/x 2>/dev/null || touch /data/x 2>/dev/null; then echo written; exit 1; fi
        wheelarm-server --list-adapters"'
    local job='SLURM_JOB_ID=1 SLURM_ARRAY_TASK_COUNT=2 SLURM_CPUS_PER_TASK=1 WHEELARM_IMAGE=$HOME/wheelarm.sif'
    data=$root/scratch/campaign
    # Shard 0 is killed with SIGKILL, shard 1 runs out of time during its first episode; then both
    # have enough time.
    as_user "$root" "$job SLURM_ARRAY_TASK_ID=0 bash /scratch/slurm.sbatch /scratch/plan.toml /scratch/campaign" >"$log" 2>&1 &
    killed=$!
    first_episode "$data" $killed "$log"
    kill -KILL $killed
    wait $killed 2>/dev/null || true
    gone '/scratch/plan.toml'
    echo "killed after $(find "$data/episodes" -name '*.h5' | wc -l) episode(s)"
    as_user "$root" "$job SLURM_ARRAY_TASK_ID=1 bash /scratch/slurm.sbatch /scratch/plan.toml /scratch/campaign &
        until pgrep -x wheelarm-worker >/dev/null; do kill -0 \$! || exit 1; sleep 0.2; done
        kill -USR1 \$!; wait \$!" >"$log" 2>&1 || true
    grep -qx 'requeue 1' "$root/scratch/requeued" || die "the job did not requeue itself: $(tail -n 5 "$log")"
    echo "out of time after $(find "$data/episodes" -name '*.h5' | wc -l) episode(s), requeued"
    for shard in 0 1; do
        as_user "$root" "$job SLURM_ARRAY_TASK_ID=$shard bash /scratch/slurm.sbatch /scratch/plan.toml /scratch/campaign" >"$log" 2>&1 ||
            die "shard $shard: $(tail -n 5 "$log")"
    done
    as_user "$root" 'apptainer --quiet exec --bind /scratch wheelarm.sif wheelarm collect --merge /scratch/campaign' | tail -n 1
    same_data "$data"
    rm -rf "$root"
}
