"""How demonstrations are generated: the settings of a recording, and those of the sources and what is made of them."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from robocasa_lerobot.demos.attempts import BrokenAttemptError, RecordingSettings
from robocasa_lerobot.demos.generate.course import KINDS, Course
from robocasa_lerobot.demos.generate.mimicgen.plain import Sources, plain_episode, read_sources, suited
from robocasa_lerobot.demos.generate.mimicgen.subtasks import datagen_of, digest_of_infos
from robocasa_lerobot.demos.generate.mimicgen.template import derived_template, template_from
from robocasa_lerobot.demos.generate.replays import (
    REPLAY,
    check_scenes,
    digest_of_actions,
    recorded,
    replayed,
    segment_of,
)
from robocasa_lerobot.demos.generate.select import Manner
from robocasa_lerobot.demos.generate.sources.source import (
    Source,
    Stamp,
    UnfitSourcesError,
    digest_of,
    first_of_each_task,
    place_of,
    sources_of,
    stamp_of,
)
from robocasa_lerobot.demos.generate.stage import generated
from robocasa_lerobot.demos.hdf5 import segments_of
from robocasa_lerobot.demos.motion_style import PLAIN
from robocasa_lerobot.demos.recorder import Recording
from robocasa_lerobot.demos.replay import Demonstration
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.errors import OF_THE_MACHINE, LackingMachineError, UserError

MIMICGEN = "mimicgen"
_CHOICE_STREAM = 7  # of the choices among sources, apart from those of scene, arm, noise and style


@dataclass(frozen=True)
class GenerationSettings(RecordingSettings):
    """What a file of generated demonstrations is made from.

    Attributes:
        source: file or folder of prepared demonstrations.
        sources: what they are, as `digest_of` says it.
        method: `contacts` carries contacts over and plans the rest; `mimicgen` carries whole subtasks over, joined by
            lines, the base at rest; `replay` repeats the sources' own actions in their own scenes, one after the other,
            with the noise of the attempt's seed.
        template: of `mimicgen`, what its subtasks are: JSON of one of MimicGen's templates; empty derives them.
        select, base, bridge: see `Manner`; of `contacts`.
        rules: how stages are cut, where that is not derived: JSON of what `rules.rules_from` takes.
        spread: cost that each source has at random in an attempt: the greater, the more evenly they are used.
        first_sources: of each task only so many, the first ones; 0 takes all.
        cap: share of all segments that one source should have at most; 1 takes whichever fits best.
    """

    source: str = ""
    sources: str = ""
    method: str = "contacts"
    template: str = ""
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
            UnfitSourcesError: none is prepared, no subtask can be derived from them, or they do not suit the template.
            UserError: they are seeds of the attempts, or their scenes are not made again; or a number is none that it
                could be.
        """
        settings = cls(source=str(source), **values)
        for name, number, fits, expected in (
            ("cap", settings.cap, 0.0 < settings.cap <= 1.0, "a share above 0 and up to 1, as 0.2"),
            ("spread", settings.spread, 0.0 <= settings.spread < np.inf, "a cost of 0 or more"),
            ("first-sources", settings.first_sources, settings.first_sources >= 0, "a number of sources, or 0 for all"),
        ):
            if not fits:
                raise UserError(f"--{name} is {number}, expected {expected}.")
        if settings.method == REPLAY:
            check_scenes([one for _, one in settings.recorded()], settings)
            return cls(source=str(source), sources=settings.identified()[1], **values)
        if settings.method == MIMICGEN:
            settings.subtasks()  # mistakes come up here
        seeds, digest = settings.identified()
        clash = sorted(seed for seed in seeds if 0 <= seed - settings.seed < settings.limit)
        if clash and values.get("split") is not None:
            raise UserError(
                f"{settings.task}: sources come from seeds {clash[:5]}, which are among the attempts' from "
                f"{settings.seed} on. Choose another --seed, so that nothing is generated in a source's own scene."
            )
        return cls(source=str(source), sources=digest, **values)

    def identified(self) -> tuple[list[int], str]:
        """Seeds of the sources' scenes, and what tells this set of sources from another.

        Raises:
            UserError: they cannot be read, or are none.
        """
        return _identified(self, stamp_of(place_of(self.folder, self.task)))

    def check_ready(self) -> None:
        """Whether the sources are those that this began with.

        Raises:
            LackingMachineError: they are others, or cannot be read.
        """
        try:
            _, digest = self.identified()
        except UserError as error:
            raise LackingMachineError(
                f"the sources cannot be read any more: {error} With these in place the same command goes on."
            ) from error
        if self.sources and digest != self.sources:
            raise LackingMachineError(
                f"{self.folder} holds other sources of {self.task} than when this began; with those in place the same "
                "command goes on. What is generated from these needs another --out."
            )

    def read(self) -> list[Source]:
        """The sources."""
        found = sources_of(self.folder, self.task, self.rules)
        return first_of_each_task(found, self.first_sources) if self.first_sources else found

    def subtasks(self) -> Sources:
        """The sources as MimicGen reads them.

        Raises:
            UnfitSourcesError: one does not suit the template, they are other tasks', or none can be derived.
        """
        if self.template:
            place = place_of(self.folder, self.task)
            return read_sources(place, template_from(json.loads(self.template)), self.first_sources, stamp_of(place))
        found = self.read()
        if others := sorted({source.task for source in found} - {self.task}):
            raise UnfitSourcesError(
                f"{self.folder} has no sources of {self.task}, but of {', '.join(others[:3])}: whole subtasks are "
                "carried over from demonstrations of the same task. Record and prepare some, or leave --method out."
            )
        template, alike = derived_template(found)
        return suited(template, (datagen_of(number, source) for number, source in enumerate(alike)))

    def recorded(self) -> list[tuple[str, Demonstration]]:
        """The task's own demonstrations as they were recorded, by their names."""
        place = place_of(self.folder, self.task)
        found = list(recorded(place, stamp_of(place)))
        return found[: self.first_sources] if self.first_sources else found

    @property
    def folder(self) -> Path:
        """That the sources lie in, or the file."""
        return Path(self.source)

    def identity(self) -> dict[str, Any]:
        """What attempts depend on: the sources themselves, wherever they lie."""
        return {key: value for key, value in super().identity().items() if key != "source"}

    def record(self, env: KitchenEnv, seed: int) -> Recording:
        """Make the attempt of a seed.

        Raises:
            BrokenAttemptError: it raised.
        """
        course = self._course(seed)
        try:
            return labelled(self._episode(env, seed, course), course)
        except OF_THE_MACHINE:
            raise
        except Exception as error:
            scene = self._replayed_in_turn(seed)[2].seed if self.method == REPLAY else None
            begun = segments_of({"generation": {"segments": course.used}})
            raise BrokenAttemptError(error, scene, begun) from error

    def _course(self, seed: int) -> Course:
        rng = np.random.default_rng([seed, _CHOICE_STREAM])
        if self.method == MIMICGEN:
            return Course([], rng, Manner("random", "fixed", "line"), self.spread)
        if self.method == REPLAY:
            return Course([], rng, Manner(), self.spread)
        return Course(self.read(), rng, Manner(self.select, self.base, self.bridge), self.spread, self.cap)

    def _episode(self, env: KitchenEnv, seed: int, course: Course) -> Recording:
        if self.method == MIMICGEN:
            subtasks = self.subtasks()
            noisy = any(one.action_noise > 0.0 for one in subtasks.template.subtasks)
            recording = self.labelled_episode(
                env,
                seed,
                lambda env, style, log: course.counted(plain_episode(env, log, subtasks, course)),
                clean=course.clean if noisy else None,
                styled=False,  # subtasks are carried over as they are
            )
            if noisy:  # beside the noise that comes to every action
                of_subtasks = [one.action_noise for one in subtasks.template.subtasks]
                recording.ep_meta["action_noise"] = float(np.hypot(self.action_noise, max(of_subtasks)))
                recording.ep_meta["subtask_noise"] = of_subtasks
            return recording
        if self.method == REPLAY:
            number, name, source = self._replayed_in_turn(seed)
            course.used.append(segment_of(name, number, source))
            recording = self.labelled_episode(
                env, source.seed, lambda env, _, log: course.counted(replayed(env, log, source, number, course)), seed
            )
            recording.ep_meta["motion_style"] = source.meta.get("motion_style", asdict(PLAIN))  # as its actions have it
            return recording
        return self.labelled_episode(env, seed, lambda env, style, log: generated(env, style, log, course))

    def _replayed_in_turn(self, seed: int) -> tuple[int, str, Demonstration]:
        """Number, name and content of the source that the attempt of a seed repeats: each has its turn."""
        found = self.recorded()
        number = (seed - self.seed) % len(found)
        return number, *found[number]


@lru_cache(maxsize=8)
def _identified(settings: GenerationSettings, stamp: Stamp) -> tuple[list[int], str]:
    """See `identified`; `stamp` is there so that sources that changed are looked at again."""
    if settings.method == REPLAY:
        own = [one for _, one in settings.recorded()]
        return [one.seed for one in own], digest_of_actions(own)
    if settings.method == MIMICGEN and settings.template:  # of files that others have prepared
        infos = settings.subtasks().infos
        return [one.seed for one in infos], digest_of_infos(infos)
    found = settings.read()
    return [one.seed for one in found], digest_of(found)


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
