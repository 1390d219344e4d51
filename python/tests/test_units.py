"""Quantities of astropy in place of numbers."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import SMALL

import dimcmc

units = pytest.importorskip("astropy.units")
Time = pytest.importorskip("astropy.time").Time
QTable = pytest.importorskip("astropy.table").QTable


def test_quantities_are_converted(simulation: dimcmc.Simulation) -> None:
    plain = simulation.observations
    times, velocities = plain.quantity("times_d"), plain.quantity("velocities_kms")
    assert times.unit == units.d and velocities.unit == units.km / units.s and plain.quantity("sigma").unit == ""
    made = dimcmc.Observations(
        times.to("h"), velocities.to("m/s"), plain.quantity("intensity").to("%"), plain.sigma * units.one
    )
    assert np.allclose(made.times_d, plain.times_d) and np.allclose(made.velocities_kms, plain.velocities_kms)
    assert np.allclose(made.intensity, plain.intensity) and np.array_equal(made.sigma, plain.sigma)
    # lists of quantities, and of quantities and numbers
    mixed = [24.0 * units.h, *plain.times_d[1:]]
    assert dimcmc.Observations(mixed, plain.velocities_kms, plain.intensity, plain.sigma).times_d[0] == 1.0
    with pytest.raises(ValueError, match="name: must be times_d"):
        plain.quantity("times")


def test_times_and_columns(simulation: dimcmc.Simulation) -> None:
    plain = simulation.observations
    rest = plain.velocities_kms, plain.intensity, plain.sigma
    times = Time(2_460_000.5 + plain.times_d, format="jd", scale="tdb")
    assert np.allclose(dimcmc.Observations(times, *rest).times_d, 2_460_000.5 + plain.times_d, atol=1e-8)
    table = QTable({"t": plain.times_d * 24.0 * units.h})
    assert np.allclose(dimcmc.Observations(table["t"], *rest).times_d, plain.times_d)
    with pytest.raises(ValueError, match="velocities_kms: a time, not km/s"):
        dimcmc.Observations(plain.times_d, times, plain.intensity, plain.sigma)


def test_another_kind_of_quantity_is_refused(simulation: dimcmc.Simulation) -> None:
    plain = simulation.observations
    times, velocities = plain.times_d, plain.velocities_kms
    with pytest.raises(ValueError, match="times_d: in km / s, which cannot be converted to d"):
        dimcmc.Observations(times * units.km / units.s, velocities, plain.intensity, plain.sigma)
    with pytest.raises(ValueError, match="velocities_kms: in nm, which cannot be converted to km/s"):
        dimcmc.Observations(times, velocities * units.nm, plain.intensity, plain.sigma)
    with pytest.raises(ValueError, match="intensity: in Jy, which cannot be converted to a pure number"):
        dimcmc.Observations(times, velocities, plain.intensity * units.Jy, plain.sigma)
    with pytest.raises(ValueError, match="velocities_kms: in no unit"):
        dimcmc.Observations(times, velocities * units.one, plain.intensity, plain.sigma)


def test_configs_and_arguments_take_quantities(config: dimcmc.Config, simulation: dimcmc.Simulation) -> None:
    config.star.vsini_kms = 26_000.0 * units.m / units.s
    config.star.rotation_period_d = 72.0 * units.h
    config.star.inclination_deg = np.pi / 3 * units.rad
    config.parameters.k_kms = {"prior": "uniform", "min": 0.0 * units.m / units.s, "max": 900.0 * units.m / units.s}
    assert config.star.vsini_kms == 26.0 and config.star.rotation_period_d == 3.0
    assert config.star.inclination_deg == pytest.approx(60.0) and config.parameters.k_kms.max == pytest.approx(0.9)
    with pytest.raises(ValueError, match="vsini_kms: in d, which cannot be converted to km/s"):
        config.star.vsini_kms = 3.0 * units.d
    with pytest.raises(ValueError, match="pixels: in d, which cannot be converted to a pure number"):
        config.imaging.pixels = 300 * units.d
    first = dimcmc.init(
        simulation.observations, rotation_period=72.0 * units.h, inclination=60.0 * units.deg, pixels=200,
        objective="spottedness", velocity_range=[-40_000.0 * units.m / units.s, 40.0], vsini=25.0 * units.km / units.s,
    )  # fmt: skip
    assert first.star.rotation_period_d == 3.0 and first.star.vsini_kms == 25.0
    with pytest.raises(ValueError, match="rotation_period: in km, which cannot be converted to d"):
        dimcmc.init(simulation.observations, rotation_period=3.0 * units.km)
    search = dimcmc.periodogram(SMALL, draws=1000, min_period_d=48.0 * units.h)
    assert search.periods["period_d"].min() >= 2.0 - 1e-9
