#!/usr/bin/env bash
# Runs scripts/cluster under a real Slurm, two nodes of one core on this machine, with a field in two blocks, and kills a part
# of a film while it renders.
#
#   slurm_loopback.sh REGRADE [PHOTOS]
#
# PHOTOS: what `regrade run` takes; a small synthetic street without it. As root, with Debian's slurm-wlm, munge and snakemake.
# Exit status: 0 if both styles have film and report, the killed job was tried again, and the film has the bytes of one that
# `regrade render` makes alone; 77 without Slurm.
set -euo pipefail

if [[ $# -lt 1 || $1 == --help ]]; then
  sed -n '2,9s/^# \{0,1\}//p' "${BASH_SOURCE[0]}"
  exit 0
fi
regrade=$(realpath "$1")
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
command -v slurmctld >/dev/null && command -v munged >/dev/null && command -v snakemake >/dev/null || exit 77
work=$(mktemp -d)
trap 'kill $(cat "$work"/slurm/*.pid) 2>/dev/null; sleep 1; rm -rf "$work"' EXIT

host=$(hostname)
mkdir -p "$work"/slurm/state /run/munge
[[ -s /etc/munge/munge.key ]] || mungekey --create
chown munge: /run/munge
pgrep -x munged >/dev/null || runuser -u munge -- munged
cat >"$work/slurm/slurm.conf" <<CONF
ClusterName=loopback
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
ProctrackType=proctrack/pgid
TaskPlugin=task/none
StateSaveLocation=$work/slurm/state
SlurmdSpoolDir=$work/slurm/%n
SlurmctldPidFile=$work/slurm/controller.pid
SlurmdPidFile=$work/slurm/%n.pid
SlurmctldPort=16817
SlurmctldLogFile=$work/slurm/controller.log
SlurmdLogFile=$work/slurm/%n.log
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
NodeName=n1 NodeHostname=$host NodeAddr=127.0.0.1 Port=17001 CPUs=1 RealMemory=8000
NodeName=n2 NodeHostname=$host NodeAddr=127.0.0.1 Port=17002 CPUs=1 RealMemory=8000
PartitionName=all Nodes=n1,n2 Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$work/slurm/slurm.conf OMP_WAIT_POLICY=passive
mkdir "$work"/slurm/n1 "$work"/slurm/n2
slurmctld
slurmd -N n1
slurmd -N n2
sleep 3
sinfo

photos=${2:-}
if [[ -z $photos ]]; then
  "$regrade" synth "$work/capture" --scene street --views 40 --size 200x150 --no-flow >/dev/null
  photos=$work/capture/truth
fi
mkdir "$work/styles"
cp "$root"/assets/style_{night,autumn}.png "$work/styles"
cd "$root/scripts/cluster"
film="--film-seconds 8 --film-size 320"
snakemake --profile "$root/scripts/slurm" --config regrade="$regrade" photos="$(realpath "$photos")" styles="$work/styles" out="$work/out" \
  parts=3 threads=1 memory_mb=2000 scene="--preset draft --photo-size 200 --splat-steps 1000" blocks=2 \
  refine="--splats 40 --splat-steps 600 --photo-size 200" style="--style-steps 40" film="$film" \
  >"$work/log" 2>&1 &
workflow=$!

# The first part of a film that has begun to render.
killed=
while [[ -z $killed ]] && kill -0 $workflow 2>/dev/null; do
  sleep 0.2
  if grep -qs "part . *of\|part ./" "$work"/out/.jobs/logs/style_*_part_*.txt; then
    killed=$(squeue --noheader --states=RUNNING --name=regrade-part --format=%i | head -n 1)
    [[ -z $killed ]] || scancel --signal=KILL "$killed"
  fi
done
wait $workflow || { tail -n 40 "$work/log"; exit 1; }
grep -q "Trying to restart job" "$work/log" || { echo "FAILED: job $killed was not tried again"; exit 1; }
for style in night autumn; do
  for file in styled.mp4 report.json report.html; do
    [[ -s $work/out/styles/style_$style/$file ]] || { echo "FAILED: style_$style has no $file"; exit 1; }
  done
done
cp -r "$work/out" "$work/alone"
# shellcheck disable=SC2086
"$regrade" render "$work/alone" --name style_night --until render --restart-from render $film >/dev/null 2>&1
cmp "$work"/{out,alone}/styles/style_night/styled.mp4
echo "ok: job $killed was killed and tried again"
