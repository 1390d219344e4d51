"""Sheets of panels that matplotlib draws, on new axes or given ones, in the look of the program's own figures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Arrays = dict[str, Array]
#: Draws one panel on matplotlib axes; what a colour bar is of, if anything.
Panel = Callable[[Any], Any]

# colours that survive colour blindness (Okabe & Ito 2008)
BLUE, VERMILION, GREEN, PURPLE = "#0072b2", "#d55e00", "#009e73", "#cc79a7"
ORANGE, SKY, GREY = "#e69f00", "#56b4e9", "#8a8a8a"
SERIES = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, "#000000")
# from photosphere to spot, and from brighter than the photosphere over it to spot
_SPOTS = ("#fff6dc", "#f9d58a", "#e2a04a", "#b0642f", "#663322", "#1e1014")
_BRIGHT = ("#08234f", "#124c86", "#307eb8", "#6fb1d6", "#b9dcea")

# the look of the program's own figures
_LOOK: dict[str, Any] = {
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.labelsize": 8.0,
    "axes.linewidth": 0.6,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.fontsize": 7.0,
    "legend.frameon": False,
    "legend.handlelength": 1.5,
    "lines.linewidth": 1.0,
    "mathtext.fontset": "dejavusans",
}
WIDTH_IN = 7.0


@dataclass
class Bar:
    """A colour bar beside or below some panels."""

    label: str
    panels: Sequence[int]
    location: str = "right"
    #: Of a bar below panels: its length over theirs.
    shrink: float = 1.0
    #: The panel whose colours it shows; by default the first.
    of: int | None = None


@dataclass
class Sheet:
    """Panels and their places."""

    panels: Sequence[Panel]
    #: Number of the panel in each cell, in rows; None for an empty cell.
    cells: Sequence[Sequence[int | None]]
    #: Height over the width.
    height: float
    #: What is drawn where a single axes is given.
    main: Panel | None = None
    #: Projection of each panel; an ordinary one for None.
    projections: Sequence[str | None] = ()
    heights: Sequence[float] | None = None
    widths: Sequence[float] | None = None
    bars: Sequence[Bar] = field(default_factory=list)
    #: Room to the left, right, below and above (inches) of panels that touch; laid out by their labels for None.
    margins: tuple[float, float, float, float] | None = None


def grid(panels: Sequence[Panel], columns: int) -> list[list[int | None]]:
    """Cells of rows that are filled one after the other."""
    numbers: list[int | None] = [*range(len(panels)), *[None] * (-len(panels) % columns)]
    return [numbers[first : first + columns] for first in range(0, len(numbers), columns)]


def draw(name: str, make: Callable[[], Sheet], ax: Any, width: float | None, style: Any) -> Any:
    """Draw a sheet; the axes, an array of rows and columns where there are several."""
    import matplotlib.pyplot as plt

    with plt.style.context(_LOOK if style is None else style):
        sheet = make()
        count = len(sheet.panels)
        if ax is None or ax is True:
            panels = _new(sheet, WIDTH_IN if width is None else width)
        else:
            panels = list(np.array(ax, dtype=object).reshape(-1))
            if len(panels) == 1 and sheet.main is not None:
                mesh, bar = sheet.main(panels[0]), next(iter(sheet.bars), None)
                if mesh is not None and bar is not None:
                    panels[0].figure.colorbar(mesh, ax=panels[0], label=bar.label)
                return panels[0]
            if len(panels) != count:
                raise ValueError(f"ax: figure {name} has {count} panels, not {len(panels)}")
            check_projections(name, sheet, panels)
        meshes = [paint(panel) for paint, panel in zip(sheet.panels, panels)]
        for bar in sheet.bars:
            of = [panels[k] for k in bar.panels]
            place = {"location": bar.location, "shrink": bar.shrink, "aspect": 30, "pad": 0.02}
            shown = meshes[bar.panels[0] if bar.of is None else bar.of]
            of[0].figure.colorbar(shown, ax=of, label=bar.label, **place)
        if ax is None or ax is True:
            panels[0].figure.align_ylabels([panel for panel in panels if panel.get_ylabel()])
    cells = np.empty((len(sheet.cells), len(sheet.cells[0])), dtype=object)
    for row, numbers in enumerate(sheet.cells):
        for column, number in enumerate(numbers):
            cells[row, column] = None if number is None else panels[number]
    return cells[0, 0] if cells.size == 1 else cells


def check_projections(name: str, sheet: Sheet, panels: Sequence[Any]) -> None:
    """Refuse axes of another projection than a panel has."""
    for projection, panel in zip(sheet.projections, panels):
        if projection is not None and panel.name not in (projection, "rectilinear"):
            raise ValueError(f"ax: figure {name} is drawn on axes of projection {projection!r}, not {panel.name!r}")


def _new(sheet: Sheet, width: float) -> list[Any]:
    """Axes of a new figure."""
    import matplotlib.pyplot as plt

    height = width * sheet.height
    rows, columns = len(sheet.cells), len(sheet.cells[0])
    shape: dict[str, Any] = {"height_ratios": sheet.heights, "width_ratios": sheet.widths}
    if sheet.margins is None:
        figure = plt.figure(figsize=(width, height), layout="constrained")
    else:
        figure = plt.figure(figsize=(width, height))
        left, right, below, above = sheet.margins
        shape |= {"left": left / width, "right": 1.0 - right / width, "wspace": 0.06, "hspace": 0.06}
        shape |= {"bottom": below / height, "top": 1.0 - above / height}
    places = figure.add_gridspec(rows, columns, **shape)
    panels = []
    for number in range(len(sheet.panels)):
        at = np.argwhere(np.array([[cell == number for cell in row] for row in sheet.cells]))
        (top, left), (bottom, right) = at.min(axis=0), at.max(axis=0)
        projection = sheet.projections[number] if sheet.projections else None
        panels.append(figure.add_subplot(places[top : bottom + 1, left : right + 1], projection=projection))
    return panels


def ink() -> str:
    """Colour of lines and points: that of texts, so that it is seen on any ground."""
    import matplotlib

    return str(matplotlib.rcParams["text.color"])


def colours(name: str) -> Any:
    """A map of colours: ``spots``, ``brightness``, or one of matplotlib's."""
    from matplotlib.colors import LinearSegmentedColormap

    if name == "spots":
        return LinearSegmentedColormap.from_list(name, _SPOTS)
    if name == "brightness":
        return LinearSegmentedColormap.from_list(name, [*_SPOTS[::-1], *_BRIGHT[::-1]])
    return name


def limits(values: Iterable[ArrayLike], margin: float, log: bool = False) -> tuple[float, float]:
    """Smallest and largest of some numbers with a margin, a share of the range."""
    joined = np.concatenate([np.ravel(np.asarray(some, dtype=np.float64)) for some in values])
    joined = joined[np.isfinite(joined) & ((joined > 0.0) | (not log))]
    if joined.size == 0:
        return (0.5, 2.0) if log else (0.0, 1.0)
    ends = np.array([joined.min(), joined.max()])
    if log:
        ends = np.log(ends)
    room = margin * (ends[1] - ends[0]) if ends[1] > ends[0] else 0.5
    low, high = ends[0] - room, ends[1] + room
    return (float(np.exp(low)), float(np.exp(high))) if log else (float(low), float(high))


def edges(centres: Array) -> Array:
    """Borders half way between centres of even steps."""
    step = centres[1] - centres[0] if len(centres) > 1 else 1.0
    borders: Array = np.append(centres - 0.5 * step, centres[-1] + 0.5 * step)
    return borders


def points(panel: Any, x: Array, y: Array, sigma: Array | None = None, **look: Any) -> None:
    """Points with grey error bars."""
    look = {"fmt": "o", "color": ink(), "ecolor": GREY, "elinewidth": 0.6, "markersize": 2.6, **look}
    panel.errorbar(x, y, sigma, **look)


def mark_rotation(panel: Any, rotation_period_d: float, fractions: int = 4) -> None:
    """Dotted lines at the rotation period and its fractions, with their symbols above."""
    low, high = panel.get_xlim()
    for n in range(1, fractions + 1):
        period_d = rotation_period_d / n
        if low <= period_d <= high:
            panel.axvline(period_d, color=GREY, linestyle=":", linewidth=0.8)
            text = r"$P_\mathrm{rot}$" + (f"/{n}" if n > 1 else "")
            place: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points"}
            place["xytext"] = (0, 2)
            panel.annotate(text, (period_d, 1.0), ha="center", va="bottom", fontsize="small", **place)


def legend_above(panel: Any, **where: Any) -> None:
    """A legend in one row above a panel."""
    count = len(panel.get_legend_handles_labels()[1])
    if count:
        panel.legend(loc="lower center", bbox_to_anchor=where.pop("at", (0.5, 1.0)), ncols=min(count, 5), **where)


def rotation_period_d(content: Any) -> float | None:
    """Rotation period (d) of the star in the config of a result."""
    found = content.get("config", {}).get("star", {}).get("rotation_period_d")
    return None if found is None else float(found)


def log_ticks(axis: Any, most: int = 8) -> None:
    """Plain numbers on a logarithmic axis whose ends are set: 1, 2 and 5 times the powers of ten, or even steps."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

    low, high = axis.get_view_interval()
    steps: Any = MaxNLocator(nbins=most, steps=[1, 2, 5, 10])
    for subs in ((1.0, 2.0, 5.0), (1.0, 3.0), (1.0,)):
        ticks = np.outer(10.0 ** np.arange(np.floor(np.log10(low)), np.log10(high) + 1.0), subs)
        if 3 <= np.count_nonzero((low <= ticks) & (ticks <= high)) <= most:
            steps = LogLocator(subs=subs, numticks=20)
            break
    axis.set_major_locator(steps)
    axis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axis.set_minor_formatter(NullFormatter())
