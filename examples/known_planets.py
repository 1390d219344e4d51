"""Two transiting planets of one star, and an unknown third: are their K right, is it detected?

    python3 examples/known_planets.py --program target/release/dimcmc
    python3 examples/known_planets.py --table

Each star has 14 spots with a penumbra that evolve, drawn as bright-and-dark pixels by `dimcmc simulate`, which shares
no field with the evolving maps that are fitted; two planets of 60 and 40 m/s on circular orbits of 3 to 12 d at random
phases; and some 40 profiles of 16 nights. `dimcmc init` is told rotation period and inclination. Its config gets both
ephemerides. `dimcmc periodogram` then measures K, and `dimcmc limits` the chance to detect a third planet of 100 m/s at
a period drawn for each star. `dimcmc inject` injects it, and another search tries to recover it. One line per star goes
to results/calibration/known-planets.csv; the script can be stopped and resumed. The second command writes
results/known-planets.md.

With `--simulator stars.py --csv results/calibration/known-planets-physics.csv` stars, spots, lines and the first planet
are those of a simulator that shares nothing with the program (`stars.py FOLDER --seed N --k KMS`); the second planet is
injected by `dimcmc inject`.
"""

import json
import math
import random
import subprocess
import sys
import textwrap
from pathlib import Path

import calibration_table

K_KMS = (0.06, 0.04)
THIRD_KMS = 0.1
PERIODS_D = (3.0, 12.0)
PROT_D, INCLINATION, FIRST_D = 2.741, 55.0, 2459002.0
EPHEMERIS_D = (0.0004, 0.002)
# of the other simulator
TIME_ZERO_D = 2459000.0
COLUMNS = (
    "seed period1_d period2_d k1_kms sigma_k1_kms k2_kms sigma_k2_kms false_alarm jitter_kms period3_d chance found "
    "found_at_d false_alarm3 error"
).split()


def star(rng, seed):
    """The config of a simulation, and its truth."""
    first = drawn(rng)
    second = first
    while not 1.4 < max(first, second) / min(first, second):
        second = drawn(rng)
    planets = sorted([first, second], key=lambda _: rng.random())
    times = [FIRST_D + period * rng.random() for period in planets]
    config = {
        "star": {
            "rotation_period_d": PROT_D,
            "epoch_d": FIRST_D,
            "inclination_deg": INCLINATION,
            "vsini_kms": 30.5,
            "vsys_kms": 0.35,
            "photosphere_k": 4250.0,
            "spot_k": 3450.0,
            "wavelength_nm": 640.0,
            "line": {"shape": "gaussian", "sigma_kms": 3.5, "equivalent_width_kms": 6.0},
        },
        "instrument": {"resolving_power": 65000.0},
        "planet": {
            "k_kms": K_KMS[0],
            "period_d": planets[0],
            "t_conjunction_d": times[0],
            "k2_kms": K_KMS[1],
            "period2_d": planets[1],
            "t_conjunction2_d": times[1],
        },
        "observations": {
            "simulate": {
                "random_spots": {"number": 14, "lifetime_d": 20, "seed": 1000 + seed},
                "schedule": {"nights": 16, "per_night": [2, 3], "night_hours": 8, "clouds": 0.1, "seed": seed},
                "velocity_kms": {"min": -45, "max": 45, "step": 1.8},
                "snr": 1500,
                "seed": seed,
            }
        },
    }
    return config, planets, times


def simulated(rng, seed, folder, run):
    """A star of `dimcmc simulate`: rotation period, inclination, periods and conjunctions."""
    config, planets, times = star(rng, seed)
    (folder / "simulation.json").write_text(json.dumps(config))
    run("simulate", "simulation.json", "--out", "data", "--force")
    return PROT_D, INCLINATION, planets, times


def of_others(rng, seed, folder, run, simulator):
    """A star of another simulator, which has the first planet; the second is injected."""
    words = [sys.executable, simulator, folder / "first", "--seed", seed, "--effect", "none", "--k", K_KMS[0]]
    subprocess.run(list(map(str, words)), check=True, capture_output=True)
    truth = json.loads((folder / "first" / "truth.json").read_text())
    prot, inclination = truth["prot"], truth["inc"]
    first = prot * truth["porb_over_prot"]
    second = first
    while abs(math.log(second / first)) < 0.35 or abs(math.log(second / prot)) < 0.25:
        second = drawn(rng)
    known = ("--rotation-period", prot, "--inclination", inclination)
    run("init", "first/observations.txt", *known, "--out", "first.json", "--force")
    phase, epoch_d = rng.random(), json.loads((folder / "first.json").read_text())["star"]["epoch_d"]
    orbit = ("--k-kms", K_KMS[1], "--porb-over-prot", second / prot, "--phi", phase)
    run("inject", "first.json", *orbit, "--out", "data", "--force")
    # a quarter of an orbit after the largest velocity
    times = [TIME_ZERO_D + first * (truth["phi"] + 0.25), epoch_d + second * (phase + 0.25)]
    return prot, inclination, [first, second], times


def drawn(rng):
    return PERIODS_D[0] * (PERIODS_D[1] / PERIODS_D[0]) ** rng.random()


def with_ephemerides(config, planets, times):
    parameters = config["parameters"]
    for key in ("porb_over_prot", "phi"):
        parameters.pop(key)
    for number, period, time in zip(("", "2"), planets, times):
        parameters[f"k{number}_kms"] = {"prior": "uniform", "min": 0.0, "max": 1.0}
        parameters[f"period{number}_d"] = {"prior": "normal", "mean": period, "sd": EPHEMERIS_D[0]}
        parameters[f"t_conjunction{number}_d"] = {"prior": "normal", "mean": time, "sd": EPHEMERIS_D[1]}
    config["planet"] = {"k_kms": 0.0, "k2_kms": 0.0}
    return config


def chance(folder, period_d):
    """Fraction of phases at which THIRD_KMS is recovered there, linear between the cells of `limits`."""
    rows = [line.split(",") for line in (folder / "limits.csv").read_text().split("\n") if line]
    names, rows = rows[0], [[float(cell) for cell in row] for row in rows[1:]]
    column = {name: [row[k] for row in rows] for k, name in enumerate(names)}
    near = min(column["period_d"], key=lambda each: abs(math.log(each / period_d)))
    cells = zip(column["period_d"], column["k_kms"], column["recovered"], column["phases"])
    curve = sorted((k, recovered / phases) for period, k, recovered, phases in cells if period == near)
    below = [(k, share) for k, share in curve if k <= THIRD_KMS]
    above = [(k, share) for k, share in curve if k > THIRD_KMS]
    if not below or not above:
        return (below or above)[-1 if below else 0][1]
    (low, at_low), (high, at_high) = below[-1], above[0]
    along = math.log(THIRD_KMS / low) / math.log(high / low)
    return at_low + along * (at_high - at_low)


def one(seed, args):
    rng = random.Random(seed)
    folder = args.work / str(seed)
    folder.mkdir(parents=True, exist_ok=True)
    line = {"seed": seed}

    def run(*words):
        subprocess.run([args.program, *map(str, words)], cwd=folder, check=True, capture_output=True, text=True)

    try:
        if args.simulator:
            prot, inclination, planets, times = of_others(rng, seed, folder, run, Path(args.simulator).resolve())
        else:
            prot, inclination, planets, times = simulated(rng, seed, folder, run)
        third_d, phase = math.nan, rng.random()
        # away from both planets and from the rotation
        near = lambda period: any(abs(math.log(period / other)) < 0.25 for other in (*planets, prot))
        while not third_d > 0.0 or near(third_d):
            third_d = drawn(rng)
        line |= {"period1_d": planets[0], "period2_d": planets[1], "period3_d": third_d}
        known = ("--rotation-period", prot, "--inclination", inclination)
        run("init", "data/observations.txt", *known, "--out", "star.json", "--force")
        config = with_ephemerides(json.loads((folder / "star.json").read_text()), planets, times)
        (folder / "known.json").write_text(json.dumps(config))
        run("periodogram", "known.json", "--out", "search", "--draws", 1000, "--force")
        found = json.loads((folder / "search" / "periodogram.json").read_text())
        for number, planet in enumerate(found["known_planets"], 1):
            line |= {f"{key[:-4]}{number}_kms": planet["orbit"][key] for key in ("k_kms", "sigma_k_kms")}
        line["false_alarm"] = found["false_alarm"]["probability"]
        line["jitter_kms"] = found["field"]["velocity_jitter_kms"]
        run("limits", "known.json", "--out", "limits", "--draws", 1000, "--force")
        line["chance"] = chance(folder / "limits", third_d)
        orbit = ("--k-kms", THIRD_KMS, "--porb-over-prot", third_d / prot, "--phi", phase)
        run("inject", "known.json", *orbit, "--out", "injected", "--force")
        injected = json.loads((folder / "injected" / "config.json").read_text())
        other = config | {"observations": injected["observations"]}
        (folder / "injected" / "known.json").write_text(json.dumps(other))
        run("periodogram", "injected/known.json", "--out", "third", "--draws", 1000, "--force")
        found = json.loads((folder / "third" / "periodogram.json").read_text())
        line |= {"false_alarm3": found["false_alarm"]["probability"], "found_at_d": found["peaks"][0]["period_d"]}
        right = calibration_table.same(line["found_at_d"], third_d, found["search"]["time_base_d"])
        line["found"] = int(right and line["false_alarm3"] < calibration_table.FOUND)
    except subprocess.CalledProcessError as failure:
        line["error"] = failure.stderr.strip().splitlines()[-1]
    return line


def table(args):
    lines, said, failed = [], [], []
    for name, path in (("dimcmc", args.csv), ("other", args.csv.with_stem(f"{args.csv.stem}-physics"))):
        read = calibration_table.read(path)
        rows = [{key: calibration_table.number(value) for key, value in row.items()} for row in read]
        good = [row for row in rows if row["error"] == ""]
        failed += [f"- {name}, {row['seed']:.0f}: {row['error']}\n" for row in rows if row["error"] != ""]
        if good:
            lines += [of_planet(name, number, k, good) for number, k in enumerate(K_KMS, 1)]
            said.append(of_third(name, good))
    head = "simulator; K (m/s); stars; within 68 %; within 95 %; mean pull; rms pull; median sigma_K (m/s)"
    said = "\n\n".join(textwrap.fill(each, 120) for each in said)
    text = f"{calibration_table.table(head.split('; '), lines).rstrip()}\n\n{said}\n" + "".join(failed)
    calibration_table.under_the_head(args.out, "Two transiting planets", text)


def of_planet(name, number, k, rows):
    pulls = [(row[f"k{number}_kms"] - k) / row[f"sigma_k{number}_kms"] for row in rows]
    inside = [sum(abs(pull) < bound for pull in pulls) for bound in (1.0, 1.96)]
    mean = sum(pulls) / len(pulls)
    scatter = math.sqrt(sum(pull * pull for pull in pulls) / len(pulls))
    sigma = sorted(row[f"sigma_k{number}_kms"] for row in rows)[len(rows) // 2]
    return [name, f"{1000 * k:.0f}", len(rows), *inside, f"{mean:.2f}", f"{scatter:.2f}", f"{1000 * sigma:.0f}"]


def of_third(name, rows):
    expected = sum(row["chance"] for row in rows)
    error = math.sqrt(sum(row["chance"] * (1.0 - row["chance"]) for row in rows))
    values = [row["false_alarm"] for row in rows]
    p = calibration_table.kolmogorov_smirnov(values)[1]
    return (
        f"Simulator {name}: a third planet of {1000 * THIRD_KMS:.0f} m/s, at periods away from those of both and from "
        f"the rotation, is found in {sum(row['found'] for row in rows):.0f} of {len(rows)} stars; `limits` expects "
        f"{expected:.1f} ± {error:.1f}. Without it the lowest FAP of the blind search is {min(values):.2g} (KS p = "
        f"{p:.2g})."
    )


if __name__ == "__main__":
    names = ("target/known-planets", "results/calibration/known-planets.csv", "results/known-planets.md", 40)
    calibration_table.command(__doc__, names, COLUMNS, one, table, [("--simulator", "stars.py")])
