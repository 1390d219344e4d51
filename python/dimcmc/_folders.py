"""Folders of results, whoever wrote them: opened again, and made into a page."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path

from . import _core
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
)
from ._run import Run

__all__ = ["Batch", "open", "report"]


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
        `compare` or `batch` wrote into.

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
