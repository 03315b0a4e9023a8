"""Every file in `configs/` that training reads: it parses, plans, and trains on the fake dataset."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import draccus
import pytest
from training_support import TINY

from robocasa_lerobot import contract
from robocasa_lerobot.data.mixture_config import MixtureConfig
from robocasa_lerobot.data.registry.registry_file import load_registry
from robocasa_lerobot.evaluation.config.evaluation import EvaluationConfig
from robocasa_lerobot.evaluation.config.loader import load_config
from robocasa_lerobot.evaluation.planning.check import check
from robocasa_lerobot.settings import check_keys
from robocasa_lerobot.training.config import experiment_files as overlay
from robocasa_lerobot.training.config.experiment import FROM_SCRATCH, HUB, ExperimentConfig, load_experiment, to_yaml
from robocasa_lerobot.training.phases import run_experiment
from robocasa_lerobot.training.planning import plan, plan_text, skipped
from robocasa_lerobot.training.planning.evaluations import command_arguments, phase_evaluations
from robocasa_lerobot.training.setup import builders, optimizers
from robocasa_lerobot.training.weights import adapters

CONFIGS = Path(__file__).parents[2] / "configs"
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
    check_keys(MixtureConfig, data, path.name)
    mixture = draccus.decode(MixtureConfig, data)
    assert mixture.members or mixture.select


@pytest.mark.parametrize("path", EXPERIMENTS, ids=name_of)
def test_experiment_parses(path: Path, tmp_path: Path) -> None:
    experiment = load_experiment(path)
    (tmp_path / "again.yaml").write_text(to_yaml(experiment))
    assert load_experiment(tmp_path / "again.yaml") == experiment


# Parts of another experiment, in its folder and under its name, so that no phase is trained twice.
SHARED = {"composition_none": "target_only", "composition_human300_mg60": "foundation"}


def test_every_experiment_has_its_own_folder_and_name_but_parts_of_others() -> None:
    experiments = {path: load_experiment(path) for path in EXPERIMENTS}
    own = [e for path, e in experiments.items() if path.stem not in SHARED]
    assert len({experiment.output_dir for experiment in own}) == len(own)
    assert len({experiment.name for experiment in own}) == len(own)
    for path, experiment in experiments.items():
        if path.stem in SHARED:
            whole = experiments[path.with_stem(SHARED[path.stem])]
            left_out = [phase.name for phase in whole.phases if phase not in experiment.phases]
            assert left_out == ["atomic_30", "composite_seen_30", "composite_unseen_30"]
            kept = [phase for phase in whole.phases if phase.name not in left_out]
            assert experiment == dataclasses.replace(whole, phases=kept)


@pytest.mark.parametrize("path", EXPERIMENTS, ids=name_of)
def test_evaluations_of_an_experiment_are_evaluations(path: Path) -> None:
    """As the command of an evaluation reads them; of the benchmark's protocols, each simulated experiment has one."""
    found, experiment = [], load_experiment(path)
    for phase in experiment.phases:
        for evaluation in phase_evaluations(phase):
            arguments = command_arguments(experiment, phase, evaluation)
            assert check(arguments).mistake is None
            found.append(load_config(EvaluationConfig, arguments))
    if path.parent.name == "robocasa365" and path.stem not in ("real_only", "sim_and_real"):
        # The paper's protocols: 30 trials of each task; the leaderboard's 50 are for submissions.
        assert {config.trials for config in found} == {30}
        assert {config.protocol for config in found} <= {"paper", "foundation", "lifelong", "robustness"}
        assert found
    twin = path.parent.with_name("robocasa365") / path.name
    if path.parent.name == "small" and twin.is_file():  # what fills the report's tables is the same
        ours, published = load_experiment(path), load_experiment(twin)
        assert [(p.name, p.evaluations) for p in ours.phases] == [(p.name, p.evaluations) for p in published.phases]


def test_lifelong_phases_are_evaluated_on_the_tasks_so_far() -> None:
    phases = load_experiment(CONFIGS / "experiments/robocasa365/lifelong.yaml").phases
    settings = [phase_evaluations(phase)[0].settings for phase in phases]
    assert settings == [(f"--policy.lifelong_phase={number}",) for number in (1, 2, 3, 4)]


@pytest.mark.parametrize("path", EXPERIMENTS, ids=name_of)
def test_experiment_plans(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without any data, and for the published ones without the policies' weights: the plan says what is missing."""
    monkeypatch.chdir(tmp_path)  # there are no datasets here
    if path not in OWN:  # building pi0 takes minutes even without memory for its weights
        monkeypatch.setattr(plan, "_plan_policy", lambda *_: None)
    experiment = load_experiment(path, ["--device=cpu"])
    plans = plan.plan_experiment(experiment, measured_steps=0)
    assert [p.phase.name for p in plans] == [phase.name for phase in experiment.phases]
    text = plan_text.render_plan(experiment, plans, "cpu")
    for p in plans:
        assert f"{p.phase.name} <- " in text
        assert f"{p.samples:,} samples" in text or p.left_out in text
        assert p.missing or p.left_out or path.name == "debug.yaml"
        assert path not in OWN or p.left_out or p.parameters is not None, p.notes


@pytest.mark.parametrize("path", OWN, ids=name_of)
def test_policies_of_our_own_experiments_build(path: Path) -> None:
    from robocasa_lerobot.data.mixture import MixtureMeta

    experiment = load_experiment(path)
    meta = MixtureMeta(contract.dataset_features((64, 64)), 20, contract.ROBOT_TYPE, ["open"], 1, 1)
    kinds = {str((phase.policy, phase.freeze, phase.lora)): phase for phase in experiment.phases}
    for phase in kinds.values():
        config = builders.policy_config({**experiment.policy, **phase.policy}, None, "cpu")
        policy = builders.make_phase_policy(config, meta, None)
        adapters.apply_training_scope(policy, phase, 0)
        _, scheduler, _ = optimizers.make_optimizer(policy, phase)
        assert sum(p.numel() for p in policy.parameters() if p.requires_grad) > 0
        assert scheduler is not None or config.get_scheduler_preset() is None


def shrunk(experiment: ExperimentConfig, folder: Path) -> ExperimentConfig:
    """The same graph on the same mixtures, two steps a phase and with a tiny policy.

    Policies that cannot be built without downloads (pi0, pi05, groot) are stood in for by a tiny diffusion transformer
    from scratch; of them, the settings are checked by `test_policy_others.py`.
    """
    own = experiment.policy.get("type") in TINY
    kind = str(experiment.policy["type"]) if own else "diffusion_transformer"
    kept = ("time_conditioning",)
    policy = {"type": kind, **TINY[kind], **{k: experiment.policy[k] for k in kept if k in experiment.policy}}
    small = {"steps": 2, "batch_size": 4, "save_every": 1, "log_every": 1, "warmup_steps": 1, "schedule_steps": None}
    phases = []
    for phase in experiment.phases:
        on_hub = (phase.init or "").startswith(HUB)
        lora = phase.lora and dataclasses.replace(phase.lora, rank=2, targets=phase.lora.targets if own else None)
        held_out = phase.held_out and dataclasses.replace(phase.held_out, every=2, samples=4)
        changes = {"init": FROM_SCRATCH if on_hub else phase.init, "lora": lora, "policy": {}, "held_out": held_out}
        phases.append(dataclasses.replace(phase, **changes, **small, evaluations=[], save_initial=False))
    return dataclasses.replace(
        experiment,
        policy=policy,
        phases=phases,
        loader=dataclasses.replace(experiment.loader, workers=0, cache_dir=str(folder.parent / "cache")),
        device="cpu",
        mixed_precision="no",
        output_dir=str(folder),
    )


@pytest.fixture(scope="module")
def all_datasets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A working directory in which every dataset of the experiments lies where they look: one of two fake ones."""
    from robocasa_lerobot.benchmark.tasks import published_task_sets, published_tasks
    from robocasa_lerobot.data.fake import INSTRUCTIONS, write_fake_dataset
    from robocasa_lerobot.data.registry.published import PUBLISHED

    work = tmp_path_factory.mktemp("work")
    small = write_fake_dataset(work / "small", episodes=4, length=4, image_size=32, decisions=True)
    large = write_fake_dataset(work / "large", episodes=60, length=4, image_size=32, tasks=tuple(INSTRUCTIONS))
    places = [work / "outputs/demo/data", work / "outputs/corrections/data"]
    for split, source in PUBLISHED:
        inner = "20250101" if source == "human" else f"20250101/{source}/demo/000000"
        for task in published_task_sets()[PUBLISHED[split, source]]:
            parent = work / "datasets/v1.0" / split / published_tasks()[task][0] / task / inner
            places += [parent / "lerobot", parent / "lerobot_cotraining_cams"]
    registry = load_registry(PARTS / "kitchens.yaml")
    kitchens = [  # of which parts are held out
        work / registry.root / dataset.path.replace("{task}", task)
        for dataset in registry.datasets
        for task in published_task_sets()[dataset.task_set or ""]
    ]
    real = ("CloseElectricKettleLid", "PickPlaceToasterOvenToCounter", "PickPlaceCounterToCabinet", "PlaceOnDishRack")
    places += [work / "datasets/real" / name for name in (*real, "OpenDrawer", "CloseDrawer")]
    for place in (*places, *kitchens):
        place.parent.mkdir(parents=True, exist_ok=True)
        place.symlink_to(large if place in kitchens else small)
    return work


@pytest.mark.slow
@pytest.mark.parametrize("path", EXPERIMENTS, ids=name_of)
def test_experiment_runs_two_steps_of_each_phase(
    path: Path, tmp_path: Path, all_datasets: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(all_datasets)
    experiment = shrunk(load_experiment(path), tmp_path / "out")
    assert run_experiment(experiment)
    left_out = {item.phase for item in skipped.read(tmp_path / "out") if item.kind == skipped.PHASE}
    assert (path.parent.name == "small") or not left_out
    for phase in experiment.phases:
        folder = tmp_path / "out" / phase.name
        if phase.name in left_out:
            assert not folder.exists()
            continue
        assert (folder / "checkpoints/000002/pretrained_model/model.safetensors").is_file()
        assert {"config.yaml", "phase.json", "metrics.jsonl", "learning_curve.png"} <= {
            p.name for p in folder.iterdir()
        }
        members = json.loads((folder / "phase.json").read_text())["data"]
        assert len(members) == DATASETS.get((path.parent.name, phase.name), len(members))


# Datasets of some of the published experiments' phases.
DATASETS = {
    ("robocasa365", "multitask"): 300,
    ("robocasa365", "joint"): 410,
    ("robocasa365", "atomic_10"): 18,
    ("robocasa365", "composite_unseen_100"): 16,
}
