"""The evaluations of a finished phase, each in a process of its own: training knows nothing of simulators."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from robocasa_lerobot.data.config import ROBOCASA365
from robocasa_lerobot.errors import UserError, suggest
from robocasa_lerobot.settings import load_yaml, parse_overrides
from robocasa_lerobot.training.checkpoint import LAST, PRETRAINED, last_checkpoint
from robocasa_lerobot.training.phase_config import PhaseConfig

FOLDER = "evaluations"
NAMED = Path(__file__).parents[2] / "configs" / "evaluations"
_LAUNCHER = ("RANK", "LOCAL_RANK", "WORLD_SIZE", "MASTER_ADDR", "MASTER_PORT", "ACCELERATE_", "TORCHELASTIC_")


@dataclass(frozen=True)
class PhaseEvaluation:
    """An evaluation file, and settings that a phase changes in it, as on the command line."""

    file: Path
    settings: tuple[str, ...]


def phase_evaluations(phase: PhaseConfig) -> list[PhaseEvaluation]:
    """The phase's evaluations: paths, or names of files in `configs/evaluations/`, each with its settings.

    Raises:
        UserError: a file is not there or is named twice, or a quotation does not end.
    """
    found: list[PhaseEvaluation] = []
    for text in phase.evaluations:
        try:
            name, *settings = shlex.split(text)
        except ValueError as error:
            raise UserError(
                f"phase {phase.name!r}: evaluation {text!r} ({error}); expected `NAME --setting=value ...`."
            ) from error
        file = next((p for p in (Path(name), NAMED / f"{name}.yaml") if p.is_file()), None)
        if file is None:
            known = suggest(name, [path.stem for path in NAMED.glob("*.yaml")])
            raise UserError(f"phase {phase.name!r}: no evaluation file {name}. {known}")
        if file.stem in [other.file.stem for other in found]:
            raise UserError(f"phase {phase.name!r}: two evaluations would write to the folder {file.stem!r}.")
        found.append(PhaseEvaluation(file, tuple(settings)))
    return found


def registry_setting(evaluation: PhaseEvaluation, registry: str | None) -> list[str]:
    """The setting that gives an evaluation the experiment's registry, where it names none itself."""
    if registry in (None, ROBOCASA365):
        return []
    env = load_yaml(evaluation.file).get("env") or {}
    own = [key for key, _ in parse_overrides(evaluation.settings, flags=True)]
    return [] if "registry" in env or "env.registry" in own else [f"--env.registry={registry}"]


def run_evaluations(phase: PhaseConfig, folder: Path, registry: str | None = None) -> None:
    """Run the phase's evaluations that are not finished yet; results go to `<folder>/evaluations/<name>/`.

    `registry` is the experiment's: its task sets are meant by an evaluation that names none.

    Raises:
        UserError: one failed; its own message stands above.
    """
    for evaluation in phase_evaluations(phase):
        file = evaluation.file
        out = folder / FOLDER / file.stem
        last = last_checkpoint(folder)
        done = out / "finished"
        if last is None:
            continue
        what = " ".join((last.name, *evaluation.settings))
        if done.is_file() and done.read_text() == what:
            continue
        command = [sys.executable, "-m", "robocasa_lerobot.cli", "eval", "--config_path", str(file)]
        command += [f"--policy.path={folder / 'checkpoints' / LAST / PRETRAINED}", f"--out={out}"]
        command += [*registry_setting(evaluation, registry), *evaluation.settings]
        # It is no part of this process group of trainers.
        environment = {k: v for k, v in os.environ.items() if not k.startswith(_LAUNCHER)}
        status = subprocess.run(command, env=environment, check=False).returncode
        if status:
            raise UserError(
                f"the evaluation {file} of phase {phase.name!r} ended with status {status}; the training is complete. "
                f"Run it again with the same command, or alone: {shlex.join(command[1:])}"
            )
        out.mkdir(parents=True, exist_ok=True)
        done.write_text(what)
