"""Phases as a graph: what they start from, what of the policy they train, whose data they see, and what they leave."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import huggingface_hub
import numpy as np
import pyarrow.parquet as pq
import pytest
import torch
import yaml
from accelerate import Accelerator
from lerobot.processor import NormalizerProcessorStep
from safetensors.torch import load_file
from training_support import experiment_file, losses, metrics, tiny, weights

from robocasa_lerobot import contract
from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.data.mixture import open_mixture
from robocasa_lerobot.data.reading.source import DatasetSource
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.training.config.experiment import load_experiment
from robocasa_lerobot.training.config.phase import LoraConfig, PhaseConfig
from robocasa_lerobot.training.phases import run_experiment
from robocasa_lerobot.training.planning import evaluations
from robocasa_lerobot.training.setup import builders
from robocasa_lerobot.training.setup import phase_data as joining
from robocasa_lerobot.training.setup.build_phase import prepare_phase
from robocasa_lerobot.training.weights.adapters import apply_training_scope, merged_state

FROZEN = "observation_encoder"


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_fake_dataset(tmp_path_factory.mktemp("data") / "fake", episodes=8, length=12, image_size=32)


@pytest.fixture(scope="module")
def other(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_fake_dataset(tmp_path_factory.mktemp("other") / "fake", episodes=2, length=8, image_size=32, seed=1)


@pytest.fixture(scope="module")
def pretrained(tmp_path_factory: pytest.TempPathFactory, data: Path) -> Path:
    """Output folder of a finished first phase."""
    folder = tmp_path_factory.mktemp("pretrained")
    torch.set_num_threads(1)
    assert run_experiment(tiny(folder, data, overrides=["--defaults.steps=2"]), only="pretrain")
    return folder / "out/pretrain/checkpoints/last/pretrained_model"


def from_there(folder: Path, data: Path, pretrained: Path, **finetune: Any) -> Path:
    """An experiment of one phase that starts from a checkpoint."""
    path = experiment_file(folder, data)
    content = yaml.safe_load(path.read_text())
    content["phases"] = [{**content["phases"][1], "init": str(pretrained), **finetune}]
    path.write_text(yaml.safe_dump(content))
    return path


def changed_weights(folder: Path, pretrained: Path, phase: str = "finetune") -> set[str]:
    before, after = load_file(pretrained / "model.safetensors"), weights(folder, phase)
    assert before.keys() == after.keys()
    return {key for key in before if not torch.equal(before[key], after[key])}


def test_graph_of_phases(tmp_path: Path, data: Path) -> None:
    """Two fine-tunings from one pretraining: both start from its weights, and one can be run alone."""
    path = experiment_file(tmp_path, data, defaults={"steps": 2})
    content = yaml.safe_load(path.read_text())
    content["phases"].append({**content["phases"][1], "name": "second", "init": "pretrain", "save_initial": True})
    content["phases"][1]["save_initial"] = True
    path.write_text(yaml.safe_dump(content))
    experiment = load_experiment(path)
    with pytest.raises(UserError, match=r"'pretrain', which is not finished.*--phase pretrain"):
        run_experiment(experiment, only="second")
    with pytest.raises(UserError, match="Did you mean 'second'"):
        run_experiment(experiment, only="secnd")
    assert run_experiment(experiment, only="pretrain")
    assert run_experiment(experiment, only="second")
    assert not (tmp_path / "out/finetune").exists()
    assert run_experiment(experiment)
    start = weights(tmp_path, "pretrain")
    for name in ("finetune", "second"):
        assert all(torch.equal(value, start[key]) for key, value in weights(tmp_path, name, "000000").items())
    assert losses(tmp_path, "finetune") != losses(tmp_path, "second")  # other samples and noise


def test_phase_folder_says_how_it_was_made(tmp_path: Path, data: Path) -> None:
    experiment = tiny(tmp_path, data, overrides=["--defaults.steps=1"])
    assert run_experiment(experiment, only="pretrain")
    folder = tmp_path / "out/pretrain"
    about = json.loads((folder / "phase.json").read_text())
    assert {"python", "lerobot", "torch"} <= about["versions"].keys()
    assert len(about["data_fingerprint"]) > 10
    assert "git_commit" in about
    again = load_experiment(folder / "config.yaml")
    assert [phase.name for phase in again.phases] == ["pretrain"]
    assert again.phases[0].batch_size == experiment.phases[0].batch_size
    assert (folder / "learning_curve.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("missing", [None, "replce"])
def test_statistics_must_be_said(tmp_path: Path, data: Path, missing: str | None) -> None:
    path = experiment_file(tmp_path, data)
    content = yaml.safe_load(path.read_text())
    content["phases"][1]["statistics"] = missing
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(UserError, match="does not say what its inputs" if missing is None else "'replace'"):
        load_experiment(path)


def test_pooled_statistics_are_those_of_both_phases_samples(tmp_path: Path, data: Path, other: Path) -> None:
    mixture = f"{{members: [{{root: {other}}}]}}"
    overrides = ["--defaults.steps=2", f"--phases.finetune.mixture={mixture}", "--phases.finetune.statistics=pool"]
    experiment = tiny(tmp_path, data, overrides=[*overrides, "--phases.pretrain.steps=6"])
    ours = open_mixture(experiment.phases[1].mixture, experiment.loader)
    theirs = open_mixture(experiment.phases[0].mixture, experiment.loader)
    found = joining.pooled(experiment, experiment.phases[1], ours)["observation.state"]
    parts = [ours.statistics()["observation.state"], theirs.statistics()["observation.state"]]
    shares = (0.25, 0.75)  # 2 steps of 8
    mean = sum(share * part["mean"] for share, part in zip(shares, parts, strict=True))
    square = sum(s * (p["std"] ** 2 + p["mean"] ** 2) for s, p in zip(shares, parts, strict=True))
    np.testing.assert_allclose(found["mean"], mean, atol=1e-6)
    np.testing.assert_allclose(found["std"], np.sqrt(square - mean**2), atol=1e-6)
    np.testing.assert_array_equal(found["max"], np.maximum(parts[0]["max"], parts[1]["max"]))


def test_imagenet_statistics_of_pictures_need_none_of_the_data(tmp_path: Path, data: Path) -> None:
    bare = shutil.copytree(data, tmp_path / "bare")
    for path in bare.glob("meta/episodes/*/*.parquet"):
        table = pq.read_table(path)
        pictures = [name for name in table.column_names if name.startswith(f"stats/{contract.IMAGE_PREFIX}")]
        pq.write_table(table.drop_columns(pictures), path)
    overrides = ["--defaults.steps=1", "--phases.finetune.statistics=pool"]
    with pytest.raises(UserError, match=r"no statistics of .*`image_statistics: imagenet`"):
        run_experiment(tiny(tmp_path / "dataset", bare, overrides=overrides))
    assert run_experiment(
        tiny(tmp_path / "imagenet", bare, overrides=[*overrides, "--defaults.image_statistics=imagenet"])
    )


def test_pool_needs_the_earlier_data(tmp_path: Path, data: Path, pretrained: Path) -> None:
    with pytest.raises(UserError, match="no phase of this experiment"):
        run_experiment(load_experiment(from_there(tmp_path, data, pretrained, statistics="pool")))


def test_replay_draws_its_share_from_earlier_phases(tmp_path: Path, data: Path, other: Path) -> None:
    mixture = f"{{members: [{{root: {other}}}], draw: episodes}}"
    overrides = [f"--phases.finetune.mixture={mixture}", "--phases.finetune.replay.share=0.25"]
    experiment = tiny(tmp_path, data, overrides=overrides)
    dataset = joining.open_phase_data(experiment, experiment.phases[1])
    assert [member.root for member in dataset.config.members] == [str(other), str(data)]
    np.testing.assert_allclose(dataset.probabilities, [0.75, 0.25])
    assert dataset.sampler(seed=0).episodes_first  # as the phase's own data
    members, _ = dataset.sampler(seed=0).draw(0, 4000)
    assert np.mean(members == 1) == pytest.approx(0.25, abs=0.03)  # 4 standard deviations
    with pytest.raises(UserError, match="builds on no earlier phase"):
        tiny(tmp_path, data, overrides=["--phases.pretrain.replay.share=0.25"])
    with pytest.raises(UserError, match="Did you mean 'pretrain'"):
        tiny(tmp_path, data, overrides=["--phases.finetune.replay={phases: [pretran]}"])


@pytest.mark.parametrize("change", [{"replay": {"phases": ["pretrain"]}}, {"statistics": "pool", "init": "pretrain"}])
def test_data_of_the_hub_are_fetched_for_the_phases_that_see_them_again(
    tmp_path: Path, data: Path, pretrained: Path, monkeypatch: pytest.MonkeyPatch, change: dict[str, Any]
) -> None:
    """Of a phase that is not run itself, or was before its data were removed."""
    monkeypatch.chdir(tmp_path)
    asked = []

    def download(name: str, *, local_dir: str, **_: str) -> str:
        asked.append(name)
        shutil.copytree(data, local_dir, dirs_exist_ok=True)
        return local_dir

    monkeypatch.setattr(huggingface_hub, "snapshot_download", download)
    path = experiment_file(tmp_path, data, defaults={"steps": 1})
    content = yaml.safe_load(path.read_text())
    content["phases"][0]["mixture"] = {"members": [{"repo_id": "owner/name"}]}
    content["phases"][1] |= {"init": str(pretrained), **change}
    path.write_text(yaml.safe_dump(content))
    experiment = load_experiment(path)
    if change.get("init") == "pretrain":
        assert run_experiment(experiment, only="pretrain")
        shutil.rmtree(tmp_path / "datasets")
        asked.clear()
    assert run_experiment(experiment, only="finetune")
    assert asked == ["owner/name"]


def test_datasets_of_several_phases_are_opened_once(
    tmp_path: Path, data: Path, other: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three phases on two datasets with replay of what was before: each dataset is a member once."""
    path = experiment_file(tmp_path, data)
    content = yaml.safe_load(path.read_text())
    second = {**content["phases"][1], "mixture": {"members": [{"root": str(other)}]}, "replay": {"share": 0.5}}
    third = {**second, "name": "third", "mixture": {"members": [{"root": str(data)}]}, "statistics": "pool"}
    content["phases"][1:] = [second, third]
    path.write_text(yaml.safe_dump(content))
    experiment = load_experiment(path)
    count: list[Path] = []
    whole = DatasetSource.__init__

    def counted(self: DatasetSource, root: Path) -> None:
        count.append(root)
        whole(self, root)

    monkeypatch.setattr(DatasetSource, "__init__", counted)
    dataset = joining.open_phase_data(experiment, experiment.phases[2])
    assert sorted(count) == sorted([data, other])
    assert [member.root for member in dataset.config.members] == [str(data), str(other)]
    np.testing.assert_allclose(dataset.probabilities, [0.75, 0.25])  # a half, and a half of the replayed half
    joining.pooled(experiment, experiment.phases[2], dataset)
    assert len(count) == 2


def test_frozen_parts_stay(tmp_path: Path, data: Path, pretrained: Path) -> None:
    experiment = load_experiment(from_there(tmp_path, data, pretrained, freeze=[FROZEN]))
    assert run_experiment(experiment, stop_after=2) is False
    changed = changed_weights(tmp_path, pretrained)
    assert changed
    assert not [key for key in changed if key.startswith(FROZEN)]
    about = json.loads((tmp_path / "out/finetune/phase.json").read_text())
    assert 0 < about["trainable_parameters"] < about["parameters"]


def test_frozen_modules_keep_out_of_training_mode() -> None:
    model = torch.nn.Sequential(torch.nn.Linear(2, 2), torch.nn.Dropout(), torch.nn.Linear(2, 2))
    phase = PhaseConfig.__new__(PhaseConfig)
    phase.freeze, phase.lora = ["0"], None
    assert apply_training_scope(model, phase, 0) == [model[0]]
    phase.freeze = ["3"]
    with pytest.raises(UserError, match=r"unknown part of the policy '3'"):
        apply_training_scope(model, phase, 0)


def test_low_rank_training_goes_on_and_leaves_an_ordinary_policy(tmp_path: Path, data: Path, pretrained: Path) -> None:
    changes = {"lora": {"rank": 2, "dropout": 0.1}, "save_initial": True}
    whole = load_experiment(from_there(tmp_path / "whole", data, pretrained, **changes))
    parts = load_experiment(from_there(tmp_path / "parts", data, pretrained, **changes))
    assert run_experiment(whole)
    assert not run_experiment(parts, stop_after=2)
    assert run_experiment(parts)
    assert losses(tmp_path / "parts", "finetune") == losses(tmp_path / "whole", "finetune")
    ours, theirs = weights(tmp_path / "parts", "finetune"), weights(tmp_path / "whole", "finetune")
    assert all(torch.equal(ours[key], theirs[key]) for key in theirs)
    start = weights(tmp_path / "whole", "finetune", "000000")
    changed = changed_weights(tmp_path / "whole", pretrained)
    assert changed
    for key in changed:  # differences of rank 2, and of matrices only
        difference = (theirs[key] - start[key]).double()
        assert difference.ndim == 2
        values = torch.linalg.svdvals(difference)
        assert (values[2:] < 1e-4 * values[0]).all()  # float32 rounds
    about = json.loads((tmp_path / "whole/out/finetune/phase.json").read_text())
    assert about["trainable_parameters"] < 0.5 * about["parameters"]


def test_low_rank_changes_are_of_what_the_policy_trains() -> None:
    """Its own frozen parts, as GR00T's vision and language models, are adapted only where `targets` names them."""
    phase = PhaseConfig.__new__(PhaseConfig)
    for targets, changed in ((None, {"head"}), (["*"], {"backbone", "head"})):
        model = torch.nn.ModuleDict({"backbone": torch.nn.Linear(2, 2), "head": torch.nn.Linear(2, 2)})
        model["backbone"].requires_grad_(False)
        phase.freeze, phase.lora = [], LoraConfig(rank=1, targets=targets)
        apply_training_scope(model, phase, 0)
        assert {name.split(".")[0] for name, p in model.named_parameters() if p.requires_grad} == changed


def test_low_rank_change_starts_at_nothing() -> None:
    model = torch.nn.ModuleDict({"a": torch.nn.Linear(4, 4), "m": torch.nn.MultiheadAttention(4, 2)})
    before = {key: value.clone() for key, value in model.state_dict().items()}
    phase = PhaseConfig.__new__(PhaseConfig)
    phase.freeze, phase.lora = [], LoraConfig(rank=2, targets=["a", "m.in_proj"], train=["m.out_proj.bias"])
    apply_training_scope(model, phase, 0)
    merged = merged_state(model)
    assert merged is not None
    assert merged.keys() == before.keys()
    assert all(torch.equal(merged[key], before[key]) for key in before)
    trained = {name for name, p in model.named_parameters() if p.requires_grad}
    assert len(trained) == 5  # two matrices for each of two weights, and the bias
    phase.lora = LoraConfig(targets=["b"])
    with pytest.raises(UserError, match="unknown layer 'b'"):
        apply_training_scope(torch.nn.Sequential(torch.nn.Linear(2, 2)), phase, 0)


def test_constant_components_do_not_explode_in_lerobots_policies(tmp_path: Path, data: Path) -> None:
    experiment = tiny(tmp_path, data, "act")
    config = builders.policy_config(experiment.policy, None, "cpu")
    dataset = open_mixture(experiment.phases[0].mixture, experiment.loader)
    stats = dataset.statistics(images=False)
    for name, value in (("min", 0.25), ("max", 0.25), ("mean", 0.25), ("std", 0.0)):
        stats[contract.ACTION_KEY][name][0] = value
    dataset.meta.stats = builders.with_imagenet_statistics(stats, dataset.meta.camera_keys)
    builders.make_phase_policy(config, dataset.meta, None)
    pre, _ = builders.make_processors(config, dataset.meta, None, keep_statistics=False)
    (normalizer,) = [step for step in pre.steps if isinstance(step, NormalizerProcessorStep)]
    assert float(normalizer.stats[contract.ACTION_KEY]["std"][0]) == 1.0


def test_mistakes_in_phases_are_told(tmp_path: Path, data: Path) -> None:
    for overrides, message in (
        (["--phases.pretrain.evaluations=[quik]"], "Did you mean 'quick'"),
        (["--phases.pretrain.evaluations=['quick --seed=\"1']"], "No closing quotation"),
        (["--phases.pretrain.evaluations=[quick, quick --seed=1]"], "two evaluations"),
        (["--phases.pretrain.init=hub:nobody/nothing", "--phases.pretrain.statistics=keep"], "hf download"),
        (["--trackers=[tensorbord]"], "Did you mean 'tensorboard'"),
        (["--phases.pretrain.lora.rank=0"], "rank is 0"),
        (["--phases.pretrain.lora.rank=1", "--phases.pretrain.freeze=[a]"], "leave `freeze` out"),
        (["--phases.pretrain.augment.crop=2"], "crop is 2"),
        (["--phases.pretrain.freeze=['*']"], "leaves nothing"),
    ):
        with pytest.raises(UserError, match=message):
            run_experiment(tiny(tmp_path, data, overrides=overrides), only="pretrain")
    assert not metrics_exist(tmp_path)


def test_evaluations_run_once_for_each_checkpoint_and_setting(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    commands: list[list[str]] = []

    def run(command: list[str], _: object) -> int:
        commands.append(command)
        return 0

    monkeypatch.setattr(evaluations, "_run", run)
    common = ["--defaults.steps=1"]
    for settings in ("--seed=1", "--seed=1", '--policy.training_data="a b"'):
        names = [*common, f"--phases.pretrain.evaluations=['quick {settings}']"]
        assert run_experiment(tiny(tmp_path, data, overrides=names), only="pretrain", evaluate=True)
    assert [command[-1] for command in commands] == ["--seed=1", "--policy.training_data=a b"]
    folder = tmp_path / "out/pretrain"
    assert f"--policy.path={folder}/checkpoints/last/pretrained_model" in commands[0]
    assert f"--out={folder}/evaluations/quick" in commands[0]


def metrics_exist(folder: Path) -> bool:
    return (folder / "out/pretrain/metrics.jsonl").exists() and bool(metrics(folder, "pretrain"))


def test_columns_that_do_not_fit_have_a_default_place(tmp_path: Path, data: Path) -> None:
    """As in the published experiments: no frames are kept, and the columns are more than the memory for them."""
    path = experiment_file(tmp_path, data, defaults={"steps": 1})
    content = yaml.safe_load(path.read_text())
    content["loader"] = {"cache_frames": False, "cache_columns_above_gb": 0.0}
    content["phases"][1]["statistics"] = "pool"
    path.write_text(yaml.safe_dump(content))
    assert run_experiment(load_experiment(path))
    assert list((tmp_path / "out/frame_cache").glob("*.npy"))


def test_last_frames_start_no_sample_where_a_phase_says_so(tmp_path: Path, data: Path) -> None:
    counts = {}
    for dropped in (None, 0, 3):
        overrides = [] if dropped is None else [f"--defaults.drop_last_frames={dropped}"]
        experiment = tiny(tmp_path / str(dropped), data, overrides=overrides)
        run = prepare_phase(experiment, experiment.phases[0], "cpu", Accelerator(cpu=True))
        counts[dropped] = sum(pool.size for pool in run.batches.sampler.pools)
    assert counts[None] < counts[0]  # its default drops one of each episode
    assert counts[0] - counts[3] == 3 * (counts[0] - counts[None])
