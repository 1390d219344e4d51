"""What calls give back: numbers, figures, what a notebook shows, pickles, and the files of the command line."""

from __future__ import annotations

import pickle
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy as np
import pytest
from conftest import SMALL

import dimcmc


def command(*arguments: object) -> subprocess.CompletedProcess[str]:
    """The command line that comes with the package."""
    program = shutil.which("dimcmc", path=sysconfig.get_path("scripts"))
    assert program, "the package is not installed"
    return subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, check=False)


def files(folder: Path) -> dict[str, bytes]:
    # how long it took is no result
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != "effort.json"}


@pytest.fixture(scope="module")
def star(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("star") / "star.json"
    dimcmc.Config(SMALL).save(path)
    return path


def test_a_chain_is_that_of_the_command_line(star: Path, run: dimcmc.Run, tmp_path: Path) -> None:
    done = command("sample", star, "--out", tmp_path / "run")
    assert done.returncode == 0, done.stderr
    assert files(tmp_path / "run") == files(run.folder) and done.stdout.rstrip() == str(run)
    # a run of the command line opens, and one of Python's goes on there
    assert np.array_equal(dimcmc.Run.open(tmp_path / "run").chain, run.chain)


@pytest.mark.parametrize("name", ["plan", "simulate", "map", "periodogram", "optimise"])
def test_files_are_those_of_the_command_line(name: str, star: Path, tmp_path: Path) -> None:
    done = command(name, star, "--out", tmp_path / "theirs")
    assert done.returncode == 0, done.stderr
    result = getattr(dimcmc, name)(star, out=tmp_path / "ours")
    assert files(tmp_path / "theirs") == files(tmp_path / "ours")
    assert str(result) in done.stdout
    with pytest.raises(FileExistsError, match="not empty"):
        getattr(dimcmc, name)(star, out=tmp_path / "ours")


def test_the_command_line_comes_along(star: Path, tmp_path: Path) -> None:
    assert "dimcmc" in command("--version").stdout and command("--help").returncode == 0
    wrong = command("sample", star, "--out", tmp_path, "--seed", "x")
    assert wrong.returncode == 2 and "--seed" in wrong.stderr
    missing = command("map", tmp_path / "none.json", "--out", tmp_path / "map")
    assert missing.returncode == 2 and "none.json" in missing.stderr
    module = subprocess.run([sys.executable, "-m", "dimcmc", "--version"], capture_output=True, check=False)
    assert module.returncode == 0


def test_a_run_in_numbers(run: dimcmc.Run) -> None:
    steps, ensembles, walkers, parameters = run.chain.shape
    assert (ensembles, walkers, run.names) == (2, 10, ["k_kms", "phi"]) and parameters == 2
    assert run.log_prob.shape == (steps, ensembles, walkers) == run.numbers["chi2"].shape
    kept = run.chain[run.summary.discarded_steps :]
    assert np.array_equal(run.samples["k_kms"], kept[..., 0].ravel())
    one = run.summary.parameters.k_kms
    assert np.median(run.samples["k_kms"]) == pytest.approx(one.median, abs=0.02 * one.sd)
    assert np.std(run.samples["k_kms"], ddof=1) == pytest.approx(one.sd, rel=1e-9)
    # phases are unwrapped: within half a turn of the mode
    turned = run.samples["phi"] - run.summary.parameters.phi.mode
    assert np.all(np.abs(turned) <= 0.5)
    assert one.ci95[0] < 0.3 < one.ci95[1] and run.converged == run.summary.converged
    assert "t_conjunction_d" in run.samples and run.verdict and run.verdict in str(run)


def test_runs_go_on_and_begin_again(config: dimcmc.Config, run: dimcmc.Run, tmp_path: Path) -> None:
    config.sampler.steps = 10
    config.sampler.ess = 1e5
    folder = tmp_path / "run"
    first = dimcmc.sample(config, out=folder, resume=True)
    assert first.summary.steps == 10
    with pytest.raises(FileExistsError, match="resume=True"):
        dimcmc.sample(config, out=folder)
    assert dimcmc.sample(config, out=folder, extend=5).summary.steps == 15
    config.sampler.steps = 20
    config.sampler.ess = 100.0
    gone_on = dimcmc.sample(config, out=folder, resume=True)
    assert np.array_equal(gone_on.chain[:11], first.chain)
    config.star.vsini_kms = 26.0
    with pytest.raises(ValueError, match="star.vsini_kms .*of the config changed"):
        dimcmc.sample(config, out=folder, resume=True)
    config.sampler.steps = 1
    again = dimcmc.sample(config, out=folder, force=True, seed=2, start="prior")
    assert not np.array_equal(again.chain[0], first.chain[0])
    with pytest.raises(ValueError, match="out: name the run"):
        dimcmc.sample(config, resume=True)
    with pytest.raises(ValueError, match="start"):
        dimcmc.sample(config, start="nowhere")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="holds no results yet"):
        dimcmc.Run.open(tmp_path)


def test_a_map_and_a_search_in_numbers(simulation: dimcmc.Simulation) -> None:
    observations = simulation.observations
    star = dimcmc.map(SMALL, observations=observations)
    assert star.summary.chi2_per_datum == pytest.approx(1.0, abs=0.2)
    assert len(star.map.spot_filling) == star.map.pixels
    assert np.array_equal(star.profiles["observed"], observations.intensity.ravel())
    assert len(star.velocities["time_d"]) == len(observations)
    search = dimcmc.periodogram(SMALL, observations=observations, draws=1000, min_period_d=2.0, planets=2)
    assert search.verdict == search.summary.verdict.sentence and "periodogram_2.csv" in files(search.folder)
    assert search.covariance.shape == (12, 12) and np.allclose(search.covariance, search.covariance.T)
    errors = search.velocities["rv_sigma_kms"]
    assert np.allclose(errors, np.sqrt(np.diag(search.covariance)))
    assert search.periods["period_d"].min() >= 2.0 - 1e-9
    with pytest.raises(ValueError, match="draws: must be from 1000"):
        dimcmc.periodogram(SMALL, draws=10)
    with pytest.raises(ValueError, match="marginal-likelihood"):
        dimcmc.map(SMALL, times_d=[1.0])


def test_maps_of_a_star_that_changes(config: dimcmc.Config) -> None:
    config.update({"imaging": {"objective": "marginal-likelihood"}, "sampler": {"walkers": 14}})
    star = dimcmc.map(config, times_d=np.array([0.5, 2.0]))  # type: ignore[arg-type]
    assert [one.time_d for one in star.map.maps] == [0.5, 2.0] and star.figures[0].startswith("map")


def test_an_optimum_in_numbers(config: dimcmc.Config) -> None:
    best = dimcmc.optimise(config)
    assert best.names == ["k_kms", "phi"]
    assert abs(best.parameters["k_kms"] - 0.3) < 5.0 * best.sd["k_kms"]
    assert np.allclose(np.sqrt(np.diag(best.covariance)), [best.sd[name] for name in best.names])
    config.parameters = {}
    with pytest.raises(ValueError, match="parameters"):
        dimcmc.optimise(config)


def test_a_plan_in_numbers(config: dimcmc.Config) -> None:
    other = config.copy()
    other.observations.simulate.snr = 500.0
    forecast = dimcmc.plan([config, other], maps=1, draws=1000)
    assert forecast.summary.best == 1 and len(forecast.summary.schedules) == 2
    first = forecast.periods["schedule"] == 1
    assert np.nanmin(forecast.periods["k95_kms"][first]) < np.nanmin(forecast.periods["k95_kms"][~first])
    for wrong, words in [({"maps": -1}, "maps"), ({"nights": [0]}, "nights"), ({"draws": 1}, "draws")]:
        with pytest.raises(ValueError, match=words):
            dimcmc.plan(config, **wrong)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="one at least"):
        dimcmc.plan([])
    chosen = dimcmc.plan(config, maps=1, draws=1000, next=2, period_d=4.0).summary.schedules[0].next
    assert len(chosen.chosen) == 2 and chosen.chosen[1].sigma_k_kms > 0.0
    for wrong, words in [({"next": 0}, "next"), ({"next": 2, "nights": [3]}, "nights"), ({"period_d": 3.0}, "only")]:
        with pytest.raises(ValueError, match=words):
            dimcmc.plan(config, **wrong)  # type: ignore[arg-type]


def test_a_simulation_in_numbers(simulation: dimcmc.Simulation) -> None:
    assert simulation.sets == [simulation.observations]
    assert simulation.observations.intensity.shape == (12, 41)
    assert simulation.truth.parameters.k_kms == 0.3
    with pytest.raises(ValueError, match="observations.simulate: missing"):
        dimcmc.simulate({**SMALL, "observations": {"path": "observations.txt"}})


def test_notebooks_show_table_verdict_and_figure(run: dimcmc.Run, simulation: dimcmc.Simulation) -> None:
    shown = run._repr_html_()
    for part in ["<table>", "k_kms", "rhat", "data:image/png;base64", run.verdict or ""]:
        assert part in shown
    assert "<pre>" in simulation._repr_html_() and "spottedness" in repr(simulation)


def test_figures(run: dimcmc.Run, tmp_path: Path) -> None:
    assert run.figures[0] == "corner"
    figure = run.figure()
    assert figure.svg.startswith("<svg") and figure._repr_png_().startswith(b"\x89PNG") and "corner" in repr(figure)
    for name in ["corner.svg", "corner.png"]:
        figure.save(tmp_path / name)
        assert (tmp_path / name).stat().st_size > 1000
    with pytest.raises(ValueError, match=r"saved as .svg or .png"):
        figure.save(tmp_path / "corner.jpg")
    with pytest.raises(KeyError, match="no figure map"):
        run.figure("map")


def test_figures_by_matplotlib(run: dimcmc.Run) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    names = run.names
    data = run.figure_data("corner")
    assert list(data) == names and np.array_equal(data["k_kms"], run.samples["k_kms"])
    assert run.figure_data("traces")["k_kms"].shape == run.log_prob.shape
    axes = run.figure("corner", ax=True, width=5.0, style="ggplot")
    assert axes.shape == (len(names), len(names)) and axes[0, 0].figure.get_figwidth() == 5.0
    # on axes of one's own, which must be as many as there are panels
    figure, own = plt.subplots(len(names), 1)
    drawn = run.figure("traces", ax=own)
    assert list(drawn[:, 0]) == list(own) and own[0].lines
    with pytest.raises(ValueError, match=f"traces has {len(names)} panels, not 1"):
        run.figure("traces", ax=figure.add_subplot())
    with pytest.raises(KeyError, match="no figure map"):
        run.figure_data("map")
    plt.close("all")


def test_results_survive_pickling(run: dimcmc.Run, simulation: dimcmc.Simulation, tmp_path: Path) -> None:
    again = pickle.loads(pickle.dumps(run))
    assert np.array_equal(again.chain, run.chain) and again.summary == run.summary and str(again) == str(run)
    assert again.folder != run.folder and again.figure().png == run.figure().png
    other = pickle.loads(pickle.dumps(simulation))
    assert other.observations == simulation.observations and other.truth == simulation.truth
    folder = again.folder
    again.save(tmp_path / "copy")
    assert files(tmp_path / "copy") == files(run.folder)
    del again
    assert not folder.exists()


def test_exports(run: dimcmc.Run, tmp_path: Path) -> None:
    written = run.export("csv", out=tmp_path / "chain.csv")
    assert written == [tmp_path / "chain.csv"]
    with pytest.raises(ValueError, match="chain.csv"):
        run.export("csv", out=tmp_path / "chain.csv")
    with pytest.raises(ValueError, match="format: must be"):
        run.export("fits")


def test_xarray_and_arviz(run: dimcmc.Run) -> None:
    pytest.importorskip("zarr")
    posterior = run.to_xarray()["posterior"].to_dataset()
    assert posterior.sizes["chain"] == 2 and set(run.samples) == set(posterior.data_vars)
    assert np.array_equal(np.sort(posterior["k_kms"].values.ravel()), np.sort(run.samples["k_kms"]))
    assert posterior["k_kms"].attrs["units"] == "km/s"
    arviz = pytest.importorskip("arviz")
    assert "k_kms" in arviz.summary(run.to_inferencedata()).index
