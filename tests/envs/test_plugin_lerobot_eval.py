"""LeRobot's own command, unmodified, evaluates checkpoints of our policies in our kitchens."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from flow_vla_support import tiny_config as tiny_vla
from lerobot.configs import PreTrainedConfig
from policy_support import build, tiny_config

PIXELS = 32


def save(folder: Path, config: PreTrainedConfig) -> Path:
    """An untrained policy, saved as training saves it."""
    for part in build(config):
        part.save_pretrained(folder)
    return folder


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("checkpoint") / "pretrained_model"
    return save(folder, tiny_config(pixels=PIXELS, push_to_hub=False))


def lerobot_eval(checkpoint: Path, out: Path, *arguments: str) -> dict[str, object]:
    done = subprocess.run(
        [
            str(Path(sys.executable).with_name("lerobot-eval")),
            f"--policy.path={checkpoint}",
            "--env.type=robocasa_kitchen",
            f"--env.image_size={PIXELS}",
            "--env.episode_length=3",
            f"--output_dir={out}",
            "--policy.device=cpu",
            *arguments,
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-4000:]
    return dict(json.loads((out / "eval_info.json").read_text(encoding="utf-8")))


@pytest.mark.render
def test_one_task(checkpoint: Path, tmp_path: Path) -> None:
    info = lerobot_eval(
        checkpoint, tmp_path / "out", "--env.task=OpenDrawer", "--eval.n_episodes=1", "--eval.batch_size=1"
    )
    assert info["overall"]["n_episodes"] == 1  # type: ignore[index]
    assert list(info["per_group"]) == ["OpenDrawer"]  # type: ignore[call-overload]
    assert list((tmp_path / "out" / "videos").rglob("*.mp4"))


@pytest.mark.render
@pytest.mark.slow
def test_flow_vla_in_other_kitchens_and_another_preset(tmp_path: Path) -> None:
    folder = save(tmp_path / "pretrained_model", tiny_vla(push_to_hub=False))
    info = lerobot_eval(
        folder,
        tmp_path / "out",
        "--env.task=OpenDrawer",
        "--env.split=pretrain",
        "--env.render_preset=quality",
        "--eval.n_episodes=1",
        "--eval.batch_size=1",
    )
    assert info["overall"]["n_episodes"] == 1  # type: ignore[index]


@pytest.mark.render
@pytest.mark.slow
def test_two_tasks_in_two_processes_through_the_discovery_flag(checkpoint: Path, tmp_path: Path) -> None:
    info = lerobot_eval(
        checkpoint,
        tmp_path / "out",
        "--env.discover_packages_path=robocasa_lerobot.plugins",
        "--env.task=OpenDrawer,CloseDrawer",
        "--eval.n_episodes=2",
        "--eval.batch_size=2",
    )
    assert info["overall"]["n_episodes"] == 4  # type: ignore[index]
    assert set(info["per_group"]) == {"OpenDrawer", "CloseDrawer"}  # type: ignore[call-overload]
