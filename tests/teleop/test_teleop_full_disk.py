"""A full disk costs no episode: what could not be written is said on the page, and by the command at its end."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from full_disk import full_after, recording
from teleop_desk import desk
from teleop_support import SPLIT, TASK, demonstration, settings

from robocasa_lerobot.demos.recorder import Recording
from robocasa_lerobot.demos.replay import replay
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.teleop.keeping.store import Store
from robocasa_lerobot.teleop.loop import ControlLoop, Inbox
from robocasa_lerobot.teleop.session import Session

pytestmark = pytest.mark.render


@pytest.fixture(scope="module")
def shown() -> Recording:
    return demonstration()


@pytest.fixture(scope="module")
def env() -> Iterator[KitchenEnv]:
    made = KitchenEnv(TASK, split=SPLIT, cameras=(), terminate_on_success=False)
    yield made
    made.close()


def test_a_full_disk_leaves_the_episode_to_be_saved_again(tmp_path: Path, env: KitchenEnv, shown: Recording) -> None:
    with desk(tmp_path, env, shown) as table:
        table.follow(200)
        folder = tmp_path / f".{TASK}.teleop"
        block = folder / "000000.hdf5.partial"
        block.mkdir()  # nothing can be written there
        table.say("save")
        table.until("review")
        assert "save it again" in table.notes()[-1]
        block.rmdir()
        with full_after(2000):  # HDF5 ends the process where it meets that by itself
            table.say("save")
            table.until("review")
        assert "too large" in table.notes()[-1]
        merged = tmp_path / f"{TASK}.hdf5.partial"
        merged.mkdir()
        table.say("save")
        table.until("done")
        assert "free disk space and give the same command again" in table.notes()[-1]
        assert table.told[-1] == {"type": "done", "path": None, "saved": 1}
        assert isinstance(table.session.failure, UserError)
        merged.rmdir()
    with Store(settings(tmp_path)).held() as store:
        assert store.saved == [0]
    assert replay(tmp_path / f"{TASK}.hdf5", "demo_0").deviation == 0.0


def test_an_attempt_that_cannot_be_noted_goes_on(tmp_path: Path, env: KitchenEnv, shown: Recording) -> None:
    with desk(tmp_path, env, shown) as table:
        table.follow(5)
        with full_after(0):
            for order in ({"kind": "redo"}, {"kind": "discard", "reason": "too dark"}):
                table.say(**order)
                assert "could not be noted" in table.notes()[-1]
        assert (table.session.phase, len(table.session.driven), table.session.store.attempts) == ("running", 5, [])
        table.say("redo")
        table.until("ready")
        assert table.session.store.discarded == 1


def test_a_disk_that_is_full_at_the_end_is_what_the_command_says(tmp_path: Path) -> None:
    class Nobody:
        """Takes no pictures."""

        def wants_frames(self) -> bool:
            return False

        def sees_nothing(self) -> bool:
            return False

        def frame(self, told: dict[str, Any], pictures: list[bytes]) -> None:
            assert told["phase"] == "done"

        def tell(self, message: dict[str, Any], map_jpeg: bytes | None) -> None:
            assert message["type"] in ("note", "done")

    with Store(settings(tmp_path, episodes=2)).held() as store:
        store.save(0, recording(), undos=0, wall_seconds=1.0)
        env = KitchenEnv(TASK, split=SPLIT, cameras=(), terminate_on_success=False)
        loop = ControlLoop(Session(store.settings, store, env), Inbox(), Nobody())
        loop.stop()
        (tmp_path / f"{TASK}.hdf5.partial").mkdir()
        with pytest.raises(UserError, match=rf"{TASK}.hdf5 could not be written .*free disk space"):
            loop.run()
