"""What LeRobot's discovery imports: `--env.discover_packages_path=robocasa_lerobot.plugins`.

Importing this package registers our env and policy types with LeRobot. The first-level submodules do the
work, so that LeRobot's loader, which imports exactly those, and a plain `import` come to the same.
"""

from robocasa_lerobot.plugins import registrations

__all__ = ["registrations"]
