"""emcee and dynesty on our density against our own chain: medians within 0.1 standard deviations, widths within 10 %.

Minutes each: `python -m pytest -m slow`.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
from conftest import SMALL
from numpy.typing import NDArray

import dimcmc

pytestmark = pytest.mark.slow

# long enough that medians are good to 0.04 standard deviations and widths to 3 %
STAR: dict[str, Any] = {
    **SMALL,
    "parameters": {
        "k_kms": {"prior": "uniform", "min": 0.0, "max": 1.0},
        "porb_over_prot": {"prior": "normal", "mean": 1.7, "sd": 0.03},
        "phi": {"prior": "uniform", "min": 0.2, "max": 0.8},
    },
    "sampler": {"ensembles": 4, "walkers": 16, "steps": 4000, "ess": 4000, "rhat": 1.01},
}


@pytest.fixture(scope="module")
def ours() -> NDArray[np.float64]:
    run = dimcmc.sample(STAR)
    assert run.converged
    return np.stack([run.samples[name] for name in run.names], axis=-1)


@pytest.fixture(scope="module")
def density() -> dimcmc.LogPosterior:
    return dimcmc.LogPosterior(STAR)


def agree(ours: NDArray[np.float64], theirs: NDArray[np.float64]) -> None:
    width = ours.std(axis=0)
    medians = (np.median(theirs, axis=0) - np.median(ours, axis=0)) / width
    widths = theirs.std(axis=0) / width
    print(f"medians off by {medians} standard deviations, widths {widths} of ours")
    assert np.all(np.abs(medians) < 0.1) and np.all(np.abs(widths - 1.0) < 0.1)


def test_emcee(ours: NDArray[np.float64], density: dimcmc.LogPosterior) -> None:
    emcee = pytest.importorskip("emcee")
    np.random.seed(1)
    start = density.optimum + 0.5 * density.sd * np.random.default_rng(1).normal(size=(32, density.ndim))
    assert np.all(np.isfinite(density.log_prior(start)))
    sampler = emcee.EnsembleSampler(32, density.ndim, density, vectorize=True)
    sampler.run_mcmc(start, 6000)
    print(f"autocorrelation times {sampler.get_autocorr_time(quiet=True)}")
    agree(ours, sampler.get_chain(discard=500, flat=True))


def test_dynesty(ours: NDArray[np.float64], density: dimcmc.LogPosterior) -> None:
    dynesty = pytest.importorskip("dynesty")
    # far from the optimum evaluations are slow: bounds around the live points from the start, not at 10 % accepted
    sampler = dynesty.NestedSampler(
        density.log_likelihood, density.prior_transform, density.ndim,
        nlive=500, first_update={"min_eff": 90}, rstate=np.random.default_rng(1),
    )  # fmt: skip
    began = time.process_time()
    sampler.run_nested(print_progress=False)
    results = sampler.results
    print(f"{np.sum(results.ncall)} evaluations, {time.process_time() - began:.0f} s of a processor")
    agree(ours, results.samples_equal(rstate=np.random.default_rng(2)))
