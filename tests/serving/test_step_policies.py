"""A policy of LeRobot's with queues and noise of its own: each client has its own, on the same weights."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from serving_support import SIZE, observation, own_names, serving
from websockets.sync.client import ClientConnection, connect

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors.checkpoint import read_source
from robocasa_lerobot.evaluation.actors.chunk_policy import LoadedCheckpoint
from robocasa_lerobot.evaluation.actors.policy_runner import StepPolicy
from robocasa_lerobot.serving.host import Host
from robocasa_lerobot.serving.policy import load_served
from robocasa_lerobot.wire.codec import decode, encode

INSTRUCTION = "open the left drawer"
STEPS = 6  # chunks of 4


@pytest.fixture(scope="module")
def diffusion(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """LeRobot's Diffusion Policy, small, with random weights: 2 observations, 4 executed steps, noise."""
    import torch
    from lerobot.configs.types import FeatureType, PolicyFeature
    from lerobot.policies.diffusion.configuration_diffusion import DiffusionConfig
    from lerobot.policies.factory import get_policy_class, make_pre_post_processors

    torch.manual_seed(0)
    images = {key: PolicyFeature(FeatureType.VISUAL, (3, SIZE, SIZE)) for key in contract.IMAGE_KEYS}
    state = {contract.STATE_KEY: PolicyFeature(FeatureType.STATE, (contract.STATE_SIZE,))}
    config = DiffusionConfig(
        input_features={**images, **state},
        output_features={contract.ACTION_KEY: PolicyFeature(FeatureType.ACTION, (contract.ACTION_SIZE,))},
        device="cpu",
        horizon=8,
        n_action_steps=4,
        pretrained_backbone_weights=None,
        use_group_norm=True,
        crop_is_random=False,
        down_dims=(16, 32),
        diffusion_step_embed_dim=16,
        spatial_softmax_num_keypoints=4,
        num_inference_steps=2,
    )
    folder = tmp_path_factory.mktemp("diffusion") / "pretrained_model"
    get_policy_class(config.type)(config).save_pretrained(folder)
    sizes = {contract.STATE_KEY: contract.STATE_SIZE, contract.ACTION_KEY: contract.ACTION_SIZE}
    stats: dict[str, Any] = {key: {"min": -torch.ones(n), "max": torch.ones(n)} for key, n in sizes.items()}
    stats |= {key: {"mean": torch.zeros(3, 1, 1), "std": torch.ones(3, 1, 1)} for key in contract.IMAGE_KEYS}
    for processor in make_pre_post_processors(config, dataset_stats=stats):
        processor.save_pretrained(folder)
    return folder


def alone(path: Path, seed: int, first: int) -> list[np.ndarray]:
    """The actions of a trial in process."""
    steps = StepPolicy(LoadedCheckpoint(read_source(str(path)), "cpu", None))
    steps.reset(seed, None)
    return [steps.act(observation(first + step), INSTRUCTION) for step in range(STEPS)]


def ask(connection: ClientConnection, step: int, seed: int, number: int) -> Any:
    message = own_names([observation(step)], INSTRUCTION)
    connection.send(encode({**message, "seed": seed, "number": number}, "openpi"))
    answer = connection.recv(timeout=60)
    return decode(answer)["actions"][0] if isinstance(answer, bytes) else answer


def test_clients_that_take_turns_get_what_each_would_get_alone(diffusion: Path) -> None:
    policy = load_served(read_source(str(diffusion)), "cpu")
    assert policy.served.executed == 1
    expected = {7: alone(diffusion, 7, 0), 8: alone(diffusion, 8, 100)}
    with serving(Host(policy), "openpi") as port:
        url = f"ws://127.0.0.1:{port}"
        with connect(url, compression=None) as one, connect(url, compression=None) as other:
            for connection in (one, other):
                assert decode(connection.recv(timeout=30))["executed_steps"] == 1
            for _ in range(2):  # the second trial starts from nothing
                for step in range(STEPS):
                    np.testing.assert_array_equal(ask(one, step, 7, step), expected[7][step])
                    np.testing.assert_array_equal(ask(other, 100 + step, 8, step), expected[8][step])
            assert "expected 6" in ask(one, 0, 7, 9)
            assert "remembers earlier steps" in ask(other, 0, 9, 3)


def test_executed_steps_of_such_a_policy_are_its_own_matter(diffusion: Path) -> None:
    with pytest.raises(UserError, match="answers step by step"):
        load_served(read_source(str(diffusion)), "cpu", executed_steps=2)
