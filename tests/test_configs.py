"""Every file in `configs/` that training reads: it parses, and its policy builds."""

from __future__ import annotations

from pathlib import Path

import draccus
import pytest

from robocasa_lerobot import contract
from robocasa_lerobot.data.config import MixtureConfig
from robocasa_lerobot.training import overlay
from robocasa_lerobot.training.config import load_experiment, to_yaml

CONFIGS = Path(__file__).parents[1] / "configs"
EXPERIMENTS = [CONFIGS / "debug.yaml", *sorted((CONFIGS / "experiments").glob("*.yaml"))]
MIXTURES = sorted((CONFIGS / "mixtures").glob("*.yaml"))


@pytest.mark.parametrize("path", MIXTURES, ids=lambda path: path.stem)
def test_mixture_parses(path: Path) -> None:
    data = overlay.load_yaml(path)
    overlay.check_keys(MixtureConfig, data, path.name)
    assert draccus.decode(MixtureConfig, data).members


@pytest.mark.parametrize("path", EXPERIMENTS, ids=lambda path: path.stem)
def test_experiment_parses_and_its_policies_build(path: Path, tmp_path: Path) -> None:
    builders = pytest.importorskip("robocasa_lerobot.training.builders")
    from robocasa_lerobot.data.mixture import MixtureMeta

    experiment = load_experiment(path)
    (tmp_path / "again.yaml").write_text(to_yaml(experiment))
    assert load_experiment(tmp_path / "again.yaml") == experiment
    meta = MixtureMeta(contract.dataset_features((64, 64)), 20, contract.ROBOT_TYPE, ["open"], 1, 1)
    for phase in experiment.phases:
        config = builders.policy_config({**experiment.policy, **phase.policy}, None, "cpu")
        policy = builders.make_phase_policy(config, meta, None)
        _, scheduler, _ = builders.make_optimizer(policy, phase)
        assert sum(p.numel() for p in policy.parameters()) > 0
        assert scheduler is not None
