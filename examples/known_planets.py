"""Two transiting planets of one star, and a third that nobody knows of: are their K right, is it found?

    python3 examples/known_planets.py --program target/release/dimcmc
    python3 examples/known_planets.py --table

Each star has 14 spots with a penumbra that evolve, drawn as bright-and-dark pixels by `dimcmc simulate`, which shares
no field with the evolving maps that are fitted; two planets of 60 and 40 m/s on circular orbits of 3 to 12 d at random
phases; and some 40 profiles of 16 nights. `dimcmc init` is told rotation period and inclination. Its config gets both
ephemerides. `dimcmc periodogram` then says what K is, and `dimcmc limits` how often a third planet of 100 m/s would be
found at a period drawn for each star. `dimcmc inject` puts it in, and another search looks for it. One line per star
goes to results/calibration/known-planets.csv; the script can be stopped, and goes on. The second command writes
results/known-planets.md.
"""

import argparse
import json
import math
import random
import subprocess
import textwrap
from pathlib import Path

import calibration_table

K_KMS = (0.06, 0.04)
THIRD_KMS = 0.1
PERIODS_D = (3.0, 12.0)
PROT_D, INCLINATION, FIRST_D = 2.741, 55.0, 2459002.0
EPHEMERIS_D = (0.0004, 0.002)
COLUMNS = (
    "seed period1_d period2_d k1_kms sigma_k1_kms k2_kms sigma_k2_kms false_alarm jitter_kms period3_d chance found "
    "found_at_d false_alarm3 error"
).split()


def star(rng, seed):
    """The config of a simulation, and what there is to find."""
    first = PERIODS_D[0] * (PERIODS_D[1] / PERIODS_D[0]) ** rng.random()
    second = first
    while not 1.4 < max(first, second) / min(first, second):
        second = PERIODS_D[0] * (PERIODS_D[1] / PERIODS_D[0]) ** rng.random()
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
    """Share of phases at which THIRD_KMS is recovered there, linear between the cells of `limits`."""
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

    config, planets, times = star(rng, seed)
    third_d, phase = math.nan, rng.random()
    # away from both planets and from the rotation
    near = lambda period: any(abs(math.log(period / other)) < 0.25 for other in (*planets, PROT_D))
    while not third_d > 0.0 or near(third_d):
        third_d = PERIODS_D[0] * (PERIODS_D[1] / PERIODS_D[0]) ** rng.random()
    line |= {"period1_d": planets[0], "period2_d": planets[1], "period3_d": third_d}
    try:
        (folder / "simulation.json").write_text(json.dumps(config))
        run("simulate", "simulation.json", "--out", "data", "--force")
        known = ("--rotation-period", PROT_D, "--inclination", INCLINATION)
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
        orbit = ("--k-kms", THIRD_KMS, "--porb-over-prot", third_d / PROT_D, "--phi", phase)
        run("inject", "known.json", *orbit, "--out", "injected", "--force")
        other = with_data_of(config, json.loads((folder / "injected" / "config.json").read_text()))
        (folder / "injected" / "known.json").write_text(json.dumps(other))
        run("periodogram", "injected/known.json", "--out", "third", "--draws", 1000, "--force")
        found = json.loads((folder / "third" / "periodogram.json").read_text())
        line |= {"false_alarm3": found["false_alarm"]["probability"], "found_at_d": found["peaks"][0]["period_d"]}
        right = calibration_table.same(line["found_at_d"], third_d, found["search"]["time_base_d"])
        line["found"] = int(right and line["false_alarm3"] < calibration_table.FOUND)
    except subprocess.CalledProcessError as failure:
        line["error"] = failure.stderr.strip().splitlines()[-1]
    return line


def with_data_of(config, injected):
    return config | {"observations": injected["observations"]}


def table(args):
    rows = [
        {name: calibration_table.number(value) for name, value in row.items()}
        for row in calibration_table.read(args.csv)
    ]
    good = [row for row in rows if row["error"] == ""]
    lines = []
    for number, k in enumerate(K_KMS, 1):
        pulls = [(row[f"k{number}_kms"] - k) / row[f"sigma_k{number}_kms"] for row in good]
        inside = [sum(abs(pull) < bound for pull in pulls) for bound in (1.0, 1.96)]
        mean = sum(pulls) / len(pulls)
        scatter = math.sqrt(sum(pull * pull for pull in pulls) / len(pulls))
        sigma = sorted(row[f"sigma_k{number}_kms"] for row in good)[len(good) // 2]
        lines.append([f"{1000 * k:.0f}", len(good), *inside, f"{mean:.2f}", f"{scatter:.2f}", f"{1000 * sigma:.0f}"])
    head = "K (m/s); stars; within 68 %; within 95 %; mean pull; rms pull; median sigma_K (m/s)"
    expected = sum(row["chance"] for row in good)
    error = math.sqrt(sum(row["chance"] * (1.0 - row["chance"]) for row in good))
    values = [row["false_alarm"] for row in good]
    p = calibration_table.kolmogorov_smirnov(values)[1]
    said = (
        f"A third planet of {1000 * THIRD_KMS:.0f} m/s, at periods away from those of both and from the rotation, is "
        f"found in {sum(row['found'] for row in good):.0f} of {len(good)} stars; `limits` expects {expected:.1f} ± "
        f"{error:.1f}. Without it the lowest FAP of the blind search is {min(values):.2g} (KS p = {p:.2g})."
    )
    text = f"{calibration_table.table(head.split('; '), lines).rstrip()}\n\n{textwrap.fill(said, 120)}\n"
    text += "".join(f"- {row['seed']:.0f}: {row['error']}\n" for row in rows if row["error"] != "")
    calibration_table.under_the_head(args.out, "Two transiting planets", text)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", help="dimcmc")
    parser.add_argument("--first", type=int, default=1, help="first seed")
    parser.add_argument("--stars", type=int, default=40)
    parser.add_argument("--work", type=Path, default=Path("target/known-planets"), help="folder of the stars")
    parser.add_argument("--csv", type=Path, default=Path("results/calibration/known-planets.csv"))
    parser.add_argument("--out", type=Path, default=Path("results/known-planets.md"))
    parser.add_argument("--table", action="store_true", help="write the table of the lines so far")
    args = parser.parse_args()
    if args.table:
        table(args)
    elif args.program:
        args.program = str(Path(args.program).resolve())
        args.work.mkdir(parents=True, exist_ok=True)
        done = {row["seed"] for row in calibration_table.resumed(args.csv)}
        for seed in range(args.first, args.first + args.stars):
            if str(seed) not in done:
                calibration_table.append(args.csv, COLUMNS, one(seed, args))
    else:
        parser.error("--program, or --table")
