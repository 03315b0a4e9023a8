"""Tasks of several stages: each is done before the next, again where it failed or came undone, and recorded."""

from __future__ import annotations

import contextlib
import itertools
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest
from task_selection import every_task

from robocasa_lerobot.demos import stages as module
from robocasa_lerobot.demos.hdf5 import write_part
from robocasa_lerobot.demos.recorder import record_episode
from robocasa_lerobot.demos.skills import SKILLS, SkillError
from robocasa_lerobot.demos.stages import (
    ATTEMPTS,
    HELD_STEPS,
    LAST_PATIENCE_STEPS,
    PATIENCE_STEPS,
    StageLog,
    carry_out,
)
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.predicates import AllOf, Goal, GripperFar, Not, ObjectInBasin, ObjectOn, StateIs
from robocasa_lerobot.envs.predicates.logic import Term
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.tasks.conditions import stage_condition, without_gripper
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.envs.tasks.task import Stage, Task
from robocasa_lerobot.errors import UserError

IN_BASIN, WATER = ObjectInBasin("obj", "sink"), StateIs("sink", "water_on")


def thaw(runs: bool) -> Task:
    """Two stages in the words of atomic tasks; its water may run from the beginning."""
    sink = get_task("PickPlaceCounterToSink")
    return Task(
        name="ThawInSink",
        summary="The object lies in the sink, and water runs.",
        fixtures=sink.fixtures,
        robot_start=sink.robot_start,
        objects=sink.objects,
        initial=(Water("sink", runs),),
        goal=AllOf(IN_BASIN, WATER),
        stages=(Stage("levers", "on", "sink", part="handle"), Stage("pick_place", "place", "sink", object="obj")),
        instruction="Put the {obj} into the sink under running water.",
    )


@pytest.mark.costly
def test_two_stages_are_solved_one_after_the_other_and_recorded(tmp_path: Path) -> None:
    solved = 0
    for split, seed in itertools.product(("target", "pretrain"), range(3)):
        env = KitchenEnv(thaw(runs=False), split=split, cameras=(), terminate_on_success=False)
        recording = record_episode(env, seed)
        env.close()
        if not recording.success:
            continue
        solved += 1
        rows = recording.ep_meta["stages"]
        assert [(row["verb"], row["done"], row["skipped"]) for row in rows] == [
            ("on", True, False),
            ("place", True, False),
        ]
        assert set(recording.stages) == {0, 1}
        assert recording.stages[0] == 0
        water, basin = (recording.success_terms[:, recording.term_names.index(t.name)] for t in (WATER, IN_BASIN))
        first = int(np.flatnonzero(recording.stages == 1)[0])
        assert not water[0]
        assert water[first]
        assert not basin[: first + 1].any()
        write_part(tmp_path / "one.hdf5", recording)
        with h5py.File(tmp_path / "one.hdf5") as file:
            assert file["demo/stage"][:].tolist() == recording.stages.tolist()
            assert file["demo/success_terms"][:].tolist() == recording.success_terms.tolist()
            assert json.loads(file["demo/success_terms"].attrs["names"]) == [IN_BASIN.name, WATER.name]
    assert solved >= 4


def test_a_stage_that_is_done_already_is_left_out() -> None:
    env = KitchenEnv(thaw(runs=True), cameras=(), terminate_on_success=False)
    recordings = [record_episode(env, seed) for seed in range(3)]
    env.close()
    assert any(recording.success for recording in recordings)
    for recording in recordings:
        assert recording.stages[0] == 1
        assert recording.ep_meta["stages"][0] == {
            "text": "turn on the faucet of the sink", "skill": "levers", "verb": "on", "target": "sink", "object": "",
            "part": "handle", "to": "",
            "attempts": 0, "done": True, "skipped": True, "reason": "",
        }  # fmt: skip


@dataclass
class Made:
    """An env of flags that skills set: what is done is known without physics."""

    declaration: Any
    flags: dict[str, bool] = field(default_factory=dict)
    scene: Any = None

    @property
    def data(self) -> dict[str, bool]:
        return self.flags


class Flag(Term):
    def __init__(self, key: str) -> None:
        self.key = key

    @property
    def name(self) -> str:
        return self.key

    def holds(self, scene: Any, data: Any) -> bool:
        return bool(data.get(self.key))


Skill = Callable[[Made, Stage], Iterator[np.ndarray]]


def made(monkeypatch: pytest.MonkeyPatch, skills: dict[str, Skill]) -> Made:
    monkeypatch.setattr(module, "SKILLS", {("made", name): skill for name, skill in skills.items()})
    monkeypatch.setattr(module, "fold_arm", lambda env: iter(()))  # there is no arm
    monkeypatch.setattr(module, "move_torso", lambda env, wanted_m, gripper: iter(()))  # nor a torso
    stages = tuple(Stage("made", name, "", until=Flag(name)) for name in skills)
    goal: Goal = AllOf(*(Flag(name) for name in skills))
    return Made(SimpleNamespace(name="made", stages=stages, goal=goal))


def does(*effects: dict[str, bool] | SkillError) -> Skill:
    """A skill of one step, with an effect for each time that it is called."""
    left = list(effects)

    def skill(env: Made, stage: Stage) -> Iterator[np.ndarray]:
        effect = left.pop(0)
        yield np.zeros(12)
        if isinstance(effect, SkillError):
            raise effect
        env.flags |= effect

    return skill


def test_a_stage_that_failed_is_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    env = made(monkeypatch, {"a": does(SkillError("slipped"), {}, {"a": True}), "b": does({"b": True})})
    log = StageLog()
    steps = list(carry_out(env, log))
    assert [(o.attempts, o.done, o.reason) for o in log.outcomes] == [(3, True, ""), (1, True, "")]
    assert len(steps) == 4 + 2 * PATIENCE_STEPS + HELD_STEPS


def test_what_comes_undone_while_the_arm_is_still_is_done_again(monkeypatch: pytest.MonkeyPatch) -> None:
    env = made(monkeypatch, {"a": does(*[{"a": True}] * ATTEMPTS), "b": does({"b": True})})
    log, still = StageLog(), 0
    for _ in carry_out(env, log):
        still = still + 1 if env.flags.get("a") and env.flags.get("b") else 0
        if still == HELD_STEPS // 2 and log.outcomes[0].attempts < ATTEMPTS:
            env.flags["a"] = False  # it slides off
    assert env.flags["a"]
    assert [(o.attempts, o.done) for o in log.outcomes] == [(ATTEMPTS, True), (1, True)]


def test_a_single_stage_that_comes_undone_is_done_again(monkeypatch: pytest.MonkeyPatch) -> None:
    env = made(monkeypatch, {"a": does({"a": True}, {"a": True})})
    monkeypatch.setattr(env, "initial_noise", None, raising=False)
    log, undone = StageLog(), False
    for _ in carry_out(env, log):
        if env.flags.get("a") and not undone:
            env.flags["a"], undone = False, True
    assert env.flags["a"]
    assert [(o.attempts, o.done) for o in log.outcomes] == [(2, True)]


def test_what_time_does_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    env = made(monkeypatch, {"a": does({"a": True}), "b": does({"b": True})})
    env.declaration = SimpleNamespace(
        name="made", stages=env.declaration.stages, goal=AllOf(Flag("a"), Flag("b"), Flag("warm"))
    )
    for number, _ in enumerate(carry_out(env, StageLog())):
        env.flags["warm"] = number > LAST_PATIENCE_STEPS // 2
    assert env.flags["warm"]


def test_what_has_come_undone_comes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    env = made(monkeypatch, {"a": does({"a": True}, {"a": True}), "b": does({"a": False}, {"b": True})})
    log, order = StageLog(), []
    for _ in carry_out(env, log):
        if not order or order[-1] != log.current:
            order.append(log.current)
    assert order == [0, 1, 0, 1]
    assert [o.attempts for o in log.outcomes] == [2, 2]


def test_a_stage_that_is_done_by_what_does_not_hold_is_not_the_one_that_is_lacking(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    env = made(monkeypatch, {"a": does({}), "b": does({"b": True})})
    stages = (Stage("made", "a", "", until=Not(Flag("a"))), Stage("made", "b", "", until=Flag("b")))
    env.declaration = SimpleNamespace(name="made", stages=stages, goal=AllOf(Not(Flag("a")), Flag("c")))
    log = StageLog()
    with pytest.raises(SkillError, match="all stages are done, but the goal does not hold; false are `c`"):
        list(carry_out(env, log))
    assert [(o.attempts, o.done) for o in log.outcomes] == [(0, True), (1, True)]


class ObjectFlag(Flag):
    """A flag that tells of an object."""

    def __init__(self, key: str, object: str) -> None:
        super().__init__(key)
        self.object = object


def test_what_was_put_down_and_moved_since_comes_again_though_the_goal_has_another_word_for_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A pan on a lit burner is asked for by one term; that it stands there is a stage's, that it is lit another's."""
    env = made(monkeypatch, {"place": does({"there": True, "pan": True}), "on": does({"on": True, "there": False})})
    again = does({"there": True, "pan": True}, {"there": True, "pan": True, "lit": True})
    monkeypatch.setitem(module.SKILLS, ("made", "place"), again)
    stages = (Stage("made", "place", "", object="pan", until=Flag("there")), Stage("made", "on", "", until=Flag("on")))
    env.declaration = SimpleNamespace(name="made", stages=stages, goal=AllOf(ObjectFlag("lit", "pan"), Flag("on")))
    log = StageLog()
    list(carry_out(env, log))
    assert env.flags["lit"]
    assert [(o.attempts, o.done) for o in log.outcomes] == [(2, True), (1, True)]


class HandAway(GripperFar):
    """A flag for where the hand is."""

    def holds(self, scene: Any, data: Any) -> bool:
        return bool(data.get("away"))


def test_a_hand_that_is_near_what_it_put_down_before_goes_away_in_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """A knife comes to lie beside the butter, which is put down already, and from which the hand is to be far."""
    near = does({"knife": True, "away": False})
    env = made(monkeypatch, {"butter": does({"butter": True, "away": True}), "knife": near})

    def fold(env: Made) -> Iterator[np.ndarray]:
        yield np.zeros(12)
        env.flags["away"] = True

    monkeypatch.setattr(module, "fold_arm", fold)
    butter = Stage("made", "butter", "", until=AllOf(Flag("butter"), HandAway("butter")))
    stages = (butter, Stage("made", "knife", "", until=Flag("knife")))
    goal = AllOf(Flag("butter"), Flag("knife"), HandAway("butter"))
    env.declaration = SimpleNamespace(name="made", stages=stages, goal=goal)
    log = StageLog()
    list(carry_out(env, log))
    assert env.flags["away"]
    assert [(o.attempts, o.done) for o in log.outcomes] == [(1, True), (1, True)]


class InBowl(ObjectOn):
    """A flag for what lies in the bowl from the start."""

    def holds(self, scene: Any, data: Any) -> bool:
        return bool(data.get("in_bowl"))


@pytest.mark.parametrize("tries", [2, ATTEMPTS + 1])
def test_what_was_knocked_out_of_its_bowl_is_put_back(monkeypatch: pytest.MonkeyPatch, tries: int) -> None:
    env = made(monkeypatch, {"a": does({"a": True}), "b": does({"b": True, "in_bowl": False})})
    asked: list[Stage] = []

    def put_back(env: Made, stage: Stage) -> Iterator[np.ndarray]:
        asked.append(stage)
        yield np.zeros(12)
        env.flags["in_bowl"] = len(asked) == tries

    monkeypatch.setitem(module.SKILLS, ("pick_place", "place"), put_back)
    env.flags["in_bowl"] = True
    goal = AllOf(Flag("a"), Flag("b"), InBowl("food", "bowl"))
    env.declaration = SimpleNamespace(name="made", stages=env.declaration.stages, goal=goal)
    log = StageLog()
    gives_up = pytest.raises(SkillError, match="it is not done") if tries > ATTEMPTS else contextlib.nullcontext()
    with gives_up:
        list(carry_out(env, log))
    assert len(asked) == min(tries, ATTEMPTS)
    assert {(stage.verb, stage.target, stage.object) for stage in asked} == {("place", "bowl", "food")}
    assert env.flags["in_bowl"] == (tries <= ATTEMPTS)
    assert [(o.attempts, o.done) for o in log.outcomes] == [(1, True), (1, True)]


def test_it_gives_up_with_the_skills_own_words(monkeypatch: pytest.MonkeyPatch) -> None:
    env = made(monkeypatch, {"a": does(*[SkillError("the lid is stuck")] * ATTEMPTS), "b": does({"b": True})})
    log = StageLog()
    with pytest.raises(SkillError, match=r"stage 1 \(made a\): the lid is stuck"):
        list(carry_out(env, log))
    assert [(o.attempts, o.done) for o in log.outcomes] == [(ATTEMPTS, False), (0, False)]


def test_it_says_why_a_stage_that_was_done_is_to_be_done_again(monkeypatch: pytest.MonkeyPatch) -> None:
    def undoes(env: Made, stage: Stage) -> Iterator[np.ndarray]:
        env.flags["a"] = False
        yield np.zeros(12)
        raise SkillError("it fell")

    env = made(monkeypatch, {"a": does(*[{"a": True}] * ATTEMPTS), "b": undoes})
    with pytest.raises(
        SkillError, match=rf"stage 1 \(made a\): it came undone after {ATTEMPTS} attempts, when it fell"
    ):
        list(carry_out(env, StageLog()))


@pytest.mark.parametrize("name", every_task())
def test_every_stage_of_every_task_has_a_condition(name: str) -> None:
    task = get_task(name)
    task = task.bound(build_scene(task, "target", 0))
    for stage in task.stages:
        assert isinstance(stage_condition(task, stage), Goal)
    if len(task.stages) == 1:
        assert stage_condition(task, task.stages[0]) is task.goal


def test_conditions_of_verbs_are_those_of_goals() -> None:
    (open_,), place = get_task("OpenFridge").stages, Stage("pick_place", "place", "plate", object="obj")
    task = SimpleNamespace(name="t", stages=(open_, place), fixtures=(), goal=StateIs("fxtr", "on"))
    assert stage_condition(task, open_) == get_task("OpenFridge").goal  # type: ignore[arg-type]
    on, away = stage_condition(task, place).parts  # type: ignore[arg-type]
    assert (on, away) == (ObjectOn("obj", "plate"), GripperFar("obj"))
    assert without_gripper(stage_condition(task, place)).parts == (on,)  # type: ignore[arg-type]
    press = Stage("buttons", "press", "fxtr")
    with pytest.raises(UserError, match="until"):
        stage_condition(SimpleNamespace(name="t", stages=(open_, press)), press)  # type: ignore[arg-type]


def test_verbs_with_a_condition_of_their_own_are_verbs_of_skills() -> None:
    from robocasa_lerobot.envs.tasks import conditions

    assert set(conditions._BY_VERB) <= set(SKILLS)
