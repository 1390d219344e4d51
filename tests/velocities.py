"""Whether numpy and the RV packages read what `export --format rv` writes.

    python tests/velocities.py FOLDER

FOLDER is that export. Packages that are not installed are passed over, by name. Run by tests/commands/export.rs.
"""

import importlib.util
import sys
from pathlib import Path

import numpy as np

folder = Path(sys.argv[1])
sys.path.insert(0, str(folder))
import rv_likelihood as rv  # noqa: E402

n = len(rv.time)
C = rv.covariance
assert C.shape == (n, n) and np.allclose(C, C.T, rtol=1e-9) and np.allclose(np.sqrt(np.diag(C)), rv.error, rtol=1e-9)


def density(residuals, jitter):
    """By eigenvalues rather than by a Cholesky factor."""
    values, vectors = np.linalg.eigh(C + jitter**2 * np.eye(n))
    along = vectors.T @ residuals
    return -0.5 * np.sum(along**2 / values + np.log(2 * np.pi * values))


residuals = rv.velocity - 3.0
for jitter in [0.0, 10.0]:
    assert abs(rv.log_likelihood(residuals, jitter) - density(residuals, jitter)) < 1e-6

# the other tables hold the same, in their own units
juliet = np.loadtxt(folder / "juliet.dat", usecols=(0, 1, 2))
kima = np.loadtxt(folder / "kima.txt", skiprows=1)
pyaneti = np.loadtxt(folder / "pyaneti.dat", comments="#", usecols=(0, 1, 2))
ours = np.column_stack([rv.time, rv.velocity, rv.error])
assert (juliet == ours).all() and (kima == ours).all()
assert np.allclose(pyaneti * [1, 1000, 1000], ours, rtol=1e-12)
instruments = {line.split()[3] for line in (folder / "pyaneti.dat").read_text().splitlines()[1:]}
assert instruments == {"dimcmc"}


def installed(name):
    found = importlib.util.find_spec(name) is not None
    print(f"{name}: {'read' if found else 'not installed, passed over'}")
    return found


if installed("radvel"):
    import pandas as pd
    import radvel

    table = pd.read_csv(folder / "radvel.csv")
    assert list(table.columns) == ["time", "mnvel", "errvel", "tel"] and set(table.tel) == {"dimcmc"}
    params = radvel.Parameters(1, basis="per tc secosw sesinw k")
    for key, value in {"per1": 5.1, "tc1": 1.0, "secosw1": 0.0, "sesinw1": 0.0, "k1": 80.0}.items():
        params[key] = radvel.Parameter(value=value)
    params["dvdt"], params["curv"] = radvel.Parameter(value=0.0), radvel.Parameter(value=0.0)
    like = rv.radvel_likelihood(radvel.RVModel(params))
    like.params["gamma_dimcmc"] = radvel.Parameter(value=5.0)
    like.params["jit_dimcmc"] = radvel.Parameter(value=2.0)
    like.vector.dict_to_vector()
    residuals = rv.velocity - 5.0 - like.model(rv.time)
    assert abs(like.logprob() - density(residuals, 2.0)) < 1e-6
    together = radvel.likelihood.CompositeLikelihood([like])
    assert abs(together.logprob() - like.logprob()) < 1e-9

if installed("tinygp"):
    gp = rv.tinygp_process(mean=lambda t: 3.0, jitter=10.0)
    assert abs(float(gp.log_probability(rv.velocity)) - density(rv.velocity - 3.0, 10.0)) < 1e-6

if installed("juliet"):
    from juliet.utils import read_data

    times, velocities, errors, names = read_data(str(folder / "juliet.dat"))[:4]
    assert (np.column_stack([times, velocities, errors]) == ours).all() and set(names) == {"dimcmc"}
