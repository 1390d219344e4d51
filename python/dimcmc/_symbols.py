"""Symbols and units of parameters on axes, those of the program's own figures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ._units import unit_of

# spots have no symbols that everyone knows
_SYMBOLS = {
    "k_kms": "$K$",
    "porb_over_prot": r"$P_\mathrm{orb}/P_\mathrm{rot}$",
    "period_d": r"$P_\mathrm{orb}$",
    "phi": r"$\phi$",
    "t_conjunction_d": r"$T_\mathrm{conj}$",
    "sqrt_e_cos_omega": r"$\sqrt{e}\,\cos\omega$",
    "sqrt_e_sin_omega": r"$\sqrt{e}\,\sin\omega$",
    "k2_kms": "$K_2$",
    "porb2_over_prot": r"$P_\mathrm{orb,2}/P_\mathrm{rot}$",
    "period2_d": r"$P_\mathrm{orb,2}$",
    "phi2": r"$\phi_2$",
    "t_conjunction2_d": r"$T_\mathrm{conj,2}$",
    "sqrt_e2_cos_omega2": r"$\sqrt{e_2}\,\cos\omega_2$",
    "sqrt_e2_sin_omega2": r"$\sqrt{e_2}\,\sin\omega_2$",
    "omega_eq_rad_d": r"$\Omega_\mathrm{eq}$",
    "domega_rad_d": r"$\mathrm{d}\Omega$",
    "inclination_deg": "$i$",
    "vsini_kms": r"$v\,\sin i$",
    "vsys_kms": r"$v_\mathrm{sys}$",
    "limb_darkening": "$u$",
    "line_sigma_kms": r"$\sigma_\mathrm{line}$",
    "equivalent_width_kms": r"$W_\mathrm{line}$",
    "contrast": "$c$",
    "region_line_width": r"$w_\mathrm{r}$",
    "region_equivalent_width": r"$W_\mathrm{r}/W$",
    "region_shift_kms": r"$v_\mathrm{r}$",
    "region_area": "$F$",
    "region_area_limb": "$F_1$",
    "region_dimming_limb": "$q_1$",
    "spot_amplitude": "spot amplitude",
    "spot_slope": "power-law index",
    "spot_lifetime_d": "spot lifetime",
}
# as axes have them
_UNITS = {"rad / d": "rad/d", "km / s": "km/s", "m / s": "m/s", "deg": "°"}
_IN_DAYS = {"porb_over_prot": "period_d", "porb2_over_prot": "period2_d"}
_AMPLITUDES = ("k_kms", "k2_kms")
# velocities up to this are drawn in m/s (km/s)
_SMALL_KMS = 1.0


@dataclass(frozen=True)
class Shown:
    """A parameter as figures show it: periods in days, small velocities in m/s."""

    symbol: str
    unit: str
    #: What its values are multiplied by.
    factor: float = 1.0

    @property
    def label(self) -> str:
        """Label of an axis: symbol and unit."""
        return f"{self.symbol} ({self.unit})" if self.unit else self.symbol


def shown(name: str, rotation_period_d: float | None = None, largest: float = np.inf) -> Shown:
    """The parameter of a name whose values reach up to `largest`, of a star with a rotation period (d)."""
    if name in _IN_DAYS and rotation_period_d is not None:
        return Shown(_SYMBOLS[_IN_DAYS[name]], "d", rotation_period_d)
    if name in _AMPLITUDES:
        unit, factor = speeds(largest)
        return Shown(_SYMBOLS[name], unit, factor)
    if name in ("phi", "phi2"):
        return Shown(_SYMBOLS[name], "cycles")
    unit = unit_of(name) or ""
    return Shown(_SYMBOLS.get(name, name.replace("_", " ")), _UNITS.get(unit, unit))


def speeds(kms: ArrayLike) -> tuple[str, float]:
    """Unit in which velocities (km/s) are drawn, m/s for small ones, and what they are multiplied by."""
    sizes = np.abs(np.asarray(kms, dtype=np.float64))
    return ("m/s", 1e3) if np.max(sizes[~np.isnan(sizes)], initial=0.0) < _SMALL_KMS else ("km/s", 1.0)


def decimals(error: float | None) -> int:
    """Decimals that show two digits of `error`."""
    if error is None or not 0.0 < error < np.inf:
        return 3
    return int(np.clip(1.0 - np.floor(np.log10(error)), 0, 9))


def speed(kms: float, sigma_kms: float) -> str:
    """A semi-amplitude with its unit, m/s below 1 km/s."""
    factor, unit = (1e3, "m/s") if abs(kms) < 1.0 else (1.0, "km/s")
    return f"{factor * kms:.{decimals(factor * sigma_kms)}f} {unit}"


def interval(value: float, low: float, high: float) -> str:
    """A value with the distances of the ends of its interval, two digits of the half width of that."""
    digits = decimals(0.5 * (high - low))
    down, up = f"{value - low:.{digits}f}", f"{high - value:.{digits}f}"
    errors = rf"\pm {up}" if down == up else f"_{{-{down}}}^{{+{up}}}"
    return f"${value:.{digits}f}{errors}$"
