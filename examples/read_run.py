# %% [markdown]
# # A run in Python
#
# Beside a run of dimcmc: `dimcmc export runs/demo --format zarr`, then cell by cell in an editor that knows `# %%`
# (`jupytext` makes a notebook of it), or as a whole:
#
#     python examples/read_run.py runs/demo
#
# It needs arviz, corner, pandas, xarray and zarr.

# %%
import sys
from pathlib import Path

import arviz as az
import corner
import pandas as pd
import xarray as xr

run = Path(sys.argv[-1]) if Path(sys.argv[-1]).is_dir() else Path("runs/demo")

# %% [markdown]
# The chain itself, without any export: a row for each ensemble, step and walker.

# %%
chain = pd.read_json(run / "chain.jsonl", lines=True)
print(chain.groupby("ensemble").log_prob.describe())

# %% [markdown] After the warm-up, for ArviZ: a chain is an ensemble. R-hat is that of `summary.json`. ESS is not
# quite, for ArviZ does not see that walkers of an ensemble learn from each other.

# %%
tree = xr.open_datatree(run / "chain.zarr", engine="zarr")
posterior = tree["posterior"].to_dataset()
print(az.summary(posterior).to_string())

# %% [markdown] The marginals of the sampled parameters (what follows from them, as the period in days, is there too),
# with the injected values where there are any.

# %%
sampled = [name for name, one in posterior.data_vars.items() if "derived" not in one.attrs]
quantities = [posterior[name] for name in sampled]
figure = corner.corner(
    posterior.to_dataframe()[sampled].to_numpy(),
    labels=[f"{one.attrs['long_name']} [{one.attrs['units']}]".replace(" [1]", "") for one in quantities],
    truths=[one.attrs.get("injected") for one in quantities],
    show_titles=True,
    title_fmt=".3f",
)
figure.savefig("corner.png", dpi=120)

# %% [markdown]
# By step and walker again, to see what the sampler did: here the mean of each ensemble.

# %%
by_step = posterior.set_index(draw=["step", "walker"]).unstack("draw")
print(by_step.mean(["step", "walker"]).to_dataframe())
