#!/usr/bin/env bash
#SBATCH --job-name=haptograph
#SBATCH --cpus-per-task=1
#SBATCH --mem=1G
#SBATCH --time=4:00:00
#SBATCH --requeue
# One part. Where the node goes down or the time runs out, it is put into the queue again and goes on where it stopped.
set -euo pipefail
plan="$1" data="$2" parts="$3"
exec "${HAPTOGRAPH:-haptograph}" batch "$plan" -o "$data-parts/$SLURM_ARRAY_TASK_ID" \
  --shard "$SLURM_ARRAY_TASK_ID/$parts" --threads "${SLURM_CPUS_PER_TASK:-1}"
