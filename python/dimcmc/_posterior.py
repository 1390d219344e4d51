"""The density by itself, for other samplers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._config import Config
from ._functions import ConfigLike, _arrays, _threads
from ._observations import Observations
from ._progress import shown

__all__ = ["LogPosterior"]


class LogPosterior:
    """The log-posterior of the free parameters, marginalised over spots; bit-identical to the density of `sample`.

    It is searched for its maximum first, as `sample` does. Objects pickle: another process has it again without that
    search, and with the same values. It may be called from several threads.

    Parameters
    ----------
    config : Config, dict, str or path
        The star, with free parameters.
    observations : Observations, optional
        Profiles in place of those that the config names.
    threads : int, optional
        Threads for the search, and for arrays of vectors; all processors by default.
    progress : bool, optional
        Show progress; by default in notebooks and on terminals.

    Attributes
    ----------
    names : tuple of str
        The parameters, in the order of all vectors and in the units of their names.
    ndim : int
        How many these are.
    optimum, sd : numpy.ndarray, shape (ndim,)
        The best parameters, and their standard deviations by the curvature there.

    Examples
    --------
    >>> log_posterior = dimcmc.LogPosterior("configs/demo.json")                 # doctest: +SKIP
    >>> log_posterior.names                                                      # doctest: +SKIP
    ('k_kms', 'porb_over_prot', 'phi')
    >>> log_posterior([0.1, 1.7, 0.5])                                           # doctest: +SKIP
    -0.31

    emcee, all walkers of a step at once:

    >>> start = log_posterior.optimum + log_posterior.sd * rng.normal(size=(32, 3))               # doctest: +SKIP
    >>> sampler = emcee.EnsembleSampler(32, 3, log_posterior, vectorize=True)    # doctest: +SKIP
    >>> sampler.run_mcmc(start, 1000)                                            # doctest: +SKIP

    dynesty, from bounds around its live points as soon as may be, for evaluations far from the optimum are slow:

    >>> density = log_posterior.log_likelihood, log_posterior.prior_transform, 3  # doctest: +SKIP
    >>> nested = dynesty.NestedSampler(*density, first_update={"min_eff": 90})   # doctest: +SKIP
    """

    def __init__(
        self,
        config: ConfigLike,
        *,
        observations: Observations | None = None,
        threads: int | None = None,
        progress: bool | None = None,
    ) -> None:
        self._make(Config(config), observations, None, _threads(threads), progress)

    def _make(
        self,
        config: Config,
        observations: Observations | None,
        origin: str | None,
        threads: int | None,
        progress: bool | None,
    ) -> None:
        self._config, self._observations, self._threads = config.copy(), observations, threads
        text = config._as_text(observations is not None)
        with shown("LogPosterior", progress) as show:
            self._core = _core.LogPosterior(text, _arrays(observations), origin, (threads, show))
        self.names = tuple(self._core.names)
        self.ndim = len(self.names)
        self.optimum, self.sd = self._core.optimum()

    def __call__(self, theta: ArrayLike) -> Any:
        """ln of the posterior density, up to a constant: minus infinity outside of the prior.

        Parameters
        ----------
        theta : array_like, shape (ndim,) or (n, ndim)
            A vector of parameters, or one in each row; rows are spread over threads.

        Returns
        -------
        float or numpy.ndarray, shape (n,)
        """
        return self._core.log_prob(theta, self._threads)

    def log_prior(self, theta: ArrayLike) -> Any:
        """ln of the prior density: minus infinity outside.

        Parameters
        ----------
        theta : array_like, shape (ndim,) or (n, ndim)
            A vector of parameters, or one in each row.

        Returns
        -------
        float or numpy.ndarray, shape (n,)
        """
        return self._core.log_prior(theta)

    def log_likelihood(self, theta: ArrayLike) -> Any:
        """ln of the likelihood, up to a constant: the posterior density over that of the prior.

        Parameters
        ----------
        theta : array_like, shape (ndim,) or (n, ndim)
            A vector of parameters, or one in each row.

        Returns
        -------
        float or numpy.ndarray, shape (n,)
            Minus infinity outside of the prior.
        """
        posterior, prior = self._core.log_prob(theta, self._threads), self._core.log_prior(theta)
        if isinstance(prior, float):
            return posterior - prior if prior > -np.inf else -np.inf
        return np.where(np.isneginf(prior), -np.inf, posterior - np.where(np.isneginf(prior), 0.0, prior))

    def prior_transform(self, unit: ArrayLike) -> NDArray[np.float64]:
        """The parameters at a point of the unit cube, for nested samplers.

        Parameters
        ----------
        unit : array_like, shape (ndim,) or (n, ndim)
            Numbers from 0 to 1: shares of the prior that lie below.

        Returns
        -------
        numpy.ndarray
            Of the same shape.
        """
        return self._core.prior_transform(unit)

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (self._config, self._observations, self._core.origin(), self._threads)

    def __repr__(self) -> str:
        return f"LogPosterior of {', '.join(self.names)}"


def _again(
    config: Config, observations: Observations | None, origin: str, threads: int | None
) -> LogPosterior:
    """The same without a search."""
    posterior = LogPosterior.__new__(LogPosterior)
    posterior._make(config, observations, origin, threads, False)
    return posterior
