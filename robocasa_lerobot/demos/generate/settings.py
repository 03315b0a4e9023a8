"""How demonstrations are generated: the settings of a recording, and those of the sources and what is made of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robocasa_lerobot.demos.attempts import RecordingSettings
from robocasa_lerobot.demos.generate.course import KINDS, Course
from robocasa_lerobot.demos.generate.select import Manner
from robocasa_lerobot.demos.generate.sources.source import Source, digest_of, first_of_each_task, sources_of
from robocasa_lerobot.demos.generate.stage import generated
from robocasa_lerobot.demos.recorder import Recording
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.errors import UserError

_CHOICE_STREAM = 7  # of the choices among sources, apart from those of scene, arm, noise and style


@dataclass(frozen=True)
class GenerationSettings(RecordingSettings):
    """What a file of generated demonstrations is made from.

    Attributes:
        source: file or folder of prepared demonstrations.
        sources: what they are, as `digest_of` says it.
        select, base, bridge: see `Manner`.
        rules: how stages are cut, where that is not derived: JSON of what `rules.rules_from` takes.
        spread: cost that each source has at random in an attempt: the greater, the more evenly they are used.
        first_sources: of each task only so many, the first ones; 0 takes all.
        cap: share of all segments that one source should have at most; 1 takes whichever fits best.
    """

    source: str = ""
    sources: str = ""
    select: str = "feasible"
    base: str = "replan"
    bridge: str = "plan"
    rules: str = "{}"
    spread: float = 0.3
    cap: float = 0.2
    first_sources: int = 0

    @classmethod
    def of(cls, source: Path, **values: Any) -> GenerationSettings:
        """With the sources looked at.

        Raises:
            UserError: none is prepared, or they are seeds of the attempts.
        """
        settings = cls(source=str(source), **values)
        found = settings.read()
        clash = sorted(one.seed for one in found if 0 <= one.seed - settings.seed < settings.limit)
        if clash and values.get("split") is not None:
            raise UserError(
                f"{settings.task}: sources come from seeds {clash[:5]}, which are among the attempts' from "
                f"{settings.seed} on. Choose another --seed, so that nothing is generated in a source's own scene."
            )
        return cls(source=str(source), sources=digest_of(found), **values)

    def read(self) -> list[Source]:
        """The sources."""
        found = sources_of(self.folder, self.task, self.rules)
        return first_of_each_task(found, self.first_sources) if self.first_sources else found

    @property
    def folder(self) -> Path:
        """That the sources lie in, or the file."""
        return Path(self.source)

    def identity(self) -> dict[str, Any]:
        """What attempts depend on: the sources themselves, wherever they lie."""
        return {key: value for key, value in super().identity().items() if key != "source"}

    def record(self, env: KitchenEnv, seed: int) -> Recording:
        """Make the attempt of a seed."""
        sources = self.read()
        manner = Manner(self.select, self.base, self.bridge)
        course = Course(sources, np.random.default_rng([seed, _CHOICE_STREAM]), manner, self.spread, self.cap)
        recording = self.labelled_episode(env, seed, lambda env, style, log: generated(env, style, log, course))
        return labelled(recording, course)


def labelled(recording: Recording, course: Course) -> Recording:
    """With where each step comes from, under MimicGen's names and ours."""
    labels = np.array(course.labels[: len(recording.actions)], dtype=np.int64).reshape(-1, 3)
    recording.per_step |= {
        "src_demo_labels": labels[:, :1],
        "segment_kind": labels[:, 1],
        "src_step": labels[:, 2],
        "src_demo_inds": np.array([row["demo"] for row in course.used], dtype=np.int64),
    }
    recording.ep_meta["generation"] = {"segments": course.used, "segment_kinds": list(KINDS)}
    return recording
