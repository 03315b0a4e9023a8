"""Any order of what an operator can do leaves whole episodes only; without sockets, time is made up."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import settings as examples
from hypothesis import strategies as st
from teleop_desk import Desk, desk
from teleop_support import SEED, SPLIT, TASK, demonstration, settings

from robocasa_lerobot import contract
from robocasa_lerobot.demos.recorder import SUCCESS_HOLD_STEPS, Recording
from robocasa_lerobot.demos.replay import replay
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.robots.control_step import DivergedError
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.teleop.keeping.store import REDO, Store
from robocasa_lerobot.teleop.telling import header

pytestmark = pytest.mark.render


@pytest.fixture(scope="module")
def shown() -> Recording:
    return demonstration()


@pytest.fixture(scope="module")
def env() -> Iterator[KitchenEnv]:
    made = KitchenEnv(TASK, split=SPLIT, cameras=(), terminate_on_success=False)
    yield made
    made.close()


OPERATIONS = st.lists(
    st.one_of(
        st.tuples(st.just("follow"), st.sampled_from([1, 20, 126])),
        st.tuples(st.just("succeed"), st.just(0)),
        st.tuples(st.just("hold"), st.sampled_from([1, 7])),
        st.tuples(st.just("tick"), st.sampled_from([1, 8])),
        st.tuples(st.just("undo"), st.sampled_from([1, 15, 500])),
        st.tuples(st.just("rewind"), st.sampled_from([1, 6])),
        st.tuples(
            st.sampled_from(
                [
                    "pause",
                    "resume",
                    "mark",
                    "back_to_mark",
                    "end",
                    "continue",
                    "save",
                    "trim",
                    "redo",
                    "finish",
                    "start",
                ]
            ),
            st.just(0),
        ),
        st.tuples(st.sampled_from(["focus", "disconnect", "stale", "grip", "review", "drive", "kill"]), st.just(0)),
    ),
    max_size=12,
)


def perform(desk: Desk, what: str, times: int) -> None:
    session = desk.session
    if what in ("follow", "tick"):
        getattr(desk, what)(times)
    elif what == "succeed":
        if session.phase in ("running", "paused", "review"):
            desk.say("rewind", steps=500)
        desk.follow(200)
        desk.say("save")
    elif what == "hold":
        desk.hold(times, arm=[1, 0, 0.5, 0, 0, 0])
    elif what == "undo":
        desk.say("rewind", steps=times)
    elif what == "rewind":
        for _ in range(times):
            desk.say("rewind", on=True, speed=3)
            desk.tick()
    elif what == "grip":
        desk.say("input", frame=0, gripper="closed")
    elif what == "trim":
        desk.say("save", trim=True)
    elif what == "review":
        desk.say("review", play=True, speed=4, seek=3)
    elif what == "focus":
        desk.say("focus", on=False)
    elif what == "drive":
        desk.say("drive_to", x=1.0, y=-1.5)
    elif what in ("disconnect", "stale"):
        session.hold_still(what)
    else:
        desk.say(what)


@pytest.mark.costly
@examples(max_examples=4)
@given(operations=OPERATIONS)
@example([("hold", 7), ("undo", 1), ("succeed", 0), ("tick", 8), ("follow", 20), ("disconnect", 0), ("succeed", 0)])
@example([("succeed", 0), ("tick", 8), ("succeed", 0), ("tick", 8)])
@example([("follow", 126), ("rewind", 6), ("focus", 0), ("succeed", 0), ("tick", 1), ("kill", 0)])
def test_any_order_leaves_whole_episodes_only(
    tmp_path_factory: pytest.TempPathFactory, env: KitchenEnv, shown: Recording, operations: list[tuple[str, int]]
) -> None:
    leaves_whole_episodes(tmp_path_factory.mktemp("teleop"), env, shown, operations)


@pytest.mark.slow
@pytest.mark.timeout(1800)
@examples(max_examples=50)
@given(operations=OPERATIONS)
def test_any_of_many_orders_leaves_whole_episodes_only(
    tmp_path_factory: pytest.TempPathFactory, env: KitchenEnv, shown: Recording, operations: list[tuple[str, int]]
) -> None:
    leaves_whole_episodes(tmp_path_factory.mktemp("teleop"), env, shown, operations)


def leaves_whole_episodes(out: Path, env: KitchenEnv, shown: Recording, operations: list[tuple[str, int]]) -> None:
    """Perform operations, break off, and look at what is there."""
    with desk(out, env, shown, episodes=2) as table:
        for what, times in operations:
            if what == "kill":
                break
            perform(table, what, times)
            episode = table.session.episode
            if episode is not None:
                assert len(episode.states) == len(episode) + 1 == len(episode.origins) + 1
        saved = table.session.store.saved
        done = table.session.phase == "done"
    with Store(settings(out, episodes=2)).held() as store:
        assert store.saved == saved
        assert sorted(out.glob(".*/*.hdf5")) == [store.part(number) for number in saved]
        store.merge()
    path = out / f"{TASK}.hdf5"
    assert path.exists() == bool(saved)
    assert not done or all(told["type"] != "scene" for told in table.told[-1:])
    if saved:
        with h5py.File(path) as file:
            assert len(file["data"]) == len(saved)
        for index in range(len(saved)):
            found = replay(path, f"demo_{index}")
            assert (found.actions, found.states, found.same_start, found.deviation) == (True, True, True, 0.0)


def test_undone_steps_are_dropped_and_the_rest_replays(tmp_path: Path, env: KitchenEnv, shown: Recording) -> None:
    with desk(tmp_path, env, shown) as table:
        table.follow(40)
        table.say("mark")
        table.hold(30, arm=[0, 1, 0, 0, 0.5, 0], gripper="open")
        assert len(table.session.driven) == 70
        table.say("rewind", on=True, speed=4)
        table.tick(3)
        assert table.session.phase == "rewinding"
        table.tick(10)  # nobody holds it any more
        assert table.session.phase == "paused"
        assert not table.session.driver.steering.closed
        table.say("back_to_mark")
        assert len(table.session.driven) == 40
        assert table.session.driver.steering.closed  # as the demonstrator has it there
        assert table.session.driven.undos == 2
        table.follow(200)
        assert table.session.phase == "review"
        table.say("review", play=True, speed=10, seek=0)
        table.tick(3)
        assert table.session.playback.step == 30
        table.say("save")
        table.until("done")
    found = replay(tmp_path / f"{TASK}.hdf5", "demo_0")
    assert (found.actions, found.states, found.deviation) == (True, True, 0.0)
    with h5py.File(tmp_path / f"{TASK}.hdf5") as file:
        demo = file["data/demo_0"]
        assert np.array_equal(demo["actions"], shown.actions)
        meta = json.loads(demo.attrs["ep_meta"])["teleop"]
        assert (meta["undos"], meta["undone_steps"]) == (2, 30)


def test_an_idle_head_is_trimmed_where_it_still_succeeds(
    tmp_path: Path, env: KitchenEnv, shown: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And what is trimmed is whole again where it could not be written."""
    with desk(tmp_path, env, shown) as table:
        table.say("start")
        table.tick(12)
        table.say("rewind", steps=2)
        for action in contract.hdf5_to_stored(shown.actions):
            table.say("action", frame=0, action=action.tolist())
            table.tick()
        assert table.session.driven.idle_head() == 10
        whole = table.session.driven
        with monkeypatch.context() as full:
            full.setattr(table.session.store, "save", raises(OSError(28, "No space left on device")))
            table.say("save", trim=True)
            table.until("review")
        assert table.session.driven is whole
        assert len(whole) == 10 + len(shown.actions)
        table.say("save", trim=True)
        table.until("done")
    found = replay(tmp_path / f"{TASK}.hdf5", "demo_0")
    assert (found.actions, found.same_start, found.deviation) == (True, True, 0.0)
    with h5py.File(tmp_path / f"{TASK}.hdf5") as file:
        assert np.array_equal(file["data/demo_0/actions"], shown.actions)
        assert json.loads(file["data/demo_0"].attrs["ep_meta"])["teleop"]["trimmed_steps"] == 10


def raises(error: Exception) -> Callable[..., Any]:
    def call(*_: Any, **__: Any) -> Any:
        raise error

    return call


def test_nothing_counts_before_the_first_input(tmp_path: Path, env: KitchenEnv, shown: Recording) -> None:
    with desk(tmp_path, env, shown) as table:
        start = env.data.time
        table.hold(5)
        table.tick(20)
        assert (table.session.phase, len(table.session.driven), env.data.time) == ("ready", 0, start)
        table.hold(1, gripper="closed")
        assert (table.session.phase, len(table.session.driven)) == ("running", 1)


def test_what_is_held_expires_and_is_let_go_where_time_stops(tmp_path: Path, env: KitchenEnv, shown: Recording) -> None:
    with desk(tmp_path, env, shown) as table:
        arm = contract.ACTION_SLICES["end_effector_position"]
        table.hold(3, arm=[1, 0, 0, 0, 0, 0])
        table.tick(8)
        moved = np.abs(table.session.driven.actions()[:, arm]).max(axis=1) > 0
        assert len(moved) == 11
        assert moved[:6].all()
        assert not moved[8:].any()  # a quarter of a second, five steps, after the last message
        table.say("input", frame=0, arm=[1, 0, 0, 0, 0, 0])
        table.say("focus", on=False)
        assert (table.session.phase, table.session.pause) == ("paused", "focus")
        table.say("input", frame=0, arm=[1, 0, 0, 0, 0, 0], gripper="closed")  # a key that is bumped
        assert table.session.phase == "paused"
        assert not table.session.driver.steering.closed
        table.say("resume")
        table.tick()
        assert not table.session.driven.actions()[-1][arm].any()


def test_what_fails_is_not_saved_and_the_reason_is_kept(tmp_path: Path, env: KitchenEnv, shown: Recording) -> None:
    with desk(tmp_path, env, shown) as table:
        table.follow(30)
        table.say("save")
        assert "not possible while running" in table.notes()[-1]
        table.say("end")
        table.say("save")
        assert "goal is reached" in table.notes()[-1]
        table.say("continue")
        table.follow(200)
        assert table.session.driven.held == SUCCESS_HOLD_STEPS
        table.say("continue")
        assert "ended by success" in table.notes()[-1]
        table.say("redo")
        table.until("ready")
        assert table.session.driven.seed == SEED
        table.say("discard", reason="kitchen unsuitable")
        table.until("ready")
        assert table.session.driven.seed == SEED + 1
        assert [attempt.reason for attempt in table.session.store.attempts] == [REDO, "kitchen unsuitable"]
        table.say("finish")
    assert not (tmp_path / f"{TASK}.hdf5").exists()
    stats = json.loads((tmp_path / "teleop-stats.json").read_text())[TASK]
    assert stats["discarded"] == {REDO: 1, "kitchen unsuitable": 1}
    with Store(settings(tmp_path)).held() as store:
        assert store.next_number() == 1


def test_sessions_go_on_and_a_killed_one_loses_nothing(tmp_path: Path, env: KitchenEnv, shown: Recording) -> None:
    with desk(tmp_path, env, shown, episodes=2) as table:
        table.follow(200)
        table.say("save")
        table.until("ready")
        assert table.session.driven.seed == SEED + 1
        table.follow(10)
    assert not (tmp_path / f"{TASK}.hdf5").exists()  # killed before it was merged
    folder = tmp_path / f".{TASK}.teleop"
    (folder / "attempts.jsonl").write_text('{"number": 0, "sav')  # even while the line was written
    (folder / "000001.hdf5.partial").write_bytes(b"half of an episode")
    with Store(settings(tmp_path, episodes=2)).held() as store:
        assert (store.saved, store.next_number()) == ([0], 1)
        assert (tmp_path / f"{TASK}.hdf5").exists()
        assert not list(folder.glob("*.partial"))
        with pytest.raises(UserError, match="running already"), Store(settings(tmp_path)).held():
            pass
    with pytest.raises(UserError, match=r"other settings \(seed"), Store(settings(tmp_path, seed=SEED + 5)).held():
        pass
    (tmp_path / f".{TASK}.teleop").rename(tmp_path / "elsewhere")
    with pytest.raises(UserError, match="did not record it here"), Store(settings(tmp_path)).held():
        pass


def test_a_folder_in_which_nothing_was_kept_takes_other_settings(tmp_path: Path) -> None:
    with Store(settings(tmp_path)).held() as store:
        store.discard(0, "too dark", steps=3, undos=0, wall_seconds=0.5)
    with Store(settings(tmp_path)).held() as store:  # the same ones go on
        assert store.next_number() == 1
    with Store(settings(tmp_path, seed=SEED + 5)).held() as store:
        assert store.next_number() == 0


def test_an_idle_head_whose_loss_loses_the_physics_stays(
    tmp_path: Path, env: KitchenEnv, shown: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lost(action: np.ndarray) -> Any:
        raise DivergedError("the simulation diverged at 0.050 s; reset the env.")

    with desk(tmp_path, env, shown) as table:
        table.say("start")
        table.tick(3)
        for action in contract.hdf5_to_stored(shown.actions):
            table.say("action", frame=0, action=action.tolist())
            table.tick()
        steps = len(table.session.driven)
        with monkeypatch.context() as broken:
            broken.setattr(env, "step", lost)
            table.say("save", trim=True)
            table.until("review")
        assert "does not succeed: save it whole" in table.notes()[-1]
        assert len(table.session.driven) == steps
        table.say("save")
        table.until("done")
    assert replay(tmp_path / f"{TASK}.hdf5", "demo_0").deviation == 0.0


def test_steps_are_undone_from_the_one_that_is_shown(tmp_path: Path, env: KitchenEnv, shown: Recording) -> None:
    with desk(tmp_path, env, shown) as table:
        table.follow(40)
        table.say("end")
        table.say("review", seek=30)
        table.say("rewind", steps=10)
        assert (table.session.phase, len(table.session.driven)) == ("paused", 20)


def test_a_kitchen_that_cannot_be_made_is_left_out(
    tmp_path: Path, env: KitchenEnv, shown: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    make = env.reset

    def reset(*, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        if seed == SEED:
            raise RuntimeError("no room for the robot")
        return make(seed=seed, options=options)

    monkeypatch.setattr(env, "reset", reset)
    with desk(tmp_path, env, shown) as table:
        assert "no room for the robot" in table.notes()[0]
        assert table.session.driven.seed == SEED + 1
        assert [attempt.reason for attempt in table.session.store.attempts] == ["RuntimeError: no room for the robot"]


def test_a_hidden_goal_is_told_nowhere(tmp_path: Path, env: KitchenEnv, shown: Recording) -> None:
    for hidden in (False, True):
        with desk(tmp_path / str(hidden), env, shown, hide_goal=hidden) as table:
            table.follow(len(shown.actions) - 2)
            told = header(table.session, 1, table.now)
            scene = next(message for message in table.told if message["type"] == "scene")
            assert bool(scene["terms"]) is bool(told["terms"]) is bool(told["held"]) is not hidden
            assert told["success"] is (None if hidden else True)
