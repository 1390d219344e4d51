"""Figures by matplotlib: panels, units and names of axes, times, projections, and that every figure has them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SMALL

import dimcmc

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

FIELD = {
    **SMALL,
    # wide bins, so that it takes little time
    "observations": {
        "simulate": {**SMALL["observations"]["simulate"], "velocity_kms": {"min": -40.0, "max": 40.0, "step": 4.0}}
    },
    "imaging": {"pixels": 200, "objective": "marginal-likelihood"},
    "parameters": {
        **SMALL["parameters"],
        "porb_over_prot": {"prior": "uniform", "min": 1.2, "max": 2.2},
        "spot_amplitude": {"prior": "log-uniform", "min": 0.05, "max": 0.8},
        "spot_slope": {"prior": "uniform", "min": 0.5, "max": 2.5},
        "spot_lifetime_d": {"prior": "log-uniform", "min": 5.0, "max": 500.0},
    },
    "sampler": {"ensembles": 2, "walkers": 12, "steps": 2},
}
# two seasons, 150 d apart, on Julian dates
SEASONS = json.loads(json.dumps(FIELD))
SEASONS["star"]["epoch_d"] = 2_459_000.5
SEASONS["observations"]["simulate"]["cycles"] = [0.27 * k for k in range(12)] + [60.0 + 0.27 * k for k in range(7)]


def command(*arguments: object, cwd: Path) -> str:
    call = [sys.executable, "-m", "dimcmc", *(str(argument) for argument in arguments)]
    return subprocess.run(call, capture_output=True, text=True, cwd=cwd, check=True).stdout


@pytest.fixture(autouse=True)
def closed() -> Any:
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def search() -> dimcmc.Periodogram:
    return dimcmc.periodogram(SEASONS, draws=1000, planets=2)


@pytest.fixture(scope="module")
def maps() -> dimcmc.Maps:
    return dimcmc.map(SEASONS)


@pytest.fixture(scope="module")
def field_run() -> dimcmc.Run:
    return dimcmc.sample(FIELD)


def panels(axes: Any) -> list[Any]:
    """All panels, each once."""
    return list(dict.fromkeys(panel for panel in np.ravel(np.array(axes, dtype=object)) if panel is not None))


def texts(panel: Any) -> set[str]:
    legend = panel.get_legend()
    return set() if legend is None else {text.get_text() for text in legend.get_texts()}


def test_corners_have_days_metres_and_names(field_run: dimcmc.Run) -> None:
    axes = field_run.figure("corner", ax=True)
    labels = [panel.get_xlabel() for panel in axes[-1]]
    orbit = ["$K$ (m/s)", r"$\phi$ (cycles)", r"$P_\mathrm{orb}$ (d)"]
    assert sorted(labels) == sorted([*orbit, "spot amplitude", "power-law index", "spot lifetime (d)"])
    for name, label, factor in [("k_kms", orbit[0], 1e3), ("porb_over_prot", orbit[2], 3.0)]:
        low, high = axes[-1, labels.index(label)].get_xlim()
        median = factor * np.median(field_run.samples[name])
        assert low < median < high and high - low < 30.0 * factor * field_run.samples[name].std()
    # a prior that is even in the logarithm has an axis of it
    scales = {label: panel.get_xscale() for label, panel in zip(labels, axes[-1])}
    assert scales["spot lifetime (d)"] == "log" and scales["power-law index"] == "linear"
    assert "injected" in texts(axes[0, -1]) and "median" not in axes[0, 0].get_title()


def test_symbols_are_those_of_the_engine(run: dimcmc.Run, tmp_path: Path) -> None:
    from dimcmc._symbols import _SYMBOLS, shown

    schema = json.loads(command("schema", cwd=tmp_path))
    assert set(schema["$defs"]["PerParameter_PriorSection"]["properties"]) <= set(_SYMBOLS)
    written = run.export("getdist", out=tmp_path / "chain")
    names = next(path for path in written if path.suffix == ".paramnames").read_text(encoding="utf-8")
    for line in names.splitlines():
        name, latex = line.split(maxsplit=1)
        name = name.rstrip("*")
        if name in run.names:
            assert latex.split("\\;")[0].split("\\ ")[0].strip() in shown(name).symbol, line
    assert shown("k_kms", None, 3.0).label == "$K$ (km/s)" and shown("inclination_deg").label == "$i$ (°)"


def test_velocities_have_days_seasons_cycles_and_residuals(search: dimcmc.Periodogram) -> None:
    axes = search.figure("rv", ax=True)
    assert axes.shape == (3, 2) and len(panels(axes)) == 5 and axes[0, 1] is axes[1, 1]
    above, clean, residual = axes[:, 0]
    assert residual.get_xlabel() == "BJD − 2459000 (d)" and residual.get_ylabel() == "residual (m/s)"
    assert clean.get_ylabel() == "spot-corrected RV (m/s)" and "best orbit" in texts(clean)
    # cycles above, at their times
    twin = next(other for other in above.figure.axes if other.get_xlabel() == "rotation cycle")
    twin.figure.canvas.draw()
    for place, text in zip(twin.get_xticks(), twin.get_xticklabels()):
        assert abs((place - 0.5) / 3.0 - float(text.get_text().replace("−", "-"))) < 1e-6
    # the gap is narrow, seasons are wide
    days = [[time_d, 0.0] for time_d in (0.5, 9.4, 180.5, 185.3)]
    x = clean.transAxes.inverted().transform(clean.transData.transform(days))[:, 0]
    assert x[2] - x[1] < 0.15 and x[1] - x[0] > 0.4 and x[3] - x[2] > 0.2
    velocities = search.velocities
    best = search.summary.best
    orbit = best.k_kms * np.cos(2.0 * np.pi * (velocities["cycle"] / best.porb_over_prot - best.phi))
    left = velocities["rv_kms"] - orbit
    # where no systemic velocity is found, the residuals scatter about 0
    if not search.summary.get("systemic_velocity"):
        left = left - np.average(left, weights=velocities["rv_sigma_kms"] ** -2.0)
    drawn = residual.lines[1].get_ydata()
    assert np.allclose(drawn, 1e3 * left, atol=1e-6)


def test_a_single_axes_has_the_main_panel(search: dimcmc.Periodogram, maps: dimcmc.Maps) -> None:
    figure, own = plt.subplots()
    assert search.figure("rv", ax=own) is own
    assert own.get_ylabel() == "spot-corrected RV (m/s)" and own.get_xlabel() == "BJD − 2459000 (d)"
    for result, name in [(search, "periodogram"), (maps, "profiles"), (maps, "changes"), (maps, "residuals")]:
        figure, own = plt.subplots()
        assert result.figure(name, ax=own) is own and own.get_xlabel()
    with pytest.raises(ValueError, match="rv has 5 panels, not 2"):
        search.figure("rv", ax=plt.subplots(1, 2)[1])


def test_maps_are_projected_and_have_a_deviation(maps: dimcmc.Maps) -> None:
    count = len(maps.map.maps)
    for name, projection in [("maps_mollweide", "mollweide"), ("maps", "polar")]:
        drawn = panels(maps.figure(name, ax=True))
        assert len(drawn) == count + 1 and {panel.name for panel in drawn} == {projection}
        assert drawn[-1].get_title() == "mean standard deviation"
        mesh = drawn[-1].collections[0]
        mean = maps.figure_data(name)["sigma_spot_filling"].mean(axis=0)
        values = np.asarray(mesh.get_array())
        assert values.max() == pytest.approx(mean.max()) and values.min() == pytest.approx(mean.min())
        labels = {axes.get_xlabel() for axes in drawn[0].figure.axes}
        assert {"spot filling factor", "standard deviation of the filling factor"} <= labels
    figure, own = plt.subplots(1, count + 1)
    assert maps.figure("maps", ax=own)[0, 0].get_xlabel() == "longitude (°)"
    figure, own = plt.subplots(1, count + 1, subplot_kw={"projection": "polar"})
    with pytest.raises(ValueError, match="maps_mollweide is drawn on axes of projection 'mollweide', not 'polar'"):
        maps.figure("maps_mollweide", ax=own)


def test_a_pixel_is_drawn_at_its_place(config: dimcmc.Config) -> None:
    star = dimcmc.map(config)
    axes = star.figure("map", ax=True)
    reconstructed, injected = axes[0]
    assert reconstructed.name == "polar" and axes[1, 1].name == "mollweide"
    assert injected.get_title().startswith("injected: ")
    # spots at longitudes 40 and 200, latitudes 30 and 60
    mesh = axes[1, 1].collections[0]
    values = np.asarray(mesh.get_array()).reshape(180, 360)
    assert values[120, 40] == 0.9 and values[150, 200] == 0.8 and values[60, 40] == 0.0
    x, y = mesh.get_coordinates()[120, 40]
    assert np.degrees(x) == pytest.approx(40.0 - 180.0) and np.degrees(y) == pytest.approx(30.0)


def test_every_figure_is_drawn(
    run: dimcmc.Run, search: dimcmc.Periodogram, maps: dimcmc.Maps, simulation: dimcmc.Simulation, tmp_path: Path
) -> None:
    few: dict[str, Any] = {"draws": 1000}
    limits = dimcmc.limits(SMALL, periods=3, amplitudes=4, phases=4, **few)
    grids = {**SMALL, "imaging": {**SMALL["imaging"], "chi2_target": 1.1}}
    grids["grid"] = {"axes": {"k_kms": [0.2, 0.4, 5], "phi": [0.48, 0.53, 6]}}
    grid = dimcmc.grid(grids, out=tmp_path / "grid")
    one = {**grids, "grid": {"axes": {"k_kms": [0.2, 0.4, 5]}}}
    one["parameters"] = {"k_kms": SMALL["parameters"]["k_kms"]}
    chain = dimcmc.sample(grids, out=tmp_path / "chain")
    command("compare", chain.folder, grid.folder, "--out", "comparison", cwd=tmp_path)
    plan = dimcmc.plan(SMALL, maps=1, next=2, period_d=4.0, **few)
    results = [run, search, maps, simulation, limits, grid, plan, dimcmc.grid(one), dimcmc.optimise(SMALL)]
    results += [dimcmc.survey([dimcmc.periodogram(SMALL, **few), limits]), dimcmc.open(tmp_path / "comparison")]
    names: set[str] = set()
    for result in results:
        for name in result.figures:
            drawn = panels(result.figure(name, ax=True, width=5.0))
            assert drawn[0].figure.get_figwidth() == 5.0
            drawn[0].figure.canvas.draw()
            assert any(panel.has_data() for panel in drawn) and result.figure_data(name), name
            names.add(name)
            plt.close("all")
    wanted = {"changes", "profiles", "autocorrelation", "plan", "plan_next", "landscape", "optimum", "comparison"}
    assert wanted <= names


def test_light_curves_and_indicators(maps: dimcmc.Maps, tmp_path: Path) -> None:
    # the tables that `map` writes of them, beside its other files
    maps.save(tmp_path / "map")
    rows = [f"{t},{1.0 + 0.01 * t},0.001,{1.0 + 0.01 * t},0.0,1" for t in (0.0, 1.0, 2.0, 100.0, 101.0)]
    (tmp_path / "map/lightcurve.csv").write_text(
        "time_d,flux,sigma,model,residual,segment,band\n" + "".join(f"{row},1\n" for row in rows)
    )
    (tmp_path / "map/indicators.csv").write_text(
        "time_d,value,sigma,model,residual,indicator\n" + "".join(f"{row}\n" for row in rows)
    )
    star = dimcmc.open(tmp_path / "map")
    for name, label in [("lightcurve", "relative flux"), ("indicators", "indicator 1")]:
        above, below = star.figure(name, ax=True)[:, 0]
        assert above.get_ylabel() == label and below.get_ylabel() == "residual"
        # no line from one season to the next
        lines = [line for line in above.lines if line.get_color() == "#d55e00"]
        assert [len(line.get_xdata()) for line in lines] == [3, 2]


def test_estimates_that_are_compared_are_arrays(tmp_path: Path) -> None:
    estimate = {"value": 0.1, "ci68": [0.08, 0.13]}
    phase = {"value": 0.02, "ci68": [-0.03, 0.04]}
    content = {
        "names": ["k_kms", "phi"],
        "parameters": {
            "k_kms": {"periodic": False, "truth": 0.11, "chain": estimate, "paraboloid": None, "landscape": estimate},
            "phi": {"periodic": True, "truth": 0.98, "chain": phase, "paraboloid": None, "landscape": phase},
        },
    }
    (tmp_path / "comparison.json").write_text(json.dumps(content))
    from dimcmc._plot_chains import comparison_arrays

    found = comparison_arrays(dimcmc.Comparison(tmp_path, ""))
    assert np.allclose(found["chain"], [[0.1, 0.08, 0.13], [0.02, -0.03, 0.04]])
    # in the turn of the chain
    assert found["injected"][1, 0] == pytest.approx(-0.02) and np.all(np.isnan(found["paraboloid"]))


def test_autocorrelation_times_are_known(run: dimcmc.Run) -> None:
    from dimcmc._plot_chains import _time

    # an autoregressive series has (1 + r) / (1 - r)
    draws = np.random.default_rng(1).standard_normal((4000, 2, 20))
    for step in range(1, len(draws)):
        draws[step] = 0.8 * draws[step - 1] + 0.6 * draws[step]
    assert _time(draws) == pytest.approx(9.0, rel=0.1)
    assert np.isnan(_time(np.ones((10, 2, 3))))


def test_eccentric_orbits_are_those_of_the_engine(config: dimcmc.Config) -> None:
    config.planet = {"k_kms": 0.3, "porb_over_prot": 1.7, "phi": 0.3, "sqrt_e_cos_omega": 0.4, "sqrt_e_sin_omega": -0.5}
    star = dimcmc.map(config)
    line = next(line for line in star.figure("rv", ax=True)[1, 0].lines if line.get_label() == "assumed orbit")
    times, kms = star.velocities["time_d"], star.velocities["orbit_kms"]
    assert np.allclose(np.interp(times, line.get_xdata(), line.get_ydata()), 1e3 * kms, atol=1.0)


def test_styles(search: dimcmc.Periodogram) -> None:
    for style, size in [(None, 8.0), ([], matplotlib.rcParams["font.size"])]:
        assert panels(search.figure("periodogram", ax=True, style=style))[0].yaxis.label.get_size() == size
    # points are seen on a dark ground, too
    dark = search.figure("rv", style="dark_background")[1, 0]
    assert matplotlib.colors.to_rgb(dark.lines[0].get_color()) == (1.0, 1.0, 1.0)
