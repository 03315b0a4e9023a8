"""Demonstrations in which the hand is led astray: how far, until when, and what a training makes of them."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from recipe_experiments import experiment_of, made_dataset

from robocasa_lerobot import cli
from robocasa_lerobot.corrections.disturbances import DISTURBED_STEPS, DisturbedDemonstrator, DisturbedSettings
from robocasa_lerobot.data.mixture import MixtureDataset
from robocasa_lerobot.data.mixture_config import MemberConfig, MixtureConfig
from robocasa_lerobot.data.registry.recipes import RecipeConfig
from robocasa_lerobot.demos.motion import grip_position
from robocasa_lerobot.demos.recorder import record_episode
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.making.make import recording_settings
from robocasa_lerobot.making.needs import needs_of
from robocasa_lerobot.training.config.experiment import load_experiment

MOST = 3


def disturbed_runs(decided: np.ndarray) -> list[tuple[int, int]]:
    """First and last frame, exclusively, of each disturbance."""
    edges = np.flatnonzero(np.diff(np.concatenate([[1], decided.astype(int), [1]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


@pytest.mark.costly
@pytest.mark.render
def test_what_led_the_hand_astray_is_not_trained_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["demos", "--tasks=CloseDrawer", "--episodes=2", "--seed=800010", "--workers=1", f"--out={tmp_path}"]
    assert cli.main([*command, f"--disturbances={MOST}"]) == 0
    file = tmp_path / "CloseDrawer.hdf5"
    decided = []
    with h5py.File(file) as content:
        for demo in content["data"].values():
            decided.append(demo["intervention"][()].ravel() > 0)
            runs = disturbed_runs(decided[-1])
            assert 1 <= len(runs) <= MOST
            assert json.loads(demo.attrs["ep_meta"])["disturbances"] == len(runs)
            assert all(last - first < DISTURBED_STEPS[1] for first, last in runs)
            # Commands of the arm are the same throughout a disturbance: nobody looks where it goes.
            arm = demo["actions"][()][:, :6]
            assert all(np.ptp(arm[first:last], axis=0).max() < 1e-6 for first, last in runs)
            assert demo["rewards"][-1] == 1
    assert cli.main(["replay", str(file)]) == 0, "its actions lead to the same states again"
    assert cli.main(["convert", str(file), f"--out={tmp_path / 'data'}", "--image-size=64", "--workers=1"]) == 0
    capsys.readouterr()
    dataset = MixtureDataset(MixtureConfig(members=[MemberConfig(str(tmp_path / "data"), frames="interventions")]))
    dataset.set_windows({"action": [t / dataset.meta.fps for t in range(10)]})
    by_demonstrator = np.concatenate(decided)
    members, frames = dataset.sampler(seed=0).draw(0, 4000)
    assert set(frames.tolist()) == set(np.flatnonzero(by_demonstrator).tolist())
    inside = ~dataset.batch(members, frames)["action_is_pad"].numpy()
    learned = (frames[:, None] + np.arange(10))[inside]
    assert by_demonstrator[learned].all(), "no action of a disturbance is learned from"
    assert not inside.all()


@pytest.mark.costly
@pytest.mark.parametrize(
    "task", ["OpenDrawer", "TurnOnSinkFaucet", "PickPlaceCounterToSink", "OpenCabinet", "CloseToasterOvenDoor"]
)
def test_demonstrators_come_from_where_they_were_led(task: str) -> None:
    settings = DisturbedSettings(task, 1, split="pretrain", disturbances=MOST)
    env = settings.make_env()
    try:
        solved, ways = 0, []
        for seed in range(800_020, 800_023):
            hand: list[np.ndarray] = []
            touched: list[bool] = []

            def watched(env: KitchenEnv, *rest: object, seed: int = seed) -> object:
                demonstrator = DisturbedDemonstrator(np.random.default_rng(seed), MOST)
                for action in demonstrator.act(env, *rest):  # type: ignore[arg-type]
                    hand.append(grip_position(env.data))  # noqa: B023 of this seed
                    touched.append(bool(env.scene.robot_touches(env.data)))  # noqa: B023
                    decided[:] = demonstrator.decided  # noqa: B023
                    yield action

            decided: list[bool] = []
            recording = record_episode(env, seed, actor=watched)  # type: ignore[arg-type]
            solved += recording.success
            runs = disturbed_runs(np.array(decided))
            assert runs
            ways += [float(np.linalg.norm(hand[min(b, len(hand) - 1)] - hand[a])) for a, b in runs]
            assert not any(touched[first] for first, _ in runs), "one that touches something is left alone"
        assert solved >= 2
        assert np.median(ways) > 0.03, f"metres: {ways}"
    finally:
        env.close()


@pytest.mark.render
def test_an_experiment_trains_on_its_own_data(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    selected = {"split": "pretrain", "source": "led", "frames": "interventions"}
    phases = [{"name": "train", "mixture": {"select": [selected]}}]
    file = experiment_of(tmp_path, [made_dataset("led", seed=800_030, disturbances=MOST)], phases)
    (need,) = needs_of(load_experiment(file))[0]
    assert recording_settings(need) == DisturbedSettings(
        "CloseDrawer", 1, split="pretrain", seed=800_030, disturbances=MOST
    )
    assert cli.main(["data", str(file), "--make", "--workers=1"]) == 0
    assert cli.main(["train", f"--config_path={file}"]) == 0
    said = capsys.readouterr().out
    assert "CloseDrawer (all tasks; interventions): 1 episodes" in said
    assert (tmp_path / "out/train/checkpoints/last/pretrained_model").is_dir()


def test_mistakes_are_told() -> None:
    with pytest.raises(UserError, match="disturbances: found -1"):
        DisturbedSettings("CloseDrawer", 1, disturbances=-1).check()
    with pytest.raises(UserError, match="recorded anew"):
        RecipeConfig(disturbances=2, corrects="train")
    with pytest.raises(UserError, match="recorded anew"):
        RecipeConfig(disturbances=2, sources=10)
