#!/usr/bin/env bash
# Submits a Monte Carlo campaign as a job array, and the merge of its shards after it:
#
#   submit.sh OUT SCENARIO --runs N --seed S [--set KEY.PATH=VALUE ...]
#
#   SHARDS=20 submit.sh ...      20 tasks instead of the number in campaign.sbatch
#   CPUS=8 submit.sh ...         8 cores for each task
#
# The result is OUT/merged, the output of the jobs OUT/slurm-*.out. Give account, partition and the like in
# the variables of Slurm: SBATCH_ACCOUNT, SBATCH_PARTITION, SBATCH_TIMELIMIT.
set -euo pipefail

if [ $# -lt 2 ]; then
  echo "usage: submit.sh OUT SCENARIO --runs N --seed S [--set KEY.PATH=VALUE ...]" >&2
  exit 2
fi
here=$(cd "$(dirname "$0")" && pwd)
out="$1"
shift
if [ -e "$out/shards" ] || [ -e "$out/merged" ]; then
  echo "submit.sh: a campaign is already in $out; name another folder, or remove it" >&2
  exit 2
fi
mkdir -p "$out/shards"

array=$(sbatch --parsable ${SHARDS:+--array="1-$SHARDS"} ${CPUS:+--cpus-per-task="$CPUS"} \
  --output="$out/slurm-%A_%a.out" "$here/campaign.sbatch" "$out" "$@")
array=${array%%;*} # a federation appends its cluster's name
echo "campaign  job $array"
merge=$(sbatch --parsable --dependency="afterok:$array" --output="$out/slurm-%j.out" "$here/merge.sbatch" "$out")
echo "merge     job ${merge%%;*}, after it; the result will be in $out/merged"
