"""LeRobot's own command, unmodified, evaluates a checkpoint of our policy in our kitchens."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from policy_support import tiny_config, unit_stats

from robocasa_lerobot.policies.diffusion_transformer.modeling_diffusion_transformer import DiffusionTransformerPolicy
from robocasa_lerobot.policies.diffusion_transformer.processor_diffusion_transformer import (
    make_diffusion_transformer_pre_post_processors,
)

PIXELS = 32


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An untrained policy, saved as training saves it."""
    folder = tmp_path_factory.mktemp("checkpoint") / "pretrained_model"
    config = tiny_config(pixels=PIXELS, push_to_hub=False)
    DiffusionTransformerPolicy(config).save_pretrained(folder)
    for processor in make_diffusion_transformer_pre_post_processors(config, dataset_stats=unit_stats()):
        processor.save_pretrained(folder)
    return folder


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
