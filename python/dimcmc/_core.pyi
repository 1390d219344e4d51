"""The engine, as `dimcmc` calls it; not for users."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

_Floats = NDArray[np.float64]
_Arrays = tuple[_Floats, _Floats, float, _Floats, _Floats]
_Config = tuple[str, str | None]
_Progress = Callable[[float | None, str], None]
_Manner = tuple[int | None, _Progress | None]
_Options = tuple[float | None, float | None, float | None, bool, bool, bool, int, int]

class _Beginning(TypedDict):
    prior: bool
    replace: bool
    resume: bool
    extend: int | None

class _LimitsOptions(TypedDict):
    min_period_d: float | None
    max_period_d: float | None
    periods: int
    min_k_kms: float | None
    max_k_kms: float | None
    amplitudes: int
    phases: int
    full: int
    subtract_best: bool | None
    fixed: bool
    draws: int
    seed: int

class _Content(TypedDict):
    names: list[str]
    shape: tuple[int, int, int]
    text: str
    summary: str
    draws: dict[str, _Floats]
    chain: _Floats
    log_prob: _Floats
    numbers: dict[str, _Floats]

def command_line(arguments: Sequence[str]) -> int: ...
def load_config(path: str) -> tuple[str, str]: ...
def check_config(config: _Config) -> str: ...
def check_observations(observations: _Arrays) -> None: ...
def read_observations(list: str) -> _Arrays: ...
def write_observations(observations: _Arrays, folder: str) -> None: ...
def simulate(config: _Config, out: str, manner: _Manner) -> tuple[str, list[_Arrays]]: ...
def init(arguments: Sequence[str], manner: _Manner) -> tuple[str, str]: ...
def inject(
    config: _Config,
    observations: _Arrays | None,
    orbit: tuple[float, float, float],
    out: str,
    manner: _Manner,
) -> str: ...
def map(
    config: _Config, observations: _Arrays | None, times_d: Sequence[float] | None, out: str, manner: _Manner
) -> str: ...
def periodogram(
    config: _Config, observations: _Arrays | None, options: _Options, out: str, manner: _Manner
) -> str: ...
def limits(
    config: _Config, observations: _Arrays | None, options: _LimitsOptions, out: str, manner: _Manner
) -> str: ...
def plan(
    configs: Sequence[_Config],
    nights: tuple[Sequence[int], tuple[int, float | None, float | None] | None],
    options: tuple[float | None, float | None, bool, int, int, int],
    out: str,
    manner: _Manner,
) -> str: ...
def survey(
    folders: Sequence[str],
    options: tuple[list[str], list[str], bool, str | None, str | None, str | None],
    out: str,
    manner: _Manner,
) -> str: ...
def optimise(config: _Config, observations: _Arrays | None, out: str, manner: _Manner) -> str: ...
def grid(
    config: _Config,
    observations: _Arrays | None,
    options: tuple[bool, bool, int | None, int | None],
    out: str,
    manner: _Manner,
) -> str: ...
def sample(
    config: _Config,
    observations: _Arrays | None,
    out: str,
    beginning: _Beginning,
    seed: int | None,
    manner: _Manner,
) -> None: ...
def is_false_start(folder: str) -> bool: ...
def read_run(folder: str) -> _Content: ...
def export(run: str, format: str, out: str | None, replace: bool) -> list[Path]: ...
def printed(folder: str, file: str) -> str | None: ...
def broken(text: str) -> str: ...
def report(folders: Sequence[str]) -> str: ...
def is_report(file: str) -> bool: ...
def figure_names(folder: str) -> list[str]: ...
def figure(folder: str, name: str | None, dpi: float) -> tuple[str, str, str, bytes]: ...

class LogPosterior:
    def __new__(
        cls, config: _Config, observations: _Arrays | None, origin: str | None, manner: _Manner
    ) -> LogPosterior: ...
    @property
    def names(self) -> list[str]: ...
    def origin(self) -> str: ...
    def optimum(self) -> list[_Floats]: ...
    def log_prob(self, theta: ArrayLike, threads: int | None) -> float | _Floats: ...
    def log_prior(self, theta: ArrayLike) -> float | _Floats: ...
    def prior_transform(self, unit: ArrayLike) -> _Floats: ...
