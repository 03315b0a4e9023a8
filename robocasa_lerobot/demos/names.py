"""`python -m robocasa_lerobot.demos.names`: names of the tasks that a demonstrator can solve, as one line of JSON.

What knows nothing of simulators, such as the registry of datasets, asks by this command, in a process of its own.
"""

from __future__ import annotations

import json


def main() -> None:
    """Print the names."""
    from robocasa_lerobot.demos.demonstrator import can_demonstrate
    from robocasa_lerobot.envs.tasks.registry import get_task, task_names

    print(json.dumps([name for name in task_names() if can_demonstrate(get_task(name))]))


if __name__ == "__main__":
    main()
