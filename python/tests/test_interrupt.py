"""Ctrl-C: within a second, and what was sampled goes on to the same bytes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT, SMALL

import dimcmc

if sys.platform == "win32":
    pytest.skip("signals are those of Unix", allow_module_level=True)

PROGRAM = """
import json, sys, dimcmc
print("begins", flush=True)
CALL
"""


def interrupted(call: str, ready: Path | None, tmp_path: Path) -> tuple[float, str]:
    """Runs a call in another process, presses Ctrl-C there once a file is there or after half a second; seconds until
    the end, and what it said."""
    child = subprocess.Popen(
        [sys.executable, "-c", PROGRAM.replace("CALL", call)], cwd=tmp_path, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    assert child.stdout is not None and child.stdout.readline() == "begins\n"
    deadline = time.monotonic() + 60.0
    if ready is None:
        time.sleep(0.5)
    while ready is not None and not (ready.is_file() and ready.read_bytes().count(b"\n") > 40):
        assert child.poll() is None and time.monotonic() < deadline, child.communicate()
        time.sleep(0.01)
    os.kill(child.pid, signal.SIGINT)
    began = time.monotonic()
    _, said = child.communicate(timeout=60)
    return time.monotonic() - began, said


def test_a_chain_stops_and_goes_on(tmp_path: Path) -> None:
    star = {**SMALL, "sampler": {**SMALL["sampler"], "steps": 200, "ess": 1e6}}
    (tmp_path / "star.json").write_text(json.dumps(star))
    call = "dimcmc.sample('star.json', out='run', threads=1)"
    seconds, said = interrupted(call, tmp_path / "run/chain.jsonl", tmp_path)
    assert "KeyboardInterrupt: interrupted after step" in said and "resume=True" in said, said
    # a second, and the end of the interpreter
    assert seconds < 1.5
    before = dimcmc.Run.open(tmp_path / "run").summary.steps
    assert before < 200
    whole = dimcmc.sample(star)
    gone_on = dimcmc.sample(star, out=tmp_path / "run", resume=True)
    assert (gone_on.folder / "chain.jsonl").read_bytes() == (whole.folder / "chain.jsonl").read_bytes()


def test_a_grid_stops_and_goes_on(tmp_path: Path) -> None:
    imaging = {**SMALL["imaging"], "chi2_target": 1.1}
    star = {**SMALL, "imaging": imaging, "grid": {"axes": {"k_kms": [0.2, 0.4, 20], "phi": [0.45, 0.55, 40]}}}
    (tmp_path / "star.json").write_text(json.dumps(star))
    call = "dimcmc.grid('star.json', out='grid', threads=1)"
    seconds, said = interrupted(call, tmp_path / "grid/landscape.jsonl", tmp_path)
    assert "KeyboardInterrupt: interrupted after" in said and "resume=True" in said, said
    assert seconds < 1.5
    nodes = tmp_path / "grid/landscape.jsonl"
    assert 40 < nodes.read_bytes().count(b"\n") < 800
    gone_on = dimcmc.grid(star, out=tmp_path / "grid", resume=True)
    whole = dimcmc.grid(star)
    assert nodes.read_bytes() == (whole.folder / "landscape.jsonl").read_bytes()
    assert gone_on.paraboloid == whole.paraboloid


@pytest.mark.parametrize("name", ["sample", "periodogram", "optimise", "map", "limits", "grid", "LogPosterior"])
def test_long_calls_stop_and_leave_nothing(name: str, tmp_path: Path) -> None:
    star = json.loads((ROOT / "configs/demo.json").read_text())
    star["imaging"]["pixels"] = 20_000
    (tmp_path / "star.json").write_text(json.dumps(star))
    out = "" if name == "LogPosterior" else ", out='result'"
    seconds, said = interrupted(f"dimcmc.{name}('star.json'{out})", None, tmp_path)
    assert "KeyboardInterrupt" in said, said
    assert seconds < 1.5 and not (tmp_path / "result").exists()


def test_a_batch_stops(log_posterior: dimcmc.LogPosterior) -> None:
    theta = np.tile(log_posterior.optimum, (200_000, 1))
    main = os.getpid()
    watch = subprocess.Popen(["sh", "-c", f"sleep 0.5; kill -INT {main}"])
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        log_posterior(theta)
    assert time.monotonic() - began < 1.7
    watch.wait()
