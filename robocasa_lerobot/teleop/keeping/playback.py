"""Going through recorded states: backwards while a key is held, forwards when an episode is looked at again."""

from __future__ import annotations

from dataclasses import dataclass

from robocasa_lerobot.teleop.settings import EXPIRES_S


@dataclass
class Rewinding:
    """Backwards from the end, until the key is let go.

    Attributes:
        position: step that is shown, with what is left of slow speeds.
        speed: steps for each tick.
        until: when it ends unless the key is still held, seconds.
    """

    position: float
    speed: float
    until: float

    @property
    def step(self) -> int:
        """The step that is shown."""
        return int(self.position)

    def hold(self, speed: float, now: float) -> None:
        """The key is still held."""
        self.speed, self.until = speed, now + EXPIRES_S

    def next(self, now: float) -> int | None:
        """The step to show at this tick; None where the key has been let go."""
        if now >= self.until:
            return None
        self.position = max(self.position - self.speed, 0.0)
        return self.step


@dataclass
class Playback:
    """An episode of some steps, looked at again; its last state comes after the last step.

    Attributes:
        steps: of the episode.
        position: step that is shown.
        speed: steps for each tick.
        playing: whether it goes on by itself.
    """

    steps: int
    position: float = 0.0
    speed: float = 1.0
    playing: bool = False

    def __post_init__(self) -> None:
        self.position = float(self.steps)

    @property
    def step(self) -> int:
        """The step that is shown."""
        return int(self.position)

    def set(self, play: bool | None, speed: float | None, seek: int | None) -> None:
        """Play or hold, at a speed, from a step; playing from the end begins anew."""
        self.speed = self.speed if speed is None else speed
        self.playing = self.playing if play is None else play
        if seek is not None:
            self.position = float(min(seek, self.steps))
        elif play and self.step >= self.steps:
            self.position = 0.0

    def next(self) -> int | None:
        """The step to show at this tick; None where nothing changes."""
        if not self.playing:
            return None
        self.position = min(self.position + self.speed, float(self.steps))
        self.playing = self.step < self.steps
        return self.step
