"""Progress of long calls, as tqdm shows it: a bar in a notebook, a line on a terminal."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

_Call = Callable[[float | None, str], None]


@contextmanager
def shown(what: str, wanted: bool | None) -> Iterator[_Call | None]:
    """A function for the engine to call with the share done and a text; by default shown where a person looks on."""
    if not (_looked_at() if wanted is None else wanted):
        yield None
        return
    with warnings.catch_warnings():
        # without ipywidgets it draws with characters, and says so every time
        warnings.simplefilter("ignore")
        from tqdm.auto import tqdm

        bar = tqdm(desc=what, total=100, bar_format="{desc}: {percentage:3.0f}%|{bar}| {elapsed}{postfix}", leave=False)

    def show(share: float | None, text: str) -> None:
        if share is not None:
            bar.n = min(100.0, round(100.0 * share, 1))
        bar.set_postfix_str(text)

    try:
        yield show
    finally:
        bar.close()


def _looked_at() -> bool:
    """Whether this is a notebook or a terminal."""
    shell: Any = sys.modules.get("IPython")
    if shell is not None and shell.get_ipython() is not None:
        return True
    return sys.stderr is not None and sys.stderr.isatty()
