"""What calls give back: the files that the command line would have written, and what is in them."""

from __future__ import annotations

import base64
import csv
import html
import json
import os
import shutil
import tempfile
import weakref
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from . import _core, _plots, _text
from ._config import Config
from ._observations import Observations
from ._symbols import speed

__all__ = [
    "Comparison",
    "Figure",
    "Grid",
    "Injection",
    "Limits",
    "Maps",
    "Optimum",
    "Periodogram",
    "Plan",
    "Record",
    "Result",
    "Simulation",
    "Survey",
]

_R = TypeVar("_R", bound="Result")
_S = TypeVar("_S", bound="Simulation")


class Record(dict[str, Any]):
    """A dict of results, whose keys are attributes, too.

    >>> Record(k_kms=0.1).k_kms
    0.1
    """

    def __getattr__(self, key: str) -> Any:
        try:
            return self[key]
        except KeyError:
            raise AttributeError(key) from None

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self]

    def __repr__(self) -> str:
        return _text.values(self)


class Figure:
    """A figure, as SVG and PNG. A notebook shows it.

    Attributes
    ----------
    name : str
        What it is called, as in ``result.figures``.
    caption : str
        What it shows, in a sentence or two.
    svg : str
        For papers and slides.
    png : bytes
        With as many pixels to the inch as were asked for.
    """

    def __init__(self, name: str, caption: str, svg: str, png: bytes) -> None:
        self.name, self.caption, self.svg, self.png = name, caption, svg, png

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the figure into a file.

        Parameters
        ----------
        path : str or path
            A name that ends in ``.svg`` or ``.png``; a file that is there is replaced.
        """
        path = Path(path)
        if path.suffix == ".svg":
            path.write_text(self.svg, encoding="utf-8")
        elif path.suffix == ".png":
            path.write_bytes(self.png)
        else:
            raise ValueError(f"{path}: a figure is saved as .svg or .png")

    def __repr__(self) -> str:
        return f"Figure({self.name!r}: {self.caption})"

    def _repr_png_(self) -> bytes:
        return self.png

    def _img(self) -> str:
        data = base64.b64encode(self.png).decode("ascii")
        return f'<img src="data:image/png;base64,{data}" alt="{html.escape(self.caption, quote=True)}">'


class Scratch:
    """A folder that goes when the object goes."""

    def __init__(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="dimcmc-"))
        self._finalizer = weakref.finalize(self, shutil.rmtree, self.folder, True)

    def keep(self) -> None:
        """Leave the folder where it is."""
        self._finalizer.detach()


class Result:
    """A folder of results: the one given as ``out``, or a temporary one that lives as long as the object.

    Attributes
    ----------
    folder : pathlib.Path
        Where the files are.
    """

    #: The file by which such a folder is known.
    _FILE = ""

    folder: Path

    def __init__(self, folder: Path, text: str, scratch: Scratch | None = None) -> None:
        self.folder = folder
        self._text = _core.broken(text)
        self._scratch = scratch

    @classmethod
    def open(cls: type[_R], folder: str | os.PathLike[str]) -> _R:
        """Read the results of this kind in a folder; `dimcmc.open` finds the kind.

        Parameters
        ----------
        folder : str or path
            What a call with ``out=``, or the command line, wrote into.

        Raises
        ------
        ValueError
            No results of this kind there, or broken ones.
        """
        folder = Path(folder)
        if not cls._FILE or not cls._is_in(folder):
            raise ValueError(f"{folder}: no {cls._FILE or 'results'}, which dimcmc.{cls.__name__} reads")
        text = _core.printed(os.fspath(folder), cls._FILE)
        opened = cls(folder, "")
        opened._text = _core.broken(opened._summarised() if text is None else text)
        return opened

    @classmethod
    def _is_in(cls, folder: Path) -> bool:
        """Whether a folder is of this kind."""
        return (folder / cls._FILE).is_file()

    def _summarised(self) -> str:
        """The text of results that were opened, where the files do not hold all that was printed."""
        return ""

    @property
    def figures(self) -> list[str]:
        """Names of the figures that `figure` draws."""
        return _core.figure_names(os.fspath(self.folder))

    @overload
    def figure(self, name: str | None = None, *, dpi: float = 150.0) -> Figure: ...

    @overload
    def figure(
        self,
        name: str | None = None,
        *,
        dpi: float = 150.0,
        ax: Any = None,
        width: float | None = None,
        style: Any = None,
    ) -> Any: ...

    def figure(
        self,
        name: str | None = None,
        *,
        dpi: float = 150.0,
        ax: Any = None,
        width: float | None = None,
        style: Any = None,
    ) -> Any:
        """Draw a figure: the program's own, or by matplotlib where `ax`, `width` or `style` is given.

        Parameters
        ----------
        name : str, optional
            One of `figures`; by default the first.
        dpi : float
            Pixels of the program's own PNG to the inch.
        ax : matplotlib axes, sequence of them, or True
            Where to draw, an axes for each panel; True for a new matplotlib figure. On a single axes, figures of
            several panels draw the main one: spot-corrected velocities of ``"rv"``, the likelihood of
            ``"periodogram"``, all profiles in one column. Maps follow the projection of the axes: ``"polar"``,
            ``"mollweide"``, or longitude against latitude on ordinary ones.
        width : float, optional
            Width of a new matplotlib figure (inches).
        style : str, dict or list, optional
            Style of matplotlib, as `matplotlib.style.context` takes it; by default that of the program's own
            figures. ``[]`` is the style in force.

        Returns
        -------
        Figure, or matplotlib axes
            Axes are an array of shape (rows, columns) where there are several: a panel over several cells is in each
            of them, an empty cell is None.

        Examples
        --------
        >>> axes = run.figure("corner", ax=True, width=6.0, style="ggplot")   # doctest: +SKIP
        >>> axes[0, 0].figure.savefig("corner.pdf")                           # doctest: +SKIP
        >>> search.figure("rv", ax=axis)                                      # doctest: +SKIP
        """
        if ax is None and width is None and style is None:
            return Figure(*_core.figure(os.fspath(self.folder), name, dpi))
        return _plots.draw(self, self.figures[0] if name is None else name, ax, width, style)

    def figure_data(self, name: str | None = None) -> dict[str, NDArray[np.float64]]:
        """The numbers behind a figure.

        Parameters
        ----------
        name : str, optional
            One of `figures`; by default the first.

        Returns
        -------
        dict of str to numpy.ndarray
            Columns of the table that is drawn; pixels of maps, shape (maps, pixels); draws of the parameters;
            estimates of ``"comparison"``, a row (value, 68 % interval) for each parameter.

        Examples
        --------
        >>> run.figure_data("corner")["k_kms"].mean()                         # doctest: +SKIP
        0.103
        """
        return _plots.arrays(self, self.figures[0] if name is None else name)

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Copy all files into another folder, for the command line and others.

        Parameters
        ----------
        folder : str or path
            Made if need be; must be empty.
        """
        folder = Path(folder)
        if folder.is_dir() and any(folder.iterdir()):
            raise FileExistsError(f"{folder}: the folder is not empty; give another one")
        shutil.copytree(self.folder, folder, dirs_exist_ok=True)

    def _json(self, name: str) -> Record:
        return _read(self.folder / name)

    def _table(self, name: str) -> dict[str, NDArray[np.float64]]:
        """The columns of a table, by name."""
        with open(self.folder / name, encoding="utf-8", newline="") as file:
            names = next(csv.reader(file))
            rows = np.loadtxt(file, delimiter=",", ndmin=2)
        return {name: rows[:, k].copy() for k, name in enumerate(names)}

    def __str__(self) -> str:
        return self._text

    def __repr__(self) -> str:
        return _text.screen(f"<dimcmc.{type(self).__name__} in {self.folder}>\n{self._text}")

    def _repr_html_(self) -> str:
        try:
            figure = self.figure(dpi=100.0)._img()
        except ValueError:
            # several data sets have their figures in folders of their names
            figure = ""
        return f"<pre>{html.escape(self._text)}</pre>{figure}"

    def __reduce__(self) -> tuple[Any, ...]:
        files = {
            path.relative_to(self.folder).as_posix(): path.read_bytes()
            for path in sorted(self.folder.rglob("*"))
            if path.is_file()
        }
        return _restored, (type(self), files, self._text)


def _read(path: Path) -> Record:
    try:
        content: Record = json.loads(path.read_text(encoding="utf-8"), object_hook=Record)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return content


def _labelled(lines: list[tuple[str, str]]) -> str:
    """Labels and texts, a line each, labels padded, as calls print them."""
    width = max(len(label) for label, _ in lines)
    return "\n".join(f"{label:{width}}  {text}" for label, text in lines)


def _restored(kind: type[_R], files: Mapping[str, bytes], text: str) -> _R:
    """A result with its files in a folder that goes when it goes."""
    scratch = Scratch()
    for name, content in files.items():
        path = scratch.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return kind(scratch.folder, text, scratch)


class Simulation(Result):
    """Profiles of a spotted star with a planet, from `simulate`; of several data sets each in a folder of its name."""

    @property
    def observations(self) -> Observations:
        """The profiles, for ``observations=`` of other calls; there is one data set."""
        if len(self.sets) > 1:
            raise ValueError(f"{len(self.sets)} data sets: see `sets`, or the folders in {self.folder}")
        return self.sets[0]

    @property
    def sets(self) -> list[Observations]:
        """The profiles of each data set."""
        if self._sets is None:
            places = self._places(self.folder)
            if not places:
                raise ValueError(f"{self.folder}: other folders are beside those of the data sets")
            self._sets = [Observations.open(place / "observations.txt") for place in places]
        return list(self._sets)

    @property
    def truth(self) -> Record:
        """What they were made with: parameters, spots, noise (`truth.json`); there is one data set."""
        return self._json("truth.json")

    _FILE = "truth.json"

    _sets: list[Observations] | None = None

    @classmethod
    def open(cls: type[_S], folder: str | os.PathLike[str]) -> _S:
        """Read what `simulate` or `inject` wrote.

        Parameters
        ----------
        folder : str or path
            The folder with `truth.json`, or with a folder for each data set.

        Raises
        ------
        ValueError
            No such profiles there, or broken ones.
        """
        folder = Path(folder)
        if not cls._is_in(folder):
            raise ValueError(f"{folder}: no truth.json that dimcmc.{cls.__name__} reads")
        opened = cls(folder, "")
        opened._text = _core.broken(opened._summarised())
        return opened

    @classmethod
    def _places(cls, folder: Path) -> list[Path]:
        """The folders of the data sets: the folder itself, or all in it."""
        inside = [folder] if (folder / cls._FILE).is_file() else sorted(p for p in folder.glob("*") if p.is_dir())
        files = ("observations.txt", cls._FILE)
        several = len(inside) > 1 or inside == [folder]
        if not several or not all((place / file).is_file() for place in inside for file in files):
            return []
        # in the order of the config
        sections = _read(inside[0] / cls._FILE).get("config", {}).get("observations", [])
        order = [one.get("name") for one in sections] if isinstance(sections, list) else []
        return sorted(inside, key=lambda place: order.index(place.name) if place.name in order else len(order))

    @classmethod
    def _is_in(cls, folder: Path) -> bool:
        truths = [_read(place / cls._FILE) for place in cls._places(folder)]
        return bool(truths) and ("injected" in truths[0]) == issubclass(cls, Injection)

    def _summarised(self) -> str:
        lines: list[tuple[str, str]] = []
        places = self._places(self.folder)
        for place, one in zip(places, self.sets):
            truth = self._json(os.fspath(place.relative_to(self.folder) / self._FILE))
            noise = "without noise" if truth.snr is None else f"S/N {truth.snr:g}, seed {truth.seed}"
            lines += [("data set", place.name)] if len(places) > 1 else []
            lines.append(("profiles", f"{len(one)} of {one.intensity.shape[1]} bins, {noise}"))
            lines.append(("spottedness", f"{truth.spottedness:.5f}"))
        return _labelled(lines)

    def __reduce__(self) -> tuple[Any, ...]:
        make, arguments = super().__reduce__()
        return make, arguments, {"_sets": self._sets}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._sets = state["_sets"]


class Injection(Simulation):
    """Observed profiles with an injected orbit, from `inject`; of several data sets each in a folder of its name.

    Its `truth` is the orbit, and the velocity by which each profile was shifted.
    """

    @property
    def config(self) -> Config:
        """The config for these profiles; its start values differ from the injected orbit."""
        return Config(self.folder / "config.json")

    def _summarised(self) -> str:
        places = self._places(self.folder)
        truths = [self._json(os.fspath(place.relative_to(self.folder) / self._FILE)) for place in places]
        largest = max(abs(velocity) for truth in truths for velocity in truth.velocity_kms)
        orbit = truths[0].injected
        words = f"K {orbit.k_kms:g} km/s, Porb/Prot {orbit.porb_over_prot:g}, phi {orbit.phi:g}"
        count = sum(len(truth.times_d) for truth in truths)
        return _labelled([("profiles", f"{count}, shifted by up to {largest:.4f} km/s"), ("orbit", words)])


class Maps(Result):
    """Maps of the star, from `map`."""

    _FILE = "map.json"

    def _summarised(self) -> str:
        fit = self.summary
        per_datum = f"χ²/N = {fit.chi2_per_datum:.4f}"
        lines = [("chi2", f"{fit.chi2:.2f} for {fit.data} data in {fit.profiles} profiles ({per_datum})")]
        rms_kms = fit.observed_rv_rms_kms
        lines.append(("RV observed", f"{speed(rms_kms, 0.001 if 0.0 < rms_kms < 0.01 else 0.01)} rms"))
        return _labelled([*lines, *(("warning", text) for text in fit.get("warnings", []))])

    @property
    def summary(self) -> Record:
        """Goodness of fit and warnings (`fit.json`)."""
        return self._json("fit.json")

    @property
    def map(self) -> Record:
        """The pixels and their values (`map.json`). Its ``maps`` is a list: one, one per season, or one per time."""
        return self._json("map.json")

    @property
    def profiles(self) -> dict[str, NDArray[np.float64]]:
        """Observed and model profiles, a number for each bin: the columns of `profiles.csv`."""
        return self._table("profiles.csv")

    @property
    def velocities(self) -> dict[str, NDArray[np.float64]]:
        """Radial velocities (km/s) with and without the spots: the columns of `rv.csv`."""
        return self._table("rv.csv")


class Periodogram(Result):
    """A blind search for a planet, from `periodogram`."""

    _FILE = "periodogram.json"

    @property
    def summary(self) -> Record:
        """Best orbit, peaks, FAP, remarks (`periodogram.json`)."""
        return self._json("periodogram.json")

    @property
    def verdict(self) -> str:
        """The verdict on the best orbit, in one sentence."""
        return str(self.summary.verdict.sentence)

    @property
    def velocities(self) -> dict[str, NDArray[np.float64]]:
        """Spot-corrected radial velocities (km/s): the columns of `rv.csv`."""
        return self._table("rv.csv")

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of ``velocities["rv_kms"]`` (km^2/s^2), shape (profiles, profiles)."""
        return np.loadtxt(self.folder / "covariance.csv", delimiter=",", ndmin=2)

    @property
    def periods(self) -> dict[str, NDArray[np.float64]]:
        """The periodogram, a number for each trial period: the columns of `periodogram.csv`."""
        return self._table("periodogram.csv")


class Limits(Result):
    """Detection limits from injection and recovery, from `limits`."""

    _FILE = "limits.json"

    @property
    def summary(self) -> Record:
        """Limits, subtracted orbit, comparison with the full pipeline, warnings (`limits.json`)."""
        return self._json("limits.json")

    @property
    def periods(self) -> dict[str, NDArray[np.float64]]:
        """K recovered at 50 and 95 % of the phases (km/s) at every period; NaN beyond the K injected."""
        limits = self.summary.limits
        names = ["period_d", "porb_over_prot", "k50_kms", "k95_kms"]
        return {name: np.array([one[name] for one in limits], dtype=np.float64) for name in names}

    @property
    def injections(self) -> dict[str, NDArray[np.float64]]:
        """Phases recovered, for each period and K injected: the columns of `limits.csv`."""
        return self._table("limits.csv")


class Grid(Result):
    """A likelihood grid with its paraboloid, from `grid`."""

    _FILE = "landscape.json"

    @property
    def names(self) -> list[str]:
        """Names of the axes."""
        return [str(axis.name) for axis in self.summary.grid.axes]

    @property
    def axes(self) -> dict[str, NDArray[np.float64]]:
        """The values along each axis."""
        along: dict[str, NDArray[np.float64]] = {}
        for axis in self.summary.grid.axes:
            circle = axis.periodic and abs(axis.max - axis.min - 1.0) < 1e-9
            values = np.linspace(axis.min, axis.max, axis.nodes, endpoint=not circle)
            along[axis.name] = values % 1.0 if axis.periodic else values
        return along

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of nodes along each axis."""
        return tuple(axis.nodes for axis in self.summary.grid.axes)

    @property
    def log_likelihood(self) -> NDArray[np.float64]:
        """ln L at the nodes, an axis of the array for each of the grid; NaN where there is no map, or none yet."""
        values = np.full(int(np.prod(self.shape)), np.nan)
        nodes = self.nodes["log_likelihood"]
        values[: len(nodes)] = nodes
        return values.reshape(self.shape)

    @property
    def nodes(self) -> dict[str, NDArray[np.float64]]:
        """Parameters, ln L and the numbers beside it, for each node so far (`landscape.jsonl`)."""
        text = (self.folder / "landscape.jsonl").read_text(encoding="utf-8")
        rows = [json.loads(line) for line in text.split("\n")[:-1]]
        axes = [axis.name for axis in self.summary.grid.axes]
        names = [*axes, "log_likelihood", *self.summary.numbers]
        return {name: np.array([row[name] for row in rows], dtype=np.float64) for name in names}

    @property
    def paraboloid(self) -> Record:
        """Vertex and error bar of each parameter, or why there is none (`paraboloid.json`)."""
        return self._json("paraboloid.json")

    @property
    def summary(self) -> Record:
        """Axes, config and reference (`landscape.json`)."""
        return self._json("landscape.json")


class Comparison(Result):
    """A chain compared with a likelihood grid, from `dimcmc compare`."""

    _FILE = "comparison.json"

    @property
    def summary(self) -> Record:
        """Estimates of each parameter, their differences, and the cost of each (`comparison.json`)."""
        return self._json("comparison.json")


class Plan(Result):
    """Detection limits of schedules, from `plan`."""

    _FILE = "plan.json"

    @property
    def summary(self) -> Record:
        """Each schedule, as it grows, and the best of them (`plan.json`)."""
        return self._json("plan.json")

    @property
    def periods(self) -> dict[str, NDArray[np.float64]]:
        """Uncertainty of K and detectable K (km/s) at every period, for each schedule: the columns of `plan.csv`."""
        return self._table("plan.csv")


class Survey(Result):
    """Completeness of a sample of stars, and the rate of planets in it, from `survey`."""

    _FILE = "survey.json"

    @property
    def summary(self) -> Record:
        """Boxes, stars, rates with their posteriors, warnings (`survey.json`)."""
        return self._json("survey.json")

    @property
    def stars(self) -> list[Record]:
        """Verdict, limits and completeness of each star."""
        return list(self.summary.stars)

    @property
    def rates(self) -> list[Record]:
        """The rate of planets in each box, of all stars first, then of each group."""
        return list(self.summary.rates)

    @property
    def completeness(self) -> dict[str, NDArray[np.float64]]:
        """Fraction recovered by period and size: the columns of `completeness.csv`; star 0 is the sum over stars."""
        return self._table("completeness.csv")


class Optimum(Result):
    """Maximum of the posterior with uncertainties, from `optimise`."""

    _FILE = "optimum.json"

    @property
    def summary(self) -> Record:
        """All that the search found (`optimum.json`)."""
        return self._json("optimum.json")

    @property
    def names(self) -> list[str]:
        """Names of the free parameters."""
        return list(self.summary.names)

    @property
    def parameters(self) -> dict[str, float]:
        """The best value of each parameter, in the unit of its name."""
        return dict(self.summary.parameters)

    @property
    def sd(self) -> dict[str, float]:
        """Standard deviation of each, from the curvature."""
        return dict(self.summary.sd)

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Their covariance, in the order of `names`."""
        return np.array(self.summary.covariance, dtype=np.float64)
