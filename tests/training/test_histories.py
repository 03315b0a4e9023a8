"""Histories with offsets: what a policy is trained on is what it sees in a trial, frame by frame."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from policy_support import build, tiny_config

from robocasa_lerobot import contract
from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.data.mixture import MixtureDataset
from robocasa_lerobot.data.mixture_config import MemberConfig, MixtureConfig
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors.actor import ChunkActor, ChunkReply, ChunkRequest, ChunkShape, chunk_seed
from robocasa_lerobot.evaluation.actors.chunk_policy import ChunkPolicy, observation_offsets
from robocasa_lerobot.training.setup.builders import set_windows

LENGTH, PIXELS = 16, 32
HISTORIES: dict[str, dict[str, Any]] = {
    "consecutive": {"n_obs_steps": 3},
    "one": {"n_obs_steps": 1},
    "offsets": {"observation_offsets": [-6, -4, -2, 0]},
    "uneven offsets": {"observation_offsets": [-9, -1, 0]},
}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> MixtureDataset:
    root = write_fake_dataset(tmp_path_factory.mktemp("data") / "fake", episodes=2, length=LENGTH, image_size=PIXELS)
    return MixtureDataset(MixtureConfig([MemberConfig(str(root))]))


def episode(dataset: MixtureDataset, number: int) -> list[dict[str, Any]]:
    """The frames of an episode as an env would show them."""
    dataset.set_windows(None)
    frames = [dataset[number * LENGTH + step] for step in range(LENGTH)]
    return [
        {
            "pixels": {c: frame[contract.image_key(c)].permute(1, 2, 0).numpy() for c in contract.CAMERAS},
            "agent_pos": frame[contract.STATE_KEY].numpy(),
        }
        for frame in frames
    ]


def requests(observations: list[dict[str, Any]], shape: ChunkShape) -> dict[int, ChunkRequest]:
    """What a trial asks its policy for, by step; what nobody is to look at is not there."""
    asked: dict[int, ChunkRequest] = {}
    here = 0

    def predict(request: ChunkRequest) -> ChunkReply:
        asked[here] = request
        return ChunkReply(np.zeros((shape.executed, contract.ACTION_SIZE), np.float32), 0.0)

    actor = ChunkActor("label", shape, predict)
    for here, observation in enumerate(observations):
        actor.act(observation if actor.sees(here) else {"unseen": here}, "open the drawer")
    return asked


@pytest.mark.parametrize("executed", [1, 3, 5])
@pytest.mark.parametrize("history", HISTORIES)
def test_a_trials_history_is_the_window_that_was_trained_on(
    dataset: MixtureDataset, history: str, executed: int
) -> None:
    config = tiny_config(horizon=12, n_action_steps=executed, **HISTORIES[history])
    shape = ChunkShape(executed, observation_offsets(config))
    assert list(shape.offsets) == config.observation_delta_indices
    for number in (0, 1):
        asked = requests(episode(dataset, number), shape)
        assert list(asked) == list(range(0, LENGTH, executed))
        set_windows(dataset, config)
        for step, request in asked.items():
            window = dataset[number * LENGTH + step]
            seen = np.stack([one["agent_pos"] for one in request.observations])
            np.testing.assert_array_equal(seen, window[contract.STATE_KEY])
            padded = [step + offset < 0 for offset in shape.offsets]
            assert window[f"{contract.STATE_KEY}_is_pad"].tolist() == padded
            for camera in contract.CAMERAS:
                pictures = np.stack([one["pixels"][camera] for one in request.observations])
                np.testing.assert_array_equal(pictures, window[contract.image_key(camera)].permute(0, 2, 3, 1))


def test_a_trials_actions_are_those_of_the_window(dataset: MixtureDataset) -> None:
    """Through the processors and the network: only the windows of training and the histories of trials meet here."""

    class Loaded:
        config = tiny_config(horizon=12, n_action_steps=3, **HISTORIES["offsets"])
        policy, pre, post = build(config)

    policy = ChunkPolicy(Loaded(), 1)  # type: ignore[arg-type]
    assert policy.shape == ChunkShape(3, (-6, -4, -2, 0))
    asked = requests(episode(dataset, 1), policy.shape)
    set_windows(dataset, Loaded.config)
    different = set()
    for step, request in asked.items():
        batch = dataset.batch(np.array([0]), np.array([LENGTH + step]))
        batch["task"] = [request.instruction]
        inputs = Loaded.pre({k: v for k, v in batch.items() if k == "task" or k.startswith("observation.")})
        generator = torch.Generator().manual_seed(chunk_seed(request.seed, request.number))
        chunk = Loaded.post(Loaded.policy.predict_action_chunk(inputs, generator=[generator])[0])
        (reply,) = policy.predict([request])
        np.testing.assert_allclose(reply.actions, chunk.numpy(), atol=2e-5)
        different.add(reply.actions.tobytes())
    assert len(different) == len(asked)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"observation_offsets": [-2, -1]}, "ascending control steps up to 0"),
        ({"observation_offsets": [0, -2]}, "ascending control steps up to 0"),
        ({"observation_offsets": []}, "ascending control steps up to 0"),
        ({"observation_offsets": [-2, -2, 0]}, "ascending control steps up to 0"),
        ({"observation_offsets": [-2, 0], "n_obs_steps": 3}, "n_obs_steps is 3, but observation_offsets has 2 steps"),
    ],
)
def test_offsets_that_are_no_history_are_an_error(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(UserError, match=message):
        tiny_config(**settings)


def test_offsets_survive_a_checkpoint(tmp_path: Path) -> None:
    config = tiny_config(horizon=12, n_action_steps=3, **HISTORIES["offsets"])
    policy, _, _ = build(config)
    policy.save_pretrained(tmp_path)
    again = type(policy).from_pretrained(tmp_path).config
    assert (again.observation_offsets, again.n_obs_steps) == ([-6, -4, -2, 0], 4)
    assert again.action_delta_indices[again.n_obs_steps - 1] == 0
