"""Profiles as arrays: shapes, order, numbers that are none; the same results as from files."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SMALL

import dimcmc

TIMES = np.arange(5.0)
VELOCITIES = np.linspace(-20.0, 20.0, 21)
INTENSITY = np.tile(1.0 - 0.2 * np.exp(-((VELOCITIES / 8.0) ** 2)), (5, 1))


def test_shapes_of_errors_and_velocities() -> None:
    whole = dimcmc.Observations(TIMES, VELOCITIES, INTENSITY, np.full((5, 21), 1e-3))
    for sigma in (1e-3, np.full(5, 1e-3)):
        assert dimcmc.Observations(list(TIMES), VELOCITIES.tolist(), INTENSITY, sigma) == whole
    shifted = VELOCITIES + np.arange(5.0)[:, np.newaxis]
    assert np.allclose(dimcmc.Observations(TIMES, shifted, INTENSITY, 1e-3).velocities_kms, shifted)
    assert len(whole) == 5 and "5 profiles of 21 bins, -20 to 20 km/s" in repr(whole)
    late = dimcmc.Observations(2_459_010.25 + TIMES, VELOCITIES, INTENSITY, 1e-3)
    assert repr(late).endswith("2459010.25 to 2459014.25 d")
    assert pickle.loads(pickle.dumps(whole)) == whole
    # Fortran's order, other numbers, views
    turned = dimcmc.Observations(TIMES.astype(int), VELOCITIES, np.asfortranarray(INTENSITY), np.float32(1e-3))
    assert np.array_equal(turned.intensity, INTENSITY)
    with pytest.raises(ValueError, match="read-only"):
        whole.intensity[0, 0] = 2.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"times_d": TIMES[:-1]}, "times_d: 4 times for 5 profiles"),
        ({"intensity": INTENSITY.T, "times_d": TIMES}, "transposed"),
        ({"intensity": INTENSITY[0]}, "intensity: must have 2 dimensions, not 1"),
        ({"velocities_kms": VELOCITIES[1:]}, "velocities_kms: shape"),
        ({"velocities_kms": VELOCITIES[::-1]}, "must grow"),
        ({"velocities_kms": VELOCITIES**3}, "even steps"),
        ({"sigma": np.full(21, 1e-3)}, "sigma: shape"),
        ({"sigma": 0.0}, "error above 0"),
        ({"sigma": np.nan}, "must be finite"),
        ({"intensity": np.where(INTENSITY < 0.9, np.nan, INTENSITY)}, "profile 0 bin"),
        ({"times_d": [0.0, 1.0, np.inf, 3.0, 4.0]}, "profile 2"),
        ({"velocities_kms": [np.nan] * 21}, "velocities_kms: must be finite"),
        ({"sigma": "small"}, "sigma: must be numbers"),
        ({"times_d": [0.0], "intensity": INTENSITY[:1]}, "at least two"),
    ],
)
def test_what_makes_no_sense_is_told(change: dict[str, Any], words: str) -> None:
    arguments = {"times_d": TIMES, "velocities_kms": VELOCITIES, "intensity": INTENSITY, "sigma": 1e-3}
    with pytest.raises(ValueError, match=words):
        dimcmc.Observations(**(arguments | change))


def test_arrays_and_files_give_the_same_chain(
    simulation: dimcmc.Simulation, run: dimcmc.Run, tmp_path: Path
) -> None:
    from_arrays = dimcmc.sample(SMALL, observations=simulation.observations)
    assert np.array_equal(from_arrays.chain, run.chain) and np.array_equal(from_arrays.log_prob, run.log_prob)
    simulation.observations.save(tmp_path)
    star = {**SMALL, "observations": {"path": str(tmp_path / "observations.txt")}}
    # files have twelve digits
    found = dimcmc.map(star).velocities["observed_kms"]
    expected = dimcmc.map(SMALL, observations=simulation.observations).velocities["observed_kms"]
    assert np.allclose(found, expected, rtol=0.0, atol=1e-8)


def test_other_kinds_are_refused(config: dimcmc.Config) -> None:
    with pytest.raises(TypeError, match="must be dimcmc.Observations, not ndarray"):
        dimcmc.map(config, observations=INTENSITY)  # type: ignore[arg-type]
