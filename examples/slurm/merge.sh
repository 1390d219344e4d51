#!/usr/bin/env bash
# Joins the runs of array.sh into one, with its figures and a page.
#SBATCH --job-name=dimcmc-merge
#SBATCH --ntasks=1
#SBATCH --time=00:15:00
set -euo pipefail
runs=$1

dimcmc merge "$runs"/seed_* --out "$runs/merged" --force
dimcmc report "$runs/merged" --force
