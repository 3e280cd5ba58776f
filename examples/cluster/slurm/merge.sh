#!/usr/bin/env bash
#SBATCH --job-name=haptograph-merge
#SBATCH --cpus-per-task=1
#SBATCH --time=4:00:00
set -euo pipefail
data="$1" parts="$2"
folders=()
for ((part = 1; part <= parts; part++)); do folders+=("$data-parts/$part"); done
exec "${HAPTOGRAPH:-haptograph}" batch merge "${folders[@]}" -o "$data"
