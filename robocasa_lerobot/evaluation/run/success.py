"""When a trial counts as solved: at any step, after holding for some time, or at its end."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class SuccessRule:
    """Follows the goal through one trial.

    Args:
        rule: "any_step", "hold" or "at_end".
        hold_steps: control steps in a row for which the goal must hold ("hold").
    """

    rule: str = "any_step"
    hold_steps: int = 1
    _held: int = field(default=0, init=False)
    _since: int | None = field(default=None, init=False)
    _reached: int | None = field(default=None, init=False)

    def note(self, step: int, met: bool) -> bool:
        """Whether the trial is decided, after a step (from 1) after which the goal was or was not met."""
        self._held = self._held + 1 if met else 0
        self._since = (self._since or step) if met else None
        if self.rule != "at_end" and self._reached is None and self._held >= self.needed_steps:
            self._reached = step
        return self._reached is not None

    @property
    def needed_steps(self) -> int:
        """Steps in a row that make a success."""
        return self.hold_steps if self.rule == "hold" else 1

    @property
    def ends_early(self) -> bool:
        """Whether the env may end its episode at the first step at which the goal holds."""
        return self.rule == "any_step" or (self.rule == "hold" and self.hold_steps == 1)

    def success_step(self) -> int | None:
        """The step at which the trial was solved; with "at_end" since when the goal held. None if it was not."""
        return self._since if self.rule == "at_end" else self._reached
