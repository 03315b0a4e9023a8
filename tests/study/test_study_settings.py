"""The package's study: every row of every table is a phase of an experiment that there is, with its evaluation."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
import yaml

from robocasa_lerobot import cli
from robocasa_lerobot.config_files import config_names, configs_folder
from robocasa_lerobot.data.registry.recipes import IMAGE_SIZE
from robocasa_lerobot.data.registry.registry import open_registry
from robocasa_lerobot.data.registry.registry_file import load_registry
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.study import runs
from robocasa_lerobot.study.costs import costs
from robocasa_lerobot.study.settings import EXPERIMENTS, StudyConfig, load_study
from robocasa_lerobot.training.config.experiment import load_experiment
from robocasa_lerobot.training.planning.evaluations import phase_evaluations

STUDY = load_study()
GENERATION = load_study(configs_folder() / "study_generation.yaml")
PARTS = [(study, part) for study in (STUDY, GENERATION) for part in study.parts]
ROWS = [(study, part, row) for study, part in PARTS for row in study.parts[part].rows]


def name_of(value: object) -> str:
    return value.replace(" ", "_") if isinstance(value, str) else ""


@pytest.mark.parametrize(("study", "part", "row"), ROWS, ids=name_of)
def test_a_row_is_a_phase_with_its_evaluation(study: StudyConfig, part: str, row: str) -> None:
    wanted = study.parts[part].rows[row]
    experiment = load_experiment(configs_folder() / "experiments" / EXPERIMENTS / f"{wanted.experiment}.yaml")
    names = [evaluation.name for evaluation in phase_evaluations(experiment.phase(wanted.phase))]
    assert wanted.evaluation in names


@pytest.mark.parametrize(("study", "part"), PARTS, ids=name_of)
def test_the_evaluations_of_a_part_try_the_tasks_of_its_columns(study: StudyConfig, part: str) -> None:
    sets = open_registry(str(configs_folder() / study.registry)).task_sets
    config = study.parts[part]
    tried: dict[str, set[str]] = {}
    for row, wanted in config.rows.items():
        experiment = load_experiment(configs_folder() / "experiments" / EXPERIMENTS / f"{wanted.experiment}.yaml")
        for evaluation in phase_evaluations(experiment.phase(wanted.phase)):
            if evaluation.name == wanted.evaluation:
                named = next(text for text in evaluation.settings if text.startswith("--env.task_sets="))
                own = {task for name in named.partition("=")[2].split(",") for task in sets[name]}
                tried[row] = own
    columns = {task for name in config.sets for task in sets[name]}
    if config.matrix:  # the last phases' tasks come later
        assert set().union(*tried.values()) == columns
    else:
        assert {row for row, own in tried.items() if columns <= own} == set(config.rows)


def test_what_is_on_request_is_run_by_its_name_only() -> None:
    asked = STUDY.chosen([])
    assert list(asked) == ["multitask", "data_efficiency", "lifelong", "diversity", "recipes", "quality"]
    assert list(STUDY.chosen(["demonstrations"])) == ["demonstrations"]
    assert "demonstrations" in STUDY.shown_with(asked).parts, "the page has it"
    assert STUDY.chosen(["demonstrations"], seeds=1)["demonstrations"].seeds_of("recipe_disturbed") == 1


def test_every_experiment_of_a_study_is_in_one() -> None:
    named = {experiment for study, part in PARTS for experiment in study.parts[part].experiments}
    start = f"{EXPERIMENTS}/"
    there = {name.removeprefix(start) for name in config_names("experiments") if name.startswith(start)}
    assert named == there


def test_lifelong_phases_and_the_two_groups_share_out_the_tasks() -> None:
    sets = open_registry(str(configs_folder() / STUDY.registry)).task_sets
    phases = [task for number in range(1, 5) for task in sets[f"study_phase{number}"]]
    assert sorted(phases) == sorted(sets["study_12"]) == sorted([*sets["study_10"], *sets["study_2"]])
    assert set(sets["study_4"]) | set(sets["study_pick_place"]) <= set(sets["study_12"])


def test_wrong_studies_are_refused(tmp_path: Path) -> None:
    row = {"experiment": "multitask", "phase": "multitask", "evaluation": "study_target"}
    part = {"asks": "?", "rows": {"one": row}, "sets": ["study_12"]}
    whole = {"root": "outputs/study", "registry": "x.yaml", "parts": {"a": part}}

    def loaded(content: dict[str, object]) -> object:
        file = tmp_path / "study.yaml"
        file.write_text(yaml.safe_dump(content))
        return load_study(file)

    assert loaded(whole)
    with pytest.raises(UnknownNameError, match="experiment"):
        loaded({**whole, "parts": {"a": {**part, "rows": {"one": {**row, "experimnt": 1}}}}})
    with pytest.raises(UnknownNameError, match="one"):
        loaded({**whole, "parts": {"a": {**part, "reference": "oen"}}})
    with pytest.raises(UserError, match="at least one seed"):
        loaded({**whole, "parts": {"a": {**part, "seeds": 0}}})
    with pytest.raises(UnknownNameError, match="multitask"):
        STUDY.chosen(["multitasking"])
    lifelong = {**part, "sets": ["study_phase1", "study_phase2"], "matrix": True}
    assert loaded({**whole, "parts": {"a": {**lifelong, "rows": {"plain, after phase 2": row}}}})
    for label in ("plain", "plain, after phase two", "plain, after phase 3", "plain, after phase 0"):
        with pytest.raises(UserError, match="`NAME, after phase K` with a K from 1 to 2"):
            loaded({**whole, "parts": {"a": {**lifelong, "rows": {label: row}}}})


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"sets": ["study_21"]}, r"unknown task set 'study_21'. Did you mean .*'study_12'"),
        ({"experiment": "multitsk"}, r"unknown experiment 'multitsk'. Did you mean 'multitask'"),
        ({"phase": "multitasks"}, r"unknown phase 'multitasks'. Did you mean 'multitask'\? \(of the row 'one'"),
        ({"evaluation": "study_targets"}, r"unknown evaluation 'study_targets'. Did you mean 'study_target'"),
    ],
)
@pytest.mark.parametrize("words", [["--plan", "--measure=0"], ["--report"]], ids=["plan", "report"])
def test_what_a_study_misspells_is_told_before_anything_runs(
    change: dict[str, object],
    told: str,
    words: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    row = {"experiment": "multitask", "phase": "multitask", "evaluation": "study_target"}
    row |= {key: str(value) for key, value in change.items() if key in row}
    part = {"asks": "?", "rows": {"one": row}, "sets": change.get("sets", ["study_12"])}
    content = {"root": "out", "registry": "experiments/parts/study.yaml", "parts": {"a": part}}
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(content))
    monkeypatch.chdir(tmp_path)
    assert cli.main(["study", "--config_path=mine.yaml", *words]) == 2
    assert re.search(told, capsys.readouterr().err)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.yaml"]


def own_configs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, registry: str) -> StudyConfig:
    """A copy of the package's files in which a study has a registry of its own."""
    configs = tmp_path / "configs"
    shutil.copytree(configs_folder(), configs)
    (configs / "experiments/parts/mine.yaml").write_text(registry)
    monkeypatch.setattr(runs, "configs_folder", lambda: configs)
    return StudyConfig("out", "experiments/parts/mine.yaml", {})


def test_registries_that_lean_on_others_and_on_defaults_serve_a_gpu_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = own_configs(tmp_path, monkeypatch, "base: study.yaml\n")
    found = load_registry(runs.configs_for("cuda", study, tmp_path / "one") / study.registry)
    assert found.root == "datasets/study_cuda"
    assert {dataset.make.image_size for dataset in found.datasets if dataset.make} == {128, 192}
    mine = [
        {"path": "ours/{task}", "tasks": ["OpenDrawer"], "make": {"episodes": "few", "seed": 1}},
        {"path": "by_hand", "tasks": ["OpenDrawer"]},
    ]
    file = tmp_path / "configs" / study.registry
    file.write_text(yaml.safe_dump({"episodes": {"few": 1}, "datasets": mine}))
    found = load_registry(runs.configs_for("cuda", study, tmp_path / "two") / study.registry)
    assert [(one.path, one.make and one.make.image_size) for one in found.datasets] == [
        ("cuda/ours/{task}", 2 * IMAGE_SIZE),
        ("by_hand", None),
    ], "what nobody records anew stays where it is"
    assert found.root == load_registry(file).root
    outside = StudyConfig("out", str(file.rename(tmp_path / "mine.yaml")), {})
    with pytest.raises(UserError, match="outside of"):
        runs.configs_for("cuda", outside, tmp_path / "three")
    assert not (tmp_path / "three").exists()


def test_costs_need_no_registry_that_says_everything(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    study = own_configs(tmp_path, monkeypatch, "base: study.yaml\n")
    assert costs(study, {}, tmp_path / "configs", 1, 0, 1, {}) == {}
    (tmp_path / "configs" / study.registry).write_text("root: mine\n")
    assert costs(study, {}, tmp_path / "configs", 1, 0, 1, {}) == {}
