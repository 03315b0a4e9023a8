"""Attempts at demonstrations: each leaves one small file, which is how a killed recording goes on where it was.

Attempt i of a task uses seed `seed + i`; a file of demonstrations holds the first successes in this order. So it is
the same for any number of workers and after any interruption.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robocasa_lerobot import contract
from robocasa_lerobot.demos.demonstrator import demonstrate
from robocasa_lerobot.demos.failures import film_of, keep_failure
from robocasa_lerobot.demos.hdf5 import Failure, recorded_otherwise, segments_of, versions, write_part
from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.demos.motion_style import MotionStyle
from robocasa_lerobot.demos.recorder import Actor, Recording, record_episode
from robocasa_lerobot.demos.stages import StageLog
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.reset_noise import InitialNoise
from robocasa_lerobot.envs.seeds import SEEDS, is_seed
from robocasa_lerobot.errors import OF_THE_MACHINE, UserError
from robocasa_lerobot.files import write_text
from robocasa_lerobot.jobs.pool import exit_if_orphaned

# Give up when this many attempts per wanted episode were not enough, or when none of the first ones has succeeded.
MAX_ATTEMPTS_PER_EPISODE, HOPELESS = 10, 20
_ENOUGH_FOR_A_RATE = 10


class BrokenAttemptError(Exception):
    """An attempt that raised, with what is known of it: see `Failure`."""

    def __init__(self, cause: Exception, scene: int | None, segments: tuple[tuple[str, str], ...]) -> None:
        self.scene, self.segments = scene, segments
        super().__init__(f"{type(cause).__name__}: {cause}")


@dataclass(frozen=True)
class RecordingSettings:
    """What a file of demonstrations is made from.

    Attributes:
        task: name.
        episodes: successes wanted.
        split: of the kitchens.
        seed: of the first attempt.
        action_noise: see `record_episode`.
        images: whether camera pictures are stored.
        image_size: of those pictures, pixels.
        layouts: ids of layouts or of groups of them; None takes the split's own.
        styles: the same for styles.
        varied: whether each demonstration has a style of its own (`demos.motion_style`).
        start_within_m: the robot starts anywhere within so many metres of the task's own start, at any heading.
    """

    task: str
    episodes: int
    split: str = "target"
    seed: int = 0
    action_noise: float = 0.0
    images: bool = False
    image_size: int = 256
    layouts: tuple[int, ...] | None = None
    styles: tuple[int, ...] | None = None
    varied: bool = True
    start_within_m: float = 0.0

    def env_kwargs(self) -> dict[str, Any]:
        """Arguments of the env, for the file's `env_args`."""
        chosen = {key: getattr(self, key) for key in ("layouts", "styles") if getattr(self, key) is not None}
        return {"split": self.split, "image_size": self.image_size, "render_preset": "fast", **chosen}

    def identity(self) -> dict[str, Any]:
        """What attempts depend on: parts recorded under other values are not reused. `episodes` is not among it."""
        values = {
            field.name: getattr(self, field.name) for field in dataclasses.fields(self) if field.name != "episodes"
        }
        return {key: list(value) if isinstance(value, tuple) else value for key, value in values.items()}

    def check(self) -> None:
        """Whether attempts can be made at all.

        Raises:
            UnknownNameError: no such task, split, layout or style.
            UserError: no episode is wanted, or the seed is one that no scene can have.
        """
        self.make_env()
        if self.episodes < 1:
            raise UserError(f"episodes ({self.episodes}) must be at least 1.")
        if not (is_seed(self.seed) and is_seed(self.seed + self.limit - 1)):
            raise UserError(
                f"seed {self.seed}: {self.episodes} episodes may take {self.limit} attempts, with seeds from there on; "
                f"each is to be {SEEDS}. Choose such a --seed."
            )
        if not 0.0 <= self.action_noise < math.inf:
            raise UserError(f"action_noise: found {self.action_noise}, expected a number of at least 0.")

    @property
    def limit(self) -> int:
        """The greatest number of attempts."""
        return self.episodes * MAX_ATTEMPTS_PER_EPISODE

    def check_ready(self) -> None:
        """Whether what attempts need besides a seed is there; what is raised ends the run, and is no failed attempt."""

    def record(self, env: KitchenEnv, seed: int) -> Recording:
        """Make the attempt of a seed."""
        return self.labelled_episode(env, seed, demonstrate)

    def labelled_episode(
        self,
        env: KitchenEnv,
        seed: int,
        actor: Actor,
        noise_seed: int | None = None,
        clean: Sequence[Array] | None = None,
        styled: bool = True,
    ) -> Recording:
        """An episode of an actor's; where noise comes to its actions, what it wanted is kept beside them.

        An actor with noise of its own says what it wanted in `clean`, which it fills as it goes. For one that follows
        no style, `styled` is False.
        """
        yielded: list[Array] = []

        def noted(env: KitchenEnv, style: MotionStyle, log: StageLog) -> Iterator[Array]:
            for wanted in actor(env, style, log):
                yielded.append(wanted.copy())
                yield wanted

        recording = record_episode(
            env,
            seed,
            action_noise=self.action_noise,
            images=self.images,
            varied=self.varied and styled,
            actor=noted,
            noise_seed=noise_seed,
        )
        if clean is not None or self.action_noise > 0.0:
            kept = (yielded if clean is None else clean)[: len(recording.actions)]
            recording.per_step[contract.CLEAN_ACTION] = np.array([_as_executed(wanted) for wanted in kept])
        return recording

    def attempt_kwargs(self) -> dict[str, Any]:
        """Arguments of the env that attempts are made in, beyond the file's: nothing is rendered that is not stored."""
        return {} if self.images else {"cameras": ()}

    def make_env(self) -> KitchenEnv:
        """The env that attempts are made in."""
        kwargs = {**self.env_kwargs(), **self.attempt_kwargs()}
        noise = InitialNoise(base_within_m=self.start_within_m) if self.start_within_m else None
        return KitchenEnv(self.task, terminate_on_success=False, initial_noise=noise, **kwargs)


def _as_executed(wanted: Array) -> Array:
    """An action (12,) of an actor's as it is executed where no noise comes to it, in the order of HDF5 files."""
    return contract.stored_to_hdf5(contract.binarize(np.clip(wanted, -1.0, 1.0)))


@dataclass(frozen=True)
class Tally:
    """How far the attempts at a task are.

    Attributes:
        chosen: the first successes among attempts 0, 1, 2, ... without a gap, no more than are wanted.
        tried: how many attempts that took.
        failures: those of them that failed.
        done: every attempt that has ended, and whether it succeeded.
    """

    chosen: list[int]
    tried: int
    failures: list[Failure]
    done: dict[int, bool]

    @property
    def rate(self) -> float:
        """Share of the attempts that have ended which succeeded; 0 where none has."""
        return sum(self.done.values()) / max(len(self.done), 1)


class Parts:
    """The folder of what a task's attempts have left.

    Args:
        out: the folder that the file of demonstrations comes to.
        settings: of the recording.
        films: folder for the films of failures; None keeps nothing.
    """

    def __init__(self, out: Path, settings: RecordingSettings, films: Path | None = None) -> None:
        self.folder = out / f".{settings.task}.parts"
        self.settings = settings
        self.films = films
        self._failures: dict[str, Failure] = {}  # notes that have been read: there may be thousands of them

    def prepare(self) -> None:
        """Make the folder, dropping one of other settings or versions in which nothing has succeeded.

        Raises:
            UserError: it holds demonstrations that were recorded with other settings, or under other versions.
        """
        note = self.folder / "settings.json"
        found = json.loads(note.read_text()) if note.exists() else {}
        others = recorded_otherwise(found, self.settings.identity(), versions())
        if self.folder.exists() and others:
            kept = len(list(self.folder.glob("[0-9]*.hdf5")))
            if kept:
                raise UserError(
                    f"{self.folder} holds {kept} demonstration(s) of an interrupted recording with {others} it, "
                    "remove the folder, or choose another --out."
                )
            shutil.rmtree(self.folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        write_text(note, json.dumps({**self.settings.identity(), **versions()}))

    def episode(self, attempt: int) -> Path:
        """File of an attempt that succeeded."""
        return self.folder / f"{attempt:06d}.hdf5"

    def tally(self) -> Tally:
        """Read what there is. A failure that is to be kept counts only when it has been."""
        found: dict[int, Failure | None] = {}
        for name in os.listdir(self.folder) if self.folder.is_dir() else ():  # noqa: PTH208 names, of thousands of files
            stem, _, kind = name.partition(".")
            if not stem.isdecimal():
                continue
            if kind == "hdf5":
                found[int(stem)] = None
            elif kind == "json":
                failure = self._failure(name)
                if self.films is None or film_of(self.films, failure.seed).exists():
                    found.setdefault(int(stem), failure)
        chosen: list[int] = []
        failures: list[Failure] = []
        attempt = 0
        while attempt in found and len(chosen) < self.settings.episodes:
            failed = found[attempt]
            if failed is None:
                chosen.append(attempt)
            else:
                failures.append(failed)
            attempt += 1
        return Tally(chosen, attempt, failures, {number: failed is None for number, failed in found.items()})

    def _failure(self, name: str) -> Failure:
        if name not in self._failures:
            self._failures[name] = Failure.of(json.loads((self.folder / name).read_text()))
        return self._failures[name]

    def most(self, tally: Tally) -> int:
        """The greatest number of attempts as far as is known: where none has succeeded, the task may be hopeless."""
        limit = self.settings.limit
        return limit if any(tally.done.values()) else min(limit, HOPELESS)

    def wanted(self, tally: Tally) -> list[int]:
        """The attempts to make next: those that were jumped over, and as many as may be needed beyond."""
        done = tally.done
        top = max(done, default=-1) + 1
        gaps = [number for number in range(top) if number not in done]
        missing = self.settings.episodes - sum(done.values()) - len(gaps)
        if len(done) >= _ENOUGH_FOR_A_RATE:
            missing = math.ceil(missing / max(tally.rate, 0.1))
        return [*gaps, *range(top, min(top + max(missing, 0), self.most(tally)))]

    def gave_up(self, tally: Tally) -> str:
        """Why no more attempts are made, or "" if they are."""
        settings = self.settings
        hopeless = tally.tried >= HOPELESS and not any(tally.done.get(number) for number in range(HOPELESS))
        if len(tally.chosen) == settings.episodes or not (hopeless or tally.tried >= settings.limit):
            return ""
        last = tally.failures[-1].reason if tally.failures else ""
        remedies = ["fewer episodes", "less --action-noise"]
        # Kitchens that were chosen may be none that the task can be set up in.
        remedies += [f"other --{what}" for what in ("layouts", "styles") if getattr(settings, what) is not None]
        return (
            f"{settings.task}: {len(tally.chosen)} of {settings.episodes} episodes succeeded in {tally.tried} attempts "
            f"(last failure: {last}). Ask for {', '.join(remedies)}, or another --seed."
        )

    def attempt(self, number: int, env: KitchenEnv) -> None:
        """Make one attempt, and leave its file.

        An unforeseen error of a skill must not end a recording of thousands: that attempt failed.
        """
        exit_if_orphaned()
        settings = self.settings
        settings.check_ready()
        seed = settings.seed + number
        recording: Recording | None = None
        try:
            recording = settings.record(env, seed)
        except OF_THE_MACHINE:
            raise
        except BrokenAttemptError as error:
            failure = Failure(seed, str(error), scene=error.scene, segments=error.segments)
        except Exception as error:
            failure = Failure(seed, f"{type(error).__name__}: {error}")
        else:
            if recording.success:
                write_part(self.episode(number), recording)
                return
            scene = None if recording.seed == seed else recording.seed
            failure = Failure(seed, recording.reason, recording.false_terms, scene, segments_of(recording.ep_meta))
        if self.films is not None:
            keep_failure(self.films, env, failure, recording)
        note = self.folder / f"{number:06d}.json"
        write_text(note, json.dumps(dataclasses.asdict(failure)))
