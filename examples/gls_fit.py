"""Fits a sinusoid to the velocities of `dimcmc periodogram` by generalised least squares, all covariances counted.

A constant is free where the systemic velocity is, and one for each further data set.

    python3 examples/gls_fit.py FOLDER [PERIOD_D]

The period is the best one of periodogram.json if none is given; K then is the best orbit's.
"""

import json
import sys
from pathlib import Path

import numpy as np

folder = Path(sys.argv[1])
rv = np.genfromtxt(folder / "rv.csv", delimiter=",", names=True)
covariance = np.loadtxt(folder / "covariance.csv", delimiter=",")
found = json.loads((folder / "periodogram.json").read_text())
best = found["best"]
period_d = float(sys.argv[2]) if len(sys.argv) > 2 else best["period_d"]

angle = 2 * np.pi * (rv["time_d"] - rv["time_d"].mean()) / period_d
constants = [np.ones_like(angle)] if "systemic_velocity" in found else []
for number, data_set in enumerate(found.get("measured", {}).get("sets", []), 1):
    if "zero_point" in data_set:
        constants.append((rv["data_set"] == number).astype(float))
x = np.column_stack([np.cos(angle), np.sin(angle), *constants])
curvature = x.T @ np.linalg.solve(covariance, x)
amplitudes = np.linalg.solve(curvature, x.T @ np.linalg.solve(covariance, rv["rv_kms"]))[:2]
k = np.hypot(*amplitudes)
sigma = np.sqrt(amplitudes @ np.linalg.inv(curvature)[:2, :2] @ amplitudes) / k
print(f"K = {k:.9f} +- {sigma:.9f} km/s at {period_d:.6f} d (the period taken as known)")
