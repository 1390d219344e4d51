"""Units: a number is in the unit that its name ends with; quantities of astropy are converted to it."""

from __future__ import annotations

from typing import Any

__all__ = ["number", "quantity", "unit_of"]

# units by the end of a name, the longer ends first
_UNITS = {
    "_rad_d": "rad / d",
    "_kms": "km / s",
    "_deg": "deg",
    "_msun": "solMass",
    "_ms": "m / s",
    "_nm": "nm",
    "_d": "d",
    "_k": "K",
}


def unit_of(name: str) -> str | None:
    """The unit of what is called so, as astropy spells it."""
    return next((unit for end, unit in _UNITS.items() if name.endswith(end)), None)


def number(name: str, value: Any, unit: str | None = None) -> Any:
    """The numbers of a quantity in `unit`, by default that of its name; anything else unchanged.

    Lists may hold quantities, and times may be an `astropy.time.Time`. Nothing of astropy is imported: whoever has a
    quantity has it.
    """
    unit = unit_of(name) if unit is None else unit
    if isinstance(value, (list, tuple)):
        return [number(name, one, unit or "") for one in value]
    if getattr(value, "unit", None) is not None:
        return _converted(name, value, unit or "")
    # a time is no quantity: its Julian date, on its own scale
    if hasattr(value, "jd") and hasattr(value, "scale"):
        if unit != "d":
            raise ValueError(f"{name}: a time, not {_words(unit or '')}")
        return value.jd
    return value


def _converted(name: str, value: Any, unit: str) -> Any:
    # a column of a table
    value = getattr(value, "quantity", value)
    try:
        return value.to_value(unit)
    except (AttributeError, TypeError, ValueError):
        given = str(value.unit) or "no unit"
        raise ValueError(f"{name}: in {given}, which cannot be converted to {_words(unit)}") from None


def _words(unit: str) -> str:
    return unit.replace(" ", "") or "a pure number"


def quantity(value: Any, unit: str) -> Any:
    """The numbers with their unit, as a quantity of astropy."""
    try:
        from astropy import units
    except ImportError as error:
        raise ImportError("astropy is needed: pip install astropy") from error
    return units.Quantity(value, unit)
