"""Episodes that a policy begins and a demonstrator ends: who decided each step, and what a training makes of them."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from recipe_experiments import experiment_of, made_dataset

from robocasa_lerobot import cli
from robocasa_lerobot.corrections.settings import CorrectionSettings
from robocasa_lerobot.corrections.takeover import Takeover
from robocasa_lerobot.data.mixture import MixtureDataset
from robocasa_lerobot.data.mixture_config import MemberConfig, MixtureConfig
from robocasa_lerobot.demos.recorder import record_episode
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.errors import LackingMachineError, UnknownNameError
from robocasa_lerobot.evaluation.actors.reference_policies import DemonstratorPolicy, RandomPolicy
from robocasa_lerobot.making.needs import needs_of
from robocasa_lerobot.training.config.experiment import load_experiment

AFTER = 30


def correct(out: Path, *options: str, task: str = "CloseDrawer") -> int:
    words = ["correct", "--policy=random", f"--tasks={task}", "--episodes=1", "--seed=780000", "--workers=1"]
    return cli.main([*words, f"--after={AFTER}", f"--out={out}", *options])


@pytest.mark.render
def test_what_a_demonstrator_corrects_can_be_trained_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert correct(tmp_path) == 0
    assert "CloseDrawer: 1 of 1 episodes corrected, for" in capsys.readouterr().out
    file = tmp_path / "CloseDrawer.hdf5"
    with h5py.File(file) as content:
        demo = content["data/demo_0"] if "demo_0" in content["data"] else next(iter(content["data"].values()))
        corrected = demo["intervention"][()].ravel()
        actions, asked = demo["actions"][()], demo["policy_action"][()]
        meta = json.loads(demo.attrs["ep_meta"])
        rewards = demo["rewards"][()]
    assert not corrected[:AFTER].any()
    assert corrected[AFTER:].all()
    assert len(corrected) > AFTER + 20
    assert np.array_equal(actions[:AFTER], asked[:AFTER])
    assert rewards[-1] == 1, "the demonstrator has solved it"
    assert meta["correction"] | {"fingerprint": ""} == {
        "policy": "random",
        "fingerprint": "",
        "after_steps": AFTER,
        "corrected_steps": len(corrected) - AFTER,
    }
    assert cli.main(["replay", str(file)]) == 0, "its actions lead to the same states again"
    assert cli.main(["convert", str(file), f"--out={tmp_path / 'data'}", "--image-size=64", "--workers=1"]) == 0
    dataset = MixtureDataset(
        MixtureConfig(
            members=[
                MemberConfig(str(tmp_path / "data")),
                MemberConfig(str(tmp_path / "data"), frames="interventions"),
            ]
        )
    )
    assert "interventions" in dataset.describe()
    members, frames = dataset.sampler(seed=0).draw(0, 500)
    assert frames[members == 1].min() >= AFTER
    capsys.readouterr()


def test_what_a_policy_solves_is_left_to_it() -> None:
    env = KitchenEnv("CloseDrawer", cameras=(), terminate_on_success=False)
    try:
        takeover = Takeover(DemonstratorPolicy(), noise_seed=0, after_steps=200)
        recording = record_episode(env, 780_001, actor=takeover.act)
        assert recording.success
        assert takeover.corrected == [False] * len(recording.actions)
        # Solved when its time is up, but not long enough yet: it goes on.
        solved = int(np.flatnonzero(recording.rewards)[0])
        takeover = Takeover(DemonstratorPolicy(), noise_seed=0, after_steps=solved + 3)
        assert record_episode(env, 780_001, actor=takeover.act).success
        assert not any(takeover.corrected)
    finally:
        env.close()


@pytest.mark.costly
@pytest.mark.parametrize("task", ["OpenDrawer", "TurnOnMicrowave", "PickPlaceCounterToSink"])
def test_skills_begin_wherever_a_policy_has_led_the_hand(task: str) -> None:
    env = KitchenEnv(task, cameras=(), terminate_on_success=False, split="pretrain", horizon=1500)
    try:
        solved = 0
        for seed in range(780_010, 780_013):
            takeover = Takeover(RandomPolicy(), noise_seed=seed, after_steps=60)
            recording = record_episode(env, seed, actor=takeover.act)
            assert sum(not by_hand for by_hand in takeover.corrected) == 60
            solved += recording.success
        assert solved >= 2
    finally:
        env.close()


def test_what_the_policy_asked_for_has_no_noise() -> None:
    settings = CorrectionSettings.of("zero", task="CloseDrawer", episodes=1, action_noise=0.1, after_steps=(20, 20))
    env = settings.make_env()
    try:
        recording = settings.record(env, 780_000)
    finally:
        env.close()
    asked, arm = recording.per_step["policy_action"], slice(0, 6)
    assert not asked[:20, arm].any()
    assert recording.actions[:20, arm].any()
    assert np.array_equal(asked[20:], recording.actions[20:])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--policy=nowhere"], "no such folder"),
        (["--policy=demonstrator"], "nothing to correct"),
        (["--after=0"], "expected two numbers of control steps"),
        (["--after=5,3"], "expected two numbers of control steps"),
        (["--images", "--image-size=64"], "sees 256 pixels"),
    ],
)
def test_mistakes_are_told(options: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert correct(tmp_path / "out", *options) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_another_policy_does_not_go_on_where_one_was_corrected(tmp_path: Path) -> None:
    settings = CorrectionSettings.of("zero", task="CloseDrawer", episodes=1)
    settings.check_ready()
    assert settings.identity()["after_steps"] == [100, 250]
    assert settings.identity() != CorrectionSettings.of("random", task="CloseDrawer", episodes=1).identity()
    with pytest.raises(LackingMachineError, match="another policy"):
        CorrectionSettings("CloseDrawer", 1, policy="zero", fingerprint="random").check_ready()


def experiment(folder: Path, corrects: str) -> Path:
    """Of two phases, the second of which is trained on corrections of one."""
    datasets = [
        made_dataset("shown", seed=780_100),
        made_dataset("corrected", seed=780_200, corrects=corrects, after=[20, 20]),
    ]
    shown, corrected = ({"split": "pretrain", "source": source} for source in ("shown", "corrected"))
    phases = [
        {"name": "first", "mixture": {"select": [shown]}},
        {"name": "second", "mixture": {"select": [shown, {**corrected, "frames": "interventions"}]}},
    ]
    return experiment_of(folder, datasets, phases)


def test_corrections_wait_for_their_policy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = experiment(tmp_path, "first")
    needs = needs_of(load_experiment(file))[0]
    assert [(need.policy, need.waits) for need in needs] == [(None, False), (tmp_path / "out/first", True)]
    assert [need.source for need in needs_of(load_experiment(file), phase="first")[0]] == ["shown"]
    assert cli.main(["data", str(file)]) == 0
    assert f"our demonstrators, correcting {tmp_path / 'out/first'}" in capsys.readouterr().out
    with pytest.raises(UnknownNameError, match="Did you mean 'first'"):
        needs_of(load_experiment(experiment(tmp_path, "fist")))


@pytest.mark.slow
@pytest.mark.render
def test_an_experiment_corrects_what_it_has_trained(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = str(experiment(tmp_path, "first"))
    assert cli.main(["data", file, "--make", "--workers=1"]) == 0
    assert "comes later: it corrects the policy of" in capsys.readouterr().out
    assert cli.main(["train", f"--config_path={file}", "--phase=first"]) == 0
    assert cli.main(["data", file, "--make", "--workers=1"]) == 0
    assert "comes later" not in capsys.readouterr().out
    assert cli.main(["train", f"--config_path={file}", "--phase=second"]) == 0
    assert (tmp_path / "out/second/checkpoints/last/pretrained_model").is_dir()
