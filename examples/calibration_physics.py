"""Stars with physics that the model lacks: are false-alarm probabilities uniform, are planets detected?

    python3 examples/calibration_physics.py --program target/release/dimcmc --simulator stars.py
    python3 examples/calibration_physics.py --table

The simulator is an independent program, without a planet model or a kernel in common with `dimcmc`: `stars.py FOLDER
--seed N --effect NAME --k KMS` writes profiles, `observations.txt` and `truth.json`. Each star goes through
`dimcmc init`, which is told rotation period and inclination as an observer would know them, and `dimcmc periodogram`;
nothing else is set. Stars of no effect are searched twice more: with the jitter known to be 0, and with a local line
that is 40 % too wide and a vsini 1 km/s too large; stars with flares once more without them, by a copy of the simulator
that draws the flares and leaves them out, so that spots and noise are the same. One line per star goes to
results/calibration/physics.csv; the script can be stopped, and goes on. The first three seeds are the same stars
whatever the effect; from the fourth on each effect has other stars, except flares, which have those of none. The
second command writes results/real-stars.md. Needs numpy.
"""

import argparse
import json
import math
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np

import calibration_table

EFFECTS = (
    "none convective plage shear drift trend period inclination spotline macro limb gravity flare continuum "
    "correlated fast slow real"
).split()
PLANET_KMS = 0.15
# seeds whose stars are the same whatever the effect; beyond them, stars of these effects alone are
SHARED, COMPARED = 3, ("none", "flare")
# of caveats that are counted
OF_NIGHTS, NOT_NOISE = "offsets of nights", "inconsistent with noise"
# what stars without an effect are searched with, beside the config of `init`
SETTINGS = ("default", "stable", "wrong-line")
WIDER, FASTER_KMS = 1.4, 1.0
# stars with flares once more without them, and how the simulator puts flares into profiles
UNFLARED = "unflared"
FLARE = "d = d*(1 - R.uniform(.01, .04)) - R.uniform(.002, .006)*"
COLUMNS = (
    "effect seed planet setting true_porb_over_prot rotation_period_d profiles season_d lifetime_d finding "
    "false_alarm delta_ln_l period_d sigma_period_d k_kms sigma_k_kms share true_share median_sigma_k_kms "
    "spot_amplitude spot_slope spot_lifetime_d velocity_jitter_kms ln_evidence events star_gain chi2_per_datum "
    "ln_bayes held_out against warnings seconds error"
).split()


def simulated(effect, number):
    """The simulator's seed of a star: identical stars show the effect itself, others its rate of errors."""
    if number <= SHARED or effect in COMPARED:
        return number
    return number + 1000 * EFFECTS.index(effect)


def with_setting(config, setting):
    """The config of a setting, in place of that of `init`."""
    if setting == "stable":
        config["observations"]["velocity_jitter_kms"] = 0.0
    if setting == "wrong-line":
        config["star"]["line"]["sigma_kms"] *= WIDER
        config["star"]["vsini_kms"] += FASTER_KMS
    return config


def settings_of(effect):
    if effect == "none":
        return SETTINGS
    return ("default", UNFLARED) if effect == "flare" else ("default",)


def without_flares(args):
    """A copy of the simulator that draws flares without adding them to profiles: noise and spots are the same."""
    text = Path(args.simulator).read_text()
    if text.count(FLARE) != 1:
        sys.exit(f"{args.simulator}: flares are not found in it once, to leave them out: {FLARE}")
    copy = args.work / "without-flares.py"
    copy.write_text(text.replace(FLARE, "d = d*(1 - 0*R.uniform(.01, .04)) - 0*R.uniform(.002, .006)*"))
    return copy


def one(effect, number, planet, setting, args):
    k = PLANET_KMS if planet else 0.0
    folder = args.work / f"{effect}-{number}-{'planet' if planet else 'null'}"
    simulator = args.simulator
    if setting == UNFLARED:
        folder, simulator = folder.with_name(f"{folder.name}-{UNFLARED}"), without_flares(args)
    line = {"effect": effect, "seed": number, "planet": int(planet), "setting": setting}
    if not (folder / "truth.json").exists():
        simulator = [sys.executable, simulator, folder, "--seed", number, "--effect", effect, "--k", k]
        subprocess.run(list(map(str, simulator)), check=True)
    truth = json.loads((folder / "truth.json").read_text())
    line |= {"true_porb_over_prot": truth["porb_over_prot"], "lifetime_d": truth["lifetime"]}
    line["rotation_period_d"] = truth["prot"]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    try:
        if not (folder / "star.json").exists():
            known = ["--rotation-period", str(truth["prot_told"]), "--inclination", str(truth["inc_told"])]
            command = [args.program, "init", "observations.txt", *known, "--out", "star.json"]
            subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
        config = with_setting(json.loads((folder / "star.json").read_text()), setting)
        (folder / f"{setting}.json").write_text(json.dumps(config))
        command = [args.program, "periodogram", f"{setting}.json", "--out", setting, "--draws", "1000", "--force"]
        subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
        line |= results(folder / setting, truth)
    except subprocess.CalledProcessError as failure:
        line["error"] = failure.stderr.strip().splitlines()[-1]
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return line | {"seconds": after.ru_utime - before.ru_utime}


def results(out, truth):
    found = json.loads((out / "periodogram.json").read_text())
    verdict, best, field = found["verdict"], found["best"], found["field"]
    with open(out / "periodogram.csv") as file:
        names = file.readline().strip().split(",")
        columns = np.genfromtxt(file, delimiter=",").T
    searched = dict(zip(names, columns))
    line = {"profiles": truth["n"], "season_d": found["search"]["time_base_d"], "finding": verdict["finding"]}
    line |= {"false_alarm": found["false_alarm"]["probability"], "delta_ln_l": best["delta_ln_l"]}
    line |= {key: best[key] for key in ("period_d", "sigma_period_d", "k_kms", "sigma_k_kms")}
    line |= {key: field[key] for key in COLUMNS if key in field}
    shares = verdict.get("periods", [])
    line["share"] = max((each["share"] for each in shares), default=1.0)
    period_d = truth["porb_over_prot"] * truth["prot"]
    is_true = lambda one: calibration_table.same(one["period_d"], period_d, line["season_d"])
    line["true_share"] = sum(one["share"] for one in shares if is_true(one)) if shares else float(is_true(best))
    line["median_sigma_k_kms"] = calibration_table.median_sigma(searched["porb_over_prot"], searched["sigma_k_kms"])
    measured = found["measured"]
    events = (measured.get("events") or {}).get("profiles", [])
    line["events"] = " ".join(f"{each['profile']}x{each['sigma_factor']:.2g}" for each in events)
    line["star_gain"] = (measured.get("star") or {}).get("gain", 0.0)
    line["chi2_per_datum"] = found["expansion"]["chi2_per_datum"]
    if found.get("evidence"):
        line["ln_bayes"] = found["evidence"]["circle"]["ln_bayes"]
    if found["robustness"].get("held_out_nights"):
        line["held_out"] = found["robustness"]["held_out_nights"]["delta_ln_p"]
    return line | {"against": "; ".join(verdict["against"]), "warnings": "; ".join(found["warnings"])}


def run(args):
    args.work.mkdir(parents=True, exist_ok=True)
    done = {key(row) for row in calibration_table.resumed(args.csv)}
    for of_effect in range(args.first, args.first + args.seeds):
        for planet in (False,) if args.without_planets else (False, True):
            for effect in args.effects:
                number = simulated(effect, of_effect)
                for setting in settings_of(effect):
                    if (effect, str(number), str(int(planet)), setting) not in done:
                        calibration_table.append(args.csv, COLUMNS, one(effect, number, planet, setting, args))


def key(row):
    return tuple(row[name] for name in ("effect", "seed", "planet", "setting"))


def median(values):
    values = [value for value in values if value != ""]
    return float(np.median(values)) if values else math.nan


def is_right(row):
    """Whether the period is the true one."""
    truth_d = row["true_porb_over_prot"] * row["rotation_period_d"]
    return calibration_table.same(row["period_d"], truth_d, row["season_d"])


def ratios(rows, others):
    """Median sigma_K of each star over that of the star of the same seed among the others."""
    others = {(row["seed"], row["planet"]): row["median_sigma_k_kms"] for row in others}
    pairs = ((row["median_sigma_k_kms"], others.get((row["seed"], row["planet"]))) for row in rows)
    return [sigma / other for sigma, other in pairs if other]


def groups(rows):
    apart = list({row["seed"]: row for row in reversed(rows)}.values())
    of_each = ((effect, [row for row in rows if row["effect"] == effect]) for effect in EFFECTS)
    return [("all", rows), ("one per seed", apart), *of_each]


def false_alarms(rows):
    lines = []
    for name, group in groups(rows):
        if group:
            values = [row["false_alarm"] for row in group]
            below = [sum(value < level for value in values) for level in (0.01, 0.1, 0.5)]
            p = calibration_table.kolmogorov_smirnov(values)[1]
            said = [sum(words in row["against"] for row in group) for words in (OF_NIGHTS, NOT_NOISE)]
            lines.append([name, len(group), f"{min(values):.1e}", *below, f"{p:.2g}", *said])
    head = "effect; stars; lowest FAP; below 1 %; below 10 %; below 50 %; KS p"
    head += "; with the caveat of nights; residuals not like noise"
    return calibration_table.table(head.split("; "), lines)


def planets_found(planets, without, unflared):
    plain = [row for row in planets + without if row["effect"] == "none"]
    lines = []
    for name, group in groups(planets):
        if group:
            hits = [row for row in group if row["false_alarm"] < calibration_table.FOUND]
            right = sum(map(is_right, hits))
            ambiguous = sum(row["true_share"] > 0 and not is_right(row) for row in hits)
            alike = group + [row for row in without if name in ("all", "one per seed", row["effect"])]
            sigma = f"{1000 * median(row['median_sigma_k_kms'] for row in alike):.1f}"
            reference = unflared if name == "flare" else plain
            ratio = f"{median(ratios(alike, reference)):.2f}"
            seconds = f"{median(row['seconds'] for row in alike):.0f}"
            lines.append([name, len(group), right, ambiguous, len(hits) - right - ambiguous, sigma, ratio, seconds])
    head = "effect; planets; at the right period; at another, the right one named; at another; median sigma_K (m/s)"
    head += "; over that without the effect; processor seconds"
    return calibration_table.table(head.split("; "), lines)


def settings(rows):
    """Stars without an effect, searched with other settings."""
    plain = [row for row in rows if row["effect"] == "none"]
    default = [row for row in plain if row["setting"] == "default"]
    lines = []
    for setting in SETTINGS:
        of = [row for row in plain if row["setting"] == setting]
        ratio = ratios(of, default)
        if ratio:
            values = [row["false_alarm"] for row in of if not row["planet"]]
            right = [row for row in of if row["planet"] and is_right(row)]
            pulls = [(row["k_kms"] - PLANET_KMS) / row["sigma_k_kms"] for row in right]
            inside = [sum(abs(pull) < bound for pull in pulls) for bound in (1, 2)]
            spread = f"{min(ratio):.2f} to {max(ratio):.2f}"
            lowest = f"{min(values):.2g}" if values else "-"
            lines.append([setting, len(of), f"{np.median(ratio):.2f}", spread, lowest, len(right), *inside])
    head = "setting; stars; sigma_K over the default's (median); range; lowest FAP"
    head += "; highest peak at the right period (any FAP)"
    head += "; K within 1 sigma; within 2 sigma"
    return calibration_table.table(head.split("; "), lines)


def flares(rows):
    """sigma_K of stars with flares over that of the same stars without."""
    of_flares = [row for row in rows if row["effect"] == "flare"]
    pairs = lambda planet: [
        [row for row in of_flares if row["setting"] == setting and row["planet"] == planet]
        for setting in ("default", UNFLARED)
    ]
    lines = []
    for planet, title in enumerate(("without a planet", "with a planet of 150 m/s")):
        ratio = ratios(*pairs(planet))
        if ratio:
            over = sum(each > 1.1 for each in ratio)
            lines.append([title, len(ratio), f"{np.median(ratio):.2f}", f"{min(ratio):.2f} to {max(ratio):.2f}", over])
    head = "stars; number; sigma_K with flares over that without (median); range; more than 1.1"
    return calibration_table.table(head.split("; "), lines)


def table(args):
    number = calibration_table.number
    rows = [{name: number(value) for name, value in row.items()} for row in calibration_table.read(args.csv)]
    failed = [row for row in rows if row["error"] != ""]
    rows = [row for row in rows if row["error"] == ""]
    default = [row for row in rows if row["setting"] == "default"]
    without = [row for row in default if not row["planet"]]
    planets = [row for row in default if row["planet"]]
    unflared = [row for row in rows if row["setting"] == UNFLARED]
    text = f"{len(without)} stars without and {len(planets)} with a planet; {len(failed)} failed.\n\n"
    sections = {
        "Without a planet": false_alarms(without),
        "With a planet of 150 m/s": planets_found(planets, without, unflared),
        "Stars of no effect, searched otherwise": settings(rows),
        "Flares, and the same stars without": flares(rows),
    }
    text += "".join(f"### {title}\n\n{body}" for title, body in sections.items() if body.strip())
    text += "".join(f"- {row['effect']}, {row['seed']:.0f}: {row['error']}\n" for row in failed)
    calibration_table.under_the_head(args.out, "Stars by physics that the model does not have", text)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", help="dimcmc")
    parser.add_argument("--simulator", help="stars.py")
    parser.add_argument("--effects", nargs="+", default=EFFECTS)
    parser.add_argument("--first", type=int, default=1, help="first seed")
    parser.add_argument("--seeds", type=int, default=10, help="seeds per effect")
    parser.add_argument("--work", type=Path, default=Path("target/calibration-physics"), help="folder of the stars")
    parser.add_argument("--csv", type=Path, default=Path("results/calibration/physics.csv"))
    parser.add_argument("--out", type=Path, default=Path("results/real-stars.md"))
    parser.add_argument("--without-planets", action="store_true", help="only stars without a planet")
    parser.add_argument("--table", action="store_true", help="write the tables of the lines so far")
    args = parser.parse_args()
    if args.table:
        table(args)
    elif args.program and args.simulator:
        args.program, args.simulator = str(Path(args.program).resolve()), str(Path(args.simulator).resolve())
        run(args)
    else:
        parser.error("--program and --simulator, or --table")
