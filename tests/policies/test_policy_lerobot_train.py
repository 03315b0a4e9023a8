"""Our policies in stock LeRobot's training, by its own command, as users give it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from robocasa_lerobot.config_files import configs_folder
from robocasa_lerobot.data.fake import write_fake_dataset

PRESETS: dict[str, dict[str, Any]] = {
    "diffusion_transformer_demo": {},  # one observation: LeRobot's datasets give its pictures without a time axis
    "diffusion_transformer_compact": {"text_encoder": "token", "n_obs_steps": 2, "horizon": 17},
    "flow_vla_demo": {},
}


def lerobot_train(folder: Path, preset: str, **more: Any) -> str:
    """Two steps on a made-up dataset; what the command said."""
    data = write_fake_dataset(folder / "data", episodes=2, length=32, image_size=64)
    file = configs_folder() / "policies" / f"{preset}.yaml"
    settings = {
        "dataset": {"repo_id": "local/data", "root": str(data)},
        "policy": {**yaml.safe_load(file.read_text(encoding="utf-8")), **PRESETS[preset], "device": "cpu"},
        "output_dir": str(folder / "out"),
        "batch_size": 2,
        "steps": 2,
        "num_workers": 0,
        **more,
    }
    settings["policy"]["push_to_hub"] = False
    config = folder / "config.yaml"
    config.write_text(yaml.safe_dump(settings), encoding="utf-8")
    done = subprocess.run(
        [str(Path(sys.executable).with_name("lerobot-train")), f"--config_path={config}"],
        env={**os.environ, "HF_HUB_OFFLINE": "1"},
        capture_output=True,
        text=True,
        timeout=280,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert (folder / "out" / "checkpoints" / "last" / "pretrained_model" / "model.safetensors").is_file()
    return done.stdout + done.stderr


@pytest.mark.costly
@pytest.mark.parametrize("preset", PRESETS)
def test_lerobot_train_trains_our_presets(preset: str, tmp_path: Path) -> None:
    lerobot_train(tmp_path, preset)


@pytest.mark.slow
@pytest.mark.render
def test_lerobot_train_evaluates_in_the_same_kitchens_again_and_again(tmp_path: Path) -> None:
    """It closes its envs after each evaluation, and resets them for the next."""
    env = {"type": "robocasa_kitchen", "task": "OpenDrawer", "image_size": 64, "episode_length": 3}
    rounds = {"n_episodes": 1, "batch_size": 1}
    lerobot_train(tmp_path, "diffusion_transformer_demo", env=env, env_eval_freq=1, eval=rounds)
    films = [path.relative_to(tmp_path / "out/eval").parts[0] for path in (tmp_path / "out/eval").rglob("*.mp4")]
    assert len(set(films)) == len(films) == 2
