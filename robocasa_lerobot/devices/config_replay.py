"""Settings of the teleoperator that repeats demonstrations: `--teleop.type=robocasa_replay --teleop.demos=FILE`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lerobot.teleoperators.config import TeleoperatorConfig


@TeleoperatorConfig.register_subclass("robocasa_replay")
@dataclass(kw_only=True)
class RobocasaReplayConfig(TeleoperatorConfig):
    """Which demonstrations.

    Attributes:
        demos: file or folder that `robocasa-lerobot demos` or `teleop` wrote. The first recorded episode repeats
            its first demonstration, and so on; after the last one the first comes again.
    """

    demos: Path
