"""Profiles of a star whose spots evolve in one of three ways, on which a calibration may depend.

    python3 examples/simulate_spots.py OUT --how field --seed 1 --lifetime 15 [--k 0.1 --porb-over-prot 1.7 --phi 0.3]

`field`: the Gaussian field that `dimcmc` marginalises over (Matern 3/2 in time). `fading`: discs that keep their size
while their filling factor grows and falls. `shrinking`: discs that keep their filling factor while their area does.
Discs are at their largest at random times; `--lifetime` is the full width at half of it, `inf` makes them static. A
simulator of calibration_changing.py, whose options it has: `--simulator 'examples/simulate_spots.py --how field'`.
Needs numpy and scipy.
"""

import argparse
import json
from pathlib import Path

import numpy as np
from scipy.constants import Boltzmann, Planck, speed_of_light
from scipy.special import sph_harm_y

LINE_SIGMA_KMS, WIDTH_KMS, LIMB_DARKENING = 2.5, 5.8, 0.65
PHOTOSPHERE_K, SPOT_K, WAVELENGTH_NM = 5500.0, 3500.0, 550.0
# of the field, as fitted to stars with discs: standard deviation, power-law index, degree, mean, and its lifetime
# over that of the discs
AMPLITUDE, SLOPE, DEGREE, MEAN, LIFETIME = 0.24, 0.5, 36, 0.06, 0.8
SPOTS, EDGE_DEG = 12, 0.7
HOW = ("field", "fading", "shrinking")


def contrast():
    """1 - brightness of a spot over that of the photosphere: black bodies."""
    x = Planck * speed_of_light / (WAVELENGTH_NM * 1e-9 * Boltzmann)
    return 1 - np.expm1(x / PHOTOSPHERE_K) / np.expm1(x / SPOT_K)


def grid(rows=104):
    """Longitude, latitude (rad) and fraction of the sphere of some 14,000 pixels."""
    latitudes = (np.arange(rows) + 0.5) / rows * np.pi - np.pi / 2
    each = np.maximum(3, np.round(2 * rows * np.cos(latitudes))).astype(int)
    longitude = np.concatenate([(np.arange(n) + 0.5) / n * 2 * np.pi for n in each])
    edges = np.sin(np.linspace(-np.pi / 2, np.pi / 2, rows + 1))
    return longitude, np.repeat(latitudes, each), np.repeat(np.diff(edges) / 2 / each, each)


def observed(options, random):
    """Times (d): nights of two to four profiles, one in eight of them cloudy."""
    times = []
    for season in range(options.seasons):
        for night in range(options.nights):
            if random.random() > 0.12:
                hours = np.sort(random.uniform(0, 0.38, random.integers(2, 5)))
                times += list(season * options.season_gap + night + hours)
    return np.array(times)


def gaussian_field(options, times, longitude, latitude, random):
    """Filling factor of every pixel (rows) at every time."""
    delay = 0.0 * times if np.isinf(options.lifetime) else np.sqrt(3) * times / (LIFETIME * options.lifetime)
    delay = np.abs(delay[:, None] - delay)
    values, vectors = np.linalg.eigh((1 + delay) * np.exp(-delay))
    root = vectors * np.sqrt(np.clip(values, 0, None))
    degrees = np.arange(1, DEGREE + 1)
    variance = (degrees * (degrees + 1.0)) ** -SLOPE
    variance *= AMPLITUDE**2 / np.sum(variance * (2 * degrees + 1))
    filling = np.full((len(longitude), len(times)), MEAN)
    for degree, sd in zip(degrees, np.sqrt(variance)):
        for order in range(degree + 1):
            harmonic = sph_harm_y(degree, order, np.pi / 2 - latitude, longitude) * np.sqrt(4 * np.pi)
            parts = [harmonic.real] if order == 0 else [np.sqrt(2) * harmonic.real, np.sqrt(2) * harmonic.imag]
            for part in parts:
                filling += sd * np.outer(part, root @ random.standard_normal(len(times)))
    return filling


def discs(options, times, longitude, latitude, random):
    """Filling factor of every pixel (rows) at every time: of spots that overlap, the larger."""
    filling = np.zeros((len(longitude), len(times)))
    for season in range(options.seasons):
        start = season * options.season_gap
        lasting = np.isinf(options.lifetime)
        around = 0.0 if lasting else options.lifetime
        number = SPOTS if lasting else random.poisson(0.66 * SPOTS * (options.nights + 2 * around) / around)
        for _ in range(number):
            at, north = random.uniform(0, 2 * np.pi), np.arcsin(random.uniform(-0.29, 1))
            radius, full = np.radians(random.uniform(5, 17)), random.uniform(0.5, 0.92)
            peak = random.uniform(start - around, start + options.nights + around)
            share = np.ones(len(times)) if lasting else np.clip(1 - np.abs(times - peak) / around, 0, None)
            cosine = np.sin(latitude) * np.sin(north) + np.cos(latitude) * np.cos(north) * np.cos(longitude - at)
            away = np.arccos(np.clip(cosine, -1, 1))[:, None]
            size, depth = (radius, full * share) if options.how == "fading" else (radius * np.sqrt(share), full)
            disc = depth * np.where(share > 0, 1 / (1 + np.exp((away - size) / np.radians(EDGE_DEG))), 0)
            filling = np.maximum(filling, disc)
    return filling


def profiles(options, times, filling, longitude, latitude, area):
    """Depths (times, bins) and the velocities (km/s) of the bins."""
    velocity = (np.arange(options.bins) - (options.bins - 1) / 2) * options.step
    tilt = np.radians(options.inclination)
    width = np.hypot(LINE_SIGMA_KMS, speed_of_light / 1e3 / options.resolving_power / np.sqrt(8 * np.log(2)))
    depths = []
    for time, covered in zip(times, filling.T):
        turned = longitude + 2 * np.pi * time / options.prot
        mu = np.sin(latitude) * np.cos(tilt) + np.cos(latitude) * np.sin(tilt) * np.cos(turned)
        light = (area * mu * (1 - LIMB_DARKENING * (1 - mu)) * (1 - contrast() * covered))[mu > 0]
        orbit = options.k * np.cos(2 * np.pi * (time / (options.prot * options.porb_over_prot) - options.phi))
        shift = options.vsini * (np.cos(latitude) * np.sin(turned))[mu > 0] + orbit
        line = np.exp(-0.5 * ((velocity[:, None] - shift) / width) ** 2) @ light / light.sum()
        depths.append(WIDTH_KMS / (width * np.sqrt(2 * np.pi)) * line)
    return np.array(depths), velocity


def write(options, times, depths, velocity):
    options.out.mkdir(parents=True)
    names = [f"p{k:03d}.prof" for k in range(len(times))]
    listing = [f"{name} {time:.6f} 0.0" for name, time in zip(names, times)]
    (options.out / "observations.txt").write_text("\n".join(listing) + "\n")
    for name, depth in zip(names, depths):
        rows = [f"{v:8.2f} {1 - d:.6f} {1 / options.snr:.6f}" for v, d in zip(velocity, depth)]
        (options.out / name).write_text("\n".join(["*** simulated", f" {len(velocity)} 2", *rows]) + "\n")
    star = {"rotation_period_d": options.prot, "epoch_d": 0.0, "inclination_deg": options.inclination}
    star |= {"vsini_kms": options.vsini, "limb_darkening": {"law": "linear", "coefficients": [LIMB_DARKENING]}}
    star |= {"photosphere_k": PHOTOSPHERE_K, "spot_k": SPOT_K, "wavelength_nm": WAVELENGTH_NM}
    star["line"] = {"shape": "gaussian", "sigma_kms": LINE_SIGMA_KMS, "equivalent_width_kms": WIDTH_KMS}
    free = {"k_kms": {"prior": "uniform", "min": 0.0, "max": 0.6}, "phi": {"prior": "periodic"}}
    free["porb_over_prot"] = {"prior": "uniform", "min": 0.5, "max": 4.0}
    config = {"star": star, "instrument": {"resolving_power": options.resolving_power}, "parameters": free}
    config["planet"] = {"k_kms": 0.0, "porb_over_prot": options.porb_over_prot, "phi": options.phi}
    config["observations"] = {"path": "observations.txt"}
    (options.out / "config.json").write_text(json.dumps(config, indent=1))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--how", choices=HOW, default="shrinking")
    for name, default in {"seed": 1, "nights": 15, "seasons": 1, "bins": 57}.items():
        parser.add_argument(f"--{name}", type=int, default=default)
    numbers = {"lifetime": np.inf, "k": 0.0, "porb-over-prot": 1.7, "phi": 0.3, "prot": 3.0, "inclination": 38.0}
    numbers |= {"vsini": 40.0, "snr": 1000.0, "step": 1.8, "resolving-power": 65000.0, "season-gap": 330.0}
    for name, default in numbers.items():
        parser.add_argument(f"--{name}", type=float, default=default)
    options = parser.parse_args()
    random = np.random.default_rng(options.seed)
    times = observed(options, random)
    longitude, latitude, area = grid()
    spots = gaussian_field if options.how == "field" else discs
    filling = spots(options, times, longitude, latitude, random)
    depths, velocity = profiles(options, times, filling, longitude, latitude, area)
    write(options, times, depths + random.normal(0, 1 / options.snr, depths.shape), velocity)


if __name__ == "__main__":
    main()
