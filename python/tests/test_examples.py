"""The notebook, cell by cell, and that types are right where users write them."""

from __future__ import annotations

import ast
import importlib.util
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from conftest import ROOT
from notebook import EXAMPLES, cells, notebook

SCRIPT = (EXAMPLES / "first_star.py").read_text()


def quicker(text: str, *changes: tuple[str, str]) -> str:
    """The same with less to compute: what users wait for is not what is tested here."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return text


def test_notebook_and_script_are_the_same() -> None:
    message = "python python/tests/notebook.py writes it anew"
    assert (EXAMPLES / "first_star.ipynb").read_text() == notebook(SCRIPT), message


def test_the_notebook_runs(capsys: pytest.CaptureFixture[str]) -> None:
    """As a notebook does: what a cell ends with is shown."""
    sources = ["".join(cell["source"]) for cell in json.loads(notebook(SCRIPT))["cells"] if cell["cell_type"] == "code"]
    assert sources == [text for kind, text in cells(SCRIPT) if kind == "code"]
    names: dict[str, Any] = {}
    whole = "\0".join(sources)
    whole = quicker(whole, ('"pixels": 500', '"pixels": 300'), ('"ess": 400, "rhat": 1.02', '"ess": 100, "rhat": 1.1'))
    for source in whole.split("\0"):
        tree = ast.parse(source)
        last = tree.body[-1] if tree.body and isinstance(tree.body[-1], ast.Expr) else None
        if last is not None:
            tree.body.pop()
        exec(compile(tree, "first_star.ipynb", "exec"), names)
        if last is not None:
            shown = eval(compile(ast.Expression(last.value), "first_star.ipynb", "eval"), names)
            for how in ("_repr_html_", "_repr_png_"):
                assert not hasattr(shown, how) or getattr(shown, how)()
    printed = capsys.readouterr().out
    assert "Detection" in printed and "Chain converged" in printed and "phi') True" in printed


def blocks(page: str) -> list[str]:
    return [block.split("\n```")[0] for block in page.split("```python\n")[1:]]


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a demo of few profiles, pixels and steps."""
    demo = json.loads((ROOT / "configs/demo.json").read_text())
    simulate = demo["observations"]["simulate"]
    # the same pixels, so that few of them are enough
    simulate |= {"cycles": simulate["cycles"][::4], "pixels": 200, "snr": 300}
    demo["imaging"] |= {"pixels": 200, "chi2_target": 1.0}
    demo["sampler"] = {"ensembles": 2, "walkers": 8, "steps": 10}
    (tmp_path / "configs").mkdir()
    (tmp_path / "configs/demo.json").write_text(json.dumps(demo))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_readme_runs(desk: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (block,) = blocks((ROOT / "README.md").read_text())
    assert len(block.splitlines()) <= 10
    exec(block, {})
    assert "k_kms" in capsys.readouterr().out and (desk / "corner.png").is_file()


@pytest.mark.parametrize("page", ["tutorials/python.md", "howto/samplers.md"])
def test_the_guides_run(desk: Path, page: str) -> None:
    names: dict[str, Any] = {}
    for block in blocks((ROOT / "docs" / page).read_text()):
        others = [name for name in ("emcee", "dynesty", "matplotlib") if f"import {name}" in block]
        if all(importlib.util.find_spec(name) for name in others):
            if others == ["dynesty"]:
                # to its end it would be most of the time of all tests
                block = quicker(block, ("nlive=500", "nlive=20"), ("run_nested()", "run_nested(maxcall=100)"))
            if "dimcmc.init(" in block:
                block = quicker(block, ("inclination=38.0", 'inclination=38.0, objective="spottedness", pixels=200'))
            exec(block, names)
    if "run" in names:
        assert names["run"].summary.steps > 10


def test_types_hold_on_the_examples() -> None:
    pytest.importorskip("mypy")
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--ignore-missing-imports", EXAMPLES / "first_star.py"],
        capture_output=True, text=True, check=False, cwd=ROOT / "python/tests",
        env={**os.environ, "MYPY_CACHE_DIR": os.devnull},
    )  # fmt: skip
    assert checked.returncode == 0, checked.stdout


def test_every_public_name_is_documented() -> None:
    import dimcmc

    page = (Path(ROOT) / "docs/reference/python.md").read_text()
    for name in dimcmc.__all__:
        thing = getattr(dimcmc, name)
        if name.startswith("__"):
            continue
        assert thing.__doc__, name
        assert f"`{name}" in page or f".{name}" in page, f"{name} is not in docs/reference/python.md"
        for method, what in vars(thing).items() if isinstance(thing, type) else []:
            if not method.startswith("_") and (callable(what) or isinstance(what, property)):
                documented = getattr(thing, method).__doc__ if callable(what) else what.__doc__
                assert documented, f"{name}.{method} has no docstring"


