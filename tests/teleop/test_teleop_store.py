"""What sessions leave on a disk that is full, under another version, beside another command; without a kitchen."""

from __future__ import annotations

import json
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import pytest
from full_disk import full_after, recording
from teleop_support import SEED, TASK, settings

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.teleop.keeping.store import STATS_FILE, Store
from robocasa_lerobot.teleop.run import Place, run_session

NOTES = Path(f".{TASK}.teleop") / "attempts.jsonl"
VERSIONS = "robocasa_lerobot.teleop.keeping.store.versions"


def save(store: Store, number: int) -> None:
    store.save(number, recording(), undos=0, wall_seconds=1.0)


def discard(store: Store, number: int) -> None:
    store.discard(number, "too dark", steps=3, undos=0, wall_seconds=0.5)


def demos(out: Path) -> list[str]:
    with h5py.File(out / f"{TASK}.hdf5") as file:
        return list(file["data"])


def test_a_note_that_does_not_fit_leaves_the_others_readable(tmp_path: Path) -> None:
    with Store(settings(tmp_path)).held() as store:
        discard(store, 0)
        notes = (tmp_path / NOTES).read_bytes()
        with full_after(len(notes) + 20), pytest.raises(OSError, match="No space left"):
            discard(store, 1)
        assert (tmp_path / NOTES).read_bytes() == notes
        assert store.next_number() == 1
        discard(store, 1)
    with Store(settings(tmp_path)).held() as store:
        assert store.next_number() == 2


def test_figures_that_cannot_be_written_hold_nothing_up(tmp_path: Path) -> None:
    with Store(settings(tmp_path)).held() as store:
        (tmp_path / STATS_FILE).write_text("{ broken")
        discard(store, 0)
        assert json.loads((tmp_path / STATS_FILE).read_text())[TASK]["discarded"] == {"too dark": 1}
        (tmp_path / f"{STATS_FILE}.partial").mkdir()  # nothing can be written there
        discard(store, 1)
        save(store, 2)
        assert (store.discarded, store.saved) == (2, [2])


def test_sessions_of_several_tasks_in_one_folder_keep_each_others_figures(tmp_path: Path) -> None:
    tasks, times = ("CloseDrawer", "OpenDrawer", "OpenCabinet", "CloseCabinet"), 12

    def work(task: str) -> None:
        with Store(settings(tmp_path, task=task)).held() as store:
            for number in range(times):
                discard(store, number)

    with ThreadPoolExecutor(len(tasks)) as pool:
        list(pool.map(work, tasks))
    figures = json.loads((tmp_path / STATS_FILE).read_text())
    assert {task: figures[task]["discarded"] for task in figures} == {task: {"too dark": times} for task in tasks}


def test_an_episode_that_was_saved_by_halves_counts_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(number: int) -> None:
        raise OSError(28, "No space left on device")

    with Store(settings(tmp_path, episodes=2)).held() as store:
        for number in (0, 1):
            with monkeypatch.context() as lacking:
                lacking.setattr(os, "fsync", full)
                with pytest.raises(OSError, match="No space left"):
                    save(store, number)
            assert store.saved == [0] * number
            assert store.part(number).exists()  # it comes back where the process is killed now
            if number == 0:
                save(store, number)
                save(store, number)
        discard(store, 1)
        assert not store.part(1).exists()
        assert (store.saved, len(store.attempts)) == ([0], 2)
    with Store(settings(tmp_path, episodes=2)).held() as store:
        assert (store.saved, store.next_number()) == ([0], 2)
        store.merge()
    assert demos(tmp_path) == ["demo_0"]


def test_a_command_that_is_refused_leaves_the_running_session_its_notes(tmp_path: Path) -> None:
    with Store(settings(tmp_path)).held() as store:
        discard(store, 0)
        before = {path.name: path.read_bytes() for path in store.folder.iterdir()}
        with pytest.raises(UserError, match="running already"), Store(settings(tmp_path, seed=SEED + 5)).held():
            pass
        assert {path.name: path.read_bytes() for path in store.folder.iterdir()} == before


def test_episodes_of_another_version_are_not_mixed_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with Store(settings(tmp_path, episodes=2)).held() as store:
        save(store, 0)
    monkeypatch.setattr(VERSIONS, lambda: {"robocasa_lerobot_version": "0.0.1", "mujoco_version": "9"})
    found = r"other settings \(robocasa_lerobot_version: .*, now '0.0.1', mujoco_version: .*\)\. Install those"
    with pytest.raises(UserError, match=found), Store(settings(tmp_path, episodes=2)).held():
        pass
    monkeypatch.undo()
    with Store(settings(tmp_path, episodes=2)).held() as store:
        assert store.saved == [0]


def test_a_disk_that_is_full_at_the_start_is_told_with_a_remedy(tmp_path: Path) -> None:
    with Store(settings(tmp_path, episodes=2)).held() as store:
        save(store, 0)
    with (
        full_after(2000),
        pytest.raises(UserError, match=rf"{TASK}.hdf5 not made of it .*too large.* same command again"),
        Store(settings(tmp_path, episodes=2)).held(),
    ):
        pass
    with Store(settings(tmp_path, episodes=2)).held():
        assert demos(tmp_path) == ["demo_0"]


@pytest.mark.parametrize(("first", "second"), [("random", ""), ("", "random")])
def test_episodes_with_a_policy_and_without_are_not_mixed(first: str, second: str, tmp_path: Path) -> None:
    with Store(settings(tmp_path, policy=first)).held() as store:
        save(store, 0)
    with (
        pytest.raises(UserError, match=r"with_policy: .* choose another --out"),
        Store(settings(tmp_path, policy=second)).held(),
    ):
        pass
    with Store(settings(tmp_path, policy=first)).held() as store:
        assert store.saved == [0]


def test_a_folder_that_cannot_be_is_a_mistake_before_anything_is_loaded(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.touch()
    for out in (file, file / "below"):
        with pytest.raises(UserError, match=f"{file} is a file"), Store(settings(out)).held():
            pass
        with pytest.raises(UserError, match=f"{file} is a file"):
            run_session(settings(out), Place(), lambda server, loop: None, policy="no such policy")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_rights_is_a_mistake(tmp_path: Path) -> None:
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o500)
    for out in (closed, closed / "below"):
        with pytest.raises(UserError, match=f"nothing may be written in {closed}"), Store(settings(out)).held():
            pass
