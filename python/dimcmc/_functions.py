"""What the command line does, as functions."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

from . import _core, _units
from ._config import Config
from ._observations import Observations
from ._progress import shown
from ._results import Grid, Injection, Limits, Maps, Optimum, Periodogram, Plan, Scratch, Simulation
from ._run import Run

__all__ = ["grid", "inject", "limits", "map", "optimise", "periodogram", "plan", "sample", "simulate"]

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


def inject(
    config: ConfigLike,
    *,
    k_kms: float,
    porb_over_prot: float,
    phi: float,
    observations: Observations | None = None,
    out: Folder | None = None,
    force: bool = False,
    threads: int | None = None,
    progress: bool | None = None,
) -> Injection:
    """Inject the signal of a planet into observed profiles.

    Each profile is shifted by the velocity of the orbit at its time, and resampled on its own velocity axis. An orbit
    already present in the profiles adds to the injected one.

    Parameters
    ----------
    config : Config, dict, str or path
        The star and its profiles.
    k_kms : float
        Semi-amplitude (km/s).
    porb_over_prot : float
        Orbital period over the rotation period.
    phi : float
        Phase (orbital cycles) of maximum RV, counted from rotation cycle 0.
    observations : Observations, optional
        Profiles, in place of those named in the config.
    out : str or path, optional
        Folder for profiles, config and `truth.json`; by default a temporary one, deleted with the result.
    force : bool
        Write into a non-empty folder.
    threads : int, optional
        Number of threads; all processors by default. Results do not depend on it.
    progress : bool, optional
        Show progress; by default in notebooks and on terminals.

    Returns
    -------
    Injection

    Examples
    --------
    >>> injected = dimcmc.inject("star.json", k_kms=0.2, porb_over_prot=2.6, phi=0.25)   # doctest: +SKIP
    >>> search = dimcmc.periodogram(injected.config)                             # doctest: +SKIP
    """
    text = Config(config)._as_text(observations is not None)
    orbit = (float(_units.number("k_kms", k_kms)), float(porb_over_prot), float(phi))
    with _folder(out, force) as (folder, scratch), shown("inject", progress) as show, _by_keyword():
        manner = (_threads(threads), show)
        said = _core.inject(text, _arrays(observations), orbit, os.fspath(folder), manner)
    return Injection(folder, said, scratch)


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
    times = None if times_d is None else [float(time) for time in _units.number("times_d", times_d)]
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
    min_period_d, max_period_d = (_units.number("period_d", one) for one in (min_period_d, max_period_d))
    options = (min_period_d, max_period_d, oversampling, eccentric, planets == 2, fixed, draws, seed)
    text = Config(config)._as_text(observations is not None)
    with _folder(out, force) as (folder, scratch), shown("periodogram", progress) as show:
        manner = (_threads(threads), show)
        said = _core.periodogram(text, _arrays(observations), options, os.fspath(folder), manner)
    return Periodogram(folder, said, scratch)


def limits(
    config: ConfigLike,
    *,
    observations: Observations | None = None,
    min_period_d: float | None = None,
    max_period_d: float | None = None,
    periods: int = 40,
    min_k_kms: float | None = None,
    max_k_kms: float | None = None,
    amplitudes: int = 20,
    phases: int = 12,
    full: int = 0,
    without_best: bool = False,
    with_best: bool = False,
    fixed: bool = False,
    draws: int = 10_000,
    seed: int = 1,
    out: Folder | None = None,
    force: bool = False,
    threads: int | None = None,
    progress: bool | None = None,
) -> Limits:
    """Detection limits from injection-recovery tests in period, K and phase.

    Circular orbits are injected, linearised, and searched for as `periodogram` does. Recovered means FAP < 1 % at the
    right period. A candidate already present in the profiles is subtracted first.

    Parameters
    ----------
    config : Config, dict, str or path
        The star.
    observations : Observations, optional
        Profiles, in place of those named in the config.
    min_period_d, max_period_d : float, optional
        Shortest and longest period (d) injected and searched; by default those of `periodogram`.
    periods : int
        Number of injected periods, evenly spaced in their logarithm, from 2 to 1000.
    min_k_kms, max_k_kms : float, optional
        Smallest and largest K (km/s); by default a third of the lowest detectable K, and four times the K detected
        with certainty at most periods.
    amplitudes, phases : int
        Number of semi-amplitudes, evenly spaced in their logarithm, and of phases; each from 2 to 1000.
    full : int
        Number of orbits near the limit to pass through the full pipeline: resampled profiles, a new map, a new search.
    without_best : bool
        Subtract the best orbit of the observed profiles first, even if it is no candidate.
    with_best : bool
        Keep the best orbit of the observed profiles, even if it is a candidate.
    fixed : bool
        Fix free parameters at the config's values, instead of marginalising over them.
    draws : int
        Number of planet-free Monte Carlo realisations for the FAP, from 1000 to 10 million.
    seed : int
        Seed of the realisations, and of the orbits of `full`.
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
    Limits

    Examples
    --------
    >>> found = dimcmc.limits("configs/demo.json", periods=12)                   # doctest: +SKIP
    >>> found.periods["k95_kms"]                                                 # doctest: +SKIP
    """
    for name, count in [("periods", periods), ("amplitudes", amplitudes), ("phases", phases)]:
        if not 2 <= count <= 1000:
            raise ValueError(f"{name}: must be from 2 to 1000, not {count}")
    if not 0 <= full <= 65_535:
        raise ValueError(f"full: must be from 0 to 65535, not {full}")
    if without_best and with_best:
        raise ValueError("without_best, with_best: give one of them")
    _check_draws(draws)
    options: _core._LimitsOptions = {
        "min_period_d": _units.number("min_period_d", min_period_d),
        "max_period_d": _units.number("max_period_d", max_period_d),
        "periods": periods,
        "min_k_kms": _units.number("min_k_kms", min_k_kms),
        "max_k_kms": _units.number("max_k_kms", max_k_kms),
        "amplitudes": amplitudes,
        "phases": phases,
        "full": full,
        "subtract_best": True if without_best else False if with_best else None,
        "fixed": fixed,
        "draws": draws,
        "seed": seed,
    }
    text = Config(config)._as_text(observations is not None)
    with _folder(out, force) as (folder, scratch), shown("limits", progress) as show, _by_keyword():
        manner = (_threads(threads), show)
        said = _core.limits(text, _arrays(observations), options, os.fspath(folder), manner)
    return Limits(folder, said, scratch)


def plan(
    configs: ConfigLike | Sequence[ConfigLike],
    *,
    nights: Sequence[int] = (),
    next: int | None = None,
    period_d: float | None = None,
    alias_d: float | None = None,
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
    next : int, optional
        Choose this number of the nights: those that most reduce the uncertainty of K of one planet
        (``summary["schedules"][0]["next"]``). Not with ``nights``.
    period_d : float, optional
        Period of that planet (d); by default that of the config's planet.
    alias_d : float, optional
        Choose the nights that best tell that planet from one of this period (d).
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
    if next is not None and not 1 <= next <= 1000:
        raise ValueError(f"next: must be from 1 to 1000, not {next}")
    if next is not None and nights:
        raise ValueError("next: not with nights")
    if next is None and (period_d is not None or alias_d is not None):
        raise ValueError("period_d, alias_d: only with next")
    period_d, alias_d = (_units.number("period_d", one) for one in (period_d, alias_d))
    for name, period in (("period_d", period_d), ("alias_d", alias_d)):
        if period is not None and not 0 < period < float("inf"):
            raise ValueError(f"{name}: must be above 0, not {period}")
    wanted = None if next is None else (next, period_d, alias_d)
    schedules = [configs] if isinstance(configs, (Config, Mapping, str, os.PathLike)) else configs
    if not schedules:
        raise ValueError("configs: give one at least")
    texts = [Config(one)._as_text() for one in schedules]
    min_period_d, max_period_d = (_units.number("period_d", one) for one in (min_period_d, max_period_d))
    options = (min_period_d, max_period_d, fixed, maps, draws, seed)
    with _folder(out, force) as (folder, scratch), shown("plan", progress) as show:
        said = _core.plan(texts, (list(nights), wanted), options, os.fspath(folder), (_threads(threads), show))
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


def grid(
    config: ConfigLike,
    *,
    observations: Observations | None = None,
    fit_nodes: int | None = None,
    fit_radius: int | None = None,
    out: Folder | None = None,
    resume: bool = False,
    force: bool = False,
    threads: int | None = None,
    progress: bool | None = None,
) -> Grid:
    """Compute a likelihood grid, a map at every node, and fit a paraboloid around its highest node.

    The axes are those under ``grid`` in the config; all other parameters are fixed at the config's values. Ctrl-C
    stops it; finished nodes are kept, and the message of the `KeyboardInterrupt` says how to resume.

    Parameters
    ----------
    config : Config, dict, str or path
        The star, with ``grid.axes``: one to three parameters.
    observations : Observations, optional
        Profiles, in place of those named in the config.
    fit_nodes : int, optional
        Fit the paraboloid to so many of the highest nodes; by default to all up to 4 above the lowest chi2, or the
        fewest it needs.
    fit_radius : int, optional
        Fit it to nodes at most so many steps from the highest one along each axis.
    out : str or path, optional
        Folder for the files; by default a temporary one, deleted with the result.
    resume : bool
        Resume the grid in the folder, bit-identical to an uninterrupted one; start it if there is none. A finished
        grid gets a new paraboloid.
    force : bool
        Replace the grid that is in the folder.
    threads : int, optional
        Number of threads; all processors by default. Results do not depend on it.
    progress : bool, optional
        Show progress; by default in notebooks and on terminals.

    Returns
    -------
    Grid

    Examples
    --------
    >>> scan = dimcmc.grid("configs/demo.json", out="runs/demo_grid")            # doctest: +SKIP
    >>> scan.paraboloid.parameters.k_kms.vertex                                  # doctest: +SKIP
    0.103
    """
    if resume and out is None:
        raise ValueError("out: name the grid to resume")
    for name, count in [("fit_nodes", fit_nodes), ("fit_radius", fit_radius)]:
        if count is not None and count < 1:
            raise ValueError(f"{name}: must be 1 or more, not {count}")
    text = Config(config)._as_text(observations is not None)
    goes_on = resume and (Path(os.fspath(out or "")) / "landscape.json").is_file()
    with _folder(out, force or goes_on, resumable=True) as (folder, scratch), shown("grid", progress) as show:
        false_start = _core.is_false_start(os.fspath(folder))
        options = (force or false_start, goes_on and not false_start, fit_nodes, fit_radius)
        manner = (_threads(threads), show)
        said = _core.grid(text, _arrays(observations), options, os.fspath(folder), manner)
    return Grid(folder, said, scratch)


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
    with _folder(out, force or goes_on, resumable=True) as (folder, scratch), shown("sample", progress) as show:
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


@contextmanager
def _by_keyword() -> Iterator[None]:
    """Errors of options that the command line has, too, with the names of keyword arguments."""
    try:
        yield
    except ValueError as error:
        raise ValueError(_OPTION.sub(lambda found: found[1].replace("-", "_"), str(error))) from None


_OPTION = re.compile(r"(?<![\w/.-])--([a-z][a-z-]*)")


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
    out: Folder | None, may_hold: bool, *, resumable: bool = False
) -> Iterator[tuple[Path, Scratch | None]]:
    """Where results go: a folder that is absent or empty, unless the user insists; or one that goes with the result.

    Of a run or a grid that was interrupted, the latter stays.
    """
    if out is not None:
        folder = Path(out)
        if folder.exists() and not folder.is_dir():
            raise NotADirectoryError(f"out: {folder} is not a folder")
        if folder.is_dir() and not may_hold and any(folder.iterdir()) and not _core.is_false_start(os.fspath(folder)):
            hint = "force=True to replace the files in it" + (", or resume=True to resume" if resumable else "")
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
