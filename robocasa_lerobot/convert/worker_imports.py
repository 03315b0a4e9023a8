"""What processes that convert import before their work, by name: the process that workers are forked from does it."""

from __future__ import annotations

import sys

LEAN_LEROBOT = "robocasa_lerobot.convert.lean_lerobot"


def worker_imports(module: str, lean: bool | None = None) -> tuple[str, ...]:
    """What workers import for the work of a module.

    The process that they are forked from stays as long as this one and serves whatever it does later, be it policies.

    Args:
        module: with their work.
        lean: whether LeRobot comes without what only its policies need (default: as in this process).
    """
    lean = LEAN_LEROBOT in sys.modules if lean is None else lean
    return (LEAN_LEROBOT, module) if lean else (module,)
