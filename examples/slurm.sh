#!/bin/sh
# Reconstructs a list of captures as a Slurm array: every task takes one part of the list.
#
#     sbatch --array=1-8 examples/slurm.sh captures.txt results --stride 2
#
# A task that was killed or ran out of time may be submitted again: it skips what is done.
#SBATCH --job-name=thirdbounce
#SBATCH --cpus-per-task=4
#SBATCH --gpus-per-task=1
#SBATCH --time=04:00:00
#SBATCH --requeue
set -eu

if [ $# -lt 2 ]; then
    echo "usage: sbatch --array=1-N $0 LIST.txt RESULTS [options of reconstruct]" >&2
    exit 2
fi
list=$1
results=$2
shift 2
# Both are absent outside of an array: then this task takes the whole list.
part=${SLURM_ARRAY_TASK_ID:-1}
parts=${SLURM_ARRAY_TASK_MAX:-1}
log=$results/part-$part-of-$parts.jsonl
mkdir -p "$results"
exec "${THIRDBOUNCE:-thirdbounce}" batch "$list" --out "$results/maps" --part "$part/$parts" --quiet "$@" >"$log"
