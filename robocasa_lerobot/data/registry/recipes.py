"""How our own demonstrators make a dataset of a registry: a recipe, as data, and which tasks there are to make."""

from __future__ import annotations

import functools
import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from robocasa_lerobot.errors import UnknownNameError, UserError

_NAMES = "robocasa_lerobot.demos.names"
IMAGE_SIZE = 128  # pixels: what the policies of the small experiments look at
REPLAY = "replay"
METHODS = ("contacts", "mimicgen", REPLAY)  # see `demos.generate.settings`


@dataclass
class RecipeConfig:
    """What `robocasa-lerobot data --make` records and converts, for each task of a dataset.

    Attributes:
        episodes: kind of dataset, which names its number of demonstrations in `episodes` of the registry.
        seed: of the first attempt; datasets of one split have ranges of their own, apart from evaluations' seeds.
        layouts: kitchens by layout; null is the split's own.
        styles: likewise by style.
        action_noise: standard deviation of noise on arm commands, as `demos --action-noise`.
        disturbances: up to how many times the hand is led astray on its way, as `demos --disturbances`; mixtures leave
            these frames out by `frames: interventions`.
        varied: each demonstration in a style of its own, as `demos` without `--plain`.
        image_size: height and width of the pictures, pixels.
        sources: so many demonstrations are recorded (no more than are asked for), and multiplied to as many as asked
            for, as `generate` does; null records all of them. A task that cannot be generated yet is recorded, too.
        method: how sources are multiplied, as `generate --method`; `replay` repeats them with `action_noise`.
        redraw: instead of recording: `path` of the registry's dataset whose episodes are drawn again.
        camera_set: of the cameras that `redraw` draws with, as `render --camera-set`.
        corrects: phase of the experiment that asks for the dataset; the policy that it has trained drives first, and
            demonstrators take over, as `correct` does it. What one seed's policy was corrected of serves all seeds.
        after: control steps between which it is drawn when they do, as `correct --after`; null is its default.
    """

    episodes: str = "human"
    seed: int = 0
    layouts: list[int] | None = None
    styles: list[int] | None = None
    action_noise: float = 0.0
    disturbances: int = 0
    varied: bool = True
    image_size: int = IMAGE_SIZE
    sources: int | None = None
    method: str = METHODS[0]
    redraw: str | None = None
    camera_set: str | None = None
    corrects: str | None = None
    after: list[int] | None = None

    def __post_init__(self) -> None:
        if (self.redraw is None) != (self.camera_set is None):
            raise UserError("recipe of a dataset: `redraw` and `camera_set` go together; one of them is missing.")
        if self.corrects is not None and (self.redraw is not None or self.sources is not None):
            other = "redraw" if self.redraw is not None else "sources"
            raise UserError(f"recipe of a dataset: `corrects` and `{other}` are two ways to make it; give one.")
        if self.disturbances and (self.corrects or self.redraw or self.sources):
            raise UserError("recipe of a dataset: `disturbances` are for demonstrations that are recorded anew.")
        if self.after is not None and (self.corrects is None or len(self.after) != 2):
            raise UserError(f"recipe of a dataset: `after` is {self.after}; it takes two steps, with `corrects`.")
        if self.sources is not None and self.sources < 1:
            raise UserError(f"recipe of a dataset: `sources` is {self.sources}; it takes one at least, or null.")
        if self.method not in METHODS:
            raise UnknownNameError("method of a dataset's recipe", self.method, METHODS)
        if self.method != METHODS[0] and self.sources is None:
            raise UserError(f"recipe of a dataset: method {self.method} multiplies `sources`; say how many.")

    def sources_for(self, demonstrations: int) -> int:
        """How many are recorded to make so many of them; 0 where none is multiplied."""
        return 0 if self.sources is None else min(self.sources, demonstrations)


@functools.cache
def demonstrated_tasks() -> frozenset[str]:
    """Names of the tasks that a demonstrator of this installation can solve.

    The simulator is asked in a process of its own, which takes a second: datasets know nothing of simulators.

    Raises:
        UserError: it did not answer; its own message stands in it.
    """
    here = str(Path(__file__).parents[2])  # this very code answers, wherever it was imported from
    path = os.pathsep.join(filter(None, (here, os.environ.get("PYTHONPATH"))))
    environment = {**os.environ, "PYTHONPATH": path}
    command = [sys.executable, "-m", _NAMES]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    if done.returncode:
        said = (done.stderr.strip().splitlines() or ["nothing"])[-1]
        raise UserError(
            f"`python -m {_NAMES}` ended with status {done.returncode}: {said}; try `robocasa-lerobot tasks`."
        )
    return frozenset(json.loads(done.stdout.splitlines()[-1]))
