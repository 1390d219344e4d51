"""Text that fits a screen, for `repr`."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping
from pprint import pformat
from typing import Any

__all__ = ["LINES", "WIDTH", "sections", "screen", "values"]

# lines of a `repr`, and their width
LINES, WIDTH = 30, 100

# lines of one section of a config
_SECTION_LINES = 4
# elements of a list that are shown
_ELEMENTS = 8
# levels of dicts of results
_DEPTH = 2

# a blank where no line ends
_TIE = "\N{NO-BREAK SPACE}"
# what separates the columns of a table
_GAP = re.compile(r"\S {2,}(?=\S)")


def screen(text: str, more: str = "print() shows all") -> str:
    """A text cut to a screen: sentences are wrapped, rows of tables cut."""
    lines = [part for line in text.rstrip().split("\n") for part in _wrapped(line)]
    if len(lines) > LINES:
        left = len(lines) - LINES + 1
        lines = [*lines[: LINES - 1], f"… {left} more lines: {more}"]
    return "\n".join(lines)


def _wrapped(line: str) -> list[str]:
    if len(line) <= WIDTH:
        return [line]
    if len(_GAP.findall(line)) > 1:
        return [line[: WIDTH - 1] + "…"]
    return textwrap.wrap(line, WIDTH, subsequent_indent="    ")


class _Verbatim(str):
    """A text that `pformat` shows without quotes."""

    def __repr__(self) -> str:
        return str(self)


def _short(value: Any, depth: int = 0) -> Any:
    """Long lists, and dicts deep inside, as the number of what they hold."""
    if isinstance(value, Mapping):
        if depth == _DEPTH:
            return _Verbatim(f"{{{len(value)} keys}}")
        return {key: _short(one, depth + 1) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        if len(value) > _ELEMENTS:
            return _Verbatim(f"[{len(value)} values]")
        return [_short(one, depth) for one in value]
    return value


def values(content: Mapping[str, Any]) -> str:
    """A dict of results, long lists and dicts deep inside as the number of what they hold."""
    return screen(pformat(_short(content), width=WIDTH, compact=True, sort_dicts=False), "see its keys")


def sections(content: Mapping[str, Any]) -> str:
    """Sections of a config, a paragraph for each."""
    width = max((len(name) for name in content), default=0)
    lines: list[str] = []
    for name, section in content.items():
        inside = section if isinstance(section, Mapping) else {"": section}
        text = ", ".join(_pair(key, one) for key, one in inside.items())
        head, rest = f"  {name:<{width}}  ", " " * (width + 4)
        block = textwrap.wrap(text, WIDTH, initial_indent=head, subsequent_indent=rest) or [head.rstrip()]
        if len(block) > _SECTION_LINES:
            block = block[:_SECTION_LINES]
            block[-1] = block[-1][: WIDTH - 2] + " …"
        lines += block
    return "\n".join(lines).replace(_TIE, " ")


def _pair(key: str, value: Any) -> str:
    """A key and its value, which is not broken off it."""
    return f"{key}{_TIE}{_inline(value)}" if key else _inline(value)


def _inline(value: Any) -> str:
    value = _short(value, -_ELEMENTS)
    if isinstance(value, Mapping):
        return "{" + ", ".join(_pair(key, one) for key, one in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_inline(one) for one in value) + "]"
    words = {"None": "null", "True": "true", "False": "false"}
    return words.get(str(value), str(value))
