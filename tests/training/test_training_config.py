"""Experiment files: defaults, references to files, overrides, and what is said about mistakes."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
import yaml
from lerobot.configs.policies import PreTrainedConfig

from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.policies.registry import register_policies
from robocasa_lerobot.training.config import experiment_files as overlay
from robocasa_lerobot.training.config.experiment import ExperimentConfig, load_experiment, to_yaml
from robocasa_lerobot.training.setup.optimizers import check_optimizer

EXPERIMENT = """
name: try
output_dir: out
policy: {file: act.yaml, chunk_size: 5}
defaults: {steps: 7, batch_size: 4, ema: {power: 0.5}, mixture: mix.yaml}
phases:
  - {name: pretrain}
  - {name: finetune, statistics: keep, steps: 3, ema: {enabled: false}, learning_rate: 1e-4}
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "act.yaml").write_text("{type: act, chunk_size: 100, dim_model: 64}")
    (tmp_path / "mix.yaml").write_text("{members: [{root: a, weight: 2}, {root: b, weight: 1}]}")
    (tmp_path / "try.yaml").write_text(EXPERIMENT)
    return tmp_path / "try.yaml"


def test_phases_name_what_they_change(path: Path) -> None:
    experiment = load_experiment(path)
    first, second = experiment.phases
    assert experiment.policy == {"type": "act", "chunk_size": 5, "dim_model": 64}
    assert (first.steps, first.batch_size, first.ema.enabled, first.learning_rate) == (7, 4, True, None)
    assert (second.steps, second.batch_size, second.ema.enabled, second.learning_rate) == (3, 4, False, 1e-4)
    assert first.ema.power == second.ema.power == 0.5
    assert [member.root for member in second.mixture.members] == ["a", "b"]
    assert [experiment.init_of(phase) for phase in experiment.phases] == ["from_scratch", "pretrain"]


@pytest.mark.parametrize(
    ("arguments", "dotted", "value"),
    [
        (["--phases.pretrain.steps=10"], "phases.pretrain.steps", 10),
        (["--phases.1.steps", "10"], "phases.finetune.steps", 10),
        (["--defaults.batch_size=8"], "phases.finetune.batch_size", 8),
        (["--policy.chunk_size=9"], "policy.chunk_size", 9),
        (["--phases.finetune.learning_rate=2e-5"], "phases.finetune.learning_rate", 2e-5),
        (["--phases.finetune.mixture.alpha=1"], "phases.finetune.mixture.alpha", 1.0),
        (["--phases.finetune.mixture.members.0.weight=5"], "phases.finetune.mixture.members.0.weight", 5.0),
        (["--defaults.mixture.members.0.weight=5"], "phases.pretrain.mixture.members.0.weight", 5.0),
        (["--loader.cache_frames=false"], "loader.cache_frames", False),
        (["--output_dir=other"], "output_dir", "other"),
        (["--mixed_precision=no"], "mixed_precision", "no"),
        (["--mixed_precision=bf16"], "mixed_precision", "bf16"),
        (["--phases.0.policy={dim_model: 32}"], "phases.pretrain.policy.dim_model", 32),
    ],
)
def test_overrides(path: Path, arguments: list[str], dotted: str, value: object) -> None:
    experiment = load_experiment(path, arguments)
    assert overlay.flatten(yaml.safe_load(to_yaml(experiment)))[dotted] == value


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--stepz=1"], "unknown key 'stepz'"),
        (["--loader.workers=-1"], "workers is -1, expected at least 0"),
        (["--loader.image_size=0"], "image_size is 0, expected at least 1"),
        (["--defaults.stepz=1"], "Did you mean 'steps'"),
        (
            ["--phases.finetune.batchsize=1"],
            r"'batchsize'.*'batch_size'.*\(in `phases\.finetune` of try\.yaml with --phases",
        ),
        (["--phases.finetune.ema.powr=1"], "Did you mean 'power'"),
        (["--loader.cache_frame=1"], "Did you mean 'cache_frames'"),
        (["--phases.fintune.steps=1"], "Did you mean 'finetune'"),
        (["--phases.2.steps=1"], "has 2 entries"),
        (["--phases.pretrain.mixture.members.7.weight=1"], "has 2 entries"),
        (["--phases.pretrain.steps=many"], "steps"),
        (["--phases.pretrain.steps=0"], "expected at least 1"),
        (["--phases.pretrain.statistics=keeep"], "Did you mean 'keep'"),
        (["--phases.finetune.init=pretran"], "Did you mean 'pretrain'"),
        (["--phases.pretrain.init=finetune"], "does not come before"),
        (["--phases.finetune.name=pretrain"], "two phases"),
        (["--phases.finetune.name=../x"], "names a folder"),
        (["--phases.finetune.gradient_accumulation=3"], "no multiple"),
        (["--phases.finetune.mixture.members=[]"], "no members"),
        (["--phases.finetune.learning_rate=-1"], "learning_rate is -1.0, expected 0 or more"),
        (["--phases.finetune.ema.inv_gamma=0"], "inv_gamma is 0.0, expected more than 0"),
        (["--phases.finetune.ema.max_decay=1.5"], "expected 0 <= min_decay"),
        (["--phases.finetune.ema.power=-1"], "power is -1.0, expected more than 0"),
        (
            ["--phases.finetune.ema=false"],
            r"`phases\.finetune\.ema` is False, expected a mapping of settings: enabled,",
        ),
        (["--phases.finetune.lora=true"], r"`phases\.finetune\.lora` is True, expected a mapping of settings: rank,"),
        (["--phases.finetune.lora.alpha=nan"], "alpha is nan, expected a number"),
        (["--phases.finetune.freeze=head"], r"`phases\.finetune\.freeze` is 'head', expected a list, such as \[head\]"),
        (["--phases.finetune.optimizer=adamw"], r"`phases\.finetune\.optimizer` is 'adamw', expected a mapping"),
        (["--phases.finetune.steps=true"], r"`phases\.finetune\.steps` is True, expected a number"),
        (
            ["--phases.finetune.mixture.members.0.tasks=OpenDrawer"],
            r"members\.0\.tasks` is 'OpenDrawer', expected a list",
        ),
        (["--phases.finetune.mixture.alpha=nan"], "alpha is nan, expected a number"),
        (["--loader.cameras=left"], r"`loader\.cameras` is 'left', expected a list, such as \[left\]"),
        (["--policy.file=atc.yaml"], "no file .*atc.yaml"),
        (["--seed=-1"], "seed is -1, expected 0 or more"),
        (["--output_dir"], "has no value"),
        (["output_dir=3"], "settings are written --name=VALUE"),
        (["--name.x=3"], "nothing inside to set"),
    ],
)
def test_mistakes_are_told(path: Path, arguments: list[str], message: str) -> None:
    with pytest.raises(UserError, match=message):
        load_experiment(path, arguments)


def test_missing_and_broken_files_are_told(path: Path) -> None:
    with pytest.raises(UserError, match=r"Did you mean 'try\.yaml'"):
        load_experiment(path.with_name("tri.yaml"))
    path.with_name("act.yaml").write_text("{type: [")
    with pytest.raises(UserError, match="not valid YAML"):
        load_experiment(path)
    path.write_text("- a\n- b\n")
    with pytest.raises(UserError, match="expected a mapping"):
        load_experiment(path)


def test_resolved_experiment_loads_again(path: Path, tmp_path: Path) -> None:
    experiment = load_experiment(path, ["--phases.finetune.steps=4"])
    (tmp_path / "resolved.yaml").write_text(to_yaml(experiment))
    again = load_experiment(tmp_path / "resolved.yaml")
    assert isinstance(again, ExperimentConfig)
    assert again == experiment


def test_a_pattern_changes_all_phases_that_match(tmp_path: Path) -> None:
    phases = [{"name": name, "steps": 1} for name in ("pretrain", "atomic_10", "atomic_30")]
    (tmp_path / "base.yaml").write_text(yaml.safe_dump({"phases": phases}))
    changes = [{"name": "atomic_*", "steps": 2}, {"name": "*", "batch_size": 8}, {"name": "last", "steps": 3}]
    (tmp_path / "own.yaml").write_text(yaml.safe_dump({"base": "base.yaml", "phases": changes}))
    assert overlay.resolve(tmp_path / "own.yaml")["phases"] == [
        {"name": "pretrain", "steps": 1, "batch_size": 8},
        {"name": "atomic_10", "steps": 2, "batch_size": 8},
        {"name": "atomic_30", "steps": 2, "batch_size": 8},
        {"name": "last", "steps": 3},
    ]


def test_a_pattern_that_fits_no_phase_is_named(path: Path) -> None:
    variant = path.with_name("variant.yaml")
    variant.write_text(f"base: {path.name}\nphases: [{{name: 'fine*', steps: 5}}]\n")
    assert [phase.steps for phase in load_experiment(variant).phases][1] == 5
    variant.write_text(f"base: {path.name}\nphases: [{{name: 'fin_*', steps: 5}}]\n")
    with pytest.raises(UnknownNameError, match=r"'fin_\*'.*finetune"):
        load_experiment(variant)


@pytest.mark.parametrize("name", ["cosine", "cosine_with_restarts"])
def test_a_cosine_that_would_rise_again_is_refused(name: str, path: Path) -> None:
    register_policies()
    config = PreTrainedConfig.get_choice_class("diffusion_transformer")()
    phase = dataclasses.replace(load_experiment(path).phases[0], steps=12, schedule_steps=6)
    phase.scheduler = {"type": "diffuser", "name": name, "num_warmup_steps": 1}
    with pytest.raises(UserError, match=r"schedule_steps is 6, but there are 12 steps.*Give at least 12"):
        check_optimizer(config, phase)
    check_optimizer(config, dataclasses.replace(phase, schedule_steps=12))
    check_optimizer(config, dataclasses.replace(phase, scheduler={**phase.scheduler, "name": "linear"}))


@pytest.mark.parametrize(
    ("field", "change", "message"),
    [
        ("optimizer", {"lr": "fast"}, "`optimizer.lr` is 'fast', expected a number"),
        ("optimizer", {"weight_decay": True}, "`optimizer.weight_decay` is True, expected a number"),
        ("optimizer", {"type": "adam", "betas": 3}, "`optimizer.betas` is 3, expected a list of 2 numbers"),
        ("optimizer", {"betas": [0.9]}, "expected a list of 2 numbers"),
        ("optimizer", {"wieght_decay": 1}, "Did you mean 'weight_decay'"),
        ("optimizer", {"weight_decay": -0.1}, "optimiser 'adamw': Invalid weight_decay value: -0.1"),
        ("optimizer", {"lr": -1.0}, "Invalid learning rate: -1.0"),
        ("optimizer", {"betas": [0.9, 2]}, "Invalid beta parameter"),
        ("optimizer", {"type": "none"}, "unknown type of optimizer 'none'. (?!.*'none' or)"),
        ("scheduler", {"type": "diffuser", "name": "cosine", "num_warmup_steps": "abc"}, "num_warmup_steps` is 'abc'"),
    ],
)
def test_values_of_another_kind_for_the_optimiser_are_named(
    field: str, change: dict[str, object], message: str, path: Path
) -> None:
    register_policies()
    config = PreTrainedConfig.get_choice_class("diffusion_transformer")()
    phase = load_experiment(path).phases[0]
    check_optimizer(config, phase)
    with pytest.raises(UserError, match=message):
        check_optimizer(config, dataclasses.replace(phase, **{field: change}))
