#!/usr/bin/env bash
# Many stars in one allocation: every rank takes the next config of the list. Submit with `sbatch batch.sh stars.txt
# runs/stars`.
#SBATCH --job-name=dimcmc-batch
#SBATCH --ntasks=33            # one more than stars at once
#SBATCH --cpus-per-task=1
#SBATCH --time=08:00:00
#SBATCH --signal=B:USR1@300
#SBATCH --requeue
set -uo pipefail
list=$1 out=$2

export OMPI_MCA_odls_base_sigkill_timeout=0
# stars that are done are left alone, those that were stopped go on
# the warning comes to this script, which hands it on
${DIMCMC:-mpirun dimcmc-mpi} batch "$list" --out "$out" &
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
