"""LeRobot's own commands, unmodified and without a display, record an episode from the kitchen and train on it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from robocasa_lerobot import contract
from robocasa_lerobot.cli import main
from robocasa_lerobot.demos.replay import read_demonstration

PIXELS = 64


def lerobot(command: str, *arguments: str) -> str:
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    done = subprocess.run(
        [str(Path(sys.executable).with_name(command)), *arguments],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        env=environment,
    )
    assert done.returncode == 0, done.stderr[-4000:]
    return done.stderr + done.stdout


@pytest.fixture(scope="module")
def demos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("demos")
    arguments = ["--tasks=OpenDrawer", "--episodes=1", "--seed=100000", "--split=pretrain", f"--out={out}"]
    assert main(["demos", *arguments]) == 0
    return out / "OpenDrawer.hdf5"


@pytest.mark.slow
@pytest.mark.render
def test_an_episode_is_recorded_and_trains(demos: Path, tmp_path: Path) -> None:
    wanted = read_demonstration(demos, "demo_0")
    root = tmp_path / "recorded"
    said = lerobot(
        "lerobot-record",
        *("--robot.type=robocasa_kitchen", f"--robot.demos={demos}", f"--robot.image_size={PIXELS}"),
        *("--teleop.type=robocasa_replay", f"--teleop.demos={demos}"),
        *("--dataset.repo_id=local/recorded", f"--dataset.root={root}", f"--dataset.fps={contract.CONTROL_HZ}"),
        # Twice the time it takes, since a busy machine may be slower than the kitchen.
        *("--dataset.num_episodes=1", f"--dataset.episode_time_s={len(wanted.actions) / 10}"),
        *("--dataset.reset_time_s=0", f"--dataset.single_task={wanted.instruction}"),
        *("--dataset.push_to_hub=false", "--play_sounds=false", "--dataset.rgb_encoder.vcodec=h264"),
    )
    assert f"The goal is reached: {wanted.instruction}" in said

    dataset = LeRobotDataset("local/recorded", root=root)
    expected = contract.dataset_features((PIXELS, PIXELS))
    assert dataset.meta.robot_type == contract.ROBOT_TYPE
    assert dataset.fps == contract.CONTROL_HZ
    assert {key: tuple(dataset.features[key]["shape"]) for key in expected} == {
        k: v["shape"] for k, v in expected.items()
    }
    for key in (contract.STATE_KEY, contract.ACTION_KEY):
        assert dataset.features[key]["names"] == expected[key]["names"]
    actions = np.stack(dataset.hf_dataset.with_format("numpy")[contract.ACTION_KEY][:])[: len(wanted.actions)]
    np.testing.assert_array_equal(actions, wanted.actions.astype(np.float32))
    assert dataset[0]["task"] == wanted.instruction

    trained = tmp_path / "trained"
    lerobot(
        "lerobot-train",
        *("--dataset.repo_id=local/recorded", f"--dataset.root={root}", "--policy.type=act", "--policy.device=cpu"),
        *("--policy.pretrained_backbone_weights=null", "--policy.dim_model=32", "--policy.n_heads=2"),
        *("--policy.dim_feedforward=32", "--policy.chunk_size=4", "--policy.n_action_steps=4"),
        *("--policy.push_to_hub=false", "--steps=2", "--batch_size=2", "--num_workers=0", f"--output_dir={trained}"),
    )
    policy = trained / "checkpoints" / "last" / "pretrained_model"
    assert (policy / "model.safetensors").is_file()

    said = lerobot(
        "lerobot-rollout",
        *("--strategy.type=base", f"--policy.path={policy}", "--task=open", "--duration=3", "--device=cpu"),
        *("--robot.type=robocasa_kitchen", f"--robot.demos={demos}", f"--robot.image_size={PIXELS}"),
        *("--robot.suffix=.vel", f"--fps={contract.CONTROL_HZ}"),
    )
    assert f"Kitchen of seed {wanted.seed}: {wanted.instruction}" in said


@pytest.mark.slow
@pytest.mark.render
def test_teleoperate_drives_the_kitchen(demos: Path) -> None:
    wanted = read_demonstration(demos, "demo_0")
    said = lerobot(
        "lerobot-teleoperate",
        *("--robot.type=robocasa_kitchen", f"--robot.demos={demos}", "--robot.image_size=16"),
        *("--teleop.type=robocasa_replay", f"--teleop.demos={demos}"),
        f"--teleop_time_s={len(wanted.actions) / 10}",
    )
    assert f"The goal is reached: {wanted.instruction}" in said
