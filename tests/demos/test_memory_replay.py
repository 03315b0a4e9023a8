"""A task of two stages whose goal has memory, from its demonstration through HDF5, replay and conversion."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest
from memory_tasks import by_the_sink

from robocasa_lerobot import contract
from robocasa_lerobot.demos.demonstrator import demonstrate
from robocasa_lerobot.demos.hdf5 import merge_parts, write_part
from robocasa_lerobot.demos.motion import Array, action
from robocasa_lerobot.demos.recorder import SUCCESS_HOLD_STEPS, Recording, record_episode
from robocasa_lerobot.demos.replay import Demonstration, _goal_held_at_the_end, replay
from robocasa_lerobot.demos.skills import SKILLS
from robocasa_lerobot.demos.stages import PATIENCE_STEPS
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperFar,
    MovedSince,
    Never,
    Not,
    ObjectTouches,
    Once,
    StateIs,
    StepsWhile,
    Term,
    UnderWater,
)
from robocasa_lerobot.envs.predicates.logic import every_goal_in
from robocasa_lerobot.envs.tasks.conditions import without_gripper
from robocasa_lerobot.envs.tasks.task import Stage

N_STEPS = 3 * PATIENCE_STEPS
WASHED = StepsWhile(UnderWater("obj", "sink"), N_STEPS)
TURN_ON = Stage("levers", "on", "sink", part="handle")
WAIT = Stage("levers", "wait", "sink", object="obj", until=WASHED)
TASK = by_the_sink(WASHED, TURN_ON, WAIT)
SEED = 2


def wait(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """A skill that has nothing to do but to let the stage's condition come about."""
    yield action(gripper=-1.0)


@pytest.fixture(autouse=True)
def skill(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SKILLS, ("levers", "wait"), wait)


@pytest.fixture(scope="module")
def recording() -> Recording:
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(SKILLS, ("levers", "wait"), wait)
        env = KitchenEnv(TASK, cameras=(), terminate_on_success=False)
        return record_episode(env, SEED)


@pytest.fixture(scope="module")
def file(recording: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("washed")
    write_part(folder / "part.hdf5", recording)
    kwargs = {"split": "target", "image_size": 64, "render_preset": "fast"}
    parts = [folder / "part.hdf5"]
    out = folder / "WashLettuce.hdf5"
    merge_parts(out, parts, env_name=TASK.name, env_kwargs=kwargs, settings={}, tried=1, failures=[])
    return out


def counted(states: Array, nq: int) -> Array:
    """Steps under water in recorded states (T, 1 + nq + nv): the last joint's positions."""
    return states[:, nq]


def test_nothing_comes_of_doing_nothing() -> None:
    env = KitchenEnv(TASK, cameras=(), terminate_on_success=False)
    env.reset(seed=SEED)
    for _ in range(N_STEPS + 50):
        *_, info = env.step(np.zeros(12, np.float32))
        assert info["success_terms"] == {WASHED.name: False}


def test_its_stages_are_carried_out_until_the_count_is_full(recording: Recording) -> None:
    assert recording.success
    rows = [(row["verb"], row["attempts"], row["done"]) for row in recording.ep_meta["stages"]]
    assert rows == [("on", 1, True), ("wait", 1, True)]
    assert recording.term_names == (WASHED.name,)
    held = np.flatnonzero(recording.success_terms[:, 0])
    assert len(held) == SUCCESS_HOLD_STEPS - 1  # the state after the last action is not recorded
    assert held[-1] == len(recording.actions) - 1
    assert np.array_equal(recording.rewards, recording.success_terms[:, 0])


def test_the_recorded_states_hold_the_count(recording: Recording) -> None:
    env = KitchenEnv(TASK, cameras=())
    env.reset(seed=SEED)
    steps = counted(recording.states, env.model.nq)
    assert steps[0] == 0.0
    assert steps[-1] == N_STEPS
    assert set(np.diff(steps)) == {0.0, 1.0}
    assert np.array_equal(steps >= N_STEPS, recording.success_terms[:, 0])


def test_a_state_restored_midway_counts_on() -> None:
    env = KitchenEnv(TASK, cameras=())
    env.reset(seed=SEED)
    middle, commands = None, []
    for command in demonstrate(env):
        if middle is not None:
            commands.append(command.astype(np.float32))
        *_, ended, _, _ = env.step(command.astype(np.float32))
        if middle is None and env.scene.memory.read(env.data, WASHED.name)[0] == N_STEPS // 2:
            middle = env.get_state()
        if ended:
            break
    assert len(commands) == N_STEPS - N_STEPS // 2
    assert middle is not None
    other = KitchenEnv(TASK, cameras=())
    other.set_state(middle)
    ends = [other.step(command)[2] for command in commands]
    assert ends == [False] * (len(commands) - 1) + [True]


def test_of_what_is_remembered_about_what_is_remembered_the_outer_was_recorded() -> None:
    moves = MovedSince("obj", "step", by_m=0.001)
    name = Once(moves).name
    env = KitchenEnv(by_the_sink(Once(moves)), cameras=(), terminate_on_success=False)
    env.reset(seed=SEED)
    body = env.model.body("obj")
    env.data.qvel[env.model.jnt_dofadr[body.jntadr[0]] + 2] = 1.0  # tossed upwards
    for _ in range(3):
        *_, info = env.step(np.zeros(12, np.float32))
    assert info["success_terms"] == {name: True}
    states = np.concatenate([[env.data.time], env.data.qpos, env.data.qvel])[None]
    assert _goal_held_at_the_end(env, Demonstration("", {}, states, np.zeros((1, 12)), {name: True})) == (True, "")
    _, said = _goal_held_at_the_end(env, Demonstration("", {}, states, np.zeros((1, 12)), {name: False}))
    assert said == f"`{name}` is True in the last state, but was recorded as False"


@pytest.mark.parametrize(
    ("lifted_m", "speed", "touches"), [(0.0, 0.0, True), (8e-4, 0.0, True), (8e-4, 0.01, False), (3e-3, 0.0, False)]
)
def test_what_slept_a_hair_over_what_it_lay_on_touches_it(lifted_m: float, speed: float, touches: bool) -> None:
    env = KitchenEnv(by_the_sink(ObjectTouches("obj", "sink")), cameras=(), terminate_on_success=False)
    env.reset(seed=SEED)
    joint = env.model.body("obj").jntadr[0]
    qpos, qvel = env.data.qpos.copy(), np.zeros(env.model.nv)
    qpos[env.model.jnt_qposadr[joint] + 2] += lifted_m
    qvel[env.model.jnt_dofadr[joint] + 2] = speed
    states = np.concatenate([[env.data.time], qpos, qvel])[None]
    assert _goal_held_at_the_end(env, Demonstration("", {}, states, np.zeros((1, 12)))) == (touches, "")


def test_what_cannot_be_made_good_ends_the_attempt() -> None:
    forbidden = Never(StateIs("sink", "water_on"))
    env = KitchenEnv(by_the_sink(AllOf(WASHED, forbidden), TURN_ON, WAIT), cameras=(), terminate_on_success=False)
    recording = record_episode(env, SEED)
    assert not recording.success
    assert f"`{forbidden.name}`" in recording.reason
    assert [row["attempts"] for row in recording.ep_meta["stages"]] == [1, 0]
    assert forbidden.name in recording.false_terms


def test_what_must_still_hold_of_a_stage_that_is_done() -> None:
    """Where the gripper is does not count any more, nor what moved in the last step; what is remembered stays whole."""
    water, away = StateIs("sink", "water_on"), GripperFar("obj")
    counted_away = StepsWhile(AllOf(water, away), 5)
    moves, moved = MovedSince("obj", "step", by_m=0.001), MovedSince("obj", "reset", by_m=0.1)
    kept = without_gripper(AllOf(water, away, AllOf(counted_away, away, moves), moved, Once(moves), Not(away)))
    leaves = [part for part in every_goal_in(kept) if isinstance(part, Term)]
    assert {water, counted_away, moved, Once(moves)} <= set(leaves)
    assert moves not in kept.inner
    assert away not in kept.inner
    (inner,) = (part for part in kept.inner if counted_away in part.inner)
    assert inner.inner == (counted_away,)
    assert without_gripper(away) == AllOf()
    assert without_gripper(counted_away) is counted_away


def test_it_replays_by_actions_and_by_states(file: Path) -> None:
    found = replay(file, "demo_0", TASK)
    assert (found.actions, found.states, found.same_start, found.deviation) == (True, True, True, 0.0)
    assert found.note == ""


@pytest.mark.parametrize(
    ("change", "note"),
    [
        ("forgets", "is False in the last state, but was recorded as True"),
        ("terms", "is True in the last state, but was recorded as False"),
        ("names", "but was not recorded"),
    ],
)
def test_states_and_recorded_terms_must_agree(file: Path, tmp_path: Path, change: str, note: str) -> None:
    path = tmp_path / "changed.hdf5"
    path.write_bytes(file.read_bytes())
    env = KitchenEnv(TASK, cameras=())
    env.reset(seed=SEED)
    with h5py.File(path, "r+") as opened:
        demo = opened["data/demo_0"]
        if change == "forgets":
            demo["states"][-1, env.model.nq] = N_STEPS - 1
        elif change == "terms":
            demo["success_terms"][-1] = False
        else:
            demo["success_terms"].attrs["names"] = json.dumps(["another_goal"])
    found = replay(path, "demo_0", TASK)
    assert (found.actions, found.states) == (True, False)
    assert note in found.note


def test_a_file_without_terms_is_judged_by_its_states(file: Path, tmp_path: Path) -> None:
    def without_terms(name: str, change: Callable[[h5py.Group], None] = lambda demo: None) -> bool:
        path = tmp_path / f"{name}.hdf5"
        path.write_bytes(file.read_bytes())
        with h5py.File(path, "r+") as opened:
            del opened["data/demo_0/success_terms"]
            change(opened["data/demo_0"])
        return replay(path, "demo_0", TASK).states

    def early(demo: h5py.Group) -> None:
        states = demo["states"][()]
        demo["states"][...] = np.repeat(states[len(states) // 2][None], len(states), axis=0)

    assert without_terms("as_it_is")
    assert not without_terms("early", early)


@pytest.mark.slow
@pytest.mark.render
def test_a_converted_dataset_still_replays(file: Path, tmp_path: Path) -> None:
    from robocasa_lerobot.convert.export import ExportSettings, export
    from robocasa_lerobot.convert.pipeline import convert
    from robocasa_lerobot.convert.settings import ConversionSettings

    settings = ConversionSettings(cameras=(contract.CAMERAS[0],), image_size=16)
    convert([file], tmp_path / "dataset", settings)
    exported = export(tmp_path / "dataset", tmp_path / "again.hdf5", ExportSettings(images=False))
    found = replay(exported.path, "demo_0", TASK)
    assert (found.actions, found.states, found.same_start, found.deviation) == (True, True, True, 0.0)
