#!/usr/bin/env bash
# Runs a campaign as a Slurm job array on a one-node cluster on this machine, kills and requeues
# one shard, merges, validates. `make test-cluster` builds first. Prints "skipped" and the
# reason for a step that the machine does not allow.
#   tests/cluster.sh [PLAN]        default: assets/campaigns/small.toml
set -euo pipefail
cd "$(dirname "$0")/.."
plan=$(realpath "${1:-assets/campaigns/small.toml}")
release=$PWD/target/release
export WHEELARM=${WHEELARM:-$release/wheelarm} WHEELARM_ASSETS=$PWD/assets
shards=2

skip() {
    echo "skipped: $*"
    exit 0
}

# The Kubernetes file, against the published schema of batch/v1.
if .venv/bin/python -c 'import kubernetes_validate, yaml' 2>/dev/null; then
    .venv/bin/python - <<'PYTHON'
import tomllib

import kubernetes_validate, yaml

path = "client/cluster/kubernetes.yaml"
job = yaml.safe_load(open(path))
schema = kubernetes_validate.validate(job, "1.32", strict=True)
spec = job["spec"]
variables = {v["name"]: v["value"] for v in spec["template"]["spec"]["containers"][0]["env"]}
assert spec["completions"] == int(variables["SHARDS"]), "completions and SHARDS differ"
image = spec["template"]["spec"]["containers"][0]["image"]
version = tomllib.load(open("Cargo.toml", "rb"))["workspace"]["package"]["version"]
assert image.endswith(f"/wheelarm:{version}"), f"{image} is not of version {version}"
print(f"{path}: valid against Kubernetes {schema}; not run on a cluster")
PYTHON
else
    echo "skipped: the schema check of client/cluster/kubernetes.yaml; run: scripts/setup.sh python kubernetes-validate:kubernetes_validate"
fi

# Slurm itself.
[ "$(id -u)" = 0 ] || skip "Slurm's daemons on one node need root; run it as root, for example in a container"
if ! command -v slurmctld >/dev/null || ! command -v munged >/dev/null; then
    command -v apt-get >/dev/null || skip "slurm-wlm is not installed and there is no apt-get"
    echo "installing slurm-wlm and munge"
    { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends slurm-wlm munge; } >/dev/null ||
        skip "slurm-wlm cannot be installed here"
fi

work=$(mktemp -d -t wheelarm-cluster-XXXXXX)
started=()
finish() {
    code=$?
    for pid in "${started[@]}"; do
        kill "$pid" 2>/dev/null || true
    done
    wait 2>/dev/null || true
    if [ $code -ne 0 ]; then
        echo "failed; the logs are kept in $work"
        tail -n 5 "$work"/*.log || true
    else
        rm -rf "$work"
    fi
}
trap finish EXIT
free_port() {
    python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])'
}

mkdir -p "$work"/{state,spool,munge}
chmod 711 "$work"
chmod 755 "$work"/munge
dd if=/dev/urandom of="$work/munge.key" bs=32 count=1 status=none
chmod 400 "$work/munge.key"
munged --foreground --force --key-file="$work/munge.key" --socket="$work/munge/socket" \
    --pid-file="$work/munge/pid" --log-file="$work/munged.log" --seed-file="$work/munge/seed" \
    >"$work/munged-out.log" 2>&1 &
started+=($!)

node=$(hostname -s)
cores=$(nproc)
cat >"$work/slurm.conf" <<CONF
ClusterName=wheelarm
SlurmctldHost=$node(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$work/munge/socket
CredType=cred/munge
SlurmctldPort=$(free_port)
SlurmdPort=$(free_port)
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/slurmd.log
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerType=sched/builtin
MpiDefault=none
KillWait=5
ReturnToService=2
NodeName=$node NodeAddr=127.0.0.1 CPUs=$((cores < shards ? shards : cores)) State=UNKNOWN
PartitionName=main Nodes=$node Default=YES MaxTime=INFINITE State=UP
SlurmdParameters=config_overrides
CONF
# No plugin above uses cgroups; this one needs no privileges.
printf "CgroupPlugin=cgroup/v1\nCgroupMountpoint=%s/cgroup\n" "$work" >"$work/cgroup.conf"
export SLURM_CONF=$work/slurm.conf

until [ -S "$work/munge/socket" ]; do
    kill -0 "${started[0]}" 2>/dev/null || skip "munged does not run here: $(tail -n 1 "$work/munged-out.log")"
    sleep 0.1
done
slurmctld -D -i >"$work/slurmctld-out.log" 2>&1 &
started+=($!)
slurmd -D -N "$node" >"$work/slurmd-out.log" 2>&1 &
started+=($!)
for _ in $(seq 100); do
    sinfo -h -o %t 2>/dev/null | grep -q idle && break
    for pid in "${started[@]}"; do
        kill -0 "$pid" 2>/dev/null || skip "a daemon of Slurm does not run here: $(tail -qn 2 "$work"/slurm*-out.log "$work"/slurm*.log | tr '\n' ' ')"
    done
    sleep 0.3
done
[ "$(sinfo -h -o %t)" = idle ] || skip "the node does not come up: $(sinfo -h -R) $(tail -n 2 "$work/slurmd.log")"
echo "one-node cluster: $(sinfo --version), $(sinfo -h -o '%n, %c CPUs')"

out=$work/set
cd "$work"
job=$(sbatch --parsable --array=0-$((shards - 1)) --cpus-per-task=1 --mem=0 --time=60 \
    --signal=B:USR1@60 "$OLDPWD/client/cluster/slurm.sbatch" "$plan" "$out")
cd "$OLDPWD"
echo "job array $job"
limit=$((SECONDS + ${WHEELARM_PATIENCE:-3000}))
patient() { [ $SECONDS -lt $limit ] || { echo "too slow: $*"; squeue; exit 1; }; }
lines() { cat "$out"/journal/*.jsonl 2>/dev/null | grep -c '"kind":"done"' || true; }

# Kill one shard with SIGKILL during its second episode or later.
victim=$((shards - 1))
journal=$out/journal/shard-$victim-of-$shards.jsonl
until grep -q '"kind":"done"' "$journal" 2>/dev/null && compgen -G "$out/staging/*/operator.log" >/dev/null; do
    patient "the first episode of shard $victim"
    sleep 0.2
done
pid=$(pgrep -f -- "--out $out --shard $victim/$shards" | head -1)
before=$(sha256sum "$out"/episodes/*.h5)
kill -KILL "$pid"
echo "killed shard $victim with $(lines) episodes done; requeued"
sleep 1
scontrol requeue "${job}_$victim"
# Slurm lets a requeued job wait two minutes.
sleep 2
scontrol update JobId="${job}_$victim" StartTime=now 2>/dev/null || true

while squeue -h -j "$job" 2>/dev/null | grep -q .; do
    patient "the end of the array"
    sleep 1
done
echo "the array has ended with $(lines) episodes"
sha256sum --quiet --check <<<"$before"

# Merge with a check of every file; then read each with the dataset's reader.
"$WHEELARM" collect --merge "$out"
twice=$(cat "$out"/journal/*.jsonl | grep '"kind":"done"' | grep -o '"episode":"[^"]*"' | sort | uniq -d)
[ -z "$twice" ] || { echo "done twice: $twice"; exit 1; }
for file in "$out"/episodes/*.h5; do
    "$WHEELARM" dataset info "$file" >/dev/null || { echo "$file is not complete"; exit 1; }
done
[ -z "$(ls "$out/staging")" ] || { echo "half-made episodes are left: $(ls "$out/staging")"; exit 1; }
echo "the Slurm test passed: $(find "$out"/episodes -name '*.h5' | wc -l) episodes, complete"
