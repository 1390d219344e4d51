"""What the command line does, as functions."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

from . import _core
from ._config import Config
from ._observations import Observations
from ._progress import shown
from ._results import Maps, Optimum, Periodogram, Plan, Scratch, Simulation
from ._run import Run

__all__ = ["map", "optimise", "periodogram", "plan", "sample", "simulate"]

ConfigLike = Config | Mapping[str, Any] | str | os.PathLike[str]
Folder = str | os.PathLike[str]


def simulate(
    config: ConfigLike,
    *,
    out: Folder | None = None,
    force: bool = False,
    threads: int | None = None,
    progress: bool | None = None,
) -> Simulation:
    """Simulate profiles of a spotted star with a planet.

    Parameters
    ----------
    config : Config, dict, str or path
        With ``observations.simulate``: spots, cycles, velocities, noise.
    out : str or path, optional
        Folder for the profiles and `truth.json`; by default one that goes with the result.
    force : bool
        Write into a non-empty folder.
    threads : int, optional
        Number of threads; all processors by default. Results do not depend on it.
    progress : bool, optional
        Show progress; by default in notebooks and on terminals.

    Returns
    -------
    Simulation

    Examples
    --------
    >>> simulation = dimcmc.simulate("configs/demo.json")                        # doctest: +SKIP
    >>> simulation.observations.intensity.shape                                  # doctest: +SKIP
    (50, 57)
    """
    text = Config(config)._as_text()
    with _folder(out, force) as (folder, scratch), shown("simulate", progress) as show:
        said, sets = _core.simulate(text, os.fspath(folder), (_threads(threads), show))
    simulation = Simulation(folder, said, scratch)
    simulation._sets = [Observations._of(arrays) for arrays in sets]
    return simulation


def map(
    config: ConfigLike,
    *,
    observations: Observations | None = None,
    times_d: Sequence[float] | None = None,
    out: Folder | None = None,
    force: bool = False,
    threads: int | None = None,
    progress: bool | None = None,
) -> Maps:
    """Reconstruct the spots at the config's parameter values: does the model fit?

    Parameters
    ----------
    config : Config, dict, str or path
        The star.
    observations : Observations, optional
        Profiles, in place of those named in the config.
    times_d : sequence of float, optional
        Times (d) of evolving maps (``imaging.objective`` "marginal-likelihood"); by default the mean time of each
        night.
    out : str or path, optional
        Folder for the files; by default a temporary one, deleted with the result.
    force : bool
        Write into a non-empty folder.
    threads : int, optional
        Number of threads; all processors by default. Results do not depend on it.
    progress : bool, optional
        Show progress; by default in notebooks and on terminals.

    Returns
    -------
    Maps

    Raises
    ------
    ValueError
        Invalid config, or no fitting map; the message names the key and the likely cause.

    Examples
    --------
    >>> star = dimcmc.map("configs/demo.json")                                   # doctest: +SKIP
    >>> star.summary.chi2_per_datum                                              # doctest: +SKIP
    0.97
    """
    text = Config(config)._as_text(observations is not None)
    times = None if times_d is None else [float(time) for time in times_d]
    with _folder(out, force) as (folder, scratch), shown("map", progress) as show:
        manner = (_threads(threads), show)
        said = _core.map(text, _arrays(observations), times, os.fspath(folder), manner)
    return Maps(folder, said, scratch)


def periodogram(
    config: ConfigLike,
    *,
    observations: Observations | None = None,
    min_period_d: float | None = None,
    max_period_d: float | None = None,
    oversampling: float | None = None,
    eccentric: bool = False,
    planets: Literal[1, 2] = 1,
    fixed: bool = False,
    draws: int = 10_000,
    seed: int = 1,
    out: Folder | None = None,
    force: bool = False,
    threads: int | None = None,
    progress: bool | None = None,
) -> Periodogram:
    """Blind search for a planet over period, marginalised over the star's spots.

    Parameters
    ----------
    config : Config, dict, str or path
        The star.
    observations : Observations, optional
        Profiles, in place of those named in the config.
    min_period_d, max_period_d : float, optional
        Shortest and longest period (d); by default that of 5 average Nyquist frequencies, and twice the time base.
    oversampling : float, optional
        Trial frequencies per inverse time base; 10 by default.
    eccentric : bool
        Fit eccentric orbits around the peaks as well.
    planets : {1, 2}
        Number of planets to search for.
    fixed : bool
        Fix free parameters at the config's values, instead of marginalising over them.
    draws : int
        Number of planet-free Monte Carlo realisations for the FAP, from 1000 to 10 million.
    seed : int
        Seed of these realisations.
    out : str or path, optional
        Folder for the files; by default a temporary one, deleted with the result.
    force : bool
        Write into a non-empty folder.
    threads : int, optional
        Number of threads; all processors by default. Results do not depend on it.
    progress : bool, optional
        Show progress; by default in notebooks and on terminals.

    Returns
    -------
    Periodogram

    Examples
    --------
    >>> search = dimcmc.periodogram("configs/demo.json")                         # doctest: +SKIP
    >>> print(search.verdict)                                                    # doctest: +SKIP
    """
    if planets not in (1, 2):
        raise ValueError(f"planets: must be 1 or 2, not {planets}")
    _check_draws(draws)
    options = (min_period_d, max_period_d, oversampling, eccentric, planets == 2, fixed, draws, seed)
    text = Config(config)._as_text(observations is not None)
    with _folder(out, force) as (folder, scratch), shown("periodogram", progress) as show:
        manner = (_threads(threads), show)
        said = _core.periodogram(text, _arrays(observations), options, os.fspath(folder), manner)
    return Periodogram(folder, said, scratch)


def plan(
    configs: ConfigLike | Sequence[ConfigLike],
    *,
    nights: Sequence[int] = (),
    min_period_d: float | None = None,
    max_period_d: float | None = None,
    fixed: bool = False,
    maps: int = 8,
    draws: int = 4000,
    seed: int = 1,
    out: Folder | None = None,
    force: bool = False,
    threads: int | None = None,
    progress: bool | None = None,
) -> Plan:
    """Forecast the detection limits of an observing schedule.

    Parameters
    ----------
    configs : Config, dict, str, path, or a list of these
        One or several schedules: ``observations.simulate`` of a star not yet observed, or observed profiles with a
        section ``plan``.
    nights : sequence of int
        Numbers of nights, one schedule each.
    min_period_d, max_period_d : float, optional
        Shortest and longest period (d) searched.
    fixed : bool
        Fix free parameters at the config's values, instead of marginalising over them.
    maps : int
        Number of spot maps drawn, over which medians are taken; 0 for an unspotted star.
    draws : int
        Number of planet-free Monte Carlo realisations for the FAP, from 1000 to 10 million.
    seed : int
        Seed of maps and realisations.
    out : str or path, optional
        Folder for the files; by default a temporary one, deleted with the result.
    force : bool
        Write into a non-empty folder.
    threads : int, optional
        Number of threads; all processors by default. Results do not depend on it.
    progress : bool, optional
        Show progress; by default in notebooks and on terminals.

    Returns
    -------
    Plan

    Examples
    --------
    >>> forecast = dimcmc.plan("configs/plan.json", nights=[8, 12, 16])          # doctest: +SKIP
    >>> forecast.periods["k95_kms"].min()                                        # doctest: +SKIP
    """
    if not 0 <= maps <= 1000:
        raise ValueError(f"maps: must be from 0 to 1000, not {maps}")
    _check_draws(draws)
    if any(not 1 <= number <= 1000 for number in nights):
        raise ValueError(f"nights: must be numbers from 1 to 1000, not {list(nights)}")
    schedules = [configs] if isinstance(configs, (Config, Mapping, str, os.PathLike)) else configs
    if not schedules:
        raise ValueError("configs: give one at least")
    texts = [Config(one)._as_text() for one in schedules]
    options = (min_period_d, max_period_d, fixed, maps, draws, seed)
    with _folder(out, force) as (folder, scratch), shown("plan", progress) as show:
        said = _core.plan(texts, list(nights), options, os.fspath(folder), (_threads(threads), show))
    return Plan(folder, said, scratch)


def optimise(
    config: ConfigLike,
    *,
    observations: Observations | None = None,
    out: Folder | None = None,
    force: bool = False,
    threads: int | None = None,
    progress: bool | None = None,
) -> Optimum:
    """Find the maximum of the posterior, with uncertainties.

    Parameters
    ----------
    config : Config, dict, str or path
        The star, with free parameters.
    observations : Observations, optional
        Profiles, in place of those named in the config.
    out : str or path, optional
        Folder for `optimum.json`; by default one that goes with the result.
    force : bool
        Write into a non-empty folder.
    threads : int, optional
        Number of threads; all processors by default. Results do not depend on it.
    progress : bool, optional
        Show progress; by default in notebooks and on terminals.

    Returns
    -------
    Optimum

    Examples
    --------
    >>> best = dimcmc.optimise("configs/demo.json")                              # doctest: +SKIP
    >>> best.parameters["k_kms"], best.sd["k_kms"]                               # doctest: +SKIP
    (0.103, 0.011)
    """
    text = Config(config)._as_text(observations is not None)
    with _folder(out, force) as (folder, scratch), shown("optimise", progress) as show:
        said = _core.optimise(text, _arrays(observations), os.fspath(folder), (_threads(threads), show))
    return Optimum(folder, said, scratch)


def sample(
    config: ConfigLike,
    *,
    observations: Observations | None = None,
    out: Folder | None = None,
    resume: bool = False,
    extend: int | None = None,
    start: Literal["optimum", "prior"] = "optimum",
    seed: int | None = None,
    force: bool = False,
    threads: int | None = None,
    progress: bool | None = None,
) -> Run:
    """Sample the posterior of the free parameters.

    Independent ensembles run until every parameter has reached the R-hat and effective sample size of the config, or
    its step limit. The chain is that of the command line, byte for byte. Ctrl-C stops it within a second; what was
    sampled is kept, and the message of the `KeyboardInterrupt` says how to resume.

    Parameters
    ----------
    config : Config, dict, str or path
        The star, with free parameters.
    observations : Observations, optional
        Profiles, in place of those named in the config.
    out : str or path, optional
        Folder of the run; by default a temporary one, deleted with the result.
    resume : bool
        Resume the run in the folder, bit-identical to an uninterrupted run; start it if there is none.
    extend : int, optional
        Resume the run in the folder and make this many more steps in any case.
    start : {"optimum", "prior"}
        Where walkers start: around the maxima that a search finds, or drawn from the prior.
    seed : int, optional
        In place of ``sampler.seed``.
    force : bool
        Replace the run that is in the folder.
    threads : int, optional
        Number of threads; all processors by default. Results do not depend on it.
    progress : bool, optional
        Show progress; by default in notebooks and on terminals.

    Returns
    -------
    Run

    Examples
    --------
    >>> run = dimcmc.sample("configs/demo.json", out="runs/demo")                # doctest: +SKIP
    >>> run = dimcmc.sample("configs/demo.json", out="runs/demo", extend=500)    # doctest: +SKIP
    """
    if start not in ("optimum", "prior"):
        raise ValueError(f'start: must be "optimum" or "prior", not {start!r}')
    if (resume or extend is not None) and out is None:
        raise ValueError("out: name the run to resume")
    if resume and extend is not None:
        raise ValueError("extend: resumes the run, omit resume")
    text = Config(config)._as_text(observations is not None)
    goes_on = extend is not None or (resume and (Path(os.fspath(out or "")) / "manifest.json").is_file())
    with _folder(out, force or goes_on, of_run=True) as (folder, scratch), shown("sample", progress) as show:
        false_start = _core.is_false_start(os.fspath(folder))
        _core.sample(
            text,
            _arrays(observations),
            os.fspath(folder),
            {
                "prior": start == "prior",
                "replace": force or false_start,
                "resume": goes_on and not false_start,
                "extend": extend,
            },
            seed,
            (_threads(threads), show),
        )
    return Run(folder, None, scratch)


def _check_draws(draws: int) -> None:
    if not 1000 <= draws <= 10_000_000:
        raise ValueError(f"draws: must be from 1000 to 10000000, not {draws}")


def _arrays(observations: Observations | None) -> Any:
    if observations is None or isinstance(observations, Observations):
        return None if observations is None else observations._arrays()
    raise TypeError(f"observations: must be dimcmc.Observations, not {type(observations).__name__}")


def _threads(threads: int | None) -> int | None:
    if threads is not None and not 1 <= threads <= 4096:
        raise ValueError(f"threads: must be from 1 to 4096, not {threads}")
    return threads


@contextmanager
def _folder(
    out: Folder | None, may_hold: bool, *, of_run: bool = False
) -> Iterator[tuple[Path, Scratch | None]]:
    """Where results go: a folder that is absent or empty, unless the user insists; or one that goes with the result.

    Of a run that was interrupted, the latter stays.
    """
    if out is not None:
        folder = Path(out)
        if folder.exists() and not folder.is_dir():
            raise NotADirectoryError(f"out: {folder} is not a folder")
        if folder.is_dir() and not may_hold and any(folder.iterdir()) and not _core.is_false_start(os.fspath(folder)):
            hint = "force=True to replace the files in it" + (", or resume=True to resume" if of_run else "")
            raise FileExistsError(f"out: {folder}: the folder is not empty; give another one, or {hint}")
        yield folder, None
        return
    scratch = Scratch()
    try:
        yield scratch.folder, scratch
    except KeyboardInterrupt:
        # the message of the interrupt names it
        if any(scratch.folder.iterdir()):
            scratch.keep()
        raise
