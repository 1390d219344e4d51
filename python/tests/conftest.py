"""A small star for all tests, and what takes a while computed once."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

import pytest

import dimcmc

# what a shell starts in the background is deaf to Ctrl-C, and so are its children
signal.signal(signal.SIGINT, signal.default_int_handler)

ROOT = Path(__file__).resolve().parents[2]

# a star whose evaluations take a fraction of a millisecond
SMALL: dict[str, Any] = {
    "star": {
        "rotation_period_d": 3.0,
        "inclination_deg": 60.0,
        "vsini_kms": 25.0,
        "contrast": 0.3,
        "line": {"sigma_kms": 4.0, "equivalent_width_kms": 6.0},
    },
    "planet": {"k_kms": 0.3, "porb_over_prot": 1.7, "phi": 0.5},
    "observations": {
        "simulate": {
            "spots": [[40.0, 30.0, 15.0, 0.9], [200.0, 60.0, 12.0, 0.8]],
            "cycles": [0.27 * k for k in range(12)],
            "velocity_kms": {"min": -40.0, "max": 40.0, "step": 2.0},
            "snr": 1000.0,
            # those of the image, so that few are enough
            "pixels": 200,
        }
    },
    "imaging": {"pixels": 200, "objective": "spottedness", "unresolved_spots": "entropy"},
    "parameters": {
        "k_kms": {"prior": "uniform", "min": 0.0, "max": 1.0},
        "phi": {"prior": "periodic"},
    },
    "sampler": {"ensembles": 2, "walkers": 10, "steps": 30, "ess": 100.0, "rhat": 1.1},
}


@pytest.fixture
def config() -> dimcmc.Config:
    return dimcmc.Config(SMALL)


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> dimcmc.Run:
    return dimcmc.sample(SMALL, out=tmp_path_factory.mktemp("run") / "run")


@pytest.fixture(scope="session")
def log_posterior() -> dimcmc.LogPosterior:
    return dimcmc.LogPosterior(SMALL)


@pytest.fixture(scope="session")
def simulation() -> dimcmc.Simulation:
    return dimcmc.simulate(SMALL)
