"""Rates of planets by `dimcmc survey`, checked on simulated samples of known rate (results/survey.md).

    python3 examples/survey_check.py --program target/release/dimcmc
    python3 examples/survey_check.py --write FOLDER

Running searches of thousands of stars would take weeks. What `survey` reads is simulated instead: for each star the
files of `dimcmc limits` and `dimcmc periodogram`, with detection limits that rise at the rotation period, at half of it
and beyond the time base. Nothing here is shared with the program. Each star gets

- fractions recovered: binomial counts of 12 phases at 40 periods and 20 K, by the chance of detection;
- with the rate of its sample a planet with P from 1 to 10 d and K from 0.05 to 1 km/s, evenly in both logarithms; of
  the others one in ten has a planet from 10 to 30 d, which is not to be counted;
- a search: Delta ln L of the planet is noncentral chi2 with one degree of freedom, so that planets just below the
  threshold are found at times and others are missed. Where none is found, one star in a hundred shows a false alarm,
  evenly in frequency.

The first command prints the table; the second writes one sample at a rate of 10 %, as in the figures of
docs/howto/survey.md. Rates are 0, 10 and 30 %, and drawn from the uniform prior, for which Bayesian intervals hold the
truth exactly as often as they claim. At one fixed rate they need not: numbers of signals are whole, so that intervals
hold it more or less often than that. How often is computed here for a binomial with the true mean completeness, and
given beside the claim.
"""

import argparse
import functools
import hashlib
import json
import math
import random
import statistics
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

HOT_D, COOL_D = (1.0, 10.0), (10.0, 30.0)
K_KMS = (0.05, 1.0)
SEARCHED_D = (0.5, 30.0)
PERIODS, AMPLITUDES, PHASES = 40, 20, 12
FAP, COOL_RATE = 0.01, 0.1


def even(low, high, count):
    """Numbers evenly spaced in their logarithm."""
    return [low * (high / low) ** (k / (count - 1)) for k in range(count)]


def log_uniform(rng, low, high):
    return low * (high / low) ** rng.random()


def above(z):
    """Probability of a standard normal deviate above z."""
    return 0.5 * math.erfc(z / math.sqrt(2.0))


class Star:
    def __init__(self, rng):
        self.rotation_d = log_uniform(rng, 1.0, 8.0)
        self.time_base_d = rng.uniform(8.0, 25.0)
        self.level = rng.uniform(7.0, 10.0)
        self.floor_kms = math.exp(rng.gauss(math.log(0.1), 0.5))

    def k50_kms(self, period_d):
        """K whose Delta ln L is the threshold without noise."""
        def spots(harmonic, height):
            return height * math.exp(-((math.log(period_d / self.rotation_d * harmonic) / 0.08) ** 2))

        return self.floor_kms * (1.0 + spots(1, 6.0) + spots(2, 2.0)) * max(1.0, period_d / self.time_base_d) ** 1.5

    def sigma_kms(self, period_d):
        """Standard deviation of K: Delta ln L is half the square of K over it."""
        return self.k50_kms(period_d) / math.sqrt(2.0 * self.level)

    def chance(self, period_d, k_kms):
        """Probability that a planet is found."""
        threshold, mean = math.sqrt(2.0 * self.level), k_kms / self.sigma_kms(period_d)
        return above(threshold - mean) + above(threshold + mean)

    def completeness(self):
        """Mean of that over the box."""
        steps = [(k + 0.5) / 15 for k in range(15)]
        periods, amplitudes = ([low * (high / low) ** x for x in steps] for low, high in (HOT_D, K_KMS))
        return sum(self.chance(p, k) for p in periods for k in amplitudes) / 225

    def search(self, rng, planet):
        """Period, K and FAP of the highest peak."""
        if planet is not None:
            period_d, k_kms = planet
            z = abs(k_kms / self.sigma_kms(period_d) + rng.gauss(0.0, 1.0))
            if 0.5 * z * z > self.level:
                return period_d, z * self.sigma_kms(period_d), FAP * math.exp(self.level - 0.5 * z * z)
        low, high = 1.0 / SEARCHED_D[1], 1.0 / SEARCHED_D[0]
        period_d, p = 1.0 / rng.uniform(low, high), rng.random()
        delta = max(self.level + math.log(FAP / max(p, 1e-12)), 1.0)
        return period_d, math.sqrt(2.0 * delta) * self.sigma_kms(period_d), p

    def write(self, rng, folder, name, planet):
        folder.mkdir(parents=True)
        periods = even(*SEARCHED_D, PERIODS)
        lowest = min(self.k50_kms(p) for p in periods)
        amplitudes = even(lowest / 3.0, 15.0 * lowest, AMPLITUDES)
        period_d, k_kms, p = self.search(rng, planet)
        own = {
            "version": "simulated",
            "config": {"star": {"name": name, "rotation_period_d": self.rotation_d}},
            "config_sha256": "0" * 64,
            "data_sha256": hashlib.sha256(f"{name} {rng.random()}".encode()).hexdigest(),
        }
        finding = "detection" if p < 1e-3 else "candidate" if p < FAP else "no-planet-needed"
        signal = {"period_d": period_d, "sigma_period_d": None, "k_kms": k_kms, "sigma_k_kms": self.sigma_kms(period_d)}
        verdict = {"finding": finding, "sentence": "", "false_alarm_probability": p, "signal": signal, "against": []}
        before = {"period_d": period_d, "delta_ln_l": self.level, "false_alarm_probability": p}
        limits = [
            {"period_d": p, "porb_over_prot": p / self.rotation_d, "k50_kms": self.k50_kms(p), "k95_kms": None}
            for p in periods
        ]
        file = {
            "false_alarm_probability": FAP,
            "level": self.level,
            "removed": None,
            "before": before,
            "after": None,
            "k_kms": amplitudes,
            "phases": PHASES,
            "limits": limits,
            "agreement": None,
            "comparisons": [],
            "warnings": [],
        }
        (folder / "periodogram.json").write_text(json.dumps({"verdict": verdict, **own}))
        (folder / "limits.json").write_text(json.dumps({**file, **own}))
        with open(folder / "limits.csv", "w") as table:
            table.write("period_d,porb_over_prot,k_kms,phases,detected,recovered\n")
            for period in periods:
                for k in amplitudes:
                    chance = self.chance(period, k)
                    found = sum(rng.random() < chance for _ in range(PHASES)) if 1e-6 < chance < 1 - 1e-6 else (
                        PHASES if chance > 0.5 else 0
                    )
                    table.write(f"{period},{period / self.rotation_d},{k},{PHASES},{found},{found}\n")


def write_sample(rng, folder, stars, rate):
    """A sample of stars, each with a folder of its results; their true mean completeness."""
    whole = 0.0
    for k in range(stars):
        planet = None
        if rng.random() < rate:
            planet = log_uniform(rng, *HOT_D), log_uniform(rng, *K_KMS)
        elif rng.random() < COOL_RATE:
            planet = log_uniform(rng, *COOL_D), log_uniform(rng, *K_KMS)
        star = Star(rng)
        star.write(rng, folder / f"star_{k + 1:02}", f"Star {k + 1}", planet)
        whole += star.completeness()
    return whole / stars


def sample(options, number, rate):
    """The rate of one sample by the program, with the true one."""
    rng = random.Random(f"{options.seed} {number} {rate}")
    truth = rng.random() if rate is None else rate
    with tempfile.TemporaryDirectory() as folder:
        stars = Path(folder) / "stars"
        completeness = write_sample(rng, stars, options.stars, truth)
        out = Path(folder) / "survey"
        box = f"{HOT_D[0]}:{HOT_D[1]},{K_KMS[0]}:{K_KMS[1]}"
        command = [options.program, "survey", str(stars), "--box", box, "--out", str(out)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        return truth, completeness, json.loads((out / "survey.json").read_text())["rates"][0]


@functools.cache
def coverage(stars, completeness, rate, share):
    """How often intervals hold the rate where every star has this completeness and all signals are planets."""
    rates = [k / 1000 for k in range(1001)]
    covered = 0.0
    for found in range(stars + 1):
        # likelihood over its highest, at the share found
        peak = min(found / stars / completeness, 1.0) * completeness

        def likelihood(q):
            ln = (found * math.log(q / peak) if found else 0.0) + (stars - found) * math.log((1 - q) / (1 - peak))
            return math.exp(ln)

        heights = [likelihood(f * completeness) if f > 0 or not found else 0.0 for f in rates]
        here = likelihood(rate * completeness) if rate > 0 or not found else 0.0
        # the rate is inside unless higher likelihoods hold so much of the posterior
        if sum(height for height in heights if height > here) < share * sum(heights):
            q = rate * completeness
            covered += math.comb(stars, found) * q**found * (1 - q) ** (stars - found)
    return covered


def row(options, rate, found):
    count = len(found)
    cells = ["drawn from the prior" if rate is None else f"{100 * rate:.0f} %"]
    for key, share in (("ci68", 0.68), ("ci95", 0.95)):
        inside = sum(of[key][0] <= truth <= of[key][1] for truth, _, of in found)
        shares = [share if rate is None else coverage(options.stars, round(c, 2), rate, share) for _, c, _ in found]
        sd = math.sqrt(sum(p * (1.0 - p) for p in shares))
        cells += [str(inside), f"{share * count:.1f}", f"{sum(shares):.1f} ± {sd:.1f}"]
    errors = [100 * (of["most_likely"] - truth) for truth, _, of in found]
    cells.append(f"{statistics.mean(errors):+.1f} ± {statistics.stdev(errors) / math.sqrt(count):.1f}")
    for key, digits in (("effective_stars", 1), ("detections", 2), ("false_alarms", 2)):
        cells.append(f"{statistics.mean(of[key] for _, _, of in found):.{digits}f}")
    print("| " + " | ".join(cells) + " |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=60)
    parser.add_argument("--stars", type=int, default=30)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--program", default="target/release/dimcmc")
    parser.add_argument("--write", type=Path)
    options = parser.parse_args()
    if options.write is not None:
        write_sample(random.Random(options.seed), options.write, options.stars, 0.1)
        return
    inside = " | ".join(f"in {share} % | nominal | of a binomial" for share in (68, 95))
    print(f"| true rate | {inside} | most likely - true (%) | effective stars | signals | false positives |")
    print("|---" * 11 + "|")
    with ThreadPoolExecutor(2) as pool:
        for rate in (0.0, 0.1, 0.3, None):
            jobs = [pool.submit(sample, options, number, rate) for number in range(options.samples)]
            row(options, rate, [job.result() for job in jobs])


if __name__ == "__main__":
    sys.exit(main())
