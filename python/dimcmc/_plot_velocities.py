"""Figures of what is measured over time: radial velocities, light curves, activity indicators."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ._sheet import (
    BLUE,
    GREY,
    PURPLE,
    VERMILION,
    Array,
    Arrays,
    Panel,
    Sheet,
    legend_above,
    limits,
    points,
    rotation_period_d,
)
from ._symbols import decimals, speed, speeds
from ._times import Clock

if TYPE_CHECKING:
    from ._results import Record, Result

# room above the highest and below the lowest error bar, as a share of half the range: that of a legend
_ROOM = 0.25
_ORBIT = {"color": BLUE, "linewidth": 1.0}
_ZERO = {"color": GREY, "linestyle": "--", "linewidth": 0.6}


class _Orbit:
    """An orbit of the star by the keys of results."""

    def __init__(self, of: Mapping[str, Any], ending: str = "") -> None:
        self.k_kms, self.porb_over_prot = float(of[f"k{ending}_kms"]), float(of[f"porb{ending}_over_prot"])
        self.phi = float(of[f"phi{ending}"])
        shape = of.get("shape") or of
        cos, sin = (float(shape.get(f"sqrt_e{ending}_{of_omega}_omega{ending}") or 0.0) for of_omega in ("cos", "sin"))
        self.eccentricity, self.omega = cos**2 + sin**2, float(np.arctan2(sin, cos))

    def velocity_kms(self, cycles: Array) -> Array:
        """V = K (cos(nu + omega) + e cos omega), the largest at phase phi."""
        return self.at_phase(cycles / self.porb_over_prot - self.phi)

    def at_phase(self, phases: Array) -> Array:
        """Velocity (km/s) at orbital phases from the largest."""
        e, omega = self.eccentricity, self.omega
        half = np.sqrt((1.0 - e) / (1.0 + e))
        anomaly = 2.0 * np.arctan(half * np.tan(-0.5 * omega))
        mean = 2.0 * np.pi * phases + anomaly - e * np.sin(anomaly)
        eccentric = mean + e * np.sin(mean)
        for _ in range(50):
            eccentric = eccentric - (eccentric - e * np.sin(eccentric) - mean) / (1.0 - e * np.cos(eccentric))
        true = 2.0 * np.arctan2(np.sin(0.5 * eccentric), half * np.cos(0.5 * eccentric))
        velocities: Array = self.k_kms * (np.cos(true + omega) + e * np.cos(omega))
        return velocities


class _Velocities:
    """Velocities of a result (km/s): first moments, without spots, and without the orbit, too."""

    def __init__(self, result: Result, numbers: Arrays) -> None:
        self.numbers, self.times_d, self.cycle = numbers, numbers["time_d"], numbers["cycle"]
        self.clock = Clock(self.times_d)
        self.period_d, self.zero_kms = 1.0, 0.0
        self.orbits: list[_Orbit] = []
        self.errors: tuple[float | None, float | None] = (None, None)
        if (result.folder / "fit.json").is_file() and "observed_kms" in numbers:
            self._of_map(result._json("fit.json"))
        else:
            self._of_search(result._json("periodogram.json"))
        self.residual = self.clean - self.orbit_kms(self.times_d)
        self.unit, self.factor = speeds(np.concatenate([self.clean, self.residual]))

    def _of_map(self, fit: Record) -> None:
        numbers, parameters = self.numbers, fit.parameters
        self.period_d = rotation_period_d(fit) or 1.0
        self.zero_kms = float(parameters.vsys_kms)
        self.moments = ("observed_kms", "sigma_kms")
        self.orbits = [_Orbit(parameters)]
        if parameters.get("k2_kms") is not None:
            self.orbits.append(_Orbit(parameters, "2"))
        if "rv_kms" in numbers:
            self.clean, self.sigma = numbers["rv_kms"] + self.zero_kms, numbers["rv_sigma_kms"]
        else:
            self.clean, self.sigma = numbers["filtered_kms"] + numbers["orbit_kms"], numbers["sigma_kms"]
        self.orbit_is = "assumed orbit"
        self._events(fit)

    def _of_search(self, found: Record) -> None:
        best = found.best
        self.period_d = best.period_d / best.porb_over_prot
        self.moments = ("first_moment_kms", "first_moment_sigma_kms")
        known = list(found.get("known_planets") or [])
        is_first = bool(known) and known[0].planet == 1
        orbits = known if is_first else [{"orbit": best}, *known]
        # of planets the first two, as far as they are modelled
        self.orbits = [_Orbit({**one["orbit"], "shape": one.get("shape")}) for one in orbits[:2]]
        self.errors = (best.sigma_k_kms, best.get("sigma_porb_over_prot"))
        self.clean, self.sigma = self.numbers["rv_kms"], self.numbers["rv_sigma_kms"]
        # velocities count from a systemic velocity that is found; relative to a given one, all may be offset alike
        if found.get("systemic_velocity") is None and found.get("offset") is not None:
            self.zero_kms = self._mean_residual()
        several = "known planets" if is_first else "best orbit and known planet"
        self.orbit_is = several if len(self.orbits) > 1 else "known planet" if is_first else "best orbit"
        self._events(found)

    def _events(self, content: Record) -> None:
        """Profiles whose errors are enlarged, because the others do not predict them."""
        events = ((content.get("measured") or {}).get("events") or {}).get("profiles") or []
        self.events = np.isin(np.arange(len(self.times_d)) + 1, [event.profile for event in events])

    @property
    def folds(self) -> bool:
        """Whether there is an orbit to fold with."""
        return self.orbits[0].k_kms > 0.0 and self.orbits[0].porb_over_prot > 0.0

    def cycle_at(self, times_d: Array) -> Array:
        """Rotation cycles at times (d)."""
        cycles: Array = self.cycle[0] + (times_d - self.times_d[0]) / self.period_d
        return cycles

    def orbit_kms(self, times_d: Array) -> Array:
        """Velocity of the star by its planets (km/s)."""
        total: Array = np.full(len(times_d), self.zero_kms)
        for orbit in self.orbits:
            if orbit.porb_over_prot > 0.0:
                total += orbit.velocity_kms(self.cycle_at(times_d))
        return total

    def _mean_residual(self) -> float:
        """Mean of velocities less orbits (km/s) by their uncertainties, 0 if there is none."""
        residual = self.clean - self.orbit_kms(self.times_d)
        known = np.isfinite(residual) & (self.sigma > 0.0)
        return float(np.average(residual[known], weights=self.sigma[known] ** -2.0)) if known.any() else 0.0

    def rings(self, panel: Any, x: Array, y: Array) -> None:
        """Rings around events."""
        if self.events.any():
            look = {"markerfacecolor": "none", "markersize": 6.5, "color": PURPLE, "label": "outlier"}
            panel.plot(x[self.events], y[self.events], "o", **look)


def rv(result: Result, numbers: Arrays) -> Sheet:
    """Radial velocities over time: first moments, without spots, residuals; and folded with the orbit."""
    of = _Velocities(result, numbers)
    rows: list[Panel] = [
        partial(_moments, of),
        partial(_clean, of, labelled=not of.folds),
    ]
    main = partial(_clean, of, cycles=True)
    if not of.folds:
        return Sheet(rows, [[0], [1]], 0.5, main=main, heights=(1.0, 1.3))
    panels: list[Panel] = [*rows, partial(_residuals, of), partial(_folded, of), partial(_folded_residuals, of)]
    return Sheet(panels, [[0, 3], [1, 3], [2, 4]], 0.62, main=main, heights=(1.0, 1.3, 0.8), widths=(1.3, 1.0))


def _span(panel: Any, y: Array, sigma: Array, middle: float) -> None:
    """All error bars, with as much above `middle` as below it."""
    low, high = limits([y - sigma, y + sigma], 0.0)
    middle = middle if low <= middle <= high else float(np.nanmean(y))
    half = (1.0 + _ROOM) * max(high - middle, middle - low)
    panel.set_ylim(middle - half, middle + half)


def _moments(of: _Velocities, panel: Any) -> None:
    days, (name, sigma) = of.clock.days(of.times_d), of.moments
    y, errors = of.numbers[name], of.numbers[sigma]
    points(panel, days, y, errors, label="first moment")
    if "modelled_kms" in of.numbers:
        panel.plot(days, of.numbers["modelled_kms"], "D", color=VERMILION, markersize=2.2, label="model")
    of.rings(panel, days, y)
    _span(panel, y, errors, of.zero_kms)
    panel.set_ylabel("RV (km/s)")
    of.clock.axis(panel, labelled=False)
    of.clock.cycles(panel, of.cycle_at)
    panel.legend(ncols=3, loc="upper left", columnspacing=1.0)


def _clean(of: _Velocities, panel: Any, labelled: bool = True, cycles: bool = False) -> None:
    """Velocities without spots, and the orbit in each season."""
    days, y = of.clock.days(of.times_d), of.factor * of.clean
    points(panel, days, y, of.factor * of.sigma)
    of.rings(panel, days, y)
    if of.folds:
        for k, season in enumerate(of.clock.seasons):
            line = np.linspace(*season, 601)
            label = of.orbit_is if k == 0 else None
            panel.plot(line, of.factor * of.orbit_kms(line + of.clock.zero_d), label=label, **_ORBIT)
        panel.legend(ncols=2, loc="upper left")
    else:
        panel.axhline(of.factor * of.zero_kms, **_ZERO)
    _span(panel, y, of.factor * of.sigma, of.factor * of.zero_kms)
    panel.set_ylabel(f"spot-corrected RV ({of.unit})")
    of.clock.axis(panel, labelled)
    if cycles:
        of.clock.cycles(panel, of.cycle_at)


def _residuals(of: _Velocities, panel: Any) -> None:
    days, y = of.clock.days(of.times_d), of.factor * of.residual
    panel.axhline(0.0, **_ZERO)
    points(panel, days, y, of.factor * of.sigma)
    of.rings(panel, days, y)
    _span(panel, y, of.factor * of.sigma, 0.0)
    panel.set_ylabel(f"residual ({of.unit})")
    of.clock.axis(panel)


def _phases(of: _Velocities) -> Array:
    orbit = of.orbits[0]
    return (of.cycle / orbit.porb_over_prot - orbit.phi) % 1.0


def _folded(of: _Velocities, panel: Any) -> None:
    """Velocities without spots over the orbital phase, those of a second planet subtracted."""
    orbit, phases = of.orbits[0], _phases(of)
    others = sum((other.velocity_kms(of.cycle) for other in of.orbits[1:]), np.zeros(len(of.cycle)))
    y = of.factor * (of.clean - others)
    line = np.linspace(0.0, 1.0, 201)
    sigma_k, sigma_ratio = of.errors
    days = decimals(None if sigma_ratio is None else sigma_ratio * of.period_d)
    period_d = orbit.porb_over_prot * of.period_d
    text = (
        f"$K$ = {speed(orbit.k_kms, sigma_k or 0.1 * orbit.k_kms)}, $P$ = {period_d:.{days}f} d = "
        rf"{orbit.porb_over_prot:.{decimals(sigma_ratio)}f} $P_\mathrm{{rot}}$"
    )
    panel.plot(line, of.factor * (of.zero_kms + orbit.at_phase(line)), label=text, **_ORBIT)
    points(panel, phases, y, of.factor * of.sigma)
    if of.events.any():
        panel.plot(phases[of.events], y[of.events], "o", markerfacecolor="none", markersize=6.5, color=PURPLE)
    _span(panel, y, of.factor * of.sigma, of.factor * of.zero_kms)
    panel.set(xlim=(0.0, 1.0), ylabel=f"spot-corrected RV ({of.unit})")
    panel.tick_params(labelbottom=False)
    legend_above(panel)


def _folded_residuals(of: _Velocities, panel: Any) -> None:
    phases, y = _phases(of), of.factor * of.residual
    panel.axhline(0.0, **_ZERO)
    points(panel, phases, y, of.factor * of.sigma)
    of.rings(panel, phases, y)
    _span(panel, y, of.factor * of.sigma, 0.0)
    panel.set(xlim=(0.0, 1.0), xlabel="orbital phase (0: maximal RV)", ylabel=f"residual ({of.unit})")


def lightcurve(result: Result, numbers: Arrays) -> Sheet:
    """Light curves with the flux of the most probable maps, and the difference."""
    return _series(numbers, "flux", ("band", "segment"), lambda _: "relative flux")


def indicators(result: Result, numbers: Arrays) -> Sheet:
    """Activity indicators with the value by the most probable maps, and the difference."""
    known = (result._json("fit.json").get("measured") or {}).get("indicators") or []

    def name(number: int) -> str:
        return str(known[number - 1].name) if number <= len(known) else f"indicator {number}"

    return _series(numbers, "value", ("indicator", "indicator"), name)


def _series(numbers: Arrays, value: str, parts: tuple[str, str], label: Callable[[int], str]) -> Sheet:
    """A panel for each series and one for its residuals; the model is a line in each segment."""
    clock = Clock(numbers["time_d"])
    series = [int(number) for number in np.unique(numbers[parts[0]])]

    def above(number: int, labelled: bool, panel: Any) -> None:
        rows = numbers[parts[0]] == number
        days, y, sigma = clock.days(numbers["time_d"]), numbers[value], numbers["sigma"]
        points(panel, days[rows], y[rows], sigma[rows], markersize=1.6, label=value)
        name: str | None = "most probable maps"
        for season in clock.seasons:
            for segment in np.unique(numbers[parts[1]][rows]):
                line = rows & (numbers[parts[1]] == segment) & clock.is_in(numbers["time_d"], season)
                if line.any():
                    order = np.argsort(days[line])
                    panel.plot(days[line][order], numbers["model"][line][order], color=VERMILION, label=name)
                    name = None
        panel.set_ylabel(label(number))
        clock.axis(panel, labelled)
        if number == series[0]:
            legend_above(panel)

    def below(number: int, panel: Any) -> None:
        rows = numbers[parts[0]] == number
        panel.axhline(0.0, **_ZERO)
        days = clock.days(numbers["time_d"][rows])
        points(panel, days, numbers["residual"][rows], numbers["sigma"][rows], markersize=1.6)
        panel.set_ylabel("residual")
        clock.axis(panel, labelled=number == series[-1])

    panels: list[Panel] = []
    for number in series:
        panels += [partial(above, number, False), partial(below, number)]
    cells = [[k] for k in range(len(panels))]
    heights = (1.0, 0.56) * len(series)
    return Sheet(panels, cells, 0.08 + 0.32 * len(series), main=partial(above, series[0], True), heights=heights)
