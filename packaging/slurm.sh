#!/bin/bash
#SBATCH --nodes=2
#SBATCH --ntasks-per-node=16
#SBATCH --cpus-per-task=1
#SBATCH --mem=0
#SBATCH --time=08:00:00
#SBATCH --signal=TERM@60
# sbatch packaging/slurm.sh SCENE.py RUN FIRST LAST [OPTION ...]: levels below FIRST of a scene on one task, then FIRST to LAST on all of them, into the
# folder RUN. Submitted again, it goes on with what is stored. docs/cluster.md says what a cluster needs. MPI names Slurm's plugin: pmix for Open MPI, pmi2 for MPICH.
set -euo pipefail
scene=$1 run=$2 first=$3 last=$4
shift 4
export OMP_NUM_THREADS=1
tasks() { srun --mpi="${MPI:-pmix}" --kill-on-bad-exit=1 --ntasks="$1" pdvol run "$scene" --out "$run" "${@:2}" --no-picture; }
resume=()
if [ -e "$run/run.json" ]; then resume=(--resume); fi
if [ "$first" -gt 0 ]; then
    tasks 1 --levels "0:$((first - 1))" "${resume[@]}" "$@"
    resume=(--resume)
fi
tasks "$SLURM_NTASKS" --levels "$first:$last" "${resume[@]}" "$@"
