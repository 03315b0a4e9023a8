"""The evaluations of a finished phase, each in a process of its own: training knows nothing of simulators."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from robocasa_lerobot.errors import UserError, suggest
from robocasa_lerobot.training.checkpoint import LAST, PRETRAINED, last_checkpoint
from robocasa_lerobot.training.phase_config import PhaseConfig

FOLDER = "evaluations"
NAMED = Path(__file__).parents[2] / "configs" / "evaluations"
_LAUNCHER = ("RANK", "LOCAL_RANK", "WORLD_SIZE", "MASTER_ADDR", "MASTER_PORT", "ACCELERATE_", "TORCHELASTIC_")


def evaluation_files(phase: PhaseConfig) -> list[Path]:
    """The phase's evaluation files: paths, or names of those in `configs/evaluations/`.

    Raises:
        UserError: one is not there.
    """
    files = []
    for name in phase.evaluations:
        file = next((p for p in (Path(name), NAMED / f"{name}.yaml") if p.is_file()), None)
        if file is None:
            known = suggest(name, [path.stem for path in NAMED.glob("*.yaml")])
            raise UserError(f"phase {phase.name!r}: no evaluation file {name}. {known}")
        files.append(file)
    return files


def run_evaluations(phase: PhaseConfig, folder: Path) -> None:
    """Run the phase's evaluations that are not finished yet; results go to `<folder>/evaluations/<name>/`.

    Raises:
        UserError: one failed; its own message stands above.
    """
    for file in evaluation_files(phase):
        out = folder / FOLDER / file.stem
        last = last_checkpoint(folder)
        done = out / "finished"
        if last is None or (done.is_file() and done.read_text() == last.name):
            continue
        command = [sys.executable, "-m", "robocasa_lerobot.cli", "eval", "--config_path", str(file)]
        command += [f"--policy.path={folder / 'checkpoints' / LAST / PRETRAINED}", f"--out={out}"]
        # It is no part of this process group of trainers.
        environment = {k: v for k, v in os.environ.items() if not k.startswith(_LAUNCHER)}
        status = subprocess.run(command, env=environment, check=False).returncode
        if status:
            raise UserError(
                f"the evaluation {file} of phase {phase.name!r} ended with status {status}; the training is complete. "
                f"Run it again with the same command, or alone: {' '.join(command[1:])}"
            )
        out.mkdir(parents=True, exist_ok=True)
        done.write_text(last.name)
