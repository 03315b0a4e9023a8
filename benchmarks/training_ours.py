"""Our loop as a process: an experiment file, trained as `train.py` does, or on the batches of LeRobot's loader.

python benchmarks/training_ours.py experiment.yaml [--lerobot-loader] [--memory FILE]
"""

from __future__ import annotations

import argparse
import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import torch
from accelerate import Accelerator
from lerobot.datasets.factory import resolve_delta_timestamps
from training_loaders import LeRobotBatches, lerobot_dataset

from robocasa_lerobot.training.config.experiment import ExperimentConfig, load_experiment
from robocasa_lerobot.training.loop import train_phase
from robocasa_lerobot.training.phases import run_experiment
from robocasa_lerobot.training.setup import builders
from robocasa_lerobot.training.setup.build_phase import prepare_phase


def main(arguments: Sequence[str] | None = None) -> int:
    """Train the file's only phase."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("experiment", type=Path)
    parser.add_argument("--lerobot-loader", action="store_true")
    parser.add_argument("--memory", type=Path, help="JSON file for the most GPU memory that was taken")
    options = parser.parse_args(arguments)
    experiment = load_experiment(options.experiment)
    if options.lerobot_loader:
        train_on_theirs(experiment)
    else:
        run_experiment(experiment)
    if options.memory is not None:
        options.memory.write_text(json.dumps({"peak_gib": torch.cuda.max_memory_allocated() / 2**30}))
    return 0


def train_on_theirs(experiment: ExperimentConfig) -> None:
    """Train an experiment's only phase on the batches of LeRobot's loader."""
    (phase,) = experiment.phases
    device = builders.best_device(experiment.device)
    accelerator = Accelerator(cpu=device == "cpu", mixed_precision=experiment.mixed_precision)
    run = prepare_phase(experiment, phase, device, accelerator)
    root, policy = Path(phase.mixture.members[0].root), run.state.policy.config
    dataset = lerobot_dataset(root, None)
    dataset = lerobot_dataset(root, resolve_delta_timestamps(policy, dataset.meta))
    batches = LeRobotBatches(dataset, phase.batch_size, getattr(policy, "drop_n_last_frames", None) or 0)
    # The loop asks for batches by their number and looks at nothing else.
    train_phase(dataclasses.replace(run, batches=cast(Any, batches)), accelerator)


if __name__ == "__main__":
    raise SystemExit(main())
