"""Time axes: days less a constant, seasons with gaps between them, and rotation cycles above."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# times below this are written as they are, Julian dates are above that (d)
_SMALL_D, _JULIAN_D = 1000.0, 2_400_000.0
# least gap between seasons (d), and as a share of all the time
_GAP_D, _GAP_SHARE = 15.0, 0.1
# least width of a season, the room around its times, and the gap, as shares of all widths
_LEAST, _MARGIN, _BETWEEN = 0.15, 0.04, 0.03


@dataclass
class Clock:
    """Times (d) as an axis shows them: less a constant, and seasons side by side."""

    times_d: Array
    zero_d: float = 0.0
    label: str = "time (d)"
    #: From when to when each season is shown, less the constant.
    seasons: list[tuple[float, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        times = np.sort(self.times_d[np.isfinite(self.times_d)])
        if not times.size:
            raise ValueError("no times to draw")
        if times[0] >= _SMALL_D:
            self.zero_d = float(np.floor(times[0] / _SMALL_D) * _SMALL_D)
            self.label = f"{'BJD' if times[0] > _JULIAN_D else 'time'} − {self.zero_d:.0f} (d)"
        times = times - self.zero_d
        gaps = np.flatnonzero(np.diff(times) >= max(_GAP_D, _GAP_SHARE * (times[-1] - times[0])))
        ends = [(part[0], part[-1]) for part in np.split(times, gaps + 1)]
        longest = max(last - first for first, last in ends)
        # a single night has some length, too
        room = _MARGIN * longest if longest > 0.0 else 0.5
        self.seasons = [(float(first - room), float(last + room)) for first, last in ends]

    def days(self, times_d: Array) -> Array:
        """Times less the constant."""
        return times_d - self.zero_d

    def is_in(self, times_d: Array, season: tuple[float, float]) -> NDArray[np.bool_]:
        """Which times are in a season."""
        days = self.days(times_d)
        return (season[0] <= days) & (days <= season[1])

    def axis(self, panel: Any, labelled: bool = True) -> None:
        """Make the lower axis of a panel one of these days."""
        self._scale(panel)
        ticks = [_ticks(*season, share) for season, share in zip(self.seasons, self._shares())]
        panel.set_xticks(np.concatenate(ticks))
        if labelled:
            panel.set_xlabel(self.label)
        else:
            panel.tick_params(labelbottom=False)
        for (_, end), (start, _) in zip(self.seasons, self.seasons[1:]):
            _cut(panel, end, start)

    def cycles(self, panel: Any, cycle_at: Callable[[Array], Array]) -> None:
        """Rotation cycles above a panel of these days; `cycle_at` is linear in time (d)."""
        above = panel.twiny()
        self._scale(above)
        panel.tick_params(axis="x", which="both", top=False)
        above.tick_params(axis="x", which="both", bottom=False, top=True)
        # the frame is that of the panel, with its gaps
        above.spines[:].set_visible(False)
        places, texts = [], []
        for (first, last), share in zip(self.seasons, self._shares()):
            start, end = cycle_at(np.array([first, last]) + self.zero_d)
            ticks = _ticks(float(start), float(end), share)
            places.append(first + (ticks - start) / (end - start) * (last - first))
            texts += [f"{tick:.10g}".replace("-", "−") for tick in ticks]
        above.set_xticks(np.concatenate(places), texts)
        above.set_xticks([], minor=True)
        above.set_xlabel("rotation cycle")

    def _shares(self) -> Array:
        """Width of each season as a share of all."""
        lengths = np.array([last - first for first, last in self.seasons])
        shares = np.maximum(lengths / lengths.sum(), min(_LEAST, 0.5 / len(lengths)))
        widths: Array = shares / shares.sum()
        return widths

    def _scale(self, panel: Any) -> None:
        if len(self.seasons) > 1:
            panel.set_xscale("function", functions=self._functions())
        panel.set_xlim(self.seasons[0][0], self.seasons[-1][1])

    def _functions(self) -> tuple[Callable[[Array], Array], Callable[[Array], Array]]:
        """From days to places on the page, and back: linear in each season and in each gap."""
        days = np.array(self.seasons).ravel()
        starts = np.cumsum(self._shares() + _BETWEEN) - self._shares() - _BETWEEN
        places = np.column_stack([starts, starts + self._shares()]).ravel()
        # beyond the ends as in the seasons there
        slopes = np.diff(places)[[0, -1]] / np.diff(days)[[0, -1]]
        far = 1e6
        days = np.concatenate([[days[0] - far], days, [days[-1] + far]])
        places = np.concatenate([[places[0] - far * slopes[0]], places, [places[-1] + far * slopes[1]]])
        return lambda x: np.interp(x, days, places), lambda x: np.interp(x, places, days)


def _ticks(first: float, last: float, share: float) -> Array:
    """Even values of an axis that has this share of the width."""
    from matplotlib.ticker import MaxNLocator

    steps = MaxNLocator(nbins=max(3, round(9 * share)), steps=[1, 2, 5, 10], min_n_ticks=1)
    ticks = np.asarray(steps.tick_values(first, last), dtype=np.float64)
    return ticks[(first <= ticks) & (ticks <= last)]


def _cut(panel: Any, end: float, start: float) -> None:
    """Cut a panel between the end of a season and the start of the next."""
    import matplotlib

    # through all that is drawn there, the frame too
    ground = matplotlib.rcParams["figure.facecolor"]
    ends = {"ymin": -0.01, "ymax": 1.01, "clip_on": False}
    panel.axvspan(end, start, facecolor=ground, edgecolor="none", zorder=2.6, **ends)
    frame = panel.spines["left"]
    for x in (end, start):
        panel.axvline(x, 0.0, 1.0, color=frame.get_edgecolor(), linewidth=frame.get_linewidth(), zorder=2.7)
