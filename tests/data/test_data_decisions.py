"""Samples of a mixture by who decided them: a person's corrections and the policy's own steps, each with a weight."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robocasa_lerobot import contract
from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.data.mixture import MixtureDataset
from robocasa_lerobot.data.mixture_config import MemberConfig, MixtureConfig
from robocasa_lerobot.data.reading.decisions import frame_pool
from robocasa_lerobot.data.sampler import MixtureSampler
from robocasa_lerobot.errors import UnknownNameError, UserError

LENGTH = 6


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    write_fake_dataset(folder / "plain", episodes=2, length=LENGTH)
    write_fake_dataset(folder / "corrected", episodes=3, length=LENGTH, decisions=True)
    return folder


def mixture(data: Path) -> MixtureDataset:
    return MixtureDataset(
        MixtureConfig(
            members=[
                MemberConfig(str(data / "plain"), weight=0.5),
                MemberConfig(str(data / "corrected"), frames="interventions", weight=0.4),
                MemberConfig(str(data / "corrected"), frames="autonomous", weight=0.1),
            ]
        )
    )


def test_samples_start_where_the_member_says_and_as_often(data: Path) -> None:
    dataset = mixture(data)
    assert dataset.meta.total_frames == 2 * LENGTH + 3 * LENGTH
    members, frames = dataset.sampler(seed=0).draw(0, 20_000)
    place = frames % LENGTH
    assert set(place[members == 0]) == set(range(LENGTH))
    assert set(place[members == 1]) == {3, 4, 5}
    assert set(place[members == 2]) == {0, 1, 2}
    assert {len(set(frames[members == number])) for number in (1, 2)} == {9}
    assert np.allclose(np.bincount(members) / len(members), [0.5, 0.4, 0.1], atol=0.015)
    assert "interventions" in dataset.describe()
    for dropped, left in ((2, {3}), (4, {3}), (1, {3, 4})):  # an episode keeps its first frame of the kind
        members, frames = dataset.sampler(seed=0, drop_last_frames=dropped).draw(0, 5_000)
        assert set(frames[members == 1] % LENGTH) == left


def test_an_episode_first_of_frames_of_a_kind(data: Path) -> None:
    """Each episode as often as another, though one of them has but one frame of the kind left."""
    source = mixture(data).sources[data / "corrected"]
    wanted = np.zeros(3 * LENGTH, dtype=bool)
    wanted[[0, 1, 3, LENGTH + 5]] = True  # two runs, a last frame, and none of the third
    pool = frame_pool(source, np.arange(3), wanted, drop_last_frames=1)
    assert pool.of_episodes is not None
    assert pool.of_episodes.tolist() == [3, 1]
    _, frames = MixtureSampler([pool], np.array([1.0]), seed=0, episodes_first=True).draw(0, 20_000)
    shares = np.bincount(frames, minlength=3 * LENGTH) / 20_000
    assert np.allclose(shares[[0, 1, 3, LENGTH + 5]], [1 / 6, 1 / 6, 1 / 6, 1 / 2], atol=0.015)


def test_policies_do_not_see_who_decided(data: Path) -> None:
    dataset = mixture(data)
    assert contract.decision_key("intervention") not in dataset.meta.features
    batch = dataset.batch(np.array([0, 1]), np.array([0, 4]))
    assert not [key for key in batch if key.startswith(contract.EXTRA_PREFIX)]
    assert contract.decision_key("intervention") not in dataset.statistics(images=False)


def test_what_says_nothing_has_no_such_frames(data: Path) -> None:
    with pytest.raises(UserError, match=r"needs the feature extra\.intervention"):
        MixtureDataset(MixtureConfig(members=[MemberConfig(str(data / "plain"), frames="autonomous")]))
    with pytest.raises(UnknownNameError, match="Did you mean 'interventions'"):
        MemberConfig("x", frames="intervention")
    write_fake_dataset(data / "person_alone", episodes=1, length=1, decisions=True)
    with pytest.raises(UserError, match="no frame is left with frames=autonomous"):
        MixtureDataset(MixtureConfig(members=[MemberConfig(str(data / "person_alone"), frames="autonomous")]))
    kept = MixtureDataset(
        MixtureConfig(
            members=[
                MemberConfig(str(data / "person_alone"), frames="autonomous"),
                MemberConfig(str(data / "corrected"), frames="autonomous"),
            ]
        )
    )
    assert [member.root for member in kept.config.members] == [str(data / "corrected")], (
        "a dataset without any is left out"
    )
    assert kept.probabilities.tolist() == [1.0]


def test_actions_end_where_somebody_else_decides(data: Path) -> None:
    """And begin: the policy's steps, 0 to 2, come before the person's, 3 to 5. What was seen before still is."""
    dataset = mixture(data)
    windows = {"action": range(-1, 3), "observation.state": range(-1, 1)}
    dataset.set_windows({key: [t / dataset.meta.fps for t in steps] for key, steps in windows.items()})
    members, frames = np.array([0, 1, 2, 2, 1]), np.array([1, 4, LENGTH, LENGTH + 1, 3])
    batch = dataset.batch(members, frames)
    assert batch["action_is_pad"].tolist() == [
        [False, False, False, False],  # whoever decides
        [False, False, False, True],  # to the end of the episode
        [True, False, False, False],
        [False, False, False, True],  # what follows is not the policy's
        [True, False, False, False],  # what came before is not the person's
    ]
    assert not batch["observation.state_is_pad"][4].any()
    everything = dataset.sources[data / "corrected"].columns["action"]
    for row, indices in ((1, [3, 4, 5, 5]), (3, [LENGTH, LENGTH + 1, LENGTH + 2, LENGTH + 2])):
        assert np.array_equal(batch["action"][row], everything[indices])
