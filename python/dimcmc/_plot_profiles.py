"""Figures of line profiles: below each other, as dynamic spectra, and where the star changed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ._sheet import GREY, PURPLE, VERMILION, Array, Arrays, Bar, Panel, Sheet, edges, grid, ink, legend_above
from ._times import Clock

if TYPE_CHECKING:
    from ._results import Result

# profiles of a column
_PER_COLUMN = 17
# half the phase that a profile fills in a dynamic spectrum, at most
_HALF_ROW = 0.015
# largest residual that has a colour of its own, and that of a star that changes, at least and at most (sigma)
_RESIDUAL, _LEAST, _MOST = 4.0, 4.0, 20.0
# profiles further apart than this (d) are of different nights; rows that are left out between seasons
_NIGHT_D, _BETWEEN = 0.5, 3.0


@dataclass
class _Line:
    """A profile: rows of the table."""

    time_d: float
    cycle: float
    velocity_kms: Array
    columns: Arrays
    data_set: float | None
    is_event: bool

    @property
    def phase(self) -> float:
        """Rotation phase."""
        return self.cycle % 1.0


def _lines(result: Result, numbers: Arrays) -> list[_Line]:
    """Profiles in the order of their phase."""
    events: set[int] = set()
    if (result.folder / "fit.json").is_file():
        found = (result._json("fit.json").get("measured") or {}).get("events") or {}
        events = {event.profile for event in found.get("profiles") or []}
    starts = np.append(0, np.flatnonzero(np.diff(numbers["profile"])) + 1)
    lines = []
    for rows in np.split(np.arange(len(numbers["profile"])), starts[1:]):
        columns = {name: values[rows] for name, values in numbers.items()}
        data_set = columns["data_set"][0] if "data_set" in columns else None
        is_event = int(columns["profile"][0]) + 1 in events
        of = (columns["time_d"][0], columns["cycle"][0], columns["velocity_kms"])
        lines.append(_Line(*of, columns, data_set, is_event))
    return sorted(lines, key=lambda line: (line.phase, line.cycle))


def profiles(result: Result, numbers: Arrays) -> Sheet:
    """Profiles below each other in the order of their phase, observed and modelled."""
    lines = _lines(result, numbers)
    columns = int(np.clip(-(-len(lines) // _PER_COLUMN), 1, 4))
    rows = -(-len(lines) // columns)
    parts = [lines[first : first + rows] for first in range(0, len(lines), rows)]
    low, high = (end(line.columns["observed"] for line in lines) for end in (_least, _greatest))
    velocities = (_least(line.velocity_kms for line in lines), _greatest(line.velocity_kms for line in lines))
    spacing = 0.5 * (high - low)

    def paint(part: list[_Line], slots: int, first: bool, panel: Any) -> None:
        names: dict[str, str | None] = {"observed": "observed", "model": "model", "event": "outlier"}
        for row, line in enumerate(part):
            kind = "event" if line.is_event else "observed"
            colour = PURPLE if line.is_event else ink()
            down = spacing * row
            look = {"color": colour, "linewidth": 1.2, "label": names[kind]}
            panel.plot(line.velocity_kms, line.columns["observed"] - down, **look)
            names[kind] = None
            if "model" in line.columns:
                look = {"color": VERMILION, "linewidth": 0.6, "label": names["model"]}
                panel.plot(line.velocity_kms, line.columns["model"] - down, **look)
                names["model"] = None
            level = line.columns["observed"][-1] - down
            # plus and minus one standard error beside the profile
            sigma = line.columns["sigma"].mean()
            panel.plot([1.015] * 2, [level - sigma, level + sigma], color=ink(), linewidth=1.0, clip_on=False,
                       transform=panel.get_yaxis_transform())  # fmt: skip
            data_set = "" if line.data_set is None else f" ({line.data_set:.0f})"
            text = f"{line.cycle - line.phase:.0f} + {line.phase:.3f}{data_set}".replace("-", "−")
            panel.text(1.03, level, text, transform=panel.get_yaxis_transform(), va="center", fontsize="x-small")
        room = 0.04 * (velocities[1] - velocities[0])
        panel.set_xlim(velocities[0] - room, velocities[1] + room)
        panel.set_ylim(low - spacing * (slots - 0.7), high + 0.5 * spacing)
        panel.set_yticks([])
        panel.set_xlabel("velocity (km/s)")
        if first:
            panel.set_ylabel("intensity / continuum + offset")
            _depth_bar(panel, spacing)
            legend_above(panel, at=(0.5, 1.01))
        place = {"transform": panel.transAxes, "va": "bottom", "fontsize": "x-small"}
        panel.text(1.03, 1.01, "cycle + phase", **place)

    panels: list[Panel] = [partial(paint, part, rows, k == 0) for k, part in enumerate(parts)]
    height = float(np.clip(1.1 + 0.43 * rows, 2.4, 9.0)) / 7.0
    return Sheet(panels, grid(panels, len(panels)), height, main=partial(paint, lines, len(lines), True))


def _least(arrays: Any) -> float:
    return float(min(np.nanmin(values) for values in arrays))


def _greatest(arrays: Any) -> float:
    return float(max(np.nanmax(values) for values in arrays))


def _depth_bar(panel: Any, spacing: float) -> None:
    """A bar that shows how much of the continuum a length upwards is."""
    power = 10.0 ** np.floor(np.log10(spacing))
    length = next((f * power for f in (5.0, 2.0, 1.0) if f * power <= 1.001 * spacing), power)
    low, high = panel.get_ylim()
    foot = low + 0.012 * (high - low)
    place = {"transform": panel.get_yaxis_transform()}
    panel.plot([0.04, 0.04], [foot, foot + length], "-_", color=GREY, linewidth=0.9, markersize=4.0, **place)
    panel.text(0.06, foot + 0.5 * length, rf"{length:g} $I_\mathrm{{c}}$", va="center", fontsize="x-small", **place)


def residuals(result: Result, numbers: Arrays) -> Sheet:
    """Dynamic spectra: profiles minus the mean observed one of their data set, and residuals, by rotation phase."""
    lines = _lines(result, numbers)
    means = [_mean(lines, own) for own in lines]
    rows = _rows(np.array([line.phase for line in lines]))
    observed = [100.0 * (line.columns["observed"] - mean) for line, mean in zip(lines, means)]
    modelled = [100.0 * (line.columns["model"] - mean) for line, mean in zip(lines, means)]
    left = [(line.columns["observed"] - line.columns["model"]) / line.columns["sigma"] for line in lines]
    change = _greatest(np.abs(values) for values in observed) or 1.0

    def paint(title: str, values: list[Array], reach: float, labelled: bool, panel: Any) -> Any:
        mesh = None
        panel.set_facecolor("0.84")
        for line, value, parts in zip(lines, values, rows):
            for low, high in parts:
                look = {"cmap": "RdBu_r", "vmin": -reach, "vmax": reach, "rasterized": True}
                mesh = panel.pcolormesh(edges(line.velocity_kms), [low, high], value[np.newaxis], **look)
        panel.set(title=title, xlabel="velocity (km/s)", ylim=(0.0, 1.0))
        panel.tick_params(labelleft=labelled)
        if labelled:
            panel.set_ylabel("rotation phase")
        return mesh

    panels: list[Panel] = [
        partial(paint, "observed − mean", observed, change, True),
        partial(paint, "model − mean", modelled, change, False),
        partial(paint, "observed − model", left, _RESIDUAL, False),
    ]
    bars = [Bar("uncertainties (σ)", [2]), Bar("% of the continuum", [0, 1])]
    main = partial(paint, "observed − model", left, _RESIDUAL, True)
    return Sheet(panels, [[0, 1, 2]], 0.5, main=main, bars=bars)


def _mean(lines: list[_Line], own: _Line) -> Array:
    """Mean observed profile of the data set in the bins of one of its profiles."""
    of_set = [line for line in lines if line.data_set == own.data_set]
    there = [
        np.interp(own.velocity_kms, line.velocity_kms, line.columns["observed"], left=np.nan, right=np.nan)
        for line in of_set
    ]
    mean: Array = np.nanmean(there, axis=0)
    return mean


def _rows(phases: Array) -> list[list[tuple[float, float]]]:
    """From which phase to which each profile is drawn: half way to its neighbours; in two parts around 0."""
    up = np.minimum(0.5 * ((np.roll(phases, -1) - phases) % 1.0), _HALF_ROW)
    down = np.minimum(0.5 * ((phases - np.roll(phases, 1)) % 1.0), _HALF_ROW)
    if len(phases) == 1:
        up, down = np.array([_HALF_ROW]), np.array([_HALF_ROW])

    def parts(low: float, high: float) -> list[tuple[float, float]]:
        if low < 0.0:
            return [(0.0, high), (1.0 + low, 1.0)]
        return [(low, 1.0), (0.0, high - 1.0)] if high > 1.0 else [(low, high)]

    return [parts(*ends) for ends in zip(phases - down, phases + up)]


def changes(result: Result, numbers: Arrays) -> Sheet:
    """Residuals of a static map and of the evolving maps, by time; numbers are the time of the first of a night."""
    lines = sorted(_lines(result, numbers), key=lambda line: line.time_d)
    times = np.array([line.time_d for line in lines])
    clock = Clock(times)
    season = np.array([np.flatnonzero(clock.is_in(times, ends)) for ends in clock.seasons], dtype=object)
    places = np.arange(len(lines)) + _BETWEEN * np.concatenate([[k] * len(of) for k, of in enumerate(season)])
    nights = np.append(0, np.flatnonzero(np.diff(times) > _NIGHT_D) + 1)

    def of_model(name: str) -> list[Array]:
        return [(line.columns["observed"] - line.columns[name]) / line.columns["sigma"] for line in lines]

    static, evolving = of_model("unchanging_model"), of_model("model")
    reach = float(np.clip(np.ceil(np.quantile(np.abs(np.concatenate(static)), 0.99)), _LEAST, _MOST))
    rows = places[-1] + 1.0
    height = float(np.clip(0.07 * rows, 1.4, 7.8))
    # times are written where there is room
    apart = 0.13 * rows / height
    written: list[int] = []
    for night in nights:
        if not written or places[night] - places[written[-1]] >= apart:
            written.append(int(night))

    def paint(title: str, values: list[Array], labelled: bool, panel: Any) -> Any:
        mesh = None
        panel.set_facecolor("0.84")
        for line, value, row in zip(lines, values, places):
            look = {"cmap": "RdBu_r", "vmin": -reach, "vmax": reach, "rasterized": True}
            mesh = panel.pcolormesh(edges(line.velocity_kms), [row, row + 1.0], value[np.newaxis], **look)
        for night in nights[1:]:
            panel.axhline(places[night], color="black", linewidth=0.3)
        panel.set(title=title, xlabel="velocity (km/s)", ylim=(rows, 0.0))
        texts = [f"{times[night]:.2f}" for night in written]
        panel.set_yticks(places[written] + 0.5, texts if labelled else [""] * len(texts))
        panel.tick_params(axis="y", length=0.0)
        if labelled:
            panel.set_ylabel("time (d)")
        return mesh

    panels: list[Panel] = [
        partial(paint, "observed − static map", static, True),
        partial(paint, "observed − evolving maps", evolving, False),
    ]
    return Sheet(panels, [[0, 1]], (height + 0.6) / 7.0, main=panels[0], bars=[Bar("uncertainties (σ)", [0, 1])])
