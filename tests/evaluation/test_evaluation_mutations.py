"""Faults put into the evaluation on purpose: each must be found by the check that guards against it.

Every check is run twice: as it is, where it must pass, and with its mutation, where it must fail.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from evaluation_env import SlideEnv

from robocasa_lerobot import contract
from robocasa_lerobot.envs.tasks import registry
from robocasa_lerobot.evaluation.actors import actor
from robocasa_lerobot.evaluation.actors.actor import ChunkActor, ChunkReply, ChunkRequest, ChunkShape
from robocasa_lerobot.evaluation.actors.reference_policies import ZeroPolicy
from robocasa_lerobot.evaluation.config.evaluation import EvaluationConfig
from robocasa_lerobot.evaluation.config.loader import load_config
from robocasa_lerobot.evaluation.planning import run_header as resolve
from robocasa_lerobot.evaluation.planning import trials as plan
from robocasa_lerobot.evaluation.planning.trials import TrialSpec
from robocasa_lerobot.evaluation.run import engine, rollout, success
from robocasa_lerobot.evaluation.run.messages import Outcome

TASKS_CSV = Path(__file__).parents[3] / "shared/facts/tasks.csv"


def planned(*arguments: str) -> list[TrialSpec]:
    given = ["--policy=zero", "--env.tasks=OpenDrawer,CloseDrawer", "--trials=20", *arguments]
    return engine.prepare(load_config(EvaluationConfig, given)).plan


def slide(spec: TrialSpec, policy: Any = None) -> tuple[Outcome, SlideEnv]:
    env = SlideEnv("Slide", horizon=spec.horizon)
    return rollout.run_trial(env, policy or ZeroPolicy(), spec), env


def slide_plan() -> list[TrialSpec]:
    return plan.make_plan(["zero"], {"Slide": 7}, trials=20, seed=0, videos=0)


def check_success_is_the_goals() -> None:
    """A slider that nobody pushes is solved exactly where it starts behind the goal."""
    solved = []
    for spec in slide_plan():
        outcome, env = slide(spec)
        assert outcome.success is (env._place > 0.8)
        assert outcome.success is any(term.final for name, term in outcome.terms.items() if name == "very far")
        solved.append(outcome.success)
    assert len(set(solved)) == 2


def check_horizons_are_the_published_ones() -> None:
    """A failed trial has as many steps as the benchmark's table says, times the multiplier."""
    horizons = {"OpenDrawer": 750, "CloseDrawer": 450}  # steps at 20 Hz, RoboCasa 1.0.1
    for arguments, factor in (([], 1.0), (["--env.horizon_multiplier=1.5"], 1.5)):
        for spec in planned(*arguments):
            assert spec.horizon == round(factor * horizons[spec.task])
    failed = 0
    for spec in slide_plan():
        outcome, env = slide(spec)
        if not outcome.success:
            failed += 1
            assert outcome.steps == env._step == 7
    assert failed


def check_every_trial_has_its_own_scene() -> None:
    """No two trials of a task share a seed, a policy seed or a way; two policies share all of them."""
    for name in ("seed", "policy_seed"):
        for task in ("OpenDrawer", "CloseDrawer"):
            seeds = [getattr(spec, name) for spec in planned() if spec.task == task]
            assert len(set(seeds)) == len(seeds) == 20
    specs = slide_plan()
    assert len({slide(spec)[0].trajectory for spec in specs}) == len(specs)
    pair = planned("--policy=zero,random")
    by_label = {label: [s.seed for s in pair if s.label == label] for label in ("zero", "random")}
    assert by_label["zero"] == by_label["random"]


def check_the_policy_is_told_what_the_record_says() -> None:
    """Each chunk is asked for with the instruction of the env, which the record keeps."""
    told: list[str] = []

    def predict(request: ChunkRequest) -> ChunkReply:
        told.append(request.instruction)
        return ChunkReply(np.zeros((2, contract.ACTION_SIZE), np.float32), 0.0)

    policy = ChunkActor("label", ChunkShape(executed=2), predict)
    outcome, env = slide(next(spec for spec in slide_plan() if not slide(spec)[0].success), policy)
    assert env.task_description == outcome.instruction == "slide the block"
    assert told == ["slide the block"] * 4


def success_always_true(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(success.SuccessRule, "success_step", lambda self: 1)


def success_never_noticed(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(success.SuccessRule, "success_step", lambda self: None)


def horizon_off_by_one(patch: pytest.MonkeyPatch) -> None:
    original = resolve.plan_tasks

    def shorter(env: Any, first_sets: int | None = None) -> Any:
        tasks = original(env, first_sets)
        return resolve.PlannedTasks({t: h - 1 for t, h in tasks.horizons.items() if h}, tasks.sets, tasks.missing)

    patch.setattr(engine.resolve, "plan_tasks", shorter)


def env_ends_a_step_early(patch: pytest.MonkeyPatch) -> None:
    original = SlideEnv.__init__
    patch.setattr(SlideEnv, "__init__", lambda self, task, horizon: original(self, task, horizon=horizon - 1))


def seeds_reused(patch: pytest.MonkeyPatch) -> None:
    original = plan.trial_seed
    patch.setattr(plan, "trial_seed", lambda seed, task, trial, stream=0: original(seed, task, trial % 10, stream))


def seeds_of_the_policy(patch: pytest.MonkeyPatch) -> None:
    original = engine.make_plan

    def own_seeds(labels: Any, *rest: Any) -> list[TrialSpec]:
        out = []
        for number, (label, tasks) in enumerate(labels.items()):
            horizons, trials, seed, *others = rest
            out += original({label: tasks}, horizons, trials, seed + number, *others)
        return out

    patch.setattr(engine, "make_plan", own_seeds)


def instruction_dropped(patch: pytest.MonkeyPatch) -> None:
    original = actor.ChunkRequest
    patch.setattr(actor, "ChunkRequest", lambda label, seen, instruction, *rest: original(label, seen, "", *rest))


def instruction_not_recorded(patch: pytest.MonkeyPatch) -> None:
    original = rollout.Outcome
    patch.setattr(rollout, "Outcome", lambda **values: original(**{**values, "instruction": "do it"}))


Check, Mutation = Callable[[], None], Callable[[pytest.MonkeyPatch], None]
GUARDED: list[tuple[Check, Mutation]] = [
    (check_success_is_the_goals, success_always_true),
    (check_success_is_the_goals, success_never_noticed),
    (check_horizons_are_the_published_ones, horizon_off_by_one),
    (check_horizons_are_the_published_ones, env_ends_a_step_early),
    (check_every_trial_has_its_own_scene, seeds_reused),
    (check_every_trial_has_its_own_scene, seeds_of_the_policy),
    (check_the_policy_is_told_what_the_record_says, instruction_dropped),
    (check_the_policy_is_told_what_the_record_says, instruction_not_recorded),
]


@pytest.mark.parametrize(("check", "mutation"), GUARDED, ids=lambda function: function.__name__)
def test_a_mutation_is_found(check: Check, mutation: Mutation, monkeypatch: pytest.MonkeyPatch) -> None:
    check()
    mutation(monkeypatch)
    with pytest.raises(AssertionError):
        check()


def test_registered_horizons_are_the_benchmarks() -> None:
    if not TASKS_CSV.is_file():
        pytest.skip("the table of the benchmark's tasks is not beside this checkout")
    with TASKS_CSV.open(encoding="utf-8") as file:
        table = {row["task"]: int(row["horizon"]) for row in csv.DictReader(file) if row["horizon"]}
    known = [name for name in registry.task_names() if name in table]
    assert known
    assert {name: registry.get_task(name).horizon for name in known} == {name: table[name] for name in known}
