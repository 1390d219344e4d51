"""Folders of results, whoever wrote them: opened again, and made into a page."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from . import _core
from ._functions import _folder, _threads
from ._progress import shown
from ._results import (
    Comparison,
    Grid,
    Injection,
    Limits,
    Maps,
    Optimum,
    Periodogram,
    Plan,
    Record,
    Result,
    Simulation,
    Survey,
)
from ._run import Run

__all__ = ["Batch", "open", "report", "survey"]


class Batch(Result):
    """Runs of many stars, from `dimcmc batch`."""

    _FILE = "batch.json"

    @property
    def summary(self) -> list[Record]:
        """What came of each star (`batch.json`)."""
        text = (self.folder / self._FILE).read_text(encoding="utf-8")
        rows: list[Record] = json.loads(text, object_hook=Record)
        return rows

    @property
    def runs(self) -> dict[str, Run]:
        """The run of each star that has one, by its name."""
        names = [str(row.name) for row in self.summary]
        return {name: Run.open(self.folder / name) for name in names if Run._is_in(self.folder / name)}

    def _summarised(self) -> str:
        def line(row: Record) -> str:
            if row.converged is None:
                return f"{row.name}: no chain"
            state = "converged" if row.converged else "not converged"
            return f"{row.name}: {state}" + (f". {row.verdict.sentence}" if row.verdict else "")

        return "\n".join(line(row) for row in self.summary)


_KINDS: tuple[type[Result], ...] = (
    Run,
    Grid,
    Maps,
    Periodogram,
    Limits,
    Plan,
    Survey,
    Optimum,
    Comparison,
    Batch,
    Injection,
    Simulation,
)


def open(folder: str | os.PathLike[str]) -> Result:
    """Open a folder of results, from a call with ``out=`` or from the command line.

    Parameters
    ----------
    folder : str or path
        What `simulate`, `inject`, `map`, `periodogram`, `limits`, `plan`, `optimise`, `grid`, `sample`, `merge`,
        `compare`, `batch` or `survey` wrote into.

    Returns
    -------
    Result
        Of the class of its kind: a `Run`, `Maps`, `Periodogram`, ...

    Raises
    ------
    FileNotFoundError, NotADirectoryError
        No such folder.
    ValueError
        No results there, results of several kinds, or broken ones.

    Examples
    --------
    >>> search = dimcmc.open("runs/demo_periodogram")                            # doctest: +SKIP
    >>> print(search.verdict)                                                    # doctest: +SKIP
    """
    folder = Path(folder)
    if not folder.exists():
        raise FileNotFoundError(f"{folder}: no such folder")
    if not folder.is_dir():
        raise NotADirectoryError(f"{folder}: is no folder; give the one that the file is in")
    found = [kind for kind in _KINDS if kind._is_in(folder)]
    # profiles beside what was made of them
    results = [kind for kind in found if not issubclass(kind, Simulation)] or found
    if not results:
        files = ", ".join(dict.fromkeys(kind._FILE for kind in _KINDS))
        raise ValueError(f"{folder}: no results of dimcmc, which would be one of {files}")
    if len(results) > 1:
        ways = " or ".join(f"dimcmc.{kind.__name__}.open" for kind in results)
        raise ValueError(f"{folder}: results of several kinds, use {ways}")
    return results[0].open(folder)


def report(
    results: Result | str | os.PathLike[str] | Sequence[Result | str | os.PathLike[str]],
    *,
    out: str | os.PathLike[str] | None = None,
    force: bool = False,
) -> Path:
    """Write one HTML page of a star: verdict, velocities, maps, periodogram, posterior and limits.

    Parameters
    ----------
    results : Result, str, path, or a list of these
        Results of one star, or their folders.
    out : str or path, optional
        The file; by default `report.html` in the folder, or beside the first of several.
    force : bool
        Replace an existing report.

    Returns
    -------
    pathlib.Path
        The page, a single file that needs nothing else.

    Raises
    ------
    ValueError
        Folders without results, or of different stars.
    FileExistsError
        The file exists, or is no report.

    Examples
    --------
    >>> dimcmc.report([star, search, run], out="star.html")                      # doctest: +SKIP
    PosixPath('star.html')
    """
    several = [results] if isinstance(results, (Result, str, os.PathLike)) else list(results)
    if not several:
        raise ValueError("results: give one at least")
    folders = [one.folder if isinstance(one, Result) else Path(one) for one in several]
    if out is not None:
        file = Path(out)
    elif isinstance(several[0], Result) and several[0]._scratch is not None:
        raise ValueError("out: name the file, for the folder of the results is deleted with them")
    else:
        file = (folders[0] if len(folders) == 1 else folders[0].parent) / "report.html"
    if file.is_dir():
        raise IsADirectoryError(f"out: {file} is a folder, give the name of a file")
    if file.exists() and not force:
        raise FileExistsError(f"out: {file} exists; give another name, or force=True")
    if file.exists() and not _core.is_report(os.fspath(file)):
        raise FileExistsError(f"out: {file} exists and is no report: it is not replaced")
    page = _core.report([os.fspath(folder) for folder in folders])
    # whole or not at all
    begun = file.with_name(f".{file.name}.{os.getpid()}")
    try:
        begun.write_text(page, encoding="utf-8", newline="\n")
        begun.replace(file)
    finally:
        begun.unlink(missing_ok=True)
    return file


def survey(
    results: Result | str | os.PathLike[str] | Sequence[Result | str | os.PathLike[str]],
    *,
    boxes: Sequence[tuple[tuple[float, float], tuple[float, float]]] = (),
    mass_boxes: Sequence[tuple[tuple[float, float], tuple[float, float]]] = (),
    table: str | os.PathLike[str] | None = None,
    group: str | None = None,
    reliability: str | None = None,
    prior: Literal["uniform", "jeffreys"] = "uniform",
    out: str | os.PathLike[str] | None = None,
    force: bool = False,
    threads: int | None = None,
    progress: bool | None = None,
) -> Survey:
    """Completeness of a sample of stars, and the rate of planets in it.

    Each star has a search (`periodogram`, `sample`) and detection limits (`limits`); results of the same observations
    belong to one star.

    Parameters
    ----------
    results : Result, str, path, or a list of these
        Searches and limits, or folders that hold them, at any depth up to 4.
    boxes : sequence of ((shortest, longest), (smallest, largest))
        Planets whose rate is estimated, by period (d) and K (km/s); by default ((1, 10), (0.05, 1)).
    mass_boxes : sequence of ((shortest, longest), (smallest, largest))
        The same by period (d) and M sin i (Jupiter masses); needs ``star.mass_msun`` of every star.
    table : str or path, optional
        Table of the stars (CSV), their names in the column ``name`` or ``star``, or in the first.
    group : str, optional
        Column of the table: estimate the rate in each group, too.
    reliability : str, optional
        Column of the table: probability that the signal of a star is a planet, chance aside.
    prior : {"uniform", "jeffreys"}
        Prior of each rate.
    out : str or path, optional
        Folder for the files; by default a temporary one, deleted with the result.
    force : bool
        Write into a non-empty folder.
    threads : int, optional
        Number of threads; all processors by default. Results do not depend on it.
    progress : bool, optional
        Show progress; by default in notebooks and on terminals.

    Returns
    -------
    Survey

    Raises
    ------
    ValueError
        A star without search or limits; the message names all of them.

    Examples
    --------
    >>> found = dimcmc.survey("runs/stars", boxes=[((1, 10), (0.05, 1.0))])      # doctest: +SKIP
    >>> found.rates[0].ci95                                                      # doctest: +SKIP
    [0.0, 0.12]
    """
    if prior not in ("uniform", "jeffreys"):
        raise ValueError(f'prior: must be "uniform" or "jeffreys", not {prior!r}')
    if table is None and (group is not None or reliability is not None):
        raise ValueError("table: name the table that has the columns group and reliability")
    several = [results] if isinstance(results, (Result, str, os.PathLike)) else list(results)
    if not several:
        raise ValueError("results: give one at least")
    folders = [os.fspath(one.folder if isinstance(one, Result) else one) for one in several]
    texts = [[f"{p[0]}:{p[1]},{s[0]}:{s[1]}" for p, s in some] for some in (boxes, mass_boxes)]
    path = None if table is None else os.fspath(table)
    options = (texts[0], texts[1], prior == "jeffreys", path, group, reliability)
    with _folder(out, force) as (folder, scratch), shown("survey", progress) as show:
        said = _core.survey(folders, options, os.fspath(folder), (_threads(threads), show))
    return Survey(folder, said, scratch)
