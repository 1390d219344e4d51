"""Configs: where they come from, attributes, errors that name the key."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT, SMALL

import dimcmc


def test_dict_text_file_and_config_are_the_same(tmp_path: Path) -> None:
    file = tmp_path / "star.json"
    file.write_text(json.dumps(SMALL))
    configs = [dimcmc.Config(source) for source in (SMALL, json.dumps(SMALL), file, str(file))]
    for config in configs:
        assert config.to_dict() == SMALL
        assert config.resolved() == configs[0].resolved()
        assert dimcmc.Config(config) == config and pickle.loads(pickle.dumps(config)) == config


def test_attributes_give_what_is_written_or_the_default(config: dimcmc.Config) -> None:
    assert config.star.vsini_kms == 25.0 and config["star"]["vsini_kms"] == 25.0
    # nothing is written of these
    assert config.star.epoch_d == 0.0 and config.sampler.seed == 1
    del config.imaging.objective
    assert config.imaging.objective == "marginal-likelihood"
    assert "vsini_kms" in dir(config.star) and "star" in dir(config)
    with pytest.raises(AttributeError, match=r"no star.vsini: did you mean vsini_kms\?"):
        config.star.vsini


def test_changes_are_checked_and_reach_the_engine(config: dimcmc.Config) -> None:
    config.star.vsini_kms = np.float64(30.0)
    config.sampler["steps"] = 7
    config.grid = {"axes": {"k_kms": [0.0, 0.5, 3], "phi": [np.float64(0.0), 0.9, np.int64(4)]}}
    assert config.resolved()["star"]["vsini_kms"] == 30.0 and config.resolved()["sampler"]["steps"] == 7
    del config.grid
    del config.sampler.steps
    assert "grid" not in config.to_dict() and config.sampler.steps != 7


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("star.vsini_kms", -1.0, "star.vsini_kms"),
        ("star.vsini_kms", "fast", "star.vsini_kms: expected a number"),
        ("star.vsini_kms", float("nan"), "star.vsini_kms: must be a finite number"),
        ("star.vsin_kms", 25.0, "unknown key star.vsin_kms: did you mean vsini_kms?"),
        ("imaging.objective", "likelihood", "imaging.objective"),
        ("sampler.steps", 1.5, "sampler.steps"),
    ],
)
def test_nonsense_names_the_key_and_changes_nothing(
    config: dimcmc.Config, path: str, value: object, words: str
) -> None:
    before = config.to_dict()
    section, key = path.split(".")
    with pytest.raises(ValueError) as caught:
        setattr(getattr(config, section), key, value)
    assert words in str(caught.value) and config.to_dict() == before


def test_wrong_sources(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="dict, JSON text or a path, not int"):
        dimcmc.Config(3)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"star.line: .* not object"):
        dimcmc.Config({**SMALL, "star": {**SMALL["star"], "line": object()}})
    with pytest.raises(FileNotFoundError):
        dimcmc.Config(tmp_path / "none.json")
    with pytest.raises(ValueError, match=r"config:1:\d+: invalid JSON"):
        dimcmc.Config("{,}")
    with pytest.raises(ValueError, match="star"):
        dimcmc.Config({})


def test_several_keys_at_once(config: dimcmc.Config) -> None:
    config.update({"observations": {"simulate": None, "path": "observations.txt"}, "sampler": {"steps": 5}})
    assert config.observations.path == "observations.txt" and config.sampler.walkers == 10


def test_saved_and_read_again(config: dimcmc.Config, tmp_path: Path) -> None:
    config.save(tmp_path / "star.json")
    assert dimcmc.Config(tmp_path / "star.json").to_dict() == config.to_dict()
    assert "vsini_kms" in config._repr_html_() and "vsini_kms" in repr(config)


def test_the_demo_is_read() -> None:
    assert dimcmc.Config(ROOT / "configs/demo.json").sampler.ensembles == 4
