"""Figures of parameters: corner plots, traces, autocorrelation, likelihood grids, and estimates compared."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from ._sheet import (
    BLUE,
    GREEN,
    GREY,
    SERIES,
    VERMILION,
    Array,
    Arrays,
    Bar,
    Panel,
    Sheet,
    edges,
    grid,
    ink,
    legend_above,
    limits,
    log_ticks,
    rotation_period_d,
)
from ._symbols import Shown, decimals, interval, shown

if TYPE_CHECKING:
    from ._results import Record, Result

# shares of draws that contours hold, and the root of the difference of chi2 there for two Gaussian parameters
_SHARES, _RADII = (0.95, 0.68), (2.448, 1.510)
# cells of a density along each axis, and its bandwidth over that of Scott's rule
_CELLS, _NARROWED = 96, 0.9
# differences of chi2 of contours of a likelihood grid, and the largest root that has a colour of its own
_LEVELS, _DARKEST = (2.30, 5.99), 10.0
# standard deviations from the median within which an injected value widens an axis
_NEAR = 8.0
# walkers of each ensemble that are drawn, and their steps, about
_WALKERS, _STEPS = 4, 500
# window of Sokal's rule
_WINDOW = 5.0
_INJECTED = {"color": VERMILION, "linestyle": "--", "linewidth": 1.0}


def nearest_turn(values: Any, centre: float) -> Any:
    """Values of a periodic parameter (period 1) by the whole number of turns that brings them nearest to `centre`."""
    return values - np.round(values - centre)


class _Parameter:
    """A parameter of a chain: how it is shown, its prior, its summary, and its injected value."""

    def __init__(self, name: str, manifest: Record, summary: Record) -> None:
        self.name, self.of = name, summary.parameters[name]
        prior = manifest.priors[name]
        self.shown = shown(name, rotation_period_d(manifest), self.of.ci95[1])
        self.log = prior.prior == "log-uniform"
        self.mode = nearest_turn(self.of.mode, self.of.median) if prior.prior == "periodic" else None
        bounds = (prior.get("min", -np.inf), prior.get("max", np.inf))
        self.bounds = bounds if self.mode is None else (self.mode - 0.5, self.mode + 0.5)
        truth = (manifest.get("truth") or {}).get(name)
        self.truth = None if truth is None else float(self.unwrapped(truth))

    def unwrapped(self, values: Any) -> Any:
        """Values in the turn of the mode."""
        return values if self.mode is None else nearest_turn(values, self.mode)

    def values(self, draws: Array) -> Array:
        """Draws in the unit shown."""
        scaled: Array = self.shown.factor * self.unwrapped(draws)
        return scaled

    def is_near(self) -> bool:
        """Whether the draws do not shrink beside the injected value."""
        return self.truth is not None and abs(self.truth - self.of.median) < _NEAR * self.of.sd

    def range(self, values: Array) -> tuple[float, float]:
        """All but a thousandth of the draws to either side, with some room, within the bounds of the prior."""
        ends = np.quantile(values, [0.001, 0.999])
        also = [self.shown.factor * (self.truth or 0.0)] if self.is_near() else []
        low, high = limits([ends, also], 0.08, self.log)
        bounds = [self.shown.factor * end for end in self.bounds]
        return max(low, bounds[0]), min(high, bounds[1])


def _parameters(result: Result) -> list[_Parameter]:
    manifest, summary = result._json("manifest.json"), getattr(result, "summary")
    return [_Parameter(name, manifest, summary) for name in summary.names]


def _empty(panel: Any) -> None:
    panel.set_axis_off()


def _corner(
    parameters: Sequence[tuple[Shown, tuple[float, float], str, float | None, bool]],
    diagonal: Callable[[Any, int], None],
    pair: Callable[[Any, int, int], None],
    keys: Sequence[tuple[str, float]],
) -> Sheet:
    """A triangle of panels: of each parameter its range, title, injected value, and whether its axis is logarithmic."""
    n = len(parameters)
    ticks = max(3, 8 - n)
    size = {"fontsize": "small"} if n > 5 else {}

    def paint(row: int, column: int, panel: Any) -> None:
        of_x, x_range, title, x_truth, x_log = parameters[column]
        of_y, y_range, _, y_truth, y_log = parameters[row]
        if x_log:
            panel.set_xscale("log")
        if row == column:
            diagonal(panel, row)
            panel.set_title(title, fontsize="small")
            panel.set_yticks([])
        else:
            if y_log:
                panel.set_yscale("log")
            pair(panel, column, row)
            panel.set_ylim(y_range)
            if y_log:
                log_ticks(panel.yaxis, ticks)
            else:
                panel.locator_params(axis="y", nbins=ticks)
            if y_truth is not None:
                panel.axhline(of_y.factor * y_truth, **_INJECTED)
        if x_truth is not None:
            panel.axvline(of_x.factor * x_truth, **_INJECTED)
        panel.set_xlim(x_range)
        if x_log:
            log_ticks(panel.xaxis, ticks)
        else:
            panel.locator_params(axis="x", nbins=ticks)
        panel.tick_params(labelbottom=row == n - 1, labelleft=column == 0 and row > 0)
        if row == n - 1:
            panel.set_xlabel(of_x.label, **size)
        if column == 0 and row > 0:
            panel.set_ylabel(of_y.label, **size)

    def key(panel: Any) -> None:
        from matplotlib.patches import Patch

        panel.set_axis_off()
        handles: list[Any] = [Patch(color=BLUE, alpha=alpha, label=text) for text, alpha in keys]
        if any(truth is not None for *_, truth, _ in parameters):
            handles += panel.plot([], [], label="injected", **_INJECTED)
        panel.legend(handles=handles, loc="upper right")

    def one(row: int, column: int) -> Panel:
        if column > row:
            return key if (row, column) == (0, n - 1) else _empty
        return partial(paint, row, column)

    panels = [one(row, column) for row in range(n) for column in range(n)]
    return Sheet(panels, grid(panels, n), 1.0, margins=(0.6, 0.1, 0.5, 0.4))


def corner(result: Result, numbers: Arrays) -> Sheet:
    """Posterior of the sampled parameters: histograms with the 68 % interval, contours of 68 and 95 %."""
    parameters = _parameters(result)
    draws = [parameter.values(numbers[parameter.name]) for parameter in parameters]
    ranges = [parameter.range(values) for parameter, values in zip(parameters, draws)]
    ess = [parameter.of.ess for parameter in parameters if parameter.of.get("ess") is not None]
    effective = min(ess, default=100.0)

    def title(parameter: _Parameter) -> str:
        of, factor = parameter.of, parameter.shown.factor
        if of.get("unconstrained"):
            return f"{parameter.shown.symbol}\nunconstrained"
        return f"{parameter.shown.label}\n{interval(factor * of.median, *(factor * end for end in of.ci68))}"

    def diagonal(panel: Any, k: int) -> None:
        parameter, values = parameters[k], draws[k]
        spaced = np.geomspace if parameter.log else np.linspace
        counts, borders = np.histogram(values, spaced(*ranges[k], 41))
        panel.stairs(counts, borders, color=BLUE, alpha=0.25, fill=True)
        panel.stairs(counts, borders, color=ink(), linewidth=0.6)
        if not parameter.of.get("unconstrained"):
            low, high = (parameter.shown.factor * end for end in parameter.of.ci68)
            # the steps between the ends of the interval
            inside = np.clip(borders, low, high)
            panel.stairs(np.where(np.diff(inside) > 0.0, counts, 0), inside, color=BLUE, alpha=0.45, fill=True)
        panel.set_ylim(0.0, 1.05 * max(1, counts.max()))

    def pair(panel: Any, i: int, j: int) -> None:
        scales = [np.log if parameters[k].log else np.asarray for k in (i, j)]
        back = [np.exp if parameters[k].log else np.asarray for k in (i, j)]
        x, y = (scale(draws[k]) for scale, k in zip(scales, (i, j)))
        ends = [scale(np.array(ranges[k])) for scale, k in zip(scales, (i, j))]
        found = _density(x, y, ends, effective)
        if found is not None:
            centres, density, levels = found
            places = [of(centre) for of, centre in zip(back, centres)]
            top = [*levels, max(1.01 * density.max(), 1.01 * levels[-1])]
            panel.contourf(*places, density.T, levels=top, colors=[BLUE, BLUE], alpha=0.25)
            panel.contourf(*places, density.T, levels=top[-2:], colors=[BLUE], alpha=0.4)
            panel.contour(*places, density.T, levels=levels, colors=BLUE, linewidths=0.7)

    shown_as = [
        (one.shown, ends, title(one), one.truth, one.log) for one, ends in zip(parameters, ranges)
    ]
    return _corner(shown_as, diagonal, pair, [("68 % of the posterior", 0.55), ("95 % of the posterior", 0.25)])


def _density(x: Array, y: Array, ends: Sequence[Array], effective: float) -> Any:
    """Density of draws in a rectangle: centres of its cells, density, and levels that hold 95 and 68 % of the draws.

    A histogram under a Gaussian, normalised inside so that a posterior that ends at the edge keeps its height there.
    """
    counts, *borders = np.histogram2d(x, y, bins=_CELLS, range=[tuple(end) for end in ends])
    if counts.sum() == 0.0 or not (x.std() > 0.0 and y.std() > 0.0):
        return None
    correlation = np.corrcoef(x, y)[0, 1]
    density = counts
    for axis, values in enumerate((x, y)):
        # of several modes or long tails the densest part counts
        quartiles = np.subtract(*np.quantile(values, [0.75, 0.25])) / 1.349
        scale = min(values.std(), quartiles) if quartiles > 0.0 else values.std()
        width = _NARROWED * scale * effective ** (-1.0 / 6.0) * np.sqrt(1.0 - 0.9 * correlation**2)
        cells = max(width / (borders[axis][1] - borders[axis][0]), 0.5)
        apart = np.subtract.outer(np.arange(_CELLS), np.arange(_CELLS))
        kernel = np.exp(-0.5 * (apart / cells) ** 2)
        density = np.moveaxis(np.tensordot(kernel / kernel.sum(axis=1, keepdims=True), density, (1, axis)), 0, axis)
    order = np.argsort(density, axis=None)[::-1]
    held = np.cumsum(counts.ravel()[order]) / counts.sum()
    levels = [float(density.ravel()[order[np.searchsorted(held, share)]]) for share in _SHARES]
    if not 0.0 < levels[0] < levels[1]:
        return None
    # a border of nothing closes the contours
    centres = [np.concatenate([edge[:1], 0.5 * (edge[1:] + edge[:-1]), edge[-1:]]) for edge in borders]
    return centres, np.pad(density, 1), levels


def optimum(result: Result, numbers: Arrays) -> Sheet:
    """The best parameters with the Gaussian of the curvature there: ellipses of 68 and 95 %."""
    content = result._json("optimum.json")
    best, sd, covariance = numbers["best"], numbers["sd"], numbers["covariance"]
    if not content.well_defined or not np.all(np.isfinite(sd) & (sd > 0.0)):
        file = result.folder / "optimum.json"
        raise ValueError(f"{file}: no well-defined maximum, so there are no error bars to draw")
    period_d, truths = rotation_period_d(content), content.get("truth") or {}
    shown_as = []
    for name, x, error in zip(content.names, best, sd):
        of = shown(name, period_d, x + 2.0 * error)
        truth = truths.get(name)
        if truth is not None and name in ("phi", "phi2"):
            truth = float(nearest_turn(truth, x))
        ends = (of.factor * (x - 3.6 * error), of.factor * (x + 3.6 * error))
        value = interval(of.factor * x, of.factor * (x - error), of.factor * (x + error))
        shown_as.append((of, ends, f"{of.label}\n{value}", truth, False))
    factors = np.array([of.factor for of, *_ in shown_as])
    best, covariance = factors * best, np.outer(factors, factors) * covariance

    def diagonal(panel: Any, k: int) -> None:
        u = np.linspace(-3.6, 3.6, 145)
        x, bell = best[k] + u * np.sqrt(covariance[k, k]), np.exp(-0.5 * u**2)
        panel.fill_between(x, bell, color=BLUE, alpha=0.25, linewidth=0.0)
        panel.plot(x, bell, color=BLUE, linewidth=0.8)
        panel.set_ylim(0.0, 1.12)

    def pair(panel: Any, i: int, j: int) -> None:
        for radius, alpha in zip(_RADII, (0.25, 0.4)):
            x, y = _ellipse(best[[i, j]], covariance[np.ix_([i, j], [i, j])], radius)
            panel.fill(x, y, color=BLUE, alpha=alpha, linewidth=0.0)
            panel.plot(x, y, color=BLUE, linewidth=0.7)

    return _corner(shown_as, diagonal, pair, [("68 % by the curvature", 0.55), ("95 % by the curvature", 0.25)])


def _ellipse(centre: Array, covariance: Array, radius: float) -> Array:
    """The ellipse at so many standard deviations of a Gaussian."""
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    circle = np.array([np.cos(angle), np.sin(angle)])
    outline: Array = centre[:, np.newaxis] + radius * np.linalg.cholesky(covariance) @ circle
    return outline


def traces(result: Result, numbers: Arrays) -> Sheet:
    """Walkers of each ensemble over the steps, the burn-in grey."""
    parameters = _parameters(result)
    discarded = getattr(result, "summary").discarded_steps

    def paint(parameter: _Parameter, panel: Any) -> None:
        values = parameter.values(numbers[parameter.name])
        steps = np.arange(0, len(values), -(-len(values) // _STEPS))
        panel.axvspan(0, discarded, color=GREY, alpha=0.2, linewidth=0.0, label="burn-in")
        for ensemble in range(values.shape[1]):
            lines = values[steps][:, ensemble, :_WALKERS]
            panel.plot(steps, lines, color=SERIES[ensemble % len(SERIES)], alpha=0.55, linewidth=0.5)
            panel.plot([], [], color=SERIES[ensemble % len(SERIES)], label=f"ensemble {ensemble + 1}")
        if parameter.truth is not None:
            low, high = panel.get_ylim()
            panel.axhline(parameter.shown.factor * parameter.truth, color=ink(), linestyle="--", label="injected")
            if not parameter.is_near():
                panel.set_ylim(low, high)
        if parameter.log:
            panel.set_yscale("log")
            log_ticks(panel.yaxis)
        panel.set_xlim(0, max(1, len(values) - 1))
        panel.locator_params(axis="x", integer=True)
        panel.set_ylabel(parameter.shown.label)
        panel.tick_params(labelbottom=parameter is parameters[-1])
        if parameter is parameters[0]:
            legend_above(panel)
        if parameter is parameters[-1]:
            panel.set_xlabel("step")

    panels = [partial(paint, parameter) for parameter in parameters]
    return Sheet(panels, grid(panels, 1), 0.1 + 0.15 * len(panels))


def autocorrelation(result: Result, numbers: Arrays) -> Sheet:
    """Autocorrelation of the walkers around the mean of their ensemble, and its integrated time as the chain grows."""
    parameters, summary = _parameters(result), getattr(result, "summary")
    series = [parameter.values(numbers[parameter.name])[summary.discarded_steps :] for parameter in parameters]
    kept = len(series[0])
    looks = [
        {"color": SERIES[k % len(SERIES)], "linestyle": ["-", ":"][k // len(SERIES) % 2], "label": one.shown.symbol}
        for k, one in enumerate(parameters)
    ]

    def function(panel: Any) -> None:
        longest = max([1.0, *(time for time in (_time(one) for one in series) if np.isfinite(time))])
        lags = min(max(int(np.ceil(8.0 * longest)), 10), max(1, kept // 2))
        panel.axhline(0.0, color=GREY, linewidth=0.6)
        for one, look in zip(series, looks):
            panel.plot(_function(one)[: lags + 1], **look)
        panel.set(xlabel="lag (steps)", ylabel="autocorrelation", xlim=(0, lags), ylim=(-0.25, 1.05))
        panel.locator_params(axis="x", integer=True)
        panel.legend(ncols=2, loc="upper right")

    def growth(panel: Any) -> None:
        lengths = np.unique(np.round(np.geomspace(min(10, kept), kept, 13)).astype(int))
        lengths = lengths[lengths >= 4]
        for one, look in zip(series, looks):
            panel.plot(lengths, [_time(one[:steps]) for steps in lengths], **look)
        panel.set(xscale="log", yscale="log", xlabel="steps after the burn-in")
        panel.set_ylabel(r"autocorrelation time $\tau$ (steps)")
        panel.set_xlim(min(10, kept), max(kept, 20))
        for axis in (panel.xaxis, panel.yaxis):
            log_ticks(axis)
        said = "converged" if summary.converged else "not converged"
        panel.set_title(said, loc="left")

    return Sheet([function, growth], [[0, 1]], 0.4, main=function)


def _covariances(series: Array) -> Array:
    """Autocovariance at all lags, of all walkers around the mean of their ensemble; times the number of values."""
    centred = series - series.mean(axis=(0, 2), keepdims=True)
    steps = len(centred)
    spectrum = np.fft.rfft(centred.reshape(steps, -1), n=2 * steps, axis=0)
    sums: Array = np.fft.irfft(np.abs(spectrum) ** 2, axis=0)[:steps].sum(axis=1)
    return sums


def _function(series: Array) -> Array:
    """Autocorrelation at all lags; NaN of what does not vary."""
    covariances = _covariances(series)
    return covariances / covariances[0] if covariances[0] > 0.0 else np.full(len(covariances), np.nan)


def _time(series: Array) -> float:
    """Integrated autocorrelation time by Sokal's window; NaN of what does not vary."""
    function = _function(series)[: len(series) // 2 + 1]
    times = 2.0 * np.cumsum(function) - 1.0
    closed = np.flatnonzero(np.arange(len(times)) >= _WINDOW * times)
    return float(times[closed[0]] if closed.size else times[-1])


class _Landscape:
    """A likelihood grid: nodes of each axis, differences of chi2, the lowest node, and the paraboloid."""

    def __init__(self, result: Result, numbers: Arrays) -> None:
        content = result._json("landscape.json")
        self.names = [str(axis.name) for axis in content.grid.axes]
        self.nodes = [_nodes(axis, numbers[axis.name]) for axis in content.grid.axes]
        if np.all(np.isnan(numbers["log_likelihood"])):
            raise ValueError(f"{result.folder / 'landscape.jsonl'}: no node has a value")
        top = np.nanmax(numbers["log_likelihood"])
        self.delta: Array = 2.0 * (top - numbers["log_likelihood"])
        self.lowest = np.unravel_index(np.nanargmin(self.delta), self.delta.shape)
        largest = [float(np.max(nodes)) for nodes in self.nodes]
        self.shown = [shown(name, None, most) for name, most in zip(self.names, largest)]
        self.turn = [0.5 * (nodes[0] + nodes[-1]) if axis.periodic else None
                     for axis, nodes in zip(content.grid.axes, self.nodes)]  # fmt: skip
        truth = content.get("truth") or {}
        self.truth = [self._turned(k, truth[name]) if name in truth else None for k, name in enumerate(self.names)]
        self.vertex: Array | None = None
        found = result._json("paraboloid.json") if (result.folder / "paraboloid.json").is_file() else None
        if found is not None and found.get("parameters"):
            of = [found.parameters[name] for name in self.names]
            self.vertex = np.array([self._turned(k, one.vertex) for k, one in enumerate(of)])
            self.error = np.array([one.error for one in of])
            self.covariance = np.array(found.covariance)

    def _turned(self, k: int, x: float) -> float:
        """A value in the turn of its axis."""
        turn = self.turn[k]
        return float(x if turn is None else nearest_turn(x, turn))

    def axis(self, k: int) -> Array:
        """Nodes in the unit shown."""
        return self.shown[k].factor * self.nodes[k]


def _nodes(axis: Record, values: Array) -> Array:
    """Nodes of an axis, rising: a periodic one leaves [0, 1) rather than wrap."""
    return axis.min + (values - values[0]) % 1.0 if axis.periodic else values


def landscape(result: Result, numbers: Arrays) -> Sheet:
    """A likelihood grid: slices through its highest node, and of three axes the lowest chi2 over the third."""
    of = _Landscape(result, numbers)
    if len(of.names) == 1:
        return Sheet([partial(_curve, of)], [[0]], 0.7)
    panels: list[Panel] = []
    rows = [False, True] if len(of.names) == 3 else [False]
    for lowest in rows:
        panels += [partial(_plane, of, pair, lowest) for pair in combinations(range(len(of.names)), 2)]
    columns = len(panels) // len(rows)
    bars = [Bar(r"$\sqrt{\Delta\chi^2}$", range(len(panels)))]
    return Sheet(panels, grid(panels, columns), 0.4 * len(rows) if columns > 1 else 0.8, bars=bars)


def _curve(of: _Landscape, panel: Any) -> None:
    """The grid of a single parameter."""
    x, factor = of.axis(0), of.shown[0].factor
    highest = min(max(1.0, float(np.nanmax(of.delta))), _DARKEST**2)
    ends = edges(x)[[0, -1]]
    panel.plot(x, of.delta, "o", color=ink(), markersize=3.6, label="nodes")
    if of.vertex is not None:
        line = np.linspace(ends[0], ends[1], 201)
        panel.plot(line, ((line / factor - of.vertex[0]) / of.error[0]) ** 2, color=VERMILION, label="paraboloid")
    if of.truth[0] is not None:
        panel.axvline(factor * of.truth[0], label="injected", **_INJECTED)
    panel.set(xlim=ends, ylim=(-0.05 * highest, highest), xlabel=of.shown[0].label, ylabel=r"$\Delta\chi^2$")
    panel.legend()


def _plane(of: _Landscape, pair: tuple[int, int], lowest: bool, panel: Any) -> Any:
    """Two axes: the slice through the lowest node, or the lowest over the other axis."""
    i, j = pair
    others = [k for k in range(len(of.names)) if k not in pair]
    values = of.delta
    for k in others:
        nothing = np.where(np.isnan(values), np.inf, values)
        values = nothing.min(axis=k) if lowest else np.take(values, of.lowest[k], axis=k)
        values = np.where(np.isinf(values), np.nan, values)
        spacing = of.nodes[k][1] - of.nodes[k][0]
        at = f"{of.shown[k].factor * of.nodes[k][of.lowest[k]]:.{decimals(of.shown[k].factor * spacing)}f}"
        symbol = of.shown[k].symbol
        panel.set_title(f"lowest over {symbol}" if lowest else f"slice at {symbol} = {at} {of.shown[k].unit}".rstrip())
    x, y = of.axis(i), of.axis(j)
    look = {"cmap": "cividis_r", "vmin": 0.0, "vmax": _DARKEST, "shading": "flat"}
    mesh = panel.pcolormesh(edges(x), edges(y), np.sqrt(values).T, **look)
    panel.contour(x, y, values.T, levels=_LEVELS, colors="#282828", alpha=0.6, linewidths=2.4)
    panel.plot([], [], color="#282828", alpha=0.6, linewidth=2.4, label=r"$\Delta\chi^2$ = 2.30, 5.99")
    if of.vertex is not None:
        factors = np.array([of.shown[k].factor for k in pair])
        _paraboloid(of, pair, factors, lowest or not others, panel)
    if of.truth[i] is not None and of.truth[j] is not None:
        place = [of.shown[k].factor * (of.truth[k] or 0.0) for k in pair]
        panel.plot(*place, "x", color=VERMILION, markersize=5.5, label="injected")
    panel.set(xlabel=of.shown[i].label, ylabel=of.shown[j].label)
    if pair == (0, 1) and not lowest:
        legend_above(panel, at=(0.5, 1.1 if others else 1.0), fontsize="x-small" if others else None)
    return mesh


def _paraboloid(of: _Landscape, pair: tuple[int, int], factors: Array, projected: bool, panel: Any) -> None:
    """Ellipses of the paraboloid, projected onto the plane with error bars at the vertex, or cut by it."""
    covariance = of.covariance if projected else np.linalg.inv(of.covariance)
    covariance = covariance[np.ix_(pair, pair)]
    covariance = np.outer(factors, factors) * (covariance if projected else np.linalg.inv(covariance))
    vertex = factors * np.array([(of.vertex if of.vertex is not None else [])[k] for k in pair])
    for k, level in enumerate(_LEVELS):
        label = "paraboloid" if k == 0 else None
        panel.plot(*_ellipse(vertex, covariance, np.sqrt(level)), color=VERMILION, label=label)
    if projected:
        errors = factors * of.error[list(pair)]
        panel.errorbar(*vertex, xerr=errors[0], yerr=errors[1], color=VERMILION, linewidth=0.8)


def comparison_arrays(result: Result) -> Arrays:
    """Estimates, a row for each parameter in the order of the names: value and 68 % interval; NaN without."""
    content = result._json("comparison.json")
    found: Arrays = {}
    for estimate in ("chain", "paraboloid", "landscape", "fixed_at", "truth"):
        rows = []
        for name in content.names:
            of = content.parameters[name]
            one = of.get(estimate)
            if one is None:
                row = [np.nan] * 3
            else:
                row = [one.value, *one.ci68] if hasattr(one, "keys") else [one, np.nan, np.nan]
            if of.periodic:
                row = list(np.array(row) + nearest_turn(row[0], of.chain.value) - row[0])
            rows.append(row)
        found[{"truth": "injected"}.get(estimate, estimate)] = np.array(rows, dtype=np.float64)
    return found


_ESTIMATES = {
    "chain": ("chain", "o", BLUE),
    "paraboloid": ("paraboloid", "s", VERMILION),
    "landscape": ("likelihood grid", "^", GREEN),
    "fixed_at": ("fixed at", "v", GREY),
    "injected": ("injected", "D", None),
}


def comparison(result: Result, numbers: Arrays) -> Sheet:
    """Estimates of each parameter with their 68 % intervals."""
    names = [str(name) for name in result._json("comparison.json").names]
    columns = min(len(names), 3)

    def paint(k: int, panel: Any) -> None:
        there = [estimate for estimate in _ESTIMATES if np.any(np.isfinite(numbers[estimate][:, 0]))]
        of = shown(names[k], None, float(np.nanmax(numbers["chain"][k])))
        panel.axvline(of.factor * numbers["chain"][k, 0], color=GREY, linestyle=":", linewidth=0.6)
        for row, estimate in enumerate(there):
            value, low, high = of.factor * numbers[estimate][k]
            _, marker, colour = _ESTIMATES[estimate]
            errors = None if np.isnan(low) else [[value - low], [high - value]]
            panel.errorbar(value, row, xerr=errors, fmt=marker, color=colour or ink(), markersize=5.0, capsize=2.0)
        panel.set_xmargin(0.15)
        panel.set(xlabel=of.label, ylim=(len(there) - 0.4, -0.6))
        panel.set_yticks(range(len(there)), [_ESTIMATES[estimate][0] for estimate in there])
        panel.tick_params(axis="y", length=0.0, labelleft=k % columns == 0)

    panels = [partial(paint, k) for k in range(len(names))]
    cells = grid(panels, columns)
    return Sheet(panels, cells, 0.26 * len(cells))
