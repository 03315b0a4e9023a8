"""Phases that go on, or begin from others, after settings, data or earlier phases have changed."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
import yaml
from training_support import experiment_file, metrics, tiny

from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.training.config.experiment import load_experiment
from robocasa_lerobot.training.phases import run_experiment
from robocasa_lerobot.training.setup import builders
from robocasa_lerobot.training.setup.build_phase import planned_policy


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_fake_dataset(tmp_path_factory.mktemp("data") / "fake", episodes=6, length=12, image_size=32)


@pytest.fixture(scope="module")
def begun(tmp_path_factory: pytest.TempPathFactory, data: Path) -> Path:
    """Folder of an experiment whose first phase has made two of its four steps."""
    folder = tmp_path_factory.mktemp("begun")
    assert not run_experiment(tiny(folder, data), stop_after=2)
    return folder


def copied(begun: Path, folder: Path) -> Path:
    shutil.copytree(begun / "out", folder / "out", symlinks=True)
    return folder


def test_a_copy_that_followed_the_link_to_the_last_checkpoint_goes_on(tmp_path: Path, data: Path, begun: Path) -> None:
    shutil.copytree(begun / "out", tmp_path / "out")
    assert not (tmp_path / "out/pretrain/checkpoints/last").is_symlink()
    assert not run_experiment(tiny(tmp_path, data), stop_after=1)
    assert (tmp_path / "out/pretrain/checkpoints/last").resolve().name == "000003"


def saved_config(folder: Path, phase: str) -> dict[str, object]:
    config: dict[str, object] = json.loads(
        (folder / "out" / phase / "checkpoints/last/pretrained_model/config.json").read_text()
    )
    return config


@pytest.mark.parametrize("setting", ["width=32", "constant_range=0.1"])
def test_what_was_refused_is_refused_again(setting: str, tmp_path: Path, data: Path, begun: Path) -> None:
    """Settings that a begun phase could not take are not those of its folder afterwards."""
    folder = copied(begun, tmp_path)
    before = (folder / "out/experiment.yaml").read_text()
    changed = tiny(folder, data, overrides=[f"--policy.{setting}"])
    with pytest.raises(UserError):
        run_experiment(changed, force=True)
    assert (folder / "out/experiment.yaml").read_text() == before
    with pytest.raises(UserError, match="with other settings"):
        run_experiment(changed)
    assert run_experiment(tiny(folder, data))


def test_what_began_before_a_setting_came_to_be_goes_on(tmp_path: Path, data: Path, begun: Path) -> None:
    """As `augment.mirror`, of which an experiment of an earlier version says nothing."""
    folder = copied(begun, tmp_path)
    path = folder / "out/experiment.yaml"
    old = yaml.safe_load(path.read_text())
    del old["trackers"], old["registry"]
    for phase in old["phases"]:
        del phase["compile"], phase["ema"]["enabled"]
    path.write_text(yaml.safe_dump(old))
    with pytest.raises(UserError, match=r"phases\.pretrain\.compile: False -> True"):
        run_experiment(tiny(folder, data, overrides=["--defaults.compile=true"]))
    assert run_experiment(tiny(folder, data))


def test_forced_settings_of_the_policy_are_those_of_later_phases(tmp_path: Path, data: Path, begun: Path) -> None:
    folder = copied(begun, tmp_path)
    assert not run_experiment(tiny(folder, data), stop_after=2)  # the first phase is finished, the second not begun
    assert not (folder / "out/finetune").exists()
    assert run_experiment(tiny(folder, data, overrides=["--policy.num_inference_steps=5"]), force=True)
    assert saved_config(folder, "pretrain")["num_inference_steps"] != 5
    assert saved_config(folder, "finetune")["num_inference_steps"] == 5


def test_steps_that_end_with_a_phase_make_none_of_the_next(
    tmp_path: Path, data: Path, begun: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = copied(begun, tmp_path)
    assert not run_experiment(tiny(folder, data), stop_after=2)
    assert "stopped before phase finetune" in capsys.readouterr().out
    assert [line["step"] for line in metrics(folder, "pretrain")] == [1, 2, 3, 4]
    assert run_experiment(tiny(folder, data), stop_after=4), "the last step of all leaves nothing to stop for"


def test_a_phase_whose_start_was_trained_anew_is_told(tmp_path: Path, data: Path, begun: Path) -> None:
    folder = copied(begun, tmp_path)
    assert run_experiment(tiny(folder, data))
    assert run_experiment(tiny(folder, data)), "nothing has changed"
    shutil.rmtree(folder / "out/pretrain")
    assert run_experiment(tiny(folder, data), only="pretrain")
    with pytest.raises(UserError, match=r"'finetune' .* started from weights of 'pretrain' that are gone.* Remove .*"):
        run_experiment(tiny(folder, data))
    shutil.rmtree(folder / "out/finetune")
    assert run_experiment(tiny(folder, data))


def test_what_has_begun_needs_its_start_no_more_and_that_is_not_trained_anew(
    tmp_path: Path, data: Path, begun: Path
) -> None:
    folder = copied(begun, tmp_path)
    assert not run_experiment(tiny(folder, data), stop_after=4), "two steps of the next"
    about = (folder / "out/finetune/phase.json").read_bytes()
    shutil.rmtree(folder / "out/pretrain/checkpoints")  # for its disk space
    with pytest.raises(
        UserError, match=r"'pretrain' has no checkpoint .* and 'finetune', .* `--phase finetune` goes on"
    ):
        run_experiment(tiny(folder, data))
    assert not (folder / "out/pretrain/checkpoints").exists()
    assert run_experiment(tiny(folder, data), only="finetune")
    before, now = json.loads(about), json.loads((folder / "out/finetune/phase.json").read_text())
    assert {key: now[key] for key in ("run", "init", "init_run")} == {
        key: before[key] for key in ("run", "init", "init_run")
    }


def test_other_episodes_of_the_same_data_are_told(tmp_path: Path, data: Path, begun: Path) -> None:
    """As where a set of tasks, or the share that is held out, means something else in a later version."""
    folder = copied(begun, tmp_path)
    path = folder / "out/pretrain/phase.json"
    about = json.loads(path.read_text())
    path.write_text(json.dumps({**about, "selection_fingerprint": "of before"}))
    before = (folder / "out/experiment.yaml").read_text()
    with pytest.raises(UserError, match=r"begun with other episodes of its data.*--resume=force"):
        run_experiment(tiny(folder, data))
    assert (folder / "out/experiment.yaml").read_text() == before
    assert run_experiment(tiny(folder, data), force=True)
    assert json.loads(path.read_text())["run"] == about["run"]


def test_features_that_a_later_phase_lacks_are_told_before_the_first(tmp_path: Path, data: Path) -> None:
    lacking = Path(shutil.copytree(data, tmp_path / "lacking"))
    info = json.loads((lacking / "meta/info.json").read_text())
    camera = next(key for key in info["features"] if "eye_in_hand" in key)
    del info["features"][camera]
    (lacking / "meta/info.json").write_text(json.dumps(info))
    path = experiment_file(tmp_path, data)
    content = yaml.safe_load(path.read_text())
    content["phases"][1]["mixture"] = {"members": [{"root": str(lacking)}]}
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(UnknownNameError, match=f"{camera}.*what phase 'pretrain' trains"):
        run_experiment(load_experiment(path))
    assert not (tmp_path / "out").exists()
    content["phases"][1]["policy"] = {"leave_out": [camera]}  # of which the settings speak
    path.write_text(yaml.safe_dump(content))
    assert not run_experiment(load_experiment(path), stop_after=1)


def test_cameras_to_crop_that_are_none_are_told(tmp_path: Path, data: Path) -> None:
    blanks = "--phases.pretrain.augment={blank: 0.5, blank_cameras: ['*agentview_lefft']}"
    with pytest.raises(UnknownNameError, match="blank_cameras"):
        run_experiment(tiny(tmp_path, data, overrides=[blanks]))
    crops = "--phases.pretrain.augment={crop: 0.9, crop_cameras: ['*agentview_lefft']}"
    with pytest.raises(UnknownNameError, match="crop_cameras"):
        run_experiment(tiny(tmp_path, data, overrides=[crops]))


def test_a_policy_without_a_schedule_warms_up_where_it_is_asked_to(tmp_path: Path, data: Path) -> None:
    experiment = load_experiment(
        experiment_file(tmp_path, data, "act"),
        ["--phases.pretrain.warmup_steps=2", "--phases.pretrain.learning_rate=1e-4"],
    )
    assert run_experiment(experiment, only="pretrain")
    rates = [line["learning_rate"] for line in metrics(tmp_path, "pretrain")]
    assert rates == pytest.approx([0.0, 5e-5, 1e-4, 1e-4])


def test_settings_of_a_policy_are_laid_over_its_own(tmp_path: Path, data: Path) -> None:
    def mapping(*overrides: str) -> dict[str, str]:
        settings, start = planned_policy(experiment := tiny(tmp_path, data, overrides=overrides), experiment.phases[1])
        found = builders.policy_config(settings, start, "cpu").normalization_mapping
        return {kind: mode.value for kind, mode in found.items()}

    one = "{STATE: MEAN_STD}"  # LeRobot takes what is not named for left as it is
    own = {"VISUAL": "IDENTITY", "STATE": "MIN_MAX", "ACTION": "MIN_MAX"}
    assert mapping() == own
    assert mapping(f"--policy.normalization_mapping={one}") == {**own, "STATE": "MEAN_STD"}
    assert mapping(f"--phases.finetune.policy={{normalization_mapping: {one}}}") == {**own, "STATE": "MEAN_STD"}
    both = mapping(
        "--policy.normalization_mapping={VISUAL: MEAN_STD}",
        f"--phases.finetune.policy={{normalization_mapping: {one}}}",
    )
    assert both == {"VISUAL": "MEAN_STD", "STATE": "MEAN_STD", "ACTION": "MIN_MAX"}
    other = tiny(
        tmp_path, data, overrides=["--phases.finetune.init=from_scratch", "--phases.finetune.policy={type: act}"]
    )
    assert planned_policy(other, other.phases[1])[0] == {"type": "act"}, "no field of the experiment's own policy"
