"""Are the nights that `plan --next` chooses better than others?

    python3 examples/next_nights.py --program target/release/dimcmc
    python3 examples/next_nights.py --program target/release/dimcmc --sets 2 --stars 8
    python3 examples/next_nights.py --table

Each star has 14 evolving spots, drawn as pixels by `dimcmc simulate`, and no planet. Eight nights are taken, 14 may
follow, with one to four profiles each. `dimcmc plan --next 6` knows the profiles that are taken and the times of the
others; it chooses for a planet of a period drawn for each star. Then the profiles of the nights it chose, of six evenly
spaced and of six random ones are searched by `dimcmc periodogram` with those taken before, and sigma_K at that period
is compared. With `--sets 2` nights are those of two spectrographs (six each are taken, eight may follow), the second
with a lower resolution and S/N and an RV offset, and photometry goes on from the first night to the last. One line per
star goes to results/calibration/next-nights.csv, or next-nights-sets.csv; the last command writes the tables at the end
of results/plan.md.
"""

import json
import math
import random
import subprocess
import textwrap
from pathlib import Path

import calibration_table

PROT_D, INCLINATION, FIRST_D = 2.741, 55.0, 2459002.0
TAKEN, CANDIDATES, CHOSEN = 8, 14, 6
PERIODS_D = (3.0, 12.0)
WAYS = ("chosen", "even", "random")
NAMES = ("first", "second")
OF_EACH = (6, 8)
LIGHT = {"cadence_d": 0.2, "sigma": 5e-4}
SETS_CSV = Path("results/calibration/next-nights-sets.csv")
COLUMNS = "seed period_d forecast_now forecast chosen even random error".split()


def simulation(seed, sets):
    config = {
        "star": {
            "rotation_period_d": PROT_D,
            "epoch_d": FIRST_D,
            "inclination_deg": INCLINATION,
            "vsini_kms": 30.5,
            "photosphere_k": 4250.0,
            "spot_k": 3450.0,
            "wavelength_nm": 640.0,
            "line": {"shape": "gaussian", "sigma_kms": 3.5, "equivalent_width_kms": 6.0},
        },
        "instrument": {"resolving_power": 65000.0},
        "observations": {
            "simulate": {
                "random_spots": {"number": 14, "lifetime_d": 20, "seed": 2000 + seed},
                "schedule": {"nights": TAKEN + CANDIDATES, "per_night": [1, 4], "night_hours": 8, "seed": seed},
                "velocity_kms": {"min": -45, "max": 45, "step": 1.8},
                "snr": 1500,
                "seed": seed,
            }
        },
    }
    if sets == 2:
        first = config["observations"] | {"name": NAMES[0]}
        first["simulate"]["schedule"]["nights"] = sum(OF_EACH)
        other = {"snr": 800, "seed": 5000 + seed, "zero_point_kms": 0.15}
        simulate = first["simulate"] | other | {"velocity_kms": {"min": -45, "max": 45, "step": 2.5}}
        simulate["schedule"] = simulate["schedule"] | {"seed": 5000 + seed}
        del simulate["random_spots"]
        config["observations"] = [first, {"name": NAMES[1], "resolving_power": 40000, "simulate": simulate}]
        config["photometry"] = {"simulate": LIGHT}
    return config


def one(seed, args):
    rng = random.Random(seed)
    folder = args.work / str(seed)
    folder.mkdir(parents=True, exist_ok=True)
    period_d = PERIODS_D[0] * (PERIODS_D[1] / PERIODS_D[0]) ** rng.random()
    line = {"seed": seed, "period_d": period_d}

    def run(*words):
        subprocess.run([args.program, *map(str, words)], cwd=folder, check=True, capture_output=True, text=True)

    sets = int(args.sets or 1)
    names = NAMES if sets == 2 else ("",)

    def rows(name):
        return [text for text in (folder / name).read_text().split("\n") if text and not text.startswith("#")]

    def listed(name, nights):
        """The lists of all data sets, of nights that are (set, lines)."""
        for s, of in enumerate(names):
            lines = [text for night in nights if night[0] == s for text in night[1]]
            (folder / "data" / of / name).write_text("".join(f"{text}\n" for text in lines))
        return [str(Path("data") / of / name) for of in names]

    begin = lambda night: min(float(text.split()[1]) for text in night[1])
    try:
        (folder / "simulation.json").write_text(json.dumps(simulation(seed, sets)))
        run("simulate", "simulation.json", "--out", "data", "--force")
        taken, later = [], []
        for s, of in enumerate(names):
            nights = {}
            for text in rows(Path("data") / of / "observations.txt"):
                nights.setdefault(math.floor(float(text.split()[1]) - FIRST_D), []).append(text)
            nights = [(s, nights[number]) for number in sorted(nights)]
            count = TAKEN if sets == 1 else OF_EACH[0]
            taken, later = taken + nights[:count], later + nights[count:]
        later.sort(key=begin)
        known = ["--rotation-period", PROT_D, "--inclination", INCLINATION]
        if sets == 2:
            head, *light = rows("data/photometry.csv")
            light = [text for text in light if float(text.split(",")[0]) < begin(later[0])]
            (folder / "data" / "taken.csv").write_text("\n".join([head, *light]) + "\n")
            known += ["--photometry", "data/taken.csv", "--resolving-power", "65000,40000"]
        run("init", *listed("taken.txt", taken), *known, "--out", "star.json", "--force")
        config = json.loads((folder / "star.json").read_text())
        plans = []
        for s, of in enumerate(names):
            plans.append({"times_d": [float(text.split()[1]) for night in later if night[0] == s for text in night[1]]})
            if sets == 2:
                plans[s]["set"] = config["observations"][s]["name"]
                plans[s]["snr"] = (1500, 800)[s]
        plans[-1] |= {"photometry": LIGHT} if sets == 2 else {}
        (folder / "plan.json").write_text(json.dumps(config | {"plan": plans if sets == 2 else plans[0]}))
        run("plan", "plan.json", "--next", CHOSEN, "--period-d", period_d, "--draws", 1000, "--out", "plan", "--force")
        forecast = json.loads((folder / "plan" / "plan.json").read_text())["schedules"][0]["next"]
        line["forecast_now"] = forecast["now"]["sigma_k_kms"]
        line["forecast"] = forecast["chosen"][-1]["sigma_k_kms"]
        begins = [(night.get("set"), night["span_d"][0]) for night in forecast["chosen"]]
        name = lambda night: plans[night[0]].get("set")
        is_chosen = lambda night: any(name(night) == of and abs(begin(night) - time) < 1e-6 for of, time in begins)
        count = len(later)
        ways = {
            "chosen": [night for night in later if is_chosen(night)],
            "even": [later[(2 * k + 1) * count // (2 * CHOSEN)] for k in range(CHOSEN)],
            "random": rng.sample(later, CHOSEN),
        }
        for way, nights in ways.items():
            assert len(nights) == CHOSEN
            paths = listed(f"{way}.txt", taken + nights)
            if sets == 2:
                for section, path in zip(config["observations"], paths):
                    section["path"] = path
                config["photometry"]["path"] = "data/photometry.csv"
            else:
                config["observations"]["path"] = paths[0]
            (folder / f"{way}.json").write_text(json.dumps(config))
            run("periodogram", f"{way}.json", "--draws", 1000, "--out", way, "--force")
            table = [row.split(",") for row in (folder / way / "periodogram.csv").read_text().split("\n") if row]
            at, sigma = (table[0].index(name) for name in ("period_d", "sigma_k_kms"))
            nearest = min(table[1:], key=lambda row: abs(math.log(float(row[at]) / period_d)))
            line[way] = float(nearest[sigma])
    except subprocess.CalledProcessError as failure:
        line["error"] = failure.stderr.strip().splitlines()[-1]
    return line


def table(args):
    text = compared(args.csv)
    if SETS_CSV.exists():
        said = "Two spectrographs (S/N 1500 and 800, resolving power 65000 and 40000, RV offset fitted) and photometry:"
        text += f"\n{said}\n\n{compared(SETS_CSV)}"
    calibration_table.under_the_head(args.out, "Plans", text)


def compared(path):
    number = calibration_table.number
    rows = [{name: number(value) for name, value in row.items()} for row in calibration_table.read(path)]
    good = [row for row in rows if row["error"] == ""]
    median = lambda values: sorted(values)[len(values) // 2]
    lines = []
    for way in WAYS:
        sigma = f"{1000 * median([row[way] for row in good]):.1f}"
        ratio = f"{median([row[way] / row['chosen'] for row in good]):.2f}"
        beaten = "" if way == "chosen" else sum(row["chosen"] < row[way] for row in good)
        lines.append([way, sigma, ratio, beaten])
    head = "six nights; median sigma_K (m/s); over that of the chosen; stars on which the chosen are better"
    best = sum(row["chosen"] < min(row["even"], row["random"]) for row in good)
    ratio = median([row["chosen"] / row["forecast"] for row in good])
    said = (
        f"On {best} of {len(good)} stars the nights chosen give a smaller sigma_K than both others. What is achieved "
        f"is {ratio:.2f} of the forecast (median)."
    )
    text = f"{calibration_table.table(head.split('; '), lines).rstrip()}\n\n{textwrap.fill(said, 120)}\n"
    return text + "".join(f"- {row['seed']:.0f}: {row['error']}\n" for row in rows if row["error"] != "")


if __name__ == "__main__":
    names = ("target/next-nights", "results/calibration/next-nights.csv", "results/plan.md", 30)
    options = (("--sets", "2 for two spectrographs and a light curve"),)
    calibration_table.command(__doc__, names, COLUMNS, one, table, options)
