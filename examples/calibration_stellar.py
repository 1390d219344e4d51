"""Stellar parameters of simulated stars with evolving spots: best values and errors by evolving and static maps.

    python3 examples/calibration_stellar.py --simulator SIMULATOR --simulator target/release/dimcmc \\
        --program target/release/dimcmc
    python3 examples/calibration_stellar.py --table

Stars of random geometry as in calibration_changing.py (inclination 20 to 75 degrees, vsini 15 to 70 km/s, lifetimes
from 7 d to infinity), with a planet. Orbit, rotation, shear, inclination, vsini and the field are free; the search
begins at values that are off: inclination by up to 15 degrees, vsini by up to 1 km/s, the rate of rotation by up to 0.3
%. Best values have errors by the curvature; with `--steps` a short chain of evolving maps follows, most of whose moves
are independent draws, so that a few hundred are enough. Where no static map reaches the usual chi2 the target is set
above the attainable one, as a user would. One line per star and objective goes to results/calibration/stellar.csv; the
script can be stopped and resumed. The second command writes results/calibration-stellar.md. Needs numpy.
"""

import argparse
import json
import math
import re
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np

import calibration_changing
import calibration_table

OBJECTIVES = ("marginal-likelihood", "spottedness")
FREE = ("inclination_deg", "vsini_kms", "omega_eq_rad_d", "domega_rad_d", "k_kms", "porb_over_prot", "phi")
COLUMNS = ["seed", "simulator", "objective", "lifetime_d", "well_defined", "log_prob", "seconds", "error"]
COLUMNS += ["chi2_target"]
COLUMNS += [f"{prefix}{name}" for name in FREE for prefix in ("true_", "best_", "sd_")]
# of chains: the share of draws below the true value, and the standard deviation of draws
TOLD = ("inclination_deg", "vsini_kms", "omega_eq_rad_d", "domega_rad_d", "k_kms")
COLUMNS += ["draws", "accepted", *(f"{prefix}{name}" for name in TOLD for prefix in ("below_", "spread_"))]
# the chain's first steps are left out
BURN_IN, ENSEMBLES, WALKERS = 2, 2, 20


# an unattainable target of chi2 is replaced by this many times the lowest chi2 of a map
ABOVE_FLOOR = 1.03
# km/s; the table has stars on both sides of it apart
FAST = 45.0


def config(truth, folder, objective, seed):
    """The simulated star's config with all of FREE free, beginning beside the truth."""
    random = np.random.default_rng(seed)
    found = json.loads((folder / "config.json").read_text())
    star = found["star"]
    omega = 2 * math.pi / star["rotation_period_d"]
    vsini = star["vsini_kms"] + random.uniform(-1, 1)
    star["inclination_deg"] = float(np.clip(star["inclination_deg"] + random.uniform(-15, 15), 10, 85))
    star["vsini_kms"], star["domega_rad_d"] = vsini, 0.0
    star["omega_eq_rad_d"] = omega * (1 + random.uniform(-3e-3, 3e-3))
    uniform = lambda low, high: {"prior": "uniform", "min": low, "max": high}
    found["parameters"] |= {
        "inclination_deg": {"prior": "isotropic", "min": 3, "max": 89},
        "vsini_kms": uniform(vsini - 5, vsini + 5),
        "omega_eq_rad_d": uniform(0.97 * omega, 1.03 * omega),
        "domega_rad_d": uniform(-0.2, 0.2),
    }
    found["planet"] = {"k_kms": 0.1, "porb_over_prot": truth["porb_over_prot"], "phi": truth["phi"]}
    found["observations"]["velocity_jitter_kms"] = 0.0
    found["imaging"] = found.get("imaging", {}) | {"objective": objective}
    return found


def of_chain(out, truth):
    """The columns of a chain in the table."""
    draws = [json.loads(line) for line in (out / "chain.jsonl").read_text().splitlines()]
    draws = [draw for draw in draws if draw["step"] >= BURN_IN]
    line = {"draws": len(draws), "accepted": round(np.mean([draw["accepted"] for draw in draws]), 3)}
    for name in TOLD:
        of = np.array([draw[name] for draw in draws])
        line |= {f"below_{name}": round(np.mean(of < truth[name]), 4), f"spread_{name}": f"{np.std(of):.6g}"}
    return line


def one(number, objective, simulator, args):
    row, options = calibration_changing.star("geometry", number, 1)
    folder = args.work / f"geometry-{row['seed']}"
    if not (folder / "config.json").exists():
        calibration_changing.simulate(simulator, options, folder)
    truth = {"inclination_deg": options["inclination"], "vsini_kms": options["vsini"], "domega_rad_d": 0.0}
    truth |= {"omega_eq_rad_d": 2 * math.pi / options["prot"], "k_kms": options["k"]}
    truth |= {"porb_over_prot": options["porb-over-prot"], "phi": options["phi"]}
    line = {"seed": row["seed"], "simulator": calibration_changing.name_of(simulator), "objective": objective}
    line |= {"lifetime_d": row["lifetime_d"]}
    line |= {f"true_{name}": truth[name] for name in FREE}
    path, out = folder / f"stellar-{objective}.json", folder / f"stellar-{objective}"
    asked = config(truth, folder, objective, row["seed"])
    began = time.monotonic()
    sampled = args.steps > 0 and objective == OBJECTIVES[0]
    if sampled:
        asked["sampler"] = {"ensembles": ENSEMBLES, "walkers": WALKERS, "steps": args.steps}
        shutil.rmtree(out, ignore_errors=True)
    command = ["sample"] if sampled else ["optimise", "--force"]
    while True:
        path.write_text(json.dumps(asked))
        done = subprocess.run([args.program, *command, path, "--out", out], capture_output=True, text=True)
        floor = re.search(r"comes down to ([0-9.]+) per datum", done.stderr)
        if not done.returncode or not floor or "chi2_target" in asked["imaging"]:
            break
        asked["imaging"]["chi2_target"] = line["chi2_target"] = round(ABOVE_FLOOR * float(floor[1]), 4)
    line["seconds"] = round(time.monotonic() - began, 1)
    if done.returncode:
        return line | {"error": done.stderr.strip().splitlines()[-1].split(".json: ")[-1][:200]}
    if sampled:
        found = json.loads((out / "manifest.json").read_text())["optimum"]
        line |= of_chain(out, truth)
    else:
        found = json.loads((out / "optimum.json").read_text())
        line["well_defined"] = found["well_defined"] and found["converged"]
    line["log_prob"] = found["log_prob"]
    for name in FREE:
        line[f"best_{name}"], line[f"sd_{name}"] = found["parameters"][name], found["sd"][name]
    return line


def run(args):
    args.work.mkdir(parents=True, exist_ok=True)
    done = {(row["seed"], row["objective"]) for row in calibration_table.resumed(args.csv)}
    for number in range(args.first, args.stars):
        simulator = args.simulator[number % len(args.simulator)]
        for objective in args.objective or OBJECTIVES:
            seed = calibration_changing.star("geometry", number, 1)[0]["seed"]
            if (str(seed), objective) not in done:
                calibration_table.append(args.csv, COLUMNS, one(number, objective, simulator, args))


def table(args):
    """Fractions of true values within 1 and 2 standard errors, for all stars whose search ended."""
    rows = calibration_table.read(args.csv)
    ended = [row for row in rows if not row["error"]]
    discs = [row for row in ended if not row["simulator"].endswith("field")]
    integrated = [row for row in discs if row["objective"] == OBJECTIVES[0]]
    fast = lambda row: float(row["true_vsini_kms"]) > FAST
    groups = {
        "evolving maps": integrated,
        f"the same, vsini below {FAST:.0f} km/s": [row for row in integrated if not fast(row)],
        f"the same, vsini above {FAST:.0f} km/s": [row for row in integrated if fast(row)],
        "evolving maps, spots from a Gaussian field": [row for row in ended if row["simulator"].endswith("field")],
        "spottedness": [row for row in discs if row["objective"] == OBJECTIVES[1]],
    }
    lines = ["| parameter | stars by | stars | within 1 sd (68 %) | within 2 sd (95 %) | rms error / sd | median sd |"]
    lines.append("| --- | --- | --- | --- | --- | --- | --- |")
    for name in TOLD:
        for group, of in groups.items():
            if not of:
                continue
            number = lambda prefix: np.array([float(row[prefix + name]) for row in of])
            off, sd = np.abs(number("best_") - number("true_")), number("sd_")
            cells = [name, group, str(len(of)), *(calibration_table.share(off < n * sd) for n in (1, 2))]
            cells += [f"{np.sqrt(np.mean((off / sd) ** 2)):.2f}", f"{np.median(sd):.3g}"]
            lines.append("| " + " | ".join(cells) + " |")
    lines += ["", "| parameter | chains of stars with vsini | stars | inside 68 % | inside 95 % | spread / sd |"]
    lines.append("| --- | --- | --- | --- | --- | --- |")
    chains = [row for row in integrated if row["draws"]]
    groups = {f"below {FAST:.0f} km/s": [row for row in chains if not fast(row)]}
    groups[f"above {FAST:.0f} km/s"] = [row for row in chains if fast(row)]
    for name in TOLD:
        for group, of in groups.items():
            below, spread, sd = (np.array([float(row[p + name]) for row in of]) for p in ("below_", "spread_", "sd_"))
            inside = [calibration_table.share(np.abs(below - 0.5) < share / 2) for share in (0.68, 0.95)]
            cells = [name, group, str(len(of)), *inside, f"{np.median(spread / sd):.2f}"]
            lines.append("| " + " | ".join(cells) + " |")
    why = lambda row: row["error"].split(": at these")[0].removeprefix("imaging.chi2_target: ")
    failed = [f"- {row['seed']}, {row['objective']}: {why(row)}" for row in rows if row["error"]]
    text = "\n".join([*lines, "", *failed])
    calibration_table.under_the_head(args.out, "Stellar parameters of stars with evolving spots", text)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--simulator", action="append", help=calibration_changing.SIMULATOR)
    parser.add_argument("--program", help="dimcmc")
    parser.add_argument("--objective", action="append", choices=OBJECTIVES, help="both if not given")
    parser.add_argument("--stars", type=int, default=40)
    parser.add_argument("--first", type=int, default=0, help="number of the first star, for a share of the work")
    parser.add_argument("--steps", type=int, default=0, help="of a chain of evolving maps; none if 0")
    parser.add_argument("--work", type=Path, default=Path("target/calibration-changing"), help="folder of the stars")
    parser.add_argument("--csv", type=Path, default=Path("results/calibration/stellar.csv"))
    parser.add_argument("--out", type=Path, default=Path("results/calibration-stellar.md"))
    parser.add_argument("--table", action="store_true", help="write the table of the lines so far")
    args = parser.parse_args()
    if args.table:
        table(args)
    elif args.simulator and args.program:
        run(args)
    else:
        parser.error("--simulator and --program, or --table")
