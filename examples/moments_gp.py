"""Analysis without maps: a quasi-periodic Gaussian process on the first moments of the same profiles.

    python3 examples/moments_gp.py --work target/calibration-changing

For every star of `calibration_changing.py` (rv.csv has its first moments) amplitude, decay and periodic scale of the
kernel, a jitter and a constant are fitted by maximum likelihood, the rotation period known. Orbits of all periods of
the blind search follow in closed form, and false-alarm probabilities from draws of the model without a planet. The
highest peaks are fitted once more together with the kernel; the gain is compared with the same draws, for which nothing
is fitted: false-alarm probabilities `refit_` are too small, in favour of the QP-GP. Appends one line per star to
results/calibration/changing-moments.csv, and resumes where it was. Needs numpy, scipy, jax and tinygp.
"""

import argparse
import csv
import math
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize
from tinygp import GaussianProcess, kernels

import calibration_table

jax.config.update("jax_enable_x64", True)

# stars are padded to this many profiles by ones without information, so that one compilation is enough
MOST, NOTHING_KMS = 88, 1e4
# amplitude (km/s), decay (d), gamma of exp(-gamma sin^2), jitter (km/s); where fits begin; peaks fitted once more
BOUNDS = [(math.log(low), math.log(high)) for low, high in ((1e-3, 3), (1, 1e3), (0.1, 30), (1e-4, 1))]
DECAYS_D, GAMMAS = (4, 16, 64, 300), (1, 4)
PEAKS = 5
DRAWS = 10_000
COLUMNS = (
    "kind planet seed false_alarm delta_ln_l k_kms sigma_k_kms porb_over_prot phi sigma_phi median_sigma_k_kms "
    "amplitude_kms decay_d gamma jitter_kms "
    "refit_false_alarm refit_delta_ln_l refit_k_kms refit_sigma_k_kms refit_porb_over_prot refit_phi"
).split()


def process(kernel, star):
    amplitude, decay, gamma, jitter = jnp.exp(kernel)
    shape = kernels.ExpSquared(scale=decay) * kernels.ExpSineSquared(scale=star["rotation_d"], gamma=gamma)
    return GaussianProcess(amplitude**2 * shape, star["time_d"], diag=star["sigma_kms"] ** 2 + jitter**2)


@jax.jit
@jax.value_and_grad
def misfit(kernel, star, x):
    """-ln L with the linear part of the model (columns of x) at its best."""
    solver = process(kernel, star).solver
    white, y = solver.solve_triangular(x), solver.solve_triangular(star["moment_kms"])
    rest = y - white @ jnp.linalg.solve(white.T @ white, white.T @ y)
    return 0.5 * rest @ rest + solver.normalization()


def fit(star, x, starts):
    """ln of the maximum-likelihood parameters of the kernel, and -ln L."""

    def both(kernel):
        value, slope = misfit(kernel, star, x)
        return float(value), np.asarray(slope)

    found = [minimize(both, start, jac=True, bounds=BOUNDS) for start in starts]
    best = min(found, key=lambda one: one.fun)
    return best.x, best.fun


def load(folder, rotation_d):
    """A padded star, and the number of its profiles."""
    rv = np.genfromtxt(folder / "changing" / "rv.csv", delimiter=",", names=True)
    fill = MOST - len(rv)
    return {
        "time_d": np.concatenate([rv["time_d"], rv["time_d"][-1] + 1e4 * np.arange(1, fill + 1)]),
        "moment_kms": np.concatenate([rv["first_moment_kms"], np.zeros(fill)]),
        "sigma_kms": np.concatenate([rv["first_moment_sigma_kms"], np.full(fill, NOTHING_KMS)]),
        "rotation_d": rotation_d,
    }, len(rv)


def columns(star, frequencies_per_d):
    """A constant, and cosine and sine of each frequency (frequencies, profiles, 3)."""
    angle = 2 * np.pi * np.atleast_1d(frequencies_per_d)[:, None] * star["time_d"]
    return np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=-1)


def whitening(kernel, star, n):
    """The matrix that makes the profiles' covariance the unit matrix."""
    covariance = np.asarray(process(jnp.asarray(kernel), star).covariance)[:n, :n]
    return np.linalg.inv(np.linalg.cholesky(covariance))


def orbit(white, y):
    """K, sigma_K, phi, sigma_phi by least squares."""
    errors = np.linalg.inv(white.T @ white)
    _, a, b = errors @ (white.T @ y)
    k = math.hypot(a, b)
    along, across = np.array([a, b]) / k, np.array([-b, a]) / k
    sigma, turned = (math.sqrt(v @ errors[1:, 1:] @ v) for v in (along, across))
    return k, sigma, (math.atan2(b, a) / (2 * np.pi)) % 1, turned / k / (2 * np.pi)


def heights(white, y):
    """Gain in ln L of an orbit of each frequency over a constant (frequencies, data sets), data sets in columns."""
    basis, _ = np.linalg.qr(white)
    return 0.5 * sum((basis[:, :, i] @ y) ** 2 for i in (1, 2))


class FalseAlarms:
    """False-alarm probability of a peak from draws without a planet. Beyond the draws, from as many independent periods
    as give the highest of 1 % of them."""

    def __init__(self, white, random):
        draws = [random.normal(size=(white.shape[1], 1000)) for _ in range(DRAWS // 1000)]
        self.highest = np.concatenate([heights(white, y).max(axis=0) for y in draws])
        self.periods = math.log(0.99) / math.log1p(-math.exp(-np.quantile(self.highest, 0.99)))

    def probability(self, height):
        by_draws = (1 + np.sum(self.highest >= height)) / (DRAWS + 1)
        return by_draws if by_draws > 0.01 else -math.expm1(self.periods * math.log1p(-math.exp(-height)))


def peaks(gains):
    """The highest maxima."""
    inside = gains[1:-1]
    top = 1 + np.flatnonzero((inside >= gains[:-2]) & (inside > gains[2:]))
    return top[np.argsort(-gains[top])][:PEAKS]


def searched(row, folder):
    star, n = load(folder, float(row["rotation_period_d"]))
    scan = np.genfromtxt(folder / "changing" / "periodogram.csv", delimiter=",", names=True)
    y, periods = star["moment_kms"][:n], scan["porb_over_prot"]
    starts = [np.log([max(np.std(y), 2e-3), decay, gamma, 1e-2]) for decay in DECAYS_D for gamma in GAMMAS]
    kernel, alone = fit(star, columns(star, 0.0)[0][:, :1], starts)
    whiten = whitening(kernel, star, n)
    white = whiten @ columns(star, scan["frequency_per_d"])[:, :n]
    gains = heights(white, (whiten @ y)[:, None])[:, 0]
    orbits = np.array([orbit(each, whiten @ y) for each in white])
    best = int(gains.argmax())
    alarms = FalseAlarms(white, np.random.default_rng(1))
    line = {name: row[name] for name in ("kind", "planet", "seed")}
    line |= {"false_alarm": alarms.probability(gains[best]), "delta_ln_l": gains[best]}
    line |= dict(zip(("k_kms", "sigma_k_kms", "phi", "sigma_phi"), orbits[best]))
    median = calibration_table.median_sigma(periods, orbits[:, 1])
    line |= {"porb_over_prot": periods[best], "median_sigma_k_kms": median}
    line |= dict(zip(("amplitude_kms", "decay_d", "gamma", "jitter_kms"), np.exp(kernel)))
    refits = []
    for peak in peaks(gains):
        x = columns(star, scan["frequency_per_d"][peak])[0]
        again, misfit_there = fit(star, x, [kernel, starts[0]])
        refits.append((alone - misfit_there, peak, again, x))
    gain, peak, again, x = max(refits, key=lambda one: one[0])
    whiten = whitening(again, star, n)
    k, sigma_k, phi, _ = orbit(whiten @ x[:n], whiten @ y)
    names = ("refit_false_alarm", "refit_delta_ln_l", "refit_k_kms", "refit_sigma_k_kms", "refit_phi")
    line |= dict(zip(names, (alarms.probability(gain), gain, k, sigma_k, phi)))
    return line | {"refit_porb_over_prot": periods[peak]}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--work", type=Path, default=Path("target/calibration-changing"), help="folder of the stars")
    parser.add_argument("--csv", type=Path, default=Path("results/calibration/changing.csv"))
    parser.add_argument("--out", type=Path, default=Path("results/calibration/changing-moments.csv"))
    args = parser.parse_args()
    done = {row["seed"] for row in calibration_table.read(args.out)}
    for row in calibration_table.read(args.csv):
        if row["seed"] in done or row["error"]:
            continue
        line = searched(row, args.work / f"{row['kind'].replace(' ', '-')}-{row['seed']}")
        calibration_table.append(args.out, COLUMNS, line)


if __name__ == "__main__":
    main()
