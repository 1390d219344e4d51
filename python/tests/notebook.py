"""The cells of a script with `# %%` marks, and the notebook that is made of them.

    python python/tests/notebook.py        # writes examples/first_star.ipynb anew
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def cells(script: str) -> list[tuple[str, str]]:
    """Kind (`code` or `markdown`) and text of each cell."""
    found: list[tuple[str, str]] = []
    for block in script.split("# %%")[1:]:
        head, _, body = block.partition("\n")
        kind = "markdown" if "[markdown]" in head else "code"
        lines = body.strip("\n").split("\n")
        if kind == "markdown":
            lines = [line.removeprefix("#").removeprefix(" ") for line in lines]
        found.append((kind, "\n".join(lines)))
    return found


def notebook(script: str) -> str:
    """The notebook of a script, without results."""
    made: list[dict[str, Any]] = []
    for k, (kind, text) in enumerate(cells(script)):
        cell: dict[str, Any] = {"cell_type": kind, "id": f"cell-{k}", "metadata": {}}
        if kind == "code":
            cell |= {"execution_count": None, "outputs": []}
        made.append(cell | {"source": text.splitlines(keepends=True)})
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    metadata = {"kernelspec": kernel, "language_info": {"name": "python"}}
    whole = {"cells": made, "metadata": metadata, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(whole, indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    (EXAMPLES / "first_star.ipynb").write_text(notebook((EXAMPLES / "first_star.py").read_text()))
