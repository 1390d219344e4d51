#!/usr/bin/env bash
# One chain on many cores: rank 0 holds it, all others reconstruct. Submit with `sbatch chain.sh star.json runs/star`;
# without SLURM, `bash chain.sh star.json runs/star` does the same on this machine.
#SBATCH --job-name=dimcmc
# one more than reconstructions at once; no more than half the walkers of all ensembles, plus one
#SBATCH --ntasks=33
#SBATCH --cpus-per-task=1
#SBATCH --time=04:00:00
#SBATCH --signal=B:USR1@300      # five minutes before the end: finish the reconstructions under way, and stop
#SBATCH --requeue
set -uo pipefail
config=$1 run=$2

# mpirun waits a second for ranks to end by themselves; they do not need it
export OMPI_MCA_odls_base_sigkill_timeout=0
# a run that has begun goes on, with any number of ranks, to the same bytes
resume=()
[ -e "$run/manifest.json" ] && resume=(--resume)

# the warning comes to this script, which hands it on
${DIMCMC:-mpirun dimcmc-mpi} sample "$config" --out "$run" ${resume[@]+"${resume[@]}"} &
pid=$!
trap 'kill -USR1 $pid' USR1 TERM
wait $pid
code=$?
while kill -0 $pid 2>/dev/null; do
    wait $pid
    code=$?
done
# 75: stopped before its end, the same command goes on
if [ $code -eq 75 ] && [ -n "${SLURM_JOB_ID:-}" ]; then
    scontrol requeue "$SLURM_JOB_ID" && exit 0
fi
exit $code
