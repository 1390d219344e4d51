"""Configs."""

from __future__ import annotations

import copy
import difflib
import html
import json
import math
import os
from collections.abc import Iterator, Mapping
from typing import Any

from . import _core, _text, _units

__all__ = ["Config", "Section"]


class Section(Mapping[str, Any]):
    """A section of a `Config`, such as ``config.star``: a live view.

    Keys are attributes and items. Missing keys read as the program's default; writing checks
    the whole config and leaves it as it was if it makes no sense.
    """

    __slots__ = ("_config", "_path")

    def __init__(self, config: Config, path: tuple[str, ...]) -> None:
        object.__setattr__(self, "_config", config)
        object.__setattr__(self, "_path", path)

    def _written(self) -> Mapping[str, Any]:
        return _at(self._config._json, self._path)

    def _resolved(self) -> Mapping[str, Any]:
        return _at(self._config._resolved, self._path)

    def __getitem__(self, key: str) -> Any:
        for values in (self._written(), self._resolved()):
            if key in values:
                value = values[key]
                return Section(self._config, (*self._path, key)) if isinstance(value, dict) else copy.deepcopy(value)
        raise KeyError(".".join((*self._path, key)))

    def __setitem__(self, key: str, value: Any) -> None:
        self._config._set((*self._path, key), value)

    def __delitem__(self, key: str) -> None:
        self._config._set((*self._path, key), _ABSENT)

    def __getattr__(self, key: str) -> Any:
        try:
            return self[key]
        except KeyError:
            raise AttributeError(_unknown((*self._path, key), self)) from None

    def __setattr__(self, key: str, value: Any) -> None:
        self[key] = value

    def __delattr__(self, key: str) -> None:
        del self[key]

    def __iter__(self) -> Iterator[str]:
        written = self._written()
        return iter([*written, *(key for key in self._resolved() if key not in written)])

    def __len__(self) -> int:
        return len(list(iter(self)))

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self]

    def to_dict(self) -> dict[str, Any]:
        """All keys with their values, defaults among them, as plain dicts and lists."""
        return {key: value.to_dict() if isinstance(value, Section) else value for key, value in self.items()}

    def __repr__(self) -> str:
        return _text.screen(f"{'.'.join(self._path) or 'config'}\n{_text.sections(self.to_dict())}", "see to_dict()")


class Config:
    """Star, observations, image, free parameters and sampler, by the keys of the reference of the config.

    Sections and keys are attributes. Every change is checked at once: an unknown key, or a value that makes no sense,
    is a `ValueError` that names it, and changes nothing.

    Parameters
    ----------
    source : dict, str, path or Config
        Keys and values; the same as JSON text, which begins with a brace; or the path of a JSON file. Paths in the
        config start from the folder of that file, or else from the working directory. Where profiles are at hand as
        `Observations`, nothing need be said of them. Numbers are in the units of their keys; quantities of astropy
        are converted to them.

    Raises
    ------
    ValueError
        A key that is unknown, missing, or does not make sense; its message names the key.
    OSError
        A file that cannot be read.

    Examples
    --------
    >>> import dimcmc
    >>> config = dimcmc.Config({
    ...     "star": {"rotation_period_d": 3.0, "inclination_deg": 60.0, "vsini_kms": 25.0, "contrast": 0.3,
    ...              "line": {"sigma_kms": 4.0, "equivalent_width_kms": 6.0}},
    ...     "observations": {"path": "observations.txt"},
    ...     "parameters": {"k_kms": {"prior": "uniform", "min": 0.0, "max": 1.0}},
    ... })
    >>> config.star.vsini_kms
    25.0
    >>> config.star.vsini_kms = 26.0
    >>> config.sampler.steps = 500
    >>> config.star.vsini = 26.0
    Traceback (most recent call last):
    ...
    ValueError: config: unknown key star.vsini: did you mean vsini_kms?
    """

    _json: dict[str, Any]
    _resolved: dict[str, Any]
    _path: str | None
    _sources: str | None = None

    def __init__(self, source: Mapping[str, Any] | str | os.PathLike[str] | Config) -> None:
        path: str | None = None
        if isinstance(source, Config):
            value, path = source._json, source._path
            self._say(source._sources)
        elif isinstance(source, Mapping):
            value = dict(source)
        elif isinstance(source, str) and source.lstrip().startswith("{"):
            resolved = _core.check_config((source, None))
            self._keep(json.loads(source), json.loads(resolved), None)
            return
        elif isinstance(source, (str, os.PathLike)):
            path = os.fspath(source)
            # a file that is not there is an error of the system's, with its name
            with open(path, "rb"):
                written, resolved = _core.load_config(path)
            self._keep(json.loads(written), json.loads(resolved), path)
            return
        else:
            raise TypeError(f"a config is a dict, JSON text or a path, not {type(source).__name__}")
        self._keep(*_checked(value, path), path)

    def _keep(self, value: dict[str, Any], resolved: dict[str, Any], path: str | None) -> None:
        for name, content in [("_json", value), ("_resolved", resolved), ("_path", path)]:
            object.__setattr__(self, name, content)

    def _say(self, sources: str | None) -> None:
        object.__setattr__(self, "_sources", sources)

    @property
    def sources(self) -> str | None:
        """What `init` printed: each value with its source, then notes; None of a config from elsewhere."""
        return self._sources

    def _set(self, path: tuple[str, ...], value: Any) -> None:
        """Put a value at a path of keys, if the whole makes sense then."""
        changed = copy.deepcopy(self._json)
        place = changed
        for key in path[:-1]:
            if not isinstance(place.get(key), dict):
                place[key] = {}
            place = place[key]
        if value is _ABSENT:
            place.pop(path[-1], None)
        else:
            place[path[-1]] = value
        self._keep(*_checked(changed, self._path), self._path)

    def update(self, changes: Mapping[str, Any]) -> None:
        """Change several keys at once, where each by itself would make no sense.

        Parameters
        ----------
        changes : dict
            Sections with their new values; keys of sections that are not named stay. ``None`` leaves a key out.

        Examples
        --------
        >>> config.update({"sampler": {"walkers": 20, "steps": 400}, "grid": None})    # doctest: +SKIP
        """
        changed = copy.deepcopy(self._json)
        _merge(changed, changes)
        self._keep(*_checked(changed, self._path), self._path)

    def copy(self) -> Config:
        """Another config of the same content."""
        return Config(self)

    def to_dict(self) -> dict[str, Any]:
        """What was given, as plain dicts and lists."""
        return copy.deepcopy(self._json)

    def resolved(self) -> dict[str, Any]:
        """The same with all defaults filled in, as results keep it."""
        return copy.deepcopy(self._resolved)

    def to_json(self) -> str:
        """What was given, as JSON text."""
        return json.dumps(self._json, indent=2, ensure_ascii=False)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a config file for the command line. Paths in it start from its folder then.

        Parameters
        ----------
        path : str or path
            The file; one that is there is replaced.
        """
        with open(path, "w", encoding="utf-8") as file:
            file.write(self.to_json() + "\n")

    def _as_text(self, observed: bool = False) -> tuple[str, str | None]:
        """What the engine takes; where profiles are `observed` as arrays, none are simulated."""
        value = self._json
        if observed and isinstance(value.get("observations"), dict):
            section = {key: one for key, one in value["observations"].items() if key != "simulate"}
            value = {**value, "observations": section}
        return json.dumps(_with_profiles(value) if observed else value), self._path

    def _root(self) -> Section:
        return Section(self, ())

    def __getitem__(self, key: str) -> Any:
        return self._root()[key]

    def __setitem__(self, key: str, value: Any) -> None:
        self._set((key,), value)

    def __getattr__(self, key: str) -> Any:
        if key.startswith("__") or "_json" not in self.__dict__:
            raise AttributeError(key)
        return getattr(self._root(), key)

    def __setattr__(self, key: str, value: Any) -> None:
        self._set((key,), value)

    def __delattr__(self, key: str) -> None:
        self._set((key,), _ABSENT)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._root()]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Config) and (self._json, self._path) == (other._json, other._path)

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore, (self._json, self._path, self._sources)

    def __str__(self) -> str:
        return self.to_json()

    def __repr__(self) -> str:
        head = "Config" if self._path is None else f"Config {self._path}"
        return _text.screen(f"{head}\n{_text.sections(self._json)}")

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(repr(self))}</pre>"


_ABSENT = object()

# stands for the list of profiles that are arrays
_IN_MEMORY = "profiles in memory"


def _restore(value: dict[str, Any], path: str | None, sources: str | None) -> Config:
    config = Config.__new__(Config)
    config._keep(*_checked(value, path), path)
    config._say(sources)
    return config


def _at(values: dict[str, Any], path: tuple[str, ...]) -> Mapping[str, Any]:
    for key in path:
        below = values.get(key)
        if not isinstance(below, dict):
            return {}
        values = below
    return values


def _plain(value: Any, path: tuple[str, ...]) -> Any:
    """As JSON has it: also numbers and arrays of numpy, quantities of astropy, paths, sections of another config."""
    if getattr(value, "unit", None) is not None:
        # the prior of a parameter has its unit
        name = next((key for key in reversed(path) if _units.unit_of(key)), path[-1])
        value = _units.number(name, value)
    if isinstance(value, Section):
        return value.to_dict()
    if isinstance(value, Mapping):
        return {str(key): _plain(one, (*path, str(key))) for key, one in value.items()}
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [_plain(one, (*path, str(k))) for k, one in enumerate(value)]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"config: {'.'.join(path)}: must be a finite number, not {value}")
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    kind = type(value).__name__
    raise TypeError(f"config: {'.'.join(path)}: a config holds numbers, texts, lists and dicts, not {kind}")


def _checked(value: Mapping[str, Any], path: str | None) -> tuple[dict[str, Any], dict[str, Any]]:
    """As JSON has it, and with all defaults."""
    plain = _plain(value, ())
    return plain, json.loads(_core.check_config((json.dumps(_with_profiles(plain)), path)))


def _with_profiles(value: dict[str, Any]) -> dict[str, Any]:
    """The same for profiles given as arrays, which the config then omits."""
    section = value.get("observations", {})
    if not isinstance(section, dict) or section.get("path") is not None or section.get("simulate") is not None:
        return value
    return {**value, "observations": {**section, "path": _IN_MEMORY}}


def _merge(values: dict[str, Any], changes: Mapping[str, Any]) -> None:
    for key, change in changes.items():
        if change is None:
            values.pop(key, None)
        elif isinstance(change, Mapping) and isinstance(values.get(key), dict):
            _merge(values[key], change)
        else:
            values[key] = change


def _unknown(path: tuple[str, ...], section: Section) -> str:
    nearest = difflib.get_close_matches(path[-1], list(section), n=1)
    hint = f": did you mean {nearest[0]}?" if nearest else ""
    return f"the config has no {'.'.join(path)}{hint}"
