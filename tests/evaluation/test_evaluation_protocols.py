"""The protocols: their numbers, their task sets, and what is said where tasks are not there yet."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from atomic_version import atomic_tasks_only

from robocasa_lerobot.benchmark.tasks import published_task_sets
from robocasa_lerobot.data.registry.recipes import demonstrated_tasks
from robocasa_lerobot.envs.robots.camera_noise import CameraNoise
from robocasa_lerobot.envs.scene.reset_noise import InitialNoise
from robocasa_lerobot.envs.tasks.registry import task_names
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.config.evaluation import PERTURBATIONS, EvaluationConfig
from robocasa_lerobot.evaluation.config.loader import load_config
from robocasa_lerobot.evaluation.planning.run_header import (
    NothingRegisteredError,
    env_arguments,
    partial_sentence,
    plan_tasks,
)
from robocasa_lerobot.evaluation.planning.trials import Shard, running_order
from robocasa_lerobot.evaluation.run import engine

CONFIGS = Path(__file__).parents[2] / "configs/evaluations"
TARGET_SETS = {"atomic_seen": 18, "composite_seen": 16, "composite_unseen": 16}


def protocol(name: str, *arguments: str) -> EvaluationConfig:
    return load_config(EvaluationConfig, [f"--config_path={CONFIGS / name}.yaml", "--policy=zero", *arguments])


# Source of the numbers: the published benchmark (facts/benchmark.md and policies.md, sections 4 and 5).
@pytest.mark.parametrize(
    ("name", "sets", "split", "trials", "arguments"),
    [
        ("leaderboard", TARGET_SETS, "pretrain", 50, []),
        ("paper", TARGET_SETS, "pretrain", 30, []),
        ("foundation", TARGET_SETS, "target", 30, []),
        ("robustness", {"composite_seen": 16, "composite_unseen": 16}, "target", 30, []),
        (
            "lifelong",
            {"lifelong_phase1": 65, "lifelong_phase2": 20, "lifelong_phase3": 20, "lifelong_phase4": 20},
            "pretrain",
            30,
            ["--policy.lifelong_phase=4"],
        ),
    ],
)
def test_numbers_of_the_protocols(
    name: str, sets: dict[str, int], split: str, trials: int, arguments: list[str]
) -> None:
    config = protocol(name, *arguments)
    assert (config.env.split, config.trials, config.env.horizon_multiplier) == (split, trials, 1.0)
    assert (config.success.rule, config.env.horizon, config.protocol) == ("any_step", None, name)
    known = published_task_sets()
    assert {task_set: len(known[task_set]) for task_set in config.env.task_sets} == sets
    if {task for task_set in sets for task in known[task_set]} <= set(task_names()):
        assert len(plan_tasks(config.env).horizons) == sum(sets.values())
    else:
        config.env.allow_missing_tasks = False
        with pytest.raises(UserError, match=r"not registered in this version: |this version has none"):
            plan_tasks(config.env)


def test_missing_tasks_are_left_out_and_listed_unless_all_are_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    registered = atomic_tasks_only(monkeypatch)
    config = protocol("leaderboard", "--env.allow_missing_tasks=false")
    with pytest.raises(UserError) as error:
        plan_tasks(config.env)
    for part in ("WashLettuce", "KettleBoiling", "--env.allow_missing_tasks=true", "--env.tasks=Close"):
        assert part in str(error.value)
    there = [t for name in config.env.task_sets for t in published_task_sets()[name] if t in registered]
    consented = engine.prepare(protocol("leaderboard"))
    named = engine.prepare(protocol("leaderboard", f"--env.tasks={','.join(there)}"))
    for evaluation in (consented, named):
        header = evaluation.header
        assert header.tasks == there
        assert len(header.missing_tasks) + len(there) == 50
        assert not set(header.missing_tasks) & set(there)
        assert sorted(t for tasks in header.task_sets.values() for t in tasks) == sorted(there)
        assert len(evaluation.plan) == 50 * len(there)
        missing = {name: len(tasks) for name, tasks in header.missing_by_set.items()}
        assert {n: missing.get(n, 0) + len(header.task_sets[n]) for n in TARGET_SETS} == TARGET_SETS
        said = str(partial_sentence(header.task_sets, header.missing_tasks, header.missing_by_set))
        assert "partial: without 16 of 16 tasks of composite_seen" in said
        assert said.endswith("; averages are over the tasks that were run."), "as the headline gives one"
    outside = engine.prepare(protocol("leaderboard", "--env.tasks=CloseDrawer")).header
    assert (outside.tasks, len(outside.missing_tasks)) == (["CloseDrawer"], 50)
    with pytest.raises(UserError, match="Did you mean 'atomic_seen'"):
        engine.prepare(protocol("leaderboard", "--env.task_sets=atomic_sen"))
    with pytest.raises(NothingRegisteredError, match="has none of the tasks of composite_seen"):
        engine.prepare(protocol("leaderboard", "--env.task_sets=composite_seen"))
    # A task of the benchmark that is not there yet is missing; one that the benchmark does not have is a mistake.
    some = engine.prepare(protocol("leaderboard", "--env.task_sets=", "--env.tasks=OpenDrawer,WashLettuce")).header
    assert (some.tasks, some.missing_tasks, some.task_sets) == (["OpenDrawer"], ["WashLettuce"], {})
    with pytest.raises(UserError, match="Did you mean 'OpenDrawer'"):
        engine.prepare(protocol("leaderboard", "--env.tasks=OpenDrawr"))


def test_a_lifelong_phase_needs_no_tasks_of_later_phases() -> None:
    evaluation = engine.prepare(protocol("lifelong", "--policy.lifelong_phase=1"))
    assert len(evaluation.header.tasks) == 65
    assert evaluation.header.missing_tasks == []
    assert list(evaluation.header.task_sets) == ["lifelong_phase1"]


def test_task_sets_of_a_registry_file(tmp_path: Path) -> None:
    file = tmp_path / "own.yaml"
    file.write_text(
        "task_sets: {lifelong_phase1: [OpenDrawer, CloseDrawer], lifelong_phase2: [TurnOnStove], drawers: [OpenDrawer]}"
    )
    phase2 = protocol("lifelong", "--policy.lifelong_phase=2", f"--env.registry={file}")
    header = engine.prepare(phase2).header
    # Both sets are the file's own, and whole, although the benchmark has others under their names.
    assert header.task_sets == {"lifelong_phase1": ["OpenDrawer", "CloseDrawer"], "lifelong_phase2": ["TurnOnStove"]}
    assert header.missing_by_set == {}
    assert header.registry == str(file)
    kitchens = Path(__file__).parents[2] / "configs/experiments/parts/kitchens.yaml"  # the benchmark's sets, restricted
    pretraining = protocol("leaderboard", "--env.task_sets=atomic_seen,pretrain300", f"--env.registry={kitchens}")
    header = engine.prepare(pretraining).header
    assert header.missing_by_set == {}
    assert set(header.task_sets["pretrain300"]) == set(published_task_sets()["pretrain300"]) <= demonstrated_tasks()
    both = protocol("leaderboard", "--env.task_sets=drawers,atomic_seen", f"--env.registry={file}")
    header = engine.prepare(both).header
    assert (header.task_sets["drawers"], len(header.task_sets["atomic_seen"])) == (["OpenDrawer"], 18)
    assert header.missing_by_set == {}
    with pytest.raises(UserError, match="Did you mean 'drawers'"):
        engine.prepare(protocol("leaderboard", "--env.task_sets=drawrs", f"--env.registry={file}"))
    # Where the file of a set lies does not decide how a trial goes.
    assert header.settings == engine.prepare(protocol("leaderboard", "--env.task_sets=atomic_seen")).header.settings


def test_lifelong_policies_run_the_tasks_of_their_phases(monkeypatch: pytest.MonkeyPatch) -> None:
    sets = {"first": ("OpenDrawer", "CloseDrawer"), "second": ("PickPlaceCounterToSink",)}
    monkeypatch.setattr("robocasa_lerobot.benchmark.tasks.published_task_sets", lambda: sets)
    given = ["--env.task_sets=first,second", "--lifelong", "--policy=zero,random", "--trials=1"]
    evaluation = engine.prepare(load_config(EvaluationConfig, [*given, "--policy.lifelong_phase=1,2"]))
    assert [(s.label, s.task) for s in evaluation.plan] == [
        ("zero", "OpenDrawer"),
        ("zero", "CloseDrawer"),
        ("random", "OpenDrawer"),
        ("random", "CloseDrawer"),
        ("random", "PickPlaceCounterToSink"),
    ]
    assert [p.lifelong_phase for p in evaluation.header.policies.values()] == [1, 2]
    with pytest.raises(UserError, match="found 3, but env"):
        engine.prepare(load_config(EvaluationConfig, [*given, "--policy.lifelong_phase=1,3"]))
    with pytest.raises(UserError, match="lifelong needs"):
        load_config(EvaluationConfig, given)


def test_perturbations_share_seeds_and_have_their_sigmas_in_the_header() -> None:
    # Each another one than its default, and than the others.
    camera = {"camera_position_m": 0.2, "camera_angle_deg": 7.0, "wrist_position_m": 0.01, "wrist_angle_deg": 1.5}
    joint, base = {"joint_rad": 0.3}, {"base_position_m": 0.4, "base_yaw_deg": 20.0}
    settings = [f"--perturbation.{name}={value}" for name, value in {**camera, **joint, **base}.items()]
    config = protocol("robustness", "--env.task_sets=[]", "--env.tasks=OpenDrawer", "--trials=3", *settings)
    evaluation = engine.prepare(config)
    assert len(evaluation.plan) == 3 * len(PERTURBATIONS)
    by_trial: dict[int, set[tuple[int, int]]] = {}
    for spec in evaluation.plan:
        by_trial.setdefault(spec.trial, set()).add((spec.seed, spec.policy_seed))
    assert [len(seeds) for seeds in by_trial.values()] == [1, 1, 1]
    sigmas = {"camera": camera, "joint": joint, "base": base}
    assert {name: evaluation.header.perturbations[name] for name in sigmas} == sigmas
    arguments: dict[str, dict[str, Any]] = {n: env_arguments(n, config.perturbation) for n in PERTURBATIONS}
    assert arguments["none"] == {}
    assert arguments["language"] == {"novel_language": True}
    assert arguments["joint"] == {"initial_noise": InitialNoise(arm_rad=0.3)}
    assert arguments["base"] == {"initial_noise": InitialNoise(base_position_m=0.4, base_yaw_deg=20.0)}
    noise = CameraNoise(scene_position_m=0.2, scene_angle_deg=7.0, wrist_position_m=0.01, wrist_angle_deg=1.5)
    assert arguments["camera"] == {"camera_noise": noise}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--perturbation.names=camra"], "Did you mean 'camera'"),
        (["--perturbation.joint_rad=-1"], "perturbation.joint_rad: found -1"),
        (["--success.rule=holds"], "Did you mean 'hold'"),
        (["--success.hold_steps=5"], "no effect with success.rule=any_step"),
        (["--policy.demo_fraction=2"], "expected shares between 0 and 1"),
        (["--policy.training_data=a,b"], "2 policy.training_data for 1 policy.path"),
        (["--policy.placement=server"], "Did you mean 'servers'"),
        (["--policy.batch_width=-1"], "policy.batch_width: found -1"),
    ],
)
def test_settings_out_of_range_are_explained(arguments: list[str], message: str) -> None:
    with pytest.raises(UserError, match=message):
        protocol("quick", *arguments)


def test_shards_part_the_plan_and_share_every_task() -> None:
    plan = engine.prepare(protocol("quick")).plan
    shards = [Shard(i, 4).of(plan) for i in (1, 2, 3, 4)]
    assert sorted(s.key for shard in shards for s in shard) == sorted(s.key for s in plan)
    for shard in shards:
        assert {s.task for s in shard} == {s.task for s in plan}
    assert Shard.parse("2/3") == Shard(2, 3)
    for text in ("0/3", "4/3", "1", "a/b", "1/0", "-1/2"):
        with pytest.raises(UserError, match="expected I/N"):
            Shard.parse(text)


def test_long_trials_begin_first() -> None:
    order = running_order(engine.prepare(protocol("quick", "--policy=zero,random")).plan)
    for label in ("zero", "random"):
        horizons = [s.horizon or 0 for s in order if s.label == label]
        assert horizons == sorted(horizons, reverse=True)
    assert [s.label for s in order] == ["zero"] * 30 + ["random"] * 30
