#!/usr/bin/env bash
# A data set in parts under Slurm: an array of jobs, and the merge once all of them succeeded.
#
#   PARTS=64 ./submit.sh plan.ron data
set -euo pipefail
here="$(cd "$(dirname "$0")" && pwd)"
plan="$1" data="$2" parts="${PARTS:-64}"
array="$(sbatch --parsable --array="1-$parts" "$here/part.sh" "$plan" "$data" "$parts")"
sbatch --dependency="afterok:$array" "$here/merge.sh" "$data" "$parts"
