"""LeRobot's own commands, unmodified and without a display, record an episode from the kitchen and train on it."""

from __future__ import annotations

import functools
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from robocasa_lerobot import contract
from robocasa_lerobot.cli import main
from robocasa_lerobot.demos.recorder import SUCCESS_HOLD_STEPS
from robocasa_lerobot.demos.replay import read_demonstration

PIXELS = 64
REACHED = "The goal is reached: "
INTERRUPT = b"\x03"


LONG_S = 900  # more than anything takes; a key ends it


def lerobot(command: str, *arguments: str, keys: dict[str, bytes] | None = None) -> str:
    """Run a command of LeRobot's in a terminal without a display; as soon as it says something, press a key there."""
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    terminal, stdin = os.openpty()
    process = subprocess.Popen(
        [str(Path(sys.executable).with_name(command)), *arguments],
        stdin=stdin,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=environment,
        # A shell's background jobs ignore this signal, and so would what they start; in a terminal nobody does.
        preexec_fn=functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    )
    said = ""
    assert process.stdout is not None
    try:
        for line in process.stdout:
            said += line
            for words, key in (keys or {}).items():
                if words in line and key is INTERRUPT:
                    process.send_signal(signal.SIGINT)
                elif words in line:
                    os.write(terminal, key)
        assert process.wait() == 0, said[-4000:]
    finally:
        process.kill()
        process.wait()
        os.close(terminal)
        os.close(stdin)
    return said


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
        *("--dataset.num_episodes=1", f"--dataset.episode_time_s={LONG_S}"),
        *("--dataset.reset_time_s=0", f"--dataset.single_task={wanted.instruction}"),
        *("--dataset.push_to_hub=false", "--play_sounds=false", "--dataset.rgb_encoder.vcodec=h264"),
        keys={REACHED: b"n"},
    )
    assert REACHED + wanted.instruction in said

    dataset = LeRobotDataset("local/recorded", root=root)
    expected = contract.dataset_features((PIXELS, PIXELS))
    assert dataset.meta.robot_type == contract.ROBOT_TYPE
    assert dataset.fps == contract.CONTROL_HZ
    assert {key: tuple(dataset.features[key]["shape"]) for key in expected} == {
        k: v["shape"] for k, v in expected.items()
    }
    for key in (contract.STATE_KEY, contract.ACTION_KEY):
        assert dataset.features[key]["names"] == expected[key]["names"]
    actions = np.stack(dataset.hf_dataset.with_format("numpy")[contract.ACTION_KEY][:])
    # The key comes some steps after the goal; the demonstration itself holds it for as long as a recording asks.
    both = min(len(actions), len(wanted.actions))
    assert both > len(wanted.actions) - SUCCESS_HOLD_STEPS
    np.testing.assert_array_equal(actions[:both], wanted.actions[:both].astype(np.float32))
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
        f"--teleop_time_s={LONG_S}",
        keys={REACHED: INTERRUPT},
    )
    assert REACHED + wanted.instruction in said
