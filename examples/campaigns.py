"""Published campaigns, simulated: would their planets be found if spots live 20, 60 or 200 d, and are false ones?

    python3 examples/campaigns.py --program target/release/dimcmc --search target/release/examples/blind_search
    python3 examples/campaigns.py --table

Stars like V830 Tau, TAP 26 and V889 Her take turns: each lifetime, without and with a planet. All stars of a campaign
have the same times, drawn once within the nights of the campaign; spots, noise and phase of the orbit are each star's.
Each is searched by evolving maps, by a static map (spottedness), and by a quasi-periodic Gaussian process on first
moments. `dimcmc plan` forecasts each campaign before the first star. One line per star goes to
results/calibration/campaigns.csv, forecasts to campaigns-plan.csv beside it; the script can be stopped at any time and
goes on where it was. The second command writes results/campaigns.md. Needs numpy, scipy, jax and tinygp; tables, numpy.
"""

import argparse
import itertools
import json
import math
import subprocess
import time
from pathlib import Path

import numpy as np

import calibration_changing
import calibration_table

# rotation period (d), vsini (km/s), inclination (deg), temperatures (K), wavelength (nm), period (d) and K (km/s) of
# the planet, and what stands under observations.simulate.schedule
STARS = {
    "V830 Tau": {"prot": 2.741, "vsini": 30.5, "inclination": 55.0, "spots": (4250.0, 3450.0, 640.0)}
    | {"porb": 4.93, "k": 0.07}
    | {"schedule": {"nights": 30, "seasons": 2, "season_spacing_d": 61.0, "per_night": [1, 2]}},
    "TAP 26": {"prot": 0.7135, "vsini": 68.0, "inclination": 55.0, "spots": (4600.0, 3600.0, 640.0)}
    | {"porb": 10.8, "k": 0.15, "schedule": {"on_nights": [*range(16), *range(59, 72)], "per_night": [1, 1]}},
    # no planet is known: schedule and planet are made up
    "V889 Her": {"prot": 1.337, "vsini": 38.5, "inclination": 60.0, "spots": (5750.0, 4250.0, 550.0)}
    | {"porb": 3.1, "k": 0.1, "schedule": {"nights": 12, "per_night": [3, 4]}},
}
LIFETIMES_D = (20, 60, 200)
# lifetime of a field of spots whose area grows and falls linearly
FIELD = 0.8
MOMENTS = "false_alarm k_kms sigma_k_kms porb_over_prot median_sigma_k_kms refit_false_alarm refit_porb_over_prot"
METHODS = ("changing", "static", "moments", "moments_refit")
COLUMNS = [name for name in calibration_changing.COLUMNS if name not in ("simulator", "error")]
COLUMNS += ["static_sigma_k_there_kms"]
COLUMNS += [f"moments_{name}" for name in (*MOMENTS.split(), "sigma_k_there_kms", "seconds")] + ["error"]
PLAN_COLUMNS = "kind lifetime_d profiles sigma_k_kms k50_kms k95_kms".split()


def star(name, lifetime, number, planet):
    """The star's line of the table before the search, and the simulator's options."""
    campaign = STARS[name]
    cell = 10 * list(STARS).index(name) + LIFETIMES_D.index(lifetime)
    seed = 2_000_000 + 10_000 * cell + 2 * number + planet
    period, phi = campaign["porb"] / campaign["prot"], float(np.random.default_rng(seed).random())
    margin, step = calibration_changing.MARGIN_KMS, calibration_changing.STEP_KMS
    options = {key: campaign[key] for key in ("prot", "vsini", "inclination")}
    options |= {"seed": seed, "lifetime": lifetime, "k": campaign["k"] if planet else 0.0, "porb-over-prot": period}
    options |= {"phi": phi, "bins": math.ceil(2 * (campaign["vsini"] + margin) / step) | 1}
    row = {"kind": name, "planet": planet, "seed": seed, "true_k_kms": options["k"], "true_porb_over_prot": period}
    row |= {"true_phi": phi, "rotation_period_d": options["prot"], "inclination_deg": options["inclination"]}
    return row | {"vsini_kms": options["vsini"], "lifetime_d": lifetime}, options


def config(name, options):
    """A config of `dimcmc simulate`, or `plan`, and its section observations.simulate."""
    found, simulated = calibration_changing.own(options)
    keys = ("photosphere_k", "spot_k", "wavelength_nm")
    found["star"] |= dict(zip(keys, STARS[name]["spots"]))
    found["parameters"]["porb_over_prot"]["max"] = 40.0
    simulated["schedule"] = STARS[name]["schedule"] | {"seed": 1}
    return found, simulated


def simulate(program, name, options, folder):
    """Profiles and config.json, star parameters at the truth but for the systemic velocity, which is free."""
    found, simulated = config(name, options)
    folder.mkdir(exist_ok=True)
    path = folder / "simulate.json"
    path.write_text(json.dumps(found | {"observations": {"simulate": simulated}}))
    subprocess.run([program, "simulate", path, "--out", folder, "--force"], check=True, capture_output=True, text=True)
    found["planet"]["k_kms"] = 0.0
    found["parameters"]["vsys_kms"] = {"prior": "uniform", "min": -1.0, "max": 1.0}
    (folder / "config.json").write_text(json.dumps(found | {"observations": {"path": "observations.txt"}}))


def by_moments(row, folder):
    """Result of a Gaussian process on first moments, and sigma_K at the planet's period."""
    import moments_gp

    moments_gp.MOST = 128
    began = time.monotonic()
    line = moments_gp.searched(row, folder)
    found, n = moments_gp.load(folder, row["rotation_period_d"])
    kernel = np.log([line[key] for key in ("amplitude_kms", "decay_d", "gamma", "jitter_kms")])
    frequency = 1 / (row["true_porb_over_prot"] * row["rotation_period_d"])
    white = moments_gp.whitening(kernel, found, n) @ moments_gp.columns(found, frequency)[0][:n]
    errors = np.linalg.inv(white.T @ white)
    line["sigma_k_there_kms"] = math.sqrt(0.5 * np.trace(errors[1:, 1:]))
    line["seconds"] = time.monotonic() - began
    return {f"moments_{key}": line[key] for key in (*MOMENTS.split(), "sigma_k_there_kms", "seconds")}


def one(name, lifetime, number, planet, args):
    row, options = star(name, lifetime, number, planet)
    folder = args.work / f"{name.replace(' ', '-')}-{lifetime}-{row['seed']}"
    try:
        if not (folder / "config.json").exists():
            simulate(args.program, name, options, folder)
        row = calibration_changing.searched(row, folder, args, number < args.static)
    except subprocess.CalledProcessError as failure:
        return row | {"error": failure.stderr.strip().splitlines()[-1]}
    if number < args.static:
        period_d = row["true_porb_over_prot"] * row["rotation_period_d"]
        errors = calibration_changing.at_period(folder / "static", period_d, row["true_phi"])[1]
        row["static_sigma_k_there_kms"] = math.sqrt(0.5 * np.trace(errors))
    return row | by_moments(row, folder)


def plan(name, lifetime, args):
    """Forecast of `dimcmc plan` at the planet's period, with the lifetime of the spots given."""
    found, simulated = config(name, star(name, lifetime, 0, 0)[1])
    for key in ("spots", "random_spots"):
        del simulated[key]
    found["observations"] = {"velocity_jitter_kms": 0.0, "simulate": simulated}
    found["parameters"] = {"vsys_kms": {"prior": "uniform", "min": -1.0, "max": 1.0}}
    found["imaging"] = {"objective": "marginal-likelihood", "spot_lifetime_d": FIELD * lifetime}
    folder = args.work / f"plan-{name.replace(' ', '-')}-{lifetime}"
    path = folder.with_suffix(".json")
    path.write_text(json.dumps(found))
    command = [args.program, "plan", path, "--out", folder, "--force"]
    subprocess.run(command, check=True, capture_output=True, text=True)
    periods = np.genfromtxt(folder / "plan.csv", delimiter=",", names=True)
    at = np.abs(1 / periods["period_d"] - 1 / STARS[name]["porb"]).argmin()
    profiles = json.loads((folder / "plan.json").read_text())["schedules"][0]["after"][-1]["profiles"]
    line = {"kind": name, "lifetime_d": lifetime, "profiles": profiles}
    return line | {key: float(periods[key][at]) for key in ("sigma_k_kms", "k50_kms", "k95_kms")}


def run(args):
    """Runs forecasts, then stars until there are enough, except those in the table."""
    args.work.mkdir(parents=True, exist_ok=True)
    planned = {(row["kind"], row["lifetime_d"]) for row in calibration_table.resumed(args.plan)}
    for lifetime, name in itertools.product(LIFETIMES_D, STARS):
        if (name, str(lifetime)) not in planned:
            calibration_table.append(args.plan, PLAN_COLUMNS, plan(name, lifetime, args))
    done = {row["seed"] for row in calibration_table.resumed(args.csv)}
    for number, planet, lifetime, name in itertools.product(range(args.stars), (0, 1), LIFETIMES_D, STARS):
        if str(star(name, lifetime, number, planet)[0]["seed"]) not in done:
            calibration_table.append(args.csv, COLUMNS, one(name, lifetime, number, planet, args))


def cells(rows):
    """Stars of each campaign and lifetime, of each campaign, and all."""
    for name in STARS:
        of = [row for row in rows if row["kind"] == name]
        for lifetime in LIFETIMES_D:
            yield name, f"{lifetime} d", [row for row in of if row["lifetime_d"] == lifetime]
        yield name, "all", of
    yield "all", "all", rows


def detections(rows):
    lines = []
    for name, lifetime, group in cells(rows):
        for how in METHODS:
            tried = calibration_table.has(group, how)
            if not tried:
                continue
            planets = [row for row in tried if row["planet"]]
            bare = [row for row in tried if not row["planet"]]
            hits = [row for row in planets if calibration_table.found(row, how)]
            good = [row for row in hits if calibration_table.right(row, how)]
            false = [calibration_table.found(row, how) for row in bare]
            line = [name, lifetime, calibration_table.METHODS[how]]
            for n, of in ((sum(false), len(bare)), (len(good), len(planets))):
                line += [f"{n} of {of}", share(n, of)]
            lines.append([*line, len(hits) - len(good)])
    head = "star; lifetime; method; found without a planet; per cent; found at its period; per cent; at another"
    return calibration_table.table(head.split("; "), lines)


def share(hits, of):
    """A fraction in per cent with its binomial error; where it is 0 or 1, the 68 % limit."""
    if not of:
        return "-"

    def digits(x):
        return f"{x:.0f}" if x >= 1 else f"{x:.1f}"

    if hits in (0, of):
        limit = 100 * (1 - 0.32 ** (1 / of))
        return f"below {digits(limit)}" if not hits else f"above {100 - limit:.0f}"
    p = hits / of
    return f"{digits(100 * p)} +- {digits(100 * math.sqrt(p * (1 - p) / of))}"


def sigma_there(row, how):
    """Error of K (m/s) at the planet's period, averaged over phases; None where the method was not tested."""
    if how == "changing":
        return 1000 * math.sqrt(0.5 * (row["sigma_along_kms"] ** 2 + row["sigma_across_kms"] ** 2))
    value = row[f"{how}_sigma_k_there_kms"]
    return 1000 * value if value != "" else None


def median(values):
    values = [value for value in values if value is not None]
    return f"{np.median(values):.1f}" if values else "-"


def forecasts(rows, planned):
    """Forecasts and achieved uncertainties, by evolving maps and by the others."""
    lines = []
    for name, lifetime, group in cells(rows):
        line = next((row for row in planned if (row["kind"], f"{row['lifetime_d']} d") == (name, lifetime)), None)
        if line is None:
            continue
        forecast = [f"{1000 * float(line[key]):.1f}" for key in ("sigma_k_kms", "k50_kms", "k95_kms")]
        planets = [row for row in group if row["planet"]]
        good = [row for row in planets if calibration_table.found(row, "changing")]
        good = sum(calibration_table.right(row, "changing") for row in good)
        chance = chance_of(STARS[name]["k"], float(line["k50_kms"]), float(line["k95_kms"]))
        achieved = [median(sigma_there(row, how) for row in group) for how in ("changing", "static", "moments")]
        ends = [f"{1000 * STARS[name]['k']:.0f}", chance, f"{good} of {len(planets)}"]
        lines.append([name, lifetime, forecast[0], *achieved, *forecast[1:], *ends])
    head = "star; lifetime; sigma_K forecast; evolving maps; static map; QP-GP; K 50 %; K 95 %; K of the planet; "
    return calibration_table.table((head + "chance forecast; found").split("; "), lines)


def chance_of(k, k50, k95):
    """Chance to detect K, from the two K that are detected with 50 and 95 %, as if detection had a Gaussian edge."""
    value = 0.5 * (1 + math.erf(1.645 * (k - k50) / (k95 - k50) / math.sqrt(2)))
    return "above 99 %" if value > 0.99 else f"{100 * value:.0f} %"


def intervals(rows):
    """Orbits at the true period, and fitted fields."""
    lines = []
    for name, lifetime, group in cells(rows):
        if not group:
            continue
        pulls = [(row["along_kms"] - row["true_k_kms"]) / row["sigma_along_kms"] for row in group]
        pulls += [row["across_kms"] / row["sigma_across_kms"] for row in group]
        inside = [sum(abs(pull) < bound for pull in pulls) for bound in (0.99446, 1.95996)]
        shares = [share(hits, len(pulls)) for hits in inside]
        velocities = np.mean([row["chi2_rv"] for row in group])
        middle = [np.median([row[key] for row in group]) for key in ("amplitude", "slope", "fitted_lifetime_d")]
        lines.append([name, lifetime, len(group), *shares, f"{velocities:.2f}", *(f"{value:.2g}" for value in middle)])
    head = "star; lifetime; stars; inside 68 %; inside 95 %; velocities; amplitude; slope; lifetime found (d)"
    return calibration_table.table(head.split("; "), lines)


def seconds(rows):
    lines = []
    for name in STARS:
        of = [row for row in rows if row["kind"] == name]
        times = [[row[f"{how}seconds"] for row in of] for how in ("", "static_", "moments_")]
        times = [median(value for value in each if value != "") for each in times]
        lines.append([name, median(row["profiles"] for row in of), *times])
    return calibration_table.table("star; profiles; evolving maps; static map; QP-GP".split("; "), lines)


def write(args):
    """The tables under the hand-written head of the note."""
    number = calibration_table.number
    rows = [{key: number(value) for key, value in row.items()} for row in calibration_table.read(args.csv)]
    failed = [row for row in rows if row["error"]]
    rows = [row for row in rows if not row["error"]]
    without = sum(not row["planet"] for row in rows)
    text = f"{without} stars without and {len(rows) - without} with a planet; {len(failed)} failed.\n\n"
    sections = {
        "Found": detections(rows),
        "Forecasts": forecasts(rows, calibration_table.read(args.plan)),
        "Orbits at the true period, and fields": intervals(rows),
        "Seconds": seconds(rows),
    }
    text += "".join(f"### {title}\n\n{body}" for title, body in sections.items())
    text += "".join(f"- {row['kind']}, {row['seed']:.0f}: {row['error']}\n" for row in failed)
    calibration_table.under_the_head(args.out, "Published campaigns, simulated", text)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", help="dimcmc, which simulates and forecasts")
    parser.add_argument("--search", help="dimcmc, or the example blind_search")
    parser.add_argument("--stars", type=int, default=50, help="of each kind, without and with a planet each")
    parser.add_argument("--static", type=int, default=50, help="how many of these are searched by spottedness as well")
    parser.add_argument("--work", type=Path, default=Path("target/campaigns"), help="folder of the stars")
    parser.add_argument("--csv", type=Path, default=Path("results/calibration/campaigns.csv"))
    parser.add_argument("--plan", type=Path, default=Path("results/calibration/campaigns-plan.csv"))
    parser.add_argument("--out", type=Path, default=Path("results/campaigns.md"))
    parser.add_argument("--table", action="store_true", help="write the tables of the lines so far")
    args = parser.parse_args()
    if args.table:
        write(args)
    elif args.program and args.search:
        run(args)
    else:
        parser.error("--program and --search, or --table")
