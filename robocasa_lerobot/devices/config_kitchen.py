"""Settings of the kitchen as a LeRobot robot: `--robot.type=robocasa_kitchen`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lerobot.robots.config import RobotConfig

from robocasa_lerobot import contract


@RobotConfig.register_subclass("robocasa_kitchen")
@dataclass(kw_only=True)
class RobocasaKitchenConfig(RobotConfig):
    """Which kitchen, and what comes after it.

    Attributes:
        task: name of a registered task.
        split: of the kitchens, "target" or "pretrain".
        seed: of the first kitchen.
        demos: file or folder of recorded demonstrations; the kitchens are then theirs, in order, instead of `seed`'s.
        next_kitchen: each recorded episode has a kitchen of its own (`seed`, `seed` + 1, ...), except one that is
            recorded again. With False they all start in the first one.
        render_preset: "fast" or "quality".
        image_size: height and width of the pictures, pixels.
        suffix: ending of all names of state and action. `lerobot-rollout` leaves out those that end neither in ".pos"
            nor in ".vel", and drives back to where ".pos" were at its start: it needs ".vel".
        realtime: carry out at most 20 actions a second, as a real robot does, whoever sends them.
    """

    task: str = "OpenDrawer"
    split: str = "pretrain"
    seed: int = 0
    demos: Path | None = None
    next_kitchen: bool = True
    render_preset: str = "fast"
    image_size: int = contract.IMAGE_SIZE
    suffix: str = ""
    realtime: bool = True
