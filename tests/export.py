"""Whether ArviZ, emcee, GetDist and pandas find in the exports of a run what `summary.json` says.

    python tests/export.py RUN

RUN is a folder with summary.json, chain.jsonl and all exports at their default places, of a chain of four ensembles
with a phase around 0 and autocorrelation times of some ten steps. Run by tests/commands/export.rs.
"""

import json
import sys
from pathlib import Path

import arviz as az
import emcee
import getdist
import numpy as np
import pandas as pd
import xarray as xr

run = Path(sys.argv[1])
summary = json.loads((run / "summary.json").read_text())
records = [json.loads(line) for line in (run / "chain.jsonl").read_text().splitlines()]
derived = summary["derived_names"]
names, parameters, discarded = summary["names"], summary["parameters"], summary["discarded_steps"]
PERIODIC = {"phi"}


def close(what, found, expected, tolerance):
    """Prints and compares."""
    difference = float(np.max(np.abs(np.asarray(found, float) - np.asarray(expected, float))))
    print(f"{what}: off by {difference:.1e}")
    assert difference <= tolerance, f"{what}: off by {difference}, allowed {tolerance}"


def within(what, ratio, low, high):
    print(f"{what}: ratio {ratio:.3f}")
    assert low < ratio < high, f"{what}: ratio {ratio} not in ({low}, {high})"


def off_by_turns(x, y):
    """How far phases are apart, whole turns aside."""
    return (np.asarray(x) - y + 0.5) % 1 - 0.5


# pandas: the same numbers to the last bit
numbers = [*names, "log_prob", "spottedness", "chi2"]
# pandas' own conversion may be off by the last bit, depending on its version
table = pd.read_csv(run / "chain.csv", converters={key: float for key in [*numbers, *derived]})
close("pandas by itself", pd.read_csv(run / "chain.csv")[numbers] / table[numbers], 1, 1e-15)
assert len(table) == len(records)
for key in [*numbers, "ensemble", "step", "walker", "model_applications", "accepted", "status", "proposed"]:
    assert table[key].tolist() == [record[key] for record in records], key
assert table["move"].fillna("").tolist() == [record.get("move", "") for record in records]
assert (table.warmup == (table.step < discarded)).all() and table.warmup.dtype == bool
ensembles, walkers, steps = (int(table[key].max()) + 1 for key in ["ensemble", "walker", "step"])
kept = steps - discarded
draws = ensembles * walkers * kept
assert ensembles == 4


def cube(name, first=0):
    """[step, ensemble, walker] of the chain as it is."""
    return table[name].to_numpy().reshape(steps, ensembles, walkers)[first:]


# xarray: every draw of the chain is there once, under its step and walker
tree = xr.open_datatree(run / "chain.zarr", engine="zarr")
posterior, stats = tree["posterior"].to_dataset(), tree["sample_stats"].to_dataset()
assert list(posterior.data_vars) == names + derived and posterior.sizes == {"chain": ensembles, "draw": kept * walkers}
for group, first, last in [("posterior", discarded, steps), ("warmup_posterior", 0, discarded)]:
    grid = tree[group].to_dataset().set_index(draw=["step", "walker"])
    grid = grid.unstack("draw").transpose("step", "chain", "walker")
    assert grid["step"].values.tolist() == list(range(first, last))
    for name in names:
        difference = grid[name].values - cube(name)[first:last]
        if name in PERIODIC:
            # unwrapped around the mode: half a turn on each side, whole turns away from the chain
            assert np.ptp(grid[name].values) < 1 and np.any(np.round(difference) != 0), "this chain should go over 0"
            difference = off_by_turns(difference, 0)
        # a turn more or less costs the last digits of a phase
        close(f"{group} {name}", difference, 0 * difference, 1e-15 if name in PERIODIC else 0)
grid = stats.set_index(draw=["step", "walker"]).unstack("draw").transpose("step", "chain", "walker")
for name in ["lp", "spottedness", "chi2", "accepted", "model_applications"]:
    key = "log_prob" if name == "lp" else name
    assert (grid[name].values == cube(key, discarded)).all(), name
for name, start in [("move", "start"), ("status", ""), ("proposed", "")]:
    words = np.array(stats[name].attrs["flag_meanings"].split())
    assert stats[name].attrs["flag_values"] == list(range(len(words)))
    expected = np.where(pd.isna(cube(name, discarded)), start, cube(name, discarded))
    assert (words[grid[name].values.astype(int)] == expected).all()
for name in derived:
    one, wanted = posterior[name], summary["derived"][name]
    grid = posterior.set_index(draw=["step", "walker"]).unstack("draw").transpose("step", "chain", "walker")
    assert (grid[name].values == cube(name, discarded)).all()
    assert one.attrs["derived"] == 1 and one.attrs["units"] in ["d", "Mjup"]
    close(f"median of {name}", (float(np.median(one)) - wanted["median"]) / wanted["sd"], 0, 1e-6)
    close(f"sd of {name}", float(one.std(ddof=1)) / wanted["sd"], 1, 1e-6)
assert posterior["k_kms"].attrs["units"] == "km/s" and posterior["k_kms"].attrs["injected"] == 0.2
assert json.loads(posterior["k_kms"].attrs["prior"])["max"] == 1.0
assert tree.attrs["discarded_steps"] == discarded and json.loads(tree.attrs["config"])["star"]["vsini_kms"] == 20.0

# ArviZ: its table, R-hat and ESS
found = az.summary(posterior, round_to="none")
print(found)
for name in names:
    one, wanted = posterior[name], parameters[name]
    error = wanted["sd"] / wanted["ess"] ** 0.5
    mean = found.loc[name, "mean"] - wanted["mean"]
    mean = off_by_turns(mean, 0) if name in PERIODIC else mean
    # the same numbers added up in another order
    close(f"ArviZ mean of {name} in standard errors", mean / error, 0, 1e-9)
    close(f"ArviZ sd of {name}", found.loc[name, "sd"] / wanted["sd"], 1, 1e-9)
    facets = [np.cos(2 * np.pi * one), np.sin(2 * np.pi * one)] if name in PERIODIC else [one]
    # Both are rank-normalised split R-hat of the same halves, once the middle one of an odd number of steps is out.
    # The program's normal quantiles are good to 4.5e-4, which makes a part in a thousand of R-hat - 1, and that is
    # some 0.01
    whole = kept % 2 == 0 or posterior.step.values != discarded + kept // 2
    halves = [facet.values[:, whole] if kept % 2 else facet.values for facet in facets]
    close(f"ArviZ R-hat of {name}", max(float(az.rhat(facet)) for facet in halves), wanted["rhat"], 2e-5)
    # ArviZ looks at the series of the walkers, as tau does, but ends its sums by another rule and cuts the series in
    # two, which takes 2 tau/kept = 3 % of the correlation away; both know tau to 10 %
    ess = min(float(az.ess(facet.values)) for facet in facets)
    within(f"ArviZ ESS of {name} over draws / tau", ess * wanted["tau"] / draws, 0.75, 1.35)
    # summary.json: from the series of the four ensembles' means, whose tau is known to 2 sqrt(5 tau / (4 kept)) = 30 %
    within(f"ArviZ ESS of {name} over summary.json's", ess / wanted["ess"], 0.33, 3.0)
    # draws in the order of the chain hide the correlation between steps behind the walkers
    mixed = cube(name, discarded).transpose(1, 0, 2).reshape(ensembles, -1)
    mixed = off_by_turns(mixed, wanted["mode"]) if name in PERIODIC else mixed
    within(f"ESS of {name} in the order of the chain, over that", float(az.ess(mixed)) / ess, 3.0, 100.0)

# emcee: all walkers side by side, without the start
backend = emcee.backends.HDFBackend(str(run / "chain.h5"), read_only=True)
with backend.open() as file:
    attributes = dict(file["mcmc"].attrs)
assert list(attributes["blob_names"]) == ["spottedness", "chi2", *derived]
assert list(attributes["parameter_names"]) == names and json.loads(attributes["injected"])["k_kms"] == 0.2
positions = np.stack([cube(name, 1).reshape(steps - 1, -1) for name in names], axis=-1)
chain = backend.get_chain()
assert chain.shape == positions.shape == (steps - 1, *backend.shape) and backend.iteration == steps - 1
for p, name in enumerate(names):
    if name in PERIODIC:
        close("emcee phases", off_by_turns(chain[..., p], positions[..., p]), 0, 1e-15)
        positions[..., p] = chain[..., p]
assert (chain == positions).all()
assert (backend.get_log_prob() == cube("log_prob", 1).reshape(steps - 1, -1)).all()
for b, name in enumerate(attributes["blob_names"]):
    assert (backend.get_blobs()[..., b] == cube(name, 1).reshape(steps - 1, -1)).all(), name
assert (backend.accepted == cube("accepted", 1).sum(axis=0).ravel()).all()
assert backend.random_state is None and (backend.get_last_sample().coords == chain[-1]).all()
discard = int(attributes["discard"])
assert len(backend.get_chain(discard=discard)) == kept
accepted = cube("accepted", discarded).mean()
close("acceptance fraction", accepted, summary["acceptance_fraction"], 1e-12)
times = backend.get_autocorr_time(discard=discard, quiet=True)
close("emcee tau", times, emcee.autocorr.integrated_time(positions[discard:], quiet=True), 1e-9)
for time, name in zip(times, names):
    # emcee takes every walker around its own mean, which takes some 10 tau^2/steps away; of a phase, here the worse
    # of cosine and sine counts
    tau = parameters[name]["tau"]
    within(f"emcee tau of {name} over summary.json's", time / tau, 0.85 - 10 * tau / kept, 1.1)
blobs = {"blob_names": list(attributes["blob_names"]), "blob_groups": ["sample_stats"] * (2 + len(derived))}
from_emcee = az.from_emcee(backend, var_names=names, **blobs)
assert dict(from_emcee["posterior"].sizes) == {"chain": ensembles * walkers, "draw": steps - 1}
assert (from_emcee["sample_stats"]["chi2"].transpose("draw", "chain").values == backend.get_blobs()[..., 1]).all()

# GetDist: a chain an ensemble
samples = getdist.loadMCSamples(str(run / "chain"), no_cache=True)
kept_draws = [np.stack([posterior[name].values[e] for name in names], axis=-1) for e in range(ensembles)]
assert [len(one.weights) for one in samples.getSeparateChains()] == [kept * walkers] * ensembles
for p, name in enumerate(names):
    wanted = parameters[name]
    assert (samples.samples[:, p] == np.concatenate([draws[:, p] for draws in kept_draws])).all()
    mean = off_by_turns(samples.mean(name), wanted["mean"])
    close(f"GetDist mean of {name}", mean, 0, 1e-9 * wanted["sd"])
    close(f"GetDist sd of {name}", samples.std(name) / wanted["sd"], 1, 1e-3)
    # a sum of correlations up to the first below 5 %: less than all of them
    within(f"GetDist ESS of {name} over draws / tau", samples.getEffectiveSamples(p) * wanted["tau"] / draws, 0.8, 1.5)
covariance = np.mean([np.cov(draws.T, ddof=0) for draws in kept_draws], axis=0)
between = np.cov(np.array([draws.mean(axis=0) for draws in kept_draws]).T)
worst = np.max(np.linalg.eigvals(np.linalg.solve(covariance, between)).real)
close("GetDist R-1", samples.getGelmanRubin(), worst, 1e-9)
assert samples.ranges.periodic == {"phi"}
assert (samples.ranges.getLower("k_kms"), samples.ranges.getUpper("k_kms")) == (0, 1)
labels = {one.name: one.label for one in samples.paramNames.names}
assert labels["k_kms"] == r"K\;[\mathrm{km/s}]" and samples.paramNames.numDerived() == 2 + len(derived)
density = samples.get1DDensity("phi")
# both smooth the draws, each by its own width
mode = off_by_turns(density.x[np.argmax(density.P)], parameters["phi"]["mode"])
close("GetDist mode of phi in standard deviations", mode / parameters["phi"]["sd"], 0, 0.5)
print("all as summary.json says")
