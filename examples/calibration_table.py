"""The tables of `calibration_changing.py`, and how lines of calibrations are kept."""

import argparse
import csv
import math
from pathlib import Path

import numpy as np

# periods within this share of the rotation period, or of its half, are near co-rotation
NEAR = 0.15
# ranges of periods (rotations)
EDGES = (0.3, 0.45, 0.55, 0.85, 1.15, 2.0, 4.0, 8.0)
# a peak of a false-alarm probability below this is a planet
FOUND = 0.01
# a period is right within this share of the resolution, 1 over the time base of a season
RIGHT = 0.5
LEVELS = ((0.68, 0.99446), (0.95, 1.95996))
METHODS = {
    "changing": "evolving maps",
    "static": "spottedness (0.1.0)",
    "moments": "QP-GP on RVs",
    "moments_refit": "QP-GP, refitted with the orbit",
}


def read(path):
    """Lines of a table as dictionaries; none where there is no table."""
    if not path.exists():
        return []
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def resumed(path):
    """The lines of a table that is to be continued, without one that was being written when it was stopped."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.exists():
        whole = path.read_text()
        path.write_text(whole[: whole.rfind("\n") + 1])
    return read(path)


def append(path, columns, line):
    """One line more. Columns that a table of an earlier version lacks are added to it first, empty."""
    kept = read(path)
    head = list(kept[0]) if kept else []
    columns = [*head, *(name for name in columns if name not in head)]
    anew = columns != head
    with open(path, "w" if anew else "a", newline="") as file:
        writer = csv.DictWriter(file, columns, restval="", lineterminator="\n")
        if anew:
            writer.writeheader()
            writer.writerows(kept)
        writer.writerow({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in line.items()})


def command(doc, names, columns, one, table, options=()):
    """A calibration as a command: `one` makes the line of a star from its seed and the arguments, `table` the note of
    all lines. `names` are those of folder, table and note, and the number of stars; `options` further arguments of
    the parser, as a name and its help."""
    work, lines, note, stars = names
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", help="dimcmc")
    parser.add_argument("--first", type=int, default=1, help="first seed")
    parser.add_argument("--stars", type=int, default=stars)
    parser.add_argument("--work", type=Path, default=Path(work), help="folder of the stars")
    parser.add_argument("--csv", type=Path, default=Path(lines))
    parser.add_argument("--out", type=Path, default=Path(note))
    parser.add_argument("--table", action="store_true", help="write the table of the lines so far")
    for name, said in options:
        parser.add_argument(name, help=said)
    args = parser.parse_args()
    if args.table:
        table(args)
    elif args.program:
        args.program = str(Path(args.program).resolve())
        args.work.mkdir(parents=True, exist_ok=True)
        done = {row["seed"] for row in resumed(args.csv)}
        for seed in range(args.first, args.first + args.stars):
            if str(seed) not in done:
                append(args.csv, columns, one(seed, args))
    else:
        parser.error("--program, or --table")


def under_the_head(out, title, text):
    """Inserts tables under the hand-written head of a note, or below its title where there is none yet."""
    mark = "<!-- tables -->\n"
    note = out.read_text() if out.exists() else f"# {title}\n\n"
    out.write_text(f"{note.partition(mark)[0]}{mark}\n{text.rstrip()}\n")


def median_sigma(porb_over_prot, sigma_k_kms):
    """Median of sigma_K over periods of 0.5 to 4 rotations away from co-rotation."""
    inside = (porb_over_prot > 0.5) & (porb_over_prot < 4)
    away = (np.abs(porb_over_prot - 1) > NEAR) & (np.abs(2 * porb_over_prot - 1) > NEAR)
    return float(np.nanmedian(sigma_k_kms[inside & away]))


def season(times_d):
    """Time (d) from the first to the last profile of the longest season."""
    cuts = np.flatnonzero(np.diff(times_d) > 60) + 1
    return float(max(np.ptp(one) for one in np.split(times_d, cuts)))


def stars(path, moments):
    """All lines as numbers where they are numbers, those of the rival with `moments_` before their names."""
    rivals = {row["seed"]: row for row in read(moments)}
    rows = []
    for row in read(path):
        row |= {f"moments_{name}": value for name, value in rivals.get(row["seed"], {}).items()}
        rows.append({name: number(value) for name, value in row.items()})
    return rows


def number(text):
    try:
        return float(text)
    except ValueError:
        return text


def near(row):
    """Whether the true period is near co-rotation."""
    period = row["true_porb_over_prot"]
    return abs(period - 1) < NEAR or abs(2 * period - 1) < NEAR


def of(row, how, name):
    """A number of one of the methods; None where it is missing."""
    value = row.get(name if how == "changing" else f"{how}_{name}", "")
    return value if isinstance(value, float) else None


def has(rows, how):
    """Stars on which the method was tested."""
    return [row for row in rows if of(row, how, "false_alarm") is not None]


def found(row, how):
    return of(row, how, "false_alarm") < FOUND


def same(period_d, true_d, season_d):
    """Whether a period is the true one within the resolution of a season."""
    return abs(1 / period_d - 1 / true_d) < RIGHT / season_d


def right(row, how):
    """Whether the period found is the true one."""
    periods = (of(row, how, "porb_over_prot"), row["true_porb_over_prot"])
    return same(*(period * row["rotation_period_d"] for period in periods), row["season_d"])


def share(hits):
    """A fraction in per cent with its binomial error."""
    hits = [bool(hit) for hit in hits]
    if not hits:
        return "-"
    p, n = sum(hits) / len(hits), len(hits)
    return f"{100 * p:.0f} +- {100 * math.sqrt(p * (1 - p) / n):.0f}"


def kolmogorov_smirnov(values):
    """Distance from the uniform distribution, and the probability of a larger one by chance."""
    values, n = np.sort(values), len(values)
    steps = np.arange(n + 1) / n
    distance = float(max((steps[1:] - values).max(), (values - steps[:-1]).max()))
    z = distance * (math.sqrt(n) + 0.12 + 0.11 / math.sqrt(n))
    p = sum(2 * (-1) ** (k - 1) * math.exp(-2 * (k * z) ** 2) for k in range(1, 100))
    return distance, min(max(p, 0.0), 1.0)


def turned(row, name):
    """A phase minus the true one, within half a turn."""
    apart = row[name] - row["true_phi"]
    return apart - round(apart)


def groups(rows):
    """Names and stars: all, static and evolving ones, and each kind."""
    static = [row for row in rows if row["lifetime_d"] == math.inf]
    changing = [row for row in rows if row["lifetime_d"] != math.inf]
    kinds = dict.fromkeys(row["kind"] for row in rows)
    named = [({"for ever": "static"}.get(kind, kind), [row for row in rows if row["kind"] == kind]) for kind in kinds]
    return [("all", rows), ("static spots", static), ("evolving spots", changing), *named]


def table(head, rows):
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(map(str, line))} |\n" for line in lines) + "\n"


def false_alarms(rows):
    lines = []
    for how, title in METHODS.items():
        for name, group in groups(has(rows, how)):
            values = [of(row, how, "false_alarm") for row in group]
            if values:
                below = [share(value < level for value in values) for level in (0.01, 0.05, 0.1, 0.5)]
                p = kolmogorov_smirnov(values)[1]
                lines.append([title, name, len(values), f"{p:.2g}", f"{min(values):.1e}", *below])
    head = "method; stars; number; KS p; lowest; below 1 %; below 5 %; below 10 %; below 50 %"
    return table(head.split("; "), lines)


def inside(pulls):
    """Fractions of pulls inside 68 and 95 % of a normal distribution."""
    pulls = list(pulls)
    return [share(abs(pull) < bound for pull in pulls) for _, bound in LEVELS]


def at_true_period(rows, bare):
    """Stars without a planet, too: the parts of an orbit in phase with the true one, and across."""
    lines = []
    away = [row for row in rows if not near(row)]
    close = [row for row in rows if near(row)]
    for name, group in [*groups(away), ("all near co-rotation", close)]:
        planets = [row for row in group if row["planet"]]
        along = inside((row["along_kms"] - row["true_k_kms"]) / row["sigma_along_kms"] for row in group)
        across = inside(row["across_kms"] / row["sigma_across_kms"] for row in group)
        both = [share(row["chi2_orbit"] < -2 * math.log(1 - level) for row in group) for level, _ in LEVELS]
        if bare:
            lines.append([name, len(group), *along, *across, *both])
        else:
            k = inside((row["k_there_kms"] - row["true_k_kms"]) / row["sigma_k_there_kms"] for row in planets)
            phi = inside(turned(row, "phi_there") / row["sigma_phi_there"] for row in planets)
            lines.append([name, len(planets), *k, *phi])
    what = "in phase; across; both" if bare else "K; phi"
    head = [f"{one} {level} %" for one in what.split("; ") for level in (68, 95)]
    return table(["stars", "number", *head], lines)


def left_over(rows):
    """Mean squares of the residual velocities, with the error from the scatter between stars."""
    names = [name for name in rows[0] if name.startswith("chi2_") and name != "chi2_orbit"]
    lines = []
    for name, group in groups(rows):
        cells = []
        for column in names:
            values = [row[column] for row in group if row[column] != ""]
            error = np.std(values, ddof=1) / math.sqrt(len(values)) if len(values) > 1 else math.nan
            cells.append(f"{np.mean(values):.2f} +- {error:.2f}" if values else "-")
        lines.append([name, len(group), *cells])
    below = (0.0, *EDGES)
    ranges = [f"{low} to {high}" for low, high in zip(below, EDGES)]
    return table(["stars", "number", "all velocities", *ranges], lines)


def of_the_found(rows):
    """Intervals of planets found at the right period."""
    good = [row for row in rows if row["planet"] and found(row, "changing") and right(row, "changing")]
    away = [row for row in good if not near(row)]
    lines = []
    for name, group in [*groups(away), ("all near co-rotation", [row for row in good if near(row)])]:
        k = inside((row["k_kms"] - row["true_k_kms"]) / row["sigma_k_kms"] for row in group)
        period = ((row["porb_over_prot"] - row["true_porb_over_prot"]) / row["sigma_porb_over_prot"] for row in group)
        phi = inside(turned(row, "phi") / row["sigma_phi"] for row in group)
        lines.append([name, len(group), *k, *inside(period), *phi])
    head = [f"{one} {level} %" for one in ("K", "P", "phi") for level in (68, 95)]
    return table(["stars", "planets", *head], lines)


def planets_found(rows):
    lines = []
    for name, group in groups(rows):
        for how, title in METHODS.items():
            stars_tried = has(group, how)
            planets = [row for row in stars_tried if row["planet"]]
            if not planets:
                continue
            hits = [row for row in planets if found(row, how)]
            good = [row for row in hits if right(row, how)]
            sigma = [of(row, how, "median_sigma_k_kms") for row in stars_tried]
            sigma = [1000 * value for value in sigma if value is not None]
            middle = f"{np.median(sigma):.1f}" if sigma else "-"
            false = sum(found(row, how) for row in stars_tried if not row["planet"])
            none = sum(not row["planet"] for row in stars_tried)
            lines.append([name, title, middle, len(planets), len(good), len(hits) - len(good), f"{false} of {none}"])
    head = "stars; method; median sigma_K (m/s); planets; found at the right period; at another; found without planet"
    return table(head.split("; "), lines)


def fields(rows):
    lines = []
    for name, group in groups(rows)[3:]:
        middle = [np.median([row[key] for row in group]) for key in ("amplitude", "slope", "fitted_lifetime_d")]
        jitter = sum(row["jitter_kms"] > 0 for row in group)
        bounds = ", ".join(sorted({str(row["at_bounds"]) for row in group if row["at_bounds"]})) or "none"
        reached = sum(bool(row["at_bounds"]) for row in group)
        seconds = np.median([row["seconds"] for row in group])
        lines.append([name, *(f"{value:.3g}" for value in middle), jitter, reached, bounds, f"{seconds:.0f}"])
    head = "stars; amplitude; slope; lifetime (d); with jitter; at a bound; bounds; seconds"
    return table(head.split("; "), lines)


def those_that_are_off(rows):
    lines = []
    for row in rows:
        pull = (row["along_kms"] - row["true_k_kms"]) / row["sigma_along_kms"]
        across = row["across_kms"] / row["sigma_across_kms"]
        false = not row["planet"] and row["false_alarm"] < 1e-3
        if false or max(abs(pull), abs(across)) > 3:
            k, period = 1000 * row["true_k_kms"], row["true_porb_over_prot"]
            what = [row["kind"], f"{row['seed']:.0f}", f"{k:.0f}", f"{period:.3f}", f"{row['false_alarm']:.1e}"]
            lines.append([*what, f"{row['porb_over_prot']:.3f}", f"{pull:.1f}", f"{across:.1f}"])
    head = "stars; seed; K (m/s); Porb/Prot; FAP; Porb/Prot found; in phase (sigma); across (sigma)"
    return table(head.split("; "), lines) if lines else "None.\n\n"


def write(path, moments, out):
    """Puts the tables between the two marks of the note, or at its end."""
    rows = stars(path, moments)
    failed = [row for row in rows if row["error"]]
    rows = [row for row in rows if not row["error"]]
    without = [row for row in rows if not row["planet"]]
    text = f"{len(without)} stars without and {len(rows) - len(without)} with a planet; {len(failed)} failed.\n\n"
    sections = {
        "False alarms": false_alarms(without),
        "Orbits at the true period": at_true_period(rows, True),
        "Velocities left over, by period in rotations": left_over(rows),
        "K and phi at the true period": at_true_period(rows, False),
        "Planets found at the right period": of_the_found(rows),
        "Planets and errors": planets_found(rows),
        "Fields": fields(rows),
        "Stars that are off": those_that_are_off(rows),
    }
    text += "".join(f"### {title}\n\n{body}" for title, body in sections.items())
    note = out.read_text() if out.exists() else ""
    begin, end = "<!-- tables -->\n", "<!-- end of tables -->\n"
    before, _, rest = note.partition(begin)
    after = rest.partition(end)[2]
    out.write_text(f"{before}{begin}\n{text}{end}{after}")
