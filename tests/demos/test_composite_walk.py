"""Every composite target task from a demonstration to a dataset and back, by the commands that users give."""

from __future__ import annotations

from pathlib import Path

import pytest

from robocasa_lerobot.benchmark.tasks import published_task_sets
from robocasa_lerobot.cli import main
from robocasa_lerobot.evaluation.records.results import read_results

FAST = ("KettleBoiling",)  # the shortest
SETS = ("composite_seen", "composite_unseen")
NAMES = [name for one in SETS for name in published_task_sets()[one]]


@pytest.mark.render
@pytest.mark.parametrize(
    "task", [name if name in FAST else pytest.param(name, marks=pytest.mark.slow) for name in NAMES]
)
def test_a_demonstration_replays_converts_verifies_and_succeeds_from_the_dataset(task: str, tmp_path: Path) -> None:
    demos, data, out = tmp_path / "demos", tmp_path / "data", tmp_path / "out"
    settings = ["--episodes=1", "--split=pretrain", "--seed=100400", "--workers=1", f"--out={demos}"]
    assert main(["demos", f"--tasks={task}", *settings]) == 0
    file = demos / f"{task}.hdf5"
    assert main(["replay", str(file)]) == 0  # bit for bit from its actions, or the command says where not
    assert main(["convert", str(file), f"--out={data}", "--image-size=96", "--workers=1"]) == 0
    assert main(["verify", str(data)]) == 0
    arguments = [f"--policy=replay:{data}", f"--env.tasks={task}", "--env.split=pretrain", "--trials=1", "--videos=0"]
    assert main(["eval", *arguments, "--workers=1", f"--out={out}"]) == 0
    (trial,) = read_results(out).trials
    assert trial.success
    assert trial.stages is not None
    assert trial.stages.progress == 1.0
