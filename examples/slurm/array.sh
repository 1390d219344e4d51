#!/usr/bin/env bash
# Independent ensembles as an array of jobs, each a run of its own seed; no MPI. Submit with
#     job=$(sbatch --parsable array.sh star.json runs/star)
#     sbatch --dependency=afterok:$job merge.sh runs/star
# Without SLURM: `SLURM_ARRAY_TASK_ID=1 bash array.sh star.json runs/star`, and so on.
#SBATCH --job-name=dimcmc-array
#SBATCH --array=1-8
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=8
#SBATCH --time=02:00:00
#SBATCH --signal=B:USR1@120
#SBATCH --requeue
set -uo pipefail
config=$1 seed=$SLURM_ARRAY_TASK_ID run=$2/seed_$SLURM_ARRAY_TASK_ID

resume=()
[ -e "$run/manifest.json" ] && resume=(--resume)

# the warning comes to this script, which hands it on
dimcmc sample "$config" --out "$run" --seed "$seed" --threads "${SLURM_CPUS_PER_TASK:-1}" ${resume[@]+"${resume[@]}"} &
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
    scontrol requeue "${SLURM_ARRAY_JOB_ID}_${SLURM_ARRAY_TASK_ID}" && exit 0
fi
exit $code
