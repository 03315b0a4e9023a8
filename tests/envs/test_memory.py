"""Goals with memory: counted once in each control step, carried by every state, and without weight in the physics."""

from __future__ import annotations

import functools
from contextlib import closing
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import cast

import mujoco
import numpy as np
import pytest
from goal_states import evaluate, hold, put_object, write
from memory_tasks import WASHED, by_the_sink
from numpy.typing import NDArray

from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.predicates import (
    AllOf,
    ForEach,
    Goal,
    Grasped,
    GripperTouches,
    MovedSince,
    Never,
    Not,
    ObjectUpright,
    Once,
    StateIs,
    StepsWhile,
    Strokes,
    UnderWater,
    When,
    parts_with_memory,
)
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.scene.memory import PREFIX
from robocasa_lerobot.envs.scene.scene import Scene
from robocasa_lerobot.envs.state import KitchenState
from robocasa_lerobot.envs.vector.kitchens import make_vector_env
from robocasa_lerobot.errors import UserError

IDLE = np.zeros(12, np.float32)
RUNS = StateIs("sink", "water_on")
EVERY: tuple[Goal, ...] = (
    WASHED,
    StepsWhile(AllOf(RUNS, StateIs("sink", "left")), 3, consecutive=True),
    Once(AllOf(RUNS, StateIs("sink", "right"))),
    Never(Grasped("obj")),
    MovedSince("obj", "step", by_m=0.001),
    MovedSince("obj", "reset", by_rad=0.3),
    Strokes("sponge", "obj"),
)


@functools.cache
def kitchen(goal: Goal, runs: bool) -> KitchenEnv:
    return KitchenEnv(by_the_sink(goal, runs=runs), cameras=(), terminate_on_success=False)


def make(goal: Goal, seed: int = 0, *, runs: bool = False) -> KitchenEnv:
    """An env at the beginning of an episode."""
    env = kitchen(goal, runs)
    env.reset(seed=seed)
    return env


def water(env: KitchenEnv, on: bool) -> None:
    env.scene.fixture("sink", Sink).set_water(env.data, on)


def steps(env: KitchenEnv, count: int, on: bool | None = None) -> list[bool]:
    """Whether the goal holds after each of some idle steps, in which water runs or not."""
    found = []
    for _ in range(count):
        if on is not None:
            water(env, on)
        found.append(bool(env.step(IDLE)[-1]["success"]))
    return found


def test_steps_are_counted_in_total() -> None:
    env = make(StepsWhile(RUNS, 5))
    assert not any(steps(env, 8, on=False))
    assert not any(steps(env, 3, on=True))
    assert not any(steps(env, 3, on=False))
    assert steps(env, 2, on=True) == [False, True]
    assert all(steps(env, 3, on=False)), "what was counted remains"


def test_steps_are_counted_without_a_break() -> None:
    env = make(StepsWhile(RUNS, 5, consecutive=True))
    assert not any(steps(env, 4, on=True) + steps(env, 1, on=False) + steps(env, 4, on=True))
    assert steps(env, 1, on=True) == [True]
    assert all(steps(env, 3, on=False))


def test_looking_at_the_goal_does_not_count() -> None:
    env = make(StepsWhile(RUNS, 5), runs=True)
    before = env.scene.memory.read(env.data, env.declaration.goal.name)
    for _ in range(20):
        assert not env.declaration.goal.evaluate(env.scene, env.data, {})
    assert before == env.scene.memory.read(env.data, env.declaration.goal.name) == 0.0  # nor did settling
    steps(env, 2)
    assert env.scene.memory.read(env.data, env.declaration.goal.name) == 2.0


def test_a_memory_in_goal_and_stage_is_one_and_counts_once() -> None:
    goal = AllOf(StepsWhile(RUNS, 5), Not(Once(StepsWhile(RUNS, 5))))
    task = by_the_sink(goal, runs=True)
    (stage,) = task.stages
    task = replace(task, stages=(replace(stage, until=StepsWhile(RUNS, 5)),))
    env = KitchenEnv(task, cameras=(), terminate_on_success=False)
    env.reset(seed=0)
    names = [part.name for part in env.scene.remembering]
    assert names == ["sink_water_on_for_5_steps", "once_sink_water_on_for_5_steps"]
    steps(env, 3)
    assert env.scene.memory.read(env.data, "sink_water_on_for_5_steps") == 3.0


def test_once_and_never() -> None:
    env = make(AllOf(Once(RUNS), Never(StateIs("sink", "left"))))
    assert env.get_state()
    _, *_, info = env.step(IDLE)
    assert info["success_terms"] == {"once_sink_water_on": False, "never_sink_left": True}
    assert steps(env, 2, on=True) == [True, True]
    assert all(steps(env, 2, on=False)), "it has been on"
    env.scene.fixture("sink", Appliance).set_position(env.data, "spout", -1.0)
    assert steps(env, 1) == [False]
    env.scene.fixture("sink", Appliance).set_position(env.data, "spout", 0.0)
    assert not any(steps(env, 3)), "what has happened cannot be made good"
    env.reset(seed=0)
    assert steps(env, 1, on=True) == [True]


def test_moved_in_the_last_step() -> None:
    env = make(MovedSince("obj", "step", by_m=0.01))
    steps(env, 10)
    name = env.declaration.goal.name
    middle = env.data.body("obj").xpos.copy()
    for distance, moved in ((0.012, True), (0.008, False), (0.012, True)):
        middle += [0.0, 0.0, distance]
        put_object(env.scene, env.data, "obj", middle)
        evaluate(env.scene, env.data)
        env.scene.after_control_step(env.data)
        assert env.declaration.goal.evaluate(env.scene, env.data, {}) == moved
    env.scene.after_control_step(env.data)
    assert env.scene.memory.read(env.data, name)[-1] == 0.0, "it lies still"


@pytest.mark.parametrize(
    ("goal", "move", "turn", "held"),
    [
        (MovedSince("obj", "reset", by_m=0.05), (0.06, 0.0, 0.0), 0.0, True),
        (MovedSince("obj", "reset", by_m=0.05), (0.04, 0.0, 0.0), 3.0, False),
        (MovedSince("obj", "reset", by_m=0.05, across=True), (0.03, 0.03, 0.5), 0.0, False),
        (MovedSince("obj", "reset", by_m=0.05), (0.03, 0.03, 0.03), 0.0, True),
        (MovedSince("obj", "reset", by_rad=0.3), (1.0, 0.0, 0.0), 0.29, False),
        (MovedSince("obj", "reset", by_rad=0.3), (0.0, 0.0, 0.0), 0.31, True),
        (MovedSince("obj", "reset", by_rad=0.3), (0.0, 0.0, 0.0), -0.31, True),
    ],
)
def test_moved_since_the_reset(goal: MovedSince, move: tuple[float, ...], turn: float, held: bool) -> None:
    env = make(goal)
    steps(env, 3)
    free = env.data.joint("obj_joint0")
    free.qpos[:3] += move
    about_x = np.array([np.cos(turn / 2), np.sin(turn / 2), 0.0, 0.0])
    mujoco.mju_mulQuat(free.qpos[3:], about_x, free.qpos[3:].copy())
    assert (hold(goal, env.scene, env.data) is None) == held


@pytest.mark.parametrize(("axis", "held"), [(0, False), (1, False), (2, True)])
def test_tipping_is_no_turn_about_the_vertical(axis: int, held: bool) -> None:
    goal = MovedSince("obj", "reset", by_rad=0.3, about_vertical=True)
    env = make(goal)
    steps(env, 3)
    free = env.data.joint("obj_joint0")
    turn = np.zeros(4)
    turn[[0, 1 + axis]] = np.cos(0.2), np.sin(0.2)  # 0.4 rad
    mujoco.mju_mulQuat(free.qpos[3:], turn, free.qpos[3:].copy())
    assert (hold(goal, env.scene, env.data) is None) == held


def rub(env: KitchenEnv, places: list[tuple[float, float]], *, held: bool = True, touching: bool = True) -> bool:
    """Hold the sponge in the gripper and rub it over the lettuce, at places (metres) in the frame of the lettuce."""
    scene, data, goal = env.scene, env.data, env.declaration.goal
    write(Grasped("sponge"), scene, data)
    if not held:
        for joint in scene.robot.names.finger_joints:
            data.joint(joint).qpos[0] = 0.0  # a closed fist in the sponge
            data.joint("sponge_joint0").qpos[0] += 0.10
    evaluate(scene, data)
    sponge = data.body("sponge").xpos.copy()
    data.joint("obj_joint0").qpos[3:] = [1.0, 0.0, 0.0, 0.0]
    for x, y in places:
        data.joint("obj_joint0").qpos[:3] = sponge - [x, y, 0.0 if touching else 0.5]
        evaluate(scene, data)
        scene.after_control_step(data)
    return goal.evaluate(scene, data, {})


LINE = [(x, 0.0) for x in (-0.052, -0.026, 0.0, 0.026, 0.052)]


def test_strokes_that_are_apart_and_long_enough() -> None:
    assert rub(make(Strokes("sponge", "obj")), LINE)
    assert rub(make(Strokes("sponge", "obj")), [(-0.03, -0.04), (0.03, -0.04), (-0.03, 0.04), (0.0, 0.0), (0.03, 0.03)])
    assert rub(make(Strokes("sponge", "obj")), [(0.021 * n - 0.052, 0.0) for n in range(6)]), (
        "a sixth place reaches the span"
    )


@pytest.mark.parametrize(
    ("places", "held", "touching"),
    [
        (LINE[:4], True, True),  # too few
        ([*LINE[:4], *LINE[:4]], True, True),  # the same again
        ([(0.8 * x, 0.0) for x, _ in LINE], True, True),  # too short
        ([(x, 0.0) for x in (-0.052, -0.034, -0.016, 0.002, 0.052)], True, True),  # two of them too near to others
        (LINE, False, True),
        (LINE, True, False),
    ],
)
def test_strokes_that_do_not_count(places: list[tuple[float, float]], held: bool, touching: bool) -> None:
    assert not rub(make(Strokes("sponge", "obj")), places, held=held, touching=touching)


def test_a_surface_that_goes_along_is_not_rubbed() -> None:
    """Where the sponge is on the board counts, not where in the room."""
    env = make(Strokes("sponge", "obj"))
    rub(env, LINE[:1])
    for _ in range(10):
        for name in ("sponge", "obj"):
            env.data.joint(f"{name}_joint0").qpos[0] += 0.003
        evaluate(env.scene, env.data)
        env.scene.after_control_step(env.data)
    assert env.scene.memory.read(env.data, env.declaration.goal.name)[0] == 1.0


@pytest.mark.parametrize("goal", EVERY, ids=lambda goal: goal.name)
def test_the_written_state_counts_and_the_first_one_only_where_nothing_must_happen(goal: Goal) -> None:
    env = make(goal)
    assert (hold(goal, env.scene, env.data) is None) == isinstance(goal, Never)
    write(goal, env.scene, env.data)
    assert hold(goal, env.scene, env.data) is None
    env.reset(seed=0)
    assert (hold(goal, env.scene, env.data) is None) == isinstance(goal, Never)


def wander(seed: int, count: int = 30) -> list[NDArray[np.float32]]:
    rng = np.random.default_rng(seed)
    direction = rng.uniform(-1, 1, 12)
    return [np.clip(direction + 0.3 * rng.normal(size=12), -1, 1).astype(np.float32) for _ in range(count)]


def test_a_state_carries_what_is_remembered() -> None:
    env = make(AllOf(*EVERY), runs=True)
    for action in wander(0, 10):
        env.step(action)
    state = env.get_state()
    terms, numbers = [], []
    for action in wander(1):
        terms.append(env.step(action)[-1]["success_terms"])
        numbers.append(env.data.qpos.copy())
    assert len({tuple(row.values()) for row in terms}) > 1
    other = KitchenEnv(env.declaration, cameras=(), terminate_on_success=False)
    for again in (env, other):
        again.set_state(KitchenState.from_dict(state.to_dict()))
        assert again.scene.memory.read(again.data, WASHED.name) == 10.0
        for action, row, qpos in zip(wander(1), terms, numbers, strict=True):
            assert again.step(action)[-1]["success_terms"] == row
            assert np.array_equal(again.data.qpos, qpos)
    env.reset(seed=0)
    assert env.scene.memory.read(env.data, WASHED.name) == 0.0


@pytest.mark.parametrize("seed", range(3))
def test_memory_has_no_weight_in_the_physics(seed: int) -> None:
    """The same kitchen with and without memory goes the same course, bit for bit, and nothing stays awake for it."""
    with_it, without = make(AllOf(*EVERY), seed, runs=True), make(RUNS, seed, runs=True)
    nq, nv = without.model.nq, without.model.nv
    added = sum(len(part.numbers) for part in with_it.scene.remembering)
    assert (with_it.model.nq, with_it.model.nv) == (nq + added, nv + added)
    for env in (with_it, without):
        env.data.qpos[env.model.joint("obj_joint0").qposadr[0] + 2] += 0.05  # something falls
    for action in wander(seed, 60):
        for env in (with_it, without):
            env.step(action)
        assert np.array_equal(with_it.data.qpos[:nq], without.data.qpos)
        assert np.array_equal(with_it.data.qvel[:nv], without.data.qvel)
        assert not with_it.data.qvel[nv:].any()
        assert with_it.data.ncon == without.data.ncon
    assert with_it.data.ntree_awake == without.data.ntree_awake
    assert with_it.data.nefc == without.data.nefc


def test_a_joint_keeps_what_was_written_through_physics() -> None:
    env = make(AllOf(*EVERY))
    kept = {part.name: np.linspace(-300.0, 700.0, len(part.numbers)) / 7 for part in env.scene.remembering}
    for name, numbers in kept.items():
        env.scene.memory.write(env.data, name, numbers)
    for _ in range(500):
        mujoco.mj_step(env.model, env.data)
    for name, numbers in kept.items():
        assert np.array_equal(env.scene.memory.read(env.data, name), numbers)


@pytest.mark.render
def test_workers_of_a_vector_env_count_each_for_itself_and_anew_in_each_episode() -> None:
    tasks = [by_the_sink(StepsWhile(RUNS, n), runs=True) for n in (3, 5)]
    with closing(make_vector_env([partial(KitchenEnv, task, cameras=()) for task in tasks])) as envs:
        envs.reset(seed=[0, 1])
        ends = np.array([envs.step(np.zeros((2, 12), np.float32))[2] for _ in range(12)])
    # The step after an end resets, and counts for nothing.
    assert np.flatnonzero(ends[:, 0]).tolist() == [2, 6, 10]
    assert np.flatnonzero(ends[:, 1]).tolist() == [4, 10]


def hidden(scene: Scene) -> list[str]:
    names = [scene.model.joint(number).name for number in range(scene.model.njnt)]
    return [name for name in names if name.startswith(PREFIX)]


def test_only_scenes_of_tasks_with_memory_have_such_joints() -> None:
    scene = build_scene(by_the_sink(AllOf(*EVERY)), "target", 0)
    assert len(hidden(scene)) == sum(len(part.numbers) for part in parts_with_memory(EVERY)) > 0
    assert not hidden(build_scene(by_the_sink(UnderWater("obj", "sink")), "target", 0))


def test_what_is_inside_comes_first() -> None:
    moved = MovedSince("obj", "step", by_m=0.001)
    outer = StepsWhile(AllOf(GripperTouches("obj"), moved), 5)
    assert parts_with_memory([Not(AllOf(ObjectUpright("obj"), outer)), moved]) == (moved, outer)


def test_mistakes_are_named() -> None:
    one, other = Once(RUNS, label="seen"), Once(UnderWater("obj", "sink"), label="seen")
    with pytest.raises(UserError, match=r"task WashLettuce: two terms .* `seen`"):
        by_the_sink(AllOf(one, other))
    stage = replace(by_the_sink(one).stages[0], until=other)
    with pytest.raises(UserError, match=r"task WashLettuce: two terms with memory .* `seen`"):
        by_the_sink(one, stage)
    with pytest.raises(UserError, match="found n_steps 0"):
        StepsWhile(RUNS, 0)
    with pytest.raises(UserError, match="expected a bound"):
        MovedSince("obj", "step")


def test_what_is_remembered_is_bound_with_its_goal_and_keeps_its_name() -> None:
    drawn = cast(Scene, SimpleNamespace(named=lambda name: (f"{name}_0", f"{name}_1"), choices={"side": "left"}))
    each = ForEach("ice", lambda name: UnderWater(name, "sink"))
    by_side = When("side", {"left": StateIs("sink", "left"), "right": StateIs("sink", "right")})
    for make in (partial(StepsWhile, n_steps=3), Once, Never):
        term = make(goal=AllOf(each, by_side))
        bound = term.bound(drawn)
        both = AllOf(UnderWater("ice_0", "sink"), UnderWater("ice_1", "sink"))
        assert bound.inner == (AllOf(both, StateIs("sink", "left")),)
        assert (type(bound), bound.name) == (type(term), term.name)
        assert bound.bound(drawn) == bound
