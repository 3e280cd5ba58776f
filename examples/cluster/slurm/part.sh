#!/usr/bin/env bash
#SBATCH --job-name=haptograph
#SBATCH --cpus-per-task=1
#SBATCH --mem=1G
#SBATCH --time=4:00:00
#SBATCH --requeue
#SBATCH --signal=B:USR1@60
# One part. Where the node goes down, Slurm puts it into the queue again; a minute before the time runs out it does so itself. Either way it
# goes on where it stopped.
set -euo pipefail
plan="$1" data="$2" parts="$3"
again() {
  kill "$part"
  wait "$part" || true
  exec scontrol requeue "${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID"
}
trap again USR1
"${HAPTOGRAPH:-haptograph}" batch "$plan" -o "$data-parts/$SLURM_ARRAY_TASK_ID" \
  --shard "$SLURM_ARRAY_TASK_ID/$parts" --threads "${SLURM_CPUS_PER_TASK:-1}" &
part=$!
wait "$part"
