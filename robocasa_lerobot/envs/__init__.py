"""Kitchens, robot, tasks: the MuJoCo side. Knows no torch.

Importing this package makes the tasks known to Gymnasium: `gymnasium.make("robocasa_lerobot/OpenDrawer")`, and
`gymnasium.make_vec` with the arguments of `vector.kitchens.make_vector_env`. Their declarations are imported when one
is asked for: what only draws states, as the converter does, needs none.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium

from robocasa_lerobot.benchmark.tasks import task_facts

if TYPE_CHECKING:
    from robocasa_lerobot.envs.tasks.registry import get_task, task_names

__all__ = ["get_task", "task_names"]

NAMESPACE = "robocasa_lerobot"

for _name in sorted(task_facts()):
    if f"{NAMESPACE}/{_name}" not in gymnasium.registry:
        gymnasium.register(
            f"{NAMESPACE}/{_name}",
            entry_point="robocasa_lerobot.envs.kitchen_env:KitchenEnv",
            vector_entry_point="robocasa_lerobot.envs.vector.kitchens:make_vector_env",
            kwargs={"task": _name},
        )

if not TYPE_CHECKING:  # which would take any name for one that is there

    def __getattr__(name: str) -> Any:
        if name not in __all__:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from robocasa_lerobot.envs.tasks import registry

        return getattr(registry, name)
