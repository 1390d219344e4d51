# %% [markdown]
# # A first star
#
# A young, spotted star with a planet of 150 m/s: simulated, mapped, searched and sampled. It requires only
# `pip install dimcmc`. The notebook `first_star.ipynb` and the script `first_star.py` have the same cells.

# %%
import numpy as np

import dimcmc

# %% [markdown]
# ## The star
#
# A config describes star, profiles and free parameters, by the keys of the [reference](../docs/reference/config.md).
# This star rotates in 3 days. We simulate 24 profiles over four rotations, with a signal-to-noise ratio of 1000. Spots
# are longitude, latitude, radius (degrees) and filling factor. They are static here, so that a static map fits and
# everything takes seconds. For your own star delete `objective`: spots then evolve.

# %%
config = dimcmc.Config(
    {
        "star": {
            "rotation_period_d": 3.0,
            "inclination_deg": 60.0,
            "vsini_kms": 25.0,
            "contrast": 0.3,
            "line": {"sigma_kms": 4.0, "equivalent_width_kms": 6.0},
        },
        "planet": {"k_kms": 0.15, "porb_over_prot": 1.7, "phi": 0.5},
        "observations": {
            "simulate": {
                "spots": [[40, 30, 15, 0.9], [200, 60, 12, 0.8], [300, 10, 10, 0.8]],
                "cycles": [round(0.17 * k, 2) for k in range(24)],
                "velocity_kms": {"min": -40.0, "max": 40.0, "step": 2.0},
                "snr": 1000.0,
            }
        },
        "imaging": {"objective": "spottedness", "pixels": 500},
        "parameters": {
            "k_kms": {"prior": "uniform", "min": 0.0, "max": 0.5},
            "porb_over_prot": {"prior": "uniform", "min": 0.5, "max": 4.0},
            "phi": {"prior": "periodic"},
        },
        "sampler": {"ensembles": 4, "walkers": 12, "ess": 400, "rhat": 1.02},
    }
)
config.star.vsini_kms

# %% [markdown]
# ## Its profiles
#
# `simulate` makes them. Observed profiles are files named in the config, or arrays:
# `dimcmc.Observations(times_d, velocities_kms, intensity, sigma)`.

# %%
simulation = dimcmc.simulate(config)
observations = simulation.observations
observations

# %%
simulation.figure("profiles")

# %% [markdown]
# ## Does the model fit?
#
# `map` is Doppler imaging at the config's values. The chi2 per datum should be near 1, and the residuals like noise.

# %%
star = dimcmc.map(config, observations=observations)
star

# %% [markdown]
# ## Is there a planet?
#
# The blind search covers all periods, marginalised over the spots. The verdict is one sentence.

# %%
search = dimcmc.periodogram(config, observations=observations)
print(search.verdict)
search.figure()

# %%
k, error = search.summary.best.k_kms, search.summary.best.sigma_k_kms
print(f"K = {1000 * k:.0f} +- {1000 * error:.0f} m/s, {1000 * config.planet.k_kms:.0f} m/s were injected")

# %% [markdown]
# ## The posterior
#
# With `out="runs/first_star"` the chain would stay on disk. Ctrl-C (in a notebook, *interrupt*) stops it; the same call
# with `resume=True` continues it.

# %%
run = dimcmc.sample(config, observations=observations)
print(run)

# %%
run.figure("corner")

# %% [markdown]
# The draws are numpy arrays, for derived quantities. The minimum mass (Jupiter masses) around a star
# of one solar mass, on a circular orbit:

# %%
mass_mjup = run.samples["k_kms"] / 0.0284 * (run.samples["period_d"] / 365.25) ** (1 / 3)
print(f"M sin i = {np.median(mass_mjup):.2f} +- {np.std(mass_mjup):.2f} Jupiter masses")

# %% [markdown]
# ## Other samplers
#
# `LogPosterior` is the density of that chain, for emcee, zeus, dynesty or nautilus: a function of one vector, or of an
# array of them.

# %%
log_posterior = dimcmc.LogPosterior(config, observations=observations)
draws = run.chain[-1].reshape(-1, log_posterior.ndim)
print(log_posterior.names, np.allclose(log_posterior(draws), run.log_prob[-1].ravel(), rtol=0, atol=0))
