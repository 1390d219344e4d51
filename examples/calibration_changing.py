"""Calibration of the marginal likelihood on simulated stars with evolving spots, compared with a static objective.

    python3 examples/calibration_changing.py --simulator target/release/dimcmc \
        --search target/release/examples/blind_search
    python3 examples/calibration_changing.py --table

The first makes stars one by one, kinds in turn, without and with a planet, searches each, and appends one line per star
to results/calibration/changing.csv; it can be stopped at any time, and resumes where it was. `--search` is
`dimcmc`, or the example `blind_search`, which takes half the time. The second writes results/calibration-changing.md.
Needs numpy, and the requirements of the simulator.
"""

import argparse
import itertools
import json
import math
import shlex
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

import calibration_table

# lifetime (d) and further options of the simulator
KINDS = {
    "for ever": {"lifetime": math.inf},
    "60 d": {"lifetime": 60},
    "30 d": {"lifetime": 30},
    "15 d": {"lifetime": 15},
    "7 d": {"lifetime": 7},
    "polar spot": {"lifetime": 12, "polar-spot": True},
    "two seasons": {"lifetime": 40, "seasons": 2, "nights": 10},
    "geometry": {},
    "shear": {"lifetime": 30},
}
K_KMS, PERIODS = (0.03, 0.3), (0.5, 4.0)
# kind "geometry": inclination (deg), vsini (km/s), rotation period (d), lifetime (d)
INCLINATION_DEG, VSINI_KMS, ROTATION_D, LIFETIMES_D = (20, 75), (15, 70), (1.5, 6.0), (math.inf, 60, 30, 15, 7)
# kind "shear": differential rotation (rad/d)
SHEAR_RAD_D = (0.02, 0.1)
# bins of 1.8 km/s as far from the edge of the line as with 57 bins at 40 km/s
STEP_KMS, MARGIN_KMS = 1.8, 11.3

SIMULATOR = (
    "dimcmc, or a script that makes a star (OUT --seed N --lifetime D --k KMS ...), with options of its own as in "
    "'examples/simulate_spots.py --how field'; several take turns"
)
COLUMNS = (
    "kind planet seed profiles true_k_kms true_porb_over_prot true_phi rotation_period_d inclination_deg vsini_kms "
    "lifetime_d false_alarm finding k_kms sigma_k_kms porb_over_prot sigma_porb_over_prot phi sigma_phi on_edge "
    "median_sigma_k_kms amplitude slope break_degree fitted_lifetime_d jitter_kms at_bounds "
    "along_kms sigma_along_kms across_kms sigma_across_kms chi2_orbit k_there_kms sigma_k_there_kms phi_there "
    "sigma_phi_there seconds static_false_alarm static_finding static_k_kms static_sigma_k_kms static_porb_over_prot "
    "static_seconds season_d simulator ln_bayes_circle ln_bayes_ellipse ln_bayes_two_circles chi2_rv "
    "chi2_below_0.3 chi2_to_0.45 chi2_half chi2_to_0.85 chi2_rotation chi2_to_2 chi2_to_4 chi2_to_8 error"
).split()


def log_uniform(random, low, high):
    return float(np.exp(random.uniform(math.log(low), math.log(high))))


def star(kind, number, planet):
    """A star: its line of the table before the search, and the simulator's options."""
    seed = 1_000_000 + 10_000 * list(KINDS).index(kind) + 2 * number + planet
    random = np.random.default_rng(seed)
    k, period, phi = log_uniform(random, *K_KMS), log_uniform(random, *PERIODS), float(random.random())
    options = {"seed": seed, "k": k if planet else 0.0, "porb-over-prot": period, "phi": phi, "prot": 3.0}
    options |= {"inclination": 38.0, "vsini": 40.0} | KINDS[kind]
    if kind == "geometry":
        vsini = random.uniform(*VSINI_KMS)
        options |= {
            "inclination": random.uniform(*INCLINATION_DEG),
            "vsini": vsini,
            "prot": log_uniform(random, *ROTATION_D),
            "lifetime": LIFETIMES_D[random.integers(len(LIFETIMES_D))],
            "bins": math.ceil(2 * (vsini + MARGIN_KMS) / STEP_KMS) | 1,
        }
    if kind == "shear":
        options["shear"] = random.uniform(*SHEAR_RAD_D)
    row = {"kind": kind, "planet": planet, "seed": seed, "true_k_kms": options["k"], "true_porb_over_prot": period}
    row |= {"true_phi": phi, "rotation_period_d": options["prot"], "inclination_deg": options["inclination"]}
    return row | {"vsini_kms": options["vsini"], "lifetime_d": options["lifetime"]}, options


def simulate(program, options, folder):
    """Writes profiles and config.json, star parameters at the truth."""
    if not is_own(program):
        flags = [f"--{name}" if value is True else f"--{name}={value}" for name, value in options.items()]
        script, *more = shlex.split(program)
        command = [sys.executable, script, folder, *more, *flags]
        subprocess.run(command, check=True, capture_output=True, text=True)
        return
    config, simulated = own(options)
    folder.mkdir()
    path = folder / "simulate.json"
    path.write_text(json.dumps(config | {"observations": {"simulate": simulated}}))
    subprocess.run([program, "simulate", path, "--out", folder, "--force"], check=True, capture_output=True, text=True)
    config["planet"]["k_kms"] = 0.0
    (folder / "config.json").write_text(json.dumps(config | {"observations": {"path": "observations.txt"}}))


def is_own(program):
    """Whether a simulator is `dimcmc` rather than a Python script."""
    return not shlex.split(program)[0].endswith(".py")


def name_of(program):
    """A simulator in tables: its name with its own options, without folders."""
    script, *more = shlex.split(program)
    return " ".join([Path(script).stem, *more])


def own(options):
    """A config of `dimcmc simulate` for the same kind of star, and its section observations.simulate."""
    seed, lifetime, edge = options["seed"], options["lifetime"], options.get("bins", 57) // 2 * STEP_KMS
    star = {"rotation_period_d": options["prot"], "epoch_d": 0.0, "inclination_deg": options["inclination"]}
    star |= {"vsini_kms": options["vsini"], "domega_rad_d": options.get("shear", 0.0), "wavelength_nm": 550.0}
    star |= {"limb_darkening": {"law": "linear", "coefficients": [0.65]}, "photosphere_k": 5500.0, "spot_k": 3500.0}
    star["line"] = {"shape": "gaussian", "sigma_kms": 2.5, "equivalent_width_kms": 5.8}
    longitude = seed * 137.5 % 360
    simulated = {
        "spots": [[longitude, 80, 20, 0.85]] if options.get("polar-spot") else [],
        "random_spots": {"lifetime_d": None if math.isinf(lifetime) else lifetime, "seed": seed},
        "schedule": {"nights": options.get("nights", 15), "seasons": options.get("seasons", 1), "clouds": 0.12}
        | {"season_spacing_d": 330.0, "seed": seed},
        "velocity_kms": {"min": -edge, "max": edge, "step": STEP_KMS},
        "snr": 1000.0,
        "seed": seed,
        "pixels": 20000,
    }
    planet = {"k_kms": options["k"], "porb_over_prot": options["porb-over-prot"], "phi": options["phi"]}
    free = {"k_kms": {"prior": "uniform", "min": 0.0, "max": 0.6}, "phi": {"prior": "periodic"}}
    free["porb_over_prot"] = {"prior": "uniform", "min": 0.5, "max": 4.0}
    return {"star": star, "instrument": {"resolving_power": 65000.0}, "planet": planet, "parameters": free}, simulated


def search(program, config, objective, folder):
    """periodogram.json of a blind search with that objective, and its seconds."""
    changed = json.loads(config.read_text())
    changed["imaging"] = changed.get("imaging", {}) | {"objective": objective}
    changed["observations"]["velocity_jitter_kms"] = 0.0
    path = config.with_name(f"{objective}.json")
    path.write_text(json.dumps(changed))
    began = time.monotonic()
    subprocess.run([program, "periodogram", path, "--out", folder], check=True, capture_output=True, text=True)
    return json.loads((folder / "periodogram.json").read_text()), time.monotonic() - began


def at_period(folder, period_d, phi):
    """The orbit at a known period by least squares with all covariances: K and phase, and the part of it that is in
    phase with the true orbit and the part across (both Gaussian, whatever K)."""
    rv = np.genfromtxt(folder / "rv.csv", delimiter=",", names=True)
    covariance = np.loadtxt(folder / "covariance.csv", delimiter=",")
    angle = 2 * np.pi * (rv["time_d"] / period_d - phi)
    x = np.column_stack([np.cos(angle), np.sin(angle)])
    weighted = np.linalg.solve(covariance, x)
    errors = np.linalg.inv(x.T @ weighted)
    along, across = errors @ (weighted.T @ rv["rv_kms"])
    k = math.hypot(along, across)
    unit = np.array([along, across]) / k
    turned = np.array([-unit[1], unit[0]])
    return {
        "along_kms": along,
        "sigma_along_kms": math.sqrt(errors[0, 0]),
        "across_kms": across,
        "sigma_across_kms": math.sqrt(errors[1, 1]),
        "k_there_kms": k,
        "sigma_k_there_kms": math.sqrt(unit @ errors @ unit),
        "phi_there": (phi + math.atan2(across, along) / (2 * np.pi)) % 1,
        "sigma_phi_there": math.sqrt(turned @ errors @ turned) / k / (2 * np.pi),
    }, errors


def by_period(folder, row):
    """Residuals of the velocities from the true orbit, in squares of their errors: the total, and the part of an orbit
    at each period, averaged over ranges of periods (the expectation of each is 1)."""
    rv = np.genfromtxt(folder / "rv.csv", delimiter=",", names=True)
    weight = np.linalg.inv(np.loadtxt(folder / "covariance.csv", delimiter=","))
    scan = np.genfromtxt(folder / "periodogram.csv", delimiter=",", names=True)
    turns = rv["time_d"] / (row["true_porb_over_prot"] * row["rotation_period_d"]) - row["true_phi"]
    left = rv["rv_kms"] - row["true_k_kms"] * np.cos(2 * np.pi * turns)
    angle = 2 * np.pi * scan["frequency_per_d"][:, None] * rv["time_d"]
    x = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    slope = np.swapaxes(x, 1, 2) @ (weight @ left)
    curvature = np.swapaxes(x, 1, 2) @ weight @ x
    chi2 = 0.5 * np.sum(slope * np.linalg.solve(curvature, slope[..., None])[..., 0], axis=-1)
    names = [name for name in COLUMNS if name.startswith("chi2_") and name not in ("chi2_orbit", "chi2_rv")]
    ranges = np.digitize(scan["porb_over_prot"], calibration_table.EDGES)
    means = {name: float(chi2[ranges == i].mean()) for i, name in enumerate(names) if np.any(ranges == i)}
    return {"chi2_rv": left @ weight @ left / len(left)} | means


def searched(row, folder, args, static):
    """The line of a simulated star, also searched with a static map if `static`."""
    config = folder / "config.json"
    found, row["seconds"] = search(args.search, config, "marginal-likelihood", folder / "changing")
    best, field = found["best"], found["field"]
    times = np.genfromtxt(folder / "changing" / "rv.csv", delimiter=",", names=True)["time_d"]
    row["profiles"], row["season_d"] = len(times), calibration_table.season(times)
    row["false_alarm"], row["finding"] = found["false_alarm"]["probability"], found["verdict"]["finding"]
    for name in "k_kms sigma_k_kms porb_over_prot sigma_porb_over_prot phi sigma_phi on_edge".split():
        row[name] = best[name]
    row["amplitude"], row["slope"] = field["spot_amplitude"], field["spot_slope"]
    row["break_degree"] = field["spot_break_degree"]
    row["fitted_lifetime_d"], row["jitter_kms"] = field["spot_lifetime_d"], field["velocity_jitter_kms"]
    row["at_bounds"] = " ".join(field["at_bounds"])
    for planets, factor in found["evidence"].items():
        if "ln_bayes" in factor:
            row[f"ln_bayes_{planets}"] = factor["ln_bayes"]
    scan = np.genfromtxt(folder / "changing" / "periodogram.csv", delimiter=",", names=True)
    row["median_sigma_k_kms"] = calibration_table.median_sigma(scan["porb_over_prot"], scan["sigma_k_kms"])
    period_d = row["true_porb_over_prot"] * row["rotation_period_d"]
    there, errors = at_period(folder / "changing", period_d, row["true_phi"])
    off = np.array([there["along_kms"] - row["true_k_kms"], there["across_kms"]])
    row |= there | {"chi2_orbit": off @ np.linalg.solve(errors, off)}
    row |= by_period(folder / "changing", row)
    if not static:
        return row
    found, row["static_seconds"] = search(args.search, config, "spottedness", folder / "static")
    row["static_false_alarm"] = found["false_alarm"]["probability"]
    row["static_finding"] = found["verdict"]["finding"]
    for name in ("k_kms", "sigma_k_kms", "porb_over_prot"):
        row[f"static_{name}"] = found["best"][name]
    return row


def one(kind, number, planet, simulator, args):
    row, options = star(kind, number, planet)
    row["simulator"] = name_of(simulator)
    folder = args.work / f"{kind.replace(' ', '-')}-{row['seed']}"
    try:
        if not (folder / "config.json").exists():
            simulate(simulator, options, folder)
        return searched(row, folder, args, number < args.static)
    except subprocess.CalledProcessError as failure:
        return row | {"error": failure.stderr.strip().splitlines()[-1]}


def run(args):
    """Runs stars until there are enough, except those in the table."""
    args.work.mkdir(parents=True, exist_ok=True)
    done = {(row["kind"], row["seed"]) for row in calibration_table.resumed(args.csv)}
    for number, planet, kind in itertools.product(range(args.first, args.stars), (0, 1), args.kind or KINDS):
        able = [program for program in args.simulator if kind != "shear" or is_own(program)]
        if able and (kind, str(star(kind, number, planet)[0]["seed"])) not in done:
            simulator = able[number % len(able)]
            calibration_table.append(args.csv, COLUMNS, one(kind, number, planet, simulator, args))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--simulator", action="append", help=SIMULATOR)
    parser.add_argument("--search", help="dimcmc, or the example blind_search")
    parser.add_argument("--kind", action="append", choices=KINDS, help="of stars, all if not given")
    parser.add_argument("--stars", type=int, default=25, help="of each kind, without and with a planet each")
    parser.add_argument("--first", type=int, default=0, help="number of the first star, for a share of the work")
    parser.add_argument("--static", type=int, default=6, help="how many of these are searched by spottedness as well")
    parser.add_argument("--work", type=Path, default=Path("target/calibration-changing"), help="folder of the stars")
    parser.add_argument("--csv", type=Path, default=Path("results/calibration/changing.csv"))
    parser.add_argument("--moments", type=Path, default=Path("results/calibration/changing-moments.csv"))
    parser.add_argument("--table", action="store_true", help="write the tables of the lines so far")
    parser.add_argument("--out", type=Path, default=Path("results/calibration-changing.md"))
    args = parser.parse_args()
    if args.table:
        calibration_table.write(args.csv, args.moments, args.out)
    elif args.simulator and args.search:
        run(args)
    else:
        parser.error("--simulator and --search, or --table")
