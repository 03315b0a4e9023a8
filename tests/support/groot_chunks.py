"""GR00T, tiny and with random weights, asked for chunks and step by step: the same actions.

HF_HOME=FOLDER python groot_chunks.py FOLDER      # with `tests` and `tests/support/tiny_gemma` on PYTHONPATH
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import torch
from evaluation_env import SlideEnv
from walk_hub import REPOSITORIES, TINY_BACKBONE, write_hub

from robocasa_lerobot import contract
from robocasa_lerobot.data.mixture import MixtureMeta
from robocasa_lerobot.evaluation.actors.actor import ChunkRequest, chunk_seed
from robocasa_lerobot.evaluation.actors.checkpoint import read_source
from robocasa_lerobot.evaluation.actors.chunk_policy import ChunkPolicy, LoadedCheckpoint
from robocasa_lerobot.evaluation.actors.policy_runner import StepPolicy
from robocasa_lerobot.training.setup import builders

SIZE = 64
NEEDED = (TINY_BACKBONE, "nvidia/Cosmos-Reason2-2B", "nvidia/GR00T-N1.7-3B")


def write_checkpoint(folder: Path) -> Path:
    settings = {
        "type": "groot", "base_model_path": "nvidia/GR00T-N1.7-3B", "chunk_size": 16, "n_action_steps": 16,
        "num_inference_timesteps": 4, "use_bf16": False,
    }  # fmt: skip
    meta = MixtureMeta(contract.dataset_features((SIZE, SIZE)), contract.VIDEO_FPS, contract.ROBOT_TYPE, ["open"], 1, 1)
    sizes = {contract.STATE_KEY: contract.STATE_SIZE, contract.ACTION_KEY: contract.ACTION_SIZE}
    spread = np.linspace(1, 2, contract.STATE_SIZE)
    meta.stats = {key: {"min": -spread[:n], "max": spread[:n] + 0.5} for key, n in sizes.items()}
    config = builders.policy_config(settings, None, "cpu")
    policy = builders.make_phase_policy(config, meta, None)
    for part in (policy, *builders.make_processors(config, meta, None, keep_statistics=False)):
        part.save_pretrained(folder)
    return folder


def main() -> None:
    torch.set_num_threads(1)
    home = Path(sys.argv[1])
    for name in set(REPOSITORIES) - set(NEEDED):
        del REPOSITORIES[name]
    write_hub(home)
    source = read_source(str(write_checkpoint(home / "checkpoint")))
    loaded = LoadedCheckpoint(source, "cpu", None)
    assert ChunkPolicy.serves(loaded)
    chunked, steps, env = ChunkPolicy(loaded, 1), StepPolicy(loaded), SlideEnv("Slide", image_size=SIZE)
    assert chunked.shape.executed == 16
    observation, _ = env.reset(seed=1)
    (reply,) = chunked.predict([ChunkRequest("p", (observation,), "open the drawer", 5, 0)])
    steps.reset(chunk_seed(5, 0), env)
    theirs = np.stack([steps.act(observation, "open the drawer") for _ in range(16)])
    assert reply.actions.shape == (16, contract.ACTION_SIZE)
    assert np.ptp(theirs, axis=0).max() > 0.01, "all actions are alike"
    np.testing.assert_allclose(reply.actions, theirs, atol=1e-6)


if __name__ == "__main__":
    main()
