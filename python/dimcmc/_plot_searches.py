"""Figures of periods: periodograms, detection limits, plans, and surveys of many stars."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ._sheet import (
    BLUE,
    GREEN,
    GREY,
    PURPLE,
    SERIES,
    SKY,
    VERMILION,
    Array,
    Arrays,
    Bar,
    Panel,
    Sheet,
    grid,
    ink,
    legend_above,
    limits as limits_of,
    log_ticks,
    mark_rotation,
)
from ._symbols import decimals, speed, speeds

if TYPE_CHECKING:
    from ._results import Record, Result

_HALF = {"color": "white", "linestyle": "--", "linewidth": 1.2, "label": "50 %"}
_NEARLY_ALL = {"color": VERMILION, "linewidth": 1.2, "label": "95 %"}


def periodogram(result: Result, numbers: Arrays, name: str) -> Sheet:
    """Gain in ln L at every period with its thresholds, window function, and K with its uncertainty and limit."""
    content = result._json("periodogram.json")
    found = content.second if name == "periodogram_2" else content
    periods = numbers["period_d"]
    rotation_d = float(periods[0] / numbers["porb_over_prot"][0])
    truth = content.get("truth") if name == "periodogram" else None
    injected_d = truth.porb_over_prot * rotation_d if truth is not None and truth.k_kms > 0.0 else None

    def marks(panel: Any, texts: bool, labelled: bool) -> None:
        panel.set_xscale("log")
        panel.set_xlim(periods.min(), periods.max())
        for period_d, colour, look in ((1.0, PURPLE, ":"), (injected_d, VERMILION, "--")):
            if period_d is not None and periods.min() <= period_d <= periods.max():
                panel.axvline(period_d, color=colour, linestyle=look, linewidth=0.8)
        for n in range(1, 5):
            panel.axvline(rotation_d / n, color=GREY, linestyle=":", linewidth=0.7)
        if texts:
            mark_rotation(panel, rotation_d)
            for period_d, colour, text in ((1.0, PURPLE, "1 d"), (injected_d, VERMILION, "injected")):
                if period_d is not None and periods.min() <= period_d <= periods.max():
                    # above the symbols of the rotation period
                    place = {"xycoords": ("data", "axes fraction"), "xytext": (0, 11), "textcoords": "offset points"}
                    panel.annotate(text, (period_d, 1.0), color=colour, ha="center", fontsize="small", **place)
        log_ticks(panel.xaxis)
        panel.tick_params(labelbottom=labelled)
        if labelled:
            panel.set_xlabel("period (d)")

    def likelihood(labelled: bool, panel: Any) -> None:
        # peaks between trial periods are known more closely
        peaks = found.get("peaks") or []
        x = np.concatenate([periods, [peak.period_d for peak in peaks]])
        y = np.concatenate([numbers["delta_ln_l"], [peak.delta_ln_l for peak in peaks]])
        order = np.argsort(x)
        panel.plot(x[order], y[order], color=ink(), linewidth=0.9)
        for level in found.false_alarm.levels:
            panel.axhline(level.delta_ln_l, color=GREY, linestyle="--", linewidth=0.7)
            share = f"{100 * level.false_alarm_probability:g} %"
            place: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "va": "center", "fontsize": "small"}
            panel.annotate(share, (1.005, level.delta_ln_l), **place)
        highest = max([1.0, float(np.nanmax(y)), *(level.delta_ln_l for level in found.false_alarm.levels)])
        panel.set(ylim=(0.0, 1.15 * highest), ylabel=r"$\Delta \ln L$")
        marks(panel, True, labelled)
        if peaks:
            peak = peaks[0]
            panel.plot(peak.period_d, peak.delta_ln_l, "o", color=BLUE, markersize=3.6)
            sigma = peak.get("sigma_period_d")
            digits = 4 if sigma is None else decimals(sigma)
            right = np.log(peak.period_d) > np.log(periods.min() * periods.max()) / 2.0
            place = {"xytext": (-5 if right else 5, 4), "textcoords": "offset points", "fontsize": "small"}
            text = f"highest: {peak.period_d:.{digits}f} d"
            panel.annotate(text, (peak.period_d, peak.delta_ln_l), color=BLUE, ha="right" if right else "left", **place)

    def window(panel: Any) -> None:
        panel.plot(periods, numbers["window"], color=ink(), linewidth=0.9)
        panel.set(ylim=(0.0, 1.05), ylabel="window")
        marks(panel, False, False)

    def amplitude(panel: Any) -> None:
        unit, factor = speeds(numbers["k_upper95_kms"])
        columns = {name: factor * numbers[name] for name in ("k_kms", "sigma_k_kms", "k_upper95_kms")}
        panel.plot(periods, columns["k_kms"], color=GREEN, linestyle=":", linewidth=0.8, label="best $K$")
        panel.plot(periods, columns["sigma_k_kms"], color=BLUE, label=r"$\sigma_K$")
        panel.plot(periods, columns["k_upper95_kms"], color=ink(), linestyle="--", linewidth=0.9, label="95 % limit")
        panel.set_yscale("log")
        panel.set_ylim(limits_of([columns["sigma_k_kms"], columns["k_upper95_kms"]], 0.08, log=True))
        panel.set_ylabel(f"$K$ ({unit})")
        log_ticks(panel.yaxis)
        marks(panel, False, True)
        panel.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))

    panels: list[Panel] = [partial(likelihood, False), window, amplitude]
    return Sheet(panels, [[0], [1], [2]], 0.7, main=partial(likelihood, True), heights=(1.0, 0.34, 0.66))


def _log_edges(centres: Array) -> Array:
    """Borders half way between centres on a logarithmic axis; of one value some per cent to either side."""
    step = (centres[-1] / centres[0]) ** (0.5 / (len(centres) - 1)) if len(centres) > 1 else 1.05
    borders: Array = np.append(centres / step, centres[-1] * step)
    return borders


def limits(result: Result, numbers: Arrays) -> Sheet:
    """Share of the orbits of each period and K that the search recovers, and K recovered at 50 and 95 %."""
    content = result._json("limits.json")
    share = 100.0 * numbers["recovered"] / numbers["phases"]
    periods, amplitudes = np.unique(numbers["period_d"]), np.unique(numbers["k_kms"])
    unit, factor = speeds(amplitudes)
    cells = np.full((len(amplitudes), len(periods)), np.nan)
    cells[np.searchsorted(amplitudes, numbers["k_kms"]), np.searchsorted(periods, numbers["period_d"])] = share
    rotation_d = float(numbers["period_d"][0] / numbers["porb_over_prot"][0])

    def paint(panel: Any) -> Any:
        panel.set(xscale="log", yscale="log", xlabel="period (d)", ylabel=f"$K$ ({unit})")
        look = {"cmap": "cividis", "vmin": 0.0, "vmax": 100.0}
        mesh = panel.pcolormesh(_log_edges(periods), factor * _log_edges(amplitudes), cells, **look)
        at = [limit.period_d for limit in content.limits]
        for key, pen in (("k50_kms", _HALF), ("k95_kms", _NEARLY_ALL)):
            panel.plot(at, factor * np.array([limit[key] for limit in content.limits], dtype=np.float64), **pen)
        beyond = _found(content, factor, panel)
        for recovered, marker, text in ((True, "o", "full pipeline: recovered"), (False, "x", "missed")):
            of = [one for one in content.get("comparisons") or []
                  if ((one.get("full") or {}).get("recovered") or False) is recovered]  # fmt: skip
            if of:
                x = [orbit.porb_over_prot * rotation_d for orbit in of]
                y = [factor * orbit.k_kms for orbit in of]
                panel.plot(x, y, marker, color=VERMILION, markersize=4.0, label=text)
        _limit(panel, _log_edges(periods), factor * _log_edges(amplitudes), beyond)
        mark_rotation(panel, rotation_d)
        for axis in (panel.xaxis, panel.yaxis):
            log_ticks(axis)
        _dark_legend(panel)
        return mesh

    return Sheet([paint], [[0]], 0.5, bars=[Bar("recovered (% of the phases)", [0])])


def _limit(panel: Any, x: Array, y: Array, beyond: list[tuple[float, float]]) -> None:
    """Axes from the first to the last border, and on to signals beyond."""
    ends = [limits_of([borders], 0.0, log=True) for borders in (x, y)]
    for k, (low, high) in enumerate(ends):
        places = [signal[k] for signal in beyond if np.isfinite(signal[k]) and not low <= signal[k] <= high]
        ends[k] = (min([low, *(place / 1.3 for place in places)]), max([high, *(1.3 * place for place in places)]))
    panel.set(xlim=ends[0], ylim=ends[1])


def _dark_legend(panel: Any) -> None:
    """A legend below a map of colours: white lines on a white page are grey."""
    handles, labels = panel.get_legend_handles_labels()
    legend = panel.legend(handles, labels, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=5)
    for line in legend.get_lines():
        if line.get_color() == "white":
            line.set_color(GREY)


def _found(content: Record, factor: float, panel: Any) -> list[tuple[float, float]]:
    """The planet that the profiles show by themselves: subtracted before the injections, or the highest peak."""
    removed, before = content.get("removed"), content.before
    if removed is None and not before.false_alarm_probability < content.false_alarm_probability:
        return []
    period_d = before.period_d
    if removed is not None and content.limits:
        one = content.limits[0]
        period_d = removed.porb_over_prot * one.period_d / one.porb_over_prot
    panel.axvline(period_d, color=SKY, linestyle="--", linewidth=1.0)
    text = f"$P$ = {period_d:.2f} d"
    if removed is not None:
        k_kms = abs(removed.k_kms)
        look = {"color": BLUE, "markeredgecolor": "white", "markersize": 6.5, "zorder": 3}
        panel.plot(period_d, factor * k_kms, "D", **look)
        text += f", $K$ = {speed(k_kms, 0.1 * k_kms)}"
    text = ("subtracted: " if removed is not None else "highest peak: ") + text
    ground = {"facecolor": "white", "alpha": 0.85, "edgecolor": "none", "pad": 1.5}
    low, high = np.log(panel.get_xlim())
    right = np.log(period_d) > 0.5 * (low + high)
    place = {"xycoords": ("data", "axes fraction"), "xytext": (-5 if right else 5, -5), "textcoords": "offset points"}
    look = {"color": BLUE, "va": "top", "ha": "right" if right else "left", "fontsize": "small", "bbox": ground}
    panel.annotate(text, (period_d, 1.0), **look, **place)
    return [(period_d, np.nan if removed is None else factor * abs(removed.k_kms))]


def plan(result: Result, numbers: Arrays) -> Sheet:
    """Uncertainty of K and detectable K at every period, and their medians from night to night."""
    content = result._json("plan.json")
    schedules = content.schedules
    both = np.concatenate([numbers["sigma_k_kms"], numbers["k95_kms"]])
    unit, factor = speeds(both[np.isfinite(both)])
    looks = (("sigma_k_kms", "--", 0.9, r"$\sigma_K$"), ("k95_kms", "-", 1.1, "$K$ detected, 95 %"))

    def periods(panel: Any) -> None:
        for k, schedule in enumerate(schedules):
            rows = numbers["schedule"] == k + 1
            colour = SERIES[k % len(SERIES)]
            for name, style, width, text in looks:
                label = text if len(schedules) == 1 else schedule.name if style == "-" else None
                look = {"color": colour, "linestyle": style, "linewidth": width, "label": label}
                panel.plot(numbers["period_d"][rows], factor * numbers[name][rows], **look)
        if len(schedules) > 1:
            panel.plot([], [], "--", color=GREY, label=looks[0][3])
            panel.plot([], [], "-", color=GREY, label=looks[1][3])
        panel.set(xscale="log", yscale="log", xlabel="period (d)", ylabel=f"$K$ ({unit})")
        panel.set_xlim(numbers["period_d"].min(), numbers["period_d"].max())
        mark_rotation(panel, float(schedules[0].rotation_period_d), 3)
        for axis in (panel.xaxis, panel.yaxis):
            log_ticks(axis)
        panel.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=3)

    def nights(panel: Any) -> None:
        for k, schedule in enumerate(schedules):
            count = [after.nights for after in schedule.after]
            for name, style, width, _ in looks:
                medians = factor * np.array([after[name] for after in schedule.after], dtype=np.float64)
                look = {"color": SERIES[k % len(SERIES)], "linestyle": style, "linewidth": width}
                panel.plot(count, medians, marker="o", markersize=2.5, **look)
        most = max([1, *(after.nights for schedule in schedules for after in schedule.after)])
        panel.set(yscale="log", xlim=(0.0, 1.08 * most), xlabel="nights", ylabel=f"median $K$ ({unit})")
        log_ticks(panel.yaxis)

    return Sheet([periods, nights], [[0, 1]], 0.5, main=periods, widths=(1.6, 1.0))


def plan_next_arrays(result: Result) -> Arrays:
    """Number of coming nights, and the uncertainty of K (km/s) with chosen, even and random ones; NaN without."""
    content = result._json("plan.json")
    of = content.schedules[content.best - 1].next
    nights = np.arange(len(of.chosen) + 1)
    found: Arrays = {"nights": nights.astype(np.float64)}
    chosen = {k + 1: one.sigma_k_kms for k, one in enumerate(of.chosen)}
    others = {name: {one.nights: one.sigma_k_kms for one in of[name]} for name in ("even", "random")}
    rows = {"chosen": chosen, **others}
    for name, sigma in rows.items():
        values = [of.now.sigma_k_kms, *(sigma.get(int(n)) for n in nights[1:])]
        found[f"sigma_k_{name}_kms"] = np.array(values, dtype=np.float64)
    return found


def plan_next(result: Result, numbers: Arrays) -> Sheet:
    """Uncertainty of K against the number of coming nights: chosen, evenly spaced, and random ones."""

    def paint(panel: Any) -> None:
        for k, name in enumerate(("chosen", "even", "random")):
            sigma = 1e3 * numbers[f"sigma_k_{name}_kms"]
            there = np.isfinite(sigma)
            look = {"color": SERIES[k], "marker": "o", "markersize": 2.5, "label": name}
            look["linestyle"] = "--" if k else "-"
            panel.plot(numbers["nights"][there], sigma[there], **look)
        panel.set(yscale="log", xlim=(0.0, 1.04 * max(1.0, numbers["nights"][-1])), xlabel="nights")
        panel.set_ylabel(r"$\sigma_K$ (m/s)")
        log_ticks(panel.yaxis)
        legend_above(panel)

    return Sheet([paint], [[0]], 0.6)


def completeness(result: Result, numbers: Arrays, name: str) -> Sheet:
    """Completeness of all stars by period and size, with the signals found."""
    content = result._json("survey.json")
    # the sum over stars is star 0: by K without a mass, by mass without K
    size, other = ("k_kms", "msini_mjup") if name == "completeness" else ("msini_mjup", "k_kms")
    rows = (numbers["star"] == 0) & np.isnan(numbers[other])
    periods, sizes = np.unique(numbers["period_d"][rows]), np.unique(numbers[size][rows])
    stars = sum(star.counted for star in content.stars)
    cells = 100.0 / stars * numbers["completeness"][rows].reshape(len(periods), len(sizes)).T
    unit, factor = speeds(sizes) if size == "k_kms" else ("", 1.0)
    size_label = f"$K$ ({unit})" if size == "k_kms" else r"$M\,\sin i$ ($M_\mathrm{Jup}$)"

    def paint(panel: Any) -> Any:
        panel.set(xscale="log", yscale="log", xlabel="period (d)", ylabel=size_label)
        look = {"cmap": "cividis", "vmin": 0.0, "vmax": 100.0}
        mesh = panel.pcolormesh(_log_edges(periods), factor * _log_edges(sizes), cells, **look)
        for level, pen in ((50.0, _HALF), (95.0, _NEARLY_ALL)):
            panel.plot(periods, factor * _reached(sizes, cells, level), **pen)
        for k, planets in enumerate(one for one in content.boxes if one.get(size) is not None):
            (p1, p2), (s1, s2) = planets.period_d, (factor * edge for edge in planets[size])
            panel.plot([p1, p2, p2, p1, p1], [s1, s1, s2, s2, s1], color=SKY, label=None if k else "box")
        beyond: list[tuple[float, float]] = []
        for star in content.stars:
            chance = star.get("false_alarm_probability")
            if star.counted and chance is not None and chance < content.false_alarm_probability and star[size]:
                look = {"color": VERMILION, "markeredgecolor": "white", "zorder": 3}
                label = None if beyond else "signals with FAP < 1 %"
                beyond.append((star.period_d, factor * star[size]))
                panel.plot(*beyond[-1], "D", label=label, **look)
                place = {"xytext": (6, -3), "textcoords": "offset points", "fontsize": "small"}
                ground = {"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 0.5}
                panel.annotate(star.name, beyond[-1], bbox=ground, color="black", **place)
        _limit(panel, _log_edges(periods), factor * _log_edges(sizes), beyond)
        for axis in (panel.xaxis, panel.yaxis):
            log_ticks(axis)
        _dark_legend(panel)
        return mesh

    return Sheet([paint], [[0]], 0.5, bars=[Bar(f"completeness (% of {stars} stars)", [0])])


def _reached(sizes: Array, cells: Array, level: float) -> Array:
    """The size from which on the completeness stays at a level or above, at each period; NaN beyond the sizes."""

    def reached(column: Array) -> float:
        below = np.flatnonzero(column < level)
        if below.size == 0:
            return float(sizes[0])
        j = below[-1]
        if j + 1 == len(sizes):
            return float("nan")
        along = (level - column[j]) / (column[j + 1] - column[j])
        return float(sizes[j] * (sizes[j + 1] / sizes[j]) ** along)

    return np.array([reached(column) for column in cells.T])


def rates_arrays(result: Result) -> Arrays:
    """Rates and densities of each posterior, by the number of its box and its group."""
    found: Arrays = {}
    for rate in result._json("survey.json").rates:
        key = f"box_{rate.box}_{'all' if rate.group is None else rate.group}"
        found[f"{key}_rate"], found[f"{key}_density"] = np.array(rate.rate), np.array(rate.density)
    return found


def rates(result: Result, numbers: Arrays) -> Sheet:
    """Posterior of the fraction of stars with a planet in each box, of all stars and of each group."""
    content = result._json("survey.json")

    def paint(box: int, panel: Any) -> None:
        of_box = [rate for rate in content.rates if rate.box == box]
        end = min(100.0, 1.35 * max([1.0, *(100.0 * rate.ci95[1] for rate in of_box)]))
        highest = 0.0
        for k, rate in enumerate(of_box):
            colour = SERIES[k % len(SERIES)]
            x, y = 100.0 * np.array(rate.rate), 0.01 * np.array(rate.density)
            low, high = (100.0 * edge for edge in rate.ci68)
            label = f"{'all' if rate.group is None else rate.group}, {rate.stars} stars: "
            if rate.get("upper95") is not None:
                label += f"< {100.0 * rate.upper95:.1f} % (95 %)"
            else:
                label += f"{100.0 * rate.most_likely:.1f} % ({low:.1f} to {high:.1f} %)"
            panel.plot(x, y, color=colour, linewidth=1.2, label=label)
            panel.fill_between(x, y, where=(low <= x) & (x <= high), color=colour, alpha=0.2, linewidth=0.0)
            for edge in rate.ci95:
                if edge > 0.0:
                    panel.axvline(100.0 * edge, color=colour, linestyle=":", linewidth=0.8)
            # a prior without bound at 0 leaves the panel there
            inside = (0.01 * end < x) & (x <= end) & np.isfinite(y)
            highest = max(highest, float(np.max(y[inside], initial=0.0)))
        room = 1.1 + 0.12 * len(of_box)
        panel.set(xlim=(0.0, end), ylim=(0.0, room * (highest or 1.0)))
        panel.set(xlabel="stars with a planet (%)", ylabel="probability density (1/%)")
        panel.set_title(_box(content.boxes[box - 1]))
        panel.legend(loc="upper right")

    panels: list[Panel] = [partial(paint, box + 1) for box in range(max(1, len(content.boxes)))]
    cells = grid(panels, min(2, len(panels)))
    return Sheet(panels, cells, (0.5 if len(panels) == 1 else 0.42) * len(cells))


def _box(planets: Record) -> str:
    """The planets of a box."""
    (first, last), by_k = planets.period_d, planets.get("k_kms")
    text = f"$P$ {first:g} to {last:g} d, "
    if by_k is not None:
        unit, factor = speeds(by_k)
        return text + f"$K$ {factor * by_k[0]:g} to {factor * by_k[1]:g} {unit}"
    low, high = planets.msini_mjup
    return text + rf"$M\,\sin i$ {low:g} to {high:g} $M_\mathrm{{Jup}}$"
