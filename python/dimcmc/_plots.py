"""Figures by matplotlib, and the numbers behind all figures as arrays."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _plot_chains, _plot_maps, _plot_profiles, _plot_searches, _plot_velocities, _sheet
from ._sheet import Arrays, Sheet

if TYPE_CHECKING:
    from ._results import Result

# tables by the names of figures
_TABLES = {
    "rv": "rv.csv",
    "periodogram": "periodogram.csv",
    "periodogram_2": "periodogram_2.csv",
    "profiles": "profiles.csv",
    "residuals": "profiles.csv",
    "changes": "profiles.csv",
    "lightcurve": "lightcurve.csv",
    "indicators": "indicators.csv",
    "limits": "limits.csv",
    "plan": "plan.csv",
    "completeness": "completeness.csv",
    "completeness_mass": "completeness.csv",
}
_Painter = Callable[["Result", Arrays], Sheet]
_PAINTERS: dict[str, _Painter] = {
    "corner": _plot_chains.corner,
    "traces": _plot_chains.traces,
    "autocorrelation": _plot_chains.autocorrelation,
    "optimum": _plot_chains.optimum,
    "landscape": _plot_chains.landscape,
    "comparison": _plot_chains.comparison,
    "rv": _plot_velocities.rv,
    "lightcurve": _plot_velocities.lightcurve,
    "indicators": _plot_velocities.indicators,
    "profiles": _plot_profiles.profiles,
    "residuals": _plot_profiles.residuals,
    "changes": _plot_profiles.changes,
    "maps": partial(_plot_maps.maps, projection="polar"),
    "maps_mollweide": partial(_plot_maps.maps, projection="mollweide"),
    "periodogram": partial(_plot_searches.periodogram, name="periodogram"),
    "periodogram_2": partial(_plot_searches.periodogram, name="periodogram_2"),
    "limits": _plot_searches.limits,
    "plan": _plot_searches.plan,
    "plan_next": _plot_searches.plan_next,
    "completeness": partial(_plot_searches.completeness, name="completeness"),
    "completeness_mass": partial(_plot_searches.completeness, name="completeness_mass"),
    "rates": _plot_searches.rates,
}


def _is_map(name: str) -> bool:
    """Whether a figure is of one map: of a star, or of a season."""
    return name == "map" or name.removeprefix("map_").isdecimal()


def arrays(result: Result, name: str) -> Arrays:
    """The numbers behind a figure."""
    known = result.figures
    if name not in known:
        raise KeyError(f"no figure {name}: there are {', '.join(known)}")
    if name in _TABLES and (result.folder / _TABLES[name]).is_file():
        return result._table(_TABLES[name])
    if name == "profiles":
        return _simulated_profiles(result)
    if name.startswith("maps") or _is_map(name):
        return _plot_maps.maps_arrays(result)
    if name == "corner":
        samples: Arrays = getattr(result, "samples")
        return {of: samples[of] for of in getattr(result, "names")}
    if name in ("traces", "autocorrelation"):
        chain = getattr(result, "chain")
        return {of: chain[..., k] for k, of in enumerate(getattr(result, "names"))}
    if name == "landscape":
        axes: Arrays = getattr(result, "axes")
        return {**axes, "log_likelihood": getattr(result, "log_likelihood")}
    if name == "rates":
        return _plot_searches.rates_arrays(result)
    if name == "plan_next":
        return _plot_searches.plan_next_arrays(result)
    if name == "comparison":
        return _plot_chains.comparison_arrays(result)
    if name == "optimum":
        best = result._json("optimum.json")
        values = [np.array([best[key][of] for of in best.names]) for key in ("parameters", "sd")]
        return {"best": values[0], "sd": values[1], "covariance": np.array(best.covariance)}
    raise ValueError(f"figure {name} has no arrays")


def _simulated_profiles(result: Result) -> Arrays:
    """Profiles of a simulation, as in the table of a map."""
    observed = getattr(result, "observations")
    star = result._json("truth.json").get("config", {}).get("star", {})
    bins = observed.intensity.shape[1]
    cycle = (observed.times_d - (star.get("epoch_d") or 0.0)) / star["rotation_period_d"]
    each = {"profile": np.arange(len(observed), dtype=np.float64), "time_d": observed.times_d, "cycle": cycle}
    return {
        **{key: np.repeat(values, bins) for key, values in each.items()},
        "velocity_kms": observed.velocities_kms.ravel(),
        "observed": observed.intensity.ravel(),
        "sigma": observed.sigma.ravel(),
    }


def draw(result: Result, name: str, ax: Any, width: float | None, style: Any) -> Any:
    """Draw a figure on matplotlib axes; the axes, an array of them where there are several."""
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise ImportError("matplotlib is needed: pip install matplotlib") from error
    numbers = arrays(result, name)
    # of two kinds in one folder the second has another name
    painter = partial(_plot_maps.one_map, name=name) if _is_map(name) else _PAINTERS.get(name)
    if painter is None:
        raise ValueError(f"figure {name} is not drawn by matplotlib; its numbers are in figure_data({name!r})")
    return _sheet.draw(name, partial(painter, result, numbers), ax, width, style)
