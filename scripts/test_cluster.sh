#!/usr/bin/env bash
# Shards by Slurm and by Snakemake, for real, on this machine: Slurm's daemons on one node, an array of jobs of which one is
# killed and requeued, Snakemake local and through its Slurm plugin; each must leave the bytes of a run that was not divided.
#
# Root on Debian 12 (it writes /etc/slurm/slurm.conf and starts munged, slurmctld and slurmd), with
#     apt-get install slurmctld slurmd slurm-client munge
#     python3 -m venv DIR && DIR/bin/pip install snakemake snakemake-executor-plugin-slurm
# and SNAKEMAKE=DIR/bin/snakemake. Status 77 where something of that is missing.
set -euo pipefail
cd "$(dirname "$0")/.."
repository=$PWD
track=${TRACK:-$repository/target/debug/track}
snakemake=${SNAKEMAKE:-snakemake}

skip() { echo "skipped: $*"; exit 77; }
[[ $(id -u) -eq 0 ]] || skip "needs root"
for tool in slurmctld slurmd sbatch munged; do
    command -v "$tool" > /dev/null || skip "no $tool: apt-get install slurmctld slurmd slurm-client munge"
done
command -v "$snakemake" > /dev/null || skip "no snakemake: set SNAKEMAKE to that of a virtual environment"
if [[ -e /etc/slurm/slurm.conf ]] && ! grep -q '^ClusterName=track-test$' /etc/slurm/slurm.conf; then
    skip "this machine has a Slurm of its own (/etc/slurm/slurm.conf)"
fi

work=$(mktemp -d)
daemons=()
clean() {
    for daemon in "${daemons[@]}"; do kill "$daemon" 2> /dev/null || true; done
    wait 2> /dev/null || true
    rm -rf "$work"
}
trap clean EXIT

host=$(hostname -s)
mkdir -p "$work/state" "$work/spool" /etc/slurm
cat > /etc/slurm/slurm.conf << CONF
ClusterName=track-test
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
ReturnToService=2
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) RealMemory=$(free -m | awk '/^Mem:/ {print $2}') State=UNKNOWN
PartitionName=all Nodes=$host Default=YES State=UP
CONF
install -d -o munge /run/munge
if [[ ! -S /run/munge/munge.socket.2 ]]; then
    runuser -u munge -- munged --foreground & daemons+=($!)
fi
sleep 1
slurmctld -D > "$work/slurmctld.log" 2>&1 & daemons+=($!)
slurmd -D > "$work/slurmd.log" 2>&1 & daemons+=($!)
for _ in $(seq 60); do
    [[ $(sinfo -h -o %T 2> /dev/null) == idle ]] && break
    sleep 0.5
done
[[ $(sinfo -h -o %T) == idle ]] || { cat "$work"/slurm*.log; exit 1; }

# Nine small recordings.
mkdir "$work/recordings"
for i in 1 2 3 4 5 6 7 8 9; do
    cat > "$work/recordings/clip$i.scene.json" << SCENE
{"schema": "track.scene/1", "seed": $i,
 "ball": {"radius_m": 0.02, "mass_kg": 0.2, "inertia_factor": 0.4},
 "contact": {"model": "mu_e", "restitution": 0.78, "friction": 0.07},
 "launch": {"drop_height_m": 0.1$i, "speed_m_s": 1.0},
 "camera": {"image_size_px": [256, 160], "frame_rate_hz": 120, "exposure_s": 0.0005,
            "metres_per_pixel": 0.0025, "origin_px": [20, 145], "noise_grey": 2},
 "stop": {"bounces": 1, "tail_s": 0.12}}
SCENE
    "$track" simulate "$work/recordings/clip$i.scene.json" --out "$work/recordings" > /dev/null 2>&1
done
cd "$work"
"$track" batch recordings --out whole > /dev/null 2>&1

same() {
    diff -r --exclude shards whole "$1"
    echo "$1: the bytes of a run that was not divided ($SECONDS s since the start)"
}
# Waits until no job is left.
drain() {
    for _ in $(seq 480); do
        [[ -z $(squeue -h) ]] && return
        # Slurm holds a requeued job back for two minutes; a test need not wait.
        for job in $(squeue -h -t PENDING -o '%i %r' | awk '$2 == "BeginTime" {print $1}'); do
            scontrol update JobId="$job" StartTime=now 2> /dev/null || true
        done
        sleep 0.5
    done
    echo "jobs do not end:"; squeue; exit 1
}

export TRACK=$track
id=$(sbatch --parsable --array=1-3 --output "$work/array-%a.log" "$repository/cluster/track.sbatch" recordings array)
# The first that runs is killed and requeued.
for _ in $(seq 100); do
    [[ $(squeue -h -j "${id}_1" -o %T) == RUNNING ]] && break
    sleep 0.1
done
scontrol requeue "${id}_1"
echo "requeued ${id}_1"
drain
"$track" batch --merge --out array > /dev/null 2>&1 || { cat array-*.log; "$track" batch --merge --out array; }
same array

"$snakemake" --quiet --snakefile "$repository/workflow/Snakefile" --cores 2 \
    --config recordings=recordings out=local shards=3 track="$track" > local.log 2>&1 || { cat local.log; exit 1; }
same local

# Through Slurm.
timeout -s KILL 240 "$snakemake" --snakefile "$repository/workflow/Snakefile" \
    --profile "$repository/workflow/profiles/slurm" --latency-wait 5 \
    --config recordings=recordings out=plugin shards=2 track="$track" > plugin.log 2>&1 || { cat plugin.log; exit 1; }
same plugin
echo "all passed in $SECONDS s"
