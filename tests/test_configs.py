"""Every file in `configs/` that training reads: it parses, plans, and trains on the fake dataset."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import draccus
import pytest
from training_support import TINY

from robocasa_lerobot import contract
from robocasa_lerobot.data.config import MemberConfig, MixtureConfig
from robocasa_lerobot.training import overlay
from robocasa_lerobot.training.config import FROM_SCRATCH, HUB, ExperimentConfig, load_experiment, to_yaml

CONFIGS = Path(__file__).parents[1] / "configs"
PARTS = CONFIGS / "experiments" / "parts"  # bases that are no experiments by themselves
EXPERIMENTS = [
    CONFIGS / "debug.yaml",
    *sorted(path for path in (CONFIGS / "experiments").rglob("*.yaml") if PARTS not in path.parents),
]
MIXTURES = sorted((CONFIGS / "mixtures").glob("*.yaml"))
OWN = [path for path in EXPERIMENTS if path.parent.name != "robocasa365"]  # their policies need no downloads


def name_of(path: Path) -> str:
    return path.relative_to(CONFIGS).with_suffix("").as_posix()


@pytest.mark.parametrize("path", MIXTURES, ids=name_of)
def test_mixture_parses(path: Path) -> None:
    data = overlay.load_yaml(path)
    overlay.check_keys(MixtureConfig, data, path.name)
    mixture = draccus.decode(MixtureConfig, data)
    assert mixture.members or mixture.select


@pytest.mark.parametrize("path", EXPERIMENTS, ids=name_of)
def test_experiment_parses(path: Path, tmp_path: Path) -> None:
    experiment = load_experiment(path)
    (tmp_path / "again.yaml").write_text(to_yaml(experiment))
    assert load_experiment(tmp_path / "again.yaml") == experiment


def test_every_experiment_has_its_own_folder_and_name() -> None:
    experiments = [load_experiment(path) for path in EXPERIMENTS]
    assert len({experiment.output_dir for experiment in experiments}) == len(experiments)
    assert len({experiment.name for experiment in experiments}) == len(experiments)


@pytest.mark.parametrize("path", EXPERIMENTS, ids=name_of)
def test_experiment_plans(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without any data, and for the published ones without the policies' weights: the plan says what is missing."""
    plan = pytest.importorskip("robocasa_lerobot.training.plan")
    plan_text = pytest.importorskip("robocasa_lerobot.training.plan_text")
    monkeypatch.chdir(tmp_path)  # there are no datasets here
    if path not in OWN:  # building pi0 takes minutes even without memory for its weights
        monkeypatch.setattr(plan, "_plan_policy", lambda *_: None)
    experiment = load_experiment(path, ["--device=cpu"])
    plans = plan.plan_experiment(experiment, measured_steps=0)
    assert [p.phase for p in plans] == experiment.phases
    text = plan_text.render_plan(experiment, plans, "cpu")
    for p in plans:
        assert f"{p.phase.name} <- " in text
        assert f"{p.samples:,} samples" in text
        assert p.missing or path.name == "debug.yaml"
        assert path not in OWN or p.parameters is not None, p.notes


@pytest.mark.parametrize("path", OWN, ids=name_of)
def test_policies_of_our_own_experiments_build(path: Path) -> None:
    builders = pytest.importorskip("robocasa_lerobot.training.builders")
    adapters = pytest.importorskip("robocasa_lerobot.training.adapters")
    from robocasa_lerobot.data.mixture import MixtureMeta

    experiment = load_experiment(path)
    meta = MixtureMeta(contract.dataset_features((64, 64)), 20, contract.ROBOT_TYPE, ["open"], 1, 1)
    kinds = {str((phase.policy, phase.freeze, phase.lora)): phase for phase in experiment.phases}
    for phase in kinds.values():
        config = builders.policy_config({**experiment.policy, **phase.policy}, None, "cpu")
        policy = builders.make_phase_policy(config, meta, None)
        adapters.apply_training_scope(policy, phase, 0)
        _, scheduler, _ = builders.make_optimizer(policy, phase)
        assert sum(p.numel() for p in policy.parameters() if p.requires_grad) > 0
        assert scheduler is not None or config.get_scheduler_preset() is None


def shrunk(experiment: ExperimentConfig, folder: Path, data: Path) -> ExperimentConfig:
    """The same graph, two steps a phase, on the fake dataset and with a tiny policy.

    A policy that cannot be built without downloads is stood in for by the tiny diffusion transformer.
    """
    own = experiment.policy.get("type") in TINY
    kind = str(experiment.policy["type"]) if own else "diffusion_transformer"
    kept = ("time_conditioning",)
    policy = {"type": kind, **TINY[kind], **{k: experiment.policy[k] for k in kept if k in experiment.policy}}
    phases = []
    for phase in experiment.phases:
        on_hub = (phase.init or "").startswith(HUB)
        lora = phase.lora and dataclasses.replace(phase.lora, rank=2, targets=phase.lora.targets if own else None)
        held_out = phase.held_out and dataclasses.replace(phase.held_out, every=2, samples=4)
        small = {
            "steps": 2,
            "batch_size": 4,
            "save_every": 1,
            "log_every": 1,
            "warmup_steps": 1,
            "schedule_steps": None,
        }
        mixture = MixtureConfig(members=[MemberConfig(str(data))], alpha=phase.mixture.alpha)
        changes = {"mixture": mixture, "init": FROM_SCRATCH if on_hub else phase.init, "lora": lora, "policy": {}}
        phases.append(
            dataclasses.replace(phase, **changes, **small, held_out=held_out, evaluations=[], save_initial=False)
        )
    loader = dataclasses.replace(experiment.loader, workers=0, cache_frames=None, cache_dir=str(data.parent / "frames"))
    return dataclasses.replace(
        experiment,
        policy=policy,
        phases=phases,
        loader=loader,
        device="cpu",
        mixed_precision="no",
        output_dir=str(folder),
    )


@pytest.mark.slow
@pytest.mark.parametrize("path", EXPERIMENTS, ids=name_of)
def test_experiment_runs_two_steps_of_each_phase(path: Path, tmp_path: Path, tiny_dataset: Path) -> None:
    phases = pytest.importorskip("robocasa_lerobot.training.phases")
    experiment = shrunk(load_experiment(path), tmp_path / "out", tiny_dataset)
    assert phases.run_experiment(experiment)
    for phase in experiment.phases:
        folder = tmp_path / "out" / phase.name
        assert (folder / "checkpoints/000002/pretrained_model/model.safetensors").is_file()
        assert {"config.yaml", "phase.json", "metrics.jsonl", "learning_curve.png"} <= {
            p.name for p in folder.iterdir()
        }


@pytest.fixture(scope="module")
def tiny_dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from robocasa_lerobot.data.fake import write_fake_dataset

    return write_fake_dataset(tmp_path_factory.mktemp("data") / "fake", episodes=4, length=12, image_size=32)
