"""Orbits of planets around spotted stars, the spots marginalised out.

A config says which star, which profiles and which parameters are free; the functions are those of the command line:

>>> import dimcmc
>>> config = dimcmc.Config("configs/demo.json")            # doctest: +SKIP
>>> run = dimcmc.sample(config)                            # doctest: +SKIP
>>> print(run)                                             # doctest: +SKIP

==================  =========================================================
`Config`            star, observations, image, free parameters, sampler
`Observations`      line profiles as arrays
`init`              a first config for observed profiles
`plan`              which planets would profiles show that are not yet taken?
`simulate`          profiles of a star with spots and a planet
`inject`            observed profiles with the signal of a planet
`map`               the spots, and whether the model fits
`periodogram`       is there a planet, at which period?
`limits`            which planets would the profiles show?
`optimise`          the best parameters and their error bars
`grid`              a likelihood grid and its paraboloid
`sample`            the posterior; a `Run`, also of the command line
`survey`            the rate of planets in a sample of stars
`report`            one HTML page of a star
`open`              any folder of results, also of the command line
`LogPosterior`      the same density for emcee, zeus, dynesty, nautilus
==================  =========================================================

Velocities are in km/s, times and periods in days, angles in degrees, as their names say. Quantities of astropy are
converted to these.
"""

from ._config import Config, Section
from ._core import __version__
from ._folders import Batch, open, report, survey
from ._functions import grid, inject, limits, map, optimise, periodogram, plan, sample, simulate
from ._init import init
from ._observations import Observations
from ._posterior import LogPosterior
from ._results import (
    Comparison,
    Figure,
    Grid,
    Injection,
    Limits,
    Maps,
    Optimum,
    Periodogram,
    Plan,
    Record,
    Result,
    Simulation,
    Survey,
)
from ._run import Run

__all__ = [
    "Batch",
    "Comparison",
    "Config",
    "Figure",
    "Grid",
    "Injection",
    "Limits",
    "LogPosterior",
    "Maps",
    "Observations",
    "Optimum",
    "Periodogram",
    "Plan",
    "Record",
    "Result",
    "Run",
    "Section",
    "Simulation",
    "Survey",
    "__version__",
    "grid",
    "init",
    "inject",
    "limits",
    "map",
    "open",
    "optimise",
    "periodogram",
    "plan",
    "report",
    "sample",
    "simulate",
    "survey",
]
