"""Samples in a mirror: the robot's own symmetry, pictures, words, statistics, and a training with them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import torch
from safetensors.numpy import load_file
from training_support import losses, tiny

from robocasa_lerobot import contract
from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.data.mixture import MixtureMeta, open_mixture
from robocasa_lerobot.data.mixture_config import LoaderConfig, MemberConfig, MixtureConfig
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.training.augment import augment
from robocasa_lerobot.training.config.phase import AugmentConfig
from robocasa_lerobot.training.mirror import (
    check_mirror,
    mirror,
    mirror_action,
    mirror_state,
    mirror_statistics,
    mirror_text,
)
from robocasa_lerobot.training.phases import run_experiment

STATE, ACTION, TASK = contract.STATE_KEY, contract.ACTION_KEY, contract.TASK_KEY
LEFT, RIGHT, WRIST = contract.IMAGE_KEYS
EEF = contract.slices(contract.STATE_PARTS)


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A dataset of the test's own, of four short episodes with three cameras."""
    return write_fake_dataset(tmp_path / "fake", episodes=4, length=12, image_size=32)


def batch(count: int) -> dict[str, Any]:
    drawn = torch.Generator().manual_seed(0)
    pictures = {key: torch.rand(count, 1, 3, 8, 8, generator=drawn) for key in contract.IMAGE_KEYS}
    state = torch.rand(count, 1, 16, generator=drawn) * 2 - 1
    action = torch.rand(count, 10, 12, generator=drawn) * 2 - 1
    return {**pictures, STATE: state, ACTION: action, TASK: ["Open the left drawer."] * count}


def test_the_robot_is_its_own_mirror_image() -> None:
    """Joints turned the other way put the hand where the mirrored state says, and cameras stand in pairs."""
    env = KitchenEnv("OpenDrawer", split="target")
    env.reset(seed=1)
    model, data = env.model, mujoco.MjData(env.model)
    joints = [model.joint(f"robot0_joint{i}").qposadr[0] for i in range(1, 8)]
    generator = np.random.default_rng(0)
    base = model.body("mobilebase0_support").id
    hand = model.body("robot0_right_hand").id

    def pose(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        data.qpos[joints] = angles
        mujoco.mj_kinematics(model, data)
        turned = data.xmat[base].reshape(3, 3)
        return turned.T @ (data.xpos[hand] - data.xpos[base]), turned.T @ data.xmat[hand].reshape(3, 3)

    flip = np.diag([1.0, -1.0, 1.0])
    for _ in range(20):
        angles = np.array([0, -1.0, 0, -2.2, 0, 1.5, 0.7]) + generator.uniform(-0.5, 0.5, 7)
        other = angles * [-1, 1, -1, 1, -1, 1, -1]
        other[6] += np.pi / 2  # the hand is mounted at 45 degrees
        position, rotation = pose(angles)
        there, turned = pose(other)
        np.testing.assert_allclose(there, flip @ position, atol=1e-9)
        np.testing.assert_allclose(turned, flip @ rotation @ flip, atol=2e-3)  # the 45 degrees are rounded in the model
        state = torch.zeros(16, dtype=torch.float64)
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, rotation.ravel())
        state[EEF["end_effector_rotation_relative"]] = torch.from_numpy(np.roll(quaternion, -1))
        x, y, z, w = mirror_state(state)[EEF["end_effector_rotation_relative"]].tolist()
        seen = np.zeros(9)
        mujoco.mju_quat2Mat(seen, np.array([w, x, y, z]))
        np.testing.assert_allclose(seen.reshape(3, 3), turned, atol=2e-3)
    left, right = (model.camera(f"robot0_agentview_{side}") for side in ("left", "right"))
    wrist = model.camera("robot0_eye_in_hand")
    for camera, other in ((left, right), (wrist, wrist)):
        np.testing.assert_allclose(camera.pos * [1, -1, 1], other.pos)
        # A picture's own sides change as well: its first axis points to the right.
        np.testing.assert_allclose(flip @ axes(camera) @ np.diag([-1, 1, 1]), axes(other), atol=1e-6)
    env.close()


def axes(camera: Any) -> np.ndarray:
    """Axes of a camera in the frame that it is mounted in, (3, 3): right, up, back."""
    out = np.zeros(9)
    mujoco.mju_quat2Mat(out, camera.quat)
    return out.reshape(3, 3)


def test_mirrored_commands_move_the_hand_to_the_mirrored_place() -> None:
    """In free air, through the controllers: the way of the hand is the mirrored one within its own noise."""
    generator = np.random.default_rng(1)
    commands = np.zeros((25, 12), dtype=np.float32)
    commands[:, 4] = commands[:, 11] = -1  # the arm moves, and the hand stays open
    commands[:, 5:11] = generator.uniform(-0.4, 0.4, (1, 6))
    ways = []
    for actions in (commands, mirror_action(torch.from_numpy(commands)).numpy()):
        env = KitchenEnv("OpenDrawer", split="target")
        env.reset(seed=1)
        hand = model_hand(env)
        start = hand()
        for action in actions:
            env.step(action)
        ways.append(hand() - start)
        env.close()
    assert np.linalg.norm(ways[0]) > 0.05
    np.testing.assert_allclose(ways[1], ways[0] * [1, -1, 1], atol=0.02)


def model_hand(env: KitchenEnv) -> Any:
    """Where the hand is in the frame of the base, metres."""
    base, hand = env.model.body("mobilebase0_support").id, env.model.body("robot0_right_hand").id

    def place() -> np.ndarray:
        data = env.data
        return data.xmat[base].reshape(3, 3).T @ (data.xpos[hand] - data.xpos[base])

    return place


def test_twice_mirrored_is_what_it_was() -> None:
    before, chosen = batch(4), torch.tensor([True, False, True, False])
    once = mirror(before, list(contract.IMAGE_KEYS), chosen)
    twice = mirror(once, list(contract.IMAGE_KEYS), chosen)
    for key, value in before.items():
        if key == TASK:
            assert twice[key] == value
            assert once[key] == ["Open the right drawer.", value[1]] * 2
        else:
            assert torch.equal(twice[key], value)
            assert torch.equal(once[key][1::2], value[1::2])
            assert not torch.equal(once[key][0], value[0])
    assert torch.equal(once[LEFT][0], before[RIGHT][0].flip(-1))
    assert torch.equal(once[WRIST][0], before[WRIST][0].flip(-1))


@pytest.mark.parametrize(
    ("text", "seen"),
    [
        ("Turn on the front left burner.", "Turn on the front right burner."),
        ("Left of the rightmost cup.", "Right of the leftmost cup."),
        (
            "Set it the right way up, right beside the left bowl.",
            "Set it the right way up, right beside the right bowl.",
        ),
        ("Carry on until none is left in the left basin.", "Carry on until none is left in the right basin."),
        ("The cup is left of the plate.", "The cup is right of the plate."),
        ("No cabinet should be left open.", "No cabinet should be left open."),
        ("Freeze what is left of the soup, and leave no door left behind.",) * 2,
        ("Make sure that no gap is left at the left drawer.", "Make sure that no gap is left at the right drawer."),
        ("A shelf for each kind: put the pear on the right one.",) * 2,
        ("Fetch the right tool from the right drawer.", "Fetch the right tool from the left drawer."),
        (
            "The fork at the left hand, the spoon right, dishes in the right one.",
            "The fork at the right hand, the spoon left, dishes in the left one.",
        ),
        ("Open the drawer.", "Open the drawer."),
    ],
)
def test_sides_are_swapped_and_other_meanings_are_not(text: str, seen: str) -> None:
    assert mirror_text(text) == seen
    assert mirror_text(seen) == text


def test_statistics_are_those_of_the_data_and_their_mirror_image() -> None:
    generator = np.random.default_rng(0)
    values = {STATE: generator.normal(0.3, 1, (4000, 16)), ACTION: generator.normal(-0.2, 1, (4000, 12))}
    after = {
        STATE: mirror_state(torch.from_numpy(values[STATE])).numpy(),
        ACTION: mirror_action(torch.from_numpy(values[ACTION])).numpy(),
    }
    found = mirror_statistics({key: measured(value) for key, value in values.items()}, 0.25)
    for key, value in values.items():
        joined = measured(np.concatenate([value, value, value, after[key]]))
        for name in ("min", "max", "mean", "std"):
            np.testing.assert_allclose(found[key][name], joined[name], atol=1e-9)
        assert (found[key]["q01"] <= joined["q01"] + 1e-9).all()
        assert (found[key]["q99"] >= joined["q99"] - 1e-9).all()


def measured(values: np.ndarray) -> dict[str, np.ndarray]:
    quantiles = {name: np.quantile(values, q, axis=0) for name, q in (("q01", 0.01), ("q50", 0.5), ("q99", 0.99))}
    ends = {"min": values.min(axis=0), "max": values.max(axis=0)}
    return {
        **ends,
        "mean": values.mean(axis=0),
        "std": values.std(axis=0),
        "count": np.array([len(values)]),
        **quantiles,
    }


def test_processes_mirror_their_part_of_the_batch() -> None:
    config, before = AugmentConfig(mirror=0.5), batch(6)
    whole = augment(before, list(contract.IMAGE_KEYS), config, 3)
    for rank in range(2):
        mine = {key: value[3 * rank : 3 * rank + 3] for key, value in before.items()}
        part = augment(mine, list(contract.IMAGE_KEYS), config, 3, rank, 2)
        assert part[TASK] == whole[TASK][3 * rank : 3 * rank + 3]
        assert torch.equal(part[ACTION], whole[ACTION][3 * rank : 3 * rank + 3])
    assert len(set(whole[TASK])) == 2


def test_data_whose_sides_are_not_known_are_refused(tmp_path: Path, data: Path) -> None:
    features = open_mixture(MixtureConfig(members=[MemberConfig(str(data))]), LoaderConfig()).meta.features

    def refused(changed: dict[str, Any], message: str) -> None:
        with pytest.raises(UserError, match=message):
            check_mirror(MixtureMeta(changed, 20, None, [], 1, 1))

    refused({**features, ACTION: {**features[ACTION], "shape": [7]}}, r"action has the shape \[7\], expected \[12\]")
    refused({key: value for key, value in features.items() if key != STATE}, r"state has the shape \[\]")
    lacking = {key: value for key, value in features.items() if key != RIGHT}
    refused(lacking, "agentview_right in a mirror")
    (data / "meta/info.json").write_text(
        json.dumps({**json.loads((data / "meta/info.json").read_text()), "features": lacking})
    )
    with pytest.raises(UserError, match="agentview_right in a mirror"):
        run_experiment(tiny(tmp_path, data, overrides=["--defaults.augment={mirror: 0.5}"]))


def test_training_with_a_mirror_goes_on_where_it_was(tmp_path: Path, data: Path) -> None:
    """All three cameras, stopped and continued: the losses of a training in one go; statistics are symmetric."""
    overrides = ["--defaults.augment={mirror: 0.5, blank: 0.3, blank_cameras: ['*agentview*']}"]
    assert not run_experiment(tiny(tmp_path / "a", data, overrides=overrides), stop_after=4)
    assert not run_experiment(tiny(tmp_path / "b", data, overrides=overrides), stop_after=2)
    assert not run_experiment(tiny(tmp_path / "b", data, overrides=overrides), stop_after=2)
    assert losses(tmp_path / "a", "pretrain") == losses(tmp_path / "b", "pretrain")
    (path,) = (tmp_path / "a/out/pretrain/checkpoints/last/pretrained_model").glob("policy_pre*normalizer*.safetensors")
    stats, names = load_file(path), contract.component_names(contract.STATE_PARTS)
    low, high = stats[f"{STATE}.min"][names.index("eef_y")], stats[f"{STATE}.max"][names.index("eef_y")]
    assert low == -high < 0
    assert stats[f"{STATE}.mean"][names.index("eef_y")] == pytest.approx(0, abs=1e-6)
