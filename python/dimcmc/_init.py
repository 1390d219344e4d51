"""A first config for observed profiles."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

from . import _core, _units
from ._config import Config
from ._functions import _by_keyword, _threads
from ._observations import Observations
from ._progress import shown
from ._results import Scratch

__all__ = ["init"]

_File = str | os.PathLike[str]


def init(
    observations: Observations | _File | Sequence[_File],
    *,
    rotation_period: float,
    inclination: float | None = None,
    vsini: float | None = None,
    epoch: float | None = None,
    domega: float | None = None,
    limb_darkening: float | None = None,
    photosphere: float | None = None,
    spot: float | None = None,
    wavelength: float | Sequence[float] | None = None,
    line_sigma: float | None = None,
    instrument: str | Sequence[str] | None = None,
    resolving_power: float | Sequence[float] | None = None,
    velocity_range: Sequence[float] | None = None,
    photometry: _File | Sequence[_File] = (),
    photometry_wavelength: float | Sequence[float] | None = None,
    indicator: _File | Sequence[_File] = (),
    objective: Literal["marginal-likelihood", "spottedness"] | None = None,
    brightness: Literal["bright-and-dark", "spots"] | None = None,
    pixels: int | None = None,
    out: _File | None = None,
    force: bool = False,
    threads: int | None = None,
    progress: bool | None = None,
) -> Config:
    """Make a first config for observed profiles.

    Velocity range, vsini, systemic velocity, noise and priors of the orbit are measured on the profiles. Other values
    are given here or assumed; `Config.sources` lists the source of each. A test fit on some of the profiles follows.

    Parameters
    ----------
    observations : Observations, str, path, or a list of paths
        Profiles, or a list of their files. Several lists are data sets of one star, one per spectrograph.
    rotation_period : float
        Rotation period (d).
    inclination : float, optional
        Inclination of the rotation axis to the line of sight (degrees).
    vsini : float, optional
        Projected rotation velocity (km/s), in place of the measured one.
    epoch : float, optional
        Time of rotation cycle 0 (d); by default the middle of the observations.
    domega : float, optional
        Differential rotation, equator minus pole (rad/d).
    limb_darkening : float, optional
        Coefficient of linear limb darkening.
    photosphere, spot : float, optional
        Temperatures (K).
    wavelength : float or sequence of float, optional
        Wavelength of the profiles (nm); for several lists one each.
    line_sigma : float, optional
        Standard deviation of the local line (km/s), before instrumental broadening.
    instrument : str or sequence of str, optional
        Spectrograph, such as ESPaDOnS, SPIRou or HARPS; for several lists one each.
    resolving_power : float or sequence of float, optional
        Resolving power of the spectrograph; for several lists one each.
    velocity_range : sequence of two floats, optional
        First and last velocity to use (km/s).
    photometry : str, path, or a list of these
        Light curves of the same weeks: tables of time, flux and its uncertainty.
    photometry_wavelength : float or sequence of float, optional
        Wavelength (nm) of each light curve.
    indicator : str, path, or a list of these
        Activity indicators: tables of time, value and its uncertainty.
    objective : {"marginal-likelihood", "spottedness"}, optional
        Likelihood of an orbit.
    brightness : {"bright-and-dark", "spots"}, optional
        Brightness model of a static map.
    pixels : int, optional
        Pixels of the image.
    out : str or path, optional
        File for the config, of the bytes that the command line writes. Without it paths in the config start from the
        working directory.
    force : bool
        Replace an existing file.
    threads : int, optional
        Number of threads; all processors by default. Results do not depend on it.
    progress : bool, optional
        Show progress; by default in notebooks and on terminals.

    Returns
    -------
    Config
        Of `Observations` one without a path: give them with it to other calls.

    Raises
    ------
    ValueError
        Profiles that cannot be read or fitted, values out of range; the message says which.

    Examples
    --------
    >>> config = dimcmc.init("profiles/observations.txt", rotation_period=3.0, inclination=38)   # doctest: +SKIP
    >>> print(config.sources)                                                    # doctest: +SKIP
    """
    if isinstance(observations, Observations) and out is not None:
        raise ValueError("out: a config names files; write the profiles by Observations.save, and give their list")
    one_each: list[tuple[str, Any, str | None]] = [
        ("rotation_period", rotation_period, "d"),
        ("epoch", epoch, "d"),
        ("inclination", inclination, "deg"),
        ("vsini", vsini, "km / s"),
        ("domega", domega, "rad / d"),
        ("limb_darkening", limb_darkening, ""),
        ("photosphere", photosphere, "K"),
        ("spot", spot, "K"),
        ("wavelength", wavelength, "nm"),
        ("line_sigma", line_sigma, "km / s"),
        ("instrument", instrument, None),
        ("resolving_power", resolving_power, ""),
        ("photometry_wavelength", photometry_wavelength, "nm"),
        ("objective", objective, None),
        ("brightness", brightness, None),
        ("pixels", pixels, None),
    ]
    options = [f"--{_dashed(name)}={_said(name, value, unit)}" for name, value, unit in one_each if value is not None]
    if velocity_range is not None:
        ends = [_said("velocity_range", one, "km / s") for one in velocity_range]
        if len(ends) != 2:
            raise ValueError(f"velocity_range: must be two velocities, not {len(ends)}")
        options += ["--velocity-range", *ends]
    for name, files in (("photometry", photometry), ("indicator", indicator)):
        options += [f"--{name}={os.fspath(file)}" for file in _files(files)]
    place = Path("star.json") if out is None else Path(out)
    options.append(f"--out={place.absolute() if out is None else place}")
    if force or out is None:
        options.append("--force")
    scratch = Scratch()
    if isinstance(observations, Observations):
        observations.save(scratch.folder)
        lists = [os.fspath(scratch.folder / "observations.txt")]
    else:
        lists = [os.fspath(file) for file in _files(observations)]
    with shown("init", progress) as show, _by_keyword():
        try:
            text, table = _core.init([*options, "--", *lists], (_threads(threads), show))
        except ValueError as error:
            # of profiles in memory there is no file
            raise ValueError(str(error).replace(os.fspath(scratch.folder) + os.sep, "")) from None
    if out is None:
        content = json.loads(text)
        if isinstance(observations, Observations):
            del content["observations"]["path"]
        config = Config(content)
    else:
        Path(out).write_text(text, encoding="utf-8", newline="\n")
        config = Config(out)
    config._say(_core.broken(table.rstrip()))
    return config


def _files(files: _File | Sequence[_File]) -> list[_File]:
    return [files] if isinstance(files, (str, os.PathLike)) else list(files)


def _dashed(name: str) -> str:
    return name.replace("_", "-")


def _said(name: str, value: Any, unit: str | None) -> str:
    """A value as an option has it; of several lists one each, between commas."""
    value = value if unit is None else _units.number(name, value, unit)
    if hasattr(value, "tolist"):
        value = value.tolist()
    several = list(value) if isinstance(value, (list, tuple)) else [value]
    return ",".join(repr(one) if isinstance(one, float) else str(one) for one in several)
