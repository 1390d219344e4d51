"""The commands that begin and end an analysis: a first config, injections, limits, a likelihood grid, folders opened
again, a report."""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from conftest import SMALL
from numpy.typing import NDArray

import dimcmc

# the objective with the quicker test fit
QUICK: Literal["spottedness"] = "spottedness"
FEW: dict[str, Any] = {"periods": 3, "amplitudes": 4, "phases": 4, "draws": 1000}


def files(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def command(*arguments: object, cwd: Path) -> str:
    """The command line itself."""
    call = [sys.executable, "-m", "dimcmc", *(str(argument) for argument in arguments)]
    ended = subprocess.run(call, capture_output=True, text=True, cwd=cwd, check=False)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


@pytest.fixture(scope="module")
def profiles(simulation: dimcmc.Simulation, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("profiles")
    simulation.observations.save(folder)
    return folder / "observations.txt"


@pytest.fixture(scope="module")
def limits(tmp_path_factory: pytest.TempPathFactory) -> dimcmc.Limits:
    return dimcmc.limits(SMALL, out=tmp_path_factory.mktemp("limits") / "limits", **FEW)


GRID = {
    **SMALL,
    "imaging": {**SMALL["imaging"], "chi2_target": 1.1},
    "grid": {"axes": {"k_kms": [0.2, 0.4, 5], "phi": [0.48, 0.53, 6]}},
}


@pytest.fixture(scope="module")
def grid(tmp_path_factory: pytest.TempPathFactory) -> dimcmc.Grid:
    return dimcmc.grid(GRID, out=tmp_path_factory.mktemp("grid") / "grid")


def test_a_first_config_is_that_of_the_command_line(profiles: Path, tmp_path: Path) -> None:
    known: dict[str, Any] = {"rotation_period": 3.0, "inclination": 60.0, "pixels": 200, "objective": QUICK}
    options = [f"--{name.replace('_', '-')}={value}" for name, value in known.items()]
    printed = command("init", profiles, *options, "--out", tmp_path / "command.json", cwd=tmp_path)
    config = dimcmc.init(profiles, **known, out=tmp_path / "python.json")
    assert (tmp_path / "python.json").read_bytes() == (tmp_path / "command.json").read_bytes()
    assert config.star.rotation_period_d == 3.0 and abs(config.star.vsini_kms - 25.0) < 3.0
    assert config.sources and config.sources in printed and "vsini_kms" in config.sources
    # the table goes with the config
    assert config.copy().sources == config.sources == pickle.loads(pickle.dumps(config)).sources
    assert dimcmc.Config(SMALL).sources is None
    with pytest.raises(ValueError, match=r"out .*python.json exists"):
        dimcmc.init(profiles, **known, out=tmp_path / "python.json")
    # without a file, paths start from the working directory
    there = dimcmc.init(profiles, **known)
    assert (Path(os.getcwd()) / there.observations.path).samefile(profiles)
    assert not Path("star.json").exists()


def test_a_first_config_for_arrays(simulation: dimcmc.Simulation, tmp_path: Path) -> None:
    profiles = simulation.observations
    config = dimcmc.init(profiles, rotation_period=3.0, inclination=60.0, vsini=25.0, pixels=200, objective=QUICK)
    assert "path" not in config.to_dict()["observations"] and config.star.vsini_kms == 25.0
    assert str(config.sources).count("vsini") and "/tmp" not in str(config.sources)
    assert dimcmc.map(config, observations=profiles).summary.profiles == len(profiles)
    with pytest.raises(ValueError, match="out: a config names files"):
        dimcmc.init(profiles, rotation_period=3.0, out=tmp_path / "star.json")


def test_wrong_values_of_a_first_config_name_the_argument(profiles: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"^inclination: star.inclination_deg: 120 must"):
        dimcmc.init(profiles, rotation_period=3.0, inclination=120.0)
    with pytest.raises(ValueError, match="instrument: .*; for any other give resolving_power and wavelength"):
        dimcmc.init(profiles, rotation_period=3.0, instrument="Telescope")
    with pytest.raises(ValueError, match="invalid value 'long' for 'rotation_period <DAYS>'"):
        dimcmc.init(profiles, rotation_period="long")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="none.txt"):
        dimcmc.init(tmp_path / "none.txt", rotation_period=3.0)
    with pytest.raises(ValueError, match="velocity_range: 3 must be below 2"):
        dimcmc.init(profiles, rotation_period=3.0, velocity_range=(3.0, 2.0))


def test_an_injected_orbit_is_recovered(simulation: dimcmc.Simulation, tmp_path: Path) -> None:
    orbit: dict[str, Any] = {"k_kms": 0.5, "porb_over_prot": 1.7, "phi": 0.5}
    injected = dimcmc.inject(SMALL, **orbit, out=tmp_path / "injected")
    assert injected.truth.injected == orbit and injected.sets == [injected.observations]
    shift = np.array(injected.truth.velocity_kms)
    cycles = np.array(injected.truth.times_d) / 3.0
    assert np.allclose(shift, 0.5 * np.cos(2 * np.pi * (cycles / 1.7 - 0.5)))

    def centroid(profiles: dimcmc.Observations) -> NDArray[np.float64]:
        depth = 1.0 - profiles.intensity
        moments: NDArray[np.float64] = (depth * profiles.velocities_kms).sum(axis=1) / depth.sum(axis=1)
        return moments

    # the centroid of each line moves by the velocity of the orbit
    moved = centroid(injected.observations) - centroid(simulation.observations)
    assert np.corrcoef(moved, shift)[0, 1] > 0.99
    # it adds to that of the simulation, and the map fits with both
    config = injected.config
    config.planet = {**orbit, "k_kms": 0.8}
    assert dimcmc.map(config).summary.chi2_per_datum == pytest.approx(1.0, abs=0.2)
    wrongs: list[tuple[dict[str, Any], str]] = [
        ({"k_kms": -1.0}, r"^k_kms: must be from 0"),
        ({"porb_over_prot": 0.0}, "^porb_over_prot"),
    ]
    for wrong, words in wrongs:
        with pytest.raises(ValueError, match=words):
            dimcmc.inject(SMALL, **{**orbit, **wrong})


def test_limits_are_those_of_the_command_line(limits: dimcmc.Limits, tmp_path: Path) -> None:
    (tmp_path / "star.json").write_text(json.dumps(SMALL))
    options = [f"--{name}={value}" for name, value in FEW.items()]
    printed = command("limits", "star.json", *options, "--out", "limits", cwd=tmp_path)
    assert str(limits) in printed
    theirs = files(tmp_path / "limits")
    assert theirs["limits.csv"] == files(limits.folder)["limits.csv"]
    assert len(limits.periods["period_d"]) == 3 and len(limits.injections["k_kms"]) == 12
    k50, k95 = limits.periods["k50_kms"], limits.periods["k95_kms"]
    bounded = np.isfinite(k50) & np.isfinite(k95)
    assert bounded.any() and np.all(k50[bounded] <= k95[bounded])
    assert limits.figures == ["limits"] and "k_kms" in limits.figure_data()
    assert limits.summary.removed is None
    without = dimcmc.limits(SMALL, without_best=True, min_k_kms=0.5, max_k_kms=2.0, **FEW)
    assert without.summary.removed.k_kms < 0.0 and without.summary.k_kms[0] == 0.5


def test_limits_through_the_full_pipeline() -> None:
    found = dimcmc.limits(SMALL, full=2, **FEW)
    assert found.summary.agreement.orbits == 2 and "full pipeline" in str(found)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"periods": 1}, "periods: must be from 2"),
        ({"draws": 10}, "draws: must be from 1000"),
        ({"min_k_kms": 2.0, "max_k_kms": 1.0, **FEW}, "^min_k_kms, max_k_kms: 2 to 1 km/s is no range"),
        ({"with_best": True, "without_best": True}, "give one of them"),
        ({"full": -1}, "full"),
    ],
)
def test_limits_refuse_nonsense(wrong: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        dimcmc.limits(SMALL, **wrong)


def test_a_grid_in_numbers(grid: dimcmc.Grid, tmp_path: Path) -> None:
    assert grid.names == ["k_kms", "phi"] and grid.shape == (5, 6) == grid.log_likelihood.shape
    assert np.allclose(grid.axes["k_kms"], [0.2, 0.25, 0.3, 0.35, 0.4])
    # an axis of the array for each of the grid
    assert np.allclose(grid.nodes["k_kms"].reshape(grid.shape)[:, 0], grid.axes["k_kms"])
    assert np.allclose(grid.nodes["phi"].reshape(grid.shape)[0], grid.axes["phi"])
    best = np.unravel_index(np.nanargmax(grid.log_likelihood), grid.shape)
    assert abs(grid.axes["phi"][best[1]] - 0.5) < 0.15
    vertex = grid.paraboloid.parameters.k_kms
    assert abs(vertex.vertex - 0.3) < 5.0 * vertex.error
    assert grid.figure_data()["log_likelihood"].shape == grid.shape
    (tmp_path / "star.json").write_text(json.dumps(GRID))
    printed = command("grid", "star.json", "--out", "grid", cwd=tmp_path)
    assert files(tmp_path / "grid")["landscape.jsonl"] == files(grid.folder)["landscape.jsonl"]
    assert all(line in printed for line in str(grid).splitlines())
    with pytest.raises(ValueError, match="grid: missing"):
        dimcmc.grid(SMALL)
    with pytest.raises(ValueError, match="out: name the grid"):
        dimcmc.grid(GRID, resume=True)


def test_a_grid_goes_on(grid: dimcmc.Grid, tmp_path: Path) -> None:
    folder = tmp_path / "grid"
    grid.save(folder)
    nodes = (folder / "landscape.jsonl").read_bytes()
    (folder / "landscape.jsonl").write_bytes(b"".join(nodes.splitlines(keepends=True)[:7]))
    (folder / "paraboloid.json").unlink()
    begun = dimcmc.open(folder)
    assert isinstance(begun, dimcmc.Grid) and "7 of 30 nodes so far" in str(begun)
    assert np.isfinite(begun.log_likelihood).sum() == 7
    with pytest.raises(FileExistsError, match="resume=True"):
        dimcmc.grid(GRID, out=folder)
    gone_on = dimcmc.grid(GRID, out=folder, resume=True)
    assert files(folder)["landscape.jsonl"] == nodes and str(gone_on) == str(grid)
    other = dimcmc.grid(GRID, out=folder, resume=True, fit_nodes=12)
    assert other.paraboloid.nodes == 12


def test_folders_open_as_what_they_are(
    run: dimcmc.Run, grid: dimcmc.Grid, limits: dimcmc.Limits, simulation: dimcmc.Simulation, tmp_path: Path
) -> None:
    results: list[dimcmc.Result] = [
        run,
        grid,
        limits,
        dimcmc.map(SMALL, out=tmp_path / "map"),
        dimcmc.periodogram(SMALL, draws=1000, out=tmp_path / "search"),
        dimcmc.optimise(SMALL, out=tmp_path / "optimum"),
        dimcmc.plan(SMALL, maps=1, draws=1000, out=tmp_path / "plan"),
        dimcmc.simulate(SMALL, out=tmp_path / "simulated"),
        dimcmc.inject(SMALL, k_kms=0.2, porb_over_prot=2.6, phi=0.25, out=tmp_path / "injected"),
    ]
    for result in results:
        opened = dimcmc.open(result.folder)
        assert type(opened) is type(result) and opened.folder == result.folder
        assert opened.figures == result.figures
        # files of maps do not hold all that is printed
        if isinstance(result, dimcmc.Maps):
            assert set(str(opened).splitlines()) < set(str(result).splitlines())
        else:
            assert str(opened) == str(result)
        assert type(result).open(os.fspath(result.folder)).folder == result.folder
    injected = dimcmc.open(tmp_path / "injected")
    assert isinstance(injected, dimcmc.Injection) and injected.config.star.vsini_kms == 25.0
    again = dimcmc.Simulation.open(tmp_path / "simulated")
    # profiles in files have 12 digits
    assert np.allclose(again.observations.intensity, simulation.observations.intensity, atol=1e-12)
    with pytest.raises(ValueError, match="no limits.json, which dimcmc.Limits reads"):
        dimcmc.Limits.open(tmp_path / "map")
    with pytest.raises(ValueError, match="no truth.json that dimcmc.Injection reads"):
        dimcmc.Injection.open(tmp_path / "simulated")


def test_what_the_command_line_wrote_opens(run: dimcmc.Run, grid: dimcmc.Grid, tmp_path: Path) -> None:
    chain = dimcmc.sample(GRID)
    command("compare", chain.folder, grid.folder, "--out", "comparison", cwd=tmp_path)
    comparison = dimcmc.open(tmp_path / "comparison")
    assert isinstance(comparison, dimcmc.Comparison) and comparison.summary.names == run.names
    assert "k_kms" in str(comparison)
    (tmp_path / "star.json").write_text(json.dumps(SMALL))
    (tmp_path / "stars.txt").write_text("star.json\n")
    command("batch", "stars.txt", "--out", "stars", cwd=tmp_path)
    stars = dimcmc.open(tmp_path / "stars")
    assert isinstance(stars, dimcmc.Batch) and list(stars.runs) == ["star"]
    assert np.array_equal(stars.runs["star"].chain, run.chain)
    assert "star: " in str(stars) and stars._repr_html_()


def test_rates_are_those_of_the_command_line(limits: dimcmc.Limits, tmp_path: Path) -> None:
    search = dimcmc.periodogram(SMALL, draws=1000, out=tmp_path / "star")
    (tmp_path / "stars.csv").write_text("name,age\nstar,young\n")
    box = ((0.5, 5.0), (0.05, 1.0))
    table = tmp_path / "stars.csv"
    found = dimcmc.survey([search, limits], boxes=[box], table=table, group="age", out=tmp_path / "survey")
    options = ["--box", "0.5:5.0,0.05:1.0", "--table", table, "--group", "age", "--out", "theirs"]
    printed = command("survey", search.folder, limits.folder, *options, cwd=tmp_path)
    assert str(found) in printed
    theirs = files(tmp_path / "theirs")
    for name in ["survey.csv", "completeness.csv", "survey.json"]:
        assert theirs[name] == files(found.folder)[name], name
    assert [rate.group for rate in found.rates] == [None, "young"]
    assert found.stars[0].finding == search.summary.verdict.finding
    assert 0.0 <= found.rates[0].effective_stars <= 1.0
    assert set(np.unique(found.completeness["star"])) == {0.0, 1.0}
    assert found.figures == ["completeness", "rates"]
    assert type(dimcmc.open(found.folder)) is dimcmc.Survey and str(dimcmc.open(found.folder)) == str(found)
    assert "box_1_young_density" in found.figure_data("rates")
    with pytest.raises(ValueError, match="no limits of 1 of 1 stars: star: run `dimcmc limits"):
        dimcmc.survey(search)
    with pytest.raises(ValueError, match="boxes: 5:1,0.1:1"):
        dimcmc.survey([search, limits], boxes=[((5, 1), (0.1, 1))])
    with pytest.raises(ValueError, match="table: name the table"):
        dimcmc.survey([search, limits], group="age")


def test_several_data_sets_open(tmp_path: Path) -> None:
    observed = SMALL["observations"]["simulate"]
    second = {key: observed[key] for key in ("cycles", "velocity_kms", "snr")}
    both = [{"name": "b", "simulate": observed}, {"name": "a", "simulate": {**second, "seed": 2}}]
    star = {**SMALL, "observations": both, "imaging": {"pixels": 200, "objective": "marginal-likelihood"}}
    simulated = dimcmc.simulate(star, out=tmp_path / "both")
    opened = dimcmc.open(tmp_path / "both")
    assert isinstance(opened, dimcmc.Simulation) and len(opened.sets) == 2 == len(simulated.sets)
    for ours, theirs in zip(opened.sets, simulated.sets):
        assert np.allclose(ours.intensity, theirs.intensity, atol=1e-12)
    assert opened._repr_html_()


def test_other_folders_do_not_open(run: dimcmc.Run, grid: dimcmc.Grid, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no such folder"):
        dimcmc.open(tmp_path / "none")
    with pytest.raises(ValueError, match="no results of dimcmc, which would be one of manifest.json"):
        dimcmc.open(tmp_path)
    with pytest.raises(NotADirectoryError, match="is no folder"):
        dimcmc.open(run.folder / "manifest.json")
    run.save(tmp_path / "two")
    for name, content in files(grid.folder).items():
        (tmp_path / "two" / name).write_bytes(content)
    with pytest.raises(ValueError, match=r"several kinds, use dimcmc.Run.open or dimcmc.Grid.open"):
        dimcmc.open(tmp_path / "two")
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken/limits.json").write_text("{}")
    with pytest.raises(ValueError, match="limits.json"):
        dimcmc.open(tmp_path / "broken")


def test_reports(run: dimcmc.Run, limits: dimcmc.Limits, tmp_path: Path) -> None:
    page = dimcmc.report([run, limits.folder], out=tmp_path / "star.html")
    assert page == tmp_path / "star.html" and [*tmp_path.iterdir()] == [page]
    text = page.read_text(encoding="utf-8")
    assert text.startswith("<!") and "k_kms" in text and "Detection limits" in text
    command("report", run.folder, limits.folder, "--out", "command.html", cwd=tmp_path)
    assert page.read_bytes() == (tmp_path / "command.html").read_bytes()
    with pytest.raises(FileExistsError, match="force=True"):
        dimcmc.report(run, out=page)
    assert dimcmc.report(run, out=page, force=True).read_text(encoding="utf-8") != text
    (tmp_path / "notes.html").write_text("mine")
    with pytest.raises(FileExistsError, match="is no report"):
        dimcmc.report(run, out=tmp_path / "notes.html", force=True)
    run.save(tmp_path / "run")
    assert dimcmc.report(tmp_path / "run") == tmp_path / "run/report.html"
    with pytest.raises(ValueError, match="given twice"):
        dimcmc.report([run, run], out=tmp_path / "other.html")
    with pytest.raises(ValueError, match="out: name the file"):
        dimcmc.report(dimcmc.optimise(SMALL))
    with pytest.raises(ValueError, match="one at least"):
        dimcmc.report([])


def test_results_fit_a_screen(
    run: dimcmc.Run, grid: dimcmc.Grid, limits: dimcmc.Limits, simulation: dimcmc.Simulation, config: dimcmc.Config
) -> None:
    search = dimcmc.periodogram(SMALL, draws=1000, planets=2)
    # many sections, long lists, and more text than a screen holds
    config.update({"grid": GRID["grid"], "star": {"name": "A star of many words " * 3}})
    config.observations.simulate.spots = [[10.0 * k, 5.0, 3.0, 0.5] for k in range(30)]
    shown = [run, grid, limits, simulation, simulation.observations, search, search.summary, run.summary]
    shown += [config, config.star, config.observations, dimcmc.Config(SMALL), limits.summary, grid.summary]
    for one in shown:
        lines = repr(one).splitlines()
        assert len(lines) <= 30 and max(len(line) for line in lines) <= 100, repr(one)
        assert len(repr(one)) > 20
    assert search.verdict.split(".")[0] in repr(search).replace("\n    ", " ")
    for words in ["rotation_period_d 3.0", "spottedness", "k_kms", "[30 values]"]:
        assert words in repr(config)
    assert json.loads(str(config)) == config.to_dict()
    many = dimcmc.Record(k_kms=0.1, numbers=list(range(1000)), inside=dimcmc.Record(a=[1], b={"c": 1}))
    assert repr(many) == "{'k_kms': 0.1, 'numbers': [1000 values], 'inside': {'a': [1], 'b': {1 keys}}}"
    long = dimcmc.Record({f"key {k}": k for k in range(100)})
    assert "71 more lines" in repr(long)
