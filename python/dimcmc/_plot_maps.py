"""Figures of maps of the star: flattened polar projection and Mollweide's, or longitude against latitude."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ._sheet import BLUE, GREY, VERMILION, Array, Arrays, Bar, Panel, Sheet, colours, grid, ink

if TYPE_CHECKING:
    from ._results import Record, Result

# southernmost latitude of the polar projection (deg)
_SOUTH_DEG = -30.0
# profiles no further from a map's time than this (d) are of the same night
_NIGHT_D = 0.5
# share of the pixels whose values have colours of their own
_SHOWN = 0.999
# edges of the cells of a ring along it (deg)
_LONGITUDES = np.arange(361.0)


@dataclass
class _Star:
    """What is on a star: values in rings between latitudes, and how they are coloured."""

    title: str
    #: Borders of the rings (deg), and the values of each ring on cells of a degree.
    latitudes: Array
    cells: Array
    colours: Any
    ends: tuple[float, float]
    #: Rotation cycles that were observed.
    cycles: Array = field(default_factory=lambda: np.array([]))
    #: Latitudes below this (deg) are never visible.
    unseen_deg: float = -90.0
    #: Discs whose rims are drawn: longitude, latitude and radius (deg), and the colour.
    rims: Sequence[tuple[float, float, float, str]] = ()
    #: What is written on the polar projection: all, ``"few"`` of many that are alike, or ``"none"`` but the phases.
    labels: str = "all"

    def paint(self, panel: Any) -> Any:
        """Draw the star in the projection of the axes."""
        painted = {"mollweide": self._mollweide, "polar": self._polar}.get(panel.name, self._plain)(panel)
        panel.set_title(self.title, fontsize="small")
        return painted

    def _mesh(self, panel: Any, x: Array, y: Array) -> Any:
        look = {"cmap": self.colours, "vmin": self.ends[0], "vmax": self.ends[1], "rasterized": True}
        return panel.pcolormesh(x, y, self.cells, **look)

    def _rims(self, panel: Any, place: Any) -> None:
        for longitude, latitude, radius, colour in self.rims:
            x, y = place(*_rim(longitude, latitude, radius))
            # what goes around behind the star is not joined
            x = np.where(np.abs(np.diff(x, prepend=x[0])) > np.pi / 2.0, np.nan, x) if panel.name != "polar" else x
            panel.plot(x, y, color=colour, linewidth=0.6)

    def _mollweide(self, panel: Any) -> Any:
        mesh = self._mesh(panel, np.radians(_LONGITUDES) - np.pi, np.radians(self.latitudes))
        if self.unseen_deg > -90.0:
            x = np.linspace(-np.pi, np.pi, 181)
            panel.fill_between(x, np.radians(-90.0), np.radians(self.unseen_deg), color=GREY, linewidth=0.0)
        self._rims(panel, lambda longitude, latitude: (np.radians(longitude) - np.pi, np.radians(latitude)))
        for cycle in self.cycles:
            x = (-cycle) % 1.0
            panel.plot([x, x], [-0.03, -0.1], color=ink(), linewidth=0.7, clip_on=False, transform=panel.transAxes)
        panel.axhline(0.0, color="black", linewidth=0.9)
        panel.grid(color=GREY, linewidth=0.4, linestyle="--")
        # longitudes are written below, where they do not hide the star
        panel.set_xticks(np.radians([-120.0, -60.0, 0.0, 60.0, 120.0]), [""] * 5)
        for longitude in (0.0, 90.0, 180.0, 270.0, 360.0):
            place = {"transform": panel.transAxes, "ha": "center", "va": "top", "fontsize": "x-small"}
            panel.text(longitude / 360.0, -0.12, f"{longitude:.0f}°", **place)
        latitudes = [-60.0, -30.0, 0.0, 30.0, 60.0]
        panel.set_yticks(np.radians(latitudes), [_signed(latitude) for latitude in latitudes], fontsize="x-small")
        return mesh

    def _polar(self, panel: Any) -> Any:
        panel.set_theta_zero_location("S")
        mesh = self._mesh(panel, np.radians(_LONGITUDES), 90.0 - self.latitudes)
        around = np.linspace(0.0, 2.0 * np.pi, 361)
        outer = 90.0 - _SOUTH_DEG
        if self.unseen_deg > _SOUTH_DEG:
            panel.fill_between(around, 90.0 - self.unseen_deg, outer, color=GREY, linewidth=0.0)
        self._rims(panel, lambda longitude, latitude: (np.radians(longitude), 90.0 - latitude))
        for cycle in self.cycles:
            tick = ([-2.0 * np.pi * cycle] * 2, [1.02 * outer, 1.07 * outer])
            panel.plot(*tick, color=ink(), linewidth=0.7, clip_on=False)
        panel.plot(around, np.full(361, 90.0), color="black", linewidth=0.9)
        panel.grid(color=GREY, linewidth=0.4, linestyle="--")
        panel.set_rlim(0.0, outer)
        # the meridian of longitude l faces the observer at phase 1 - l / 360
        beside = ["0.75", "0.25"] if self.labels == "all" else ["", ""]
        phases = ["0" if self.labels == "none" else "phase 0", beside[0], "0.5", beside[1]]
        panel.set_thetagrids([0, 90, 180, 270], phases, fontsize="x-small")
        panel.tick_params(axis="x", pad=1.0)
        latitudes = ["", "", ""] if self.labels == "none" else ["+60°", "+30°", "0°"]
        panel.set_rgrids([30.0, 60.0, 90.0], latitudes, angle=207.0, fontsize="xx-small")
        place = {"transform": panel.transAxes, "ha": "center", "va": "center", "fontsize": "large"}
        panel.text(0.97, 0.06, "↺", **place)
        return mesh

    def _plain(self, panel: Any) -> Any:
        mesh = self._mesh(panel, _LONGITUDES, self.latitudes)
        if self.unseen_deg > -90.0:
            panel.axhspan(-90.0, self.unseen_deg, color=GREY, linewidth=0.0)
        for longitude, latitude, radius, colour in self.rims:
            x, y = _rim(longitude, latitude, radius)
            panel.plot(np.where(np.abs(np.diff(x, prepend=x[0])) > 90.0, np.nan, x), y, color=colour, linewidth=0.6)
        panel.set(xlabel="longitude (°)", ylabel="latitude (°)", xlim=(0.0, 360.0), ylim=(-90.0, 90.0))
        return mesh


def _signed(latitude: float) -> str:
    return f"{latitude:+.0f}°".replace("+0°", "0°").replace("-", "−")


def _rim(longitude: float, latitude: float, radius: float) -> tuple[Array, Array]:
    """Longitudes and latitudes (deg) of the rim of a disc."""
    direction = np.radians(np.arange(0.0, 361.0, 3.0))
    b, r = np.radians(latitude), np.radians(radius)
    sine = np.sin(b) * np.cos(r) + np.cos(b) * np.sin(r) * np.cos(direction)
    turn = np.arctan2(np.sin(direction) * np.sin(r) * np.cos(b), np.cos(r) - np.sin(b) * sine)
    return (longitude + np.degrees(turn)) % 360.0, np.degrees(np.arcsin(np.clip(sine, -1.0, 1.0)))


class _Rings:
    """Pixels of equal area in rings, south to north."""

    def __init__(self, counts: Sequence[int]) -> None:
        self.counts = np.array(counts)
        ends = np.append(0, np.cumsum(self.counts))
        self.starts = ends[:-1]
        self.latitudes: Array = np.degrees(np.arcsin(np.clip(2.0 * ends / ends[-1] - 1.0, -1.0, 1.0)))

    def cells(self, values: Array) -> Array:
        """Values of pixels on cells of a degree along each ring."""
        middles = (0.5 * (_LONGITUDES[1:] + _LONGITUDES[:-1])) / 360.0
        pixels = self.starts[:, np.newaxis] + (middles * self.counts[:, np.newaxis]).astype(int)
        found: Array = values[pixels]
        return found


def maps_arrays(result: Result) -> Arrays:
    """Pixels of the maps, shape (maps, pixels); of a simulation its spots, a row each."""
    if not (result.folder / "map.json").is_file():
        spots = np.array([spot[:4] for spot in result._json("truth.json").spots], dtype=np.float64).reshape(-1, 4)
        return dict(zip(("longitude_deg", "latitude_deg", "radius_deg", "spot_filling"), spots.T))
    content = result._json("map.json")
    maps = content.get("maps") or [content]
    if len(maps) == 1:
        maps = [{**content, **maps[0]}]
    columns = ["time_d", "spot_filling", "brightness", "sigma_spot_filling", "true_spot_filling"]
    found = {key: np.array([one[key] for one in maps], dtype=np.float64) for key in columns if key in maps[0]}
    pixels = ["longitude_deg", "latitude_deg", "area_fraction"]
    return {**{key: np.array(content[key], dtype=np.float64) for key in pixels}, **found}


def maps(result: Result, numbers: Arrays, projection: str) -> Sheet:
    """Evolving maps, and the mean standard deviation of their pixels."""
    content = result._json("map.json")
    rings = _Rings(content.ring_pixels)
    filling, sigma = numbers["spot_filling"], numbers["sigma_spot_filling"].mean(axis=0)
    # steps of 0.05
    reach = float(np.clip(np.ceil(20.0 * np.quantile(np.abs(filling), _SHOWN) - 1e-9) / 20.0, 0.05, 1.0))
    unseen = -float(content.parameters.inclination_deg)
    times, cycles = _observed(result)
    stars: list[_Star] = []
    for time_d, values in zip(numbers["time_d"], filling):
        of_night = cycles[np.abs(times - time_d) <= _NIGHT_D]
        look = (colours("brightness").reversed(), (-reach, reach))
        star = _Star(f"{time_d:.2f} d", rings.latitudes, rings.cells(values), *look, of_night, unseen)
        star.labels = "none" if stars else "few"
        stars.append(star)
    most = float(content.field.spot_amplitude)
    # from the next tenth of the amplitude below what is known best
    least = most * float(np.clip(np.floor(10.0 * sigma.min() / most), 0.0, 9.0)) / 10.0
    deviation = _Star("mean standard deviation", rings.latitudes, rings.cells(sigma), "cividis", (least, most))
    deviation.unseen_deg, deviation.labels = unseen, "few"
    stars.append(deviation)
    panels: list[Panel] = [star.paint for star in stars]
    polar = projection == "polar"
    most_columns = (5 if len(panels) <= 20 else 6) if polar else (3 if len(panels) <= 18 else 4)
    cells = grid(panels, min(len(panels), most_columns))
    columns, last = len(cells[0]), len(panels) - 1
    height = (1.4 if polar else 0.72) * len(cells) / columns + 0.12
    bars = [
        Bar("standard deviation of the filling factor", range(len(panels)), "bottom", 0.5, of=last),
        Bar("spot filling factor", range(len(panels)), "bottom", 0.5),
    ]
    return Sheet(panels, cells, height, projections=[projection] * len(panels), bars=bars)


def _observed(result: Result) -> tuple[Array, Array]:
    """Times (d) and rotation cycles of the profiles, where the folder has them."""
    if not (result.folder / "rv.csv").is_file():
        return np.array([]), np.array([])
    table = result._table("rv.csv")
    return table["time_d"], table["cycle"]


def one_map(result: Result, numbers: Arrays, name: str) -> Sheet:
    """A map in both projections, and beside it the injected one where it is known."""
    if not (result.folder / "map.json").is_file():
        return _sheet(_simulated(result), "spot filling factor")
    content = result._json("map.json")
    season = None if name == "map" else int(name.removeprefix("map_")) - 1
    number = season or 0
    is_bright = "brightness" in numbers
    what = "brightness" if is_bright else "spot_filling"
    values = numbers[what][number]
    spots, faculae = ([], []) if season is not None else _injected(result)
    rims = [*((*spot[:3], BLUE) for spot in spots), *((*facula[:3], VERMILION) for facula in faculae)]
    known = numbers.get("true_spot_filling") if season is None and not is_bright else None
    middle = 1.0 if is_bright else 0.0
    highest = max(np.abs(some - middle).max() for some in (values, *(() if known is None else (known[0],))))
    reach = 1.0 if highest > 0.5 else max(np.ceil(10.0 * highest) / 10.0, 0.1)
    look = (colours("brightness"), (1.0 - reach, 1.0 + reach)) if is_bright else (colours("spots"), (0.0, reach))
    rings = _Rings(content.ring_pixels)
    times, cycles = _observed(result)
    of = content.maps[number] if season is not None else content
    if season is not None:
        cycles = cycles[(times >= of.first_d - 1e-9) & (times <= of.last_d + 1e-9)]
    title = _title("reconstructed", of.get("spottedness"), is_bright)
    if season is not None:
        title = f"season {season + 1}, {of.first_d:.2f} to {of.last_d:.2f} d\n{title}"
    stars = [_Star(title, rings.latitudes, rings.cells(values), *look, cycles, rims=rims)]
    if known is not None:
        title = _title("injected", of.get("true_spottedness"), is_bright)
        of_star = _discs(spots) if spots else (rings.latitudes, rings.cells(known[0]))
        stars.append(_Star(title, *of_star, *look, cycles))
    return _sheet(stars, "brightness over that of the photosphere" if is_bright else "spot filling factor")


def _title(what: str, spottedness: float | None, is_bright: bool) -> str:
    if spottedness is None:
        return what
    share = f"{100.0 * spottedness:.1f} %"
    return f"{what}: brightness varies by {share} rms" if is_bright else f"{what}: {share} spotted"


def _sheet(stars: Sequence[_Star], label: str) -> Sheet:
    """Both projections of a star, or of two stars in columns."""
    bars = [Bar(label, range(2 * len(stars)), "bottom", 0.5)]
    panels: list[Panel] = [*(star.paint for star in stars), *(_untitled(star) for star in stars)]
    if len(stars) == 1:
        widths, cells = (1.0, 1.4), [[0, 1]]
        return Sheet(panels, cells, 0.55, stars[0].paint, ("polar", "mollweide"), widths=widths, bars=bars)
    projections = ("polar", "polar", "mollweide", "mollweide")
    return Sheet(panels, [[0, 1], [2, 3]], 0.95, stars[0].paint, projections, heights=(1.5, 1.0), bars=bars)


def _untitled(star: _Star) -> Panel:
    def paint(panel: Any) -> Any:
        mesh = star.paint(panel)
        panel.set_title("")
        return mesh

    return paint


def _injected(result: Result) -> tuple[list[Any], list[Any]]:
    """Injected spots and faculae, where the folder says that they do not change."""
    found: Record | None = None
    if (result.folder / "truth.json").is_file():
        found = result._json("truth.json")
    elif (result.folder / "fit.json").is_file():
        observed = result._json("fit.json").get("config", {}).get("observations")
        found = observed.get("simulate") if isinstance(observed, dict) else None
    spots = [] if found is None else found.get("spots") or []
    if found is None or found.get("random_spots") is not None or any(len(spot) > 4 for spot in spots):
        return [], []
    return list(spots), list(found.get("faculae") or [])


def _discs(spots: Sequence[Any]) -> tuple[Array, Array]:
    """Borders of rings (deg), and filling factors on cells of a degree, of spots that do not change."""
    latitudes = np.arange(-90.0, 90.5, 1.0)
    longitude, latitude = np.meshgrid(_LONGITUDES[1:] - 0.5, latitudes[1:] - 0.5)
    cells = np.zeros(longitude.shape)
    # the fuller ones cover the others
    for spot in sorted(spots, key=lambda spot: float(spot[3])):
        apart, b, b_spot = np.radians(longitude - spot[0]), np.radians(latitude), np.radians(spot[1])
        cosine = np.sin(b) * np.sin(b_spot) + np.cos(b) * np.cos(b_spot) * np.cos(apart)
        cells[cosine > np.cos(np.radians(spot[2]))] = spot[3]
    return latitudes, cells


def _simulated(result: Result) -> list[_Star]:
    """The injected spots, at their size in the middle of the data."""
    truth = result._json("truth.json")
    times = np.array(truth.times_d)
    middle = 0.5 * (times.min() + times.max())
    is_changing = any(len(spot) > 4 for spot in truth.spots)
    latitudes, cells = _discs([_at(spot, middle) for spot in truth.spots])
    highest = cells.max()
    reach = 1.0 if highest > 0.5 else max(np.ceil(10.0 * highest) / 10.0, 0.1)
    star = truth.get("config", {}).get("star", {})
    cycles = (times - (star.get("epoch_d") or 0.0)) / star["rotation_period_d"]
    title = _title("injected", None if is_changing else truth.spottedness, False)
    return [_Star(title, latitudes, cells, colours("spots"), (0.0, float(reach)), cycles)]


def _at(spot: Sequence[float], time_d: float) -> list[float]:
    """A spot at a time: the area of one that comes and goes is linear in time, over twice its lifetime."""
    longitude, latitude, radius, filling, *life = spot
    if life:
        area = max(0.0, 1.0 - abs(time_d - life[0]) / life[1])
        radius = np.degrees(2.0 * np.arcsin(np.sqrt(area) * np.sin(0.5 * np.radians(radius))))
    return [longitude, latitude, radius, filling]
