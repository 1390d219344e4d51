"""Runs: chains of the posterior in a folder."""

from __future__ import annotations

import html
import json
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._results import Record, Result, Scratch

if TYPE_CHECKING:
    import xarray

__all__ = ["Run"]

# columns of the table that a notebook shows
_COLUMNS = ["median", "sd", "ci68", "ci95", "rhat", "ess"]


class Run(Result):
    """A chain of the posterior: what `sample` gives back, or any run of the command line.

    Attributes
    ----------
    folder : pathlib.Path
        Where `manifest.json`, `chain.jsonl` and `summary.json` are.
    names : list of str
        Names of the free parameters.
    samples : dict of str to numpy.ndarray
        The draws of each parameter, and of what follows from them (period, times, minimum mass), the warm-up left out;
        one-dimensional, in the units of the names. Phases are unwrapped around their mode.
    chain : numpy.ndarray, shape (steps, ensembles, walkers, parameters)
        All positions, the start (step 0) and the warm-up among them.
    log_prob : numpy.ndarray, shape (steps, ensembles, walkers)
        Their log-probabilities.
    numbers : dict of str to numpy.ndarray
        What is kept beside these, such as ``"spottedness"`` and ``"chi2"``; of the shape of `log_prob`.
    summary : Record
        Medians, intervals, convergence, verdict: `summary.json`.

    Examples
    --------
    >>> run = dimcmc.Run.open("runs/demo")                      # doctest: +SKIP
    >>> run.summary.parameters.k_kms.ci95                       # doctest: +SKIP
    [0.084, 0.123]
    >>> run.samples["period_d"].mean()                          # doctest: +SKIP
    5.14
    """

    names: list[str]
    samples: dict[str, NDArray[np.float64]]
    chain: NDArray[np.float64]
    log_prob: NDArray[np.float64]
    numbers: dict[str, NDArray[np.float64]]
    summary: Record

    _FILE = "manifest.json"

    def __init__(self, folder: Path, text: str | None = None, scratch: Scratch | None = None) -> None:
        content = _core.read_run(os.fspath(folder))
        super().__init__(folder, content["text"], scratch)
        shape = content["shape"]
        self.names, self.samples = content["names"], content["draws"]
        self.chain = content["chain"].reshape(*shape, len(self.names))
        self.log_prob = content["log_prob"].reshape(shape)
        self.numbers = {name: values.reshape(shape) for name, values in content["numbers"].items()}
        self.summary = json.loads(content["summary"], object_hook=Record)

    @classmethod
    def open(cls, folder: str | os.PathLike[str]) -> Run:
        """Read the run in a folder; it may still be growing.

        Parameters
        ----------
        folder : str or path
            What `sample` or the command line wrote into.

        Returns
        -------
        Run

        Raises
        ------
        ValueError
            No run there, or one that is broken.
        """
        return cls(Path(folder))

    @property
    def converged(self) -> bool:
        """Whether all goals of the config were reached."""
        return bool(self.summary.converged)

    @property
    def verdict(self) -> str | None:
        """The verdict, in one sentence; None without an orbit."""
        verdict = self.summary.get("verdict")
        return None if verdict is None else str(verdict.sentence)

    def to_xarray(self) -> xarray.DataTree:
        """The draws for xarray and ArviZ.

        A chain is an ensemble, with its walkers one after the other, for only ensembles are independent. Groups are
        ``posterior``, ``sample_stats`` and those of the warm-up; units, priors and injected values are attributes.
        Needs xarray and zarr (``pip install dimcmc[arviz]``).

        Returns
        -------
        xarray.DataTree

        Examples
        --------
        >>> posterior = run.to_xarray()["posterior"].to_dataset()     # doctest: +SKIP
        """
        try:
            import xarray
            import zarr  # noqa: F401
        except ImportError as error:
            raise ImportError(f"{error.name} is needed: pip install dimcmc[arviz]") from error
        with tempfile.TemporaryDirectory(prefix="dimcmc-") as folder:
            place = os.path.join(folder, "chain.zarr")
            self.export("zarr", out=place)
            return xarray.open_datatree(place, engine="zarr").load()

    def to_inferencedata(self) -> Any:
        """The draws as ArviZ takes them: its InferenceData before version 1, a DataTree from then on.

        Returns
        -------
        arviz.InferenceData or xarray.DataTree

        Examples
        --------
        >>> arviz.summary(run.to_inferencedata())                     # doctest: +SKIP
        """
        tree = self.to_xarray()
        try:
            import arviz
        except ImportError as error:
            raise ImportError(f"{error.name} is needed: pip install dimcmc[arviz]") from error
        make = getattr(getattr(arviz, "InferenceData", None), "from_datatree", None)
        return tree if make is None else make(tree)

    def export(
        self, format: str, *, out: str | os.PathLike[str] | None = None, force: bool = False
    ) -> list[Path]:
        """Export the chain to other programs.

        Parameters
        ----------
        format : {"zarr", "emcee", "getdist", "csv"}
            For which program.
        out : str or path, optional
            File, folder or, for GetDist, beginning of names; by default in the run's folder.
        force : bool
            Replace an earlier export.

        Returns
        -------
        list of pathlib.Path
            What was written.
        """
        place = None if out is None else os.fspath(out)
        return _core.export(os.fspath(self.folder), format, place, force)

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{html.escape(name)}</th>" for name in ["", *_COLUMNS])
        values = {**self.summary.parameters, **self.summary.get("derived", {})}
        order = [*self.names, *self.summary.get("derived_names", [])]
        rows = "".join(f"<tr><th>{html.escape(name)}</th>{_cells(values[name])}</tr>" for name in order)
        verdict = "" if self.verdict is None else f"<p><b>{html.escape(self.verdict)}</b></p>"
        state = "the chain has converged" if self.converged else "the chain has not converged"
        advice = "".join(f"<li>{html.escape(line)}</li>" for line in self.summary.advice)
        figure = self.figure("corner", dpi=100.0)._img() if "corner" in self.figures else ""
        return f"{verdict}<table><tr>{head}</tr>{rows}</table><p>{state}</p><ul>{advice}</ul>{figure}"


def _cells(one: Record) -> str:
    digits = max(0, 1 - int(np.floor(np.log10(one.sd)))) if one.sd > 0.0 else 3

    def text(name: str) -> str:
        value = one.get(name)
        if value is None:
            return ""
        if name == "rhat":
            return f"{value:.3f}"
        if name == "ess":
            return f"{value:.0f}"
        if isinstance(value, list):
            return f"[{value[0]:.{digits}f}, {value[1]:.{digits}f}]"
        return f"{value:.{digits}f}"

    return "".join(f"<td>{text(name)}</td>" for name in _COLUMNS)
