"""Recordings of tasks of which something is drawn: files, replay and datasets keep the stages of each scene."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py
import pytest
from drawn_tasks import FRUITS

from robocasa_lerobot.demos.hdf5 import merge_parts, write_part
from robocasa_lerobot.demos.recorder import record_episode
from robocasa_lerobot.demos.replay import replay
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.task import Task


def recorded(task: Task, seeds: range, folder: Path, images: bool = False) -> tuple[Path, list[Any]]:
    env = KitchenEnv(task, cameras=(), terminate_on_success=False)
    recordings = [record_episode(env, seed, images=images) for seed in seeds]
    env.close()
    parts = []
    for recording in recordings:
        parts.append(folder / f"{recording.seed}.hdf5")
        write_part(parts[-1], recording)
    out = folder / f"{task.name}.demos"
    merge_parts(out, parts, env_name=task.name, env_kwargs={}, settings={}, tried=len(parts), failures=[])
    return out, recordings


@pytest.fixture(scope="module")
def fruits(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Any]]:
    """Demonstrations with different numbers of fruits."""
    return recorded(FRUITS, range(5), tmp_path_factory.mktemp("fruits"))


def test_recordings_have_the_stages_of_their_own_scene(fruits: tuple[Path, list[Any]]) -> None:
    path, recordings = fruits
    assert sum(recording.success for recording in recordings) >= 3
    assert len({len(recording.ep_meta["stages"]) for recording in recordings}) > 1
    with h5py.File(path) as file:
        for number, recording in enumerate(recordings):
            demo = file[f"data/demo_{number}"]
            rows = json.loads(demo.attrs["ep_meta"])["stages"]
            assert [row["object"] for row in rows] == [f"fruit_{i}" for i in range(len(rows))]
            assert demo["stage"][:].max() < len(rows)
            names = json.loads(demo["success_terms"].attrs["names"])
            assert len(names) == 2 * len(rows) == demo["success_terms"].shape[1]
            if recording.success:
                assert set(demo["stage"][:].tolist()) == set(range(len(rows)))


@pytest.mark.costly
def test_replay_makes_the_same_scene_and_the_same_goal(fruits: tuple[Path, list[Any]]) -> None:
    path, recordings = fruits
    for number, recording in enumerate(recordings):
        if recording.success:
            found = replay(path, f"demo_{number}", FRUITS)
            assert (found.note, found.deviation) == ("", 0.0)
            assert found.actions
            assert found.states


@pytest.mark.render
def test_datasets_have_the_text_of_every_stage(fruits: tuple[Path, list[Any]], tmp_path: Path) -> None:
    from lerobot.datasets.language_render import active_at
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    from robocasa_lerobot.convert.pipeline import convert
    from robocasa_lerobot.convert.settings import ConversionSettings

    settings = ConversionSettings(image_size=16, cameras=("robot0_eye_in_hand",))
    root = convert([fruits[0]], tmp_path / "data", settings, workers=1).root
    dataset = LeRobotDataset("local/data", root=root, video_backend="pyav")
    first = 0
    for recording in fruits[1]:
        texts = [row["text"] for row in recording.ep_meta["stages"]]
        for step, stage in enumerate(recording.stages):
            if step % 25 == 0:
                item = dataset[first + step]
                said = active_at(float(item["timestamp"]), persistent=item["language_persistent"], style="subtask")
                assert said is not None
                assert said["content"] == texts[stage]
                assert int(item["stage_index"]) == stage
        first += len(recording.stages)
    assert first == len(dataset)
