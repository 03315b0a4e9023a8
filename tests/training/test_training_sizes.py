"""A phase whose policy does not fit what it starts from is refused before anything is trained."""

from __future__ import annotations

import copy
import re
from pathlib import Path

import pytest
import torch
from training_support import experiment_file

from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.policies.cut_instructions import cut_instructions
from robocasa_lerobot.policies.flow_vla.configuration_flow_vla import FlowVlaConfig
from robocasa_lerobot.training.config.experiment import load_experiment
from robocasa_lerobot.training.config.phase import LoraConfig, PhaseConfig
from robocasa_lerobot.training.phases import run_experiment
from robocasa_lerobot.training.planning.plan import plan_experiment
from robocasa_lerobot.training.weights.adapters import apply_training_scope, merged_state


def run(folder: Path, data: Path, *settings: str) -> bool:
    return run_experiment(load_experiment(experiment_file(folder, data, defaults={"steps": 1}), settings))


def test_sizes_that_do_not_fit_the_phase_before(tmp_path: Path, data: Path) -> None:
    message = r"sets policy\.dropout, policy\.width, with which \d+ of the weights .* 16.* there, and .*32.* here"
    with pytest.raises(UserError, match=message):
        run(tmp_path, data, "--phases.finetune.policy.dropout=0.2", "--phases.finetune.policy.width=32")
    assert not (tmp_path / "out").exists()


def test_another_type_than_that_of_the_phase_before_is_named(tmp_path: Path, data: Path) -> None:
    with pytest.raises(UserError, match=r"'finetune' starts from phase 'pretrain', .* asks for 'act'.*from_scratch"):
        run(tmp_path, data, "--phases.finetune.policy.type=act")


def test_names_of_inputs_are_names(tmp_path: Path, data: Path) -> None:
    for setting, expected in (("rename={a: null}", "expected names"), ("leave_out=wrist", "expected a list of names")):
        with pytest.raises(UserError, match=expected):
            run(tmp_path, data, f"--phases.finetune.policy.{setting}")


def test_settings_that_change_no_size_pass_and_those_of_a_checkpoint_are_looked_at(tmp_path: Path, data: Path) -> None:
    assert run(tmp_path / "first", data, "--phases.finetune.policy.dropout=0.2")
    start = f"--phases.pretrain.init={tmp_path}/first/out/pretrain/checkpoints/last/pretrained_model"
    keep = "--phases.pretrain.statistics=keep"
    with pytest.raises(UserError, match=r"'pretrain' sets policy\.width, with which"):
        run(tmp_path / "second", data, start, keep, "--phases.pretrain.policy.width=32")
    assert not (tmp_path / "second/out").exists()


def test_instructions_that_are_cut_are_named(tmp_path: Path, data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(tmp_path, data, "--policy.max_words=2")
    assert re.search(r"note: 2 of 2 instructions are cut after 2 words .* the longest has \d", capsys.readouterr().out)
    experiment = load_experiment(tmp_path / "experiment.yaml", ["--policy.max_words=2"])
    plan = plan_experiment(experiment, measured_steps=0)[0]
    assert any("cut after 2 words" in note for note in plan.notes)


def test_every_tasks_instruction_is_read_to_its_end() -> None:
    config = FlowVlaConfig()
    longest = [re.sub(r"\{[^}]*\}", "three more words", get_task(name).instruction) for name in task_names()]
    assert cut_instructions(config, longest) is None
    config.max_words = 30
    assert "'" in str(cut_instructions(config, longest))


def test_small_changes_of_weights_in_half_precision_are_not_rounded_away() -> None:
    """They change the outputs as they would in float32, and learn; what is merged is rounded once."""
    torch.manual_seed(0)
    model = torch.nn.Sequential(torch.nn.Linear(64, 32)).to(torch.bfloat16)
    phase = PhaseConfig.__new__(PhaseConfig)
    phase.freeze, phase.lora = [], LoraConfig(rank=4)
    apply_training_scope(model, phase, 0)
    before, inputs = model[0].weight.detach().clone(), torch.randn(16, 64, dtype=torch.bfloat16)
    change = model[0].parametrizations.weight[0]
    with torch.no_grad():
        change.up.normal_(std=1e-4)
        difference = (change.up.float() @ change.down.float()) * change.scale
        wanted = inputs.float() @ difference.T
        assert (model[0].weight == before).float().mean() > 0.8  # in the weights themselves most of it is lost
        model[0].bias.zero_()
        plain = torch.nn.functional.linear(inputs, before)
        found = copy.deepcopy(model)(inputs * 0) + change.change(inputs)
        assert torch.nn.functional.cosine_similarity(found.float().ravel(), wanted.ravel(), dim=0) > 0.999
        assert torch.equal(model(inputs), plain + change.change(inputs))
    model(inputs).sum().backward()
    assert change.up.grad is not None
    assert change.up.grad.abs().max() > 0
    merged = merged_state(model)
    assert merged is not None
    assert torch.equal(merged["0.weight"], (before.float() + difference).to(torch.bfloat16))


@pytest.mark.parametrize("setting", ["leave_out=[observation.images.wrist]", "rename={observation.state: state}"])
def test_inputs_of_weights_where_there_are_none(setting: str, tmp_path: Path, data: Path) -> None:
    with pytest.raises(UserError, match=r"'pretrain' sets policy\.\w+, .* starts from_scratch, .*loader\.cameras"):
        run(tmp_path, data, f"--phases.pretrain.policy.{setting}")
