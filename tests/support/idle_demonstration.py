"""A file with a demonstration in which next to nothing happens: made in a second, for whatever reads files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from robocasa_lerobot.demos.hdf5 import Failure, merge_parts, write_part
from robocasa_lerobot.demos.motion import Array, action
from robocasa_lerobot.demos.motion_style import MotionStyle
from robocasa_lerobot.demos.recorder import record_episode
from robocasa_lerobot.demos.recording import RecordingSettings
from robocasa_lerobot.demos.stages import StageLog, StageOutcome
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

STEPS = 4  # of each stage


def _idle(env: KitchenEnv, style: MotionStyle, log: StageLog) -> Iterator[Array]:
    log.outcomes = [StageOutcome() for _ in env.declaration.stages]
    for number in range(len(log.outcomes)):
        log.current = number
        for _ in range(STEPS):
            yield action(gripper=-1.0)


def write_idle(path: Path, failures: Sequence[Failure] = ()) -> Path:
    """Write the file of the task that it is named after, some steps in each stage, and failed attempts beside it."""
    settings = RecordingSettings(path.stem, 1)
    env = settings.make_env()
    recording = record_episode(env, settings.seed, actor=_idle)
    env.close()
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    write_part(part, recording)
    merge_parts(
        path,
        [part],
        env_name=settings.task,
        env_kwargs=settings.env_kwargs(),
        settings={**settings.identity(), "episodes": settings.episodes},
        tried=1 + len(failures),
        failures=list(failures),
    )
    part.unlink()
    return path
