"""Kitchens, robot, tasks: the MuJoCo side. Knows no torch.

Importing this package makes the tasks known to Gymnasium: `gymnasium.make("robocasa_lerobot/OpenDrawer")`, and
`gymnasium.make_vec` with the arguments of `vector.kitchens.make_vector_env`.
"""

import gymnasium

from robocasa_lerobot.envs.tasks.registry import get_task, task_names

__all__ = ["get_task", "task_names"]

NAMESPACE = "robocasa_lerobot"

for _name in task_names():
    if f"{NAMESPACE}/{_name}" not in gymnasium.registry:
        gymnasium.register(
            f"{NAMESPACE}/{_name}",
            entry_point="robocasa_lerobot.envs.kitchen_env:KitchenEnv",
            vector_entry_point="robocasa_lerobot.envs.vector.kitchens:make_vector_env",
            kwargs={"task": _name},
        )
