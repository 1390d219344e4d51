"""Velocities free of spots with their full covariance, in m/s, as a likelihood of radvel and as the noise of tinygp.

    import radvel, rv_likelihood
    like = rv_likelihood.radvel_likelihood(model)       # in place of radvel.likelihood.RVLikelihood

    import rv_likelihood
    gp = rv_likelihood.tinygp_process(mean=lambda t: orbit(t))
    gp.log_probability(rv_likelihood.velocity)

Needs numpy, and the package that is asked for. Written by `dimcmc export --format rv`; README.txt says what is lost
without the covariance.
"""

from pathlib import Path

import numpy as np

FOLDER = Path(__file__).resolve().parent
time, velocity, error = np.loadtxt(FOLDER / "radvel.csv", delimiter=",", skiprows=1, usecols=(0, 1, 2), unpack=True)
covariance = np.loadtxt(FOLDER / "covariance_m2s2.csv", delimiter=",", ndmin=2)


def log_likelihood(residuals, jitter=0.0):
    """ln of the density of residuals (m/s) in the order of the table, with a jitter (m/s) beside."""
    factor = np.linalg.cholesky(covariance + jitter**2 * np.eye(len(covariance)))
    whitened = np.linalg.solve(factor, residuals)
    ln_determinant = 2.0 * np.sum(np.log(np.diag(factor)))
    return -0.5 * (whitened @ whitened + ln_determinant + len(whitened) * np.log(2.0 * np.pi))


def radvel_likelihood(model, suffix="_dimcmc"):
    """A radvel RVLikelihood of these velocities; its parameters are gamma_dimcmc and jit_dimcmc."""
    from radvel.likelihood import RVLikelihood

    class CovarianceLikelihood(RVLikelihood):
        def logprob(self):
            gamma = self.params[self.gamma_param]
            if gamma.linear and not gamma.vary:
                raise ValueError(f"{self.gamma_param}: linear=True takes velocities for independent, let it vary")
            return log_likelihood(self.residuals(), self.params[self.jit_param].value)

    return CovarianceLikelihood(model, time, velocity, error, suffix=suffix)


def tinygp_process(kernel=None, mean=None, jitter=0.0):
    """A tinygp GaussianProcess with the covariance as noise, and a kernel beside it if there is one."""
    import jax

    jax.config.update("jax_enable_x64", True)
    import tinygp

    noise = tinygp.noise.Dense(value=jax.numpy.asarray(covariance + jitter**2 * np.eye(len(covariance))))
    kernel = tinygp.kernels.Constant(0.0) if kernel is None else kernel
    return tinygp.GaussianProcess(kernel, jax.numpy.asarray(time), noise=noise, mean=mean)
