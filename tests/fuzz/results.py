#!/usr/bin/env python3
"""A folder of results for fuzzing: `results.py PROGRAM FOLDER`, what each command writes of a small star."""

import json
import pathlib
import subprocess
import sys

CONFIG = {
    "star": {
        "name": "Beta & Co", "rotation_period_d": 3.0, "inclination_deg": 50.0, "vsini_kms": 20.0, "contrast": 0.1,
        "mass_msun": 0.9, "line": {"sigma_kms": 2.5, "equivalent_width_kms": 5.8},
    },
    "planet": {"k_kms": 0.2, "porb_over_prot": 1.7, "phi": 0.0},
    "observations": {
        "simulate": {
            "random_spots": {"number": 6, "lifetime_d": 8, "seed": 2},
            "cycles": [0.0, 0.13, 0.29, 0.41, 0.58, 0.72, 0.87, 1.04],
            "velocity_kms": {"min": -27.0, "max": 27.0, "step": 3.0},
            "snr": 1000, "seed": 7, "pixels": 300,
        },
        "velocity_jitter_kms": 0,
    },
    "imaging": {"objective": "marginal-likelihood", "pixels": 100, "spot_amplitude": 0.2, "spot_slope": 0.5},
    "parameters": {"k_kms": {"prior": "uniform", "min": 0.0, "max": 1.0}, "phi": {"prior": "periodic"}},
    "sampler": {"ensembles": 2, "walkers": 6, "steps": 8, "ess": 10, "rhat": 1.5, "seed": 3},
    "grid": {"axes": {"k_kms": [0.08, 0.34, 4], "phi": [-0.09, 0.08, 4]}},
}

COMMANDS = [
    "simulate config.json --out simulate",
    "map config.json --out map",
    "optimise config.json --out optimise",
    "grid config.json --out grid",
    "sample config.json --out sample",
    "sample config.json --out seed_4 --seed 4",
    "periodogram config.json --out periodogram --draws 1000",
    "compare sample grid --out compare",
    "inject config.json --k-kms 0.2 --porb-over-prot 2.6 --phi 0.2 --out inject",
    "limits config.json --min-period-d 2 --max-period-d 8 --periods 4 --amplitudes 4 --phases 4 --out limits",
    "plan config.json --nights 2,3 --maps 0 --draws 1000 --out plan",
    "survey periodogram limits --out survey",
]

program, folder = (pathlib.Path(name).absolute() for name in sys.argv[1:])
folder.mkdir(parents=True)
(folder / "config.json").write_text(json.dumps(CONFIG))
# a star that does not change
CONFIG["imaging"] = {"objective": "spottedness", "pixels": 100, "chi2_target": 1.2}
CONFIG["observations"]["simulate"]["random_spots"]["lifetime_d"] = None
CONFIG["observations"]["simulate"]["snr"] = 100
(folder / "static.json").write_text(json.dumps(CONFIG))
for command in COMMANDS + ["map static.json --out static"]:
    done = subprocess.run([program, *command.split()], cwd=folder, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{command}: {done.stderr}")
