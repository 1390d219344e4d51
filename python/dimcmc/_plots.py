"""Figures by matplotlib, and the numbers behind all figures as arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ._results import Result

Array = NDArray[np.float64]
Arrays = dict[str, Array]

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
_MAPS = ("map", "maps", "maps_mollweide")
_CHAIN = ("traces", "autocorrelation")
# Julian dates are above this (d)
_JULIAN_D = 2_400_000.0
_WIDTH_IN = 7.0


def arrays(result: Result, name: str) -> Arrays:
    """The numbers behind a figure."""
    known = result.figures
    if name not in known:
        raise KeyError(f"no figure {name}: there are {', '.join(known)}")
    if name in _TABLES and (result.folder / _TABLES[name]).is_file():
        return result._table(_TABLES[name])
    if name in _MAPS or name.startswith("map_"):
        return _maps(result)
    if name == "corner":
        samples: dict[str, Array] = getattr(result, "samples")
        return {of: samples[of] for of in getattr(result, "names")}
    if name in _CHAIN:
        chain: Array = getattr(result, "chain")
        return {of: chain[..., k] for k, of in enumerate(getattr(result, "names"))}
    if name == "landscape":
        axes: Arrays = getattr(result, "axes")
        return {**axes, "log_likelihood": getattr(result, "log_likelihood")}
    if name == "rates":
        return _rates_arrays(result)
    if name == "optimum":
        best = result._json("optimum.json")
        values = [np.array([best[key][of] for of in best.names]) for key in ("parameters", "sd")]
        return {"best": values[0], "sd": values[1], "covariance": np.array(best.covariance)}
    raise ValueError(f"figure {name} has no arrays")


def _maps(result: Result) -> Arrays:
    content = result._json("map.json")
    maps = content.get("maps") or [content]
    columns = ["time_d", "spot_filling", "brightness", "sigma_spot_filling"]
    found = {key: np.array([one[key] for one in maps], dtype=np.float64) for key in columns if key in maps[0]}
    pixels = ["longitude_deg", "latitude_deg", "area_fraction"]
    return {**{key: np.array(content[key], dtype=np.float64) for key in pixels}, **found}


def draw(result: Result, name: str, ax: Any, width: float | None, style: Any) -> Any:
    """Draw a figure on matplotlib axes; the axes, an array of them where there are several."""
    try:
        import matplotlib.pyplot as plt
    except ImportError as error:
        raise ImportError("matplotlib is needed: pip install matplotlib") from error
    numbers = arrays(result, name)
    painter, rows, columns = _painter(name, numbers)
    with plt.style.context([] if style is None else style):
        if ax is None or ax is True:
            inches = _WIDTH_IN if width is None else width
            cell = inches / columns
            height = rows * (cell if painter is _corner else 0.6 * cell if painter is _surface else min(cell, 2.4))
            _, axes = plt.subplots(
                rows, columns, figsize=(inches, height), squeeze=False, layout="constrained"
            )
        else:
            axes = np.array(ax, dtype=object).reshape(-1)
            if axes.size != rows * columns:
                raise ValueError(f"ax: figure {name} has {rows * columns} panels, not {axes.size}")
            axes = axes.reshape(rows, columns)
        painter(result, numbers, axes)
    return axes[0, 0] if axes.size == 1 else axes


_Painter = Callable[["Result", Arrays, Any], None]


def _painter(name: str, numbers: Arrays) -> tuple[_Painter, int, int]:
    """What draws a figure, and how many rows and columns of panels it takes."""
    if name == "corner":
        return _corner, len(numbers), len(numbers)
    if name == "traces":
        return _traces, len(numbers), 1
    if name == "rv":
        return _velocities, 2, 1
    if name.startswith("periodogram"):
        return _periodogram, 1, 1
    if name == "limits":
        return _limits, 1, 1
    if name == "residuals":
        return _residuals, 1, 3
    if name == "completeness":
        return _completeness, 1, 1
    if name == "completeness_mass":
        return _completeness_mass, 1, 1
    if name == "rates":
        return _rates, 1, max(int(key.split("_")[1]) for key in numbers)
    if name in _MAPS or name.startswith("map_"):
        count = len(_values(numbers))
        columns = min(count, 3)
        return _surface, -(-count // columns), columns
    raise ValueError(f"figure {name} is not drawn by matplotlib; its numbers are in figure_data({name!r})")


def _labels(names: Sequence[str]) -> list[str]:
    units = {"_kms": " (km/s)", "_rad_d": " (rad/d)", "_d": " (d)", "_deg": " (deg)"}
    symbols = {"k_kms": "K (km/s)", "porb_over_prot": "$P_{orb}/P_{rot}$", "phi": "phase"}

    def label(name: str) -> str:
        if name in symbols:
            return symbols[name]
        for ending, unit in units.items():
            if name.endswith(ending):
                return name[: -len(ending)].replace("_", " ") + unit
        return name.replace("_", " ")

    return [label(name) for name in names]


def _corner(result: Result, numbers: Arrays, axes: Any) -> None:
    names, draws = list(numbers), list(numbers.values())
    labels = _labels(names)
    for row in range(len(names)):
        for column in range(len(names)):
            panel = axes[row, column]
            if column > row:
                panel.set_axis_off()
                continue
            if column == row:
                panel.hist(draws[row], bins=40, histtype="step", color="black")
                low, median, high = np.quantile(draws[row], [0.16, 0.5, 0.84])
                panel.axvspan(low, high, alpha=0.3)
                digits = max(0, int(1 - np.floor(np.log10(max(high - low, 1e-12) / 2))))
                errors = f"_{{-{median - low:.{digits}f}}}^{{+{high - median:.{digits}f}}}"
                panel.set_title(f"${median:.{digits}f}{errors}$", fontsize="small")
                panel.set_yticks([])
            else:
                bins = int(np.clip(0.7 * np.sqrt(draws[row].size), 10, 40))
                density, x, y = np.histogram2d(draws[column], draws[row], bins=bins)
                density = _smooth(density)
                # a border of nothing closes the contours
                centres = [np.concatenate([edges[:1], 0.5 * (edges[1:] + edges[:-1]), edges[-1:]]) for edges in (x, y)]
                levels = _levels(density, (0.95, 0.68))
                if len(levels) == 2:
                    top = [*levels, 1.01 * density.max()]
                    panel.contourf(*centres, np.pad(density, 1).T, levels=top, cmap="Blues", vmin=0.0)
                panel.set_xlim(x[0], x[-1])
                panel.set_ylim(y[0], y[-1])
            if row == len(names) - 1:
                panel.set_xlabel(labels[column])
            else:
                panel.set_xticklabels([])
            if column == 0 and row > 0:
                panel.set_ylabel(labels[row])
            elif column < row:
                panel.set_yticklabels([])


def _smooth(counts: Array) -> Array:
    """Counts under a binomial kernel of five cells."""
    kernel = np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16.0
    for axis in (0, 1):
        counts = np.apply_along_axis(np.convolve, axis, counts, kernel, mode="same")
    return counts


def _levels(density: Array, shares: Sequence[float]) -> list[float]:
    """Densities above which cells hold these shares of the draws; rising, without repetition."""
    falling = np.sort(density.ravel())[::-1]
    held = np.cumsum(falling) / falling.sum()
    return sorted({float(falling[int(np.searchsorted(held, share))]) for share in shares})


def _traces(result: Result, numbers: Arrays, axes: Any) -> None:
    for panel, (name, label) in zip(axes[:, 0], zip(numbers, _labels(list(numbers)))):
        for ensemble in range(numbers[name].shape[1]):
            panel.plot(numbers[name][:, ensemble, :4], color=f"C{ensemble}", alpha=0.5, linewidth=0.5)
        panel.set_ylabel(label)
    axes[-1, 0].set_xlabel("step")


def _days(times_d: Array) -> tuple[Array, str]:
    """Times less a constant, with the label of their axis."""
    first = float(np.min(times_d))
    if first < 1000.0:
        return times_d, "time (d)"
    zero = float(np.floor(first / 1000.0) * 1000.0)
    return times_d - zero, f"{'BJD' if first > _JULIAN_D else 'time'} − {zero:.0f} (d)"


def _velocities(result: Result, numbers: Arrays, axes: Any) -> None:
    days, label = _days(numbers["time_d"])
    moments = ("first_moment_kms", "first_moment_sigma_kms")
    if moments[0] not in numbers:
        moments = ("observed_kms", "sigma_kms")
    clean = ("rv_kms", "rv_sigma_kms") if "rv_kms" in numbers else ("filtered_kms", "sigma_kms")
    for panel, (rv, sigma), name in zip(axes[:, 0], (moments, clean), ("RV", "spot-corrected RV")):
        panel.errorbar(days, numbers[rv], numbers[sigma], fmt="o", color="black", ecolor="grey", markersize=3)
        panel.set_ylabel(f"{name} (km/s)")
    axes[-1, 0].set_xlabel(label)


def _periodogram(result: Result, numbers: Arrays, axes: Any) -> None:
    panel = axes[0, 0]
    panel.plot(numbers["period_d"], numbers["delta_ln_l"], color="black", linewidth=0.9)
    for level in result._json("periodogram.json").false_alarm.levels:
        panel.axhline(level.delta_ln_l, color="grey", linestyle="--", linewidth=0.7)
        share = f"{100 * level.false_alarm_probability:g} %"
        panel.annotate(share, (1.005, level.delta_ln_l), xycoords=("axes fraction", "data"), va="center")
    panel.set(xscale="log", xlabel="period (d)", ylabel="Δ ln L")


def _limits(result: Result, numbers: Arrays, axes: Any) -> None:
    panel = axes[0, 0]
    share = 100.0 * numbers["recovered"] / numbers["phases"]
    periods, speeds = np.unique(numbers["period_d"]), np.unique(numbers["k_kms"])
    grid = np.full((len(speeds), len(periods)), np.nan)
    at = np.searchsorted(speeds, numbers["k_kms"]), np.searchsorted(periods, numbers["period_d"])
    grid[at] = share
    mesh = panel.pcolormesh(periods, 1e3 * speeds, grid, cmap="cividis", vmin=0, vmax=100, shading="nearest")
    panel.figure.colorbar(mesh, ax=panel, label="recovered (% of the phases)")
    removed = result._json("limits.json").get("removed")
    if removed is not None:
        rotation = numbers["period_d"][0] / numbers["porb_over_prot"][0]
        period_d, k = removed.porb_over_prot * rotation, 1e3 * abs(removed.k_kms)
        panel.plot(period_d, k, "D", color="C0", markeredgecolor="white")
    panel.set(xscale="log", yscale="log", xlabel="period (d)", ylabel="K (m/s)")


def _completeness(result: Result, numbers: Arrays, axes: Any) -> None:
    _completeness_by(result, numbers, axes[0, 0], "k_kms", 1e3, "K (m/s)")


def _completeness_mass(result: Result, numbers: Arrays, axes: Any) -> None:
    _completeness_by(result, numbers, axes[0, 0], "msini_mjup", 1.0, "M sin i ($M_{Jup}$)")


def _completeness_by(result: Result, numbers: Arrays, panel: Any, size: str, factor: float, label: str) -> None:
    """Completeness of all stars by period and size, with the signals found."""
    content = result._json("survey.json")
    # the sum over stars is star 0: by K without a mass, by mass without K
    other = "msini_mjup" if size == "k_kms" else "k_kms"
    rows = (numbers["star"] == 0) & np.isnan(numbers[other])
    periods, sizes = np.unique(numbers["period_d"][rows]), np.unique(numbers[size][rows])
    stars = sum(star.counted for star in content.stars)
    grid = 100.0 / stars * numbers["completeness"][rows].reshape(len(periods), len(sizes)).T
    mesh = panel.pcolormesh(periods, factor * sizes, grid, cmap="cividis", vmin=0, vmax=100, shading="nearest")
    panel.figure.colorbar(mesh, ax=panel, label=f"completeness (% of {stars} stars)")
    for planets in content.boxes:
        if planets[size] is not None:
            (p1, p2), (s1, s2) = planets.period_d, (factor * edge for edge in planets[size])
            panel.plot([p1, p2, p2, p1, p1], [s1, s1, s2, s2, s1], color="C9")
    for star in content.stars:
        found = star.false_alarm_probability is not None
        if star.counted and found and star.false_alarm_probability < content.false_alarm_probability:
            panel.plot(star.period_d, factor * star[size], "D", color="C3", markeredgecolor="white")
    panel.set(xscale="log", yscale="log", xlabel="period (d)", ylabel=label)


def _rates_arrays(result: Result) -> Arrays:
    """Rates and densities of each posterior, by the number of its box and its group."""
    found: Arrays = {}
    for rate in result._json("survey.json").rates:
        key = f"box_{rate.box}_{'all' if rate.group is None else rate.group}"
        found[f"{key}_rate"], found[f"{key}_density"] = np.array(rate.rate), np.array(rate.density)
    return found


def _rates(result: Result, numbers: Arrays, axes: Any) -> None:
    for rate in result._json("survey.json").rates:
        panel = axes[0, rate.box - 1]
        label = f"{'all' if rate.group is None else rate.group}, {rate.stars} stars"
        line = panel.plot(100.0 * np.array(rate.rate), 0.01 * np.array(rate.density), label=label)
        low, high = (100.0 * edge for edge in rate.ci68)
        panel.axvspan(low, high, color=line[0].get_color(), alpha=0.2)
        # those of all stars come first
        end = max(0.0 if rate.group is None else panel.get_xlim()[1], 135.0 * rate.ci95[1])
        panel.set(xlim=(0.0, min(100.0, end)), xlabel="stars with a planet (%)", ylabel="probability density (1/%)")
        panel.legend()


def _residuals(result: Result, numbers: Arrays, axes: Any) -> None:
    cycles = numbers["cycle"]
    bins = np.unique(numbers["profile"], return_inverse=True)[1]
    order = np.argsort([cycles[bins == k][0] % 1.0 for k in range(bins.max() + 1)])
    lengths = np.bincount(bins)
    if np.ptp(lengths) > 0:
        raise ValueError("profiles of different lengths: see figure_data('residuals')")
    shape = len(lengths), lengths[0]
    table = {key: numbers[key].reshape(shape)[order] for key in ("velocity_kms", "observed", "model", "sigma")}
    mean = table["observed"].mean(axis=0)
    change = float(np.abs(table["observed"] - mean).max())
    shown = [
        ("observed − mean", 100 * (table["observed"] - mean), 100 * change, "% of the continuum"),
        ("model − mean", 100 * (table["model"] - mean), 100 * change, "% of the continuum"),
        ("observed − model", (table["observed"] - table["model"]) / table["sigma"], 4.0, "σ"),
    ]
    for panel, (title, values, reach, unit) in zip(axes[0], shown):
        rows = np.arange(shape[0])
        mesh = panel.pcolormesh(
            table["velocity_kms"][0], rows, values, cmap="RdBu_r", vmin=-reach, vmax=reach, shading="nearest"
        )
        panel.set(title=title, xlabel="velocity (km/s)")
        panel.figure.colorbar(mesh, ax=panel, label=unit)
    axes[0, 0].set_ylabel("profile, by rotation phase")


def _values(numbers: Arrays) -> Array:
    return numbers["brightness"] if "brightness" in numbers else numbers["spot_filling"]


def _surface(result: Result, numbers: Arrays, axes: Any) -> None:
    """Maps in plate carrée projection: matplotlib projections need their own axes."""
    longitude, latitude = np.meshgrid(np.arange(1.0, 360.0, 2.0), np.arange(-89.0, 90.0, 2.0))
    rings = np.unique(numbers["latitude_deg"])
    ring = np.abs(latitude.ravel()[:, None] - rings).argmin(axis=1)
    at = np.zeros(latitude.size, dtype=int)
    for k, of in enumerate(rings):
        pixels = np.flatnonzero(numbers["latitude_deg"] == of)
        here = ring == k
        at[here] = pixels[(longitude.ravel()[here] / 360.0 * len(pixels)).astype(int)]
    values = _values(numbers)
    middle = 1.0 if "brightness" in numbers else 0.0
    reach = float(np.quantile(np.abs(values - middle), 0.999)) or 0.05
    ends = {"vmin": middle - reach, "vmax": middle + reach}
    colours = "PuOr" if "brightness" in numbers else "PuOr_r"
    flat = axes.ravel()
    for k, panel in enumerate(flat):
        if k >= len(values):
            panel.set_axis_off()
            continue
        grid = values[k][at].reshape(latitude.shape)
        mesh = panel.pcolormesh(longitude, latitude, grid, cmap=colours, shading="nearest", **ends)
        if "time_d" in numbers:
            panel.set_title(f"{numbers['time_d'][k]:.2f} d", fontsize="small")
        if k + axes.shape[1] >= len(values):
            panel.set_xlabel("longitude (deg)")
        if k % axes.shape[1] == 0:
            panel.set_ylabel("latitude (deg)")
    label = "brightness" if "brightness" in numbers else "spot filling factor"
    flat[0].figure.colorbar(mesh, ax=list(flat), label=label, fraction=0.03)
