"""The density by itself: values, shapes, priors, threads, processes, and what calling it costs."""

from __future__ import annotations

import multiprocessing
import pickle
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from conftest import SMALL

import dimcmc


def test_values_are_those_of_the_chain(log_posterior: dimcmc.LogPosterior, run: dimcmc.Run) -> None:
    draws = run.chain.reshape(-1, 2)
    assert np.array_equal(log_posterior(draws), run.log_prob.ravel())
    # one at a time, from lists, backwards, in Fortran's order, in single precision
    assert [log_posterior(list(theta)) for theta in draws[:5]] == run.log_prob.ravel()[:5].tolist()
    assert np.array_equal(log_posterior(draws[::-2]), run.log_prob.ravel()[::-2])
    assert np.array_equal(log_posterior(np.asfortranarray(draws)), run.log_prob.ravel())
    single = draws[:3].astype(np.float32)
    assert np.array_equal(log_posterior(single), log_posterior(single.astype(float)))


def test_kinds_and_shapes(log_posterior: dimcmc.LogPosterior) -> None:
    assert log_posterior.names == ("k_kms", "phi") and log_posterior.ndim == 2
    one = log_posterior(log_posterior.optimum)
    assert isinstance(one, float) and log_posterior(np.empty((0, 2))).shape == (0,)
    assert log_posterior(log_posterior.optimum + [0.02, 0.0]) < one
    assert "k_kms, phi" in repr(log_posterior)
    for wrong in (np.zeros(3), np.zeros((2, 3)), np.zeros((1, 1, 2)), 0.3):
        with pytest.raises(ValueError, match=r"expected 2 numbers \(k_kms, phi\)"):
            log_posterior(wrong)
    for nonsense in ("fast", ["a", "b"], object()):
        with pytest.raises((TypeError, ValueError)):
            log_posterior(nonsense)  # type: ignore[arg-type]


def test_outside_and_not_a_number(log_posterior: dimcmc.LogPosterior) -> None:
    for theta in ([-0.1, 0.5], [1.1, 0.5], [np.nan, 0.5], [0.3, np.inf]):
        assert log_posterior(theta) == -np.inf == log_posterior.log_likelihood(theta)
        assert log_posterior.log_prior(theta) == -np.inf
    batch = log_posterior(np.array([[0.3, 0.5], [np.nan, 0.5]]))
    assert np.isfinite(batch[0]) and batch[1] == -np.inf


def test_priors(log_posterior: dimcmc.LogPosterior) -> None:
    assert np.allclose(log_posterior.prior_transform([0.25, 0.75]), [0.25, 0.75])
    unit = np.random.default_rng(1).random((12, 2))
    theta = log_posterior.prior_transform(unit)
    assert theta.shape == (12, 2) and np.all(np.isfinite(log_posterior.log_prior(theta)))
    # the prior of k_kms is uniform from 0 to 1, that of phi periodic: their density is 1
    assert np.array_equal(log_posterior.log_likelihood(theta), log_posterior(theta))
    for wrong in ([1.5, 0.5], [np.nan, 0.5]):
        with pytest.raises(ValueError, match="unit cube"):
            log_posterior.prior_transform(wrong)


def test_threads(log_posterior: dimcmc.LogPosterior) -> None:
    theta = log_posterior.prior_transform(np.random.default_rng(2).random((10, 2)))
    alone = dimcmc.LogPosterior(SMALL, threads=1)
    assert np.array_equal(alone(theta), log_posterior(theta))
    with ThreadPoolExecutor(4) as pool:
        assert np.array_equal(list(pool.map(log_posterior, theta)), log_posterior(theta))
    with pytest.raises(ValueError, match="threads"):
        dimcmc.LogPosterior(SMALL, threads=0)


def test_the_interpreter_goes_on_meanwhile(log_posterior: dimcmc.LogPosterior) -> None:
    """Were its lock held, the counter would stand still during the call."""
    theta = log_posterior.prior_transform(np.random.default_rng(3).random((200, 2)))
    with ThreadPoolExecutor(1) as pool:
        computing = pool.submit(log_posterior, theta)
        began, counted = time.perf_counter(), 0
        while not computing.done():
            counted += 1
            time.sleep(0.002)
        assert counted > 0.1 * (time.perf_counter() - began) / 0.002


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_processes(log_posterior: dimcmc.LogPosterior, method: str) -> None:
    if method not in multiprocessing.get_all_start_methods():
        pytest.skip(f"no {method} here")
    theta = log_posterior.prior_transform(np.random.default_rng(4).random((6, 2)))
    with multiprocessing.get_context(method).Pool(1) as pool:
        assert pool.map(log_posterior, list(theta)) == log_posterior(theta).tolist()
        # a batch in another process has threads of its own
        assert np.array_equal(pool.apply(log_posterior, (theta,)), log_posterior(theta))


def test_pickles_and_arrays(simulation: dimcmc.Simulation, log_posterior: dimcmc.LogPosterior) -> None:
    from_arrays = dimcmc.LogPosterior(SMALL, observations=simulation.observations)
    again = pickle.loads(pickle.dumps(from_arrays))
    theta = log_posterior.optimum
    assert again(theta) == from_arrays(theta) == log_posterior(theta)


def test_calls_cost_little() -> None:
    """Less than 1 % of an evaluation: of a vector outside of the prior nothing is computed."""
    # an image of a usual size
    log_posterior = dimcmc.LogPosterior({**SMALL, "imaging": {**SMALL["imaging"], "pixels": 1000}})
    # the best of several, for other work on the machine takes its time, too

    def seconds(theta: np.ndarray, calls: int) -> float:
        def once() -> float:
            began = time.perf_counter()
            for _ in range(calls):
                log_posterior(theta)
            return (time.perf_counter() - began) / calls

        return min(once() for _ in range(7))

    call, evaluation = seconds(np.array([-1.0, 0.5]), 300), seconds(log_posterior.optimum + 0.01, 30)
    print(f"{1e6 * call:.1f} us a call, {1e6 * evaluation:.0f} us an evaluation")
    assert call < 0.01 * evaluation


def test_of_the_wrong_config(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="parameters"):
        dimcmc.LogPosterior({**SMALL, "parameters": {}})


def test_a_forked_process_where_maps_are_integrated_over(config: dimcmc.Config) -> None:
    """One evaluation is spread over threads there, and those of the parent are not in its child."""
    if "fork" not in multiprocessing.get_all_start_methods():
        pytest.skip("no fork here")
    config.update({"imaging": {"objective": "marginal-likelihood"}, "sampler": {"walkers": 14}})
    integrated = dimcmc.LogPosterior(config)
    expected = integrated(integrated.optimum)
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert pool.apply_async(integrated, (integrated.optimum,)).get(timeout=60) == expected
        # pickled and made again there
        assert pool.apply_async(_evaluated, (pickle.dumps(integrated),)).get(timeout=60) == expected


def _evaluated(pickled: bytes) -> float:
    again = pickle.loads(pickled)
    return float(again(again.optimum))
