"""Kitchens, robot, tasks: the MuJoCo side. Knows no torch.

Importing this package makes the tasks known to Gymnasium: `gymnasium.make("robocasa_lerobot/OpenDrawer")`.
"""

import gymnasium

from robocasa_lerobot.envs.registry import get_task, task_names

__all__ = ["get_task", "task_names"]

NAMESPACE = "robocasa_lerobot"

for _name in task_names():
    if f"{NAMESPACE}/{_name}" not in gymnasium.registry:
        gymnasium.register(
            f"{NAMESPACE}/{_name}", entry_point="robocasa_lerobot.envs.kitchen_env:KitchenEnv", kwargs={"task": _name}
        )
