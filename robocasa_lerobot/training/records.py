"""What a phase folder says about its run: settings, data, versions and commit, and whether they are still the same."""

from __future__ import annotations

import dataclasses
import json
import uuid
from pathlib import Path
from typing import Any

import torch
import yaml

from robocasa_lerobot.data.mixture import MixtureDataset
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.files import write_text
from robocasa_lerobot.provenance import git_commit, versions
from robocasa_lerobot.settings import decode
from robocasa_lerobot.training.config import experiment_files as overlay
from robocasa_lerobot.training.config.experiment import FROM_SCRATCH, ExperimentConfig, PhaseConfig, to_yaml
from robocasa_lerobot.training.weights.checkpoint import last_checkpoint

EXPERIMENT_FILE, PHASE_FILE, CONFIG_FILE = "experiment.yaml", "phase.json", "config.yaml"
PACKAGES = ("lerobot", "torch", "accelerate", "transformers", "diffusers", "numpy")
# Settings that may change while a phase is running, because the losses do not depend on them.
FREE_SETTINGS = (
    *("loader.workers", "loader.cache", "device", "trackers", "save_every", "keep_last", "keep_every", "log_every"),
    *("held_out.every", "held_out.samples", "evaluations", "scale"),
)
# Settings of what a phase makes when it begins: its checkpoints hold the statistics that inputs are normalised with.
AS_IT_BEGAN = ("statistics", "image_statistics")


def write_experiment(output: Path, experiment: ExperimentConfig) -> None:
    """Write the experiment; phases of another one in the same folder stay in the file, after its own.

    So experiments of which one is a part of the other can take turns in a folder, and share the trained phases.
    """
    path, own = output / EXPERIMENT_FILE, dataclasses.asdict(experiment)
    before = _with_starts(yaml.safe_load(path.read_text(encoding="utf-8")))["phases"] if path.is_file() else []
    names = {phase.name for phase in experiment.phases}
    own["phases"] += [phase for phase in before if phase["name"] not in names]
    write_text(path, yaml.safe_dump(own, sort_keys=False, width=120))


def _with_starts(experiment: dict[str, Any]) -> dict[str, Any]:
    """An experiment as data, in which each phase says where it starts.

    What is not said depends on the phase before (`ExperimentConfig.init_of`), which another order changes.
    """
    start = str((experiment.get("policy") or {}).get("path", FROM_SCRATCH))
    phases: list[dict[str, Any]] = []
    for phase in experiment["phases"]:
        phases.append({**phase, "init": phase["init"] or start})
        start = phase["name"]
    return {**experiment, "phases": phases}


def _completed(experiment: dict[str, Any]) -> dict[str, Any]:
    """With the settings that have come to be since an experiment was written, at what leaves it as it was.

    What cannot be read any more, such as one that is gone, stays as it is.
    """
    try:
        found: dict[str, Any] = yaml.safe_load(to_yaml(decode(ExperimentConfig, experiment)))
    except UserError:
        return experiment
    return found


def describe_phase(
    experiment: ExperimentConfig,
    phase: PhaseConfig,
    dataset: MixtureDataset,
    policy: torch.nn.Module,
    init: Path | None,
    device: str,
    begun: bool,
) -> dict[str, Any]:
    """The content of `phase.json`.

    A `run` lasts from a phase's first step to its last, however often it is continued.

    Args:
        experiment: what is run.
        phase: of it.
        dataset: that it draws from.
        policy: that it trains.
        init: the `pretrained_model` folder that it starts from; of a begun phase that is known.
        device: what it is called.
        begun: whether it goes on from a checkpoint of its own.
    """
    folder, parent = Path(experiment.output_dir) / phase.name, experiment.parent(phase)
    before = (_about(folder) or {}) if begun else {}
    start = {
        "init": str(init) if init else FROM_SCRATCH,
        "init_run": run_of(folder.parent / parent.name) if parent is not None else None,
        "statistics": phase.statistics if init else "replace",
    }
    return {
        "experiment": experiment.name,
        "phase": phase.name,
        "run": (run_of(folder) if begun else None) or uuid.uuid4().hex,
        **start,
        **{key: before[key] for key in start if key in before},
        "data": dataset.describe().splitlines(),
        "data_fingerprint": dataset.fingerprint,
        "selection_fingerprint": dataset.selection_fingerprint,
        "parameters": sum(p.numel() for p in policy.parameters()),
        "trainable_parameters": sum(p.numel() for p in policy.parameters() if p.requires_grad),
        "device": device,
        "versions": versions(*PACKAGES),
        "git_commit": git_commit(),
    }


def run_of(folder: Path) -> str | None:
    """The run that a phase's folder holds; None where none has begun, or an earlier version began it."""
    about = _about(folder)
    return about.get("run") if about is not None else None


def check_descent(experiment: ExperimentConfig, output: Path) -> None:
    """Check that what has begun started from the phases that are there now.

    Raises:
        UserError: a phase that it started from has been trained anew since.
    """
    for phase in experiment.phases:
        about, parent = _about(output / phase.name), experiment.parent(phase)
        if about is None or parent is None or last_checkpoint(output / phase.name) is None:
            continue
        started, now = about.get("init_run"), run_of(output / parent.name)
        if started is not None and now is not None and started != now:
            raise UserError(
                f"phase {phase.name!r} in {output} started from weights of {parent.name!r} that are gone: that phase "
                f"has been trained anew since. Remove {output / phase.name} to train it from the new ones, or put the "
                f"earlier folder {output / parent.name} back."
            )


def check_parents(experiment: ExperimentConfig, output: Path) -> None:
    """Check that no phase would be trained again, without being asked, under others that came from it.

    Raises:
        UserError: the checkpoints of one are gone, and what was trained from it is there.
    """
    for phase in experiment.phases:
        if last_checkpoint(output / phase.name) is not None:
            continue
        later = [other for other in experiment.phases if experiment.parent(other) == phase]
        if begun := [other.name for other in later if last_checkpoint(output / other.name) is not None]:
            raise UserError(
                f"phase {phase.name!r} has no checkpoint in {output}, and {begun[0]!r}, which was trained from it, has "
                f"begun. `--phase {begun[0]}` goes on with that; to train both anew remove {output / begun[0]}."
            )


def _about(folder: Path) -> dict[str, Any] | None:
    path = folder / PHASE_FILE
    if not path.is_file():
        return None
    about: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return about


def write_records(folder: Path, about: dict[str, Any], experiment: ExperimentConfig, phase: PhaseConfig) -> None:
    """Write `phase.json`, and the experiment with this phase alone as `config.yaml`."""
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / PHASE_FILE, json.dumps(about, indent=2))
    resolved = {**dataclasses.asdict(experiment), "phases": [dataclasses.asdict(phase)]}
    resolved["phases"][0]["init"] = about["init"]
    write_text(folder / CONFIG_FILE, yaml.safe_dump(resolved, sort_keys=False, width=120))


def check_unchanged(experiment: ExperimentConfig, output: Path, force: bool) -> None:
    """Check that what has begun in `output` is continued as it began.

    Raises:
        UserError: a setting that matters is different; all of them are listed. With `force`, one that a begun phase
            cannot change any more.
    """
    path = output / EXPERIMENT_FILE
    if not path.is_file():
        return
    begun = {phase.name for phase in experiment.phases if last_checkpoint(output / phase.name)}
    old = overlay.flatten(_with_starts(_completed(yaml.safe_load(path.read_text(encoding="utf-8")))))
    new = overlay.flatten(_with_starts(yaml.safe_load(to_yaml(experiment))))
    changed = {
        key: f"\n  {key}: {old.get(key, '(not set)')} -> {new.get(key, '(not set)')}"
        for key in sorted(old.keys() | new.keys())
        if old.get(key) != new.get(key) and begun and not _may_change(key, begun)
    }
    fixed = [f"phases.{name}.{setting}" for name in sorted(begun) for setting in AS_IT_BEGAN]
    lines = [changed[key] for key in fixed if key in changed]
    if lines and force:
        raise UserError(
            f"{output} holds phases that have begun with other settings, which they keep:" + "".join(lines) + "\nPut "
            "them back, give another `--output_dir`, or remove the phase's folder to begin it anew."
        )
    if changed and not force:
        raise UserError(
            f"{output} holds the same experiment with other settings:" + "".join(changed.values()) + "\nGive another "
            "`--output_dir`, remove the folder, or pass `--resume=force` to go on with the new settings."
        )


def check_same_data(folder: Path, dataset: MixtureDataset, force: bool = False) -> None:
    """Check that a begun phase goes on with the data that it began with, and draws from them as it did.

    With `force` it may draw others of their episodes, or at other rates, as changed settings ask for.

    Raises:
        UserError: they are others now.
    """
    before, now = _about(folder), dataset.describe().splitlines()
    if before is None:
        return
    if before["data_fingerprint"] != dataset.fingerprint:
        raise UserError(
            f"{folder} was begun with other data: {before['data']}; now: {now} (or their content changed). "
            "Restore them, or start in another `--output_dir`."
        )
    drawn = before.get("selection_fingerprint")  # None in what earlier versions wrote
    if drawn is not None and drawn != dataset.selection_fingerprint and not force:
        raise UserError(
            f"{folder} was begun with other episodes of its data, or other rates of drawing them: {before['data']}; "
            f"now: {now}. What names and sets select has changed. Put it back, start in another "
            "`--output_dir`, or pass `--resume=force` to go on with what is selected now."
        )


def _may_change(key: str, begun: set[str]) -> bool:
    if key.startswith("phases."):
        name = next((name for name in begun if key.startswith(f"phases.{name}.")), None)
        return name is None or key.removeprefix(f"phases.{name}.").startswith(FREE_SETTINGS)
    return key.startswith(FREE_SETTINGS) or key in ("name", "output_dir", "registry")
