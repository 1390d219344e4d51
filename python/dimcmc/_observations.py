"""Line profiles as arrays."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core, _units

__all__ = ["Observations"]

# velocities are evenly spaced to this share of their step
_EVEN = 1e-3


class Observations:
    """Line profiles (LSD, Stokes I) at hand as arrays, in place of files.

    Everywhere a config is taken, ``observations=`` may be given beside it, in place of ``observations.path`` or
    ``observations.simulate`` of the config. They are cut, scaled and judged as profiles from files would be.

    Parameters
    ----------
    times_d : array_like, shape (profiles,)
        Time of the middle of each exposure (d), on the time scale of ``star.epoch_d``.
    velocities_kms : array_like, shape (bins,) or (profiles, bins)
        Velocity of each bin (km/s), growing in even steps, that are those of all profiles.
    intensity : array_like, shape (profiles, bins)
        Intensity in units of the continuum.
    sigma : array_like, scalar or shape (profiles,) or (profiles, bins)
        Standard error of the intensity.

    Raises
    ------
    ValueError
        Arrays of shapes that do not fit, velocities that do not grow evenly, numbers that are not finite, errors that
        are not above 0, fewer than two profiles, quantities of another kind.

    Notes
    -----
    Numbers are in the units above. Quantities of astropy are converted to them, and `astropy.time.Time` to Julian
    dates on its own scale.

    Examples
    --------
    >>> import dimcmc, numpy as np
    >>> velocities_kms = np.arange(-60.0, 60.1, 2.0)
    >>> line = 1.0 - 0.1 * np.exp(-0.5 * (velocities_kms / 20.0) ** 2)
    >>> dimcmc.Observations([0.0, 0.4, 1.1], velocities_kms, np.tile(line, (3, 1)), 1e-3)
    Observations: 3 profiles of 61 bins, -60 to 60 km/s, 0 to 1.1 d

    With astropy, any unit of velocity and time:

    >>> dimcmc.Observations(times, velocities.to("m/s"), intensity, sigma)       # doctest: +SKIP
    """

    __slots__ = ("first_velocity_kms", "intensity", "sigma", "step_kms", "times_d")

    times_d: NDArray[np.float64]
    """Times (d)."""
    first_velocity_kms: NDArray[np.float64]
    """Velocity of the first bin of each profile (km/s)."""
    step_kms: float
    """Width of the bins (km/s)."""
    intensity: NDArray[np.float64]
    """Intensities, shape (profiles, bins)."""
    sigma: NDArray[np.float64]
    """Standard errors, shape (profiles, bins)."""

    def __init__(
        self, times_d: ArrayLike, velocities_kms: ArrayLike, intensity: ArrayLike, sigma: ArrayLike
    ) -> None:
        times, profiles = _floats("times_d", times_d, (1,)), _floats("intensity", intensity, (2,))
        count, bins = profiles.shape
        if times.shape != (count,):
            turned = ", or is intensity transposed?" if times.shape == (bins,) else ""
            raise ValueError(f"times_d: {times.size} times for {count} profiles{turned}")
        velocities = _floats("velocities_kms", velocities_kms, (1, 2))
        if velocities.shape not in [(bins,), (count, bins)]:
            raise ValueError(f"velocities_kms: shape {velocities.shape} for {count} profiles of {bins} bins")
        rows = np.atleast_2d(velocities)
        step = _step(rows)
        errors = _floats("sigma", sigma, (0, 1, 2))
        if errors.shape not in [(), (count,), (count, bins)]:
            raise ValueError(f"sigma: shape {errors.shape} for {count} profiles of {bins} bins")
        errors = errors[:, np.newaxis] if errors.ndim == 1 else errors
        self._keep(
            times, np.broadcast_to(rows[:, 0], (count,)), step, profiles, np.broadcast_to(errors, profiles.shape)
        )

    def _keep(self, times: Any, first: Any, step: float, intensity: Any, sigma: Any) -> None:
        arrays = tuple(np.array(array, dtype=np.float64, order="C") for array in (times, first, intensity, sigma))
        for array in arrays:
            array.flags.writeable = False
        self.times_d, self.first_velocity_kms, self.intensity, self.sigma = arrays
        self.step_kms = step
        _core.check_observations(self._arrays())

    @classmethod
    def _of(cls, arrays: tuple[Any, ...]) -> Observations:
        """Back from the engine, or from a pickle, to the bit."""
        observations = cls.__new__(cls)
        observations._keep(*arrays)
        return observations

    def _arrays(self) -> tuple[Any, Any, float, Any, Any]:
        """What the engine takes."""
        return self.times_d, self.first_velocity_kms, self.step_kms, self.intensity, self.sigma

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> Observations:
        """Read the profiles that a list names, as ``observations.path`` of a config does.

        Parameters
        ----------
        path : str or path
            The list, one profile per line: file, time (d), and optionally the velocity to subtract (km/s).

        Returns
        -------
        Observations

        Raises
        ------
        ValueError
            No list there, or profiles that cannot be read; the message names the file and line.
        """
        return cls._of(_core.read_observations(os.fspath(path)))

    def quantity(self, name: str) -> Any:
        """One of the arrays as a quantity of astropy, which must be installed.

        Parameters
        ----------
        name : {"times_d", "velocities_kms", "intensity", "sigma"}
            Which one.

        Returns
        -------
        astropy.units.Quantity

        Examples
        --------
        >>> profiles.quantity("velocities_kms").to("m/s")                         # doctest: +SKIP
        """
        if name not in ("times_d", "velocities_kms", "intensity", "sigma"):
            raise ValueError(f"name: must be times_d, velocities_kms, intensity or sigma, not {name!r}")
        return _units.quantity(getattr(self, name), _units.unit_of(name) or "")

    @property
    def velocities_kms(self) -> NDArray[np.float64]:
        """Velocities of all bins (km/s), shape (profiles, bins)."""
        return self.first_velocity_kms[:, np.newaxis] + self.step_kms * np.arange(self.intensity.shape[1])

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write `observations.txt` and the profiles that it lists, for ``observations.path`` of a config.

        Parameters
        ----------
        folder : str or path
            Made if need be. Files of these names are replaced.
        """
        os.makedirs(folder, exist_ok=True)
        _core.write_observations(self._arrays(), os.fspath(folder))

    def __len__(self) -> int:
        return len(self.times_d)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Observations):
            return NotImplemented
        return all(np.array_equal(a, b) for a, b in zip(self._arrays(), other._arrays()))

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        return Observations._of, (self._arrays(),)

    def __repr__(self) -> str:
        velocities, times = self.velocities_kms, self.times_d
        # two decimals: Julian dates are long, and nights differ by one
        span = f"{velocities.min():g} to {velocities.max():g} km/s, {times.min():.2f} to {times.max():.2f} d"
        return f"Observations: {len(self)} profiles of {self.intensity.shape[1]} bins, {span}"


def _floats(name: str, values: ArrayLike, dimensions: tuple[int, ...]) -> NDArray[np.float64]:
    values = _units.number(name, values, _units.unit_of(name) or "")
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise type(error)(f"{name}: must be numbers: {error}") from None
    if array.ndim not in dimensions:
        wanted = " or ".join(str(n) for n in dimensions)
        raise ValueError(f"{name}: must have {wanted} dimensions, not {array.ndim}")
    return array


def _step(velocities: NDArray[np.float64]) -> float:
    """The even step of rows of velocities."""
    steps = np.diff(velocities, axis=1)
    if steps.size == 0:
        raise ValueError("velocities_kms: a profile needs two bins at least")
    if not np.all(np.isfinite(velocities)):
        raise ValueError("velocities_kms: must be finite")
    step = float(np.mean((velocities[:, -1] - velocities[:, 0]) / steps.shape[1]))
    if not step > 0.0:
        raise ValueError("velocities_kms: must grow from bin to bin")
    if not np.all(np.abs(steps - step) < _EVEN * step):
        raise ValueError("velocities_kms: must grow in even steps, those of all profiles; resample the profiles")
    return step
