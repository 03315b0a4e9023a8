"""Replays with noise: a source's own actions in its own scene, disturbed, as what generation has to be better than.

The baseline of A. Mandlekar et al., "MimicGen" (2023): as many demonstrations, no new start among them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from robocasa_lerobot import contract
from robocasa_lerobot.demos.attempts import RecordingSettings
from robocasa_lerobot.demos.generate.course import AT_REST, CONTACT, Course
from robocasa_lerobot.demos.generate.sources.source import Stamp
from robocasa_lerobot.demos.motion import Array, action
from robocasa_lerobot.demos.recorder import SUCCESS_HOLD_STEPS
from robocasa_lerobot.demos.replay import Demonstration, demonstrations, read_demonstration
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.demos.stages import StageLog, StageOutcome
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.splits import expand
from robocasa_lerobot.errors import UserError

REPLAY = "replay"
_GRIPPER = contract.ACTION_SLICES["gripper_close"]


@lru_cache(maxsize=4)
def recorded(place: Path, stamp: Stamp) -> tuple[tuple[str, Demonstration], ...]:
    """The demonstrations of a file by their names; `stamp` is there so that a new one is read anew."""
    return tuple((f"{file.stem}/{demo}", read_demonstration(file, demo)) for file, demo in demonstrations([place]))


def check_scenes(found: Sequence[Demonstration], settings: RecordingSettings) -> None:
    """Whether the settings make the scenes of demonstrations again.

    Raises:
        UserError: they are of another task, split, kitchens or start of the robot, or no noise is asked for.
    """
    if settings.action_noise <= 0:
        raise UserError("--method replay repeats what was recorded: give --action-noise, as 0.05.")
    asked = {
        "task": settings.task,
        "split": settings.split,
        "layouts": _expanded(settings.layouts, "layout"),
        "styles": _expanded(settings.styles, "style"),
        "base_within_m": settings.start_within_m,
    }
    for one in found:
        has = {
            "task": one.task,
            "split": one.split,
            "layouts": one.meta.get("layouts"),
            "styles": one.meta.get("styles"),
            "base_within_m": float((one.meta.get("initial_noise") or {}).get("base_within_m", 0.0)),
        }
        for key, value in has.items():
            if value != asked[key]:
                raise UserError(
                    f"--method replay makes the sources' scenes again: {key} of one of them is {value}, but "
                    f"{asked[key]} is asked for. Give the options that the sources were recorded with."
                )


def replayed(env: KitchenEnv, log: StageLog, source: Demonstration, number: int, course: Course) -> Iterator[Array]:
    """Actions (12,), stored order, of a demonstration, and then so many of rest that its goal can be held.

    Raises:
        SkillError: they are over.
    """
    log.outcomes = [StageOutcome() for _ in env.declaration.stages]
    for step, wanted in enumerate(source.actions):
        if source.stage is not None:
            log.current = min(int(source.stage[step]), len(log.outcomes) - 1)
        course.label = (number, CONTACT, step)
        yield wanted
    course.label = AT_REST
    for _ in range(SUCCESS_HOLD_STEPS):
        yield action(gripper=float(source.actions[-1][_GRIPPER][0]))
    raise SkillError("all actions are carried out, and the goal does not hold")


def segment_of(name: str, number: int, source: Demonstration) -> dict[str, Any]:
    """What the episode says of where it comes from."""
    return {"source": name, "demo": number, "kind": REPLAY, "ref": "", "steps": [0, len(source.actions)]}


def digest_of_actions(found: Sequence[Demonstration]) -> str:
    """What tells one set of recorded demonstrations from another."""
    digest = hashlib.sha256()
    for one in found:
        digest.update(f"{one.task} {one.split} {one.seed}".encode())
        digest.update(np.ascontiguousarray(one.actions).tobytes())
    return digest.hexdigest()[:16]


def _expanded(ids: tuple[int, ...] | None, what: str) -> list[int] | None:
    """As an env notes them."""
    return None if ids is None else list(expand(ids, what))
