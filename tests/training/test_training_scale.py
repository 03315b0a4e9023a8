"""`--scale`: what it makes smaller, what it refuses, and that plan, evaluations and records know of it."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from atomic_version import atomic_tasks_only

from robocasa_lerobot.cli import main
from robocasa_lerobot.config_files import configs_folder
from robocasa_lerobot.data.mixture_config import SelectionConfig
from robocasa_lerobot.data.registry.registry import select_datasets
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.config.evaluation import EnvSettings, EvaluationConfig
from robocasa_lerobot.evaluation.config.loader import load_config
from robocasa_lerobot.evaluation.planning.run_header import outcome_settings, plan_tasks
from robocasa_lerobot.training.config.experiment import load_experiment, to_yaml
from robocasa_lerobot.training.config.scale import load_scale
from robocasa_lerobot.training.planning.evaluations import phase_evaluations

EXPERIMENTS = Path(__file__).parents[2] / "configs/experiments"
PUBLISHED = EXPERIMENTS / "robocasa365"


@pytest.mark.parametrize("path", sorted((configs_folder() / "scales").glob("*.yaml")), ids=lambda path: path.stem)
def test_scale_files_are_read_by_name_and_by_path(path: Path) -> None:
    assert load_scale(path.stem) == load_scale(str(path))
    assert load_scale(path.stem).name == path.stem


def test_a_scale_makes_less_of_everything_and_changes_nothing_else() -> None:
    path = PUBLISHED / "multitask_diffusion_policy.yaml"
    whole, small, scale = load_experiment(path), load_experiment(path, scale="tiny"), load_scale("tiny")
    (phase,), (before,) = small.phases, whole.phases
    assert (phase.steps, phase.batch_size, phase.save_every, phase.log_every) == (4, 2, 2, 1)
    assert before.schedule_steps == 2 * before.steps
    assert phase.schedule_steps == 2 * phase.steps  # half-way down its cosine, here too
    assert small.policy == {**whole.policy, **scale.policies["diffusion_transformer"]}
    assert small.policy["text_encoder"] == "clip"
    assert small.loader.workers == 0
    assert small.loader.cache_columns_above_gb == pytest.approx(whole.loader.cache_columns_above_gb * scale.data_share)
    assert small.loader.cache_open_files == 1
    changed = {"steps", "schedule_steps", "batch_size", "save_every", "log_every", "evaluations", "mixture"}
    for name, value in vars(before).items():
        assert name in changed or getattr(phase, name) == value, name
    assert [s.tasks_per_set for s in phase.mixture.select] == [2]
    assert small.scale == scale


def test_the_record_of_a_scaled_experiment_is_an_experiment_that_stays_as_it_is(tmp_path: Path) -> None:
    experiment = load_experiment(PUBLISHED / "foundation.yaml", scale="tiny")
    (tmp_path / "again.yaml").write_text(to_yaml(experiment))
    assert load_experiment(tmp_path / "again.yaml") == experiment


def test_evaluations_of_a_scaled_experiment_are_small_and_say_so() -> None:
    phase = load_experiment(PUBLISHED / "foundation.yaml", scale="tiny").phases[0]
    (evaluation,) = phase_evaluations(phase)
    arguments = ["--config_path", str(evaluation.file), "--policy.path=checkpoint", *evaluation.settings]
    config = load_config(EvaluationConfig, arguments)
    assert (config.trials, config.env.horizon, config.workers, config.videos) == (1, 3, 1, 0)
    assert config.policy.training_data == ["pretraining only"]  # the phase's own settings stay
    assert outcome_settings(config, 32)["scale"] == "tiny"
    assert "scale" not in outcome_settings(load_config(EvaluationConfig, arguments[:3]), 32)


def test_two_tasks_of_each_set_are_those_that_can_be_simulated(monkeypatch: pytest.MonkeyPatch) -> None:
    atomic_tasks_only(monkeypatch)
    planned = plan_tasks(EnvSettings(task_sets=["atomic_seen", "lifelong_phase1"], tasks_per_set=2))
    assert [len(tasks) for tasks in planned.sets.values()] == [2, 2]
    assert planned.missing == []
    with pytest.raises(UserError, match="lifelong_phase2"):
        plan_tasks(EnvSettings(task_sets=["lifelong_phase2"], tasks_per_set=2))


def test_two_tasks_of_a_selection_are_the_first_that_have_data() -> None:
    every = select_datasets(SelectionConfig(task_set="atomic_seen", split="pretrain", source="mg"))
    two = select_datasets(SelectionConfig(task_set="atomic_seen", split="pretrain", source="mg", tasks_per_set=2))
    assert two == every[:2]
    named = SelectionConfig(task_set="atomic_seen", tasks=["OpenDrawer"], split="target", tasks_per_set=1)
    assert next(entry.task for entry in select_datasets(named)) == "OpenDrawer"
    assert len(select_datasets(named)) == 2


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"seed": 1}, "seed"),
        ({"init": "from_scratch"}, "init"),
        ({"evaluation": {"protocol": "quick"}}, "protocol"),
        ({"policies": {"pi0": {"type": "act"}}}, "another policy"),
        ({"steps": 0}, "at least 1"),
        ({"evaluation": {"trials": 0}}, "at least 1"),
        ({"data_share": 2.0}, "at most 1"),
    ],
)
def test_what_a_scale_may_not_change_is_refused(content: dict[str, object], message: str, tmp_path: Path) -> None:
    (tmp_path / "scale.yaml").write_text(yaml.safe_dump(content))
    with pytest.raises(UserError, match=message):
        load_scale(str(tmp_path / "scale.yaml"))


def test_an_unknown_scale_names_the_closest() -> None:
    with pytest.raises(UserError, match="'tiny'"):
        load_scale("tinny")


def test_the_command_takes_a_scale(capfd: pytest.CaptureFixture[str]) -> None:
    arguments = ["train", "--config_path", str(PUBLISHED / "lifelong.yaml"), "--scale", "tiny"]
    assert main([*arguments, "--print_config"]) == 0
    assert {phase["steps"] for phase in yaml.safe_load(capfd.readouterr().out)["phases"]} == {4}
    assert main([*arguments, "--plan", "--measure=0"]) == 0
    assert "4 steps" in capfd.readouterr().out
