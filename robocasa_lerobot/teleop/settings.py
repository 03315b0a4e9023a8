"""What a session of driving by hand is asked for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robocasa_lerobot.errors import UserError

PICTURE_QUALITY = 80  # of JPEG: 37 kB for three pictures of 256x256
STALE_S = 0.5  # without an acknowledged picture, after which time stands
EXPIRES_S = 0.25  # of an input that nobody repeats
LONGEST_STEPS = 20_000  # of an episode; its states are kept for undoing, 17 kB each


@dataclass(frozen=True)
class TeleopSettings:
    """A session.

    Attributes:
        task: name.
        out: folder that gets `<task>.hdf5` and `teleop-stats.json`.
        split: of the kitchens.
        episodes: saved ones wanted, with those of earlier sessions.
        seed: of the first kitchen; kitchen i has `seed + i`.
        layouts, styles: ids, instead of the split's own.
        image_size: of the pictures, pixels.
        render_preset: "fast" or "quality".
        operator: name that is written into each episode, or "".
        hide_goal: do not tell whether the goal's terms hold.
        policy: name of the policy that drives where nobody intervenes, or "".
        free_view: address of MuJoCo's own viewer, or "".
    """

    task: str
    out: Path
    split: str = "target"
    episodes: int = 20
    seed: int = 0
    layouts: tuple[int, ...] | None = None
    styles: tuple[int, ...] | None = None
    image_size: int = 256
    render_preset: str = "fast"
    operator: str = ""
    hide_goal: bool = False
    policy: str = ""
    free_view: str = ""

    def __post_init__(self) -> None:
        if self.episodes < 1 or self.image_size < 16:
            raise UserError(f"episodes ({self.episodes}) must be at least 1, image_size ({self.image_size}) 16.")
        if self.seed < 0:
            raise UserError(f"seed: found {self.seed}, expected a number from 0 on.")

    def env_kwargs(self) -> dict[str, Any]:
        """Arguments of the env, for the file's `env_args`."""
        chosen = {key: getattr(self, key) for key in ("layouts", "styles") if getattr(self, key) is not None}
        return {"split": self.split, "image_size": self.image_size, "render_preset": self.render_preset, **chosen}

    def identity(self) -> dict[str, Any]:
        """What kitchens and kinds of episodes depend on: those recorded under other values are not mixed in."""
        ids = {key: None if (v := getattr(self, key)) is None else list(v) for key in ("layouts", "styles")}
        # Without a policy nothing says who decided each step: among episodes that do, conversion would leave it out.
        driven = {"with_policy": True} if self.policy else {}
        return {"recorded_by": "teleop", "task": self.task, "split": self.split, "seed": self.seed, **ids, **driven}
