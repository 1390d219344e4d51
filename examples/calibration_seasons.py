"""Orbits from two seasons and two spectrographs, from files to a chain: is the truth inside the intervals?

    python3 examples/calibration_seasons.py --program target/release/dimcmc
    python3 examples/calibration_seasons.py --table

Stars whose spots live 25 d are observed for 12 nights, and eleven months later for 12 more with another spectrograph,
whose velocities are 0.3 km/s higher. In turn they have an unknown planet of eccentricity 0.3, and a transiting one on a
circular orbit, whose period and time are known. `dimcmc simulate` writes the profiles of both sets; `dimcmc sample`
reads them, from a start that is not the truth, with orbit, systemic velocity, RV offset and the field of spots free.
One line per star goes to results/calibration/seasons.csv; the script can be stopped and resumed. The second command
writes results/calibration-seasons.md. Needs numpy.
"""

import argparse
import json
import math
import subprocess
from pathlib import Path

import numpy as np

import calibration_table

KINDS = ("eccentric", "transiting")
ROTATION_D, NIGHTS, GAP_D, ZERO_POINT_KMS, ECCENTRICITY = 3.0, 12, 330, 0.3, 0.3
# errors of the ephemeris (d)
PERIOD_SD_D, TRANSIT_SD_D = 5e-4, 0.01
NAMES = "k_kms porb_over_prot period_d phi t_conjunction_d sqrt_e_cos_omega sqrt_e_sin_omega vsys_kms zero_point_kms"
NAMES = NAMES.split()
COLUMNS = "kind seed profiles finding false_alarm converged steps evaluations ess rhat seconds".split()
COLUMNS += [f"{name}_{what}" for name in NAMES for what in ("true", "median", "low68", "high68", "low95", "high95")]
COLUMNS += ["eccentricity_low95", "error"]


def star(kind, number):
    """Config of the simulation, config of the inference without its data, and the true orbit."""
    seed = 3_000_000 + 10_000 * KINDS.index(kind) + number
    random = np.random.default_rng(seed)
    eccentric = kind == "eccentric"
    k = random.uniform(0.1, 0.25) if eccentric else random.uniform(0.03, 0.15)
    period, phi = math.exp(random.uniform(math.log(1.3), math.log(3.5))), random.random()
    truth = {"k_kms": k, "porb_over_prot": period, "phi": phi}
    uniform = lambda low, high: {"prior": "uniform", "min": low, "max": high}
    parameters = {"k_kms": uniform(0.0, 0.6), "vsys_kms": uniform(-1.0, 1.0)}
    start = {"k_kms": 0.1}
    if eccentric:
        omega, root = random.uniform(0, 2 * math.pi), math.sqrt(ECCENTRICITY)
        truth |= {"sqrt_e_cos_omega": root * math.cos(omega), "sqrt_e_sin_omega": root * math.sin(omega)}
        parameters |= {"porb_over_prot": {"prior": "log-uniform", "min": 1.2, "max": 4.0}, "phi": {"prior": "periodic"}}
        parameters |= {name: {"prior": "unit-disc", "max": 0.6} for name in ("sqrt_e_cos_omega", "sqrt_e_sin_omega")}
        start |= {"porb_over_prot": 2.0, "phi": 0.5}
        known = {}
    else:
        known = {"period_d": period * ROTATION_D, "t_conjunction_d": (phi + 0.25) * period * ROTATION_D}
        errors = {"period_d": PERIOD_SD_D, "t_conjunction_d": TRANSIT_SD_D}
        for name, sd in errors.items():
            parameters[name] = {"prior": "normal", "mean": known[name] + random.normal(0, sd), "sd": sd}
    shared = {
        "star": {"rotation_period_d": ROTATION_D, "inclination_deg": 55.0, "vsini_kms": 30.0}
        | {"photosphere_k": 5000.0, "spot_k": 3800.0, "line": {"sigma_kms": 2.5, "equivalent_width_kms": 5.8}},
        "imaging": {"objective": "marginal-likelihood", "pixels": 1000},
    }
    simulation = shared | {"planet": truth, "observations": sets(seed)}
    inference = shared | {"planet": start, "parameters": parameters}
    inference["sampler"] = {"ensembles": 2, "walkers": 20, "steps": 300, "ess": 200, "rhat": 1.05, "seed": 1}
    return seed, simulation, inference, truth | known | {"vsys_kms": 0.0, "zero_point_kms": ZERO_POINT_KMS}


def sets(seed):
    """Two data sets, simulated."""
    found = []
    for number, (name, power, wavelength) in enumerate((("blue", 65000.0, 520.0), ("red", 90000.0, 650.0))):
        nights = list(range(number * GAP_D, number * GAP_D + NIGHTS))
        simulated = {"schedule": {"on_nights": nights, "per_night": [1, 2], "seed": 2 * seed + number}}
        simulated |= {"velocity_kms": {"min": -40.5, "max": 40.5, "step": 1.8}, "snr": 1000.0, "pixels": 10000}
        simulated |= {"seed": 2 * seed + number, "zero_point_kms": number * ZERO_POINT_KMS}
        found.append({"name": name, "resolving_power": power, "wavelength_nm": wavelength, "simulate": simulated})
    found[0]["simulate"]["random_spots"] = {"lifetime_d": 25.0, "seed": seed}
    return found


def from_files(simulated):
    """The same sets, read from the files; velocities of the spectrographs are stable."""
    found = [{key: value for key, value in one.items() if key != "simulate"} for one in simulated]
    for one in found:
        one |= {"path": f"{one['name']}/observations.txt", "velocity_jitter_kms": 0.0}
    found[1]["zero_point_kms"] = "fitted"
    return found


def one(kind, number, args):
    seed, simulation, inference, truth = star(kind, number)
    folder = args.work / f"{kind}-{seed}"
    folder.mkdir(exist_ok=True)
    (folder / "simulate.json").write_text(json.dumps(simulation))
    (folder / "star.json").write_text(json.dumps(inference | {"observations": from_files(simulation["observations"])}))
    line = {"kind": kind, "seed": seed} | {f"{name}_true": value for name, value in truth.items()}
    commands = (["simulate", "simulate.json", "--out", "."], ["sample", "star.json", "--out", "run"])
    try:
        for command in commands if not (folder / "run" / "summary.json").exists() else ():
            subprocess.run([args.program, *command, "--force"], cwd=folder, check=True, capture_output=True, text=True)
    except subprocess.CalledProcessError as failure:
        return line | {"error": failure.stderr.strip().splitlines()[-1]}
    return line | results(folder / "run")


def results(run):
    found = json.loads((run / "summary.json").read_text())
    measured = json.loads((run / "manifest.json").read_text())["measured"]["sets"]
    line = {key: found[key] for key in ("converged", "steps", "evaluations")}
    line["seconds"] = json.loads((run / "effort.json").read_text())["seconds"]
    line |= {"finding": found["verdict"]["finding"], "false_alarm": found["verdict"]["false_alarm_probability"]}
    line["profiles"] = sum(each["profiles"] for each in measured)
    line["ess"] = min(each["ess"] for each in found["parameters"].values())
    line["rhat"] = max(each["rhat"] for each in found["parameters"].values())
    for name in NAMES:
        if name in found["parameters"]:
            each = found["parameters"][name]
            line |= {f"{name}_median": each["median"]}
            for level in ("68", "95"):
                line[f"{name}_low{level}"], line[f"{name}_high{level}"] = each[f"ci{level}"]
    held = measured[1]["zero_point"]
    line["zero_point_kms_median"] = held["value_kms"]
    for level, width in (("68", 0.99446), ("95", 1.95996)):
        for end, sign in (("low", -1), ("high", 1)):
            line[f"zero_point_kms_{end}{level}"] = held["value_kms"] + sign * width * held["sigma_kms"]
    if "eccentricity" in found.get("derived", {}):
        line["eccentricity_low95"] = found["derived"]["eccentricity"]["ci95"][0]
    return line


def run(args):
    args.work.mkdir(parents=True, exist_ok=True)
    done = {row["seed"] for row in calibration_table.resumed(args.csv)}
    for number in range(args.stars):
        for kind in KINDS:
            if str(star(kind, number)[0]) not in done:
                calibration_table.append(args.csv, COLUMNS, one(kind, number, args))


def inside(row, name, level):
    """Whether the truth is inside; a phase is wrapped across 0 if need be."""
    truth, low, high = (row[f"{name}_{what}"] for what in ("true", f"low{level}", f"high{level}"))
    turns = (-1, 0, 1) if name == "phi" else (0,)
    return any(low <= truth + turn <= high for turn in turns)


def right(row):
    """Whether the period is the true one within the resolution of a season."""
    periods = (row["porb_over_prot_median"], row["porb_over_prot_true"])
    return calibration_table.same(*(period * ROTATION_D for period in periods), NIGHTS)


def table(args):
    number = calibration_table.number
    rows = [{key: number(value) for key, value in row.items()} for row in calibration_table.read(args.csv)]
    failed = [row for row in rows if row["error"]]
    rows = [row for row in rows if not row["error"]]
    text = ""
    for kind in KINDS:
        of = [row for row in rows if row["kind"] == kind]
        if not of:
            continue
        findings = {name: sum(row["finding"] == name for row in of) for name in ("detection", "candidate")}
        text += f"### Planets that are {kind}\n\n{len(of)} stars: {findings['detection']} detections, "
        text += f"{findings['candidate']} candidates; "
        if kind == "eccentric":
            text += f"{sum(map(right, of))} with the right period, "
        text += f"{sum(row['converged'] == 'True' for row in of)} chains converged. Median time "
        text += f"{np.median([row['seconds'] for row in of]):.0f} s, profiles "
        text += f"{np.median([row['profiles'] for row in of]):.0f}.\n\n"
        lines = []
        for name in NAMES:
            have = [row for row in of if row[f"{name}_median"] != ""]
            if have:
                shares = [calibration_table.share(inside(row, name, level) for row in have) for level in ("68", "95")]
                widths = [0.5 * (row[f"{name}_high68"] - row[f"{name}_low68"]) for row in have]
                lines.append([name, len(have), *shares, f"{np.median(widths):.2g}"])
        text += calibration_table.table("parameter; stars; inside 68 %; inside 95 %; median error".split("; "), lines)
    text += "".join(f"- {row['kind']}, {row['seed']:.0f}: {row['error']}\n" for row in failed)
    calibration_table.under_the_head(args.out, "Two seasons, two spectrographs", text)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", help="dimcmc")
    parser.add_argument("--stars", type=int, default=40, help="of each kind")
    parser.add_argument("--work", type=Path, default=Path("target/calibration-seasons"), help="folder of the stars")
    parser.add_argument("--csv", type=Path, default=Path("results/calibration/seasons.csv"))
    parser.add_argument("--out", type=Path, default=Path("results/calibration-seasons.md"))
    parser.add_argument("--table", action="store_true", help="write the tables of the lines so far")
    args = parser.parse_args()
    if args.table:
        table(args)
    elif args.program:
        run(args)
    else:
        parser.error("--program, or --table")
